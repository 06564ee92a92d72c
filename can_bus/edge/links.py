"""A client's place on a bus, as used by our python-can bus; `attached_link.py` and `private_link.py` implement it for
buses elsewhere and here.

A link is used from any number of threads. No thread is started here, except in `PrivateLink.fileno` by the clock.
"""

import logging
import os
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress

from ranger_sim.can_bus.edge.taps import DROPPED, ERROR_ACTIVE, SENT, STATE, Event, overflow_frame
from ranger_sim.foundation import systems, wallclock

log = logging.getLogger("can.ranger_sim")

RECEIVE_QUEUE = 100_000  # frames kept for a reader; chosen by us: 20 MB, and 4 s of all four of Ranger's buses
# Without a timeout a sender waits for a place as long as frames are sent. If an error-passive controller's queue does
# not move for this long, no node acknowledges (SocketCAN reports at once that there is no buffer space); chosen by us:
# hundreds of attempts of the longest frame at 125 kbit/s.
UNHEARD_S = 1.0
# A `receive` under way when its link is closed waits for the rest of its time, but no longer than this: a program may
# close a bus and then stop the thread that reads it (python-can's Notifier waits 1 s at a time).
RUN_OUT_S = 1.0
STALE_S = 60.0  # a wait without a limit is cut into pieces of this length
FOR_EVER = 1e18
BUS_OFF_TEXT = "bus-off, nothing can be sent (state = ACTIVE asks for recovery)"
LISTENING_TEXT = "listening only, nothing can be sent"


class LinkError(Exception):
    """Sending or receiving failed; the text gives the bus and the reason."""


class QueueFullError(LinkError):
    """A frame found no place in the transmit queue in time."""


class Link:
    """A place on a bus: received frames, frames to send, the state of the controller."""

    acknowledge_hint = ""  # actions of a client that is alone
    data_bitrate = 0  # of a CAN FD bus, bit/s

    def __init__(self, label: str, receive_own: bool, queue_limit: int) -> None:
        self.label = label
        self.receive_own = receive_own
        self.queue_limit = queue_limit
        self.arrived: deque[Event] = deque()
        self.changed = threading.Condition()
        self.state = ERROR_ACTIVE
        self.counters = (0, 0)
        self.lost_frames = 0  # dropped because no reader took them here
        self.missed_frames = 0  # dropped before they arrived here
        self.dropped_frames = 0  # our frames that were never sent
        self.sent_frames = 0
        self.closed = False
        self.overflowing = False
        self.signal = -1  # eventfd that is readable while `arrived` holds something

    def _arrive(self, event: Event) -> None:
        """Add an event of the bus, in order."""
        kind = event[0]
        if kind == STATE:
            self.state, self.counters = event[2], (event[3], event[4])
            return
        if kind == SENT:
            self.sent_frames += 1
            if not self.receive_own:
                return
        elif kind == DROPPED:
            self.dropped_frames += 1
            return
        if len(self.arrived) >= self.queue_limit:
            self.lost_frames += 1
            self.overflowing = True
            return
        if self.overflowing:
            self.overflowing = False
            self.arrived.append(overflow_frame(event[1]))
        self.arrived.append(event)

    def receive(self, timeout: float | None) -> Event | None:
        """The oldest frame, waiting up to `timeout` s (None: without limit).

        None when none arrives in time, or when the link is closed meanwhile. LinkError when it was closed before, or
        when the other side is gone.
        """
        was_closed = self.closed  # read without the lock: others may hold it while they close the link
        with self.changed:
            if was_closed:
                self._check()
            if not self.arrived:
                end = FOR_EVER if timeout is None else wallclock.monotonic_s() + max(timeout, 0.0)
                if not self.closed:
                    self._wait(lambda: bool(self.arrived), timeout)
                if self.closed:
                    self.changed.wait(max(min(end - wallclock.monotonic_s(), RUN_OUT_S), 0.0))
                    return None
            event = self._take()
            if event is None:
                self._check()
            return event

    def _wait(self, ready: Callable[[], bool], timeout: float | None) -> None:
        """Wait until `ready()`, the time is over, or nothing more will happen."""
        raise NotImplementedError

    def _check(self) -> None:
        """Raise LinkError when this link no longer works."""
        raise NotImplementedError

    def _take(self) -> Event | None:
        """The oldest frame that has arrived, or None."""
        if not self.arrived:
            return None
        event = self.arrived.popleft()
        if self.signal >= 0 and not self.arrived:
            with suppress(BlockingIOError):
                os.eventfd_read(self.signal)
        return event

    def _raise_signal(self) -> None:
        if self.signal >= 0 and self.arrived:
            os.eventfd_write(self.signal, 1)

    def _make_signal(self) -> None:
        if not systems.is_linux():
            raise NotImplementedError("a descriptor to wait on exists on Linux only")
        self.signal = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._raise_signal()

    def _close_signal(self) -> None:
        if self.signal >= 0:
            os.close(self.signal)
            self.signal = -1

    def _full(self) -> QueueFullError:
        """Message for a frame that found no place."""
        return QueueFullError(f"{self.label}: the transmit queue stayed full{self._why()}")

    def _why(self) -> str:
        if self.state == ERROR_ACTIVE:
            return ""
        return f" (error passive, counters {self.counters}: no node acknowledges? {self.acknowledge_hint})"
