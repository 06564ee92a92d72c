# Generated from firmware_sim/peripherals/can_controller.py and firmware_sim/peripherals/can_controller.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.can_bus.node import ICR_BUS_ERROR as ICR_BUS_ERROR
from ranger_sim.can_bus.node import ICR_ERROR_PASSIVE as ICR_ERROR_PASSIVE
from ranger_sim.can_bus.node import ICR_ERROR_WARNING as ICR_ERROR_WARNING
from ranger_sim.can_bus.node import ICR_RECEIVING as ICR_RECEIVING
from ranger_sim.can_bus.transmit_ends import TransmitEnds
from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.vic import InterruptSource
from typing import Any
from typing import final

MOD_RESET: int
CMR_TR: int
CMR_AT: int
CMR_RRB: int
CMR_CDO: int
CMR_SRR: int
CMR_STB1: int
CMR_STB2: int
CMR_STB3: int
ICR_RI: int
ICR_TI1: int
ICR_DOI: int
ICR_ALI: int
ICR_TI2: int
ICR_TI3: int
ENDED_1: int
ENDED_2_3: int
TI2_SHIFT: int
SR_RBS: int
SR_DOS: int
SR_TBS: int
SR_TCS: int
SR_ES: int
SR_BS: int
SR_BUFFER_BITS: int
GSR_RX_ERRORS_SHIFT: int
GSR_TX_ERRORS_SHIFT: int
ERROR_COUNTER_MASK: int
DLC_MASK: int
DLC_SHIFT: int
RTR_SHIFT: int
FF_SHIFT: int
EIGHT_BYTES: int
RFS_EIGHT_BYTES: int

def btr_value(brp: Any, sjw: Any, tseg1: Any, tseg2: Any, sam: Any = 0) -> int: ...
def bit_rate_of(btr: Any, hz: Any) -> float: ...
def sample_point_of(btr: Any) -> float: ...

@final
class CanController(Peripheral):
    rx_source: InterruptSource
    tx_source: InterruptSource
    MOD: int
    ends: TransmitEnds
    @property
    def IER(self) -> int: ...
    end_interrupts: int
    ended: int
    noted: int
    number: int
    rx_count: int
    tx_status: MutableSequence[int]
    RFS: int
    RID: int
    RDA: int
    RDB: int
    second_RFS: int
    second_RID: int
    second_RDA: int
    second_RDB: int
    received: int
    sent: int
    requests: int
    TFI: MutableSequence[int]
    TID: MutableSequence[int]
    TDA: MutableSequence[int]
    TDB: MutableSequence[int]
    data_overruns: int
    lost: int
    aborted: int
    refused: int
    overrun: bool
    bus_off: bool
    error_warning: bool
    tx_errors: int
    rx_errors: int
    BTR: int
    error_source: InterruptSource
    def __init__(self, chip: Any, number: int = 1, btr: int = 2441217, IER: int = ...) -> None: ...
    def transmit_ends(self) -> Any: ...
    def bit_rate(self) -> float: ...
    def free_at(self, buffer: int, time: int) -> bool: ...
    def buffer_free(self, buffer: int) -> bool: ...
    def tell_end(self, buffer: int) -> None: ...
    def tell_first_end(self) -> None: ...
    def write_IER(self, value: int) -> None: ...
    def transmit(self, buffer: int, identifier: int, flags: int, lo: int, hi: int) -> bool: ...
    def transmit_if_free(self, buffer: int, identifier: int, flags: int, lo: int, hi: int) -> bool: ...
    def write_CMR(self, command: int) -> int: ...
    def on_message(self, queue: Any) -> InterruptSource | None: ...
    def release(self) -> None: ...
    def write_MOD(self, mode: int) -> None: ...
    def read_ICR(self) -> int: ...
    @property
    def ICR(self) -> int: ...
    def SR(self) -> int: ...
    def GSR(self) -> int: ...
