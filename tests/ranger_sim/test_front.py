"""What a user imports by name from `ranger_sim`, and the message for a wrong name."""

import inspect
import json
import pathlib
import subprocess
import sys

import pytest

import ranger_sim
from ranger_sim import Profile, Quirks, Ranger, Scenario, StopRule, UserError, load_profile

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent


@pytest.fixture(scope="module")
def robot():
    robot = Ranger(Scenario(seed=2), quirks=Quirks(), profile=load_profile("hil-1mbit"))
    yield robot
    robot.close()


def test_importing_the_package_loads_no_subpackage_and_nothing_heavy():
    look = (
        "import json, sys; import ranger_sim; dir(ranger_sim);"
        "print(json.dumps(sorted(name.partition('.')[0] if not name.startswith('ranger_sim') else name"
        " for name in sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", look], cwd=ROOT, capture_output=True, text=True, check=True)
    loaded = set(json.loads(done.stdout))
    assert {name for name in loaded if name.startswith("ranger_sim")} == {"ranger_sim", "ranger_sim.loading"}
    assert not {"numpy", "can", "rich", "cython"} & loaded


def test_every_name_of_the_front_is_there_and_documented():
    for name in ranger_sim.__all__:
        assert getattr(ranger_sim, name).__doc__, name
        assert name in ranger_sim.__doc__ and name in dir(ranger_sim)
    assert set(ranger_sim.__all__) == set(ranger_sim._PLACES)


def test_a_name_that_is_not_in_the_front_says_what_is():
    with pytest.raises(
        AttributeError,
        match=r"no attribute 'Robot'; it offers BusError, .*Measurement, .*Profile, ProfileError, Quirks, Ranger",
    ):
        ranger_sim.Robot  # noqa: B018


def test_the_names_work_together(robot):
    assert isinstance(robot.profile, Profile) and robot.profile.buses["can1"].bit_rate == 1_000_000
    assert not robot.run(StopRule(time_s=1.0), slice_s=0.01)
    assert robot.time_s == pytest.approx(0.01)
    assert robot.board("MB") is robot.boards["MB"]


def test_a_board_that_is_not_there_is_reported_with_those_that_are(robot):
    for ask in (lambda: robot.board("NOPE"), lambda: robot.replace("NOPE", "task", lambda: None, 1)):
        with pytest.raises(UserError, match=r"unknown board 'NOPE' .available: MCH, MCFO, MCFI, MCSI, UI, CSR, MB.$"):
            ask()


def test_a_variable_that_is_not_there_is_reported_with_those_of_like_name(robot):
    with pytest.raises(UserError, match=r"unknown variable 'MCH_ANGEL'; did you mean 'MCH_ANGLE'"):
        robot.variable("MCH_ANGEL")
    with pytest.raises(UserError, match=r"unknown variable '%%'; `ranger-sim table list`"):
        robot.variable("%%")


def test_signatures_of_compiled_functions_and_methods_can_be_read():
    from ranger_sim.firmware_sim.scheduler import SlotScheduler
    from ranger_sim.foundation.numbers import wrap_u32

    assert list(inspect.signature(wrap_u32).parameters) == ["value"]
    replace = inspect.signature(SlotScheduler.replace)
    assert list(replace.parameters) == ["self", "name", "function", "cost", "limit", "per_item"]
    assert replace.parameters["limit"].default is None
