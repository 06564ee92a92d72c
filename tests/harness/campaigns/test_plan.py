"""A campaign's file: what it comes to, and what is refused."""

import pathlib

import pytest

from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.campaigns import plan
from ranger_sim.harness.campaigns.engine import around, spread

ROOT = pathlib.Path(__file__).resolve().parents[3]
STUCK = "MCH.absolute_encoder:stuck@{start}"


def made(**data):
    return plan.of_data({"title": "test", **data}, "test.toml")


def test_a_census_is_every_combination():
    found = made(vary={"fault": [STUCK, "UI.imu:gyro_bias@{start}"], "start": ["step 6", "step 7"], "seed": [1, 2, 3]})
    cases = found.cases()
    assert found.design == "census" and len(cases) == 12
    assert {case.fault for case in cases if case.fault.startswith("MCH")} == {
        "MCH.absolute_encoder:stuck@step 6",
        "MCH.absolute_encoder:stuck@step 7",
    }
    assert {case.settings.walk["seed"] for case in cases} == {1, 2, 3}
    assert len({case.key("v", {}) for case in cases}) == 12


def test_settings_reach_the_walk_in_its_units():
    found = made(
        walk={"floor_roughness": "1 mm", "controller": "robust"},
        vary={
            "battery": ["50 %"],
            "controller.P_H_PM_H_TRATE": [2.1],
            "body.hip_gear": [60.0],
            "cost.MCH.dn_safety": [1.5],
        },
    )
    case = found.cases()[0]
    assert case.settings.walk == {
        "floor_roughness_m": 0.001,
        "controller": "robust",
        "battery_charge": 0.5,
        "seed": 1,
    }
    assert case.settings.controller == {"P_H_PM_H_TRATE": 2.1}
    assert case.settings.body == {"hip_gear": 60.0}
    assert case.settings.costs == {"MCH.dn_safety": 1.5}
    assert case.fault is None
    assert case.reference.walk == {"floor_roughness_m": 0.001, "controller": "robust", "seed": 1}


def test_every_mode_that_fits_a_pattern_is_in_the_list_and_no_other():
    found = made(faults=[{"places": ["MCH.absolute*", "UI.imu"], "modes": ["stuck", "dr*"], "period": "step 6"}])
    assert sorted(case.fault for case in found.cases()) == [
        "MCH.absolute_encoder:drift@step 6",
        "MCH.absolute_encoder:drop_out@step 6",
        "MCH.absolute_encoder:stuck@step 6",
        "UI.imu:drift@step 6",
        "UI.imu:drop_out@step 6",
        "UI.imu:stuck@step 6",
    ]


def test_a_sample_is_the_same_for_the_same_seed_and_another_for_another():
    def faults(seed):
        found = made(
            vary={"fault": ["MCH.absolute_encoder:stuck@{at} s"], "at": {"low": 4.0, "high": 6.0}, "seed": [1, 2]},
            sample={"runs": 30, "seed": seed},
        )
        return [(case.fault, case.settings.walk["seed"]) for case in found.cases()]

    assert faults(1) == faults(1) != faults(2)
    times = [float(text.split("@")[1].split()[0]) for text, _ in faults(1)]
    assert 4.0 <= min(times) < 4.4 and 5.6 < max(times) <= 6.0


def test_a_range_by_factors_has_its_middle_at_the_geometric_mean():
    assert plan.Range(0.01, 1.0, log=True).at(0.5) == 0.1
    assert plan.Range(-1.0, 3.0).at(0.25) == 0.0


def test_a_range_with_a_step_has_these_values_and_no_other_and_a_census_takes_it():
    found = plan.Range(20, 60, step=10)
    assert found.values == [20, 30, 40, 50, 60]
    assert [found.at(share) for share in (0.0, 0.19, 0.2, 0.99, 1.0)] == [20, 20, 30, 60, 60]
    assert plan.Range(0.1, 0.35, step=0.1).values == [0.1, 0.2, 0.3]
    cases = made(vary={"seed": {"low": 1, "high": 3, "step": 1}, "slope": {"low": "0 deg", "high": 0.1, "step": 0.05}})
    assert [(case.settings.walk["seed"], case.settings.walk["slope_rad"]) for case in cases.cases()] == [
        (seed, slope) for seed in (1, 2, 3) for slope in (0.0, 0.05, 0.1)
    ]


