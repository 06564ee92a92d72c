"""A CAN controller's error interrupt as error codes: the same chain of tests on every board."""

from collections.abc import Callable

from ranger_sim.datatable.generated import errors as codes
from ranger_sim.firmware_sim.peripherals.can_controller import (
    ICR_BUS_ERROR,
    ICR_ERROR_PASSIVE,
    ICR_ERROR_WARNING,
    ICR_RECEIVING,
    CanController,
)
from ranger_sim.firmware_sim.peripherals.can_controller_base import ICR_DOI

OPERATING = 0  # CxMOD: not in reset


class CanErrors:
    """The error interrupt of one controller; `report(code)` receives the codes."""

    def __init__(self, controller: CanController, report: Callable[[int], object]) -> None:
        self.controller = controller
        self.report = report
        prefix = f"CAN{controller.number}_"
        self.bus_off = getattr(codes, prefix + "TX_BUSOFF")
        self.warning = getattr(codes, prefix + "ERR_WARN")
        self.overrun = getattr(codes, prefix + "DATA_OVRN")
        self.passive = getattr(codes, prefix + "ERR_PASS")
        self.while_receiving = getattr(codes, prefix + "BUS_RX")
        self.while_sending = getattr(codes, prefix + "BUS_TX")

    def check(self) -> None:
        """Restart after bus-off, then read CxICR and report each cause; a data overrun is not cleared."""
        if self.controller.bus_off:
            self.controller.write_MOD(OPERATING)
            self.report(self.bus_off)
        cause = self.controller.read_ICR()
        if cause & ICR_ERROR_WARNING:
            self.report(self.warning)
        if cause & ICR_DOI:
            self.report(self.overrun)
        if cause & ICR_ERROR_PASSIVE:
            self.report(self.passive)
        if cause & ICR_BUS_ERROR:
            self.report(self.while_receiving if cause & ICR_RECEIVING else self.while_sending)
