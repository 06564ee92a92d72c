"""Ends of the robot's serial lines: a pseudo-terminal, or a real port opened by pyserial.

An end is a plain object without threads. The loop that owns the robot calls `poll(now_ns)` between two of its steps:
bytes that have arrived are stamped and passed to the board, bytes that the board has finished sending go out. A poll
never blocks, and nothing that a client does raises. Input arrives by the wall clock: from then on a run is not
reproducible, and `asynchronous` says so. Output changes nothing.
"""

from __future__ import annotations

import collections
import errno
import math
import os
import select
from collections.abc import Callable
from typing import Any, Protocol

from ranger_sim.can_bus.edge.peers import LIMITS, Terminal, read_ready, write_ready
from ranger_sim.foundation.events import NEVER, PIN_EDGE, STAGE_PINS, UART_BYTE
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import UserError

POLL_NS = 1_000_000  # between two polls of a port: half a slot of the main brain
AHEAD_NS = 20_000_000  # bytes read at once last at most this long on the robot's side; the rest waits in the port
ORDER = STAGE_PINS * 256 + 192
GROUP = 8  # bytes that travel as one message

DAQ_BAUD = 921_600  # of the computer's side: robot.md C7
BLUETOOTH_BAUD = 460_800
IMU_BAUD = 460_800  # robot.md N4.10


class Port(Protocol):
    """Where bytes leave the simulation. `path` is what a client opens."""

    path: str

    def read(self, limit: int) -> bytes:
        """Read at most `limit` available bytes; OSError when the port is gone."""

    def write(self, data: bytes) -> int:
        """Write bytes; returns how many were accepted; OSError when the port is gone."""

    def filenos(self) -> list[int]:
        """The file descriptors to select on for reading."""

    def close(self) -> None:
        """Close it."""


class PtyPort:
    """A pseudo-terminal, raw. Clients may connect and leave; without one at most the kernel's few kilobytes wait."""

    def __init__(self) -> None:
        self.terminal = Terminal()
        self.path = self.terminal.path

    def read(self, limit: int) -> bytes:
        return self.terminal.read(limit) or b""

    def write(self, data: bytes) -> int:
        return self.terminal.write(data)

    def filenos(self) -> list[int]:
        return [self.terminal.fileno()]

    def close(self) -> None:
        self.terminal.close()


class RealPort:
    """A serial port of this machine, or what pyserial opens for a URL. `flow_control`: RTS/CTS."""

    def __init__(self, name: str, baud: int, flow_control: bool = False) -> None:
        import serial

        self.path = name
        try:
            self.serial: Any = serial.serial_for_url(
                name, baudrate=baud, timeout=0, write_timeout=0, rtscts=flow_control, exclusive=True
            )
        except (OSError, ValueError) as error:  # SerialException is an OSError
            raise UserError(f"serial port {name}: {reason_of(error)}") from None
        try:
            self.number = int(self.serial.fileno())
            os.set_blocking(self.number, False)
        except (OSError, AttributeError):  # io.UnsupportedOperation is an OSError: a URL without a file
            self.number = -1

    def read(self, limit: int) -> bytes:
        if self.number >= 0:
            data = read_ready(self.number, limit)
            if not data and limit > 0 and hung_up(self.number):
                raise OSError(errno.EIO, os.strerror(errno.EIO))
            return data
        return bytes(self.serial.read(min(limit, self.serial.in_waiting)))

    def write(self, data: bytes) -> int:
        if self.number >= 0:  # pyserial's own write would try again for ever while the port is full
            return write_ready(self.number, data)
        return int(self.serial.write(data))

    def filenos(self) -> list[int]:
        return [self.number] if self.number >= 0 else []

    def close(self) -> None:
        self.serial.close()


def hung_up(number: int) -> bool:
    """True when the other side of a terminal is gone: reading it then looks like silence."""
    if not hasattr(select, "poll"):  # Windows: its ports have no descriptor
        return False
    watch = select.poll()
    watch.register(number, select.POLLIN)
    return any(events & (select.POLLHUP | select.POLLERR | select.POLLNVAL) for _, events in watch.poll(0))


