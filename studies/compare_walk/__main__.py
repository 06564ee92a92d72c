"""`python -m studies.compare_walk`, as a program."""

import sys

from studies.compare_walk.command import main

sys.exit(main())
