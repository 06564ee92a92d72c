"""A client's place on a bus of another process: a running robot, or a host of private buses."""

import select
import socket
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from ranger_sim.can_bus.edge import attach_records as wire
from ranger_sim.can_bus.edge.links import (
    BUS_OFF_TEXT,
    FOR_EVER,
    LISTENING_TEXT,
    RECEIVE_QUEUE,
    STALE_S,
    UNHEARD_S,
    Link,
    LinkError,
)
from ranger_sim.can_bus.edge.peers import connected
from ranger_sim.can_bus.edge.taps import (
    DROPPED,
    ERROR_ACTIVE,
    ERROR_PASSIVE,
    LISTENING,
    OFF,
    RECEIVED,
    SENT,
    STATE,
    overflow_frame,
)
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.descriptors import Readers
from ranger_sim.foundation.user_error import BusError, UserError

HANDSHAKE_S = 60.0  # chosen by us: a robot answers once its boards have started, on a slow machine after half a minute


class AttachedLink(Link):
    """A client's place on a bus of another process. UserError when that process or its channel is not there."""

    acknowledge_hint = "`ranger-sim bus --acknowledge` adds a silent node that does"

    def __init__(
        self,
        name: str,
        channel: str,
        listen_only: bool = False,
        receive_own: bool = False,
        queue_limit: int = RECEIVE_QUEUE,
        fd: bool = False,
    ) -> None:
        super().__init__(f"{name}/{channel}", receive_own, queue_limit)
        options = (wire.OPTION_LISTEN if listen_only else 0) | (wire.OPTION_FD if fd else 0)
        self.socket, welcome = handshake(name, channel, options)
        _, self.window, self.bitrate, self.epoch_ns, self.channels, rest = welcome
        self.data_bitrate, self.iso = 0, True  # of CAN FD: directly after the welcome
        self.state = LISTENING if listen_only else ERROR_ACTIVE
        self.incoming = rest
        self.outstanding = 0
        self.reading = False
        self.gone = ""
        self.waiter = Readers()
        self.waiter.add(self.socket.fileno())
        self.epoll: Any = None  # a `select.epoll` of `socket` and `signal`
        with self.changed:
            self._understand()  # frames may have arrived directly after the welcome
            if fd:
                self._wait(lambda: self.data_bitrate > 0, HANDSHAKE_S)
        if fd and not self.data_bitrate:
            self.close()
            raise BusError(f"attaching to {name!r}: {self.gone or 'no bit rate of CAN FD has come'}")

    def send(self, identifier: int, flags: int, lo: int, hi: int, timeout: float | None) -> None:
        """Queue a frame, waiting up to `timeout` s for a place.

        None: as long as frames are being sent. Raises QueueFullError where no node acknowledges.
        """
        with self.changed:
            if self.outstanding >= self.window:
                if timeout is None:
                    self._wait_while_served()
                else:
                    self._wait(lambda: self.outstanding < self.window, timeout)
                if self.outstanding >= self.window:
                    raise self._full()
            self._check()
            if self.state in (OFF, LISTENING):
                self._read(0.0)
                self._check_state()
            self.outstanding += 1
            self._write(wire.send_record(identifier, flags, lo, hi))

    def _wait_while_served(self) -> None:
        """Wait for a place, or until the controller is error passive and has sent nothing for UNHEARD_S."""
        while self.outstanding >= self.window and not (self.gone or self.closed):
            passive = self.state == ERROR_PASSIVE
            self._wait(lambda: self.outstanding < self.window, UNHEARD_S)
            if passive and self.state == ERROR_PASSIVE:
                return

    def _check_state(self) -> None:
        if self.state == OFF:
            raise LinkError(f"{self.label}: {BUS_OFF_TEXT}")
        if self.state == LISTENING:
            raise LinkError(f"{self.label}: {LISTENING_TEXT}")

    def activate(self) -> None:
        """Take part again."""
        self._control(wire.ACTIVATE)

    def listen(self) -> None:
        """Receive only."""
        self._control(wire.LISTEN)

    def flush(self) -> None:
        """Drop the frames that wait to be sent."""
        self._control(wire.FLUSH)

    def present_state(self) -> int:
        """The controller's state as last reported by the other side."""
        with self.changed:
            if not self.reading and not self.gone and not self.closed:
                self._read(0.0)
            return self.state

    def fileno(self) -> int:
        """A descriptor that is readable when `receive` has something, or may have something."""
        with self.changed:
            if self.closed:
                self._check()
            if self.epoll is None:
                self._make_signal()
                self.epoll = select.epoll()
                self.epoll.register(self.socket, select.EPOLLIN)
                self.epoll.register(self.signal, select.EPOLLIN)
            return int(self.epoll.fileno())

    def close(self) -> None:
        """Leave; the other side still sends queued frames."""
        with self.changed:
            if self.closed:
                return
            self.closed = True
            with suppress(OSError):
                self.socket.shutdown(socket.SHUT_RDWR)  # wakes threads that wait
            self.changed.notify_all()
        if self.epoll is not None:
            self.epoll.close()
        self._close_signal()
        self.socket.close()

    def _control(self, request: int) -> None:
        with self.changed:
            self._check()
            self._write(wire.record(wire.CONTROL, bytes([request])))

    def _check(self) -> None:
        if self.closed:
            raise LinkError(f"{self.label}: is shut down")
        if self.gone:
            raise LinkError(f"{self.label}: {self.gone}")

    def _write(self, data: bytes) -> None:
        try:
            self.socket.sendall(data)
        except OSError as error:
            self._read(0.0)  # the reason, if the other side has sent one
            self.gone = self.gone or f"the other side has gone ({error.strerror})"
            self._check()

    def _wait(self, ready: Callable[[], bool], timeout: float | None) -> None:
        """Wait until `ready()`, the time is over or the other side is gone. One thread reads, the others wait for
        it."""
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
        """Everything that has arrived, after waiting up to `timeout` s. Releases the lock meanwhile."""
        if timeout > 0.0:
            self.reading = True
            self.changed.release()
            try:
                self.waiter.ready(timeout)
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
        """Process the received records in order."""
        frame_size, unpack = wire.FRAME_BODY.size, wire.FRAME_BODY.unpack
        for kind, body in wire.records_of(self.incoming):
            if kind == wire.FRAME and len(body) == frame_size:  # eight data bytes are two words as well
                self._arrive((RECEIVED, *unpack(body)))
            elif kind == wire.FRAME:
                time, identifier, flags, lo, hi = wire.frame_of(wire.FRAME_HEAD, body)
                self._arrive((RECEIVED, time, identifier, flags, lo, hi))
            elif kind in (wire.SENT, wire.DROPPED):
                self.outstanding -= 1
                time, identifier, flags, lo, hi = wire.frame_of(wire.FRAME_HEAD, body)
                self._arrive((SENT if kind == wire.SENT else DROPPED, time, identifier, flags, lo, hi))
            elif kind == wire.STATE:
                time, state, transmit, receive = wire.unpacked(wire.STATE_BODY, body)
                self._arrive((STATE, time, state, transmit, receive, 0))
            elif kind == wire.OVERFLOW:
                time, self.missed_frames = wire.unpacked(wire.OVERFLOW_BODY, body)
                self._arrive(overflow_frame(time))
            elif kind == wire.FD:
                self.data_bitrate, iso = wire.unpacked(wire.FD_BODY, body)
                self.iso = bool(iso)
            elif kind == wire.REFUSED:
                self.gone = body.decode("utf-8", "replace")
            else:
                raise wire.MalformedError(f"record type {kind} with {len(body)} bytes")