def reason_of(error: Exception) -> str:
    """The operating system's message, where it has one."""
    if isinstance(error, OSError) and error.errno is not None:
        return os.strerror(error.errno)
    return str(error)


def open_port(name: str, baud: int = DAQ_BAUD, flow_control: bool = False) -> Port:
    """`pty`, or the name or URL of a serial port. UserError when it cannot be opened."""
    return PtyPort() if name == "pty" else RealPort(name, baud, flow_control)


class Dropouts:
    """Times at which the radio is silent: seeded, in virtual time.

    The robot's Bluetooth logs (robot.md C6.1, C6.2) have gaps of 50 to 180 ms; one of 93 s has about 25
    of them, one every 3.7 s. Uniform lengths and exponential distances are chosen by us.
    """

    MEAN_DISTANCE_S = 3.7
    SHORTEST_NS, LONGEST_NS = 50_000_000, 180_000_000

    def __init__(self, seed: int, start_ns: int = 0) -> None:
        self.stream: Any = RandomStream(seed, "serial drop-outs")
        self.silent = False
        self.count = 0
        self.silent_ns = 0
        self.switch_ns = start_ns + self._distance_ns()

    def _distance_ns(self) -> int:
        return round(-1e9 * self.MEAN_DISTANCE_S * math.log(1.0 - self.stream.uniform()))

    def advance(self, now_ns: int) -> bool:
        """Make at most one switch that is due; True when there was one."""
        if now_ns < self.switch_ns:
            return False
        self.silent = not self.silent
        if self.silent:
            length = self.SHORTEST_NS + self.stream.integer(self.LONGEST_NS - self.SHORTEST_NS + 1)
            self.count += 1
            self.silent_ns += length
        else:
            length = self._distance_ns()
        self.switch_ns += length
        return True


Push = Callable[..., Any]


