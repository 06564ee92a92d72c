"""Every figure of a proof on both sides of what decides it, worked out by hand on records made by hand."""

import dataclasses
import itertools
import math

import numpy as np
import pytest

from ranger_sim.datatable.generated import errors as error_table
from ranger_sim.harness.faults import proof
from ranger_sim.harness.faults.proof import Detection, Difference, Gait, Healthy, Proof, Reaction
from tests.harness.faults.records import COLUMN, MS, errors, frames, record, word

SPIKE, LIMIT, STRETCH = error_table.AE_SPIKE, error_table.MC_PWM_LIMIT, error_table.MCFO_CBL_STRCH
BEGAN = 1000 * MS


def proven(faulty, golden=None, **more):
    return proof.prove(golden if golden is not None else record(), faulty, BEGAN, True, **more)


def firmware_difference(golden, faulty):
    return proven(faulty, golden).first_firmware


# ---- what a proof tells


WHOLE = Proof(
    acted=True,
    activated_ns=BEGAN,
    first=Difference("body", "hip_rad", BEGAN + MS, 0.0, 1.0),
    first_firmware=Difference("can1", "MCH_ANGLE", BEGAN + 2 * MS, 0.0, 1.0),
    detections=(Detection("MCH", "AE_SPIKE", BEGAN + 3 * MS, True), Detection("MB", "X", BEGAN + 9 * MS, False)),
    reaction=Reaction("hip", "hold", "wait", BEGAN + 4 * MS),
    unusual=None,
    fell_ns=BEGAN + 5_500_000,
    fall_cause="fell forward",
)


def test_a_summary_counts_milliseconds_from_the_activation():
    assert WHOLE.summary() == {
        "first_difference": {"where": "can1", "name": "MCH_ANGLE", "after_ms": 2.0},
        "detected": {"code": "AE_SPIKE", "board": "MCH", "rate": True},
        "detection_ms": 3.0,
        "reaction": {"machine": "hip", "state": "hold", "instead_of": "wait"},
        "reaction_ms": 4.0,
        "fall_ms": 5.5,
    }
    nothing = dataclasses.replace(WHOLE, first_firmware=None, detections=(), reaction=None, fell_ns=None)
    assert set(nothing.summary().values()) == {None}


def test_a_robot_that_fell_at_the_very_beginning_fell():
    assert proven(dataclasses.replace(record(), fell_ns=0, fall_cause="x")).fell_ns == 0
    assert proven(record()).fell_ns is None


# ---- what differs


def test_a_frame_at_the_very_end_counts():
    golden, faulty = record(until_ms=1500), record(until_ms=1500)
    golden.frames["can1"] = frames([*range(5, 1495, 10), 1500])
    faulty.frames["can1"] = frames(range(5, 1495, 10))
    found = firmware_difference(golden, faulty)
    assert found == Difference("can1", "MCH_ANGLE", 1500 * MS, None, None)
    assert firmware_difference(faulty, golden) == found


def test_of_two_frames_in_one_place_the_earlier_gives_the_time_whatever_is_in_it():
    golden, faulty = record(until_ms=1500), record(until_ms=1500)
    for runs in ((golden, faulty), (faulty, golden)):
        runs[0].frames["can1"] = np.concatenate([frames(range(5, 1300, 10)), frames([1402], value=9)])
        runs[1].frames["can1"] = np.concatenate([frames(range(5, 1300, 10)), frames([1403], value=1)])
        assert firmware_difference(*runs).time_ns == 1402 * MS


def test_a_frame_that_is_not_a_variable_has_its_identifier_and_no_values():
    golden, faulty = record(), record()
    golden.frames["can1"] = frames([100], identifier=0x7A0)
    faulty.frames["can1"] = frames([100], identifier=0x7A0, value=3)
    assert firmware_difference(golden, faulty) == Difference("can1", "frame 7A0", 100 * MS, None, None)


def test_an_error_at_the_very_end_belongs_to_what_comes_after():
    golden, faulty = record(until_ms=1500), record(until_ms=1500)
    faulty.errors = errors((1500, "MCH", SPIKE, 1))
    assert firmware_difference(golden, faulty) is None and firmware_difference(faulty, golden) is None
    faulty.errors = errors((1499, "MCH", SPIKE, 1))
    found = Difference("errors", "MCH AE_SPIKE", 1499 * MS, None, None)
    assert firmware_difference(golden, faulty) == found and firmware_difference(faulty, golden) == found


