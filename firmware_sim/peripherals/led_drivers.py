# cython: boundscheck=False, wraparound=False
# (devices are those of the chain, ports 0 ... 9, registers masked to 32)
"""LED drivers MAX6966 in a chain on the SSP: shift registers, and what a rising edge of their select pin makes of them.

MAX6966/MAX6967 data sheet. 16 bits for each device: bit 15 reads, bits 14-8 are the register's address, 7-0 the data.
The first word that is sent ends in the device that is farthest from the processor. Registers 0x00-0x09 are the ports;
0x0A-0x0D write several of them; 0x10 bit 0 is run mode, without which no port drives; 0x20 does nothing.
Not modelled: currents (0x13-0x15) and ramps (0x11, 0x12), which dim, inputs, and the outputs' phases.
"""

import array

import cython

from ranger_sim.firmware_sim.peripherals.ssp import SspDevice
from ranger_sim.foundation.user_error import FirmwareError

PORTS = 10
REGISTERS = 32  # of a device, the last ones not there
MOST_DEVICES = 2  # whose shift register, moved by a word, fits into a whole number of C
WORD_BITS = 16
READ = 0x8000
CONFIGURATION = 0x10
RUN = 1
# values of a port; 3 ... 254 are 256ths of the period
LOW_LOGIC, HIGH_LOGIC, LOW, OPEN = 0x00, 0x01, 0x02, 0xFF
GROUPS = {0x0A: (0, 10), 0x0B: (0, 4), 0x0C: (4, 8), 0x0D: (8, 10)}  # register: first port, port behind the last
ALL_GROUPS_BELOW = 0x10  # 0x0E and 0x0F, inputs, are read only


@cython.final
@cython.cclass
class LedDrivers(SspDevice):
    """`count` drivers; number 0 is nearest to the processor. `writes`: how many registers have been written.

    `on_select` is to be called with each change of the select pin (`Chip.followers` of whoever made this).
    """

    select_pin: cython.longlong
    count: cython.longlong
    shift: cython.longlong
    writes: cython.longlong
    selected: cython.bint
    registers: cython.longlong[::1]

    def __init__(self, chip, select_pin, count=1) -> None:
        if not 1 <= count <= MOST_DEVICES:
            raise FirmwareError(f"{chip.name}: a chain of {count} LED drivers: 1 to {MOST_DEVICES} are modelled")
        SspDevice.__init__(self, chip)
        self.select_pin = select_pin
        self.count = count
        self.selected = False
        self.shift = 0
        self.registers = array.array("q", [0]) * (REGISTERS * count)
        for device in range(count):
            for port in range(PORTS):
                self.registers[REGISTERS * device + port] = OPEN
        self.writes = 0

    def exchange(self, word: cython.longlong, time: cython.longlong) -> cython.longlong:
        """The bits go in at the near end; those that leave the far end come back."""
        length: cython.longlong = WORD_BITS * self.count
        out: cython.longlong
        if self.chip.pins[self.select_pin]:
            return 0
        out = self.shift >> (length - self.bits)
        self.shift = (self.shift << self.bits | word) & ((cython.cast(cython.longlong, 1) << length) - 1)
        return out

    @cython.ccall
    def on_select(self, level: cython.longlong) -> cython.bint:
        """The select pin is `level` from now on; True when the drivers have taken what was shifted in."""
        device: cython.longlong
        rises: cython.bint = level != 0 and self.selected
        self.selected = level == 0
        if rises:
            for device in range(self.count):
                self._take(device, self.shift >> (WORD_BITS * device) & 0xFFFF)
        return rises

    @cython.cfunc
    def _take(self, device: cython.longlong, word: cython.longlong) -> cython.int:
        """One driver does what its 16 bits say."""
        address: cython.longlong = word >> 8 & 0x7F
        first: cython.longlong = REGISTERS * device
        place: cython.longlong
        if word & READ:  # goes out with the next bits
            place = WORD_BITS * device
            self.shift &= ~(cython.cast(cython.longlong, 0xFF) << place)
            if address < REGISTERS:
                self.shift |= self.registers[first + address] << place
        elif address < PORTS or ALL_GROUPS_BELOW <= address < REGISTERS:
            self._put(first + address, word & 0xFF)
        elif address < REGISTERS:
            begin, end = GROUPS.get(address, (0, 0))
            for port in range(begin, end):
                self._put(first + port, word & 0xFF)
        return 0

    @cython.cfunc
    def _put(self, place: cython.longlong, value: cython.longlong) -> cython.int:
        self.registers[place] = value
        self.writes += 1
        return 0

    @cython.ccall
    def level(self, device: cython.longlong, port: cython.longlong) -> cython.longlong:
        """Brightness that an eye sees at a port: 0 (off) ... 255 (always on)."""
        value: cython.longlong = self.registers[REGISTERS * device + port]
        if not self.registers[REGISTERS * device + CONFIGURATION] & RUN:
            return 0
        if value == HIGH_LOGIC or value == OPEN:
            return 0
        return 255 if value == LOW_LOGIC or value == LOW else value
