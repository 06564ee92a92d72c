"""A high-speed UART of the LPC3250 behind its DMA controller: HSUn_RATE, whole transfers out, a buffer in; 8N1.

Baud rate (LPC3250 user manual): clock / (14 * (HSU_RATE + 1)); the peripheral clock of 13 MHz gives 928,571 with
HSU_RATE 0 and 464,286 with 1.

Transmit: `transmit(data)` gives the DMA channel one transfer; it leaves as one UART_OUTPUT stamped with the end of its
last stop bit (c: number of bytes, ref: the bytes), and (DMA_DONE, channel) is raised then. With `cts_pin` a transfer
begins only while that pin is low (clear to send); one that has begun is finished.
Receive: UART_BYTE messages as for the LPC2194's UART, stamped with the end of their last byte, land in one of two
buffers without a cycle of the processor; `swap` hands the filled one over. A byte more than fits switches the channel
off until the next swap.
"""

import array
from typing import TYPE_CHECKING

import cython

from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.vic import DMA_DONE, InterruptSource
from ranger_sim.foundation.events import UART_BYTE, UART_OUTPUT
from ranger_sim.foundation.user_error import FirmwareError

if TYPE_CHECKING:
    from ranger_sim.firmware_sim.alarm import Alarm

BITS_PER_BYTE = 10  # start, 8 data, stop
SAMPLES_PER_BIT = 14


@cython.cclass
class HsUart(Peripheral):
    """UART `number` with transmit DMA `channel`; `buffer_bytes` of each of the two receive buffers."""

    number: cython.longlong
    rate: cython.longlong
    hz: cython.longlong
    byte_ns: cython.longlong
    done_alarm: "Alarm"
    baud: cython.double
    source: InterruptSource
    busy: cython.bint
    waits_for_cts: cython.bint
    clear_to_send: cython.bint
    overrun: cython.bint
    held: object
    sent: cython.longlong
    buffer_bytes: cython.longlong
    active: cython.longlong
    filled: cython.longlong
    received: cython.longlong
    lost: cython.longlong
    buffers: cython.longlong[::1]

    def __init__(self, chip, number, channel, rate=0, hz=13_000_000, buffer_bytes=1000, cts_pin=-1) -> None:
        Peripheral.__init__(self, chip)
        if not 0 <= rate <= 255 or hz < 1 or buffer_bytes < 1:
            raise FirmwareError(
                f"{chip.name}: UART {number}: rate {rate} (0 ... 255), clock {hz} Hz or buffer of {buffer_bytes} bytes "
                "is impossible"
            )
        self.number = number
        self.rate = rate
        self.baud = hz / (SAMPLES_PER_BIT * (rate + 1.0))
        self.hz = hz
        self.retune(0, chip.crystal)
        self.source = chip.vic.source(DMA_DONE, channel)
        self.done_alarm = chip.new_alarm(self, 0)
        self.busy = False
        self.waits_for_cts = False
        self.clear_to_send = True
        self.held = None
        self.sent = 0
        self.buffer_bytes = buffer_bytes
        self.buffers = array.array("q", [0]) * (2 * buffer_bytes)
        self.active = 0  # which buffer fills
        self.filled = 0
        self.overrun = False  # the channel switched itself off, bytes were lost
        self.received = 0
        self.lost = 0
        chip.claim(UART_BYTE, number, self)
        if cts_pin >= 0:
            chip.claim_pin(cts_pin, 0, self)

    def retune(self, now, before) -> None:
        """How long a byte takes by the chip's crystal."""
        nominal_ns = BITS_PER_BYTE * SAMPLES_PER_BIT * (self.rate + 1) * 1_000_000_000 // self.hz
        self.byte_ns = self.chip.crystal.true_ns(nominal_ns)

    # --- transmit ---------------------------------------------------------------------------------------

    @cython.ccall
    def transmit(self, data: object) -> cython.bint:
        """Start the channel on these bytes; False while an earlier transfer runs or waits."""
        if self.busy:
            return False
        self.busy = True
        if self.clear_to_send:
            self._begin(data, self.chip.now)
        else:
            self.held = data
            self.waits_for_cts = True
        return True

    @cython.cfunc
    def _begin(self, data: object, time: cython.longlong) -> None:
        count: cython.longlong = len(data)
        end: cython.longlong = time + count * self.byte_ns
        self.sent += count
        self.chip.outbox.push(end, 0, UART_OUTPUT, self.number, 0, count, 0, 0, 0, data)
        self.done_alarm.set(end)

    def on_pin(self, channel: cython.longlong, level: cython.longlong, time: cython.longlong) -> cython.longlong:
        """Clear to send: low lets a held transfer begin."""
        data: object
        self.clear_to_send = level == 0
        if self.clear_to_send and self.waits_for_cts:
            self.waits_for_cts = False
            data = self.held
            self.held = None
            self._begin(data, time)
        return 0

    def on_alarm(self, alarm: cython.longlong, time: cython.longlong) -> InterruptSource | None:
        """The last stop bit is out."""
        self.busy = False
        return self.source

    # --- receive ----------------------------------------------------------------------------------------

    def on_message(self, queue) -> InterruptSource | None:
        """One byte, or up to eight that followed each other."""
        i: cython.longlong
        if queue.c > 1:
            for i in range(min(queue.c, 8)):
                self._store((queue.d >> 8 * i if i < 4 else queue.e >> 8 * (i - 4)) & 255)
        else:
            self._store(queue.b & 255)
        return None

    @cython.cfunc
    @cython.exceptval(check=True)
    def _store(self, byte: cython.longlong) -> cython.void:
        if self.filled >= self.buffer_bytes:
            self.overrun = True
            self.lost += 1
            return
        self.received += 1
        self.buffers[self.active * self.buffer_bytes + self.filled] = byte
        self.filled += 1

    @cython.ccall
    def swap(self) -> cython.longlong:
        """Let the other buffer fill from now on; returns how many bytes the first has (see `taken`)."""
        count: cython.longlong = self.filled
        self.active = 1 - self.active
        self.filled = 0
        self.overrun = False
        return count

    @cython.ccall
    def taken(self, place: cython.longlong) -> cython.longlong:
        """Byte `place` of the buffer that does not fill."""
        return self.buffers[(1 - self.active) * self.buffer_bytes + place]
