"""The command `ranger-sim`: its parser, made of the table of commands (commands.py), and what ends every command."""

import argparse
import contextlib
import sys
from collections.abc import Callable
from typing import Any, NoReturn

from ranger_sim import __version__
from ranger_sim.foundation.user_error import UserError, did_you_mean, printable
from ranger_sim.tools.command_line import interrupts, libraries, streams
from ranger_sim.tools.command_line.units import NEGATIVE_VALUE
from ranger_sim.tools.commands import COMMANDS, NAMED

PROGRAM = "ranger-sim"
EXIT_DONE = 0
EXIT_FELL = 1  # the robot fell or a board failed
EXIT_MISUSE = 2
EPILOG = (
    "ranger-sim help COMMAND has the options of a command and examples.\n"
    f"For developers: {', '.join(each.name for each in COMMANDS if each.is_for_developers)}."
)


class OneLineParser(argparse.ArgumentParser):
    """An argument parser with one-line errors; accepts `-1s` as a value, and options only by their full names."""

    def __init__(self, *arguments: Any, **settings: Any) -> None:
        super().__init__(*arguments, **{"allow_abbrev": False, "formatter_class": HelpText, **settings})
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


class HelpText(argparse.HelpFormatter):
    """As argparse's, but lines that begin with two spaces stay as they are: examples are copied whole."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        lines = text.splitlines()
        return "\n".join(
            each if each.startswith("  ") else super(HelpText, self)._fill_text(each, width, indent) for each in lines
        )


class CommandParsers(argparse._SubParsersAction):
    """Parsers of the commands; help and examples come from the table of commands."""

    def add_parser(self, name: str, **settings: Any) -> Any:
        """Add the parser of a command of the table."""
        command = NAMED[name]
        if not command.is_for_developers:
            settings["help"] = command.help
        settings.setdefault("description", command.help)
        if command.examples:
            examples = "\n".join(f"  {line}" for line in ("examples:", *command.examples)).removeprefix("  ")
            settings["epilog"] = "\n\n".join(filter(None, (settings.get("epilog"), examples)))
        return super().add_parser(name, **settings)


def parser(command: str | None = None) -> argparse.ArgumentParser:
    """The whole command line; with `command`, the options of that one, and only name and help of the others (quick)."""
    top = OneLineParser(
        prog=PROGRAM,
        description="The Cornell Ranger biped emulated whole: seven boards' firmware, four CAN buses, one body.",
        epilog=EPILOG,
    )
    top.add_argument("--version", action="version", version=f"ranger-sim {__version__}")
    commands: Any = top.add_subparsers(dest="command", required=True, metavar="COMMAND", action=CommandParsers)
    for each in COMMANDS:
        if command is None or command == each.name:
            each.register(commands)
        else:
            commands.add_parser(each.name)
    return top


def main(
    arguments: list[str] | None = None,
    make: Callable[[str], argparse.ArgumentParser] = parser,
    program: str = PROGRAM,
) -> int:
    """Run one command; returns the process's exit code. A missing library is one line and code 2.

    make(command), program: the parser and the name of another program with the same habits.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words[:1] == ["help"]:
        words = [*words[1:], "--help"]
    try:
        return run(words, make, program)
    except ModuleNotFoundError as error:
        text = libraries.missing(error, (command_in(words) if program == PROGRAM else program) or "the command line")
        if text is None:
            raise
        return misuse(text, program)


def command_in(words: list[str]) -> str:
    """The command among the words; "" if there is none."""
    return next((word for word in words if not word.startswith("-")), "")


def run(arguments: list[str], make: Callable[[str], argparse.ArgumentParser] = parser, program: str = PROGRAM) -> int:
    """As `main`, with every library installed. A user's mistake is one line and code 2."""
    is_own_process = streams.take_over()
    if is_own_process:
        interrupts.end_in_order()
    try:
        options = make(command_in(arguments)).parse_args(arguments)
        options.arguments, options.parser = arguments, parser
        alone = streams.results_alone() if getattr(options, "json", None) == "-" else contextlib.nullcontext()
        with alone:
            code: int = options.run(options)
        sys.stdout.flush()
        return code
    except UserError as mistake:
        return misuse(str(mistake), program)
    except KeyboardInterrupt:
        if is_own_process:
            interrupts.end_at_once()
        print(f"{program}: interrupted", file=sys.stderr)
        return interrupts.EXIT_INTERRUPTED
    except OSError as error:  # a full disk, a folder that vanished: a failure of the machine, not of the program
        place = error.filename or ("standard output" if streams.is_stuck() else None)
        text = f"{place}: {error.strerror or error}" if place else f"{error.strerror or error}"
        return misuse(printable(text), program)
    except MemoryError:
        return misuse(f"{options.command}: out of memory" if program == PROGRAM else "out of memory", program)
    finally:
        interrupts.count_as_handled()


def misuse(text: str, program: str = PROGRAM) -> int:
    """Print an error on standard error."""
    print(f"{program}: {text}", file=sys.stderr)
    return EXIT_MISUSE


if __name__ == "__main__":
    sys.exit(main())
