"""Both ends of a scenario's and of a campaign's limits, and figures of a summary from records made by hand."""

import math
from types import SimpleNamespace as Made

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.campaigns import plan
from ranger_sim.ranger.records import summary
from ranger_sim.ranger.scenario import Scenario
from ranger_sim.ranger.walks import REFERENCE

RANGE = {"slope": {"low": 0.0, "high": 0.1}}


@pytest.mark.parametrize(
    "name, low, high, below, above",
    [
        ("slope_rad", -0.5, 0.5, -0.501, 0.501),
        ("floor_roughness_m", 0.0, 0.1, -0.001, 0.101),
        ("start_uptime_ms", 0, 4_294_967_295, -1, 4_294_967_296),
        ("battery_charge", 1e-6, 1.0, 0.9e-6, 1.001),
        ("battery_capacity_Wh", 1e-3, 1e6, 0.9e-3, 1.1e6),
    ],
)
def test_a_scenario_takes_both_limits_and_refuses_what_is_beyond(name, low, high, below, above):
    for value in (low, high):
        assert getattr(Scenario(**{name: value}), name) == value
    for value in (below, above, math.nan):
        with pytest.raises(UserError, match=name):
            Scenario(**{name: value})


def made(**data):
    return plan.of_data({"title": "test", "vary": RANGE, **data}, "test.toml", REFERENCE)


def test_a_search_without_numbers_has_twelve_runs_and_four_rounds_of_six():
    found = made(search={}).search
    assert (found.first, found.rounds, found.each, found.seed) == (12, 4, 6, 1)
    assert (found.least, found.outcome) == (None, "fall")


@pytest.mark.parametrize(
    "key, low, high",
    [("first", 1, 100_000), ("rounds", 0, 1000), ("each", 1, 100_000), ("seed", -(2**63), 2**63)],
)
def test_a_search_takes_both_limits_of_each_number(key, low, high):
    for value in (low, high):
        assert getattr(plan.search_of({"search": {key: value}}, "here"), key) == value
    for value in (low - 1, high + 1, 1.5, True, "1"):
        with pytest.raises(UserError, match=rf"here: \[search\]: {key} = .*a whole number from {low} to {high}"):
            plan.search_of({"search": {key: value}}, "here")


def test_a_sample_s_seed_is_1_and_may_be_any_of_64_bits():
    assert made(sample={"runs": 5}).sample.seed == 1
    for value in (-(2**63), 2**63):
        assert made(sample={"runs": 5, "seed": value}).sample.seed == value
    for value in (-(2**63) - 1, 2**63 + 1):
        with pytest.raises(UserError, match="a whole number"):
            made(sample={"runs": 5, "seed": value})
    with pytest.raises(UserError, match="runs"):
        made(sample={"runs": 0})
    assert made(sample={"runs": 1}).sample.runs == 1


def plant(steps, compliant=False, normal=-2.0):
    counts = {
        "touches": 1, "lift_offs": 2, "bounces": 3, "recontacts": 4, "scuffs": 5, "flights": 6, "slides": 7, "jams": 8,
        "lead_lifts": 9, "tensile_strikes": 10, "tensile_impulse_min_Ns": -0.5, "min_clearance_m": 0.01,
    }  # fmt: skip
    seen = Made(friction_ratio_max=0.3, slip_s=0.2, normal_force_min=normal, pull_s=0.1)
    return Made(
        record=Made(steps=steps, **counts),
        body=Made(seen=seen, compliant=compliant),
        parameters=Made(contact="rigid"),
    )


def test_oddities_of_a_walk_are_its_record_s():
    shown = summary.oddities(plant(2))
    assert [shown[key] for key in ("touches", "lift_offs", "bounces", "recontacts", "scuffs")] == [1, 2, 3, 4, 5]
    assert [shown[key] for key in ("flights", "slides", "jams", "lead_lifts")] == [6, 7, 8, 9]
    assert (shown["tensile_strikes"], shown["tensile_impulse_min_Ns"], shown["min_clearance_m"]) == (10, -0.5, 0.01)
    assert (shown["friction_ratio_max"], shown["slip_s"], shown["pull_s"]) == (0.3, 0.2, 0.1)
    assert shown["normal_force_min_N"] == -2.0 and shown["contact"] == "rigid"


def test_what_was_not_measured_is_none():
    none, one, soft = (summary.oddities(each) for each in (plant(0), plant(1), plant(5, compliant=True)))
    assert none["tensile_strikes"] is None and none["tensile_impulse_min_Ns"] is None
    assert one["tensile_strikes"] == 10 and one["min_clearance_m"] is None
    assert soft["tensile_strikes"] is None and soft["min_clearance_m"] == 0.01
    assert summary.oddities(plant(1, normal=math.inf))["normal_force_min_N"] is None


@pytest.mark.parametrize("charge, shown", [(0.4, 0.4), (-0.01, 0.0)])
def test_a_battery_s_summary_is_in_watt_hours(charge, shown):
    packs = Made(parameters=Made(charge=0.9), charge=charge, delivered_J=7200.0, lost_J=1800.0, cut_off=True)
    robot = Made(scenario=Made(battery_capacity_Wh=493.0), plant=Made(electrics=Made(battery=packs)))
    assert summary.battery(robot) == {
        "capacity_Wh": 493.0,
        "charge_at_start": 0.9,
        "charge": shown,
        "delivered_Wh": 2.0,
        "lost_inside_Wh": 0.5,
        "empty": True,
    }
