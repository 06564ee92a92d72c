"""What a fault did, on records made by hand."""

import dataclasses
import json

import numpy as np
import pytest

from ranger_sim.datatable.generated import all_variables
from ranger_sim.datatable.generated import errors as error_table
from ranger_sim.datatable.packing import word_of_value
from ranger_sim.harness.faults import proof
from ranger_sim.harness.faults.proof import Healthy
from tests.harness.faults.records import COLUMN, MS, errors, frames, record, word

SPIKE, LIMIT = error_table.AE_SPIKE, error_table.MC_PWM_LIMIT
BEGAN = 1000 * MS


def proven(faulty, golden=None, acted=True, healthy=None):
    return proof.prove(golden if golden is not None else record(), faulty, BEGAN, acted, healthy)


def test_equal_runs_show_no_difference_at_all():
    found = proven(record())
    assert (found.first, found.first_firmware, found.detected, found.reaction, found.unusual) == (None,) * 5


def test_a_golden_run_that_goes_on_longer_is_not_a_difference():
    found = proven(record(until_ms=1500))
    assert (found.first, found.reaction) == (None, None)


def test_the_first_frame_that_differs_is_named_with_both_values():
    faulty = record()
    row = int(np.flatnonzero(faulty.frames["can1"][:, 0] == 1205 * MS)[0])
    changed = word_of_value(all_variables.TYPES[all_variables.ID_OF["MCH_ANGLE"]], 0.25)
    faulty.frames["can1"][row:, 1] = changed << 12 | 8 << 4
    first = proven(faulty).first_firmware
    assert (first.where, first.name, first.time_ns) == ("can1", "MCH_ANGLE", 1205 * MS)
    assert (first.golden, first.faulty) == (0.0, 0.25)


def test_a_frame_that_does_not_come_is_a_difference_at_its_time():
    faulty = record()
    rows = faulty.frames["can2"]
    faulty.frames["can2"] = rows[rows[:, 0] != 1507 * MS]
    first = proven(faulty).first_firmware
    assert (first.where, first.time_ns, first.golden, first.faulty) == ("can2", 1507 * MS, 0.0, 0.0)


def test_frames_that_end_early_differ_where_the_next_one_is_missing():
    faulty = record()
    faulty.frames["can1"] = frames(range(5, 1400, 10))
    first = proven(faulty).first_firmware
    assert (first.where, first.time_ns, first.golden, first.faulty) == ("can1", 1405 * MS, None, None)


def test_the_earlier_of_frame_and_variable_is_the_first():
    faulty = record()
    number = all_variables.ID_OF["MCH_ANGLE"]
    faulty.words[faulty.words[:, 0] >= 1100 * MS, 1 + number] = 7
    faulty.frames["can1"][faulty.frames["can1"][:, 0] >= 1105 * MS, 1] += 1 << 12
    first = proven(faulty).first_firmware
    assert (first.where, first.name, first.time_ns) == ("MB", "MCH_ANGLE", 1100 * MS)


def test_a_new_error_is_named_and_not_the_usual_one_that_comes_at_the_same_time():
    golden, faulty = record(), record()
    golden.errors = errors((1200, "MB", LIMIT, 1))
    faulty.errors = errors((1200, "MCFO", SPIKE, 1), (1200, "MB", LIMIT, 1))
    for runs in ((faulty, golden), (golden, faulty)):
        first = proven(*runs).first_firmware
        assert (first.where, first.name) == ("errors", "MCFO AE_SPIKE")


def test_a_frame_under_way_at_the_end_is_not_a_difference():
    faulty = record(until_ms=1500)
    faulty.frames["can1"] = frames(range(5, 1510, 10))  # the last one's receivers have it at 1505 ms
    assert proven(faulty).first is None


def test_a_body_that_moves_otherwise_is_not_a_difference_of_the_firmware():
    faulty = record()
    faulty.samples[600:, COLUMN["hip_rad"]] = 0.1
    found = proven(faulty)
    assert found.first_firmware is None
    assert (found.first.where, found.first.name, found.first.time_ns) == ("body", "hip_rad", 1200 * MS)


