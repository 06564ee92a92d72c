# cython: boundscheck=False, wraparound=False
# (every index below is a place of the FIFO that holds a byte or is free)
"""A UART with byte timing: UnRBR, UnTHR, UnLSR, UnIIR, UnDLL/DLM as one divisor, UnFDR; 8N1.

Receive: UART_BYTE messages stamped with the end of the byte fill a FIFO of 16. One message may bring up to
eight bytes: c their number, d the first four, e the rest, low byte first, stamped with the end of the last.
The interrupt (UART_BYTE, number) comes when the trigger level (1, 4, 8 or 14) is reached, and when bytes have
waited below it for the time of four characters since the last one came or was read (IIR 0xC, LPC2194 user manual:
3.5 to 4.5). Handlers are expected to empty the FIFO.
Transmit: a byte written to THR leaves as UART_OUTPUT, stamped with the end of its stop bit; FIFO of 16. When
the FIFO has become empty, (UART_TRANSMIT, number) is raised.
"""

from typing import TYPE_CHECKING, Final

import cython

from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.vic import UART_TRANSMIT, InterruptSource
from ranger_sim.foundation.events import NEVER, UART_BYTE, UART_OUTPUT
from ranger_sim.foundation.user_error import FirmwareError

if TYPE_CHECKING:
    from ranger_sim.firmware_sim.alarm import Alarm

FIFO_BYTES: Final = 16
BITS_PER_BYTE: Final = 10  # start, 8 data, stop
CLOCKS_PER_BIT: Final = 16
TIMEOUT_BYTES: Final = 4  # of silence, while bytes wait below the trigger level
TIMEOUT_ALARM: Final = 0
TRANSMIT_ALARM: Final = 1

# UnIIR
IIR_NONE: Final = 1
IIR_TRANSMIT: Final = 2  # THRE: the transmit FIFO is empty
IIR_RECEIVED: Final = 4  # RDA: the trigger level is reached
IIR_TIMEOUT: Final = 12  # CTI: bytes wait below it

# UnLSR
LSR_RDR: Final = 0x1  # a received byte waits
LSR_OE: Final = 0x2  # overrun
LSR_THRE: Final = 0x20  # the transmit FIFO is empty
LSR_TEMT: Final = 0x40  # and the last byte is out


