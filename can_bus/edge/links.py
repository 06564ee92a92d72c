"""What stands behind a python-can bus of ours: a client's place on an attached bus, or on a private one.

Both are used from any number of threads. Nothing here starts a thread, but for `PrivateLink.fileno` by the clock.
"""

import logging
import os
import select
import socket
import sys
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress

from ranger_sim.can_bus.edge import attach_records as wire
from ranger_sim.can_bus.edge.paced import PacedBus
from ranger_sim.can_bus.edge.taps import (
    DROPPED,
    ERROR_ACTIVE,
    ERROR_PASSIVE,
    FULL,
    LISTENING,
    NOT_ON_BUS,
    OFF,
    RECEIVED,
    SENT,
    STATE,
    Event,
    overflow_frame,
)
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.events import NEVER
from ranger_sim.foundation.user_error import UserError

log = logging.getLogger("can.ranger_sim")

RECEIVE_QUEUE = 100_000  # frames kept for a reader; chosen by us: 20 MB, and 4 s of all four of Ranger's buses
HANDSHAKE_S = 60.0  # chosen by us: a robot answers once its boards have started, on a slow machine after half a minute
STALE_S = 60.0  # a wait without a limit is cut into pieces of this length
FOR_EVER = 1e18


class LinkError(Exception):
    """Sending or receiving failed; the text says which bus and why."""


class QueueFullError(LinkError):
    """A frame found no place in the transmit queue in time."""


class Link:
    """A place on a bus: frames that came in, room for frames to go out, the state of the controller."""

    def __init__(self, label: str, receive_own: bool, queue_limit: int) -> None:
        self.label = label
        self.receive_own = receive_own
        self.queue_limit = queue_limit
        self.arrived: deque[Event] = deque()
        self.changed = threading.Condition()
        self.state = ERROR_ACTIVE
        self.counters = (0, 0)
        self.lost_frames = 0  # dropped because nobody read them here
        self.missed_frames = 0  # dropped before they came here
        self.dropped_frames = 0  # of ours, that never went out
        self.sent_frames = 0
        self.closed = False
        self.overflowing = False
        self.signal = -1  # eventfd that is readable while `arrived` holds something

    def _arrive(self, event: Event) -> None:
        """An event of the bus, in its turn."""
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
        if not sys.platform.startswith("linux"):
            raise NotImplementedError("a descriptor to wait on exists on Linux only")
        self.signal = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._raise_signal()

    def _close_signal(self) -> None:
        if self.signal >= 0:
            os.close(self.signal)
            self.signal = -1

    def _full(self) -> QueueFullError:
        return QueueFullError(f"{self.label}: the transmit queue stayed full{self._why()}")

    def _why(self) -> str:
        if self.state == ERROR_ACTIVE:
            return ""
        return f" (the controller is error passive, counters {self.counters}: does anybody acknowledge?)"