def test_a_code_that_no_healthy_walk_has_detects_with_its_first_error():
    faulty = record()
    faulty.errors = errors((1012.5, "MCH", SPIKE, 1), (1300, "MCH", LIMIT, 1))
    found = proven(faulty)
    assert (found.detected.board, found.detected.code, found.detected.rate) == ("MCH", "AE_SPIKE", False)
    assert found.detection_ms == 12.5
    assert len(found.detections) == 2


def test_what_the_master_table_calls_normal_needs_no_golden_run_that_shows_it():
    few, many = record(), record()
    few.errors = errors(*((1012 + ms, "MCFO", SPIKE, 1) for ms in range(0, 900, 180)))  # 6 a second are normal
    many.errors = errors(*((1001 + ms, "MCFO", SPIKE, 1) for ms in range(0, 900, 10)))
    assert proven(few).detected is None
    found = proven(many)
    assert (found.detected.code, found.detected.rate) == ("AE_SPIKE", True)
    # error n comes 10 (n - 1) + 1 ms after the start, in which no whole one is normal: the sixth is above 5
    assert found.detection_ms == 51.0


def test_errors_before_the_fault_detect_nothing():
    faulty = record()
    faulty.errors = errors((999, "MCH", SPIKE, 1))
    assert proven(faulty).detected is None


def test_a_fault_that_did_not_act_is_detected_by_nothing():
    faulty = record()
    faulty.errors = errors((1012, "MCH", SPIKE, 1))
    assert proven(faulty, acted=False).detected is None


def test_a_code_that_healthy_walks_have_detects_only_by_its_rate():
    healthy_run = record()
    healthy_run.errors = errors(*((ms, "MCH", LIMIT, 1) for ms in range(0, 2000, 100)))
    healthy = Healthy.of([healthy_run])
    usual, oftener = record(), record()
    usual.errors = errors(*((ms, "MCH", LIMIT, 1) for ms in range(20, 2000, 100)))
    oftener.errors = errors(*((ms, "MCH", LIMIT, 1) for ms in range(1001, 2000, 10)))
    assert proven(usual, healthy_run, healthy=healthy).detected is None
    found = proven(oftener, healthy_run, healthy=healthy).detected
    assert (found.code, found.rate) == ("MC_PWM_LIMIT", True)
    # error n comes 1 + 10 (n - 1) ms after the start; in that time a healthy walk has at most one more than every
    # 100 ms: the first n above 2 (1 + time / 100 ms) + 5 is the eighth or, with one more healthy error in reach, tenth
    assert 1071 * MS <= found.time_ns <= 1101 * MS


def test_a_rate_is_held_against_the_worst_of_all_healthy_walks():
    quiet, loud, faulty = record(), record(), record()
    quiet.errors = errors((100, "MCH", LIMIT, 1))
    loud.errors = errors((500, "MCH", LIMIT, 30))
    faulty.errors = errors((1200, "MCH", LIMIT, 40))
    assert proven(faulty, healthy=Healthy.of([quiet])).detected is not None
    assert proven(faulty, healthy=Healthy.of([quiet, loud])).detected is None
    assert proven(faulty, healthy=Healthy.of([quiet]).merged(Healthy.of([loud]))).detected is None


def test_the_first_other_state_is_the_reaction():
    faulty = record()
    faulty.words[faulty.words[:, 0] >= 1204 * MS, word("hip")] = 2
    found = proven(faulty)
    assert (found.reaction.machine, found.reaction.state, found.reaction.instead_of) == ("hip", "hold", "wait")
    assert found.reaction_ms == 204.0
    assert (found.unusual.state, found.unusual.instead_of, found.unusual.time_ns) == ("hold", "wait", 1204 * MS)


def test_a_walk_out_of_step_reacts_but_does_nothing_unusual():
    faulty = record()
    faulty.words[:, word("hip")] = (np.arange(len(faulty.words)) * 2 + (faulty.words[:, 0] >= BEGAN) * 100) // 500 % 2
    found = proven(faulty)
    assert found.reaction is not None and found.unusual is None


