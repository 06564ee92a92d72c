# Generated from boards/main_brain/board.py and boards/main_brain/board.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.firmware_board import FirmwareBoard
from ranger_sim.boards.main_brain.data_link import DataLink
from ranger_sim.boards.main_brain.estimator import Estimator
from ranger_sim.boards.main_brain.io_data import IoData
from ranger_sim.boards.main_brain.mode_machine import ModeMachine
from ranger_sim.boards.modules.ssp_link import MainBrainSspLink
from ranger_sim.datatable.store import DataStore
from ranger_sim.firmware_sim.peripherals.ssp import SspPort
from ranger_sim.firmware_sim.peripherals.uart_hs import HsUart
from ranger_sim.firmware_sim.scheduler import Schedule
from ranger_sim.foundation.events import EventQueue
from typing import Any
from typing import NamedTuple

EXECUTION_TIMER_HZ: int
EXECUTION_TIMER_MHZ: int
HEARTBEAT_BIT: int
HEARTBEAT_MS: int
SEGMENT_CYCLES: int
COMPUTER_PORTS: dict[str, ComputerPort]
LIGHTS: Any
TRANSMIT_CHANNEL: int
RESTART_SLOT: int
DMA_SLOT: int
DMA_CYCLES: int
RESTART_CYCLES: int

class ComputerPort(NamedTuple):
    uart: int
    rate: int
    cts_pin: int

class MainBrainBoard(FirmwareBoard):
    distribution: Any
    controller: Any
    program: str
    store: DataStore
    ssp: SspPort
    link: MainBrainSspLink
    io: IoData
    computer_uart: HsUart
    computer: DataLink
    estimator: Estimator
    modes: ModeMachine
    heartbeat_on: bool
    execution_time_folds: bool
    heartbeat_bit: int
    heartbeat_until: int
    execution_time_id: int
    def __init__(self, crystal: Any, quirks: Any, phase_ns: Any = 0, controller: Any = 'record-2011') -> None: ...
    def load_controller(self, controller: Any) -> None: ...
    def move_memory(self, words: Any) -> None: ...
    def watched(self) -> int: ...
    def counters(self) -> Any: ...
    def schedule(self) -> Schedule: ...
    def on_segment(self, queue: EventQueue) -> None: ...
    def beat(self) -> None: ...
    def refresh_lights(self) -> None: ...
    def store_execution_time(self) -> None: ...
    def id_out_of_range(self) -> None: ...
