"""Faults on a bus outside that need only frames: another peer on its interface, which does not belong there.

The peer opens the interface again, as each of the robot's controllers has. The wire decides the arbitration of its
frames; an interface without one (SocketCAN's vcan, python-can's virtual) just inserts them.
"""

import collections
from collections.abc import Callable
from typing import Any

from ranger_sim.can_bus.frame import EIGHT_BYTES
from ranger_sim.can_bus.tampering import INTRUDERS_ORDER
from ranger_sim.foundation.events import CAN_REQUEST, FLAG_ERROR, EventQueue

STEP_NS = 250_000  # of the plant, in which faults are called once
MOST_BEHIND = 64  # frames that are sent late; beyond that they are dropped (chosen by us)

Noted = Callable[[int, float], None]


def external_bus(robot: Any, number: int) -> Any:
    """The connection to bus 1 ... 4 where that is outside; None for an emulated one."""
    for end in robot.polled:
        if getattr(end, "name", None) == f"can{number}" and hasattr(end, "add_peer"):
            return end
    return None


class OutsideIntruder:
    """A peer on `external` that sends by itself; `noted(time_ns, difference)` is called for each frame."""

    def __init__(self, external: Any, identifier: int, noted: Noted) -> None:
        self.external = external
        self.identifier = identifier
        self.noted = noted
        self.inbox = EventQueue(64)
        self.peer = external.add_peer(f"{external.name}, intruder", self.inbox, 1, INTRUDERS_ORDER)

    def step(self, now_ns: int) -> None:
        """Act once per step of the plant."""
        self.inbox.clear()
        self.peer.flush(now_ns)

    def send(self, time_ns: int, low: int, high: int, flags: int = EIGHT_BYTES) -> bool:
        """Send one frame; False where the interface does not accept it now."""
        if self.peer.waiting:
            return False
        self.peer.from_board(CAN_REQUEST, time_ns, 1, self.identifier, flags, low, high)
        self.noted(time_ns, 1.0)
        return True

    def leave(self) -> None:
        """Leave the bus."""
        self.external.remove_peer(self.peer)


class OutsideBabbling(OutsideIntruder):
    """Sends one frame every `period_ns`, or one after another (0)."""

    def __init__(self, external: Any, identifier: int, period_ns: int, noted: Noted) -> None:
        OutsideIntruder.__init__(self, external, identifier, noted)
        self.period_ns = period_ns
        self.due_ns = 0

    def step(self, now_ns: int) -> None:
        OutsideIntruder.step(self, now_ns)
        length_ns = self.external.length_ns(self.identifier, EIGHT_BYTES, 0, 0)
        period_ns = max(self.period_ns, length_ns)
        self.due_ns = max(self.due_ns, now_ns - MOST_BEHIND * period_ns)
        while self.due_ns < now_ns + STEP_NS and self.send(max(self.due_ns, now_ns), 0, 0):
            self.due_ns = max(self.due_ns, now_ns) + period_ns


class OutsideDuplicate(OutsideIntruder):
    """Sends, after each frame of `identifier`, one with the bits of `mask` inverted in its first word."""

    def __init__(self, external: Any, identifier: int, mask: int, noted: Noted) -> None:
        OutsideIntruder.__init__(self, external, identifier, noted)
        self.mask = mask
        self.sent: collections.deque[tuple[int, int]] = collections.deque(maxlen=MOST_BEHIND)  # not received back yet
        external.sinks.append(self.receive)

    def receive(self, time_ns: int, identifier: int, flags: int, low: int, high: int) -> None:
        """Handle a frame on the bus; its own are received as well."""
        if identifier != self.identifier or flags & FLAG_ERROR:
            return
        if (low, high) in self.sent:
            self.sent.remove((low, high))
            return
        other = low ^ self.mask, high
        if self.send(time_ns, *other, flags=flags):
            self.sent.append(other)

    def leave(self) -> None:
        self.external.sinks.remove(self.receive)
        OutsideIntruder.leave(self)
