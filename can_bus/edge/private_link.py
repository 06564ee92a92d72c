"""A client's place on a bus inside this process."""

import threading
from collections.abc import Callable

from ranger_sim.can_bus.edge.links import (
    BUS_OFF_TEXT,
    FOR_EVER,
    LISTENING_TEXT,
    RECEIVE_QUEUE,
    STALE_S,
    Link,
    LinkError,
)
from ranger_sim.can_bus.edge.paced import PacedBus, alone_and_passive
from ranger_sim.can_bus.edge.taps import ERROR_PASSIVE, FULL, NOT_ON_BUS, Event
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.events import NEVER


class PrivateBus:
    """A bus inside this process, shared by its links; it ends with the last of them."""

    def __init__(self, paced: PacedBus) -> None:
        self.paced = paced
        self.lock = threading.RLock()
        self.links: list[PrivateLink] = []
        self.due = NEVER  # the next time of interest; threads that wait for time to pass sleep no longer than this

    def pass_time(self) -> int:
        """Advance to now and give every link its events. Returns the next time of interest, ns. The lock is held.

        When that time becomes earlier, every sleeping thread wakes, because all may sleep until the former one.
        """
        while True:
            due = self.paced.advance()
            for link in self.links:
                events = link.tap.events
                if events:
                    link.tap.events = []
                    link.take_events(events)
            if due > self.paced.time:  # otherwise there was more work than one call does
                break
        if due < self.due:
            for link in self.links:
                link.changed.notify_all()
        self.due = due
        return due


class PrivateLink(Link):
    """A client's place on a private bus of this process."""

    acknowledge_hint = "acknowledge=True adds a silent node that does"

    def __init__(
        self,
        bus: PrivateBus,
        label: str,
        listen_only: bool = False,
        receive_own: bool = False,
        queue_limit: int = RECEIVE_QUEUE,
        fd: bool = False,
    ) -> None:
        super().__init__(label, receive_own, queue_limit)
        self.bus = bus
        self.bitrate = bus.paced.bitrate
        self.data_bitrate = bus.paced.bus.data_bitrate
        self.changed = threading.Condition(bus.lock)
        self.pump: threading.Thread | None = None
        with bus.lock:
            self.tap = bus.paced.add(label, fd)
            if listen_only:
                self.tap.listen(bus.paced.time)
            bus.links.append(self)
            bus.pass_time()

    def take_events(self, events: list[Event]) -> None:
        """Take the events of the bus; the lock is held."""
        epoch = self.bus.paced.epoch_ns
        for event in events:
            self._arrive((event[0], event[1] + epoch, *event[2:]))
        self._raise_signal()
        self.changed.notify_all()

    def send(self, identifier: int, flags: int, lo: int, hi: int, timeout: float | None) -> None:
        """Queue a frame, waiting up to `timeout` s for a place.

        None: as long as frames are being sent. Raises QueueFullError where no node is left to acknowledge.
        """
        with self.changed:
            self._check()
            if self.bus.paced.speed != 0.0:
                self.bus.pass_time()
            answer = self.tap.offer(identifier, flags, lo, hi)
            if answer == FULL:
                self._wait(lambda: self.tap.queued < self.tap.depth or timeout is None and self._unheard(), timeout)
                answer = self.tap.offer(identifier, flags, lo, hi)
            self._check()
            if answer == FULL:
                raise self._full()
            if answer == NOT_ON_BUS:
                if self.tap.off:
                    raise LinkError(f"{self.label}: {BUS_OFF_TEXT}")
                raise LinkError(f"{self.label}: {LISTENING_TEXT}")
            self.bus.pass_time()

    def activate(self) -> None:
        """Take part again."""
        with self.changed:
            self._check()
            self.tap.activate(self.bus.paced.time)
            self.bus.pass_time()

    def listen(self) -> None:
        """Receive only."""
        with self.changed:
            self._check()
            self.bus.pass_time()
            self.tap.listen(self.bus.paced.time)
            self.bus.pass_time()

    def flush(self) -> None:
        """Drop the frames that wait to be sent."""
        with self.changed:
            self._check()
            self.tap.flush(self.bus.paced.time)
            self.bus.pass_time()

    def present_state(self) -> int:
        """The controller's state now."""
        with self.changed:
            if not self.closed:
                self.bus.pass_time()
            return self.tap.state

    def fileno(self) -> int:
        """A descriptor that is readable while `receive` has something. By the clock, a thread advances the time."""
        with self.changed:
            self._check()
            if self.signal < 0:
                self._make_signal()
                if self.bus.paced.speed != 0.0:
                    self.pump = threading.Thread(target=self._pump, name=f"time of {self.label}", daemon=True)
                    self.pump.start()
            return self.signal

    def _pump(self) -> None:
        """Advance the time while all other threads only watch the descriptor."""
        with self.changed:
            while not self.closed:
                due = self.bus.pass_time()
                self.changed.wait(STALE_S if due >= NEVER else min(self.bus.paced.seconds_until(due), STALE_S))

    def close(self) -> None:
        """Leave the bus; queued frames are still sent while another client is there."""
        with self.changed:
            if self.closed:
                return
            self.bus.pass_time()
            self.closed = True
            self.bus.links.remove(self)
            self.bus.paced.taps.remove(self.tap)
            self.bus.pass_time()
            self.changed.notify_all()
        if self.pump is not None and self.pump is not threading.current_thread():
            self.pump.join()
        self._close_signal()

    def _unheard(self) -> bool:
        """True while no node can acknowledge the frames that wait on the bus."""
        return self.tap.state == ERROR_PASSIVE and alone_and_passive(self.bus.paced.bus)

    def _check(self) -> None:
        if self.closed:
            raise LinkError(f"{self.label}: is shut down")

    def _wait(self, ready: Callable[[], bool], timeout: float | None) -> None:
        """Wait until `ready()` or the time is over; advances the bus's time."""
        end = FOR_EVER if timeout is None else wallclock.monotonic_s() + max(timeout, 0.0)
        while True:
            due = self.bus.pass_time()
            if ready() or self.closed:
                return
            left = end - wallclock.monotonic_s()
            if left <= 0.0:
                return
            pause = min(left, STALE_S)
            if due < NEVER:
                pause = min(pause, self.bus.paced.seconds_until(due))
            if pause > 0.0:
                self.changed.wait(pause)
