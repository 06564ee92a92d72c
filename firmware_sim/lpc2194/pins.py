# cython: boundscheck=False, wraparound=False
# (ports are 0 and 1, pins 0 ... 31 of them)
"""Pins: fast and old GPIO registers, PINSEL, and where an edge at a pin goes, to a timer's capture or an EINT.

LPC2194 user manual, GPIO and pin connect block. Both sets of GPIO registers reach the same pins, whatever SCS says.
Of a pin's functions other than GPIO only those for edges are checked: a UART's or the PWM's pin needs no PINSEL here.
"""

from typing import TYPE_CHECKING, Final

import cython

from ranger_sim.firmware_sim.lpc2194.block import Block
from ranger_sim.firmware_sim.lpc2194.timer import ProgrammedTimer
from ranger_sim.firmware_sim.peripherals.gpio import Gpio

if TYPE_CHECKING:
    from ranger_sim.firmware_sim.peripheral import Peripheral

TIMER_BIT: Final = 2  # in a pin's capture word: bits 0-1 the channel, bit 2 the timer
NO_CAPTURE: Final = -1

# (pin of port 0, function in PINSEL) -> timer, channel. LPC2194 user manual, PINSEL0 and PINSEL1.
CAPTURES = {
    (2, 2): (0, 0), (22, 2): (0, 0), (30, 3): (0, 0),
    (4, 2): (0, 1), (27, 2): (0, 1),
    (6, 2): (0, 2), (16, 3): (0, 2), (28, 2): (0, 2),
    (29, 2): (0, 3),
    (10, 2): (1, 0),
    (11, 2): (1, 1),
    (17, 1): (1, 2), (19, 3): (1, 2),
    (18, 1): (1, 3), (21, 3): (1, 3),
}  # fmt: skip
# (pin of port 0, function in PINSEL) -> external interrupt
EXTERNAL_INTERRUPTS = {
    (1, 3): 0, (16, 1): 0,
    (3, 3): 1, (14, 2): 1,
    (7, 3): 2, (15, 2): 2,
    (9, 3): 3, (20, 3): 3, (30, 2): 3,
}  # fmt: skip


@cython.final
@cython.cclass
class PinSelectBlock(Block):
    """PINSEL0 ... PINSEL2, and the edges of pins. `external`: the receiver of external interrupts' edges."""

    words: cython.longlong[3]
    timer0: ProgrammedTimer
    timer1: ProgrammedTimer
    capture: cython.longlong[64]
    interrupt: cython.longlong[64]
    external: "Peripheral"

    REGISTERS = {0x00: ("PINSEL0", "rw"), 0x04: ("PINSEL1", "rw"), 0x14: ("PINSEL2", "rw")}

    def __init__(self, chip, clocks, timers) -> None:
        Block.__init__(self, chip, clocks, "PINSEL", 0xE002C000)
        self.words = [0, 0, 4]  # PINSEL2's reset value leaves port 1 to GPIO
        self.timer0, self.timer1 = timers
        self.capture = [-1] * 64  # NO_CAPTURE
        self.interrupt = [-1] * 64
        self.external = None
        for pin in range(64):
            chip.claim_pin(pin, pin, self)

    @cython.ccall
    def connect(self) -> object:
        """Route the pins after a write of PINSEL."""
        for pin in range(32):
            function = self.words[pin >> 4] >> 2 * (pin & 15) & 3
            timer, channel = CAPTURES.get((pin, function), (0, -1))
            self.capture[pin] = timer << 2 | channel if channel >= 0 else -1
            self.interrupt[pin] = EXTERNAL_INTERRUPTS.get((pin, function), -1)

    def on_pin(self, pin: cython.longlong, level: cython.longlong, time: cython.longlong) -> cython.longlong:
        """Handle an edge at a pin, whose level has been taken in."""
        to: cython.longlong = self.capture[pin]
        timer: ProgrammedTimer
        if to >= 0:
            timer = self.timer1 if to >> TIMER_BIT else self.timer0
            return timer.on_pin(to & 3, level, time)
        if self.interrupt[pin] >= 0 and self.external is not None:
            return self.external.on_pin(self.interrupt[pin], level, time)
        return 0

    def read(self, offset: cython.longlong) -> cython.longlong:
        self.steady = True
        if offset == 0:
            return self.words[0]
        if offset == 4:
            return self.words[1]
        if offset == 0x14:
            return self.words[2]
        return self.unknown(offset, False)

    def write(self, offset: cython.longlong, value: cython.longlong) -> cython.int:
        if offset == 0x14:
            self.words[2] = value
        elif offset == 0 or offset == 4:
            self.words[offset >> 2] = value
            self.connect()
        else:
            self.unknown(offset, True)
        return 0


