"""Trace digests of short runs: python -m tests.system.digest_of CASES, a JSON list of what `Case` holds.

Prints a line for each case: the digest, then what has happened by its end.
"""

import contextlib
import dataclasses
import json
import sys

from ranger_sim.boards.quirks import Quirks
from ranger_sim.harness.outside import profile
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario


@dataclasses.dataclass(frozen=True)
class Case:
    """One run of `seconds` after power-up; all else is as in `ranger-sim walk`."""

    seconds: float
    seed: int = 1
    uptime_ms: int = 0
    controller: str = "record-2011"
    floor_roughness_m: float = 0.0
    slope_rad: float = 0.0
    body: str = "ranger"
    firmware_2016: bool = False
    profile: str = ""


def outcome(case: Case) -> str:
    """BLAKE2b-256 of the run's trace; how many steps and frames it had, and whether the robot is on its feet."""
    scenario = Scenario(
        controller=case.controller,
        body=case.body,
        seed=case.seed,
        slope_rad=case.slope_rad,
        floor_roughness_m=case.floor_roughness_m,
        start_uptime_ms=case.uptime_ms,
    )
    quirks = Quirks.firmware_2016() if case.firmware_2016 else None
    with contextlib.closing(
        Ranger(scenario, quirks=quirks, profile=profile.load(case.profile) if case.profile else None)
    ) as robot:
        robot.run_for(case.seconds)
        frames = sum(bus.counters.frames for bus in robot.buses)
        return f"{robot.trace_digest()} {robot.steps} steps {frames} frames {robot.ended or 'on its feet'}"


if __name__ == "__main__":
    for each in json.loads(sys.argv[1]):
        print(outcome(Case(**each)), flush=True)
