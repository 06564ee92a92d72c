"""Each outcome on a record made for it, and their order."""

import dataclasses

import pytest

from ranger_sim.datatable.generated import errors as error_table
from ranger_sim.harness.campaigns import group, outcomes
from ranger_sim.harness.campaigns.outcomes import Band, classify
from ranger_sim.harness.faults.proof import damage, gait, prove
from ranger_sim.ranger.walks import WALKS
from tests.harness.faults.records import COLUMN, MS, STEP_MS, errors, record

BEGAN = 1000 * MS
LONG = 6000


def judged(faulty, acted=True):
    golden = record(LONG)
    proven = prove(golden, faulty, BEGAN, acted)
    return classify(proven, gait(faulty, BEGAN), gait(golden, BEGAN, faulty.end_ns), damage(faulty, BEGAN), Band())


def differing():
    """A run whose firmware differs, and nothing else."""
    faulty = record(LONG)
    faulty.frames["can1"][200:, 1] += 1 << 12
    return faulty


def with_error(run):
    run.errors = errors((1010, "MCFO", error_table.MCFO_CBL_STRCH, 1))
    return run


def with_short_steps(run):
    run.samples[:, COLUMN["hip_x_m"]] *= 0.8
    return run


def test_a_fault_that_never_acted_is_invalid_whatever_happened():
    assert judged(with_error(differing()), acted=False) == ("invalid", "the fault never acted")


def test_no_change_in_the_firmware_is_not_an_effect():
    assert judged(record(LONG)) == ("no effect", "")


def test_a_difference_without_error_and_with_the_same_gait_is_masked():
    assert judged(differing()) == ("masked", "")


def test_an_error_with_the_same_gait_is_detected_and_safe():
    assert judged(with_error(differing())) == ("detected and safe", "MCFO_CBL_STRCH from MCFO")


def test_an_error_and_another_gait_is_a_degraded_gait():
    outcome, why = judged(with_error(with_short_steps(differing())))
    assert outcome == "degraded" and why == "step length -20 %; MCFO_CBL_STRCH from MCFO"


def test_another_gait_without_an_error_is_undetected_wrong():
    assert judged(with_short_steps(differing())) == ("undetected wrong", "step length -20 %")


def test_a_fall_is_a_fall_detected_or_not():
    for run in (differing(), with_error(differing())):
        fallen = dataclasses.replace(run, fell_ns=3000 * MS, fall_cause="fell forward")
        assert judged(fallen) == ("fall", "fell forward")


def test_damage_comes_before_a_fall():
    fallen = dataclasses.replace(differing(), fell_ns=3000 * MS, fall_cause="fell forward")
    fallen.samples[700:800, COLUMN["outer_A"]] = 12.0
    outcome, why = judged(fallen)
    assert outcome == "damage" and why.startswith("outer motor beyond 9.6 A")


def test_with_a_golden_run_that_fell_a_fall_counts_only_in_a_sweep():
    fell = ("fall", "fell forward")
    assert outcomes.against_fallen(*fell, None, "", False) == fell
    reported = ("invalid", "the golden run fell as well, after 812 ms (fell backward)")
    assert outcomes.against_fallen(*fell, 812.4, "fell backward", False) == reported
    assert outcomes.against_fallen("masked", "", 812.4, "fell backward", False) == reported
    assert outcomes.against_fallen(*fell, 812.4, "fell backward", True) == fell
    assert outcomes.against_fallen("masked", "", 812.4, "fell backward", True) == reported


def test_a_golden_run_counts_until_the_run_was_to_end():
    golden, faulty = record(LONG), differing()
    fallen = dataclasses.replace(golden, fell_ns=5000 * MS, fall_cause="fell forward")
    proven = prove(golden, faulty, BEGAN, True)
    watch = group.Watch(after_s=3.0)
    assert group.judged(WALKS, proven, fallen.until(4000 * MS), faulty, BEGAN, watch)["outcome"] == "masked"
    assert group.judged(WALKS, proven, fallen.until(5000 * MS), faulty, BEGAN, watch)["outcome"] == "invalid"


@pytest.mark.parametrize(
    ("factor", "outside"), [(1.14, ""), (1.16, "step length +16 %"), (0.86, ""), (0.84, "step length -16 %")]
)
def test_the_band_of_the_step_length_has_two_sides(factor, outside):
    run = record(LONG)
    run.samples[:, COLUMN["hip_x_m"]] *= factor
    assert outcomes.beyond(gait(run, BEGAN), gait(record(LONG), BEGAN), Band()) == outside


@pytest.mark.parametrize(("time", "outside"), [(0.57, ""), (0.60, "step time +20 %"), (0.40, "step time -20 %")])
def test_the_band_of_the_step_time_has_two_sides(time, outside):
    golden = gait(record(LONG), BEGAN)
    assert outcomes.beyond(dataclasses.replace(golden, step_time_s=time), golden, Band()) == outside


def test_only_more_power_is_worse():
    golden = gait(record(LONG), BEGAN)
    assert outcomes.beyond(dataclasses.replace(golden, motor_power_W=1.0), golden, Band()) == ""
    assert outcomes.beyond(dataclasses.replace(golden, motor_power_W=13.5), golden, Band()) == "motor power +35 %"


def test_a_robot_that_stops_stepping_is_outside_the_band():
    stands = record(LONG)
    stands.samples[:, COLUMN["steps"]] = stands.samples[BEGAN // MS // 2, COLUMN["steps"]]
    assert outcomes.beyond(gait(stands, BEGAN), gait(record(LONG), BEGAN), Band()) == "0 steps made"


def test_severity_orders_outcomes_and_the_sooner_fall_is_worse():
    def result(outcome, **more):
        return {"outcome": outcome, **more}

    ordered = [
        result("invalid"),
        result("no effect"),
        result("masked", deviation=0.1),
        result("masked", deviation=0.9),
        result("degraded", deviation=1.5),
        result("undetected wrong", deviation=1.2),
        result("fall", fall_ms=4000.0),
        result("fall", fall_ms=300.0),
        result("damage"),
    ]
    found = [outcomes.severity(each) for each in ordered]
    assert found == sorted(found) and len(set(found)) == len(found)


def test_every_outcome_has_a_criterion_and_a_severity():
    assert set(outcomes.SEVERITY) == set(outcomes.CRITERIA) == set(outcomes.OUTCOMES)
    assert STEP_MS == 500  # the records' step, on which the numbers above stand
