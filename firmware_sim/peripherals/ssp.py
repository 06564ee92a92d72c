"""The synchronous serial port: words to the device on its wires, or a link of whole segments between two chips.

As a master of words (`SspMaster`) it exchanges each with an `SspDevice` at once: the time that this takes is part of
the program's cost.

A segment is 31 half-words; at 16 bits and 3 Mbit/s it lasts 165.3 us. The master starts an exchange
(SSP_START at `now`), the slave has loaded what it will send (SSP_LOAD), which goes out in every exchange until
something else is loaded; when the last bit is through, each side gets SSP_SEGMENT and with it the interrupt
(SSP_SEGMENT, number). The wire between them is not ours.

The FIFO is not modelled word by word: the interrupts that feed it are charged in one, by `per_item` of the
handler, which returns the number of half-words.
"""

from typing import TYPE_CHECKING

import cython

from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.vic import InterruptSource
from ranger_sim.foundation.events import SSP_LOAD, SSP_SEGMENT, SSP_START

if TYPE_CHECKING:
    pass

SEGMENT_WORDS = 31
LONGEST_WORD = 16  # bits
BIT_RATE = 3_000_000  # 60 MHz / 20
WORD_BITS = 16


@cython.ccall
def segment_time_ns(words: cython.longlong, word_bits: cython.longlong, bit_rate: cython.longlong) -> cython.longlong:
    """Duration of `words` words of `word_bits` bits (ns, rounded down): 31, 16, 3 Mbit/s give 165,333."""
    return words * word_bits * 1000000000 // bit_rate


@cython.cclass
class SspDevice(Peripheral):
    """A device on the SSP; this base is an empty wire, which reads as zeros. `bits`: of a word of the master."""

    bits: cython.longlong

    def __init__(self, chip) -> None:
        Peripheral.__init__(self, chip)
        self.bits = LONGEST_WORD

    @cython.ccall
    def begin(self, time: cython.longlong) -> cython.int:
        """The first bit of a word goes over the wires at `time` (ns)."""
        return 0

    @cython.ccall
    def exchange(self, word: cython.longlong, time: cython.longlong) -> cython.longlong:
        """The last bit of `word` is through at `time`; returns the received word."""
        return 0


@cython.final
@cython.cclass
class SspMaster(Peripheral):
    """The port as a master of words of `bits` bits to `device`."""

    device: SspDevice
    bits: cython.longlong

    def __init__(self, chip, device, bits=LONGEST_WORD) -> None:
        Peripheral.__init__(self, chip)
        self.device = device
        self.bits = bits

    @cython.ccall
    def word(self, word: cython.longlong) -> cython.longlong:
        """Send a word; returns the received one."""
        device: SspDevice = self.device
        device.bits = self.bits
        device.begin(self.chip.now)
        return device.exchange(word & ((1 << self.bits) - 1), self.chip.now)


@cython.final
@cython.cclass
class SspSegment:
    """31 half-words, the last of which is the checksum of the others; `used`: how many are filled in.

    They are kept as the senders have them: `rows` of a half-word and two words of 32 bits, six times. Of the checksum
    only `checksum_error` is kept: how much it is above the sum of the others, 0 unless a fault changed it.
    """

    used: cython.longlong
    checksum_error: cython.longlong
    rows: cython.longlong[18]

    def __init__(self) -> None:
        self.rows = [0] * 18
        self.checksum_error = 0
        self.used = 0

    @property
    def words(self) -> list:
        """The half-words on the wire, each 0 ... 65535: a copy."""
        half_words = []
        for row in range(0, 18, 3):
            word0, word1 = self.rows[row + 1], self.rows[row + 2]
            half_words += [self.rows[row], word0 >> 16, word0 & 0xFFFF, word1 >> 16, word1 & 0xFFFF]
        return [*half_words, (1 + sum(half_words) + self.checksum_error) & 0xFFFF]

    @words.setter
    def words(self, half_words) -> None:
        for row in range(6):
            at = 5 * row
            self.rows[3 * row] = half_words[at]
            self.rows[3 * row + 1] = half_words[at + 1] << 16 | half_words[at + 2]
            self.rows[3 * row + 2] = half_words[at + 3] << 16 | half_words[at + 4]
        self.checksum_error = (half_words[30] - 1 - sum(half_words[:30])) & 0xFFFF

    @cython.ccall
    def clear(self) -> cython.void:
        """Thirty zeros and their checksum, nothing used."""
        self.rows = [0] * 18
        self.checksum_error = 0
        self.used = 0

    @cython.ccall
    def copy_from(self, other: "SspSegment") -> cython.void:
        """Take over the contents of another segment."""
        i: cython.longlong
        for i in range(18):
            self.rows[i] = other.rows[i]
        self.checksum_error = other.checksum_error
        self.used = other.used


@cython.final
@cython.cclass
class SspPort(Peripheral):
    """One end of the link. A received segment waits in `received`; one not taken is overwritten and counted."""

    untaken: cython.bint
    number: cython.longlong
    source: InterruptSource
    received: SspSegment
    loaded: SspSegment
    received_time: cython.longlong
    exchanges: cython.longlong
    overwritten: cython.longlong

    def __init__(self, chip, number=0) -> None:
        Peripheral.__init__(self, chip)
        self.number = number
        self.loaded = None
        self.exchanges = 0
        self.overwritten = 0
        self.received = None
        self.received_time = 0
        self.untaken = False
        self.source = chip.vic.source(SSP_SEGMENT, number)
        chip.claim(SSP_SEGMENT, number, self)

    @cython.ccall
    def start(self, segment: SspSegment) -> cython.void:
        """Master: exchange `segment` from `now` on. It must not be changed until it is through."""
        self.chip.outbox.push(self.chip.now, 0, SSP_START, self.number, 0, 0, 0, 0, 0, segment)

    @cython.ccall
    def load(self, segment: SspSegment) -> cython.void:
        """Slave: send `segment` from the next exchange on. It must not be changed until something else is loaded."""
        if segment is self.loaded:
            return
        self.loaded = segment
        self.chip.outbox.push(self.chip.now, 0, SSP_LOAD, self.number, 0, 0, 0, 0, 0, segment)

    def on_message(self, queue) -> InterruptSource | None:
        """Take the other side's segment."""
        if self.untaken:
            self.overwritten += 1
        self.received = cython.cast(SspSegment, queue.ref)  # the only thing such a message brings
        self.received_time = queue.time
        self.untaken = True
        self.exchanges += 1
        return self.source

    @cython.ccall
    def take(self) -> SspSegment:
        """The segment received last, or None when it has been taken already."""
        if not self.untaken:
            return None
        self.untaken = False
        return self.received
