"""Ranger's walks as the subject of a campaign's runs."""

import dataclasses
import json
import math
import pathlib
import tempfile
from typing import Any, ClassVar

from ranger_sim.foundation.quantities import LENGTHS, SHARES, in_base_units
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.campaigns.cases import Settings
from ranger_sim.harness.campaigns.outcomes import CRITERIA, Band, against_fallen, classify, deviation
from ranger_sim.harness.campaigns.plan import only
from ranger_sim.harness.campaigns.subjects import is_number
from ranger_sim.harness.faults.evidence import Record
from ranger_sim.harness.faults.proof import Proof, damage, gait
from ranger_sim.ranger.conditions import condition
from ranger_sim.ranger.faults.catalogue import CATALOGUE
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario

REFERENCE = "ranger_sim.ranger.walks:WALKS"
# Keys of [walk] and, with several values, of [vary]: the field of Scenario, and its units.
WALK: dict[str, tuple[str, dict[str, float] | None]] = {
    "controller": ("controller", None),
    "body": ("body", None),
    "seed": ("seed", None),
    "slope": ("slope_rad", {"rad": 1.0, "deg": math.pi / 180.0}),
    "floor_roughness": ("floor_roughness_m", LENGTHS),
    "model": ("model_file", None),
    "battery": ("battery_charge", SHARES),
    "battery_capacity": ("battery_capacity_Wh", {"Wh": 1.0}),
}

PREFIXES = ("controller.", "body.", "cost.")


class Walks:
    """The counterpart of a user's machine in harness/campaigns/subjects.py."""

    keys = WALK
    settings_text = f"setting of a walk ({', '.join(WALK)}, controller.PARAMETER, body.PARAMETER, cost.BOARD.TASK)"
    usual: ClassVar[dict[str, float]] = {}  # of [watch], over Watch's own
    criteria = CRITERIA
    catalogue = CATALOGUE
    starts_s = (4.0, 5.0, 6.0, 7.0)

    @staticmethod
    def is_setting(name: str) -> bool:
        """Whether an axis is a setting from before power-up, and not a name in a fault's text."""
        return name in WALK or name.startswith(PREFIXES)

    @staticmethod
    def field(name: str) -> str:
        """The field of Scenario that an axis sets; empty for an axis that sets none."""
        return WALK[name][0] if name in WALK else ""

    @staticmethod
    def units(name: str) -> dict[str, float] | None:
        """The units of a setting that may have one."""
        return WALK[name][1]

    @staticmethod
    def new(settings: Settings) -> Ranger:
        """A new robot with a case's settings. UserError for settings that it does not have."""
        with tempfile.TemporaryDirectory(prefix="ranger-sim-campaign-") as name:
            folder = pathlib.Path(name)
            walk = dict(settings.walk)
            try:
                Scenario(**walk)
                if settings.controller:
                    base = walk.get("controller", Scenario.controller)
                    walk["controller"] = written(folder / "controller.toml", base, settings.controller, "reasons")
                if settings.body:
                    base = walk.get("body", Scenario.body)
                    walk["body"] = written(folder / "body.toml", base, settings.body, "sources")
                return Ranger(Scenario(**walk))
            except TypeError as error:
                raise UserError(f"campaign: walk: {error}") from None

    @staticmethod
    def walk_options(settings: Settings) -> list[str] | None:
        """The options of `ranger-sim walk` that make it; None for settings that the command does not have."""
        if settings.controller or settings.body or settings.costs:
            return None
        options = {"slope_rad": "--slope", "floor_roughness_m": "--floor-roughness", "model_file": "--model"}
        found = []
        for name, (field, _) in WALK.items():
            value = settings.walk.get(field)
            if value is not None:
                option = options.get(field, "--" + name.replace("_", "-"))
                found += [option, str(value)]  # every digit, to repeat the same run
        return found

    @staticmethod
    def band(band: dict[str, Any], path: str) -> Band:
        """[band] of a plan. UserError for what it cannot be."""
        names = tuple(field.name for field in dataclasses.fields(Band))
        only(band, names, f"{path}: [band]")
        shares = {}
        for name, value in band.items():
            share = in_base_units(value, SHARES) if isinstance(value, str) else value
            if share is None or not is_number(share) or not 0.0 < share < 10.0:
                raise UserError(f"{path}: [band] {name} = {value!r}: a share such as 0.15 or '15 %' is expected")
            shares[name] = float(share)
        return Band(**shares)

    @staticmethod
    def gaits(records: list[Record], since_ns: int) -> list[dict[str, float]]:
        """The gait of each record from `since_ns` on."""
        return [dataclasses.asdict(gait(record, since_ns)) for record in records]

    @staticmethod
    def condition(wanted: str) -> Any:
        """A condition of the robot."""
        return condition(wanted)

    @staticmethod
    def version() -> str:
        """Empty: it is all in our own sources."""
        return ""

    @staticmethod
    def judge(
        proof: Proof, golden: Record, record: Record, since_ns: int, band: Band, is_sweep: bool
    ) -> dict[str, Any]:
        """Outcome, why, the gait and the golden one's, and the distance between them."""
        here = gait(record, since_ns)
        there = gait(golden, since_ns, record.end_ns)
        outcome, why = classify(proof, here, there, damage(record, since_ns), band)
        if outcome != "invalid":
            fell_ms = None if golden.fell_ns < 0 else (golden.fell_ns - since_ns) * 1e-6
            outcome, why = against_fallen(outcome, why, fell_ms, golden.fall_cause, is_sweep)
        return {
            "outcome": outcome,
            "why": why,
            "gait": dataclasses.asdict(here),
            "golden_gait": dataclasses.asdict(there),
            "deviation": deviation(here, there, band),
        }


def written(path: pathlib.Path, base: str, values: dict[str, float], explained: str) -> str:
    """Write a parameter file over `base` with these values; returns its name."""
    lines = [f"base = {json.dumps(str(base))}", "", "[parameters]"]
    lines += [f"{name} = {value!r}" for name, value in values.items()]
    lines += ["", f"[{explained}]", *(f'{name} = "set by a campaign"' for name in values)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return str(path)


WALKS = Walks()
