"""`ranger-sim completion SHELL`: a script for a shell to complete commands, options and file names, from the parser."""

import argparse
import re
from collections.abc import Callable, Iterator
from typing import Any

SHELLS = ("bash", "zsh", "fish")
FILES = {"FILE", "PROFILE", "DATA", "LOG", "FIGURES", "PAGE"}  # help's names for values that are, or may be, a file


def register(commands: Any, parser: Callable[[], argparse.ArgumentParser]) -> None:
    """Add the subcommand to the command line. parser: makes the parser of all commands, including this one."""
    command = commands.add_parser(
        "completion",
        help="a script by which bash, zsh or fish finish commands, options and file names",
        description="Prints the script; docs/reference/commands.md says where each shell looks for it.",
    )
    command.add_argument("shell", choices=SHELLS, metavar="{" + ",".join(SHELLS) + "}", help="whose script")
    command.set_defaults(run=lambda options: run(options, parser()))


def run(options: argparse.Namespace, whole: argparse.ArgumentParser) -> int:
    """Print the script."""
    print(script(whole, options.shell))
    return 0


def script(whole: argparse.ArgumentParser, shell: str) -> str:
    """The script of a shell for a command line."""
    import shtab  # imported only here

    for action in actions(whole):
        kind = completed(action)
        if kind is not None:
            action.complete = getattr(shtab, kind)  # type: ignore[attr-defined]
    text: str = shtab.complete(whole, shell)
    return text


def actions(whole: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Every option and argument of a parser and of the parsers below it."""
    for action in whole._actions:
        if isinstance(action, argparse._SubParsersAction):
            for below in action.choices.values():
                yield from actions(below)
        else:
            yield action


def completed(action: argparse.Action) -> str | None:
    """FILE or DIRECTORY if the value may be one, by its name in the help (`NAME|FILE.toml`, `DIR`); None for others."""
    words = re.split(r"\W+", action.metavar if isinstance(action.metavar, str) else "")
    if "DIR" in words:
        return "DIRECTORY"
    return "FILE" if FILES & set(words) else None