class SerialLine:
    """One UART of a board on one port.

    push: called as `EventQueue.push`: time, order, kind and up to five numbers of a message to the board.
    byte_ns: how long a byte takes on the line. With `dropouts` the radio is silent at times: with a `cts_pin` the board
    is held by flow control and waiting bytes go out later; without one the bytes of that time are lost.
    """

    def __init__(
        self,
        push: Push,
        uart: int,
        port: Port,
        byte_ns: int,
        dropouts: Dropouts | None = None,
        cts_pin: int = -1,
    ) -> None:
        self.push = push
        self.uart = uart
        self.port = port
        self.byte_ns = byte_ns
        self.dropouts = dropouts
        self.cts_pin = cts_pin
        self.outgoing: collections.deque[tuple[int, bytes]] = collections.deque()  # (end of the last byte, bytes)
        self.rest = b""  # of a piece that the port accepted in part: it goes first, so that pieces stay whole
        self.line_free_ns = 0
        self.asynchronous = False
        self.gone = ""  # why the port does not work any more
        self.closed = False
        self.bytes_in = 0
        self.bytes_out = 0
        self.bytes_lost = 0  # the port was full: no client reads
        self.bytes_unheard = 0  # sent while the radio was silent, without flow control

    # --- from the board ---------------------------------------------------------------------------------

    def from_board(self, time_ns: int, byte: int, count: int, data: bytes | None) -> None:
        """Take a UART_OUTPUT: one byte, or `count` in `data`."""
        self.outgoing.append((time_ns, bytes((byte & 255,)) if count == 0 or data is None else data))

    # --- polled -----------------------------------------------------------------------------------------

    def poll(self, now_ns: int) -> int:
        """Move bytes in and out; returns the virtual time of the next poll."""
        wish = now_ns + POLL_NS
        if self.dropouts is not None:
            while self.dropouts.advance(now_ns):
                if self.cts_pin >= 0:
                    self.push(now_ns, ORDER, PIN_EDGE, self.cts_pin, int(self.dropouts.silent), -1, 0)
            wish = min(wish, self.dropouts.switch_ns)
        if self.gone or self.closed:
            self.outgoing.clear()
            return wish if self.dropouts is not None else NEVER
        silent = self.dropouts is not None and self.dropouts.silent
        try:
            if not silent:
                self._take_in(now_ns)
            self._put_out(now_ns, silent)
        except OSError as error:
            self.gone = reason_of(error)
        return wish

    def _take_in(self, now_ns: int) -> None:
        """Read from the port what fits on the line in the next milliseconds."""
        start = max(self.line_free_ns, now_ns)
        data = self.port.read(min((now_ns + AHEAD_NS - start) // self.byte_ns, LIMITS["serial"].read_bytes))
        if not data:
            return
        self.asynchronous = True
        self.bytes_in += len(data)
        for place in range(0, len(data), GROUP):
            group = data[place : place + GROUP]
            start += len(group) * self.byte_ns
            low = int.from_bytes(group[:4], "little")
            high = int.from_bytes(group[4:], "little")
            self.push(start, ORDER, UART_BYTE, self.uart, group[0], len(group), low, high)
        self.line_free_ns = start

    def _put_out(self, now_ns: int, silent: bool) -> None:
        """Write what the board has finished sending. A piece is accepted whole or lost whole."""
        if silent and self.cts_pin >= 0:
            return  # the module keeps it; the board sends no more
        if self.rest:
            self.rest = self.rest[self._write(self.rest) :]
        room = LIMITS["serial"].write_bytes  # the rest waits for the next poll
        while self.outgoing and self.outgoing[0][0] <= now_ns and room > 0:
            room -= len(self.outgoing[0][1])
            data = self.outgoing.popleft()[1]
            if silent:
                self.bytes_unheard += len(data)
            elif self.rest:
                self.bytes_lost += len(data)
            else:
                taken = self._write(data)
                if taken == 0:
                    self.bytes_lost += len(data)
                else:
                    self.rest = data[taken:]

    def _write(self, data: bytes) -> int:
        taken = self.port.write(data)
        self.bytes_out += taken
        return taken

    def filenos(self) -> list[int]:
        """The file descriptors to select on while waiting for the wall clock."""
        return [] if self.gone or self.closed else self.port.filenos()

    def counters(self) -> dict[str, int]:
        """Whole numbers by name."""
        return {
            "bytes_in": self.bytes_in,
            "bytes_out": self.bytes_out,
            "bytes_lost": self.bytes_lost,
            "bytes_unheard": self.bytes_unheard,
            "dropouts": self.dropouts.count if self.dropouts is not None else 0,
        }

    def close(self) -> None:
        """Close the port."""
        if not self.closed:
            self.closed = True
            self.port.close()


class ImuOffer:
    """The plant's inertial unit on a port, in addition to its board: a real host reads and may command it."""

    def __init__(self, imu: Any, port: Port) -> None:
        self.imu = imu
        # the unit's output is handled like a board's bytes; the host's bytes go to the unit
        byte_ns = 10_000_000_000 // imu.baud
        self.line = SerialLine(self._to_unit, 0, port, byte_ns)

    def _to_unit(
        self, time_ns: int, _order: int, _kind: int, _uart: int, _first: int, count: int, low: int, high: int
    ) -> None:
        for byte in (low | high << 32).to_bytes(8, "little")[:count]:
            self.imu.receive_byte(time_ns, byte)

    def bytes_sent(self, times: Any, values: Any, count: int) -> None:
        """Take `count` bytes of the unit: their end times in ns, and values."""
        if count:
            self.line.from_board(int(times[count - 1]), 0, count, bytes(values[i] for i in range(count)))

    @property
    def port(self) -> Port:
        return self.line.port

    @property
    def gone(self) -> str:
        return self.line.gone

    @property
    def asynchronous(self) -> bool:
        return self.line.asynchronous

    def poll(self, now_ns: int) -> int:
        return self.line.poll(now_ns)

    def filenos(self) -> list[int]:
        return self.line.filenos()

    def counters(self) -> dict[str, int]:
        return self.line.counters()

    def close(self) -> None:
        self.line.close()
