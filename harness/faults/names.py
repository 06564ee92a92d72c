"""Parameters that are names: of a frame, a task, an interrupt."""

import dataclasses
from typing import Any

from ranger_sim.foundation.user_error import FaultError, unknown
from ranger_sim.harness.faults.fault import Parameter

ANY = "any"
HIGHEST_IDENTIFIER = 0x7FF  # standard frames, as the robot sends them


@dataclasses.dataclass(frozen=True)
class NameParameter(Parameter):
    """A name that a mode takes. The mode checks when armed whether its place has it."""

    def checked(self, value: Any, where: str) -> Any:
        """`value` as text, or a UserError naming `where`."""
        text = str(value).strip()
        if not text:
            raise FaultError(f"{where}: {self.name} is empty, it is {self.meaning}")
        return text


def name_parameter(name: str, default: Any, meaning: str, source: str) -> NameParameter:
    """A parameter that is a name; `default` where it is not given."""
    return NameParameter(name, "name", default, 0.0, 0.0, meaning, source)


def identifier_of(robot: Any, text: str, where: str) -> int:
    """Identifier of the frame called `text`: a variable, a number, or "any" (-1). UserError for other texts."""
    if text == ANY:
        return -1
    known = robot.names.ids
    if text in known:
        return int(known[text])
    try:
        number = int(text, 0)
    except ValueError:
        raise FaultError(f"{where}: {unknown('frame', text, known)}, neither a variable nor an identifier") from None
    if not 0 <= number <= HIGHEST_IDENTIFIER:
        raise FaultError(f"{where}: frame {text!r} is outside 0 ... {HIGHEST_IDENTIFIER:#x}")
    return number


def chosen(name: str, there: Any, what: str, where: str) -> str:
    """Return `name`, which must be in `there`; otherwise a UserError that lists the known ones."""
    names = sorted(there)
    if name not in names:
        raise FaultError(f"{where}: {unknown(what, name, names)}")
    return name
