"""Every mode at every kind of sensor, on the plant alone: it differs at its place and nowhere else, and ends.

The plant moves on its own here, whatever its sensors show. So a run with a fault can be held against one without, byte
for byte: before, at other places than the fault's, and after its end.
"""

import functools
import math
import struct

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.ranger.faults import places
from ranger_sim.ranger.faults.catalogue import CATALOGUE
from tests.harness.faults.bench import PlantBench

START, END, LAST = 80, 160, 260  # steps: 20, 40 and 65 ms
# With the defaults some would not differ in these 20 ms: limits that this motion does not leave.
SHORT = {"length_ms": 5.0, "pause_ms": 5.0}
PARAMETERS = {
    "saturation": {"low": 0.0, "high": 0.0},
    "spike": SHORT,
    "drop_out": SHORT,
    "contact_chatter": SHORT,
    "bit_flips": {"share": 0.5},
    "lost_edges": {"share": 1.0},
    "scale": {"factor": 2.0},
}
CATALOGUE.load()
SENSORS = (
    places.EDGES, places.WORD, places.MOTOR_CURRENT, places.BATTERY_CURRENT, places.BATTERY_VOLTAGE, places.FOOT,
    places.STEERING_ANGLE, places.SUPPLY_CURRENT, places.SUPPLY_VOLTAGE, places.IMU,
)  # fmt: skip
HERE = [place for place in CATALOGUE.places.values() if place.kind in SENSORS]


@functools.cache
def golden():
    """What leaves for the boards in each step without a fault."""
    bench = PlantBench()
    bench.step(LAST)
    return bench.seen


def differing(bench):
    """{place: steps in which it showed something else than without a fault}."""
    steps = {}
    for step, (with_fault, without) in enumerate(zip(bench.seen, golden(), strict=True)):
        for name, seen in with_fault.items():
            if seen != without[name]:
                steps.setdefault(name, []).append(step)
    return steps


@pytest.mark.parametrize(
    ("place", "mode"), [(place.name, mode) for place in HERE for mode in CATALOGUE.modes_of(place)], ids=str
)
def test_it_differs_at_its_place_from_its_start_to_its_end_and_nowhere_else(place, mode):
    bench = PlantBench()
    fault = bench.inject(place, mode, "20 ms", "40 ms", **PARAMETERS.get(mode, {}))
    bench.step(LAST)
    assert fault.activated_ns == START * 250_000
    assert fault.ended_ns == END * 250_000
    assert fault.acted
    assert fault.unit
    steps = differing(bench)
    assert set(steps) == {place}
    assert min(steps[place]) >= START
    # a packet goes out half a millisecond after its sample, and its first byte takes 22 us
    under_way_ns = 530_000 if place == "UI.imu" else 0
    assert START * 250_000 <= fault.acted_ns <= (min(steps[place]) + 1) * 250_000 + under_way_ns
    # after its end at most the way back: edges 10 us apart, a level that is set right, what had been under way
    assert END * 250_000 < fault.cleared_ns <= (END + 20) * 250_000
    assert max(steps[place]) < fault.cleared_ns // 250_000
    assert fault.largest_difference != 0
    assert bench.loop.watchers == []


def test_every_kind_of_sensor_takes_every_mode_or_says_what_is_missing():
    asked = (
        "stuck", "offset", "drift", "scale", "noise", "spike", "drop_out", "delay", "quantisation", "saturation",
        "swapped_sign", "lost_edges", "contact_bounce", "bit_flips", "gyro_bias", "contact_chatter", "contact_stuck",
    )  # fmt: skip
    for place in HERE:
        for mode in asked:
            taken = mode in CATALOGUE.modes_of(place)
            assert taken != bool(CATALOGUE.refusal(place, mode)), (place.name, mode)


@pytest.mark.parametrize("place", [place.name for place in HERE if place.kind == places.WORD])
@pytest.mark.parametrize("offset", [100.0, -100.0, 4096.0])
def test_an_offset_of_a_word_is_its_number_of_counts_in_the_joints_sense(place, offset):
    bench = PlantBench()
    fault = bench.inject(place, "offset", "20 ms", "40 ms", offset=offset)
    bench.step(LAST)
    way = -1 if place.startswith("MCFO") else 1  # its encoder is mounted the other way (robot.md N4.7)
    for step in range(START, END):
        assert bench.seen[step][place] == (golden()[step][place] + way * offset) % 8192
    assert fault.acted_ns == START * 250_000  # the word that stands from the start on is another one already
    assert abs(fault.largest_difference) == abs(offset)


