# cython: boundscheck=False, wraparound=False
# (every index below is a byte's place in the buffer of the sensor)
"""The wire between the plant's inertial unit and a UART of a board: the unit's bytes one way, commands the other."""

from typing import TYPE_CHECKING, Final

import cython

from ranger_sim.foundation.edge_buffer import ByteBuffer
from ranger_sim.foundation.events import ORDER_PINS, UART_BYTE, EventQueue
from ranger_sim.harness.step_watch import SerialDevice

if TYPE_CHECKING:
    from ranger_sim.plant.sensors.imu import Imu

MESSAGE_BYTES: Final = 8  # a UART_BYTE carries at most this many,
WORD_BYTES: Final = 4  # half of them in each of its two words
PAUSE_NS: Final = 25_000  # from byte to byte; after more a new message begins (at 460,800 baud a byte takes 21.7 us)


@cython.final
@cython.cclass
class ImuWire(SerialDevice):
    """`imu` on UART `uart` of `board`. `tap.bytes_sent(times, values, count)` also receives what the unit sends."""

    imu: "Imu"
    inbox: EventQueue
    uart: cython.longlong
    tap: object
    plugged: cython.bint

    def __init__(self, imu, board, uart) -> None:
        self.imu = imu
        self.inbox = board.inbox
        self.uart = uart
        self.tap = None
        self.plugged = True

    def unplug(self) -> None:
        """Disconnect the unit: another one replaces it on the UART."""
        self.plugged = False

    def from_board(self, time, byte, count, data) -> None:
        """Deliver a byte of the board to the unit."""
        self.imu.receive_byte(time, byte)

    def deliver(self) -> object:
        """Forward what the unit sent during the step just integrated."""
        if self.plugged and self.imu.bytes.count:
            if self.tap is not None:
                self.tap.bytes_sent(self.imu.bytes.times, self.imu.bytes.values, self.imu.bytes.count)
            self._put_bytes()
        return None

    @cython.cfunc
    def _put_bytes(self) -> cython.void:
        """Send up to eight bytes that follow each other closely as one message."""
        line: ByteBuffer = self.imu.bytes
        inbox: EventQueue = self.inbox
        time: cython.longlong = line.times[0]
        following: cython.longlong
        byte: cython.longlong
        n: cython.longlong = 0  # bytes in `low` and `high`, the first one in the lowest place
        low: cython.longlong = 0
        high: cython.longlong = 0
        i: cython.longlong
        for i in range(line.count):
            following = line.times[i]
            if n == MESSAGE_BYTES or following - time >= PAUSE_NS:
                inbox.put(time, ORDER_PINS, UART_BYTE, self.uart, low & 255, n, low, high, 0)
                n = low = high = 0
            byte = line.values[i]
            if n < WORD_BYTES:
                low |= byte << (8 * n)
            else:
                high |= byte << (8 * (n - WORD_BYTES))
            n += 1
            time = following
        inbox.put(time, ORDER_PINS, UART_BYTE, self.uart, low & 255, n, low, high, 0)