@cython.final
@cython.cclass
class Ports(Gpio):
    """The two ports with directions and output latches; masks of the fast registers."""

    direction: cython.longlong[2]
    latch: cython.longlong[2]
    hidden: cython.longlong[2]

    def __init__(self, chip) -> None:
        Gpio.__init__(self, chip)
        self.direction = [0, 0]
        self.latch = [0, 0]
        self.hidden = [0, 0]  # FIOMASK

    @cython.cfunc
    def drive(self, port: cython.longlong, bits: cython.longlong) -> cython.int:
        """Drive the outputs among `bits` with their latches."""
        bit: cython.longlong = 0
        bits &= self.direction[port]
        while bits:
            if bits & 1:
                self.write(32 * port + bit, self.latch[port] >> bit & 1)
            bits >>= 1
            bit += 1
        return 0

    @cython.cfunc
    def put(self, port: cython.longlong, bits: cython.longlong, levels: cython.longlong) -> cython.int:
        """Set the latches of `bits` to these levels."""
        self.latch[port] = self.latch[port] & ~bits | levels & bits
        return self.drive(port, bits)

    @cython.cfunc
    def direct(self, port: cython.longlong, value: cython.longlong) -> cython.int:
        """Bits of outputs, the others are inputs. An output that becomes an input keeps its level until an edge."""
        new: cython.longlong = value & ~self.direction[port]
        self.direction[port] = value
        return self.drive(port, new)


@cython.final
@cython.cclass
class FastGpioBlock(Block):
    """FIO0... and FIO1...; bytes and half-words of every register."""

    ports: Ports

    REGISTERS = {
        32 * port + offset: (f"FIO{port}{name}", access)
        for port in (0, 1)
        for offset, name, access in (
            (0x00, "DIR", "rw"),
            (0x10, "MASK", "rw"),
            (0x14, "PIN", "rw"),
            (0x18, "SET", "rw"),
            (0x1C, "CLR", "w"),
        )
    }

    def __init__(self, chip, clocks, ports) -> None:
        Block.__init__(self, chip, clocks, "fast GPIO", 0x3FFFC000)
        self.ports = ports

    def read(self, offset: cython.longlong) -> cython.longlong:
        ports: Ports = self.ports
        port: cython.longlong = offset >> 5
        register: cython.longlong = offset & 31
        if port < 2:
            self.steady = True
            if register == 0x14:
                return ports.IOPIN(port) & ~ports.hidden[port]
            if register == 0x18:
                return ports.latch[port] & ~ports.hidden[port]
            if register == 0x00:
                return ports.direction[port]
            if register == 0x10:
                return ports.hidden[port]
        return self.unknown(offset, False)

    def write(self, offset: cython.longlong, value: cython.longlong) -> cython.int:
        return self._put(offset, value, 0xFFFFFFFF)

    def write_part(self, offset: cython.longlong, size: cython.longlong, value: cython.longlong) -> cython.int:
        turn: cython.longlong = 8 * (offset & 3)
        chosen: cython.longlong = 0xFF if size == 1 else 0xFFFF
        return self._put(offset & ~3, value << turn, chosen << turn)

    @cython.cfunc
    def _put(self, offset: cython.longlong, value: cython.longlong, chosen: cython.longlong) -> cython.int:
        """Write the bits `chosen` of a register."""
        ports: Ports = self.ports
        port: cython.longlong = offset >> 5
        register: cython.longlong = offset & 31
        seen: cython.longlong
        if port > 1:
            self.unknown(offset, True)
            return 0
        seen = ~ports.hidden[port] & chosen
        if register == 0x18:
            ports.put(port, value & seen, value)
        elif register == 0x1C:
            ports.put(port, value & seen, 0)
        elif register == 0x14:
            ports.put(port, seen, value)
        elif register == 0x00:
            ports.direct(port, ports.direction[port] & ~chosen | value & chosen)
        elif register == 0x10:
            ports.hidden[port] = ports.hidden[port] & ~chosen | value & chosen
        else:
            self.unknown(offset, True)
        return 0


@cython.final
@cython.cclass
class OldGpioBlock(Block):
    """IO0... and IO1..., on the peripheral bus."""

    ports: Ports

    REGISTERS = {
        16 * port + offset: (f"IO{port}{name}", access)
        for port in (0, 1)
        for offset, name, access in ((0x0, "PIN", "rw"), (0x4, "SET", "rw"), (0x8, "DIR", "rw"), (0xC, "CLR", "w"))
    }

    def __init__(self, chip, clocks, ports) -> None:
        Block.__init__(self, chip, clocks, "GPIO", 0xE0028000)
        self.ports = ports

    def read(self, offset: cython.longlong) -> cython.longlong:
        ports: Ports = self.ports
        port: cython.longlong = offset >> 4
        register: cython.longlong = offset & 15
        if port < 2:
            self.steady = True
            if register == 0:
                return ports.IOPIN(port)
            if register == 4:
                return ports.latch[port]
            if register == 8:
                return ports.direction[port]
        return self.unknown(offset, False)

    def write(self, offset: cython.longlong, value: cython.longlong) -> cython.int:
        ports: Ports = self.ports
        port: cython.longlong = offset >> 4
        register: cython.longlong = offset & 15
        if port > 1:
            self.unknown(offset, True)
        elif register == 4:
            ports.put(port, value, value)
        elif register == 12:
            ports.put(port, value, 0)
        elif register == 0:
            ports.put(port, 0xFFFFFFFF, value)
        elif register == 8:
            ports.direct(port, value)
        return 0
