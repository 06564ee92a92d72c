# cython: boundscheck=False, wraparound=False
# (indices in the ring are taken modulo its length, those in the line's buffer are below its capacity)
"""The inertial sensor 3DM-GX3-25 on the outer legs: packets of bytes on its serial line.

It is silent until the command C4 C1 29 xx arrives, acknowledges it and then sends packet xx for ever (00 stops
it). Both packets known here have 31 bytes: header, six big-endian singles, a four-byte timer in ticks of
1/62 500 s, and the 16-bit sum of all 29 before it.

- CF: roll, pitch, yaw (rad), rates about x, y, z (rad/s), at the rate of its sensor fusion (200-250 Hz, appendix
  3.8; one packet per `fusion_divider` samples).
- C2: accelerations x, y, z (g), rates x, y, z (rad/s), every sample, 1 kHz. ROBOT PARITY: for the record walk we know
  only "rates alone at 1000 Hz"; C2 is the device's packet with scaled rates and no angles, as its protocol describes
  it. The accelerations are those of gravity alone, because nothing on the robot reads them.

Signs (robot.md C1.1, C3.2): with the outer legs' lean LO positive forward, rate x = bias - dLO/dt and
roll = roll_bias - LO. So the firmware's -(rate x - bias) is the legs' rate. The physical bias is the one that the
2011 firmware takes off, -0.004 rad/s; the roll bias the one of 2016, -0.021 rad.

ROBOT PARITY: fused angles are the true ones with noise and bias; the device's slow correction is not modelled.
"""

from typing import Final

import cython
from cython.cimports.libc.math import cos, exp, sin

from ranger_sim.foundation.edge_buffer import ByteBuffer
from ranger_sim.foundation.numbers import word_of_float
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import ModelError

# `Imu.mode`: the header of the packets that it sends
SILENT: Final = 0
HEADER_ANGLES_AND_RATES: Final = 0xCF
HEADER_RATES: Final = 0xC2
# the command that sets the mode: three bytes, then the header asked for
SET_MODE: Final = 0xC4
SET_MODE_SECOND: Final = 0xC1
SET_MODE_THIRD: Final = 0x29

PACKET_BYTES: Final = 31
MAX_FILTER: Final = 64  # samples
# C variables when compiled: Cython makes a Python object of every literal above 31 bits.
_MASK: cython.longlong = 4294967295
_TEN_BITS: cython.longlong = 10000000000


