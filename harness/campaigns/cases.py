"""One run of a campaign: what is set before power-up, and the fault; and the machine that it makes."""

import dataclasses
import hashlib
import json
import math
import pathlib
import tempfile
from typing import Any

from ranger_sim import __version__, datatable, loading
from ranger_sim.foundation.user_error import CampaignError, UserError, unknown
from ranger_sim.harness.campaigns.subjects import own_machine
from ranger_sim.harness.campaigns.walks import WALKS
from ranger_sim.harness.ranger import Ranger
from ranger_sim.harness.scenario import Scenario

# What decides the outcome of a run: the sources and data of these packages.
ROOMS = ("foundation", "datatable", "can_bus", "plant", "firmware_sim", "boards", "harness")
SOURCES = {".py", ".pxd", ".toml", ".csv"}


def version(machine: str = "") -> str:
    """Package version, table hash and digest of the sources: results of another version are not this one's.

    machine: as of Settings; its own files count as well.
    """
    total = hashlib.blake2b(digest_size=16)
    for room in ROOMS:
        for path in sorted((loading.PACKAGE / room).rglob("*")):
            if path.suffix in SOURCES and "__pycache__" not in path.parts:
                total.update(path.relative_to(loading.PACKAGE).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    own = subject_of(machine).version()
    return f"{__version__}+{datatable.table_hash()[:12]}.{total.hexdigest()[:16]}" + (f".{own}" if own else "")


@dataclasses.dataclass(frozen=True)
class Settings:
    """What is set before power-up.

    walk: fields of Scenario; controller, body: single values over those of the sets that `walk` names; costs:
    {"MCH.mc_compliant_control": factor} on the modelled cycles of a task. machine: FILE.py:NAME of the user's own one
    (subjects.py); `walk` then has its keywords. Empty: Ranger.
    """

    walk: dict[str, Any] = dataclasses.field(default_factory=dict)
    controller: dict[str, float] = dataclasses.field(default_factory=dict)
    body: dict[str, float] = dataclasses.field(default_factory=dict)
    costs: dict[str, float] = dataclasses.field(default_factory=dict)
    machine: str = ""

    @property
    def subject(self) -> Any:
        """The subject of its runs: makes the machine, has its faults, judges it."""
        return subject_of(self.machine)

    def as_dict(self) -> dict[str, Any]:
        """As plain types for JSON; the same settings give the same text."""
        found: dict[str, Any] = {
            name: dict(sorted(value.items())) for name, value in dataclasses.asdict(self).items() if name != "machine"
        }
        return {**found, "machine": self.machine} if self.machine else found

    def text(self) -> str:
        """Canonical text, for keys and for grouping."""
        return json.dumps(self.as_dict(), sort_keys=True)

    def robot(self) -> Any:
        """A new robot, or machine, with these settings. UserError for settings that it does not have."""
        robot = self.subject.machine(self.walk) if self.machine else self._ranger()
        for task, factor in self.costs.items():
            board, _, entry = task.partition(".")
            if board not in robot.boards:
                raise CampaignError(f"campaign: cost.{task}: {unknown('board', board, robot.boards)}")
            try:
                found = robot.boards[board].scheduler.find(entry)
            except UserError as error:
                raise CampaignError(f"campaign: cost.{task}: {error}") from None
            if not 0.0 <= factor < math.inf:
                raise CampaignError(f"campaign: cost.{task} is {factor:g}, a factor of 0 or more is expected")
            found.cost, found.per_item = round(found.cost * factor), round(found.per_item * factor)
        return robot

    def _ranger(self) -> Ranger:
        with tempfile.TemporaryDirectory(prefix="ranger-sim-campaign-") as name:
            folder = pathlib.Path(name)
            walk = dict(self.walk)
            if self.controller:
                base = walk.get("controller", Scenario.controller)
                walk["controller"] = written(folder / "controller.toml", base, self.controller, "reasons")
            if self.body:
                base = walk.get("body", Scenario.body)
                walk["body"] = written(folder / "body.toml", base, self.body, "sources")
            try:
                return Ranger(Scenario(**walk))
            except TypeError as error:
                raise CampaignError(f"campaign: walk: {error}") from None


def subject_of(machine: str) -> Any:
    """The subject of Settings.machine."""
    return own_machine(machine) if machine else WALKS


def written(path: pathlib.Path, base: str, values: dict[str, float], explained: str) -> str:
    """Write a parameter file over `base` with these values; returns its name."""
    lines = [f"base = {json.dumps(str(base))}", "", "[parameters]"]
    lines += [f"{name} = {value!r}" for name, value in values.items()]
    lines += ["", f"[{explained}]", *(f'{name} = "set by a campaign"' for name in values)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return str(path)


@dataclasses.dataclass(frozen=True)
class Case:
    """One run. `fault` as typed, None for a sweep of settings; `reference`: of the golden run, where other.

    axes: what the plan varied, by name, for the tables; it is not part of the key.
    """

    settings: Settings
    fault: str | None = None
    reference: Settings | None = None
    axes: dict[str, Any] = dataclasses.field(default_factory=dict, compare=False)

    def key(self, version: str, watch: dict[str, Any]) -> str:
        """Key of a result: what was run, by which version, and how it was monitored."""
        settings = self.settings.as_dict()
        whole: dict[str, Any] = {"settings": settings, "fault": self.fault, "version": version, "watch": watch}
        if self.reference is not None:
            whole["reference"] = self.reference.as_dict()
        if self.settings.machine:  # independent of its folder; the version covers the content
            for each in (settings, whole.get("reference", {})):
                each.pop("machine", None)
        return hashlib.blake2b(json.dumps(whole, sort_keys=True).encode(), digest_size=10).hexdigest()

    def golden(self) -> Settings:
        """The settings of the golden run."""
        return self.reference if self.reference is not None else self.settings
