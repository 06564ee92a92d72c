# Generated from firmware_sim/lpc2194/board.py and firmware_sim/lpc2194/board.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.firmware_sim.arm7.core import Core
from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.firmware_sim.counters import BoardCounters
from ranger_sim.firmware_sim.counters import ProcessorCounters
from ranger_sim.firmware_sim.counters import SlotCounters
from ranger_sim.firmware_sim.lpc2194.address_map import AddressMap
from ranger_sim.firmware_sim.lpc2194.block import Clocks
from ranger_sim.firmware_sim.lpc2194.can import CanFilterBlock
from ranger_sim.firmware_sim.lpc2194.converter import ConverterBlock
from ranger_sim.firmware_sim.lpc2194.hardware import BoardHardware
from ranger_sim.firmware_sim.lpc2194.image import Image
from ranger_sim.firmware_sim.lpc2194.pins import PinSelectBlock
from ranger_sim.firmware_sim.lpc2194.system import SystemBlock
from ranger_sim.firmware_sim.lpc2194.timer import ProgrammedTimer
from ranger_sim.firmware_sim.lpc2194.vic import VicBlock
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from typing import Any
import dataclasses

STINT: int
LONGEST_PASS: int
DOUBTS: int
SLOT_SHARES: int
PART_WORDS: int

@dataclasses.dataclass(frozen=True)
class ImageCounters(BoardCounters):
    processor: ProcessorCounters | None = ...

class ImageBoard(Microcontroller):
    core: Core
    map: AddressMap
    vic_block: VicBlock
    system: SystemBlock
    pin_select: PinSelectBlock
    converter: ConverterBlock
    acceptance: CanFilterBlock
    can_blocks: list[Any]
    asking: list[Any]
    image: Any
    clocks: Clocks
    skips_idle: bool
    asleep: bool
    idle: bool
    pass_looks: bool
    base_cycles: int
    base_ns: int
    running_to: int
    slot_match: ProgrammedTimer
    slots_begun: int
    slot_begin: int
    worked_until: int
    most_cycles: int
    all_cycles: int
    slots_by_cycles: MutableSequence[int]
    pass_cycles: int
    pass_instructions: int
    idle_cycles: int
    idle_instructions: int
    doubts: int
    kept_registers: MutableSequence[int]
    now_registers: MutableSequence[int]
    kept_ram: MutableSequence[int]
    waits: MutableSequence[int]
    def __init__(self, name: str, image: Image, crystal: Crystal | None = None, phase_ns: int = 0, hardware: BoardHardware | None = None) -> None: ...
    def _build(self, hardware: Any) -> None: ...
    def time_of(self, cycles: int) -> int: ...
    def set_clocks(self, cclk: Any, divider: Any) -> None: ...
    def retune(self, ppb: Any, now: Any) -> None: ...
    def sleep(self) -> None: ...
    def advance(self, until: int) -> int: ...
    def _learn(self, instructions: Any) -> None: ...
    def speaks_from(self) -> int: ...
    def quiet_until(self) -> int: ...
    def stop_at(self, time: int) -> int: ...
    def catch_up(self) -> None: ...
    def counters(self) -> Any: ...
    def latest_slot(self) -> int: ...
    def slot_counters(self) -> SlotCounters: ...
    def processor_counters(self) -> ProcessorCounters: ...
    def can_counters(self) -> list[Any]: ...
