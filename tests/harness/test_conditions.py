"""Conditions on a running robot, and waiting for them."""

import pytest

from ranger_sim import Ranger, Scenario, UserError
from ranger_sim.harness.conditions import ConditionNotMetError, condition
from ranger_sim.harness.step_watch import StepWatch

STEP_NS = 250_000  # of the plant: conditions are looked at between two of its steps


@pytest.fixture
def robot():
    robot = Ranger(Scenario())
    yield robot
    robot.close()


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("fell down", "reads like 12.3 s, step 12, hip in HI_premid"),
        ("step x", "reads like"),
        ("12", "reads like"),
        ("-1 s", "reads like"),
        ("knee in HI_premid", "machine 'knee' is none of leg, hip"),
        ("MCH_ANGEL > 0", "did you mean 'MCH_ANGLE'"),
        ("hip_rat > 0", "did you mean 'hip_rad"),
        ("error MC_TCUR_OOB", "did you mean 'MC_TCURR_OOB'"),
        ("error MC_TCURR_OOB from MCX", "unknown board 'MCX' (available: MCH, MCFO"),
    ],
)
def test_a_text_that_is_no_condition_is_refused_with_what_was_perhaps_meant(text, what):
    with pytest.raises(UserError, match=what):
        condition(text)


def test_an_unknown_state_is_refused_with_the_states_of_the_machine(robot):
    with pytest.raises(UserError, match="hip has no state 'HI_mid', but HI_starthold"):
        robot.until("hip in HI_mid")


def test_until_an_instant_ends_at_the_first_step_of_the_plant_from_there_on(robot):
    assert robot.until("1.1 ms") == pytest.approx(1.25e-3)
    assert robot.loop.time == 5 * STEP_NS
    assert robot.until("1.25 ms") == pytest.approx(1.25e-3)  # holds already: no time passes


def test_until_a_variable_has_a_value_leaves_it_with_that_value(robot):
    robot.until("MCH_ANGLE > 0.3", within="1 s")  # held with 0.35 rad between the legs
    assert robot.variable("MCH_ANGLE") > 0.3
    before = robot.loop.time
    with pytest.raises(ConditionNotMetError, match=r"not within 10 ms; the nearest value of MCH_ANGLE was 0\.3\d* rad"):
        robot.until("MCH_ANGLE < 0.1", within="10 ms")
    assert robot.loop.time == before + 10_000_000


def test_until_a_quantity_of_the_body_reads_the_body_and_not_the_table(robot):
    robot.until("hip_rad == 0.35", within="0 ms")
    with pytest.raises(ConditionNotMetError, match=r"the nearest value of hip_rad was 0.35 rad"):
        robot.until("hip_rad > 0.36", within="5 ms")


def test_until_a_function_of_the_robot_is_true(robot):
    robot.until(lambda robot: robot.board("MCH").scheduler.slot_count >= 3, within="5 ms")
    assert robot.board("MCH").scheduler.slot_count == 3


def test_an_error_counts_only_when_it_is_noted_after_the_waiting_began(robot):
    errors = robot.board("MCH").errors
    errors.report(43)
    of_the_hip, of_the_feet = condition("error MC_TCURR_OOB from MCH"), condition("error MC_TCURR_OOB from MCFO")
    for wanted in (of_the_hip, of_the_feet):
        wanted.begin(robot)
        assert not wanted.met()
    errors.report(43)
    assert of_the_hip.met()
    assert not of_the_feet.met()
    assert of_the_feet.nearest() == "MCFO noted no MC_TCURR_OOB"


def test_an_error_of_a_board_that_begins_anew_counts_from_nothing(robot):
    for _ in range(5):
        robot.board("MCH").errors.report(43)
    wanted = condition("error MC_TCURR_OOB from MCH")
    wanted.begin(robot)
    robot.inject("MCH.processor", "reset")
    robot.until(lambda robot: robot.faults[0].cleared_ns > 0, within="100 ms")
    assert robot.board("MCH").errors.totals[43] == 0 and not wanted.met()
    robot.board("MCH").errors.report(43)
    assert wanted.met()


def test_a_fall_ends_the_waiting_and_is_told():
    robot = Ranger(Scenario(controller="record-2011", slope_rad=0.2))
    with pytest.raises(ConditionNotMetError, match=r"step 1000: the robot fell \(.*\) after .*; step \d+ was reached"):
        robot.until("step 1000", within="30 s")
    robot.until("fell")
    robot.close()


def test_waiting_in_pieces_changes_nothing(robot):
    other = Ranger(Scenario())
    other.run_for(0.3)
    for number in range(1, 11):
        robot.until(f"{30 * number} ms")
    for each in (robot, other):  # an end by a condition has the sample of its instant, an end by time has not
        each.run_for(0.001)
    assert robot.loop.time == other.loop.time
    assert robot.trace_digest() == other.trace_digest()
    other.close()


class Noting(StepWatch):
    """Notes what it is told."""

    def __init__(self):
        StepWatch.__init__(self)
        self.told = []

    def before_step(self, now_ns):
        self.told.append(now_ns)

    def after_step(self, start_ns, end_ns):
        self.told.append((start_ns, end_ns))


def test_a_watcher_sees_the_beginning_and_the_end_of_every_step_once(robot):
    watch = Noting()
    robot.loop.watchers.append(watch)
    robot.until("600 us")  # stops before the step at 750 us, which is then taken from there
    robot.run_for(0.0002)
    steps = [0, 250_000, 500_000, 750_000]
    assert watch.told == [each for start in steps for each in (start, (start, start + STEP_NS))]
