"""The vectored interrupt controller: one fast interrupt (FIQ) and 16 vectored slots (IRQ), slot 0 first.

An `InterruptSource` is one line into the controller. A request is pending until served; a second request
of a pending source merges with it, as on a level-sensitive line. FIQ sources share the one FIQ and are
served in the order in which they were attached. IRQs do not nest; FIQ pre-empts IRQ and code. The event
loop in microcontroller.py serves; this file only keeps the pending sources.
"""

from typing import Final

import cython

from ranger_sim.firmware_sim.calls import code_of, owner_of
from ranger_sim.foundation.events import CAN_RX, CAN_STATUS, CAN_TX_DONE, PIN_EDGE, SSP_SEGMENT, UART_BYTE, EventQueue
from ranger_sim.foundation.user_error import FirmwareError

FIQ: Final = -1
IRQ_SLOTS: Final = 16
FIRST_FIQ: Final = 1 << 16  # in the word of pending sources the FIQ sources are above the slots

MOST_FIQ_SOURCES = 46  # bits of a word of 64, without the sign and the slots

# Kinds of sources that are not messages of foundation/events.py (those use their own numbers below 64).
TIMER_MATCH = 64  # index: timer number; MR0 reached
EXTERNAL_INTERRUPT = 65  # index: EINT number
ADC_DONE = 66  # internal converter
SPI_DONE = 67  # index: SPI number
UART_TRANSMIT = 68  # index: UART number; transmit FIFO empty (THRE)
SLOT_TIMER = 69  # the scheduler's own timer
SOFTWARE = 70  # index free: VICSoftInt
DMA_DONE = 71  # index: DMA channel; transfer complete

# A line's name until a handler with its own name is attached; {} is its index.
LINES = {
    PIN_EDGE: "pin {} edge",
    CAN_RX: "can{} receive",
    CAN_TX_DONE: "can{} transmit",
    CAN_STATUS: "can{} status",
    UART_BYTE: "uart{} receive",
    SSP_SEGMENT: "ssp{} segment",
    TIMER_MATCH: "timer{} match",
    EXTERNAL_INTERRUPT: "eint{}",
    ADC_DONE: "adc{} done",
    SPI_DONE: "spi{} done",
    UART_TRANSMIT: "uart{} transmit",
    SLOT_TIMER: "slot timer {}",
    SOFTWARE: "software {}",
    DMA_DONE: "dma{} done",
}

# ARM7TDMI technical reference manual: an interrupt waits 5 ... 29 cycles for the instruction in progress.
# Chosen by us within that: FIQ with its banked registers 12, IRQ with the read of VICVectAddr 25.
FIQ_LATENCY = 12
IRQ_LATENCY = 25


