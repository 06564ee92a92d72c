# Generated from firmware_sim/arm7/core.py and firmware_sim/arm7/core.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.foundation.user_error import UserError
from typing import Any
from typing import final

WRITTEN_BITS: int
USER: int
FAST: int
INTERRUPT: int
SUPERVISOR: int
ABORT: int
UNDEFINED: int
SYSTEM: int
IRQ_LINE: int
FIQ_LINE: int
STATE: int
LOOK_CYCLES: int
MODES: tuple[int, ...]
DEVICE_WAITS: int
BRIDGE_BASE: int
MAM_TIMING: int

class ProcessorError(UserError):
    pass

class BusFault(ProcessorError):
    address: Any
    pc: Any
    def __init__(self, text: Any, address: Any, pc: Any) -> None: ...

def memory(what: Any, size: Any) -> Any: ...
def put(words: Any, place: Any, content: Any) -> None: ...

class Device:
    def read(self, address: int, size: int) -> int: ...
    def write(self, address: int, size: int, value: int) -> int: ...

@final
class Core:
    pc: int
    following: int
    cycles: int
    began: int
    instructions: int
    n: int
    z: int
    c: int
    v: int
    carry: int
    control: int
    lines: int
    faulted: int
    stopped: int
    flash_base: int
    flash_size: int
    ram_base: int
    ram_size: int
    line: int
    data_line: int
    mam_mode: int
    mam_timing: int
    device_waits: int
    bridge_base: int
    cycles_per_instruction: int
    trail: MutableSequence[int]
    ahead: MutableSequence[int]
    ready: MutableSequence[int]
    ram_open: int
    flash_open: int
    takes_aborts: bool
    armed: bool
    debugger: Any
    hit: Any
    points: set[Any]
    watches: tuple[Any, ...]
    stepping: int
    passing: int
    return_pc: int
    return_mode: int
    next_look: int
    fault_address: int
    r: MutableSequence[int]
    high: MutableSequence[int]
    banked: MutableSequence[int]
    saved: MutableSequence[int]
    flash: MutableSequence[int]
    ram: MutableSequence[int]
    device: Any
    bridge: Device | None
    written: MutableSequence[int]
    name: str
    def __init__(self, flash_size: int = 262144, ram_size: int = 16384, flash_base: int = 0, ram_base: int = 1073741824, device: Any = None, name: str = 'ARM7TDMI') -> None: ...
    def reset(self) -> None: ...
    def connect(self, device: Any) -> None: ...
    def stop(self) -> None: ...
    def set_mam(self, mode: Any, timing: Any) -> None: ...
    def forget_flash(self) -> None: ...
    def place(self, address: Any, content: Any) -> None: ...
    def peek(self, address: Any) -> int: ...
    def cpsr(self) -> int: ...
    def spsr(self) -> int: ...
    def set_spsr(self, value: Any) -> None: ...
    def set_cpsr(self, value: int) -> int: ...
    def bank_now(self) -> int: ...
    def run(self, until: int) -> int: ...
    def step(self) -> int: ...
    def halt(self, error: Any) -> None: ...
    def set_points(self, points: Any, watches: Any) -> None: ...
    def go_on(self, step: Any) -> None: ...
    def rearm(self) -> None: ...
    def state_into(self, into: MutableSequence[int] | memoryview[int]) -> int: ...
