"""Faults of the inertial unit: another rate in its packets, with the right sum, or no packets.

Values are those that the unit tells, about its axis x: backwards positive, in rad/s (robot.md C1.1).
"""

import math
from typing import Any

from ranger_sim.foundation.numbers import float_of_word, word_of_float
from ranger_sim.harness.faults import signals
from ranger_sim.harness.faults.catalogue import mode
from ranger_sim.harness.faults.fault import Parameter
from ranger_sim.harness.faults.places import IMU
from ranger_sim.harness.faults.sensor import PlaceFault, Quantity, SignalFault, lasting, mode_classes
from ranger_sim.plant.imu import PACKET_BYTES, SET_MODE

ACKNOWLEDGEMENT_BYTES = 8
RATE_X = 13  # place of the rate about x in a packet
SUM = PACKET_BYTES - 2

RATE = Quantity(
    unit="rad/s",
    typical=0.2,
    limit=5.2,
    clip_low=-0.5,
    clip_high=0.5,
    open_value=0.0,
    source="chosen by us: a fifth of the legs' mean rate; the unit ends at 300 degrees a second (its data sheet)",
)


class PacketFault(PlaceFault):
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
        if line.count == 0:
            return
        times = [int(time_ns) for time_ns in line.times[: line.count]]
        values = [int(value) for value in line.values[: line.count]]
        line.clear()
        at = 0
        while at < len(values):
            size = ACKNOWLEDGEMENT_BYTES if values[at] == SET_MODE else PACKET_BYTES
            packet = values[at : at + size]
            if size == PACKET_BYTES:
                packet = self.packet_instead(packet, times[at])
            for time_ns, value in zip(times[at : at + len(packet)], packet, strict=True):
                line.push(time_ns, value)
            at += size

    def packet_instead(self, packet: list[int], time_ns: int) -> list[int]:
        """What is sent in place of a packet whose first byte ends at `time_ns`."""
        return packet

    def is_clear(self, start_ns: int, end_ns: int) -> bool:
        """A packet tells the rate that the legs have, but for bias and noise. Six deviations: one in 5e8 is farther."""
        values = [int(value) for value in self.imu.bytes.values[: self.imu.bytes.count]]
        before, self.lean_rate = self.lean_rate, self.robot.plant.body.outer.rate
        if len(values) < PACKET_BYTES or values[-PACKET_BYTES] != self.imu.mode:
            return False
        rates = [self.imu.bias_rad_s - self.imu.rate_scale * rate for rate in (before, self.lean_rate)]
        room = 6.0 * self.imu.noise_rad_s + 1e-6
        if self.imu.lag_s > 0.0 or self.imu.filter_samples > 1 or self.imu.cross_x_from_z != 0.0:
            rates = [self.imu.rate_x]  # of a unit that remembers, its own
        return bool(min(rates) - room <= rate_of(values[-PACKET_BYTES:]) <= max(rates) + room)


def rate_of(packet: list[int]) -> float:
    """The rate about x that a packet tells, rad/s."""
    return float_of_word(int.from_bytes(bytes(packet[RATE_X : RATE_X + 4]), "big"))


def with_rate(packet: list[int], rate_rad_s: float) -> list[int]:
    """The packet with another rate about x, and the sum that fits."""
    told = packet[:RATE_X] + list(word_of_float(rate_rad_s).to_bytes(4, "big")) + packet[RATE_X + 4 :]
    return told[:SUM] + list((sum(told[:SUM]) & 0xFFFF).to_bytes(2, "big"))


class SignalInPacket(PacketFault, SignalFault):
    """A signal of harness/faults/signals.py in the place of the rate."""

    def begin(self, now_ns: int) -> None:
        super().begin(now_ns)
        self.signal = self.new_signal()
        self.signal.begin(self.imu.rate_x, now_ns)

    def packet_instead(self, packet: list[int], time_ns: int) -> list[int]:
        true = rate_of(packet)
        told = with_rate(packet, self.signal.shown(true, time_ns))
        if told == packet:
            return packet
        self.note(time_ns, rate_of(told) - true)
        return told


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

    def packet_instead(self, packet: list[int], time_ns: int) -> list[int]:
        if not self.gaps.on(time_ns):
            return packet
        self.note(time_ns, rate_of(packet))
        return []


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

    def packet_instead(self, packet: list[int], time_ns: int) -> list[int]:
        if not math.isclose(self.imu.bias_rad_s, self.usual):
            self.note(time_ns, self.imu.bias_rad_s - self.usual)
        return packet

    def finish(self, now_ns: int) -> None:
        super().finish(now_ns)
        self.imu.bias_rad_s = self.usual
