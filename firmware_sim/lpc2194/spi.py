"""SPI 0's registers, with an absolute encoder at it, and SPI 1's, with nothing. LPC2194 user manual, SPI.

The encoder is peripherals/spi_encoder.py: no device receives what the program sends. Not modelled: slave mode, mode
fault, a transfer of SPI 1, whose pins the SSP has.
"""

from typing import Final

import cython

from ranger_sim.firmware_sim.lpc2194.block import Block
from ranger_sim.firmware_sim.lpc2194.vic import SPI0_INPUT
from ranger_sim.firmware_sim.peripherals.spi_encoder import SPSR_SPIF, SpiEncoder

# SPCR
CR_BIT_ENABLE: Final = 0x04
CR_MASTER: Final = 0x20
CR_INTERRUPT: Final = 0x80


@cython.final
@cython.cclass
class SpiBlock(Block):
    """`SPINT`: the interrupt flag."""

    spi: SpiEncoder
    CR: cython.longlong
    CCR: cython.longlong
    SPINT: cython.longlong
    under_way: cython.bint
    status_read: cython.bint

    READ_ACTS = frozenset({0x04, 0x08})
    REGISTERS = {
        0x00: ("SPCR", "rw"),
        0x04: ("SPSR", "r"),
        0x08: ("SPDR", "rw"),
        0x0C: ("SPCCR", "rw"),
        0x1C: ("SPINT", "rw"),
    }

    def __init__(self, chip, clocks, number, hardware) -> None:
        mask = 1 << SPI0_INPUT if hardware is not None else 0
        Block.__init__(self, chip, clocks, f"SPI {number}", 0xE0020000 + 0x10000 * number, mask)
        self.spi = None
        if hardware is not None:
            self.spi = SpiEncoder(chip, 0, hardware.word, hardware.bits, hardware.bit_rate, hardware.value_bits)
        self.CR = 0
        self.CCR = 0
        self.SPINT = 0
        self.under_way = False
        self.status_read = False  # SPSR was read with SPIF: an access to SPDR clears it

    def requests(self) -> cython.longlong:
        if self.under_way and not self.spi.busy:
            self.under_way = False
            if self.CR & CR_INTERRUPT:
                self.SPINT = 1
        return self.mask if self.SPINT else 0

    def read(self, offset: cython.longlong) -> cython.longlong:
        value: cython.longlong
        if offset == 0x04:
            value = self.spi.SPSR if self.spi is not None else 0
            if value & SPSR_SPIF:
                self.status_read = True
            else:
                self.steady = True
            return value
        if offset == 0x08:
            if self.spi is None:
                self.not_modelled("a transfer without a device at this SPI")
            if self.status_read:
                self.status_read = False
                return self.spi.read()
            return self.spi.SPDR
        self.steady = True
        if offset == 0x00:
            return self.CR
        if offset == 0x0C:
            return self.CCR
        if offset == 0x1C:
            return self.SPINT
        return self.unknown(offset, False)

    def write(self, offset: cython.longlong, value: cython.longlong) -> cython.int:
        if offset == 0x08:
            self._transfer()
        elif offset == 0x00:
            self.CR = value & 0xFFF
        elif offset == 0x0C:
            self.CCR = value & 0xFF
        elif offset == 0x1C:
            self.SPINT &= ~value & 1
        else:
            self.unknown(offset, True)
        return 0

    @cython.ccall
    def _transfer(self) -> object:
        """Write S0SPDR."""
        if not self.CR & CR_MASTER:
            self.not_modelled("an SPI as a slave")
        if self.spi is None:
            self.not_modelled("a transfer without a device at this SPI")
        if self.CCR < 8:
            self.not_modelled(f"a clock of SPCCR {self.CCR} (it is 8 or more)")
        bits = 8
        if self.CR & CR_BIT_ENABLE:
            bits = self.CR >> 8 & 15 or 16
        spi: SpiEncoder = self.spi
        if spi.busy:  # a write collision: the word is lost
            return
        spi.bits = bits
        spi.bit_rate = self.clocks.pclk // self.CCR
        spi.transfer_ns = self.chip.crystal.true_ns(bits * self.CCR * 1_000_000_000 // self.clocks.pclk)
        spi.SPSR = 0
        self.status_read = False
        spi.start()
        self.under_way = True