@pytest.mark.parametrize("bit", [0, 12])
def test_a_bit_that_flips_is_that_bit(bit):
    bench = PlantBench()
    bench.inject("MCH.absolute_encoder", "bit_flips", "20 ms", "40 ms", share=1.0, bit=bit)
    bench.step(LAST)
    for step in range(START, END):
        assert bench.seen[step]["MCH.absolute_encoder"] ^ golden()[step]["MCH.absolute_encoder"] == 1 << bit


def test_bits_flip_as_often_as_their_share_says_one_at_a_time_and_all_of_them():
    bench = PlantBench()
    fault = bench.inject("MCH.absolute_encoder", "bit_flips", "20 ms", "65 ms", share=0.5)
    bench.step(LAST)
    flipped = [bench.seen[n]["MCH.absolute_encoder"] ^ golden()[n]["MCH.absolute_encoder"] for n in range(START, LAST)]
    assert {bits.bit_count() for bits in flipped} == {0, 1}
    assert fault.acted_count == pytest.approx(90, abs=27)  # of 180: four deviations
    assert len({bits for bits in flipped if bits}) == 13


def test_a_word_that_drops_out_reads_as_its_line_hangs():
    for word in (0, 8191):
        bench = PlantBench()
        bench.inject("MCH.absolute_encoder", "drop_out", "20 ms", "40 ms", word=word, length_ms=100.0)
        bench.step(LAST)
        assert {bench.seen[step]["MCH.absolute_encoder"] for step in range(START, END)} == {word}


@pytest.mark.parametrize(
    ("place", "per_unit"),
    [
        # V per A or V: the constants with which boards turn counts back (robot.md N5), and 2.5 V / 8192 a count
        ("MCH.motor_current", -2.5 / 8192 / 2 / 0.00154),
        ("MCFO.motor_current", 2.5 / 8192 / 2 / 0.00152),
        ("MCH.battery_current", 2.5 / 8192 / 2 / 0.000506),
        ("MCSI.battery_current", 2.5 / 8192 / 20 / 0.0000505),
        ("MCH.battery_voltage", 3.3 / 1024 / 0.0323),
        ("MCFI.left_foot", 1.0),
        ("CSR.supply_voltage", 3.3 / 1024 / 0.03046),
    ],
)
@pytest.mark.parametrize("offset", [0.4, -0.4])
def test_an_offset_of_a_voltage_is_so_much_of_what_its_sensor_measures(place, per_unit, offset):
    bench = PlantBench()
    fault = bench.inject(place, "offset", "20 ms", "40 ms", offset=offset)
    bench.step(LAST)
    for step in range(START, END):
        for shown, true in zip(bench.seen[step][place], golden()[step][place], strict=True):
            assert shown - true == pytest.approx(offset * per_unit, rel=1e-9, abs=1e-12)
    assert fault.largest_difference == pytest.approx(offset)


def test_a_voltage_has_no_jump_within_a_fault_and_one_at_each_of_its_ends():
    bench = PlantBench()
    bench.inject("MCH.motor_current", "noise", "20 ms", "40 ms", deviation=2.0)
    bench.step(LAST)
    for step in range(1, LAST):
        before, now = bench.seen[step - 1]["MCH.motor_current"][1], bench.seen[step]["MCH.motor_current"][0]
        assert (before == now) == (step not in (START, END))


def test_two_faults_one_after_the_other_leave_the_second_alone():
    bench = PlantBench()
    first = bench.inject("MCH.motor_current", "offset", "20 ms", "25 ms")
    second = bench.inject("MCH.motor_current", "stuck", "30 ms", "40 ms", level=1.0)
    bench.step(LAST)
    assert first.cleared_ns == 25_250_000
    assert second.cleared_ns == 40_250_000
    assert all(bench.seen[step]["MCH.motor_current"] == golden()[step]["MCH.motor_current"] for step in range(101, 120))


def rates(seen, first, last):
    """Rates about x in the packets of these steps, with their sums held against their bytes."""
    line = [byte for step in range(first, last) for _, byte in seen[step]["UI.imu"]]
    found = []
    while len(line) >= 31:
        packet, line = line[:31], line[31:]
        assert packet[0] == 0xC2
        assert sum(packet[:29]) & 0xFFFF == packet[29] << 8 | packet[30]
        found.append(struct.unpack(">f", bytes(packet[13:17]))[0])
    return found


