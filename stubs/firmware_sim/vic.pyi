# Generated from firmware_sim/vic.py and firmware_sim/vic.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.foundation.events import EventQueue
from typing import Any
from typing import final

FIQ: int
IRQ_SLOTS: int
FIRST_FIQ: int
MOST_FIQ_SOURCES: int
TIMER_MATCH: int
EXTERNAL_INTERRUPT: int
ADC_DONE: int
SPI_DONE: int
UART_TRANSMIT: int
SLOT_TIMER: int
SOFTWARE: int
DMA_DONE: int
LINES: dict[Any, str]
FIQ_LATENCY: int
IRQ_LATENCY: int

@final
class InterruptSource:
    bit: int
    code: int
    owner: int
    latency_ns: int
    base_ns: int
    base_cycles: int
    served: int
    per_item: int
    requested: int
    noted: int
    noted_cycles: int
    noted_most: int
    merged: int
    forgotten: int
    handler: Any
    service: Any
    controller: InterruptController | None
    kind: int
    index: int
    number: int
    cost: int
    latency: int
    slot: int
    name: str
    time: int
    order: int
    a: int
    b: int
    c: int
    d: int
    e: int
    f: int
    ref: Any
    def __init__(self, kind: int, index: int, controller: InterruptController | None = None) -> None: ...
    @property
    def attached(self) -> bool: ...
    @property
    def pending(self) -> Any: ...
    @property
    def requests(self) -> int: ...
    @property
    def total_cycles(self) -> int: ...
    @property
    def max_cycles(self) -> int: ...
    def serve_by(self, service: Any) -> None: ...
    def settle(self) -> None: ...
    def keep_message(self, queue: EventQueue) -> None: ...
    def give_message(self, queue: EventQueue) -> None: ...
    def serve_message(self, queue: EventQueue) -> Any: ...

@final
class InterruptController:
    pending: int
    newest: InterruptSource
    fiq_list: list[Any]
    irq_list: list[Any]
    ns_per_cycle: float
    sources: dict[Any, Any]
    def __init__(self, ns_per_cycle: float = ...) -> None: ...
    def source(self, kind: int, index: int) -> InterruptSource: ...
    def attach(self, kind: Any, index: Any, handler: Any, cost: Any, per_item: Any = 0, slot: Any = 0, latency: Any = None, name: Any = None) -> Any: ...
    def retune(self, ns_per_cycle: Any) -> None: ...
    def detach(self, source: Any) -> None: ...
    def raise_source(self, source: InterruptSource, time: int) -> bool: ...
    def take_first(self) -> InterruptSource: ...
