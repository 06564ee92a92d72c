"""A campaign about a machine that is not Ranger: its plan, what is refused, and what a run comes to."""

import pathlib

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.campaigns import group, plan
from tests.firmware_sim.native.support import COMPILER

SERVO = pathlib.Path(__file__).resolve().parents[3] / "examples" / "servo"
MAKE = str(SERVO / "servo.py:new")
pytestmark = pytest.mark.skipif(not COMPILER, reason="no C compiler is installed here")


def made(**data):
    whole = {"title": "test", "machine": {"make": MAKE}, "watch": {"after": "200 ms"}, "band": {"angle_rad": 0.05}}
    return plan.of_data({**whole, **data}, "test.toml")


def test_the_shipped_plan_has_each_mode_at_each_start():
    found = plan.load(SERVO / "campaign.toml")
    assert len(found.cases()) == 20 and found.watch.band == {"angle_rad": 0.05}
    assert (
        "the machine could go no further" in found.subject.criteria["fall"] and "damage" not in found.subject.criteria
    )


def test_settings_are_the_keywords_of_what_makes_it():
    found = made(vary={"machine.coulomb_Nm": [0.002, 0.004], "seed": [3], "cost.DRIVE.observe": [2.0]})
    first, second = (case.settings for case in found.cases())
    assert (first.walk, second.walk) == ({"seed": 3, "coulomb_Nm": 0.002}, {"seed": 3, "coulomb_Nm": 0.004})
    machine = second.robot()
    assert machine.plant.numbers.coulomb_Nm == 0.004
    assert machine.boards["DRIVE"].scheduler.find("observe").cost == 1800
    machine.close()


@pytest.mark.parametrize(
    ("data", "line"),
    [
        ({"machine": {}}, "make = None: FILE.py:NAME is expected"),
        ({"machine": {"make": "nowhere.py:new"}}, "there is no file .*nowhere.py"),
        ({"machine": {"make": str(SERVO / "servo.py:old")}}, "no function or class 'old'"),
        ({"machine": {"make": MAKE, "mass": 3}}, "unexpected keyword argument 'mass'"),
        ({"walk": {"seed": 3}}, r"\[walk\] and \[machine\]: one of them"),
        ({"band": {"angel_rad": 0.1}}, r"\[band\] angel_rad: it is not a quantity of the body \(available: angle_rad"),
        ({"band": {"angle_rad": -1.0}}, "a number above 0 is expected"),
        ({"vary": {"controller.P": [1.0]}}, r"not a setting \(seed, machine.KEYWORD, cost.BOARD.TASK\)"),
        ({"vary": {"fault": ["DRIVE.encodr:stuck"]}}, "unknown fault place 'DRIVE.encodr'"),
        ({"vary": {"fault": ["DRIVE.encoder:stuck@step 3"]}}, "it reads like 12.3 s, angle_rad > 0.3"),
    ],
)
def test_a_fault_of_a_plan_is_reported_in_one_line(data, line):
    with pytest.raises(UserError, match=line) as reported:
        made(**data)
    assert len(str(reported.value).splitlines()) == 1


def test_a_run_is_judged_by_its_band_and_comes_out_the_same_again():
    found = made(vary={"fault": ["DRIVE.lead:open@0.1 s", "DRIVE.current:noise,deviation=0.05@0.1 s"]})
    off, small = (group.alone(case, found.watch, None) for case in found.cases())
    assert off["outcome"] == "degraded" and "angle_rad off by" in off["why"] and off["deviation"] > 1.0
    assert off["detected"][0]["code"] == "ENCODER_DEAD"  # the arm hangs still, so no edge comes under the full current
    assert small["outcome"] == "masked" and 0.0 < small["deviation"] < 1.0
    again = group.alone(found.cases()[0], found.watch, None)
    assert again["digest"] == off["digest"]
