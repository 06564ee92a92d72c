"""Every place and every mode, and which mode a place takes."""

import difflib
import importlib
import importlib.util
import pathlib
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.conditions import Condition, condition
from ranger_sim.harness.faults import text as typed_text
from ranger_sim.harness.faults.fault import Fault, Place

# Modules of this package that put places and modes here when they are imported, in the order in which they are listed.
MODULES = (
    "places", "edges", "words", "voltages", "imu", "converters", "actuators", "world",
    "frames", "buses", "links", "power", "processor",
)  # fmt: skip

Kind = TypeVar("Kind", bound=Fault)

PLACES: dict[str, Place] = {}
# by (kind of place, name of the mode)
MODES: dict[tuple[str, str], type[Fault]] = {}
# Files of users that have been run.
FILES: set[pathlib.Path] = set()
# The same as MODES, of modes that a kind of place does not take for a reason of its own.
REASONS: dict[tuple[str, str], str] = {}


def load() -> None:
    """Fill the catalogue: import every module of MODULES. A second call does nothing."""
    for name in MODULES:
        importlib.import_module(f"ranger_sim.harness.faults.{name}")


def load_file(name: str | pathlib.Path) -> None:
    """Run a user's .py file, which puts modes and places here. UserError when it cannot be read, or does not run.

    A second call with the same file does nothing: several plans of one process may name it.
    """
    path = pathlib.Path(name)
    if not path.is_file():
        raise UserError(f"fault module {path}: there is no such file")
    whole = path.resolve()
    if whole in FILES:
        return
    spec = importlib.util.spec_from_file_location(f"ranger_sim_fault_module_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise UserError(f"fault module {path}: it is no Python file (.py)")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except UserError:
        raise
    except Exception as error:  # whatever a user's program raises
        raise UserError(f"fault module {path}: {type(error).__name__}: {error}") from error
    FILES.add(whole)


def add_places(places: Iterable[Place]) -> None:
    """Put places in the catalogue. UserError for a name that is there."""
    for place in places:
        if place.name in PLACES:
            raise UserError(f"fault place {place.name}: it is in the catalogue already")
        PLACES[place.name] = place


def mode(kind: type[Kind]) -> type[Kind]:
    """A class decorator: the mode is in the catalogue, for each of its kinds of places."""
    for place_kind in kind.kinds:
        if (place_kind, kind.mode) in MODES:
            raise UserError(f"fault mode {kind.mode} at {place_kind}: it is in the catalogue already")
        MODES[place_kind, kind.mode] = kind
    return kind


def modes_of(place: Place) -> dict[str, type[Fault]]:
    """The modes that a place takes, by name."""
    return {name: kind for (place_kind, name), kind in MODES.items() if place_kind == place.kind}


def refusal(place: Place, mode: str) -> str:
    """Why a place does not take a mode that others take; empty when no place does, or this one does."""
    if (place.kind, mode) in MODES:
        return ""
    if (place.kind, mode) in REASONS:
        return REASONS[place.kind, mode]
    others = {kind: fault for (kind, name), fault in MODES.items() if name == mode}
    needs = next((fault.needs for fault in others.values() if fault.needs), "")
    if not others:
        return ""
    return f"it needs {needs or 'a place that is a ' + ' or a '.join(sorted(others))}"


def named(name: str, there: Iterable[str], what: str) -> str:
    """`name`, which must be `there`; otherwise a UserError with the nearest ones."""
    names = list(there)
    if name not in names:
        near = difflib.get_close_matches(name, names, 3)
        hint = f"meant was perhaps {' or '.join(near)}" if near else f"there are {', '.join(names) or 'none'}"
        raise UserError(f"{what} {name!r}: {hint}; `ranger-sim faults` lists them")
    return name


def find(name: str) -> Place:
    """The place of this name. UserError with the nearest ones for any other."""
    load()
    return PLACES[named(name, PLACES, "fault place")]


def fault(
    place: str,
    mode: str,
    start: str | Condition | Callable[[Any], Any] | None,
    end: str | Condition | Callable[[Any], Any] | None,
    parameters: Mapping[str, Any],
) -> Fault:
    """A fault, not armed yet. UserError for a place, mode, parameter or value that the catalogue does not have."""
    where = find(place)
    if reason := refusal(where, mode):
        raise UserError(f"fault {where.name}:{mode}: it cannot act there; {reason}, this is {where.what}")
    kind = modes_of(where)[named(mode, modes_of(where), f"fault mode at {where.name},")]
    known = [parameter.name for parameter in kind.parameters]
    for name in parameters:
        named(name, known, f"fault {where.name}:{mode}, parameter")
    return kind.asked(where, start, end, parameters, condition)


def typed(text: str) -> Fault:
    """The fault that somebody typed (harness/faults/text.py)."""
    parts = typed_text.parse(text)
    return fault(parts.place, parts.mode, parts.start, parts.end, parts.parameters)
