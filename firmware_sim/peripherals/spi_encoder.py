# cython: boundscheck=False, wraparound=False
# (the word is one of the sixteen of the chip)
"""An absolute encoder read through an SPI master (S0SPDR, S0SPSR): one word per transfer.

The encoder latches its position at the first clock edge and shifts it out; 14 bits at 1 MHz are 14 us,
after which (SPI_DONE, number) is raised. The value is the low 13 bits, 0 ... 8191.
"""

from typing import TYPE_CHECKING, Final

import cython

from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.vic import SPI_DONE, InterruptSource
from ranger_sim.foundation.user_error import FirmwareError

if TYPE_CHECKING:
    from ranger_sim.firmware_sim.alarm import Alarm

SPSR_SPIF: Final = 0x80  # S0SPSR: the transfer is complete


@cython.final
@cython.cclass
class SpiEncoder(Peripheral):
    """SPI `number` with the encoder that holds out `chip.words[word]`."""

    # what a transfer touches
    busy: cython.bint
    alarm: "Alarm"
    word: cython.longlong
    mask: cython.longlong
    latched: cython.longlong
    SPDR: cython.longlong
    SPSR: cython.longlong
    transfer_ns: cython.longlong
    source: InterruptSource
    # the rest
    number: cython.longlong
    bits: cython.longlong
    bit_rate: cython.longlong
    not_finished: cython.longlong

    def __init__(self, chip, number=0, word=0, bits=14, bit_rate=1_000_000, value_bits=13) -> None:
        Peripheral.__init__(self, chip)
        if not 1 <= bits <= 16 or not 1 <= value_bits <= 16 or bit_rate <= 0:
            raise FirmwareError(
                f"{chip.name}: SPI {number}: {bits} bits, {value_bits} value bits at {bit_rate} Hz are impossible"
            )
        if not 0 <= word < len(chip.words):
            raise FirmwareError(f"{chip.name}: SPI {number}: word {word} is not 0 ... {len(chip.words) - 1}")
        self.number = number
        self.word = word
        self.bits = bits
        self.bit_rate = bit_rate
        self.transfer_ns = bits * 1_000_000_000 // bit_rate
        self.mask = (1 << value_bits) - 1
        self.alarm = chip.new_alarm(self, 0)
        self.source = chip.vic.source(SPI_DONE, number)
        self.SPDR = 0
        self.SPSR = 0
        self.latched = 0
        self.not_finished = 0
        self.busy = False

    @cython.ccall
    def start(self) -> cython.bint:
        """Write S0SPDR: the transfer begins; False (and `not_finished` counts) while one is under way."""
        if self.busy:
            self.not_finished += 1
            return False
        self.busy = True
        self.SPSR = 0
        self.latched = self.chip.words[self.word] & self.mask
        self.alarm.set(self.chip.now + self.transfer_ns)
        return True

    def on_alarm(self, alarm: cython.longlong, time: cython.longlong) -> InterruptSource | None:
        """The transfer is complete: SPIF is set."""
        self.SPDR = self.latched
        self.SPSR = SPSR_SPIF
        self.busy = False
        return self.source

    @cython.ccall
    @cython.exceptval(check=False)
    def read(self) -> cython.longlong:
        """Read S0SPDR, which clears SPIF."""
        self.SPSR = 0
        return self.SPDR
