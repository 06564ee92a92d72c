# Generated from harness/lockstep.py and harness/lockstep.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.firmware_sim.board import Board
from ranger_sim.harness.records.sampler import Sampler
from ranger_sim.harness.step_watch import SerialDevice
from ranger_sim.harness.step_watch import StepEnd
from ranger_sim.harness.wiring.board_wires import BoardWires
from ranger_sim.plant.plant import Plant
from typing import Any
from typing import final

REACHED_TIME: int
REACHED_STEPS: int
REACHED_DISTANCE: int
FELL: int
A_WATCHER_STOPPED: int
WINDOW_NS: int
ANY_DISTANCE_M: float

@final
class Lockstep:
    plant: Plant
    boards: list[Any]
    buses: list[Any]
    wires: list[Any]
    word_wires: list[Any]
    encoder_wires: list[Any]
    time: int
    window_ns: int
    stop_steps: int
    stop_distance_m: float
    sampler: Sampler
    strikes: StepEnd | None
    watchers: list[Any]
    serial_device: SerialDevice | None
    encoder_boards: MutableSequence[int]
    due: MutableSequence[int]
    came: MutableSequence[int]
    prompt: MutableSequence[int]
    step_times: MutableSequence[int]
    side_by_side: bool
    stop_wanted: bool
    def __init__(self, plant: Plant, boards: Any, buses: list[Any], sampler: Sampler, start_ns: int) -> None: ...
    def _put(self, place: Any, board: Any) -> None: ...
    def _seat(self) -> None: ...
    def _hear(self, place: Any) -> None: ...
    def place(self, name: Any) -> int: ...
    def board(self, name: Any) -> Board: ...
    def add(self, board: Any) -> BoardWires: ...
    def replace(self, board: Any) -> None: ...
    def hears_in_its_slots(self, board: Any) -> None: ...
    def connect_encoder(self, encoder: Any, board: Any, pin_a: Any, pin_b: Any) -> None: ...
    def connect_voltage(self, source: Any, board: Any, channel: Any) -> None: ...
    def connect_word(self, source: Any, board: Any, word: Any) -> None: ...
    def connect_link(self, master: Any, slave: Any, exchange_ns: Any, idle_segment: Any) -> None: ...
    def connect_serial_device(self, device: Any, board: Any, uart: Any) -> None: ...
    def connect_serial_line(self, board: Any, uart: Any, line: Any) -> None: ...
    def stop_at(self, steps: Any, distance_m: Any) -> None: ...
    def run(self, until: int) -> int: ...