def test_for_the_least_value_a_smaller_one_with_the_outcome_is_worse_and_any_other_outcome_is_not():
    search = plan.Search(least="force")
    fall, damage = {"outcome": "fall", "fall_ms": 900.0}, {"outcome": "damage", "fall_ms": None}
    fell_damaged = {"outcome": "damage", "fall_ms": 500.0}
    order = [(0.1, None), (0.1, damage), (0.9, fall), (0.5, fell_damaged), (0.4, fall)]
    found = [search.badness(value, result) for value, result in order]
    assert found == sorted(found) and len(set(found)) == len(found)


def test_around_the_least_value_no_larger_one_is_tried():
    points = around({"force": 0.5, "at": 0.5}, 200, 0.2, RandomStream(1, "test"), "force")
    assert 0.3 <= min(point["force"] for point in points) < 0.31 < 0.49 < max(point["force"] for point in points) <= 0.5
    assert max(point["at"] for point in points) > 0.6


def test_the_first_round_of_a_search_has_one_point_in_each_part_of_every_range():
    points = spread(8, ["start", "magnitude"], RandomStream(1, "test"))
    for name in ("start", "magnitude"):
        assert sorted(int(point[name] * 8) for point in points) == list(range(8))


def test_later_rounds_stay_near_the_worst_point_and_inside_the_ranges():
    points = around({"start": 0.05, "magnitude": 0.5}, 200, 0.1, RandomStream(1, "test"))
    assert all(0.0 <= point["start"] <= 0.15 and 0.4 <= point["magnitude"] <= 0.6 for point in points)
    assert min(point["start"] for point in points) == 0.0


