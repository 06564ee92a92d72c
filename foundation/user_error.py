"""The exceptions for mistakes of a user: `UserError`, and a class of it for each kind of thing that is wrong."""

import difflib
import os
import traceback
from collections.abc import Iterable

LONGEST_NAME = 100  # letters of a name that is compared with others
LEAST_ALIKE = 0.7  # of 1, as difflib measures it: two letters swapped in a word of four are 0.75
MOST_NAMED = 2
FEW, MOST_LISTED = 12, 100  # names that are always listed; that are listed where none is close


def printable(text: str) -> str:
    """`text` on one line that is safe to print on a terminal: unprintable characters are written as escapes.

    So neither a file's name nor a line of an external file can colour, hide or fake a message.
    """
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode("ascii") for each in text)


def raised(error: BaseException, file: str = "") -> str:
    """An exception in one line, with its place: the innermost one in `file`, where it passed that, or of all."""
    if isinstance(error, SyntaxError):  # its text has the place
        return f"{type(error).__name__}: {error}"
    frames = traceback.extract_tb(error.__traceback__)
    place = ([each for each in frames if each.filename == file] or frames)[-1]
    return f"{type(error).__name__}: {error} ({os.path.basename(place.filename)}:{place.lineno})"


class UserError(Exception):
    """A mistake of the user: a line that names the object, the value, the limit and the place; or several such lines.

    The command line prints them and exits with code 2; library users may catch it. Each line is printable, whatever
    text it contains.
    """

    def __init__(self, *lines: str) -> None:
        super().__init__(*(printable(line) for line in lines))

    def __str__(self) -> str:
        return "\n".join(self.args)


class TableError(UserError):
    """The data table: its files, variables, errors, boards, or what is generated from it."""


class ProfileError(UserError):
    """A profile: boards, buses and their interfaces."""


class ScenarioError(UserError):
    """A scenario: its numbers, controller, parameters, quirks or conditions."""


class ModelError(UserError):
    """What is simulated: a body, a motor, a sensor, a floor, a model file, or a machine that is diagnosed."""


class DataError(UserError):
    """Measured data: a recording that cannot be read, or from which nothing can be concluded."""


class FaultError(UserError):
    """A fault that is injected: its place, mode, size or time."""


class CampaignError(UserError):
    """A campaign: its plan, runs or results."""


class BusError(UserError):
    """A CAN bus: its bits, frames and databases, interfaces and connections."""


class FirmwareError(UserError):
    """Firmware: its schedule, its chip, its source in C or its image."""


class BoardFailure(FirmwareError):  # noqa: N818  (the board's, not the user's)
    """The program of `board` cannot go on. A machine of boards goes on without it."""

    def __init__(self, board: str, text: str) -> None:
        super().__init__(f"{board}: {text}")
        self.board = board
        self.text = text


class RequestError(UserError):
    """A request to a running robot."""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """`did you mean 'walk'?`, the known names that begin with a mistyped one or are close to it; empty if there are
    none."""
    names = list(known)
    begun = [each for each in names if name and each.startswith(name)][:MOST_NAMED]
    near = begun or difflib.get_close_matches(name[:LONGEST_NAME], names, MOST_NAMED, LEAST_ALIKE)
    return f"did you mean {' or '.join(map(repr, near))}?" if near else ""


def unknown(what: str, name: str, known: Iterable[str]) -> str:
    """`unknown board 'MHC' (available: MCH, MB)`; of many `unknown frame 'MCH_ANGEL'; did you mean ...?`.

    Without any of them where nothing is close and there are more than MOST_LISTED.
    """
    names = list(known)
    near = did_you_mean(name, names) if len(names) > FEW else ""
    if near:
        return f"unknown {what} {name!r}; {near}"
    listed = f" (available: {', '.join(names) or 'none'})" if len(names) <= MOST_LISTED else ""
    return f"unknown {what} {name!r}{listed}"
