"""Faults of the inertial unit: another rate in its packets, with the right sum, or no packets.

Values are those that the unit reports, about its axis x: backwards positive, in rad/s (robot.md C1.1).
"""

import math
from typing import Any

from ranger_sim.foundation.numbers import float_of_word, word_of_float
from ranger_sim.harness.faults import signals
from ranger_sim.harness.faults.catalogue import REASONS, mode
from ranger_sim.harness.faults.fault import Fault, Parameter
from ranger_sim.harness.faults.kinds import IMU
from ranger_sim.harness.faults.sensor import Quantity, SignalFault, lasting, mode_classes
from ranger_sim.plant.sensors.imu import PACKET_BYTES, SET_MODE

ACKNOWLEDGEMENT_BYTES = 8
RATE_X = 13  # place of the rate about x in a packet

RATE = Quantity(
    unit="rad/s",
    typical=0.2,
    limit=5.2,
    clip_low=-0.5,
    clip_high=0.5,
    open_value=0.0,
    source="chosen by us: a fifth of the legs' mean rate; the unit ends at 300 degrees a second (its data sheet)",
)


class PacketFault(Fault):
    """A fault of the packets that the unit sends in a step."""

    unit = RATE.unit

    def connect(self) -> None:
        self.imu: Any = self.robot.plant.imu

    def begin(self, now_ns: int) -> None:
        super().begin(now_ns)
        self.lean_rate = self.robot.plant.body.outer.rate

    def before(self, now_ns: int) -> None:
        self.lean_rate = self.robot.plant.body.outer.rate

    def finish(self, now_ns: int) -> None:
        self.lean_rate = self.robot.plant.body.outer.rate

    def after(self, start_ns: int, end_ns: int) -> None:
        line = self.imu.bytes
        at, count = 0, line.count
        while at < count:
            size = ACKNOWLEDGEMENT_BYTES if line.values[at] == SET_MODE else PACKET_BYTES
            if size == PACKET_BYTES and not self.keep_packet(line.values, at, line.times[at]):
                for place in range(at, count - size):  # the remaining bytes move up
                    line.times[place], line.values[place] = line.times[place + size], line.values[place + size]
                count -= size
                line.count = count
            else:
                at += size

    def keep_packet(self, values: Any, at: int, time_ns: int) -> bool:
        """The packet of 31 bytes from `at` on, the first ending at `time_ns`, may be changed; False: it is not sent."""
        return True

    def is_clear(self, start_ns: int, end_ns: int) -> bool:
        """Whether a packet reports the legs' rate, except bias and noise. Six deviations: one in 5e8 is farther."""
        values = [int(value) for value in self.imu.bytes.values[: self.imu.bytes.count]]
        before, self.lean_rate = self.lean_rate, self.robot.plant.body.outer.rate
        if len(values) < PACKET_BYTES or values[-PACKET_BYTES] != self.imu.mode:
            return False
        rates = [self.imu.bias_rad_s - self.imu.rate_scale * rate for rate in (before, self.lean_rate)]
        room = 6.0 * self.imu.noise_rad_s + 1e-6
        if self.imu.lag_s > 0.0 or self.imu.filter_samples > 1 or self.imu.cross_x_from_z != 0.0:
            rates = [self.imu.rate_x]  # a unit with memory: its own
        return bool(min(rates) - room <= rate_of(values[-PACKET_BYTES:]) <= max(rates) + room)


def rate_of(values: Any, at: int = 0) -> float:
    """The rate about x in the packet from `at` on, rad/s."""
    a, b, c, d = values[at + RATE_X : at + RATE_X + 4]
    return float_of_word(a << 24 | b << 16 | c << 8 | d)


def write_rate(values: Any, at: int, rate_rad_s: float) -> None:
    """Write another rate about x into the packet from `at` on, and the matching sum."""
    word = word_of_float(rate_rad_s)
    high, low = at + PACKET_BYTES - 2, at + PACKET_BYTES - 1
    total = values[high] << 8 | values[low]
    for place, shift in zip(range(at + RATE_X, at + RATE_X + 4), (24, 16, 8, 0), strict=True):
        byte = word >> shift & 255
        total += byte - values[place]
        values[place] = byte
    values[high], values[low] = total >> 8 & 255, total & 255


class SignalInPacket(PacketFault, SignalFault):
    """A signal of harness/faults/signals.py instead of the rate."""

    def begin(self, now_ns: int) -> None:
        super().begin(now_ns)
        self.signal = self.new_signal()
        self.signal.begin(self.imu.rate_x, now_ns)

    def keep_packet(self, values: Any, at: int, time_ns: int) -> bool:
        true = rate_of(values, at)
        write_rate(values, at, self.signal.shown(true, time_ns))
        rate_shown = rate_of(values, at)
        if rate_shown != true:
            self.note(time_ns, rate_shown - true)
        return True


REASONS[IMU, "offset"] = "a constant error of it is the mode gyro_bias"
for each in mode_classes(SignalInPacket, IMU, RATE, without=("offset", "drop_out")):
    mode(each)


@mode
class PacketsMissing(PacketFault):
    """The unit is silent for a while."""

    mode = "drop_out"
    kinds = (IMU,)
    meaning = "sends no packets for a while, at random"
    parameters = lasting("a drop-out", 50.0, 500.0)

    def begin(self, now_ns: int) -> None:
        super().begin(now_ns)
        self.gaps = signals.Random(self.random, **self.values)
        self.gaps.begin(0.0, now_ns)

    def keep_packet(self, values: Any, at: int, time_ns: int) -> bool:
        if not self.gaps.on(time_ns):
            return True
        self.note(time_ns, rate_of(values, at))
        return False


@mode
class GyroBias(PacketFault):
    """The gyros have another constant error."""

    mode = "gyro_bias"
    kinds = (IMU,)
    needs = "a gyro"
    meaning = "has a constant error of its gyros on top of the usual one"
    parameters = (Parameter("rate", "rad/s", RATE.typical, -RATE.limit, RATE.limit, "added to the rates", RATE.source),)

    def begin(self, now_ns: int) -> None:
        super().begin(now_ns)
        self.usual = self.imu.bias_rad_s
        self.imu.bias_rad_s = self.usual + self.values["rate"]

    def keep_packet(self, values: Any, at: int, time_ns: int) -> bool:
        if not math.isclose(self.imu.bias_rad_s, self.usual):
            self.note(time_ns, self.imu.bias_rad_s - self.usual)
        return True

    def finish(self, now_ns: int) -> None:
        super().finish(now_ns)
        self.imu.bias_rad_s = self.usual