class AttachedLink(Link):
    """A client's place on a bus of another process. UserError when that process or its channel is not there."""

    def __init__(
        self,
        name: str,
        channel: str,
        listen_only: bool = False,
        receive_own: bool = False,
        queue_limit: int = RECEIVE_QUEUE,
    ) -> None:
        super().__init__(f"{name}/{channel}", receive_own, queue_limit)
        self.socket, welcome = greeted(name, channel, wire.OPTION_LISTEN if listen_only else 0)
        _, self.window, self.bitrate, self.epoch_ns, self.channels, rest = welcome
        self.state = LISTENING if listen_only else ERROR_ACTIVE
        self.incoming = rest
        self.outstanding = 0
        self.reading = False
        self.gone = ""
        self.waiter = select.poll()
        self.waiter.register(self.socket, select.POLLIN)
        self.epoll: select.epoll | None = None
        with self.changed:
            self._understand()  # frames may have come directly behind the welcome

    def send(self, identifier: int, flags: int, lo: int, hi: int, timeout: float | None) -> None:
        """Queue a frame, waiting up to `timeout` s for a place (None: for ever)."""
        with self.changed:
            if self.outstanding >= self.window:
                self._wait(lambda: self.outstanding < self.window, timeout)
                if self.outstanding >= self.window:
                    raise self._full()
            self._check()
            if self.state in (OFF, LISTENING):
                self._read(0.0)
                self._check_state()
            self.outstanding += 1
            self._write(wire.send_record(identifier, flags, lo, hi))

    def _check_state(self) -> None:
        if self.state == OFF:
            raise LinkError(f"{self.label}: bus-off, nothing can be sent (state = ACTIVE asks for recovery)")
        if self.state == LISTENING:
            raise LinkError(f"{self.label}: listening only, nothing can be sent")

    def receive(self, timeout: float | None) -> Event | None:
        """The oldest frame, waiting up to `timeout` s (None: for ever). LinkError when the other side is gone."""
        with self.changed:
            event = self._take()
            if event is None:
                self._wait(lambda: bool(self.arrived), timeout)
                event = self._take()
                if event is None:
                    self._check()
            return event

    def activate(self) -> None:
        """Take part again."""
        self._control(wire.ACTIVATE)

    def listen(self) -> None:
        """Receive only."""
        self._control(wire.LISTEN)

    def flush(self) -> None:
        """Drop what waits to be sent."""
        self._control(wire.FLUSH)

    def present_state(self) -> int:
        """The controller's state as far as the other side has told it."""
        with self.changed:
            if not self.reading and not self.gone and not self.closed:
                self._read(0.0)
            return self.state

    def fileno(self) -> int:
        """A descriptor that is readable when `receive` has something, or may have after a look."""
        with self.changed:
            if self.epoll is None:
                self._make_signal()
                self.epoll = select.epoll()
                self.epoll.register(self.socket, select.EPOLLIN)
                self.epoll.register(self.signal, select.EPOLLIN)
            return self.epoll.fileno()

    def close(self) -> None:
        """Leave; what is queued is still sent by the other side."""
        with self.changed:
            if self.closed:
                return
            self.closed = True
            with suppress(OSError):
                self.socket.shutdown(socket.SHUT_RDWR)  # whoever waits in another thread wakes up
            self.changed.notify_all()
        if self.epoll is not None:
            self.epoll.close()
        self._close_signal()
        self.socket.close()

    def _control(self, wish: int) -> None:
        with self.changed:
            self._check()
            self._write(wire.record(wire.CONTROL, bytes([wish])))

    def _check(self) -> None:
        if self.closed:
            raise LinkError(f"{self.label}: is shut down")
        if self.gone:
            raise LinkError(f"{self.label}: {self.gone}")

    def _write(self, data: bytes) -> None:
        try:
            self.socket.sendall(data)
        except OSError as error:
            self._read(0.0)  # why, if the other side has said it
            self.gone = self.gone or f"the other side has gone ({error.strerror})"
            self._check()

    def _wait(self, ready: Callable[[], bool], timeout: float | None) -> None:
        """Until `ready()`, the time is over or the other side is gone. One thread reads, the others wait for it."""
        end = FOR_EVER if timeout is None else wallclock.monotonic_s() + max(timeout, 0.0)
        first = True
        while not (ready() or self.gone or self.closed):
            left = end - wallclock.monotonic_s()
            if left <= 0.0 and not first:
                return
            first = False
            left = min(max(left, 0.0), STALE_S)
            if self.reading:
                self.changed.wait(left)
            else:
                self._read(left)

    def _read(self, timeout: float) -> None:
        """Everything that has come in, after waiting up to `timeout` s for something. Lets go of the lock meanwhile."""
        if timeout > 0.0:
            self.reading = True
            self.changed.release()
            try:
                self.waiter.poll(timeout * 1000.0)
            finally:
                self.changed.acquire()
                self.reading = False
        if self.closed:
            return
        try:
            data = self.socket.recv(1 << 16, socket.MSG_DONTWAIT)
            if not data:
                self.gone = self.gone or "the other side has gone"
            self.incoming += data
            self._understand()
        except BlockingIOError:
            pass
        except OSError as error:
            self.gone = self.gone or f"the other side has gone ({error.strerror})"
        except wire.MalformedError as fault:
            self.gone = f"the other side does not speak the attach protocol: {fault}"
        self._raise_signal()
        self.changed.notify_all()

    def _understand(self) -> None:
        """The records that have come in, one after the other."""
        frame_size, unpack = wire.FRAME_BODY.size, wire.FRAME_BODY.unpack
        for kind, body in wire.records_of(self.incoming):
            if kind == wire.FRAME and len(body) == frame_size:
                self._arrive((RECEIVED, *unpack(body)))
            elif kind in (wire.SENT, wire.DROPPED):
                self.outstanding -= 1
                self._arrive((SENT if kind == wire.SENT else DROPPED, *wire.unpacked(wire.FRAME_BODY, body)))
            elif kind == wire.STATE:
                time, state, transmit, receive = wire.unpacked(wire.STATE_BODY, body)
                self._arrive((STATE, time, state, transmit, receive, 0))
            elif kind == wire.OVERFLOW:
                time, self.missed_frames = wire.unpacked(wire.OVERFLOW_BODY, body)
                self._arrive(overflow_frame(time))
            elif kind == wire.REFUSED:
                self.gone = body.decode("utf-8", "replace")
            else:
                raise wire.MalformedError(f"record type {kind} with {len(body)} bytes")


