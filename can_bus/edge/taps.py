"""Clients of an emulated bus: each is a node of it, with a queue of frames to send and a list of received events.

Every kind of client (python-can, the attach protocol, slcan, socketcand) uses a `Tap`.
"""

import functools
from collections import deque
from typing import Any

from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.edge import linux_errors
from ranger_sim.can_bus.fd_frame import LONGEST, fault_of_fd_flags, fd_data_length
from ranger_sim.can_bus.frame import HIGHEST_EXTENDED, HIGHEST_STANDARD, LENGTH_CODE, arbitration_key
from ranger_sim.can_bus.node import BUS_OFF, OPERATING, PASSIVE_LIMIT, RESET
from ranger_sim.can_bus.transmit_buffers import BUFFERS
from ranger_sim.foundation.events import (
    CAN_RX,
    CAN_STATUS,
    CAN_TX_DONE,
    FLAG_EXTENDED,
    FLAG_FD,
    FLAG_REMOTE,
    NEVER,
    STAGE_BUS,
    TX_SENT,
    EventQueue,
)

# Kinds of event, the first field of each entry of `Tap.events`.
RECEIVED = 1  # time_ns, identifier, flags, lo, hi; with FLAG_ERROR an error frame, see linux_errors.py
SENT = 2  # the same for our frame that is on the bus whole
DROPPED = 3  # the same for our frame that was never sent whole
STATE = 4  # time_ns, state, transmit errors, receive errors, 0

# States of a tap: those of ISO 11898-1, and two that a client chooses or waits for.
ERROR_ACTIVE = 0
ERROR_PASSIVE = 1
OFF = 2  # bus-off
LISTENING = 3  # receives without acknowledging, sends nothing

# Results of `Tap.offer`.
QUEUED = 0
FULL = 1
NOT_ON_BUS = 2  # bus-off or listening only

TRANSMIT_QUEUE = 64  # frames; chosen by us, because at 3 Mbit/s it holds 3 ms: more than a poll every 1 ms needs
TAP_LIMIT = 16  # clients of one bus, including those that left and still send; chosen by us: each receives every frame
LINGER_NS = 1_000_000_000  # how long a client that left may still send what it had queued; chosen by us
ORDER = STAGE_BUS * 256 + 255  # after every board's controller; a tap's inbox has no other source

Event = tuple[int, int, int, int, int, int]  # kind and its fields, as above


@functools.lru_cache(maxsize=4096)
def _key(identifier: int, kind: int) -> int:
    """Arbitration field of a frame, cached: a client mostly sends the same identifiers again."""
    key: int = arbitration_key(identifier, kind)
    return key


def overflow_frame(time_ns: int) -> Event:
    """The error frame for an overrun: frames are missing here, because the reader was too slow."""
    return (RECEIVED, time_ns, *linux_errors.overflow())


def fault_of_frame(identifier: int, flags: int, lo: int, hi: int, fd: bool = False) -> str:
    """Error message for a frame that a client wants to send; empty when it is valid. `fd`: CAN FD frames are."""
    limit = HIGHEST_EXTENDED if flags & FLAG_EXTENDED else HIGHEST_STANDARD
    if not 0 <= identifier <= limit:
        return f"identifier {identifier:#x} is above {limit:#x}"
    if fd and flags & FLAG_FD:
        if hi >> 8 * (LONGEST - 4):
            return f"more than {LONGEST} data bytes"
        return fault_of_fd_flags(flags)
    if flags & ~(LENGTH_CODE | FLAG_REMOTE | FLAG_EXTENDED) or flags & LENGTH_CODE > 8:
        return f"flags {flags:#x} are not a classic data or remote frame of 0 ... 8 bytes"
    if lo >> 32 or hi >> 32:
        return "a data word has more than 32 bits"
    return ""


