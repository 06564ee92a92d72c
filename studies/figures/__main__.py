"""`python -m studies.figures`, as a program."""

import sys

from studies.figures.command import main

sys.exit(main())
