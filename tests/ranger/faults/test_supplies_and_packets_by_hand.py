"""Faults of the battery and of the inertial unit's packets: volts and bytes worked out by hand."""

import struct
from types import SimpleNamespace as Made

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.faults import imu
from ranger_sim.harness.faults.fault import Place
from ranger_sim.harness.faults.sensor import ROWS, Quantity
from ranger_sim.plant.electrics.battery import Battery, BatteryParameters
from ranger_sim.plant.sensors.imu import PACKET_BYTES, SET_MODE
from ranger_sim.ranger.faults import power

S = 1_000_000_000
# 2 cells of 3, 3.5 and 4 V: 6 V empty, 7 V at half, 8 V full; two packs of 1 ohm together 0.5
PARAMETERS = {
    "packs": 2,
    "cells_in_series": 2,
    "pack_resistance_ohm": 1.0,
    "charge": 0.5,
    "cell_volts": (3.0, 3.5, 4.0),
}


def battery(**more):
    return Battery(BatteryParameters(**{**PARAMETERS, **more}))


def fault(kind, of=None, **values):
    made = kind(Place("battery", power.BATTERY, "packs"), None, None, values)
    of = battery() if of is None else of
    made.robot = Made(plant=Made(electrics=Made(battery=of)))
    made.noted = []
    made.note = lambda time_ns, volts: made.noted.append((time_ns, pytest.approx(volts)))
    made.connect()
    return made, of


@pytest.mark.parametrize(
    ("charge", "volts"), [(-0.5, 6.0), (0.0, 6.0), (0.25, 6.5), (0.5, 7.0), (0.75, 7.5), (1.0, 8.0), (1.5, 8.0)]
)
def test_the_voltage_without_load_lies_straight_between_the_points_of_the_curve(charge, volts):
    assert power._open_circuit_V(battery(), charge) == pytest.approx(volts)


def test_a_battery_that_sags_has_more_resistance_and_less_voltage_until_the_end():
    made, packs = fault(power.Sag, ohm=0.25, drop=1.5)
    made.begin(0)
    assert packs.resistance_ohm == 0.75 and packs.open_voltage_V == pytest.approx(5.5)
    assert [packs.open_circuit_V(each) for each in (0.0, 1.0)] == pytest.approx([4.5, 6.5])
    packs.voltage_V, packs.current_A = 4.0, 2.0
    assert made.healthy_V() == pytest.approx(4.0 + 0.5 + 1.5)
    made.after(0, 9)
    assert made.noted == [(9, 2.0)]
    made.finish(0)
    assert packs.resistance_ohm == 0.5 and packs.open_voltage_V == pytest.approx(7.0)
    assert [packs.open_circuit_V(each) for each in (0.0, 1.0)] == pytest.approx([6.0, 8.0])


def test_what_takes_no_voltage_is_not_noted():
    made, packs = fault(power.Sag, ohm=0.0, drop=0.0)
    made.begin(0)
    packs.voltage_V, packs.current_A = 4.0, 2.0
    made.after(0, 9)
    assert made.noted == []


def test_packs_that_are_lost_leave_their_current_to_the_others_and_share_their_charge_when_they_are_back():
    made, packs = fault(power.PackLost, battery(packs=4), packs=1)
    before = packs.per_As
    made.begin(0)
    assert packs.resistance_ohm == pytest.approx(0.25 / 0.75) and packs.per_As == pytest.approx(before / 0.75)
    packs.voltage_V, packs.current_A = 4.0, 3.0
    assert made.healthy_V() == pytest.approx(4.0 + (0.25 / 0.75 - 0.25) * 3.0)
    packs.charge = 0.3
    made.finish(0)
    assert (packs.resistance_ohm, packs.per_As) == (0.25, before)
    assert packs.charge == pytest.approx(0.75 * 0.3 + 0.25 * 0.5)
    assert packs.open_voltage_V == pytest.approx(6.0 + 2.0 * packs.charge)
    for packs_lost, refused in ((3, False), (4, True)):
        if refused:
            with pytest.raises(UserError, match="there are 4 packs"):
                fault(power.PackLost, battery(packs=4), packs=packs_lost)
        else:
            fault(power.PackLost, battery(packs=4), packs=packs_lost)


