"""A sample of the machines that scipy solves: the rest by `python -m tests.sysid.solved_effects`."""

import dataclasses

import numpy as np
import pytest

from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.free_simulation.fit import TrajectoryFit
from tests.sysid import solved_machines
from tests.sysid.machines_of_a_user import Battery
from tests.sysid.solved_effects import answer, rows

BATTERY = dataclasses.replace(solved_machines.BATTERY, seconds=500.0)


def test_a_sound_battery_whose_current_has_another_clock_is_silent():
    """Its current jumps a row earlier or later than the voltage that shows it: without that, 14 times the noise."""
    found = answer(BATTERY, "", 0.0, 1)
    assert not found["detected"] and found["before"] < 0.01


def test_a_resistance_that_grows_is_found_in_a_battery_s_log():
    found = answer(BATTERY, "resistance grows", 8e-7, 1)
    assert found["causes"] == ["resistance_growth at cell"]
    assert found["after"] < found["before"]
    assert 0.0 < found["ci95"][0]  # so short a recording does not show the size: 5e-7 for 8e-7


def test_a_sensor_shows_the_nearest_tick_of_its_own_clock():
    log = solved_machines.BATTERY.log(1)
    base, given, corners = solved_machines.BATTERY.drawn((1, "a"))
    off = np.abs(log["current [A]"] - given(log["t [s]"])) > 0.05
    near = np.min(np.abs(log["t [s]"][:, None] - corners[None]), axis=1) <= 0.5 / 2.0 + 0.1
    assert not np.any(off & ~near)


@pytest.mark.parametrize("late", [0, 1])
def test_a_row_next_to_a_jump_weighs_less_only_where_the_clocks_differ(late):
    """The voltage shows the current at once; a row late, the fit finds that jumps are in another row."""
    current = np.repeat(np.array([0.0, 8.0, -4.0, 6.0, 1.0, -6.0, 5.0, 2.0]), 100)
    E, v1, volts = 3.8, 0.0, []
    for i in current:  # the exact solution of Battery's law for a held current
        volts.append(E - 0.03 * i - v1)
        E, v1 = E - 4e-5 * i * 0.5, v1 + (0.02 * i - v1) * (1.0 - np.exp(-0.5 / 25.0))
    noise = 1e-3 * np.sin(np.arange(800.0) ** 2)
    columns = {"current_A": np.roll(current, late), "voltage_V": np.array(volts) + noise}
    fit = TrajectoryFit(Battery(), Table(0.5 * np.arange(800), columns, (slice(0, 800),), "battery"))
    assert fit.simulator.shown_at_once(fit.u, fit.p) == ["i"]
    fit.settle()
    fit.choose_way()
    assert (fit.simulator.numerics.apart == {"i"}) == bool(late)


def test_the_table_counts_alarms_names_and_intervals():
    sound = {
        "detected": True,
        "causes": [],
        "right": False,
        "before": 1.0,
        "after": 1.0,
        "black_box": 1.0,
        "seconds": 2,
    }
    named = sound | {"right": True, "value": 2.0, "ci95": [1.0, 3.0], "true": 4.0, "after": 0.5}
    table = list(rows({"battery | nothing | 1": sound, "battery | leak | 4 | 1": named}))
    assert table[2] == "| battery | leak | 4 | 1 of 1 | 0 of 1 | 100.00%, 50.00%, 100.00% | 2.0 |"
    assert table[3].startswith("| battery | nothing |  | 1 alarms in 1 |")


@pytest.mark.parametrize("growth", [8e-7, 1e-5])
def test_a_larger_growth_is_named_as_well(growth):
    """At 1e-5 ohm/s most candidates alone explain a part of it."""
    assert answer(BATTERY, "resistance grows", growth, 1)["causes"][:1] == ["resistance_growth at cell"]


def test_an_offset_that_a_free_start_takes_up_is_not_a_candidate_and_a_drift_is():
    log = BATTERY.log(1)
    columns = {"current_A": log["current [A]"], "voltage_V": log["voltage [V]"]}
    recording = Battery().prepare(Table(log["t [s]"], columns, (slice(0, len(log["t [s]"])),), "battery"))
    offset, drift = (
        next(each for each in Battery().effects([recording]) if each.name == f"{name} at voltage_V")
        for name in ("sensor_offset", "sensor_drift")
    )
    assert offset.columns(recording, {}, recording.fitted) == {}
    assert drift.columns(recording, {}, recording.fitted).keys() == {"voltage_V"}


def test_gravity_is_named_where_each_recording_has_other_lags_between_its_clocks():
    found = answer(solved_machines.JOINT, "gravity", 0.01, 1)
    assert found["causes"][:1] == ["once_per_turn at link_rate"]
    assert found["after"] < 0.5 * found["before"]
