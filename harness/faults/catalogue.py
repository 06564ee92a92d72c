"""The possible faults of a machine: its places, every mode, and which mode a place takes.

A mode belongs to kinds of places, not to a machine: a fault of an encoder's edges applies to those of any machine.
Ranger's places, and the modes that only it has, are in ranger_catalogue.py.
"""

import importlib
import importlib.util
import pathlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeVar

from ranger_sim.foundation.user_error import FaultError, UserError, unknown
from ranger_sim.harness.faults import text as typed_text
from ranger_sim.harness.faults.fault import Fault, Place
from ranger_sim.harness.waiting import Condition, Wanted

# Modules of this package whose modes any machine's places may take.
GENERAL = ("edges", "voltages", "frames", "buses")

Kind = TypeVar("Kind", bound=Fault)

# by (kind of place, name of the mode)
MODES: dict[tuple[str, str], type[Fault]] = {}
# Reasons why a kind of place does not take a mode, by the same keys.
REASONS: dict[tuple[str, str], str] = {}
# Files of users that have been run.
FILES: set[pathlib.Path] = set()


def mode(kind: type[Kind]) -> type[Kind]:
    """Class decorator that registers a mode for places of its kinds."""
    for place_kind in kind.kinds:
        if (place_kind, kind.mode) in MODES:
            raise FaultError(f"fault mode {kind.mode} at {place_kind}: it is in the catalogue already")
        MODES[place_kind, kind.mode] = kind
    return kind


class Catalogue:
    """The places of a machine, by name. `condition` makes its conditions; modules: of this package, that have its modes
    (and add places, in the order in which they are listed). `hint`: the command that lists it all, for messages.
    """

    def __init__(
        self,
        places: Iterable[Place] = (),
        condition: Callable[[Wanted], Condition] | None = None,
        modules: Sequence[str] = GENERAL,
        hint: str = "",
    ) -> None:
        self.known: dict[str, Place] = {}
        self.condition = condition
        self.modules = modules
        self.hint = hint
        self.add_places(places)

    def load(self) -> None:
        """Load its modes: import the modules. A second call does nothing."""
        for name in self.modules:
            importlib.import_module(f"ranger_sim.harness.faults.{name}")

    @property
    def places(self) -> dict[str, Place]:
        """All of them."""
        self.load()
        return self.known

    def add_places(self, places: Iterable[Place]) -> None:
        """Add places to the catalogue. UserError for a name that it has already."""
        for place in places:
            if place.name in self.known:
                raise FaultError(f"fault place {place.name}: it is in the catalogue already")
            self.known[place.name] = place

    def modes_of(self, place: Place) -> dict[str, type[Fault]]:
        """The modes that a place takes, by name."""
        self.load()
        return {name: kind for (place_kind, name), kind in MODES.items() if place_kind == place.kind}

    def refusal(self, place: Place, mode: str) -> str:
        """Why a place does not take a mode that others take; empty when no place does, or this one does."""
        self.load()
        if (place.kind, mode) in MODES:
            return ""
        if (place.kind, mode) in REASONS:
            return REASONS[place.kind, mode]
        others = {kind: fault for (kind, name), fault in MODES.items() if name == mode}
        needs = next((fault.needs for fault in others.values() if fault.needs), "")
        if not others:
            return ""
        return f"it needs {needs or 'a place that is a ' + ' or a '.join(sorted(others))}"

    def named(self, name: str, there: Iterable[str], what: str, where: str = "") -> str:
        """Return `name`, which must be in `there`; otherwise a UserError with the nearest ones."""
        names = list(there)
        if name not in names:
            raise FaultError(f"{where}{unknown(what, name, names)}{self.hint}")
        return name

    def find(self, name: str) -> Place:
        """The place of this name. UserError with the nearest ones for any other."""
        return self.places[self.named(name, self.places, "fault place")]

    def fault(
        self, place: str | Place, mode: str, start: Wanted | None, end: Wanted | None, parameters: Mapping[str, Any]
    ) -> Fault:
        """A fault, not armed yet. UserError for a place, mode, parameter or value that the catalogue does not have."""
        where = self.find(place) if isinstance(place, str) else place
        if reason := self.refusal(where, mode):
            raise FaultError(f"fault {where.name}:{mode}: it cannot act there; {reason}, this is {where.what}")
        modes = self.modes_of(where)
        kind = modes[self.named(mode, modes, "mode", f"fault {where.name}: ")]
        known = [parameter.name for parameter in kind.parameters]
        for name in parameters:
            self.named(name, known, "parameter", f"fault {where.name}:{mode}: ")
        if self.condition is None:
            raise FaultError(f"fault {where.name}:{mode}: this catalogue belongs to no machine")
        return kind.asked(where, start, end, parameters, self.condition)

    def typed(self, text: str) -> Fault:
        """The fault of a typed text (harness/faults/text.py)."""
        parts = typed_text.parse(text)
        return self.fault(parts.place, parts.mode, parts.start, parts.end, parts.parameters)

    def load_file(self, name: str | pathlib.Path) -> None:
        """Run a user's .py file, which adds modes and places here. UserError when it cannot be read, or does not run.

        A second call with the same file does nothing: several plans of one process may name it.
        """
        self.load()
        path = pathlib.Path(name)
        if not path.is_file():
            raise FaultError(f"fault module {path}: there is no such file")
        whole = path.resolve()
        if whole in FILES:
            return
        spec = importlib.util.spec_from_file_location(f"ranger_sim_fault_module_{path.stem}", path)
        if spec is None or spec.loader is None:
            raise FaultError(f"fault module {path}: it is no Python file (.py)")
        module = importlib.util.module_from_spec(spec)
        try:
            spec.loader.exec_module(module)
        except UserError:
            raise
        except Exception as error:  # whatever a user's program raises
            raise FaultError(f"fault module {path}: {type(error).__name__}: {error}") from error
        FILES.add(whole)