@cython.final
@cython.cclass
class InterruptSource:
    """One interrupt line. Cycle counts and `requests`, `merged`, `served` are ground truth for tests.

    `bit`: its place in the controller's word of pending sources, 0 while no handler is attached. A service that takes
    `base_cycles` is only counted (`served`), the others are noted with their cycles. A source whose message no
    peripheral stores keeps that one message (`keep_message`): while it waits, a newer message overwrites the older
    one (counted in `merged`).
    """

    # In both classes the fields that every request and every service touches come first, close together.
    bit: cython.longlong
    code: cython.longlong
    owner: cython.longlong
    latency_ns: cython.longlong
    base_ns: cython.longlong
    base_cycles: cython.longlong
    served: cython.longlong
    per_item: cython.longlong
    requested: cython.longlong
    noted: cython.longlong
    noted_cycles: cython.longlong
    noted_most: cython.longlong
    merged: cython.longlong
    forgotten: cython.longlong
    handler: object
    service: object
    controller: "InterruptController"
    kind: cython.longlong
    index: cython.longlong
    number: cython.longlong
    cost: cython.longlong
    latency: cython.longlong
    slot: cython.longlong
    name: str
    time: cython.longlong
    order: cython.longlong
    a: cython.longlong
    b: cython.longlong
    c: cython.longlong
    d: cython.longlong
    e: cython.longlong
    f: cython.longlong
    ref: object

    def __init__(self, kind, index, controller=None) -> None:
        self.controller = controller
        self.kind = kind
        self.index = index
        self.number = 0  # in the order in which the controller's sources were made
        self.requested = 0  # time (ns) of the request that is or was served
        self.name = LINES.get(kind, f"line {kind}/{{}}").format(index)
        self.handler = None
        self.service = None  # what is called: the handler, or before it what gives it the message
        # the two addresses by which compiled code calls `service`
        self.code = 0
        self.owner = 0
        self.cost = 0
        self.per_item = 0
        self.latency = 0
        self.slot = 0
        self.bit = 0
        self.base_cycles = 0
        self.base_ns = 0
        self.latency_ns = 0
        self.served = 0
        self.merged = 0  # requests while it was pending already
        self.forgotten = 0  # pending when it was detached
        self.noted = 0
        self.noted_cycles = 0
        self.noted_most = 0
        self.time = 0
        self.order = 0
        self.a = 0
        self.b = 0
        self.c = 0
        self.d = 0
        self.e = 0
        self.f = 0
        self.ref = None

    @property
    def attached(self) -> bool:
        """True while a handler is attached."""
        return self.bit != 0

    @property
    def pending(self):
        """True while a request waits for its service."""
        return self.controller is not None and self.controller.pending & self.bit != 0

    @property
    def requests(self) -> int:
        """Requests while a handler was attached."""
        return self.served + self.merged + self.forgotten + int(self.pending)

    @property
    def total_cycles(self) -> int:
        """Cycles of all services."""
        return self.noted_cycles + (self.served - self.noted) * self.base_cycles

    @property
    def max_cycles(self) -> int:
        """Cycles of the longest service."""
        return max(self.noted_most, self.base_cycles if self.served > self.noted else 0)

    def serve_by(self, service) -> None:
        """Call `service` when it is served."""
        self.service = service
        self.code = code_of(service, 1)
        self.owner = owner_of(service, 1)

    @cython.cfunc
    @cython.final
    def note(self, cycles: cython.longlong) -> cython.void:
        """Note a service that took `cycles`."""
        self.noted += 1
        self.noted_cycles += cycles
        if cycles > self.noted_most:
            self.noted_most = cycles

    def settle(self) -> None:
        """Note the services so far: their cost is about to change."""
        self.noted_cycles, self.noted_most = self.total_cycles, self.max_cycles
        self.noted = self.served

    @cython.ccall
    def keep_message(self, queue: EventQueue) -> None:
        """Keep the message in the fields of `queue` until it is served."""
        if self.service is self.handler:
            self.serve_by(self.serve_message)
        self.time = queue.time
        self.order = queue.order
        self.a = queue.a
        self.b = queue.b
        self.c = queue.c
        self.d = queue.d
        self.e = queue.e
        self.f = queue.f
        self.ref = queue.ref

    @cython.ccall
    def give_message(self, queue: EventQueue) -> None:
        """Put the kept message into the fields of `queue`, where a handler looks for it."""
        queue.time = self.time
        queue.order = self.order
        queue.kind = self.kind
        queue.a = self.a
        queue.b = self.b
        queue.c = self.c
        queue.d = self.d
        queue.e = self.e
        queue.f = self.f
        queue.ref = self.ref
        self.ref = None

    def serve_message(self, queue: EventQueue) -> object:
        """Call the handler with the kept message."""
        self.give_message(queue)
        return self.handler(queue)


