"""A board of the robot whose program in C runs in another process, in place of it in this one."""

from typing import Any

from ranger_sim.boards.counters import RangerCounters
from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.firmware_sim.native.stand_in import StandIn
from ranger_sim.ranger.firmware.native_boards import PLACES, hardware_of


class RobotStandIn(StandIn):
    """Board `name`, described by the trial of its program; what a person sees of the board is here."""

    def __init__(self, name: str, crystal: Any, found: Any) -> None:
        hardware = hardware_of(name)
        StandIn.__init__(self, name, hardware.hz, crystal, found)
        if hardware.panel is not None:
            self.carry(hardware.panel(self))
        self.errors = ErrorModule(PLACES[name].table.BOARD_NUMBER, NetworkTime())

    def counters(self) -> RangerCounters:
        """Zeros: its program has not run."""
        return RangerCounters(
            hz=self.hz,
            unclaimed=0,
            slots=self.scheduler.counters(),
            can=[],
            time_ms=0,
            errors=list(self.errors.totals),
        )
