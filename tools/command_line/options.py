"""Options of a command as a table, used to make the parser and the command line that repeats a run."""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ranger_sim.tools.command_line.units import Value


@dataclass(frozen=True)
class Option:
    """One option: how to parse it, and how to type its value again.

    value: parses its text; None for a switch. repeated: may be given several times, its value is a list.
    of_run: False if it only affects which data of a run are kept or shown, not the run itself.
    always: typed again even with its default, which may change in a later version.
    """

    name: str
    help: str
    value: Value | None = None
    metavar: str | None = None
    default: Any = None
    choices: tuple[str, ...] | None = None
    repeated: bool = False
    of_run: bool = True
    always: bool = False

    @property
    def key(self) -> str:
        """Its name among the parsed options."""
        return self.name.removeprefix("--").replace("-", "_")

    def add(self, command: Any) -> None:
        """Add it to a parser or a group of one."""
        if self.value is None and self.choices is None:
            command.add_argument(self.name, action="store_true", help=self.help)
            return
        settings: dict[str, Any] = {"help": self.help, "metavar": self.metavar, "choices": self.choices}
        if self.value is not None:
            settings["type"] = self.value
        if self.repeated:
            command.add_argument(self.name, action="append", default=[], **settings)
        else:
            command.add_argument(self.name, default=self.default, **settings)

    def typed(self, options: argparse.Namespace) -> list[str]:
        """The words that give it its value in `options`; empty if no words are needed."""
        value = getattr(options, self.key, None)
        if value is None or value is False or (value == self.default and not self.always):
            return []
        if value is True:
            return [self.name]
        values = value if self.repeated else [value]
        texts = [self.value.text(each) if self.value is not None else str(each) for each in values]
        return [word for text in texts for word in self._words(text)]

    def _words(self, text: str) -> list[str]:
        return [f"{self.name}={text}"] if text.startswith("-") else [self.name, text]


def add_verbosity(command: Any) -> None:
    """-q and -v, of every command that prints progress."""
    group = command.add_mutually_exclusive_group()
    group.add_argument(
        "-q", "--quiet", action="store_true", help="print no progress and no notes; exit code and files have the result"
    )
    group.add_argument(
        "-v", "--verbose", action="store_true", help="print a line of progress every second where there is no terminal"
    )


def add_all(command: Any, options: Sequence[Option]) -> None:
    """Add a table of options to a parser or a group."""
    for option in options:
        option.add(command)
