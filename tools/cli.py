"""The command `ranger-sim`: every subcommand is a module of this package (or the `cli` of another package)."""

import argparse
import contextlib
import sys
from typing import Any, NoReturn

from ranger_sim import __version__
from ranger_sim.foundation.user_error import UserError, did_you_mean, printable
from ranger_sim.tools.command_line import interrupts, libraries, streams
from ranger_sim.tools.command_line.units import NEGATIVE_VALUE

EXIT_DONE = 0
EXIT_FELL = 1  # the robot fell or a board failed
EXIT_MISUSE = 2


class OneLineParser(argparse.ArgumentParser):
    """An argument parser with one-line errors; accepts `-1s` as a value, and options only by their full names."""

    def __init__(self, *arguments: Any, **settings: Any) -> None:
        super().__init__(*arguments, **{"allow_abbrev": False, **settings})
        self._negative_number_matcher = NEGATIVE_VALUE  # argparse's own matches -1 and -0.5, not -1s

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """As argparse's, but each command reports unknown arguments itself: under its own name, with a hint."""
        options, unknown = super().parse_known_args(args, namespace)
        if unknown:
            named = [each.partition("=")[0] for each in unknown if each.startswith("--")]
            known = [each for action in self._actions for each in action.option_strings]
            hint = did_you_mean(named[0], known) if named else ""
            self.error(f"unrecognized arguments: {' '.join(unknown)}{f'; {hint}' if hint else ''}")
        return options, unknown

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """As argparse's, but lists the names close to a mistyped one, or else all."""
        if action.choices is not None and value not in action.choices:
            known = [str(each) for each in action.choices]
            hint = did_you_mean(str(value), known) or f"available: {', '.join(known)}"
            raise argparse.ArgumentError(action, f"unknown {value!r}; {hint}")

    def error(self, message: str) -> NoReturn:
        """Print the error and where to find help; exit code 2."""
        self.exit(EXIT_MISUSE, f"{self.prog}: {printable(message)} (see {self.prog} --help)\n")


def parser() -> argparse.ArgumentParser:
    """The whole command line."""
    from ranger_sim.datatable import cli as table_command
    from ranger_sim.tools import body, faults, info
    from ranger_sim.tools.bench import command as bench
    from ranger_sim.tools.buses import bus, can_bounds, check_bus
    from ranger_sim.tools.campaign import command as campaign
    from ranger_sim.tools.command_line import completion
    from ranger_sim.tools.compare_walk import command as compare_walk
    from ranger_sim.tools.diagnose import causes
    from ranger_sim.tools.diagnose import command as diagnose
    from ranger_sim.tools.figures import command as figures
    from ranger_sim.tools.firmware import command as firmware
    from ranger_sim.tools.fmu import command as fmu
    from ranger_sim.tools.identify import command as identify
    from ranger_sim.tools.new import command as new
    from ranger_sim.tools.panel import command as panel
    from ranger_sim.tools.read import command as read
    from ranger_sim.tools.robodaq import command as daq
    from ranger_sim.tools.run import summary_schema, up, walk
    from ranger_sim.tools.timing import slots, trace
    from ranger_sim.tools.tune import command as tune
    from ranger_sim.tools.vm import command as vm

    top = OneLineParser(
        prog="ranger-sim",
        description="The Cornell Ranger biped emulated whole: seven boards' firmware, four CAN buses, one body.",
    )
    top.add_argument("--version", action="version", version=f"ranger-sim {__version__}")
    commands: Any = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    commands.add_parser("help", help="what a command does and takes: ranger-sim help COMMAND")
    walk.register(commands)
    info.register(commands)
    table_command.register(commands)
    bench.register(commands)
    trace.register(commands)
    tune.register(commands)
    up.register(commands)
    body.register(commands)
    bus.register(commands)
    can_bounds.register(commands)
    check_bus.register(commands)
    daq.register(commands)
    panel.register(commands)
    vm.register(commands)
    faults.register(commands)
    firmware.register(commands)
    new.register(commands)
    slots.register(commands)
    summary_schema.register(commands)
    campaign.register(commands)
    causes.register(commands)
    diagnose.register(commands)
    figures.register(commands)
    fmu.register(commands)
    read.register(commands)
    identify.register(commands)
    compare_walk.register(commands)
    completion.register(commands)
    return top


def main(arguments: list[str] | None = None) -> int:
    """Run one command; returns the process's exit code. A missing library is one line and code 2."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words[:1] == ["help"]:
        words = [*words[1:], "--help"]
    try:
        return run(words)
    except ModuleNotFoundError as error:
        command = next((word for word in words if not word.startswith("-")), "")
        text = libraries.missing(error, command or "the command line")
        if text is None:
            raise
        return misuse(text)


def run(arguments: list[str]) -> int:
    """As `main`, with every library installed. A user's mistake is one line and code 2."""
    is_own_process = streams.take_over()
    if is_own_process:
        interrupts.end_in_order()
    try:
        options = parser().parse_args(arguments)
        options.arguments = arguments
        alone = streams.results_alone() if getattr(options, "json", None) == "-" else contextlib.nullcontext()
        with alone:
            code: int = options.run(options)
        sys.stdout.flush()
        return code
    except UserError as mistake:
        return misuse(str(mistake))
    except KeyboardInterrupt:
        if is_own_process:
            interrupts.end_at_once()
        print("ranger-sim: interrupted", file=sys.stderr)
        return interrupts.EXIT_INTERRUPTED
    except OSError as error:  # a full disk, a folder that vanished: a failure of the machine, not of the program
        place = error.filename or ("standard output" if streams.is_stuck() else None)
        return misuse(printable(f"{place}: {error.strerror or error}" if place else f"{error.strerror or error}"))
    except MemoryError:
        return misuse(f"{options.command}: out of memory")


def misuse(text: str) -> int:
    """Print an error on standard error."""
    print(f"ranger-sim: {text}", file=sys.stderr)
    return EXIT_MISUSE


if __name__ == "__main__":
    sys.exit(main())