@cython.final
@cython.cclass
class Uart(Peripheral):
    """UART `number`. baud = hz / (16 * divisor * (1 + divaddval / mulval))."""

    # what a received byte touches
    source: InterruptSource
    byte_ns: cython.longlong
    trigger: cython.longlong
    fifo_count: cython.longlong
    IIR: cython.longlong
    received: cython.longlong
    fifo: cython.longlong[16]
    # the rest
    overruns: cython.longlong
    errors: cython.longlong
    number: cython.longlong
    DL: cython.longlong
    DIVADDVAL: cython.longlong
    MULVAL: cython.longlong
    hz: cython.longlong
    baud: cython.double
    transmit_free: cython.longlong
    sent: cython.longlong
    refused: cython.longlong
    timeout_alarm: "Alarm"
    transmit_alarm: "Alarm"
    transmit_source: InterruptSource

    def __init__(self, chip, number=0, divisor=6, divaddval=0, mulval=1, trigger=8, hz=0) -> None:
        Peripheral.__init__(self, chip)
        if trigger not in (1, 4, 8, 14):
            raise FirmwareError(f"{chip.name}: UART {number}: trigger level {trigger} is not 1, 4, 8 or 14")
        self.number = number
        self.hz = hz if hz else chip.hz
        self.trigger = trigger
        self.set_divisor(divisor, divaddval, mulval)
        self.source = chip.vic.source(UART_BYTE, number)
        self.transmit_source = chip.vic.source(UART_TRANSMIT, number)
        self.timeout_alarm = chip.new_alarm(self, TIMEOUT_ALARM)
        self.transmit_alarm = chip.new_alarm(self, TRANSMIT_ALARM)
        self.fifo = [0] * 16  # FIFO_BYTES; the oldest byte first
        self.fifo_count = 0
        self.IIR = IIR_NONE
        self.errors = 0
        self.received = 0
        self.overruns = 0
        self.sent = 0
        self.refused = 0
        self.transmit_free = 0
        chip.claim(UART_BYTE, number, self)

    @cython.ccall
    def set_divisor(self, DL: cython.longlong, DIVADDVAL: cython.longlong = 0, MULVAL: cython.longlong = 1) -> None:
        """Set the divisor latch and the fractional divider."""
        if DL < 1 or MULVAL < 1 or DIVADDVAL < 0 or DIVADDVAL > 14 or MULVAL > 15:
            raise FirmwareError(
                f"{self.chip.name}: UART {self.number}: divisor {DL}, fraction {DIVADDVAL}/{MULVAL} is impossible"
            )
        self.DL = DL
        self.DIVADDVAL = DIVADDVAL
        self.MULVAL = MULVAL
        self.baud = self.hz * MULVAL / (16.0 * DL * (MULVAL + DIVADDVAL))
        self.byte_ns = self.chip.crystal.true_ns(
            BITS_PER_BYTE * CLOCKS_PER_BIT * DL * (MULVAL + DIVADDVAL) * 1000000000 // (self.hz * MULVAL)
        )

    def retune(self, now, before) -> None:
        """Its bytes take longer or shorter."""
        self.set_divisor(self.DL, self.DIVADDVAL, self.MULVAL)

    @cython.ccall
    @cython.exceptval(check=False)
    def waiting(self) -> cython.longlong:
        """Received bytes that wait in the FIFO."""
        return self.fifo_count

    def on_message(self, queue) -> InterruptSource | None:
        """A byte came in, or up to eight that followed each other without a gap, stamped with the last's end.

        A group is taken at once: with the trigger at or above its size the interrupt comes at the same
        instant as byte by byte.
        """
        place: cython.longlong
        first: cython.longlong = self.fifo_count
        behind: cython.longlong = first + 1
        bytes_left: cython.longlong = queue.b
        if queue.c > 1:
            behind = first + queue.c
            bytes_left = queue.e << 32 | queue.d
        self.received += behind - first
        if behind > FIFO_BYTES:  # the last ones are lost
            self.overruns += behind - FIFO_BYTES
            self.errors |= LSR_OE
            behind = FIFO_BYTES
        for place in range(first, behind):
            self.fifo[place] = bytes_left & 255
            bytes_left >>= 8
        self.fifo_count = behind
        if behind >= self.trigger:
            self.timeout_alarm.set(NEVER)
            self.IIR = IIR_RECEIVED
            return self.source
        self.timeout_alarm.set(queue.time + TIMEOUT_BYTES * self.byte_ns)
        return None

    def on_alarm(self, alarm: cython.longlong, time: cython.longlong) -> InterruptSource | None:
        """Character time-out (0) or transmit FIFO empty (1)."""
        if alarm == TIMEOUT_ALARM:
            if self.fifo_count == 0:
                return None
            self.IIR = IIR_TIMEOUT
            return self.source
        self.IIR = IIR_TRANSMIT
        return self.transmit_source

    @cython.ccall
    @cython.exceptval(check=False)
    def RBR(self) -> cython.longlong:
        """Take the oldest received byte; 0 when there is none (see LSR bit 0)."""
        byte: cython.longlong
        if self.fifo_count == 0:
            return 0
        byte = self.fifo[0]
        self.were_read(1)
        return byte

    @cython.ccall
    def were_read(self, count: cython.longlong) -> cython.void:
        """The oldest `count` bytes that wait were read from `fifo` itself, as by reads of RBR."""
        i: cython.longlong
        if count > 0:
            self.fifo_count -= count
            for i in range(self.fifo_count):
                self.fifo[i] = self.fifo[count + i]
            if self.fifo_count == 0:
                self.IIR = IIR_NONE
                self.timeout_alarm.set(NEVER)
            else:
                self.timeout_alarm.set(self.chip.now + TIMEOUT_BYTES * self.byte_ns)

    @cython.ccall
    def THR(self, byte: cython.longlong) -> cython.bint:
        """Send a byte; False (and `refused` counts) when the FIFO is full."""
        now: cython.longlong = self.chip.now
        if self.transmit_free - now > FIFO_BYTES * self.byte_ns:
            self.refused += 1
            return False
        if self.transmit_free < now:
            self.transmit_free = now
        self.transmit_free += self.byte_ns
        self.sent += 1
        self.chip.outbox.push(self.transmit_free, 0, UART_OUTPUT, self.number, byte & 255)
        if self.transmit_source.attached:
            self.transmit_alarm.set(max(now, self.transmit_free - self.byte_ns))
        return True

    @cython.ccall
    def LSR(self) -> cython.longlong:
        """Line status: bit 0 data ready, 1 overrun (cleared by this read), 5 THR empty, 6 all sent."""
        status: cython.longlong = self.errors
        self.errors = 0
        if self.fifo_count > 0:
            status |= LSR_RDR
        if self.transmit_free - self.byte_ns <= self.chip.now:
            status |= LSR_THRE
        if self.transmit_free <= self.chip.now:
            status |= LSR_TEMT
        return status

    def unplug(self) -> None:
        """Forget what waits, as after a reset of both FIFOs (UnFCR)."""
        self.fifo_count = 0
        self.timeout_alarm.set(NEVER)