@cython.final
@cython.cclass
class Imu:
    """The device. `bytes`: ByteBuffer of what it sent in the last `update`, stamped with the end of each byte.

    `bias_rad_s`, `noise_rad_s` of each rate; `filter_samples`: moving average over that many samples (1: none);
    `latency_ns`: sample to first start bit; `ppb`: its own clock fast by this many parts per billion.
    """

    # fields read at every step and packet come first, next to each other
    bytes: ByteBuffer
    next_sample_ns: cython.longlong
    acknowledge: cython.longlong
    line_free_ns: cython.longlong
    byte_ns: cython.longlong
    checksum: cython.longlong
    mode: cython.longlong
    samples: cython.longlong
    packets: cython.longlong
    rate_scale: cython.double
    lag_s: cython.double
    cross_x_from_z: cython.double
    bias_rad_s: cython.double
    noise_rad_s: cython.double
    roll_bias_rad: cython.double
    roll_noise_rad: cython.double
    stream: RandomStream
    filter_samples: cython.longlong
    latency_ns: cython.longlong
    baud: cython.longlong
    sample_ns: cython.longlong
    fusion_divider: cython.longlong
    ppb: cython.longlong
    phase_ns: cython.longlong
    lagged: cython.double
    rate_x: cython.double
    roll: cython.double
    command: cython.longlong
    acknowledge_ns: cython.longlong
    ring_sum: cython.double
    ring: cython.double[64]  # MAX_FILTER

    def __init__(
        self,
        seed=0,
        bias_rad_s=-0.004,  # robot.md C3.1
        # Chosen by us: the log of the resting gyro (robot.md C6.2) spans 0.03 rad/s in 18 000 samples.
        noise_rad_s=0.004,
        roll_bias_rad=-0.021,  # robot.md N4.17
        roll_noise_rad=0.001,  # chosen by us: a few hundredths of a degree, far below the 0.5 degrees of accuracy
        filter_samples=1,
        latency_ns=500_000,  # chosen by us: half a sample to compute and frame a packet
        baud=460_800,  # the device's setting; the board's divider makes 460 526 of it
        sample_ns=1_000_000,
        fusion_divider=4,  # 250 Hz, appendix 3.8
        ppb=0,
        phase_ns=0,
    ) -> None:
        if not 1 <= filter_samples <= MAX_FILTER or fusion_divider < 1 or baud < 1 or sample_ns < 1:
            raise ModelError(
                f"inertial sensor: filter_samples {filter_samples} (1 ... {MAX_FILTER}), fusion_divider "
                f"{fusion_divider}, baud {baud} or sample_ns {sample_ns} is impossible"
            )
        if noise_rad_s < 0.0 or roll_noise_rad < 0.0 or latency_ns < 0:
            raise ModelError("inertial sensor: noise and latency must not be negative")
        self.bias_rad_s = bias_rad_s
        self.noise_rad_s = noise_rad_s
        self.roll_bias_rad = roll_bias_rad
        self.roll_noise_rad = roll_noise_rad
        self.filter_samples = filter_samples
        self.latency_ns = latency_ns
        self.baud = baud
        self.sample_ns = sample_ns
        self.fusion_divider = fusion_divider
        self.ppb = ppb
        self.phase_ns = phase_ns
        self.rate_scale = 1.0
        self.lag_s = 0.0
        self.cross_x_from_z = 0.0  # rad, misalignment: how much of the yaw rate shows about x
        self.stream = RandomStream(seed, "inertial sensor")
        self.bytes = ByteBuffer()
        self.samples = 0
        self.next_sample_ns = phase_ns
        self.line_free_ns = 0
        self.byte_ns = 0
        self.packets = 0
        self.mode = SILENT
        self.command = 0  # bytes of a command received so far
        self.acknowledge = -1  # command byte to acknowledge
        self.acknowledge_ns = 0
        self.ring = [0.0] * 64  # MAX_FILTER
        self.ring_sum = 0.0
        self.lagged = 0.0
        self.rate_x = 0.0  # of the last sample
        self.roll = 0.0
        self.checksum = 0

    @cython.ccall
    def receive_byte(self, time: cython.longlong, byte: cython.longlong) -> cython.void:
        """A byte of the board arrived complete at `time` (ns)."""
        if self.command == 3:
            self.mode = byte & 255
            if self.mode != HEADER_ANGLES_AND_RATES and self.mode != HEADER_RATES:
                self.mode = SILENT
            self.acknowledge = byte & 255
            self.acknowledge_ns = time
            self.command = 0
        elif self.command == 1 and byte == SET_MODE_SECOND or self.command == 2 and byte == SET_MODE_THIRD:
            self.command += 1
        else:
            self.command = 1 if byte == SET_MODE else 0

    @cython.ccall
    def sample_time(self, n: cython.longlong) -> cython.longlong:
        """Time (ns) of sample n, from the count, in a clock that is `ppb` fast."""
        drift: cython.longlong = (n // 1000000) * self.ppb * (self.sample_ns // 1000)
        drift += (n % 1000000) * self.ppb * self.sample_ns // 1000000000
        return self.phase_ns + n * self.sample_ns - drift

    @cython.ccall
    @cython.exceptval(check=False)
    def is_due(self, t1: cython.longlong) -> cython.bint:
        """Whether an `update` up to `t1` (ns) has work, even if only to remove the bytes of the last one."""
        return self.next_sample_ns < t1 or self.acknowledge >= 0 or self.bytes.count > 0

    @cython.ccall
    def update(
        self,
        t0: cython.longlong,
        t1: cython.longlong,
        lean0: cython.double,
        rate0: cython.double,
        lean1: cython.double,
        rate1: cython.double,
        yaw: cython.double = 0.0,
        yaw_rate: cython.double = 0.0,
    ) -> None:
        """Take all samples of [t0, t1) and send due packets: lean (rad) and lean rate (rad/s) at both ends."""
        fraction: cython.double
        rate: cython.double
        roll: cython.double
        place: cython.longlong
        start: cython.longlong
        self.bytes.count = 0
        if self.acknowledge >= 0 and t1 > self.acknowledge_ns:
            self._acknowledge()
        while self.next_sample_ns < t1:
            fraction = 0.0
            if self.next_sample_ns > t0:
                fraction = (self.next_sample_ns - t0) / (t1 - t0)
            rate = -self.rate_scale * (rate0 + fraction * (rate1 - rate0)) + self.cross_x_from_z * yaw_rate
            if self.lag_s > 0.0:
                self.lagged += (rate - self.lagged) * (1.0 - exp(-1e-9 * self.sample_ns / self.lag_s))
                rate = self.lagged
            rate += self.bias_rad_s
            if self.noise_rad_s > 0.0:
                rate += self.noise_rad_s * self.stream.normal()
            if self.filter_samples > 1:
                place = self.samples % self.filter_samples
                self.ring_sum += rate - self.ring[place]
                self.ring[place] = rate
                rate = self.ring_sum / self.filter_samples
            self.rate_x = rate
            start = self.next_sample_ns + self.latency_ns
            if start < self.line_free_ns:
                start = self.line_free_ns
            if self.mode == HEADER_RATES:
                roll = self.roll_bias_rad - (lean0 + fraction * (lean1 - lean0))
                self.roll = roll
                self._packet(start, 0.0, -sin(roll), -cos(roll), yaw_rate)
            elif self.mode == HEADER_ANGLES_AND_RATES and self.samples % self.fusion_divider == 0:
                roll = self.roll_bias_rad - (lean0 + fraction * (lean1 - lean0))
                if self.roll_noise_rad > 0.0:
                    roll += self.roll_noise_rad * self.stream.normal()
                self.roll = roll
                self._packet(start, roll, 0.0, yaw, yaw_rate)
            self.samples += 1
            self.next_sample_ns = self.sample_time(self.samples)

    @cython.ccall
    def _begin(self) -> cython.void:
        """Reserve space for a packet and start its sum."""
        line: ByteBuffer = self.bytes
        if line.count + PACKET_BYTES > line.capacity:
            line.grow()
        self.byte_ns = _TEN_BITS // self.baud
        self.checksum = 0

    @cython.ccall
    def _send(self, byte: cython.longlong) -> cython.void:
        """One byte on the line, from `line_free_ns` on; 10 bits at the baud rate."""
        line: ByteBuffer = self.bytes
        self.checksum += byte
        self.line_free_ns += self.byte_ns
        line.times[line.count] = self.line_free_ns
        line.values[line.count] = byte
        line.count += 1

    @cython.ccall
    def _word(self, word: cython.longlong) -> cython.void:
        """Four bytes, the highest first."""
        line: ByteBuffer = self.bytes
        at: cython.longlong = line.count
        time: cython.longlong = self.line_free_ns
        byte_ns: cython.longlong = self.byte_ns
        total: cython.longlong = 0
        shift: cython.longlong
        byte: cython.longlong
        for shift in range(24, -8, -8):
            byte = word >> shift & 255
            time += byte_ns
            line.times[at] = time
            line.values[at] = byte
            total += byte
            at += 1
        self.checksum += total
        self.line_free_ns = time
        line.count = at

    @cython.ccall
    def _sum(self) -> cython.void:
        """The 16-bit sum of everything since the header."""
        total: cython.longlong = self.checksum & 65535
        self._send(total >> 8)
        self._send(total & 255)

    @cython.ccall
    def _packet(
        self,
        start: cython.longlong,
        first: cython.double,
        second: cython.double,
        third: cython.double,
        yaw_rate: cython.double,
    ) -> cython.void:
        """One packet of 31 bytes whose first start bit is at `start`."""
        self.line_free_ns = start
        self._begin()
        self._send(self.mode)
        self._word(word_of_float(first))
        self._word(word_of_float(second))
        self._word(word_of_float(third))
        self._word(word_of_float(self.rate_x))
        self._word(word_of_float(self.bias_rad_s))  # about y the legs do not turn
        self._word(word_of_float(yaw_rate + self.bias_rad_s))
        self._word(self.next_sample_ns // 16000 & _MASK)
        self._sum()
        self.packets += 1

    @cython.ccall
    def _acknowledge(self) -> cython.void:
        """The answer to a mode command: C4, the command, timer, sum (8 bytes)."""
        start: cython.longlong = self.acknowledge_ns + self.latency_ns
        if start > self.line_free_ns:
            self.line_free_ns = start
        self._begin()
        self._send(SET_MODE)
        self._send(self.acknowledge)
        self._word(self.acknowledge_ns // 16000 & _MASK)
        self._sum()
        self.acknowledge = -1
