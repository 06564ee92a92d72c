"""The robot of the backends `vcan` and `hardware`: buses outside, virtual time released by the wall clock.

Boards that run here are in this process. While the test does something else than passing time, virtual time stands
still, and frames from outside wait in the interface.
"""

from __future__ import annotations

import socket
from pathlib import Path
from typing import Any

from ranger_sim.boards.quirks import Quirks
from ranger_sim.firmware_sim.board import Board
from ranger_sim.foundation import descriptors, wallclock
from ranger_sim.foundation.events import NEVER
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness import wiring
from ranger_sim.harness.processes.hardware import HardwareInTheLoop
from ranger_sim.harness.processes.outside import move_bus
from ranger_sim.harness.profile import Profile
from ranger_sim.harness.ranger import Ranger
from ranger_sim.harness.scenario import Scenario, StopRule
from ranger_sim.harness.testing.backends import HARDWARE, VCAN, MissingError

SLICE_S = 0.0005  # virtual time between two looks at the wall clock: one slot of a motor board, as in `up`
RESET = 1  # mode of a bus node


class Elsewhere(Board):
    """Stands for board `built`, which is outside or absent: it does nothing."""

    def __init__(self, built: Any) -> None:
        Board.__init__(self, built.name)
        self.inbox = built.inbox
        self.memory = built.memory
        self.built = built

    def advance(self, until: int) -> int:
        """Nothing happens; what comes is lost."""
        self.inbox.clear()
        self.next_time = NEVER
        return NEVER

    def listen_to_edges(self, buffer: Any, pin: int, partner_pin: int) -> None:
        """Edges at its pins are lost."""

    def counters(self) -> Any:
        """Nothing is counted."""
        return self.built.counters()


class OutsideRobot(Ranger):
    """`outside`: {bus: keywords of python-can}. The other buses stay inside. speed: virtual seconds per second."""

    def __init__(
        self,
        scenario: Scenario,
        log: str,
        quirks: Quirks | None,
        profile: Profile | None,
        outside: dict[str, dict[str, Any]],
        speed: float,
    ) -> None:
        from ranger_sim.can_bus.edge.external_bus import ExternalBus, opener  # python-can: only where it is used

        if not 1e-4 <= speed <= 1000.0:
            raise UserError(f"speed is {speed!r}, allowed are 0.0001 to 1000")
        Ranger.__init__(self, scenario, log, quirks, profile)
        self.backend = VCAN if profile is None else HARDWARE
        self.speed = speed
        self.here = profile.emulated() if profile is not None else wiring.BOARDS
        rates = {bus.name: bus.bitrate for bus in self.buses}
        self.outside = [ExternalBus(name, rates[name], opener(name, each)) for name, each in outside.items()]
        for name in set(wiring.BOARDS) - set(self.here):
            self._leave_out(name)
        try:
            for each in self.outside:
                move_bus(self, each, {}, self.here)
        except UserError as reason:
            self.close()
            raise MissingError(f"backend {self.backend}: {reason}") from None
        self.elsewhere: HardwareInTheLoop | None = None
        if profile is not None and (profile.external() or profile.absent()):
            self.elsewhere = HardwareInTheLoop(self, profile, self.outside)

    def _leave_out(self, name: str) -> None:
        """Board `name` is not run here, and is on no emulated bus."""
        self.loop.replace(Elsewhere(self.boards[name]))
        wires = self.loop.wires[self.loop.place(name)]
        for bus, node in zip(wires.buses, wires.nodes, strict=True):
            if bus is not None:
                bus.set_mode(node, RESET, self.loop.time)

    def run(self, stop: StopRule, slice_s: float = 1.0) -> bool:
        """Pass time, not before the wall clock has come so far."""
        begun_ns, begun_s = self.loop.time, wallclock.monotonic_s()
        end_ns = begun_ns + round(slice_s * 1e9)
        while self.loop.time < end_ns:
            due_s = begun_s + (self.loop.time - begun_ns) * 1e-9 / self.speed
            self._wait(due_s)
            if Ranger.run(self, stop, min(SLICE_S, (end_ns - self.loop.time) * 1e-9)):
                return True
        return False

    def _wait(self, due_s: float) -> None:
        """Until the wall clock is there; what comes from outside meanwhile is read at once."""
        numbers = [number for end in self.polled for number in end.filenos()]
        while (left := due_s - wallclock.monotonic_s()) > 0.0:
            if descriptors.wait(numbers, [], min(left, SLICE_S))[0]:
                self.poll_now()

    def summary(self) -> dict:
        """As of a robot inside; boards that are elsewhere have not failed."""
        found = Ranger.summary(self)
        found["failed_boards"] = [name for name in found["failed_boards"] if name in self.here]
        return found


def vcan_buses() -> dict[str, dict[str, Any]]:
    """can1 ... can4 on vcan0 ... vcan3; MissingError where there are none."""
    names = [f"vcan{number}" for number in range(4)]
    lacks = [name for name in names if not Path("/sys/class/net", name).exists()]
    if not hasattr(socket, "AF_CAN") or lacks:
        raise MissingError(
            f"backend vcan: this machine has no {', '.join(lacks) or 'SocketCAN'} "
            "(`ranger-sim vm -- pytest ...` runs tests on one that has)"
        )
    return {f"can{number}": {"interface": "socketcan", "channel": name} for number, name in enumerate(names, start=1)}


def buses_of_profile(profile: Profile | None) -> dict[str, dict[str, Any]]:
    """The buses that a profile puts on interfaces; UserError when there is no profile, or it has none of them."""
    if profile is None:
        raise UserError("backend hardware: a profile says what is real: --ranger-profile my.toml")
    found = {name: keywords for name, bus in profile.buses.items() if (keywords := bus.python_can()) is not None}
    if not found:
        raise UserError(f"backend hardware: the profile {profile.name} puts no bus on an interface")
    return found
