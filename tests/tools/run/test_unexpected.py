"""What a healthy walk has not is reported, each thing in a line; a healthy one has no line."""

import copy
import math

import pytest

from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario, StopRule
from ranger_sim.tools.run import unexpected

MU = 0.9


@pytest.fixture(scope="module")
def healthy():
    """The summary of a robot that was only held; what follows is changed in copies of it."""
    robot = Ranger(Scenario())
    robot.run(StopRule(time_s=0.05))
    found = robot.summary()
    robot.close()
    return found


def reported(summary, change):
    changed = copy.deepcopy(summary)
    change(changed)
    return [*unexpected.ending(changed), *unexpected.lines(changed, MU)]


def test_a_healthy_walk_has_no_line(healthy):
    assert reported(healthy, lambda s: s["errors"].update(MCH={"MC_TCURR_OOB": 3})) == []


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (lambda s: s.update(fell=True, fall_cause="hip too low"), "it fell: hip too low"),
        (lambda s: s.update(failed_boards=["MCH"]), "MCH: the board failed"),
        (lambda s: s["faults"].append({"fault": "a:b", "acted": False}), "a:b: the fault did not act"),
        (
            lambda s: s["oddities"].update(tensile_strikes=1, tensile_impulse_min_Ns=-2.361),
            "1 strike pulled at the floor, to -2.36 N s",
        ),
        (
            lambda s: s["oddities"].update(pull_s=0.0125, normal_force_min_N=-20.84),
            "the floor pulled at a foot for 12 ms, to -20.8 N",
        ),
        (
            lambda s: s["oddities"].update(friction_ratio_max=1.56),
            "friction of 1.56 times the normal force; the floor gives 0.90",
        ),
        (lambda s: s["oddities"].update(flights=2), "2 times with no foot on the floor"),
        (lambda s: s["oddities"].update(scuffs=1), "1 scuff of the swing foot"),
        (lambda s: s["oddities"].update(recontacts=2), "2 touches out of turn"),
        (lambda s: s["oddities"].update(bounces=2), "2 bounces of a leading foot"),
        (lambda s: s["can"]["can2"].update(lost=3), "can2: 3 frames lost"),
        (lambda s: s["can"]["can2"].update(queue_full=1), "can2: 1 frame refused by a full queue"),
        (lambda s: s["can"]["can4"].update(errors=2), "can4: 2 errors"),
        (
            lambda s: s["slots"]["UI"].update(overruns=1, max_execution_us=1203.4),
            "UI: 1 slot overrun, the longest of 1203 µs",
        ),
        (lambda s: s["heel_strike_delay_ms"].update(missed=2), "2 strikes not noticed"),
        (lambda s: s["heel_strike_delay_ms"].update(unmatched=1), "1 strike reported that did not happen"),
        (lambda s: s["errors"].update(MCFI={"ADCI_DNF": 3}), "errors of MCFI: ADCI_DNF x 3"),
    ],
)
def test_each_thing_that_a_healthy_walk_has_not_is_one_line(healthy, change, line):
    assert reported(healthy, change) == [line]


def test_friction_at_the_limit_of_a_contact_that_limits_it_is_expected(healthy):
    assert reported(healthy, lambda s: s["oddities"].update(friction_ratio_max=math.nextafter(MU, 1.0))) == []
