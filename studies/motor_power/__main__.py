"""`python -m studies.motor_power [LOGS...] [--drives N --seed N]`: the tables of docs/explanation/motor-power.md."""

import argparse
import pathlib
import sys

from ranger_sim.foundation.user_error import UserError
from studies.motor_power import tables


def main() -> int:
    """The study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("logs", nargs="*", metavar="LOG", help="the robot's logs: t_ms, variable, value")
    parser.add_argument("--drives", type=int, default=0, help="emulated drives with drawn values (0)")
    parser.add_argument("--seed", type=int, default=0, help="of the first drive; each next one has one more (0)")
    options = parser.parse_args()
    if not options.logs and not options.drives:
        parser.error("LOG or --drives N is needed")
    try:
        if options.logs:
            data = tables.opened([pathlib.Path(each) for each in options.logs])
            print("\n\n".join((tables.boards(data), tables.readings(data), tables.predictions(data))))
    except UserError as error:
        print(error, file=sys.stderr)
        return 2
    if options.drives:
        print(tables.coverage(options.seed, options.drives))
    return 0


if __name__ == "__main__":
    sys.exit(main())
