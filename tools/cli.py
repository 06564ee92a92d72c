"""The command `ranger-sim`: every subcommand is one module of this package (or a room's own `cli`)."""

import argparse
import os
import sys

from foundation.user_error import UserError

EXIT_DONE = 0
EXIT_FELL = 1  # the robot fell or a board failed
EXIT_MISUSE = 2
EXIT_INTERRUPTED = 130


def parser() -> argparse.ArgumentParser:
    """The whole command line."""
    from datatable import cli as table_command
    from tools import bench, info, walk

    top = argparse.ArgumentParser(
        prog="ranger-sim",
        description="The Cornell Ranger biped emulated whole: seven boards' firmware, four CAN buses, one body.",
    )
    commands = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    walk.register(commands)
    info.register(commands)
    table_command.register(commands)
    bench.register(commands)
    return top


def main(arguments: list[str] | None = None) -> int:
    """Run one command; returns the process's exit code. A user's mistake is one line and code 2."""
    try:
        options = parser().parse_args(arguments)
        return options.run(options)
    except UserError as mistake:
        print(f"ranger-sim: {mistake}", file=sys.stderr)
        return EXIT_MISUSE
    except BrokenPipeError:  # the reader of our output left, e.g. `| head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_DONE


if __name__ == "__main__":
    sys.exit(main())