Welcome = tuple[int, int, int, int, list[str], bytearray]


def greeted(
    name: str, channel: str, options: int = 0, patience_s: float = HANDSHAKE_S
) -> tuple[socket.socket, Welcome]:
    """A connection to the robot `name` and what it said: version, window, bit rate, epoch, channels, the rest.

    FileNotFoundError when nobody of that name is running; UserError when it refuses or is not understood.
    """
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        connection.settimeout(patience_s)
        address = wire.address_of(name)
        try:
            connection.connect(address)
        except ConnectionRefusedError:
            raise FileNotFoundError(name) from None
        hello = wire.HELLO_BODY.pack(wire.MAGIC, wire.VERSION, options) + channel.encode("utf-8")
        connection.sendall(wire.record(wire.HELLO, hello))
        incoming = bytearray()
        while True:
            data = connection.recv(4096)
            if not data:
                raise UserError(f"{name!r} ended the connection without a word")
            incoming += data
            for kind, body in wire.records_of(incoming):
                if kind == wire.REFUSED:
                    raise UserError(body.decode("utf-8", "replace"))
                if kind != wire.WELCOME or len(body) < wire.WELCOME_BODY.size:
                    raise UserError(f"{name!r} does not speak the attach protocol")
                version, window, bitrate, epoch_ns = wire.WELCOME_BODY.unpack_from(body)
                channels = body[wire.WELCOME_BODY.size :].decode("utf-8", "replace").split("\n")
                connection.settimeout(None)
                return connection, (version, window, bitrate, epoch_ns, channels, incoming)
    except TimeoutError:
        connection.close()
        raise UserError(f"{name!r} is running but has not answered for {patience_s:g} s (is it stopped?)") from None
    except wire.MalformedError as fault:
        connection.close()
        raise UserError(f"{name!r} does not speak the attach protocol: {fault}") from None
    except OSError as error:
        connection.close()
        if isinstance(error, FileNotFoundError):
            raise
        raise UserError(f"attaching to {name!r}: {error.strerror or error}") from None
    except UserError:
        connection.close()
        raise


def channels_of(name: str, patience_s: float = HANDSHAKE_S) -> list[str]:
    """The channels of a running robot or host."""
    connection, welcome = greeted(name, "", patience_s=patience_s)
    connection.close()
    return welcome[4]


class PrivateBus:
    """A bus inside this process, shared by its links; it ends with the last of them."""

    def __init__(self, paced: PacedBus) -> None:
        self.paced = paced
        self.lock = threading.RLock()
        self.links: list[PrivateLink] = []

    def pass_time(self) -> int:
        """Up to now; every link gets what happened. Returns the next instant of interest. The lock is held."""
        while True:
            due = self.paced.advance()
            for link in self.links:
                events = link.tap.events
                if events:
                    link.tap.events = []
                    link.hear(events)
            if due > self.paced.time:  # otherwise there was more than one call does
                return due