@pytest.mark.parametrize(("mode", "name"), [("gyro_bias", "rate"), ("drift", "rate"), ("spike", "height")])
@pytest.mark.parametrize("size", [0.5, -0.5])
def test_values_of_the_inertial_unit_are_off_by_the_fault_and_its_sums_fit(mode, name, size):
    bench = PlantBench()
    more = {"length_ms": 100.0} if mode == "spike" else {}
    fault = bench.inject("UI.imu", mode, "20 ms", "40 ms", **{name: size}, **more)
    bench.step(LAST)
    differences = [a - b for a, b in zip(rates(bench.seen, START, END), rates(golden(), START, END), strict=True)]
    assert len(differences) == 20  # one packet per ms
    if mode == "drift":
        assert differences[-1] == pytest.approx(0.02 * size, abs=0.001 * abs(size))
    else:
        # the numbers in a packet are singles
        assert all(difference == pytest.approx(size, abs=1e-6) for difference in differences)
    assert fault.acted_count == 20 - (mode == "drift" and differences[0] == 0.0)
    assert fault.largest_difference == pytest.approx(differences[-1], abs=1e-6)


def test_an_inertial_unit_that_drops_out_sends_nothing():
    bench = PlantBench()
    fault = bench.inject("UI.imu", "drop_out", "20 ms", "40 ms", length_ms=100.0)
    bench.step(LAST)
    assert all(bench.seen[step]["UI.imu"] == [] for step in range(START, END))
    assert fault.acted_count == 20


def test_a_stuck_contact_reads_as_swing_or_stance():
    for closed, counts in ((0.0, 700), (1.0, 7000)):
        bench = PlantBench()
        bench.inject("MCFO.left_foot", "contact_stuck", "20 ms", "40 ms", closed=closed)
        bench.step(LAST)
        volts = {value for step in range(START, END) for value in bench.seen[step]["MCFO.left_foot"]}
        assert all(value == pytest.approx(counts * 2.5 / 8192) for value in volts)


@pytest.mark.parametrize(
    ("place", "mode", "parameters", "words"),
    [
        ("MCH.joint_encoder", "offset", {"offset": 20_001}, "offset is 20001, allowed are -20000 to 20000 edges"),
        ("MCH.joint_encoder", "offset", {"offset": -20_001}, "allowed are -20000 to 20000 edges"),
        ("MCH.joint_encoder", "lost_edges", {"share": 1.1}, "share is 1.1, allowed are 0 to 1"),
        ("MCH.absolute_encoder", "bit_flips", {"bit": 13}, "allowed are -1 to 12"),
        ("UI.imu", "gyro_bias", {"rate": math.nan}, "rate is nan"),
        ("MCH.motor_current", "lost_edges", {}, "cannot act there; it needs edges on a wire, this is the current"),
        ("MCFO.left_foot", "swapped_sign", {}, "needs a signal on two wires"),
        ("UI.imu", "offset", {}, "a constant error of it is the mode gyro_bias"),
        ("MCH.absolute_encoder", "bit_flips", {"bit": 3.5}, "bit is 3.5, a whole number is expected"),
        ("MCH.joint_encoder", "stuck", {"channel": "0.5"}, "channel is '0.5', a whole number is expected"),
        ("MCSI.motor_current", "saturation", {}, "holds its motor to 0.3 A, so its currents never leave -1 to 1 A"),
        ("MCSI.battery_current", "saturation", {}, "holds its motor to 0.3 A, so its currents never leave -0.3 to 0.3"),
    ],
)
def test_what_is_out_of_its_limits_or_cannot_act_is_refused(place, mode, parameters, words):
    with pytest.raises(UserError) as refused:
        PlantBench().inject(place, mode, **parameters)
    assert words in str(refused.value)


@pytest.mark.parametrize("limits", [{"low": -0.29}, {"high": 0.29}])
def test_limits_that_the_steerings_current_can_come_to_are_taken_on_either_side(limits):
    PlantBench().inject("MCSI.motor_current", "saturation", **limits)


def test_a_fault_that_has_not_begun_changes_nothing():
    bench = PlantBench()
    fault = bench.inject("MCH.joint_encoder", "stuck", "1 h")
    bench.step(LAST)
    assert bench.seen == golden()
    assert not fault.acted
    assert fault.activated_ns == -1