def test_a_memory_and_a_body_that_differ_are_reported_with_both_values():
    golden, faulty = record(), record()
    faulty.words[700:, word("hip")] = 5
    golden.samples[650, COLUMN["hip_rad"]], faulty.samples[650, COLUMN["hip_rad"]] = 0.25, -0.5
    found = proven(faulty, golden)
    assert (found.first_firmware.time_ns, found.first_firmware.golden, found.first_firmware.faulty) == (1400 * MS, 0, 5)
    assert found.first == Difference("body", "hip_rad", 1300 * MS, 0.25, -0.5)


def test_the_reaction_is_of_the_machine_that_differs_first_and_of_two_at_once_of_the_first_in_the_list():
    golden = record()
    machines = list(golden.machines)
    faulty = record()
    faulty.words[700:702, word(machines[0])] = (2, 0)
    faulty.words[600:602, word(machines[1])] = (1, 2)
    assert proven(faulty, golden).reaction == Reaction(machines[1], "swing", "wait", 1200 * MS)
    faulty.words[600:602, word(machines[0])] = (2, 1)
    assert proven(faulty, golden).reaction == Reaction(machines[0], "hold", "wait", 1200 * MS)
    golden.words[600:602, word(machines[0])] = (1, 0)
    assert proven(faulty, golden).reaction == Reaction(machines[0], "hold", "swing", 1200 * MS)
    faulty.words[600, word(machines[0])] = 77
    assert proven(faulty, golden).reaction.state == "77"


# ---- what is normal


def test_rates_are_compared_at_each_of_32_counts_and_then_a_tenth_further_each_time():
    further = [35, 38, 41, 45, 49, 53, 58, 63, 69, 75, 82, 90, 99, 108]
    counts = [*range(1, 33), *further]
    assert [proof.looked_at(places) for places in range(len(counts) + 1)] == [
        counts[:places] for places in range(len(counts) + 1)
    ]
    for total in (0, 1, 31, 32, 33, 34, 35, 37, 38, 107, 108, 110):
        assert list(proof.looked_at_below(total)) == [each for each in counts if each <= total]


def test_what_is_known_to_be_normal_grows_with_the_time():
    key = ("MCH", LIMIT)
    healthy = Healthy({}, {}, {key: 100.0})
    assert [healthy.most(key, ms * MS) for ms in (0, 9, 11, 255, 2005)] == [0, 0, 1, 25, 200]
    assert healthy.most(("MB", LIMIT), 5000 * MS) == 0
    assert healthy.knows(key) and not healthy.knows(("MB", LIMIT)) and Healthy({key: [0]}, {}).knows(key)
    both = Healthy({key: [0, 5 * MS]}, {}, {key: 100.0})
    assert [both.most(key, ms * MS) for ms in (0, 4, 5, 25, 45)] == [1, 1, 2, 2, 4]


def detected(healthy, *rows):
    faulty = record()
    faulty.errors = errors(*rows)
    return healthy.detections(faulty, BEGAN)


def test_an_error_counts_from_behind_the_activation_and_once_for_each_board_and_code():
    nothing = Healthy({}, {})
    assert detected(nothing, (1000, "MCH", SPIKE, 3)) == []
    rows = [(1200, "MCH", SPIKE, 2), (1100, "MB", LIMIT, 1), (1200, "MB", SPIKE, 1), (1100.5, "MB", LIMIT, 7)]
    assert detected(nothing, *rows) == [
        Detection("MB", "MC_PWM_LIMIT", 1100 * MS, False),
        Detection("MB", "AE_SPIKE", 1200 * MS, False),
        Detection("MCH", "AE_SPIKE", 1200 * MS, False),
    ]