@cython.final
@cython.cclass
class InterruptController:
    """Sources by (kind, index), the pending ones, and their order. `ns_per_cycle`: of this CPU."""

    pending: cython.longlong
    newest: InterruptSource
    fiq_list: list
    irq_list: list
    ns_per_cycle: cython.double
    sources: dict

    def __init__(self, ns_per_cycle=1000.0 / 60.0) -> None:
        self.ns_per_cycle = ns_per_cycle
        self.sources = {}
        self.fiq_list = []
        self.irq_list = [None] * IRQ_SLOTS
        # one bit per source, as in VICIRQStatus (bits 0-15) and VICFIQStatus (from bit 16 on)
        self.pending = 0
        self.newest = None

    @cython.ccall
    def source(self, kind: cython.longlong, index: cython.longlong) -> InterruptSource:
        """The line of (kind, index); made on first use, silent until a handler is attached."""
        found = self.sources.get((kind, index))
        if found is None:
            found = InterruptSource(kind, index, self)
            found.number = len(self.sources)
            self.sources[(kind, index)] = found
        return found

    def attach(self, kind, index, handler, cost, per_item=0, slot=0, latency=None, name=None):
        """Let `handler(queue)` serve (kind, index); returns the source.

        Cycles stolen per service: latency + cost + per_item * (what the handler returns, None counts 0)
        + whatever the handler spends. `slot`: 0 ... 15 (one source each) or FIQ.
        """
        source = self.source(kind, index)
        if not callable(handler):
            raise FirmwareError(f"interrupt {kind}/{index}: handler {handler!r} cannot be called")
        if slot != FIQ and not 0 <= slot < IRQ_SLOTS:
            raise FirmwareError(f"interrupt {kind}/{index}: slot {slot} is neither FIQ (-1) nor 0 ... 15")
        if cost < 0 or per_item < 0:
            raise FirmwareError(f"interrupt {kind}/{index}: cost {cost} and per_item {per_item} must not be negative")
        if slot != FIQ and self.irq_list[slot] not in (None, source):
            raise FirmwareError(f"interrupt {kind}/{index}: slot {slot} is taken by {self.irq_list[slot].name}")
        self.detach(source)
        source.settle()
        source.handler = handler
        source.serve_by(handler)
        source.name = name if name is not None else getattr(handler, "__name__", source.name)
        source.cost = cost
        source.per_item = per_item
        source.slot = slot
        source.latency = latency if latency is not None else (FIQ_LATENCY if slot == FIQ else IRQ_LATENCY)
        source.base_cycles = source.latency + cost
        source.base_ns = int(source.base_cycles * self.ns_per_cycle)
        source.latency_ns = int(source.latency * self.ns_per_cycle)
        if slot == FIQ:
            if len(self.fiq_list) >= MOST_FIQ_SOURCES:
                raise FirmwareError(f"interrupt {kind}/{index}: more than {MOST_FIQ_SOURCES} sources on the FIQ")
            source.bit = FIRST_FIQ << len(self.fiq_list)
            self.fiq_list.append(source)
        else:
            source.bit = 1 << slot
            self.irq_list[slot] = source
        return source

    def retune(self, ns_per_cycle) -> None:
        """Set the duration of the processor's cycles from now on."""
        self.ns_per_cycle = ns_per_cycle
        for source in self.sources.values():
            source.base_ns = int(source.base_cycles * ns_per_cycle)
            source.latency_ns = int(source.latency * ns_per_cycle)

    def detach(self, source) -> None:
        """Take a source out of the controller; a pending request of it is forgotten."""
        if not source.attached:
            return
        source.forgotten += int(source.pending)
        self.pending &= ~source.bit
        if source.slot == FIQ:
            self.fiq_list[self.fiq_list.index(source)] = None
        else:
            self.irq_list[source.slot] = None
        source.bit = 0

    @cython.ccall
    @cython.exceptval(check=False)
    def raise_source(self, source: InterruptSource, time: cython.longlong) -> cython.bint:
        """Request service at `time` (ns); False without a handler, or when the request merged with a pending one."""
        if self.pending & source.bit:
            source.merged += 1
            return False
        if source.bit == 0:
            return False
        self.pending |= source.bit
        self.newest = source
        source.requested = time
        return True

    @cython.ccall
    @cython.boundscheck(False)
    @cython.wraparound(False)
    def take_first(self) -> InterruptSource:
        """The source served now, only while `pending` is not 0: the first FIQ source attached, else the lowest slot."""
        first: InterruptSource = self.newest
        place: cython.longlong
        if self.pending != first.bit:  # not alone, as it nearly always is
            place = IRQ_SLOTS if self.pending >= FIRST_FIQ else 0
            while self.pending >> place & 1 == 0:
                place += 1
            first = self.fiq_list[place - IRQ_SLOTS] if place >= IRQ_SLOTS else self.irq_list[place]
        self.pending ^= first.bit
        return first
