"""A short emulated walk, diagnosed with the right model and with wrong ones; what channels allow."""

import numpy as np
import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant.mechanics.parameters import BodyParameters
from ranger_sim.sysid.channels import named_for
from ranger_sim.sysid.dataset import Channel, Dataset, Table
from ranger_sim.sysid.machines.walk import Walk, mechanics, strikes, timebase
from ranger_sim.sysid.machines.walk.mechanics import Motion, Numbers
from ranger_sim.sysid.pipeline import diagnose
from ranger_sim.tools.cli import main
from ranger_sim.tools.recordings import datasets

STEPS = 30


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("walk")
    assert main(["walk", "--steps", str(STEPS), "--seed", "4", "--log", "full", "--out", str(out / "run")]) == 0
    return out / "run"


@pytest.fixture(scope="module")
def table(folder):
    machine = Walk()
    dataset = named_for(datasets.open_recording(folder), "walk")
    return machine.table(dataset, [each.name for each in machine.quantities if each.name in dataset])


def body(path, **numbers):
    lines = ['title = "wrong"', 'description = "for a test"', 'base = "ranger"', "[parameters]"]
    lines += [f"{name} = {value}" for name, value in numbers.items()]
    lines += ["[sources]", *(f'{name} = "chosen for this test"' for name in numbers)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return str(path)


def test_a_sound_walk_raises_no_alarm_and_shows_its_motors(table):
    found = diagnose(Walk(), [table]).answer
    assert not found["detected"]
    parameters = found["evidence"]["parameters"]
    # the emulated gyro's packets come 2 to 3 ms behind the boards' angles
    assert 0.001 < parameters["leg_lag_s"]["value"] < 0.004
    # 66:1 times 0.018 N m/A; its interval is 0.14 to either side, and it is known beforehand to a tenth
    assert parameters["hip_torque_constant_Nm_per_A"]["value"] == pytest.approx(1.188, abs=0.15)


def test_a_model_whose_feet_stand_too_high_is_named_with_the_height(table, tmp_path):
    """The robot's 0.146 m against a model of 0.136 m: the change that is asked for is 10 mm."""
    wrong = Walk(body(tmp_path / "low.toml", outer_ankle_offset_m=0.136, inner_ankle_offset_m=0.136))
    found = diagnose(wrong, [table]).answer
    assert found["detected"]
    first = found["causes"][0]
    assert (first["name"], first["at"]) == ("geometry", "feet")
    low, high = first["parameters"]["foot_height_m"]["ci95"]
    assert low < 0.010 < high and high - low < 0.006


@pytest.mark.parametrize("spring", [5.6, 9.6])
def test_a_model_with_a_wrong_hip_spring_is_named_with_the_stiffness_however_large(table, tmp_path, spring):
    """2 N m/rad too soft, or too stiff: noise is what differs between strides, a large misfit is not taken for it."""
    found = diagnose(Walk(body(tmp_path / "soft.toml", hip_spring_Nm_per_rad=spring)), [table]).answer
    assert found["detected"]
    first = found["causes"][0]
    assert (first["name"], first["at"]) == ("spring_value", "hip_spring")
    low, high = first["parameters"]["stiffness_Nm_per_rad"]["ci95"]
    assert low < 7.6 - spring < high


def test_rows_at_the_same_time_after_a_strike_are_repeats(table):
    """Fourteen strides of each leg; two rows of one place are a stride or more apart."""
    touches = strikes.find(table)
    stands, _ = strikes.standing(table, touches, 0.15, 0.07)
    places = strikes.places(table, touches, stands, 0.15, 0.06)
    assert 8 <= np.count_nonzero(np.bincount(places[places >= 0]) >= 10) <= 16
    for place in np.unique(places[places >= 0]):
        rows = np.flatnonzero(places == place)
        assert np.all(np.diff(table.time_s[rows]) > 0.8)
        assert set(stands[rows]) == {place % 2}


def test_what_few_channels_lack_is_reported():
    time_s = np.arange(0.0, 5.0, 0.004)
    columns = {"hip_angle_rad": 0.3 * np.sin(5.0 * time_s), "outer_leg_angle_rad": 0.2 * np.sin(5.0 * time_s)}
    few = Table(time_s, columns, (slice(0, len(time_s)),), "few.csv")
    with pytest.raises(UserError, match=r"few\.csv: no equation of a walk can be made of hip_angle_rad.*hip_current_A"):
        Walk().prepare(few)


def test_how_much_of_a_short_walk_counts_is_reported(table):
    short = table.part(slice(0, int(4.0 / table.step_s)))
    with pytest.raises(UserError, match=r"s of walking are too short: .* has most rows .*, \d+ of at least \d+"):
        Walk().prepare(short)


def test_what_was_lost_is_cut_out_and_what_stood_still_is_held():
    time_s = np.arange(0.0, 2.0, 0.002)
    value = np.where(time_s < 1.0, np.sin(time_s), np.sin(1.0))
    kept = ~((time_s > 0.5) & (time_s < 0.6)) & ~((time_s > 1.2) & (time_s < 1.4))
    dataset = Dataset("log", {"hip_angle_rad": Channel("hip_angle_rad", "rad", time_s[kept], value[kept])})
    table = timebase.even_table(dataset, ["hip_angle_rad"], ("hip_angle_rad",))
    assert len(table.runs) == 2
    assert not np.any((table.time_s > 0.505) & (table.time_s < 0.595))
    assert np.any((table.time_s > 1.25) & (table.time_s < 1.35))


def test_strikes_are_found_by_the_contact_sensors_and_legs_take_turns(table):
    found = strikes.find(table)
    assert len(found) >= STEPS - 2
    assert all(one.leg != other.leg for one, other in zip(found[:-1], found[1:], strict=True))


def test_a_robot_at_rest_on_its_sweet_spots_is_in_balance():
    """Upright, legs together, centres of mass on the legs: nothing turns."""
    numbers = Numbers.of(BodyParameters())
    still = (np.zeros(3),) * 4
    motion = Motion(still, still, (still, still), (still, still), np.zeros(3))
    left = mechanics.stance(numbers, motion, 0)
    assert left.hip_torque == pytest.approx(np.zeros(3), abs=1e-12)
    assert left.floor == pytest.approx(np.zeros(3), abs=1e-12)
    assert mechanics.height_difference(numbers, motion) == pytest.approx(np.zeros(3), abs=1e-12)


def test_no_stiffness_or_weight_is_named_that_would_be_negative(table):
    """The return springs have 0.066 N m/rad to lose, the legs' centre of mass may lie behind as well as ahead."""
    effects = {(each.cause, each.at, each.coefficients[0]): each for each in Walk().effects([Walk().prepare(table)])}
    spring = effects["spring_value", "ankle_return", "stiffness_Nm_per_rad"]
    assert spring.admissible({"stiffness_Nm_per_rad": -0.06}) and not spring.admissible({"stiffness_Nm_per_rad": -0.07})
    assert effects["inertia", "legs", "offset_kg_m"].admissible({"offset_kg_m": -0.2})