def test_a_rate_is_that_of_the_time_up_to_the_error_that_is_counted():
    healthy = Healthy({}, {}, {("MCH", LIMIT): 1000.0})
    five = [(1000.5, "MCH", LIMIT, 5)]
    assert detected(healthy, *five) == []
    assert detected(healthy, *five, (1009, "MCH", LIMIT, 1)) == []  # nine are normal in 9 ms: above 23 tell
    assert detected(healthy, (1000.5, "MCH", LIMIT, 6)) == [Detection("MCH", "MC_PWM_LIMIT", BEGAN + MS // 2, True)]
    assert detected(healthy, (1001.5, "MCH", LIMIT, 7)) == []  # twice one and five are seven
    assert len(detected(healthy, (1001.5, "MCH", LIMIT, 8))) == 1


def test_the_shortest_time_to_each_count_is_the_shortest_of_all_walks():
    one, two = record(), record()
    one.errors = errors(*((ms, "MCH", LIMIT, 1) for ms in (0, 10, 11, 30)))
    two.errors = errors(*((ms, "MCH", LIMIT, 1) for ms in (5, 12)), (3, "MB", SPIKE, 2))
    spans = {("MCH", LIMIT): [0, MS, 11 * MS, 30 * MS], ("MB", SPIKE): [0, 0]}
    assert Healthy.of([one, two]).spans == Healthy.of([two, one]).spans == spans
    assert Healthy.of([one]).merged(Healthy.of([two])).spans == spans
    assert Healthy.of([two]).merged(Healthy.of([one])).spans == spans


def test_errors_are_distinguished_by_board_and_code():
    run = record()
    run.errors = np.array([[1, 1, 0, 2], [5, 0, 0, 1], [7, 1, 60_000, 1], [9, 1, 0, 1]])
    found = {key: times.tolist() for key, times in proof.event_times(run).items()}
    assert found == {("MCH", 0): [5], ("MCFO", 0): [1, 1, 9], ("MCFO", 60_000): [7]}


def test_changes_of_state_are_pairs_of_neighbours():
    assert proof.changes_of(np.array([0, 1, 1, 2, 0, 0])) == {(0, 1), (1, 2), (2, 0)}
    assert proof.changes_of(np.array([3, 3])) == set()
    one, other = Healthy({}, {"a": {(0, 1)}}), Healthy({}, {"a": {(1, 2)}, "b": {(3, 4)}})
    assert one.merged(other).changes == other.merged(one).changes == {"a": {(0, 1), (1, 2)}, "b": {(3, 4)}}


def test_an_unusual_change_is_from_the_state_just_before_and_from_the_activation_on():
    healthy = Healthy.of([record()])  # the hip's machine alone goes from 0 to 1 and back
    machines = [each for each in record().machines if each != "hip"]
    faulty = record()
    faulty.words[499:, word(machines[0])] = 1
    faulty.words[500:, word(machines[0])] = 2
    assert healthy.unusual_change(faulty, BEGAN) == Reaction(machines[0], "hold", "swing", BEGAN)
    assert healthy.unusual_change(faulty, BEGAN + 1) is None
    faulty.words[700:, word(machines[1])] = 1
    assert healthy.unusual_change(faulty, BEGAN + 1) == Reaction(machines[1], "swing", "wait", 1400 * MS)
    faulty.words[700:, word(machines[0])] = 0
    assert healthy.unusual_change(faulty, BEGAN + 1) == Reaction(machines[0], "wait", "hold", 1400 * MS)
    assert healthy.unusual_change(faulty, BEGAN).time_ns == BEGAN


def test_a_false_alarm_is_one_for_each_start_with_the_first_error():
    runs = [record() for _ in range(3)]
    runs[1].errors = errors((1500, "MCFO", SPIKE, 1), (1600, "MB", SPIKE, 1))
    assert proof.false_alarms(runs, [500 * MS, 1550 * MS, 1700 * MS]) == (
        2,
        9,
        [Detection("MCFO", "AE_SPIKE", 1500 * MS, False), Detection("MB", "AE_SPIKE", 1600 * MS, False)],
    )


# ---- the walk


def samples(seconds, **columns):
    found = np.zeros((len(seconds), 1 + len(COLUMN)))
    found[:, 0] = seconds
    for name, values in columns.items():
        found[:, COLUMN[name]] = values
    return dataclasses.replace(record(until_ms=10), samples=found)


def test_a_gait_is_from_the_first_strike_in_its_window_to_the_last():
    walk = samples(
        [ms * MS * 1e-9 for ms in (0, 100, 300, 600, 1000, 1500, 2100, 2800)],
        steps=[0, 1, 1, 2, 2, 4, 4, 5],
        hip_x_m=[0.0, 0.5, 0.7, 1.1, 1.2, 2.3, 2.4, 3.6],
        hip_W=[0, 0, 8, 0, -8, 0, 0, 0],
        inner_W=[4, 0, 0, 0, 0, 0, 4, 0],
    )

    def figures(since_s, until_s=None):
        found = proof.gait(walk, round(since_s * 1e9), None if until_s is None else round(until_s * 1e9))
        return tuple(each if each is None else round(each, 9) for each in dataclasses.astuple(found))

    # strikes at 0.1, 0.6, 1.5 (two at once) and 2.8 s: four steps and 3.1 m from the first to the last
    assert figures(0.0) == (5, 3.1 / 4, 2.7 / 4, 8 / 8 + 8 / 8)
    assert figures(0.1) == (4, round(2.5 / 3, 9), round(2.2 / 3, 9), round(8 / 7 + 4 / 7, 9))
    assert figures(0.3, 1.5) == (3, 1.2 / 2, 0.9 / 2, 8 / 4)
    assert figures(0.3, 1.4) == (1, None, None, round(8 / 3, 9))
    assert figures(2.8) == (0, None, None, 0.0)
    assert proof.gait(walk, 2_800_000_001) == Gait(0, None, None, 0.0)


PEAKS = {"hip": 5.0, "outer": 8.0, "inner": 8.0, "steering": 0.3}  # robot.md N8.5
SUSTAINED = {"hip": 3.1, "outer": 3.1, "inner": 3.1, "steering": 0.3}


@pytest.mark.parametrize(("motor", "sign"), list(itertools.product(PEAKS, (1.0, -1.0))))
def test_a_motor_is_damaged_by_a_fifth_above_its_peak_for_more_than_ten_milliseconds(motor, sign):
    seconds = np.arange(100) * 0.002

    def reported(factor, count, since_s=0.0):
        current = np.zeros(100)
        current[20 : 20 + count] = sign * factor * PEAKS[motor]
        return proof.damage(samples(seconds, **{f"{motor}_A": current}), round(since_s * 1e9))

    assert reported(1.21, 8) == f"{motor} motor beyond {1.2 * PEAKS[motor]:g} A for 16 ms"
    assert reported(1.19, 8) == reported(1.21, 4) == "" and reported(1.21, 6).endswith("for 12 ms")
    assert reported(1.21, 8, 0.042).endswith("for 14 ms") and reported(1.21, 8, 0.048) == ""


@pytest.mark.parametrize("motor", SUSTAINED)
def test_a_motor_is_damaged_by_a_fifth_more_heat_than_it_sustains(motor):
    seconds = np.arange(0.0, 50.0, 0.01)
    # of a constant current I the state is 10 s I^2 (1 - exp(-5)) after 50 s: 1.2 times that of the limit at 1.099 of it
    held, over = (samples(seconds, **{f"{motor}_A": factor * SUSTAINED[motor]}) for factor in (1.09, 1.11))
    assert proof.damage(held, 0) == ""
    state = 10.0 * (1.11 * SUSTAINED[motor]) ** 2 * (1.0 - math.exp(-5.0))
    assert proof.damage(over, 0) == f"{motor} motor's thermal state at {state:.0f} A2s"


def test_exactly_a_fifth_above_the_peak_is_not_damage():
    current = np.full(100, 6.0)
    assert proof.damage(samples(np.arange(100) * 0.002, hip_A=current), 0) == ""


@pytest.mark.parametrize(
    ("beyond", "times", "longest"),
    [
        ([0, 0, 0], [0, 1, 2], 0.0),
        ([1, 1, 0, 0, 1, 1, 1], [0, 1, 3, 10, 11, 13, 17], 6.0),
        ([1, 1, 0, 1, 0], [0, 1, 30, 31, 32], 30.0),
        ([1, 0, 1, 0, 1, 1, 0], [0, 1, 2, 3, 10, 20, 40], 30.0),
        ([0, 1, 0, 1, 0, 1, 0], [0, 1, 3, 5, 50, 60, 61], 45.0),
        ([0, 0, 1], [0, 5, 9], 0.0),
        ([1, 1, 1], [2, 5, 9], 7.0),
    ],
)
def test_the_longest_time_without_a_break_ends_with_the_sample_after_it(beyond, times, longest):
    assert proof.longest_run(np.array(beyond, dtype=bool), np.array(times, dtype=float)) == longest


def test_the_thermal_state_begins_with_nothing_wherever_time_begins():
    assert proof.thermal_state(np.array([5.0]), np.array([1.0])) == 0.0
    assert proof.thermal_state(np.array([]), np.array([])) == 0.0
    assert proof.thermal_state(np.zeros(3), np.array([0.0, 1.0, 2.0])) == 0.0
    # the rule of the trapeze over one second: half of what came at its begin, decayed, and half of what came at its end
    decay = math.exp(-0.1)
    assert proof.thermal_state(np.array([2.0, 2.0]), np.array([50.0, 51.0])) == pytest.approx(2.0 * decay + 2.0)
    assert proof.thermal_state(np.array([2.0, 0.0, 0.0]), np.array([7.0, 8.0, 9.0])) == pytest.approx(2.0 * decay)