class Tap:
    """One client's controller on a bus. Frames leave in the order in which they were offered.

    `events` collects events, oldest first: (kind, time_ns, identifier, flags, lo, hi); its owner
    empties it. `hi` of a CAN FD frame holds all bytes from the fifth on, here and in what is offered. `poll` must be
    called with times that are never before the bus's time.
    """

    def __init__(self, bus: Bus, name: str, depth: int = TRANSMIT_QUEUE) -> None:
        self.bus = bus
        self.depth = depth
        self.inbox = EventQueue(64)
        self.node = bus.add_node(name, self.inbox, 1, ORDER)
        self.controller: Any = bus.nodes[self.node]
        self.refresh(name)

    def refresh(self, name: str) -> None:
        """Reset: nothing queued, error counters zero."""
        self.controller.renew(name)
        self.controller.listening = True
        self.inbox.clear()
        self.name = name
        self.waiting: deque[tuple[int, int, int, int]] = deque()
        self.loaded: deque[tuple[int, int, tuple[int, int, int, int]]] = deque()  # buffer, arbitration key, frame
        self.events: list[Event] = []
        self.off = False
        self.silent = False
        self.counters = (0, 0)
        self.leaving = False
        self.leave_by = NEVER
        self.held = False  # its reader is behind: a bus without a clock waits for it
        self.sent = 0
        self.received = 0
        self.dropped = 0

    @property
    def state(self) -> int:
        """ERROR_ACTIVE, ERROR_PASSIVE, OFF or LISTENING."""
        if self.off:
            return OFF
        if self.silent:
            return LISTENING
        return ERROR_PASSIVE if max(self.counters) >= PASSIVE_LIMIT else ERROR_ACTIVE

    @property
    def queued(self) -> int:
        """Frames offered and not yet on the bus."""
        return len(self.waiting) + len(self.loaded)

    def offer(self, identifier: int, flags: int, lo: int, hi: int) -> int:
        """Queue a frame (already checked with `fault_of_frame`): QUEUED, FULL or NOT_ON_BUS."""
        if self.off or self.silent:
            return NOT_ON_BUS
        if len(self.waiting) + len(self.loaded) >= self.depth:
            return FULL
        self.waiting.append((identifier, flags, lo, hi))
        return QUEUED

    def poll(self, now: int) -> None:
        """Process the events of the bus up to `now` (ns) and fill free transmit buffers."""
        inbox = self.inbox
        while inbox.head_time <= now:
            inbox.take()
            if inbox.kind == CAN_RX:
                hi = inbox.e if inbox.ref is None else int.from_bytes(inbox.ref[4:], "little")
                self.events.append((RECEIVED, inbox.time, inbox.b, inbox.c, inbox.d, hi))
                self.received += 1
            elif inbox.kind == CAN_TX_DONE:
                self._done(inbox.time, inbox.b, inbox.c)
            elif inbox.kind == CAN_STATUS:
                self._status(inbox.time, inbox.b, inbox.c, inbox.d, bool(inbox.e))
        if self.waiting and len(self.loaded) < BUFFERS:
            self._load(now)

    def _load(self, now: int) -> None:
        """Move waiting frames into transmit buffers as far as that keeps their order.

        A controller offers its lowest identifier first, and of equal ones the lowest buffer.
        """
        loaded, waiting = self.loaded, self.waiting
        if self.controller.mode == RESET or self.controller.mode == BUS_OFF:
            return  # just plugged in, or about to be notified that it is off
        while waiting and len(loaded) < BUFFERS:
            frame = waiting[0]
            key = _key(frame[0], frame[1] & (FLAG_REMOTE | FLAG_EXTENDED))
            buffer = 1
            if loaded:
                last_buffer, last_key, _ = loaded[-1]
                if key < last_key:
                    return
                used = [entry[0] for entry in loaded]
                above = last_buffer if key == last_key else 0
                buffer = next((b for b in range(1, BUFFERS + 1) if b > above and b not in used), 0)
                if buffer == 0:
                    return
            waiting.popleft()
            loaded.append((buffer, key, frame))
            if frame[1] & FLAG_FD:
                identifier, flags, lo, hi = frame
                data = (lo | hi << 32).to_bytes(LONGEST, "little")[: fd_data_length(flags)]
                self.bus.request_fd(self.node, buffer, now, identifier, flags, data)
            else:
                self.bus.request(self.node, buffer, now, *frame)

    def _done(self, time: int, buffer: int, status: int) -> None:
        """The frame in a buffer has been sent, or will not be."""
        if self.loaded and self.loaded[0][0] == buffer:
            frame = self.loaded.popleft()[2]
        else:
            entry = next((entry for entry in self.loaded if entry[0] == buffer), None)
            if entry is None:
                return
            self.loaded.remove(entry)
            frame = entry[2]
        if status == TX_SENT:
            self.sent += 1
            self.events.append((SENT, time, *frame))
        else:
            self._drop(time, frame)

    def _drop(self, time: int, frame: tuple[int, int, int, int]) -> None:
        self.dropped += 1
        self.events.append((DROPPED, time, *frame))

    def _status(self, time: int, interrupts: int, transmit_errors: int, receive_errors: int, off: bool) -> None:
        """Report changed counters, a changed state or an error frame, as one error frame and a state.

        A repeated attempt that changes neither is not reported: a sender without acknowledgement, once it is error
        passive, repeats for ever, and its passive flags are not visible on the wire.
        """
        counters = (transmit_errors, receive_errors)
        if counters == self.counters and off == self.off:
            return
        frame = linux_errors.frame_of_status(interrupts, counters, self.off, off)
        self.counters, self.off = counters, off
        if frame is not None:
            self.events.append((RECEIVED, time, *frame))
        self.report_state(time)
        if off:
            while self.waiting:
                self._drop(time, self.waiting.popleft())

    def report_state(self, time: int) -> None:
        """Add the present state to the events."""
        self.events.append((STATE, time, self.state, *self.counters, 0))

    # ---- requests of a client

    def activate(self, now: int) -> None:
        """Take part again: from listening only at once, from bus-off after its 128 recessive sequences."""
        if self.silent:
            self._unmute()
            self.report_state(now)
        elif self.off:
            self.bus.set_mode(self.node, OPERATING, now)

    def listen(self, now: int) -> None:
        """Receive without acknowledging and without sending. Queued frames are dropped."""
        if self.silent or self.controller.mode == BUS_OFF:
            return
        self.flush(now)
        self.silent = True
        self.bus.set_silent(self.node, True)
        self.report_state(now)

    def _unmute(self) -> None:
        self.silent = False
        self.bus.set_silent(self.node, False)

    def flush(self, now: int) -> None:
        """Drop waiting frames; a frame under way is completed."""
        while self.waiting:
            self._drop(now, self.waiting.popleft())
        for buffer, _, _ in self.loaded:
            self.bus.abort(self.node, buffer, now)

    def leave(self, now: int) -> None:
        """Leave the bus, dropping waiting frames."""
        if self.silent:
            self._unmute()
        if self.controller.mode == BUS_OFF:
            self.controller.unplug()  # the next client is a new controller
        else:
            self.bus.set_mode(self.node, RESET, now)


