"""A robot under test by a plain call: `new_robot(seed=3, warmed_up="step 3")`; the fixture `ranger` does the same.

with contextlib.closing(new_robot(seed=3)) as robot:
    robot.until("step 5")
    assert_healthy(robot)
"""

from __future__ import annotations

import dataclasses
import os
import pathlib
from collections.abc import Mapping
from typing import Any

from ranger_sim.boards.quirks import Quirks
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.firmware.native_firmware import Firmware
from ranger_sim.harness.outside.profile import load as load_profile
from ranger_sim.harness.testing.backends import HARDWARE, PROCESSES, SIM, VCAN, check_backend
from ranger_sim.harness.testing.counts import counting
from ranger_sim.harness.testing.health import Expected, Health
from ranger_sim.harness.testing.making import made
from ranger_sim.ranger.firmware import native_boards
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario

SCENARIO_FIELDS = tuple(field.name for field in dataclasses.fields(Scenario))
OTHERS = (
    "quirks", "profile", "warmed_up", "backend", "speed", "log", "trace",
    "firmware", "in_process", "sanitize", "counts",
)  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Order:
    """The description of a robot. Equal orders give equal robots, so one that has been warmed up can serve for another.

    warmed_up: a condition of ranger/conditions.py that holds before the test begins; empty for a new robot.
    speed: virtual seconds per second where time is released by the wall clock.
    """

    scenario: Scenario = Scenario()
    quirks: Quirks | None = None
    profile: str | None = None
    warmed_up: str = ""
    backend: str = SIM
    speed: float = 1.0
    log: str = "none"
    trace: bool = False  # keep a timeline (`robot.observed.timeline`)
    firmware: tuple[tuple[str, str], ...] = ()  # (board, folder) of those that run C
    in_process: bool | None = None  # their programs run in the test's process; None: the maker of the robot decides
    sanitize: bool = False  # compiled with sanitizers
    counts: str = ""  # compiled for coverage, which goes to this folder

    @property
    def seed(self) -> int:
        """Seed of the scenario."""
        return self.scenario.seed

    @property
    def branches(self) -> bool:
        """Whether a robot that is warmed up can be branched by forking."""
        return bool(self.warmed_up) and not self.firmware and self.backend == SIM and self.log != "full"

    def describe(self) -> str:
        """Its settings, in a line of a report."""
        scenario = self.scenario
        return f"seed {scenario.seed}, controller {scenario.controller}, body {scenario.body}, backend {self.backend}"

    def arguments(self) -> list[str]:
        """Options of pytest that reproduce it."""
        chosen = ["--ranger-seed", str(self.seed), "--ranger-backend", self.backend]
        return chosen + (["--ranger-profile", self.profile] if self.profile else [])

    def fresh(self) -> Ranger:
        """The robot at power-up, on its backend."""
        profile = load_profile(self.profile) if self.profile is not None else None
        firmware = {name: built(folder, self.sanitize, self.counts) for name, folder in self.firmware}
        if firmware and self.backend in (VCAN, HARDWARE):
            raise UserError(f"backend {self.backend}: firmware in C runs on the backends {SIM} and {PROCESSES}")
        if self.backend == PROCESSES:
            from ranger_sim.harness.testing.process_per_board import ProcessPerBoard

            return Ranger(self.scenario, self.log, self.quirks, profile, firmware, mode=ProcessPerBoard())
        if self.backend in (VCAN, HARDWARE):
            from ranger_sim.ranger.testing.outside_robot import buses_of_profile, outside_robot, vcan_buses

            outside = vcan_buses() if self.backend == VCAN else buses_of_profile(profile)
            return outside_robot(self.scenario, self.log, self.quirks, profile, outside, self.speed)
        return Ranger(self.scenario, self.log, self.quirks, profile, firmware, bool(self.in_process))


def built(folder: str | os.PathLike, sanitize: bool = False, counts: str = "") -> Firmware:
    """A folder of firmware in C, compiled for a test."""
    firmware = native_boards.build(pathlib.Path(folder), sanitize, bool(counts))
    return counting(firmware, counts) if counts else firmware


def order_of(wanted: Mapping[str, Any]) -> Order:
    """The order in keywords: fields of Scenario, and those above. UserError for an unknown keyword."""
    unknown = [name for name in wanted if name not in (*SCENARIO_FIELDS, *OTHERS)]
    if unknown:
        allowed = ", ".join((*SCENARIO_FIELDS, *OTHERS))
        raise UserError(f"ranger({', '.join(unknown)}=...): what can be asked for is {allowed}")
    scenario = Scenario(**{name: value for name, value in wanted.items() if name in SCENARIO_FIELDS})
    others = {name: value for name, value in wanted.items() if name in OTHERS and value is not None}
    check_backend(others.get("backend", SIM))
    if "firmware" in others:
        given = others["firmware"]
        if not isinstance(given, Mapping):
            raise UserError(f"ranger(firmware={given!r}): boards and folders are expected, as {{'MCH': 'hip'}}")
        others["firmware"] = tuple(sorted((native_boards.known(name), str(folder)) for name, folder in given.items()))
    return Order(scenario, **others)


def new_robot(**wanted: Any) -> Ranger:
    """A robot: `new_robot(seed=3, controller="robust", backend="processes", warmed_up="step 3")`. Close it when done.

    Its frames are kept from power-up (`robot.wire`). MissingError when this machine does not support the backend.
    """
    return robot_of(order_of(wanted))


def robot_of(order: Order) -> Ranger:
    """The ordered robot, warmed up."""
    robot: Ranger = made(order)
    return robot


def assert_healthy(robot: Ranger, **expected: Any) -> None:
    """AssertionError for an event since power-up that no healthy robot has; `expected` as in `Expected`."""
    faults = Health(robot, from_power_up=True).faults(Expected(**expected))
    if faults:
        raise AssertionError("\n".join(["the robot is not healthy:", *(f"  {line}" for line in faults)]))
