"""The machine that a campaign runs: one of an installed module, or a user's, `[machine] make = "servo.py:new"`.

A subject makes the machine, has its faults and conditions, and judges a run against the golden one. The outcomes are
the same for all (outcomes.py); "the gait" differs: for a user's machine it is the quantities of its body in [band],
each with how far it may be from the golden run's at the same time.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import inspect
import math
import pathlib
import sys
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ranger_sim.foundation.user_error import CampaignError, UserError, raised
from ranger_sim.harness.faults.evidence import Record
from ranger_sim.harness.faults.proof import Proof

# What decides the outcome of a run besides our own sources: these files of the folder that the machine is made in.
SOURCES = {".py", ".toml", ".csv", ".c", ".h"}

CRITERIA = {
    "crashed": "the simulation raised an exception, or its process died: a defect, not the machine's behaviour",
    "timed out": "the run took more computing than its limit, or hung",
    "invalid": "the fault never acted, cannot act there, or the golden run does not get that far, or ends itself: it "
    "proves nothing",
    "fall": "the machine could go no further: its plant says so",
    "no effect": "the fault acted, and no frame and no error count differs",
    "masked": "the firmware differs, no error reports it, and the body stays inside its band",
    "detected and safe": "an error, or its rate, that healthy runs do not have; the body stays inside its band",
    "degraded": "detected; a quantity of the body leaves its band",
    "undetected wrong": "a quantity of the body leaves its band, and no error reports it",
}


class OwnMachine:
    """A machine that `make` of a file makes: `reference` is FILE.py:NAME, relative to the folder of the plan."""

    criteria = CRITERIA
    after_s, from_s, patience_s = 1.0, 0.5, 10.0  # of [watch], where the plan does not set it; chosen by us
    starts_s = (0.5, 0.75, 1.0)  # times at which healthy runs are judged as if a fault had begun; chosen by us

    def __init__(self, reference: str) -> None:
        self.reference = reference
        name, _, self.name = reference.rpartition(":")
        self.file = pathlib.Path(name)
        if not self.name.isidentifier() or self.file.suffix != ".py":
            raise CampaignError(f"machine {reference!r}: FILE.py:NAME is expected, as servo.py:new")
        if not self.file.is_file():
            raise CampaignError(f"machine {reference!r}: there is no file {self.file}")

    @functools.cached_property
    def make(self) -> Callable[..., Any]:
        """The function that makes one."""
        folder = str(self.file.resolve().parent)
        if folder not in sys.path:
            sys.path.insert(0, folder)
        try:
            module = importlib.import_module(self.file.stem)
        except UserError:
            raise
        except Exception as error:  # whatever a user's program raises
            raise CampaignError(f"machine {self.file}: {type(error).__name__}: {error}") from error
        found: Callable[..., Any] | None = getattr(module, self.name, None)
        if not callable(found):
            raise CampaignError(f"machine {self.file}: there is no function or class {self.name!r} in it")
        return found

    keys: Mapping[str, tuple[str, dict[str, float] | None]] = {}  # of a plan's table [walk]: it has none
    settings_text = "setting (seed, machine.KEYWORD, cost.BOARD.TASK)"

    def is_setting(self, name: str) -> bool:
        """Whether an axis is a setting from before power-up, and not a name in a fault's text."""
        return name == "seed" or name.startswith(("machine.", "cost."))

    def field(self, name: str) -> str:
        """The keyword of `make` that an axis sets; empty for an axis that sets none."""
        return name.removeprefix("machine.") if name == "seed" or name.startswith("machine.") else ""

    def units(self, name: str) -> dict[str, float] | None:
        """The units of a setting that may have one."""
        return None

    def new(self, settings: Any) -> Any:
        """A new one with a case's settings."""
        return self.machine(settings.walk)

    def walk_options(self, settings: Any) -> list[str] | None:
        """The options of `ranger-sim walk` that make it; None: that command does not have it."""
        return None

    def gaits(self, records: list[Record], since_ns: int) -> list[dict[str, float]]:
        """The gait of each record: none."""
        return []

    def machine(self, settings: Mapping[str, Any]) -> Any:
        """A new one with these keywords. UserError for a keyword that `make` does not take."""
        try:
            inspect.signature(self.make).bind(**settings)
            return self.make(**settings)
        except TypeError as error:
            raise CampaignError(f"machine {self.file.name}:{self.name}: {error}") from None

    @functools.cached_property
    def shown(self) -> Any:
        """One of them, never run, for their common properties."""
        try:
            machine = self.machine({})
            machine.close()
        except UserError:
            raise
        except Exception as error:  # whatever a user's program raises
            raise CampaignError(f"machine {self.file.name}:{self.name}: it raised {raised(error)}") from error
        return machine

    @property
    def catalogue(self) -> Any:
        """Catalogue of its faults."""
        return self.shown.catalogue

    def condition(self, wanted: str) -> Any:
        """One of its conditions."""
        return self.shown.condition(wanted)

    def version(self) -> str:
        """Digest of the files that it is made of."""
        total = hashlib.blake2b(digest_size=8)
        folder = self.file.resolve().parent
        for path in sorted(folder.rglob("*")):
            inside = path.relative_to(folder)
            if path.suffix in SOURCES and not {"build", "runs", "__pycache__"} & set(inside.parts):
                total.update(inside.as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
        return total.hexdigest()

    def band(self, band: Mapping[str, Any], path: str) -> dict[str, float]:
        """[band] of a plan, in the quantities' units. UserError for what it cannot be."""
        for name, value in band.items():
            if not is_number(value) or not 0.0 < value < math.inf:
                raise CampaignError(f"{path}: [band] {name} = {value!r}: a number above 0 is expected, in its unit")
        try:
            self.check_band(band)
        except UserError as error:
            raise CampaignError(f"{path}: {error}") from None
        return {name: float(value) for name, value in band.items()}

    @property
    def usual(self) -> dict[str, float]:
        """Of [watch], where the plan does not set it."""
        return {"after_s": self.after_s, "from_s": self.from_s, "patience_s": self.patience_s}

    def check_band(self, band: Mapping[str, float]) -> None:
        """UserError for a quantity that its body does not have."""
        for name in band:
            if name not in self.shown.plant.sample_names:
                known = ", ".join(self.shown.plant.sample_names) or "none"
                raise CampaignError(f"[band] {name}: it is not a quantity of the body (available: {known})")

    def judge(
        self, proof: Proof, golden: Record, record: Record, since_ns: int, band: Mapping[str, float], is_sweep: bool
    ) -> dict[str, Any]:
        """Outcome, why, the largest differences by quantity, and the largest in parts of its band."""
        off = {name: farthest(golden.sample(name), record.sample(name), golden, record, since_ns) for name in band}
        parts = {name: value / band[name] for name, value in off.items()}
        worst = max(parts, key=lambda name: parts[name], default="")
        beyond = ""
        if worst and parts[worst] > 1.0:
            unit = self.shown.plant.sample_names[worst]
            beyond = f"{worst} off by {off[worst]:.4g} {unit}".rstrip()
        detection = f"{proof.detected.code} from {proof.detected.board}" if proof.detected is not None else ""
        if not proof.acted:
            outcome, why = "invalid", "the fault never acted"
        elif golden.fell_ns >= 0 and not (is_sweep and proof.fell_ns is not None):
            outcome, why = "invalid", f"the golden run ended as well ({golden.fall_cause})"
        elif proof.fell_ns is not None:
            outcome, why = "fall", proof.fall_cause
        elif proof.first_firmware is None:
            outcome, why = "no effect", ""
        elif beyond:
            outcome = "degraded" if detection else "undetected wrong"
            why = "; ".join(part for part in (beyond, detection) if part)
        else:
            outcome, why = ("detected and safe", detection) if detection else ("masked", "")
        return {
            "outcome": outcome,
            "why": why,
            "gait": {f"{name}_off": value for name, value in off.items()},
            "golden_gait": {},
            "deviation": max(parts.values(), default=0.0),
        }


def farthest(there: np.ndarray, here: np.ndarray, golden: Record, record: Record, since_ns: int) -> float:
    """The largest distance of a quantity from the golden run's at the same time, from `since_ns` on."""
    common = min(len(there), len(here))
    window = record.samples[:common, 0] >= since_ns * 1e-9
    return float(np.abs(here[:common] - there[:common])[window].max()) if window.any() else 0.0


def is_number(value: Any) -> bool:
    """Whether a value of a file is a number."""
    return isinstance(value, int | float) and not isinstance(value, bool)


@functools.cache
def subject_of(reference: str) -> Any:
    """The subject of a reference, made ready once per process: FILE.py:NAME of a user's machine, or MODULE:NAME."""
    module, _, name = reference.rpartition(":")
    if all(part.isidentifier() for part in module.split(".")) and not module.endswith(".py"):
        return getattr(importlib.import_module(module), name)
    return OwnMachine(reference)