class Taps:
    """All clients of one bus. `time`: the virtual time (ns) of the last poll."""

    def __init__(self, bus: Bus, depth: int = TRANSMIT_QUEUE) -> None:
        self.bus = bus
        self.depth = depth
        self.time = 0
        self.taps: list[Tap] = []
        self.leaving = 0  # clients that left and still send
        self.spare: list[Tap] = []  # nodes whose clients left: a bus cannot lose a node

    @property
    def full(self) -> bool:
        """True while no more clients fit."""
        return len(self.taps) >= TAP_LIMIT

    def add(self, name: str, fd: bool = True) -> Tap:
        """Add a client; it is on the bus at once, or after 11 recessive bits when it takes the place of another.

        On a CAN FD bus a client without `fd` is a classic node, which answers CAN FD frames with error frames.
        """
        for tap in self.spare:
            if tap.controller.mode == RESET:
                self.spare.remove(tap)
                tap.refresh(name)
                self.bus.set_mode(tap.node, OPERATING, self.time)
                break
        else:
            tap = Tap(self.bus, name, self.depth)
        if self.bus.is_fd:
            self.bus.set_classic(tap.node, not fd)
        self.taps.append(tap)
        return tap

    def remove(self, tap: Tap) -> None:
        """Remove a client that is gone; its queued frames are still sent, if a node is there to acknowledge them."""
        if tap not in self.taps or tap.leaving:
            return
        tap.leaving = True
        tap.controller.listening = False  # no client reads it any more: received events would be wasted work
        self.leaving += 1
        tap.leave_by = self.time + LINGER_NS
        self._see_off(tap)

    def _see_off(self, tap: Tap) -> None:
        tap.events.clear()
        if not tap.queued or tap.off or self.bus.operating < 2 or self.time > tap.leave_by:
            tap.leave(self.time)
            self.leaving -= 1
            self.taps.remove(tap)
            self.spare.append(tap)

    def poll(self, now: int) -> int:
        """Poll every client; clients that left and have nothing more to send are taken off the bus.

        Returns the first time (ns) at which a client has something to receive, or NEVER.
        """
        self.time = now
        due = NEVER
        for tap in self.taps:
            head: int = tap.inbox.head_time
            if head <= now or tap.waiting:
                tap.poll(now)
                head = tap.inbox.head_time
            if head < due:
                due = head
        if self.leaving:
            for tap in [tap for tap in self.taps if tap.leaving]:
                self._see_off(tap)
        return due

    @property
    def queued(self) -> bool:
        """True while a client has frames to send."""
        return any(tap.waiting or tap.loaded for tap in self.taps)


def taps_of(bus: "Bus | Taps") -> tuple[Taps, bool]:
    """(the clients of a bus, whether they were created here and so must be polled by the caller)."""
    if isinstance(bus, Taps):
        return bus, False
    return Taps(bus), True
