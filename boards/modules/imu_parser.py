# cython: boundscheck=False, wraparound=False
# (every index below is a place of the ring, which is masked)
"""The IMU's packets: a receive ring of 128 bytes and a parser that takes one packet or none per call.

Both packets the board can ask for have 31 bytes: a header byte, six big-endian singles, a four-byte timer
(1/62 500 s per tick in the data sheet of the 3DM-GX3-25; not used here) and a 16-bit big-endian checksum,
the sum of the 29 bytes before it.

- 0xCF: roll, pitch, yaw (rad), then rates about x, y, z (rad/s). What the 2016 firmware asks for
  (robot.md N4.10).
- 0xC2: accelerations x, y, z (g), then rates. The device sends this one at 1 kHz, because nothing has to
  be fused for it. ROBOT PARITY: appendix 3.8 says only that the record walk used rates alone at 1 kHz;
  0xC2 is chosen by us, because it is the device's documented packet with scaled rates and no angles.
"""

from typing import Final

import cython

from ranger_sim.datatable.generated import errors
from ranger_sim.firmware_sim.peripherals.uart import Uart
from ranger_sim.foundation.numbers import float_of_word

HEADER_ANGLES_AND_RATES: Final = 0xCF
HEADER_RATES_ONLY: Final = 0xC2
PACKET_BYTES: Final = 31
PACKET_WORDS: Final = 7  # six values and the timer
RING_BYTES: Final = 128
RING_MASK: Final = 127
CHECKSUM_MASK: Final = 0xFFFF


def start_command(header) -> bytes:
    """The four bytes that put the device into continuous mode with packet `header` (robot.md N4.10)."""
    return bytes((0xC4, 0xC1, 0x29, header))


@cython.final
@cython.cclass
class ImuParser:
    """Bytes in by `push` or `receive`, one packet out per `update`; values stay until the next good packet.

    `report(code)` receives MSIMU_RX_OF when the ring is full. `late_by_one_byte`: the firmware waits for
    more than 31 bytes, so a packet stays unread until its successor has begun.
    """

    ring_write: cython.longlong
    ring_read: cython.longlong
    header: cython.longlong
    needed: cython.longlong
    ring: cython.longlong[128]
    words: cython.longlong[7]
    has_angles: cython.bint
    rate_x: cython.double
    rate_y: cython.double
    rate_z: cython.double
    roll: cython.double
    pitch: cython.double
    yaw: cython.double
    acceleration_x: cython.double
    acceleration_y: cython.double
    acceleration_z: cython.double
    timer: cython.longlong
    packets: cython.longlong
    bad_checksums: cython.longlong
    skipped_bytes: cython.longlong
    bytes_lost: cython.longlong
    code_ring_full: cython.longlong
    report: object

    def __init__(self, report, header=HEADER_ANGLES_AND_RATES, late_by_one_byte=False) -> None:
        self.report = report
        self.header = header
        self.has_angles = header == HEADER_ANGLES_AND_RATES
        self.needed = PACKET_BYTES + 1 if late_by_one_byte else PACKET_BYTES
        self.code_ring_full = errors.MSIMU_RX_OF
        self.ring = [0] * 128  # RING_BYTES
        self.words = [0] * 7  # PACKET_WORDS of the packet that was examined last: six values and the timer
        self.ring_write = 0
        self.ring_read = 0
        self.roll = 0.0
        self.pitch = 0.0
        self.yaw = 0.0
        self.rate_x = 0.0
        self.rate_y = 0.0
        self.rate_z = 0.0
        self.acceleration_x = 0.0
        self.acceleration_y = 0.0
        self.acceleration_z = 0.0
        self.timer = 0
        self.packets = 0
        self.bad_checksums = 0
        self.skipped_bytes = 0
        self.bytes_lost = 0

    @cython.ccall
    def push(self, byte: cython.longlong) -> cython.bint:
        """Store a received byte; 127 fit, a byte more is lost and reported (MSIMU_RX_OF): False."""
        following: cython.longlong = (self.ring_write + 1) & RING_MASK
        if following == self.ring_read:
            self.bytes_lost += 1
            self.report(self.code_ring_full)
            return False
        self.ring[self.ring_write] = byte & 0xFF
        self.ring_write = following
        return True

    @cython.ccall
    def receive(self, uart: Uart) -> cython.longlong:
        """Store every byte that waits in the FIFO of `uart`; returns how many there were."""
        count: cython.longlong = uart.fifo_count
        write: cython.longlong = self.ring_write
        i: cython.longlong
        if self.waiting() + count < RING_BYTES:
            for i in range(count):
                self.ring[(write + i) & RING_MASK] = uart.fifo[i]
            uart.were_read(count)
            self.ring_write = (write + count) & RING_MASK
        else:
            for _byte in range(count):
                self.push(uart.RBR())
        return count

    @cython.ccall
    @cython.exceptval(check=False)
    def waiting(self) -> cython.longlong:
        """Bytes in the ring."""
        return (self.ring_write - self.ring_read) & RING_MASK

    @cython.ccall
    @cython.exceptval(check=False)
    def update(self) -> cython.longlong:
        """Look for one packet; return the number of bytes examined (the cost depends on it).

        Bytes before a header are skipped; a packet with a wrong sum costs one byte, and the search goes on
        in the next call's 31 bytes.
        """
        examined: cython.longlong = 0
        total: cython.longlong = self.header
        sent: cython.longlong
        i: cython.longlong
        byte_0: cython.longlong
        byte_1: cython.longlong
        byte_2: cython.longlong
        byte_3: cython.longlong
        read: cython.longlong
        waiting: cython.longlong = self.waiting()
        while waiting >= self.needed and self.ring[self.ring_read] != self.header:
            self.ring_read = (self.ring_read + 1) & RING_MASK
            self.skipped_bytes += 1
            examined += 1
            waiting -= 1
        if waiting < self.needed:
            return examined
        read = self.ring_read + 1
        for i in range(PACKET_WORDS):
            byte_0 = self.ring[read & RING_MASK]
            byte_1 = self.ring[(read + 1) & RING_MASK]
            byte_2 = self.ring[(read + 2) & RING_MASK]
            byte_3 = self.ring[(read + 3) & RING_MASK]
            total += byte_0 + byte_1 + byte_2 + byte_3
            self.words[i] = byte_0 << 24 | byte_1 << 16 | byte_2 << 8 | byte_3
            read += 4
        sent = (self.ring[read & RING_MASK] << 8) | self.ring[(read + 1) & RING_MASK]
        examined += PACKET_BYTES
        if (total & CHECKSUM_MASK) != sent:
            self.bad_checksums += 1
            self.ring_read = (self.ring_read + 1) & RING_MASK
            return examined
        if self.has_angles:
            self.roll = float_of_word(self.words[0])
            self.pitch = float_of_word(self.words[1])
            self.yaw = float_of_word(self.words[2])
        else:
            self.acceleration_x = float_of_word(self.words[0])
            self.acceleration_y = float_of_word(self.words[1])
            self.acceleration_z = float_of_word(self.words[2])
        self.rate_x = float_of_word(self.words[3])
        self.rate_y = float_of_word(self.words[4])
        self.rate_z = float_of_word(self.words[5])
        self.timer = self.words[6]
        self.ring_read = (read + 2) & RING_MASK
        self.packets += 1
        return examined