Welcome = tuple[int, int, int, int, list[str], bytearray]


def handshake(
    name: str, channel: str, options: int = 0, patience_s: float = HANDSHAKE_S
) -> tuple[socket.socket, Welcome]:
    """A connection to the robot `name` and its welcome: version, window, bit rate, epoch, channels, the rest.

    FileNotFoundError when no process of that name is running; UserError when it refuses, sends an invalid answer, or
    belongs to another user.
    """
    address = wire.address_of(name)
    try:
        connection = connected(address, f"the server under the name {name!r}", patience_s)
    except ConnectionRefusedError:
        raise FileNotFoundError(name) from None
    except OSError as error:
        raise BusError(f"attaching to {name!r}: {error.strerror or error}") from None
    try:
        hello = wire.HELLO_BODY.pack(wire.MAGIC, wire.VERSION, options) + channel.encode("utf-8")
        connection.sendall(wire.record(wire.HELLO, hello))
        incoming = bytearray()
        while True:
            data = connection.recv(4096)
            if not data:
                raise BusError(f"{name!r} ended the connection without a message")
            incoming += data
            for kind, body in wire.records_of(incoming):
                if kind == wire.REFUSED:
                    raise BusError(body.decode("utf-8", "replace"))
                if kind != wire.WELCOME or len(body) < wire.WELCOME_BODY.size:
                    raise BusError(f"{name!r} does not speak the attach protocol")
                version, window, bitrate, epoch_ns = wire.WELCOME_BODY.unpack_from(body)
                channels = body[wire.WELCOME_BODY.size :].decode("utf-8", "replace").split("\n")
                connection.settimeout(None)
                return connection, (version, window, bitrate, epoch_ns, channels, incoming)
    except TimeoutError:
        connection.close()
        raise BusError(f"{name!r} is running but has not answered for {patience_s:g} s (is it stopped?)") from None
    except wire.MalformedError as fault:
        connection.close()
        raise BusError(f"{name!r} does not speak the attach protocol: {fault}") from None
    except OSError as error:
        connection.close()
        raise BusError(f"attaching to {name!r}: {error.strerror or error}") from None
    except UserError:
        connection.close()
        raise


def channels_of(name: str, patience_s: float = HANDSHAKE_S) -> list[str]:
    """The channels of a running robot or host."""
    connection, welcome = handshake(name, "", patience_s=patience_s)
    connection.close()
    return welcome[4]