def test_what_healthy_walks_raise_survives_json():
    run = record()
    run.errors = errors(*((ms, "MCH", LIMIT, 1) for ms in range(0, 2000, 7)), (50, "MCFO", SPIKE, 3))
    healthy = Healthy.of([run])
    again = Healthy.from_dict(json.loads(json.dumps(healthy.as_dict())))
    assert (again.spans, again.changes) == (healthy.spans, healthy.changes)


def test_the_most_errors_in_a_time_are_counted_as_by_looking_at_every_window():
    times = np.cumsum([1, 5, 2, 2, 40, 1, 1, 1, 90, 3]) * MS
    run = record()
    run.errors = errors(*((int(each) // MS, "MCH", LIMIT, 1) for each in times))
    healthy = Healthy.of([run])
    for duration_ms in (0, 1, 2, 3, 4, 5, 9, 43, 60, 200):
        most = max(int(((times >= start) & (times <= start + duration_ms * MS)).sum()) for start in times)
        assert healthy.most(("MCH", LIMIT), duration_ms * MS) == most
    assert healthy.most(("MCFO", LIMIT), 100 * MS) == 0


def test_healthy_walks_that_are_alike_raise_no_false_alarm_and_one_that_is_not_does():
    runs = [record() for _ in range(4)]
    for run in runs:
        run.errors = errors(*((ms, "MCH", LIMIT, 1) for ms in range(0, 2000, 50)))
    assert proof.false_alarms(runs, [500 * MS, BEGAN])[:2] == (0, 8)
    runs[2].errors = errors((1500, "MCFO", SPIKE, 1))
    count, total, which = proof.false_alarms(runs, [500 * MS, BEGAN])
    assert (count, total, {each.code for each in which}) == (2, 8, {"AE_SPIKE"})


def test_a_gait_is_measured_from_strike_to_strike():
    found = proof.gait(record(until_ms=3000), 700 * MS)
    assert found.steps == 4
    assert found.step_length_m == pytest.approx(0.35)
    assert found.step_time_s == pytest.approx(0.5)
    assert found.motor_power_W == pytest.approx(10.0)


def test_less_than_two_strikes_are_not_a_gait():
    found = proof.gait(record(until_ms=1300), 700 * MS)
    assert (found.steps, found.step_length_m, found.step_time_s) == (1, None, None)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_current_beyond_its_peak_is_damage_only_when_it_lasts(sign):
    run = record()
    current = run.samples[:, COLUMN["hip_A"]]
    current[600:604] = sign * 6.1  # 1.2 times 5 A is 6; four samples are 6 to 10 ms
    assert proof.damage(run, BEGAN) == ""
    current[600:608] = sign * 6.1
    assert proof.damage(run, BEGAN).startswith("hip motor beyond 6 A")
    current[600:608] = sign * 5.9
    assert proof.damage(run, BEGAN) == ""


def test_damage_before_the_fault_is_not_the_faults():
    run = record()
    run.samples[100:200, COLUMN["hip_A"]] = 7.0
    assert proof.damage(run, BEGAN) == ""


def test_the_thermal_state_of_a_constant_current_is_the_exponentials():
    time = np.arange(0.0, 20.0, 0.002)
    expected = 3.1**2 * 10.0 * (1.0 - np.exp(-time[-1] / 10.0))
    assert proof.thermal_state(np.full(len(time), 3.1), time) == pytest.approx(expected, rel=1e-6)


def test_a_record_that_is_cut_is_the_record_of_a_shorter_run():
    cut, short = record(until_ms=2000).until(1399 * MS), record(until_ms=1400)
    for field in ("samples", "words", "errors"):
        assert np.array_equal(getattr(cut, field), getattr(short, field))
    assert all(np.array_equal(cut.frames[bus], short.frames[bus]) for bus in cut.frames)
    fallen = dataclasses.replace(record(), fell_ns=1500 * MS)
    assert fallen.until(1400 * MS).fell_ns == -1 and fallen.until(1600 * MS).fell_ns == 1500 * MS
