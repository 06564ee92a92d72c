"""`python -m dev.vm`, as a program."""

import sys

from dev.vm.command import main

sys.exit(main())
