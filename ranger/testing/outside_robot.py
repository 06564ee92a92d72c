"""The robot of the backends `vcan` and `hardware`: buses outside, virtual time released by the wall clock.

Boards that run here are in this process. While the test does not pass time, virtual time
stops, and frames from outside wait in the interface.
"""

from __future__ import annotations

import socket
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ranger_sim.boards.quirks import Quirks
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.outside.machine import move_outside
from ranger_sim.harness.outside.profile import Profile
from ranger_sim.harness.processes.hardware import HardwareInTheLoop
from ranger_sim.harness.testing.backends import HARDWARE, VCAN, MissingError
from ranger_sim.ranger import wiring
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario


def outside_robot(
    scenario: Scenario,
    log: str,
    quirks: Quirks | None,
    profile: Profile | None,
    outside: Mapping[str, Mapping[str, Any]],
    speed: float,
) -> Ranger:
    """`outside`: {bus: keywords of python-can}. The other buses stay inside. speed: virtual seconds per second.

    MissingError when an interface cannot be opened.
    """
    robot = Ranger(scenario, log, quirks, profile)
    robot.backend = VCAN if profile is None else HARDWARE
    here = profile.emulated() if profile is not None else wiring.BOARDS
    try:
        buses = move_outside(robot, outside, here, speed)
    except UserError as reason:
        robot.close()
        raise MissingError(f"backend {robot.backend}: {reason}") from None
    if profile is not None and (profile.external() or profile.absent()):
        HardwareInTheLoop(robot, profile, buses)
    return robot


def vcan_buses() -> dict[str, dict[str, Any]]:
    """can1 ... can4 on vcan0 ... vcan3; MissingError where they are missing."""
    names = [f"vcan{number}" for number in range(4)]
    lacks = [name for name in names if not Path("/sys/class/net", name).exists()]
    if not hasattr(socket, "AF_CAN") or lacks:
        raise MissingError(
            f"backend vcan: this machine has no {', '.join(lacks) or 'SocketCAN'} "
            "(`python -m dev.vm -- pytest ...` runs tests on one that has)"
        )
    return {f"can{number}": {"interface": "socketcan", "channel": name} for number, name in enumerate(names, start=1)}


def buses_of_profile(profile: Profile | None) -> dict[str, dict[str, Any]]:
    """The buses that a profile puts on interfaces; UserError without a profile, or for one without such buses."""
    if profile is None:
        raise UserError("backend hardware: it needs a profile: --ranger-profile my.toml")
    found = {name: keywords for name, bus in profile.buses.items() if (keywords := bus.python_can()) is not None}
    if not found:
        raise UserError(f"backend hardware: the profile {profile.name} puts no bus on an interface")
    return found
