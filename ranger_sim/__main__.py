"""`python -m ranger_sim`: the command `ranger-sim`."""

import sys

from ranger_sim.tools.cli import main

if __name__ == "__main__":
    sys.exit(main())