class PrivateLink(Link):
    """A client's place on a private bus of this process."""

    def __init__(
        self,
        bus: PrivateBus,
        label: str,
        listen_only: bool = False,
        receive_own: bool = False,
        queue_limit: int = RECEIVE_QUEUE,
    ) -> None:
        super().__init__(label, receive_own, queue_limit)
        self.bus = bus
        self.bitrate = bus.paced.bitrate
        self.changed = threading.Condition(bus.lock)
        self.pump: threading.Thread | None = None
        self.warned = False
        with bus.lock:
            self.tap = bus.paced.add(label)
            if listen_only:
                self.tap.listen(bus.paced.time)
            bus.links.append(self)
            bus.pass_time()

    def hear(self, events: list[Event]) -> None:
        """What happened on the bus; the lock is held."""
        epoch = self.bus.paced.epoch_ns
        for event in events:
            self._arrive((event[0], event[1] + epoch, *event[2:]))
        self._raise_signal()
        self.changed.notify_all()

    def send(self, identifier: int, flags: int, lo: int, hi: int, timeout: float | None) -> None:
        """Queue a frame, waiting up to `timeout` s for a place (None: for ever)."""
        with self.changed:
            self._check()
            if self.bus.paced.speed != 0.0:
                self.bus.pass_time()
            answer = self.tap.offer(identifier, flags, lo, hi)
            if answer == FULL:
                if timeout is None and self.tap.state == ERROR_PASSIVE and not self.warned:
                    self.warned = True
                    log.warning(
                        "%s: nobody acknowledges, so sending waits (this bus is private to this process; "
                        "`ranger-sim bus` shares one)",
                        self.label,
                    )
                self._wait(lambda: self.tap.queued < self.tap.depth, timeout)
                answer = self.tap.offer(identifier, flags, lo, hi)
            self._check()
            if answer == FULL:
                raise self._full()
            if answer == NOT_ON_BUS:
                if self.tap.off:
                    raise LinkError(f"{self.label}: bus-off, nothing can be sent (state = ACTIVE asks for recovery)")
                raise LinkError(f"{self.label}: listening only, nothing can be sent")
            self.bus.pass_time()
            self._wake_sleepers()

    def receive(self, timeout: float | None) -> Event | None:
        """The oldest frame, waiting up to `timeout` s (None: for ever)."""
        with self.changed:
            event = self._take()
            if event is None:
                self._check()
                self._wait(lambda: bool(self.arrived), timeout)
                event = self._take()
                if event is None:
                    self._check()
            return event

    def activate(self) -> None:
        """Take part again."""
        with self.changed:
            self._check()
            self.tap.activate(self.bus.paced.time)
            self.bus.pass_time()
            self._wake_sleepers()

    def listen(self) -> None:
        """Receive only."""
        with self.changed:
            self._check()
            self.bus.pass_time()
            self.tap.listen(self.bus.paced.time)
            self.bus.pass_time()

    def flush(self) -> None:
        """Drop what waits to be sent."""
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
        """A descriptor that is readable while `receive` has something. By the clock, a thread passes the time."""
        with self.changed:
            self._check()
            if self.signal < 0:
                self._make_signal()
                if self.bus.paced.speed != 0.0:
                    self.pump = threading.Thread(target=self._pump, name=f"time of {self.label}", daemon=True)
                    self.pump.start()
            return self.signal

    def _pump(self) -> None:
        """Pass the time while everybody else only watches the descriptor."""
        with self.changed:
            while not self.closed:
                due = self.bus.pass_time()
                self.changed.wait(STALE_S if due >= NEVER else min(self.bus.paced.seconds_until(due), STALE_S))

    def close(self) -> None:
        """Leave the bus; what is queued is still sent while somebody else is there."""
        with self.changed:
            if self.closed:
                return
            self.bus.pass_time()
            self.closed = True
            self.bus.links.remove(self)
            self.bus.paced.taps.remove(self.tap)
            self.bus.pass_time()
            for link in self.bus.links:
                link.changed.notify_all()
            self.changed.notify_all()
        if self.pump is not None and self.pump is not threading.current_thread():
            self.pump.join()
        self._close_signal()

    def _check(self) -> None:
        if self.closed:
            raise LinkError(f"{self.label}: is shut down")

    def _wake_sleepers(self) -> None:
        """The next instant of interest may have come nearer: who sleeps until the old one must look again."""
        for link in self.bus.links:
            if link is not self:
                link.changed.notify_all()

    def _wait(self, ready: Callable[[], bool], timeout: float | None) -> None:
        """Until `ready()` or the time is over; passes the bus's time."""
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
