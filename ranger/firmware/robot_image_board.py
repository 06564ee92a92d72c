"""A board of the robot that runs a firmware image. Separate from image_boards.py: other walks load no processor."""

from typing import Any

from ranger_sim.boards.counters import RangerCounters
from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.datatable.generated import csr, mcfi, mcfo, mch, mcsi, ui
from ranger_sim.firmware_sim.lpc2194.board import ImageBoard
from ranger_sim.firmware_sim.lpc2194.image import Image
from ranger_sim.ranger.firmware.image_boards import hardware_of

TABLES: dict[str, Any] = {"MCH": mch, "MCFO": mcfo, "MCFI": mcfi, "MCSI": mcsi, "UI": ui, "CSR": csr}


class RobotImageBoard(ImageBoard):
    """Board `name` of the robot with a firmware image, instead of the emulated one.

    Errors that its program only records are unknown here: its errors are those that it sends.
    """

    def __init__(self, name: str, image: Image, crystal: Any, power_up_ns: int) -> None:
        ImageBoard.__init__(self, name, image, crystal, power_up_ns, hardware_of(name))
        self.errors = ErrorModule(TABLES[name].BOARD_NUMBER, NetworkTime())

    @property
    def adc_external(self) -> Any:
        """Its external converter, where faults of it act."""
        return self.system.converter

    @property
    def adc_internal(self) -> Any:
        """Its chip's own converter."""
        return self.converter.adc

    def counters(self) -> object:
        """The board's counters; its program's own queues are not known."""
        return RangerCounters(
            hz=self.hz,
            unclaimed=self.unclaimed,
            slots=self.slot_counters(),
            can=self.can_counters(),
            errors=list(self.errors.totals),
            processor=self.processor_counters(),
        )
