"""A board of the robot whose firmware is C. Separate from native_boards.py: other walks need no cffi."""

import cython

from ranger_sim.boards.counters import RangerCounters
from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.foundation.user_error import FirmwareError
from ranger_sim.harness.firmware.table_board import TableBoard
from ranger_sim.ranger.firmware.native_boards import PLACES, hardware_of, table_version


@cython.cclass
class RobotNativeBoard(TableBoard):
    """Board `name` of the robot with a firmware in C, instead of the emulated one."""

    module: object

    def __init__(self, name, firmware, crystal, power_up_ns, record=None) -> None:
        table = PLACES[name].table
        TableBoard.__init__(
            self, name, firmware, table.CONTROLLER, crystal, power_up_ns, hardware_of(name), table_version(), record
        )
        self.module = ErrorModule(table.BOARD_NUMBER, NetworkTime())

    @property
    def errors(self):
        """How often its program recorded each error, where it reports that (`firmware_error_totals`); otherwise 0."""
        self.module.totals = self.error_totals(len(self.module.totals))
        return self.module

    @property
    def adc_external(self):
        """Its external converter, where faults of it act."""
        return self._started(self.devices.adcxs)

    @property
    def adc_internal(self):
        """Its chip's own converter."""
        return self._started(self.devices.adcs)

    def _started(self, devices):
        """The one device of a kind."""
        if 0 not in devices:
            raise FirmwareError(f"{self.name}: its program has not started the {devices.what}")
        return devices.at(0)

    def counters(self) -> object:
        """The board's counters; its program's own queues are not known."""
        return RangerCounters(
            hz=self.hz,
            unclaimed=self.unclaimed,
            slots=self.scheduler.counters(),
            can=self.can_counters(),
            time_ms=self.network_time_ms(),
            errors=list(self.errors.totals),
        )
