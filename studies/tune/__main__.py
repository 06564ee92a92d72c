"""`python -m studies.tune`, as a program."""

import sys

from studies.tune.command import main

sys.exit(main())