@pytest.mark.parametrize(
    ("data", "told"),
    [
        ({"vary": {"fault": ["MCH.absolute_encoder:stuk@step 6"]}}, "unknown mode 'stuk'"),
        ({"vary": {"fault": ["MCH.encoder:stuck"]}}, "fault place 'MCH.encoder'"),
        ({"vary": {"fault": [STUCK]}}, "'start' is no name of [vary]"),
        ({"vary": {"fault": ["MCH.joint_encoder:stuck@{"]}}, "Single '{'"),
        ({"vary": {"fault": {"low": 1, "high": 2}}}, "[vary] fault = {'low': 1, 'high': 2}: a list of texts"),
        ({"vary": {"fault": ["MCH.joint_encoder:stuck@{at}"], "at": ["step 3", "soon"]}}, "condition 'soon'"),
        (
            {"vary": {"fault": ["UI.imu:gyro_bias,rate={rate}"], "rate": {"low": 1, "high": 9}}, "sample": {"runs": 2}},
            "rate is '9', allowed are -5.2 to 5.2",
        ),
        ({"walk": {"seed": 1.5}}, "[walk]: scenario: seed is 1.5, a whole number"),
        ({"walk": {"controller": "nobody"}}, "[walk]: unknown controller 'nobody'"),
        ({"vary": {"seed": ["one"]}}, "[vary] seed = one: scenario: seed is 'one', a whole number"),
        ({"vary": {"body.gear_of_the_hip": [60]}}, "[vary] body.gear_of_the_hip = 60: "),
        ({"vary": {"controller.P_X": ["fast"]}}, "[vary] controller.P_X = ['fast']: a list of numbers"),
        ({"vary": {"cost.MCH.nothing": [2.0]}}, "cost.MCH.nothing: schedule: no task named 'nothing'"),
        ({"vary": {"cost.MCH.mc_compliant_control": [1.0, -2.0]}}, "a factor of 0 or more"),
        ({"tolerance": {"detection": {"within": "1 s", "share": "most"}}}, "share 'most' and confidence 0.95"),
        (
            {
                "vary": {"slope": {"low": 0.0, "high": 0.1}},
                "search": {},
                "tolerance": {"detection": {"within": "1 s"}},
            },
            "the runs of a [search] are chosen",
        ),
        ({"vary": {"seed": [1]}, "sample": {"runs": 5, "interval": ["wilson"]}}, "allowed are clopper-pearson, wilson"),
        (
            {"vary": {"seed": [1]}, "sample": {"runs": 5, "stop": {"outcome": "fall", "limit": "few"}}},
            "limit = 'few'",
        ),
        (
            {"vary": {"seed": [1]}, "sample": {"runs": 5, "stop": {"outcome": "fall", "limit": 0.1, "looks": 2.5}}},
            "looks = 2.5: a whole number from 1 to 50",
        ),
        ({"watch": {"after": "0 s"}}, "[watch] after = '0 s': it must be above 0"),
        ({"vary": {"sed": [1]}}, "[vary] sed: it is no setting of a walk"),
        ({"vary": {"seed": []}}, "a list of values"),
        ({"vary": {"seed": {"low": 1, "high": 3}}}, "a range needs [sample] or [search]"),
        ({"vary": {"slope": {"low": 0.1, "high": 0.0}}, "sample": {"runs": 3}}, "low below high"),
        ({"vary": {"slope": {"low": 0.0, "high": 0.1, "log": True}}, "sample": {"runs": 3}}, "above 0"),
        ({"vary": {"seed": [1, 2]}, "search": {}}, "at least one range"),
        ({"vary": {"seed": [1]}, "sample": {"runs": 0}}, "runs = 0: a whole number from 1"),
        ({"vary": {"seed": [1]}, "sample": {"runs": 5, "interval": "wald"}}, "clopper-pearson, wilson"),
        (
            {"vary": {"seed": [1]}, "sample": {"runs": 5, "stop": {"outcome": "falls", "limit": 0.1}}},
            "outcome = 'falls': allowed are",
        ),
        ({"walk": {"floor_roughness": "1 mile"}, "vary": {"seed": [1]}}, "floor_roughness = '1 mile'"),
        ({"walk": {"slope": 3.0}, "vary": {"seed": [1]}}, "slope_rad is 3.0"),
        ({"watch": {"after": 7}, "vary": {"seed": [1]}}, "[watch] after"),
        ({"band": {"step_length": 0}, "vary": {"seed": [1]}}, "[band] step_length = 0"),
        ({"healthy": {"seeds": [1]}, "vary": {"seed": [1]}}, "two or more whole numbers"),
        ({"tolerance": {"detecting": {"within": "1 ms"}}, "vary": {"seed": [1]}}, "allowed are detection, reaction"),
        ({"faults": [{"places": "XYZ*"}]}, "no place and mode fit"),
        ({"vary": {"slope": {"low": 0.0, "high": 0.1, "step": 0.2}}}, "at most high - low"),
        (
            {"vary": {"slope": {"low": 0.0, "high": 0.1}}, "search": {"least": "seed"}},
            "one of the ranges is expected, slope",
        ),
        ({"vary": {"slope": {"low": 0.0, "high": 0.1}}, "search": {"outcome": "fall"}}, "needs `least`"),
        ({"fault_module": "none.py", "vary": {"seed": [1]}}, "none.py: there is no such file"),
        ({"fault_module": 3, "vary": {"seed": [1]}}, "relative to the plan"),
        ({"whatever": 1}, "unknown key 'whatever'"),
    ],
)
def test_what_is_wrong_is_said_in_one_line_with_its_place(data, told):
    with pytest.raises(UserError) as mistake:
        made(**data)
    assert told in str(mistake.value) and str(mistake.value).startswith("test.toml") and "\n" not in str(mistake.value)


def test_a_file_that_is_not_there_or_no_toml_is_named(tmp_path):
    with pytest.raises(UserError, match="No such file"):
        plan.load(tmp_path / "none.toml")
    (tmp_path / "bad.toml").write_text("title = ")
    with pytest.raises(UserError, match=r"bad\.toml:1:9: not valid TOML"):
        plan.load(tmp_path / "bad.toml")


@pytest.mark.parametrize("path", sorted((ROOT / "campaigns").glob("*.toml")), ids=lambda path: path.stem)
def test_the_campaigns_that_come_with_the_project_can_be_read(path):
    found = plan.load(path)
    assert found.search or found.cases()


def test_the_sensors_campaign_has_every_sensor_and_every_mode_that_it_takes():
    from ranger_sim.harness.faults.ranger_catalogue import CATALOGUE

    CATALOGUE.load()
    found = {case.fault.partition("@")[0] for case in plan.load(ROOT / "campaigns" / "sensors.toml").cases()}
    sensors = ("encoder", "current", "voltage", "foot", "sensor", "imu")
    expected = {
        f"{place.name}:{mode}"
        for place in CATALOGUE.places.values()
        if place.name.endswith(sensors)
        for mode in CATALOGUE.modes_of(place)
    }
    assert found == expected and len(found) > 300
