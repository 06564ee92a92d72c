"""A board of the robot whose firmware is C. Apart from native_boards.py: a walk without such a board needs no cffi."""

from typing import Any

from ranger_sim.boards.counters import RangerCounters
from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.firmware_sim.native.native_board import NativeBoard, Started
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

    @property
    def adc_external(self) -> Any:
        """Its external converter, where faults of it act."""
        return self._started(self.devices.adcxs)

    @property
    def adc_internal(self) -> Any:
        """Its chip's own converter."""
        return self._started(self.devices.adcs)

    def _started(self, devices: Started) -> Any:
        """The one device of a kind."""
        if 0 not in devices:
            raise UserError(f"{self.name}: its program has not started the {devices.what}")
        return devices[0]

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
