"""A board of the robot whose firmware is C. Apart from native_boards.py: a walk without such a board needs no cffi."""

from typing import Any

from ranger_sim.boards.counters import RangerCounters
from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.firmware_sim.native.native_board import NativeBoard
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.native_boards import PLACES, Firmware, hardware_of, table_version


class RobotNativeBoard(NativeBoard):
    """Board `name` of the robot with a firmware in C, in the place of the emulated one."""

    def __init__(self, name: str, firmware: Firmware, crystal: Any, power_up_ns: int) -> None:
        hardware = firmware.manifest.hardware if firmware.manifest.hardware is not None else hardware_of(name)
        NativeBoard.__init__(self, name, firmware.library, crystal, power_up_ns, hardware)
        version = self.library.table_version
        if version is not None and version != table_version():
            raise UserError(
                f"{firmware.library}: compiled with version 0x{version:08X} of the master table, "
                f"this robot has 0x{table_version():08X}: build it again"
            )
        controller = PLACES[name].table.CONTROLLER
        if controller not in self.devices.cans:
            raise UserError(
                f"{firmware.library}: firmware_start() does not start CAN controller {controller}, "
                f"on which {name}'s bus hangs (fw_can_start)"
            )
        self.module = ErrorModule(PLACES[name].table.BOARD_NUMBER, NetworkTime())

    @property
    def errors(self) -> ErrorModule:
        """How often its program noted each error, where it says so (`firmware_error_totals`); else never."""
        self.module.totals = self.error_totals(len(self.module.totals))
        return self.module

    def counters(self) -> object:
        """What the board counted; its program's own queues are not known."""
        return RangerCounters(
            hz=self.hz,
            unclaimed=self.unclaimed,
            slots=self.scheduler.counters(),
            can=self.can_counters(),
            time_ms=self.network_time_ms(),
            errors=list(self.errors.totals),
        )