@pytest.mark.parametrize(("off_V", "clear"), [(0.0, True), (1e-6, False), (-1e-6, False)])
def test_a_battery_is_clear_when_its_voltage_is_that_of_the_charge_before_the_step(off_V, clear):
    made, packs = fault(power.Sag, ohm=0.1, drop=0.0)
    packs.per_As, packs.current_A = 0.125, 2.0  # an eighth of a second takes a 32nd of the charge
    packs.charge = 0.75 - 0.03125
    packs.voltage_V = 7.5 - 0.5 * 2.0 + off_V
    assert made.is_clear(S, S + S // 8) is clear


# ---- packets


def packet(rate, mode=1):
    """31 bytes: the rate about x at 13, big-endian, and the sum of all bytes but the first in the last two."""
    body = bytearray(range(100, 100 + PACKET_BYTES))
    body[0] = mode
    body[13:17] = struct.pack(">f", rate)
    body[-2:] = (sum(body[1:-2]) & 0xFFFF).to_bytes(2, "big")
    return list(body)


class Unit:
    """What the unit sends in a step, byte by byte."""

    def __init__(self, kind, sent, outer_rate=0.0, **values):
        self.imu = Made(bias_rad_s=0.25, rate_scale=1.0, noise_rad_s=0.0, lag_s=0.0, filter_samples=1, mode=1)
        self.imu.cross_x_from_z, self.imu.rate_x = 0.0, 0.5
        self.send(sent)
        self.fault = kind(Place("UI.imu", "imu", "packets"), None, None, values)
        self.body = Made(outer=Made(rate=outer_rate))
        self.fault.robot = Made(plant=Made(imu=self.imu, body=self.body))
        self.fault.random = Made(uniform=lambda: 0.5)
        self.noted = []
        self.fault.note = lambda time_ns, value: self.noted.append((time_ns, value))
        self.fault.connect()
        self.fault.begin(0)

    def send(self, sent):
        spare = [77] * 3
        self.imu.bytes = Made(
            values=[*sent, *spare], times=[10 * each for each in range(len(sent) + 3)], count=len(sent)
        )

    @property
    def shown(self):
        line = self.imu.bytes
        return line.values[: line.count], line.times[: line.count]


SCALE = next(each for each in imu.mode_classes(imu.SignalInPacket, "imu", imu.RATE) if each.mode == "scale")
ACKNOWLEDGED = [SET_MODE, *range(1, 8)]


def test_the_rate_is_in_four_bytes_and_the_sum_follows_it():
    values = [5, 6, *packet(0.25)]
    assert imu.rate_of(values, 2) == 0.25 and imu.rate_of(packet(-1.5)) == -1.5
    for rate in (-1.5, 3.0e-5, 0.0):
        imu.write_rate(values, 2, rate)
        assert values == [5, 6, *packet(rate)]


def test_every_packet_of_a_step_shows_the_signal_and_acknowledgements_stay():
    unit = Unit(SCALE, [*packet(0.25), *ACKNOWLEDGED, *packet(-0.5), *packet(0.0)], factor=2.0)
    unit.fault.after(0, 1)
    values, times = unit.shown
    assert values == [*packet(0.5), *ACKNOWLEDGED, *packet(-1.0), *packet(0.0)] and times == list(range(0, 1010, 10))
    assert unit.noted == [(0, 0.25), (390, -0.5)]


def test_packets_that_are_not_sent_let_the_rest_move_up():
    unit = Unit(
        imu.PacketsMissing, [*packet(0.25), *ACKNOWLEDGED, *packet(-0.5), *packet(0.75)], length_ms=1.0, pause_ms=1.0
    )
    unit.fault.gaps = Made(on=lambda now_ns: now_ns != 390)
    unit.fault.after(0, 1)
    values, times = unit.shown
    assert values == [*ACKNOWLEDGED, *packet(-0.5)] and times == list(range(310, 700, 10))
    assert unit.noted == [(0, 0.25), (700, 0.75)]


def test_a_silent_unit_is_silent_at_once():
    unit = Unit(imu.PacketsMissing, packet(0.25), length_ms=1.0, pause_ms=1.0)
    unit.fault.after(0, 1)
    assert unit.shown == ([], []) and unit.noted == [(0, 0.25)]


def test_a_bias_is_added_to_the_usual_one_and_taken_away_again():
    unit = Unit(imu.GyroBias, packet(0.25), rate=-0.5)
    assert unit.imu.bias_rad_s == -0.25
    unit.fault.after(0, 1)
    assert unit.shown[0] == packet(0.25) and unit.noted == [(0, -0.5)]
    unit.fault.finish(0)
    assert unit.imu.bias_rad_s == 0.25
    none = Unit(imu.GyroBias, packet(0.25), rate=0.0)
    none.fault.after(0, 1)
    assert none.noted == []


@pytest.mark.parametrize(
    ("reported", "clear"), [(-0.76, False), (-0.7499, True), (-0.25, True), (0.2499, True), (0.26, False)]
)
def test_a_unit_is_clear_when_its_last_packet_has_a_rate_that_the_legs_had_in_the_step(reported, clear):
    unit = Unit(imu.GyroBias, packet(9.0), outer_rate=0.5, rate=0.0)
    unit.imu.bias_rad_s, unit.imu.rate_scale = 0.25, 2.0
    unit.body.outer.rate = 0.0  # 0.25 - 2 x 0.5 at the begin, 0.25 at the end
    unit.send([*packet(9.0), *packet(reported)])
    assert unit.fault.is_clear(0, 1) is clear
    assert unit.fault.lean_rate == 0.0


def test_a_unit_is_clear_within_six_deviations_of_its_noise_and_by_its_own_rate_where_it_remembers():
    for reported, clear in ((0.84, True), (0.86, False), (-0.34, True), (-0.36, False)):
        unit = Unit(imu.GyroBias, packet(reported), rate=0.0)
        unit.imu.noise_rad_s = 0.1
        assert unit.fault.is_clear(0, 1) is clear
    for memory in ({"lag_s": 0.1}, {"filter_samples": 2}, {"cross_x_from_z": 0.1}):
        unit = Unit(imu.GyroBias, packet(0.5), rate=0.0)
        assert not unit.fault.is_clear(0, 1)
        vars(unit.imu).update(memory)
        assert unit.fault.is_clear(0, 1)


def test_a_unit_without_a_whole_packet_of_its_mode_at_the_end_is_not_clear():
    unit = Unit(imu.GyroBias, packet(0.25)[1:], rate=0.0)
    assert not unit.fault.is_clear(0, 1)
    unit.send(packet(0.25, mode=2))
    assert not unit.fault.is_clear(0, 1)
    unit.send([*packet(0.25), 1])
    assert not unit.fault.is_clear(0, 1)
    unit.send(packet(0.25))
    assert unit.fault.is_clear(0, 1)


def test_what_a_signal_of_a_quantity_takes_follows_from_its_row():
    q = Quantity("V", 2.0, 50.0, -3.0, 4.0, 0.5, "s")
    found = {row.mode: [(p.name, p.unit, p.default, p.low, p.high) for p in row.parameters(q)] for row in ROWS}
    assert found["offset"] == [("offset", "V", 2.0, -50.0, 50.0)]
    assert found["drift"] == [("rate", "V/s", 2.0, -5000.0, 5000.0)]
    assert found["noise"] == [("deviation", "V", 0.4, 0.0, 50.0)]
    assert found["spike"][0] == ("height", "V", 6.0, -50.0, 50.0)
    assert [each[2] for each in found["spike"][1:]] == [0.5, 50.0]
    assert found["drop_out"][0] == ("level", "V", 0.5, -50.0, 50.0)
    assert [each[2] for each in found["drop_out"][1:]] == [10.0, 100.0]
    assert found["quantisation"] == [("step", "V", 1.0, 0.002, 50.0)]
    assert found["saturation"] == [("low", "V", -3.0, -50.0, 50.0), ("high", "V", 4.0, -50.0, 50.0)]
    assert found["scale"] == [("factor", "1", 1.1, -10.0, 10.0)]
    assert found["delay"] == [("delay_ms", "ms", 5.0, 0.25, 1e4)] and found["swapped_sign"] == []
    assert found["stuck"][0][3:] == (-50.0, 50.0) and found["stuck"][0][2] != found["stuck"][0][2]
