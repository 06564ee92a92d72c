"""A channel that is cut off: its rows do not count, or the recording is refused; nothing is called sound by it."""

import dataclasses

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import signals
from ranger_sim.sysid.dataset import Channel, Dataset, Table
from ranger_sim.sysid.pipeline import diagnose
from tests.sysid.robot_joint import Joint
from tests.sysid.test_scores_grow import run


def cut(table, share):
    """The current cut off at this share of its largest magnitude."""
    current = table["current_A"]
    limit = share * float(np.max(np.abs(current)))
    return dataclasses.replace(table, columns=table.columns | {"current_A": np.clip(current, -limit, limit)})


def test_the_rows_that_are_cut_off_are_found_and_no_others():
    table = run(3, 0.5, "drag", 0.0)
    assert not np.any(signals.clipped(table, table["current_A"]))
    shorter = cut(table, 0.7)
    limit = float(np.max(shorter["current_A"]))
    found = signals.clipped(shorter, shorter["current_A"])
    assert np.all(np.abs(shorter["current_A"][found]) == limit)
    assert np.count_nonzero(found) > 0.8 * np.count_nonzero(np.abs(shorter["current_A"]) == limit)


def test_a_machine_that_rests_at_the_end_of_its_way_is_not_cut_off():
    table = run(3, 0.0, "drag", 0.0)
    time_s = table.time_s
    way = np.round(np.clip(1.0 - np.cos(0.8 * time_s), 0.0, 1.99999), 5)  # slows down towards each end, in counts
    assert not np.any(signals.clipped(table, way))


def test_an_inertia_is_right_where_a_tenth_of_the_current_is_cut_off():
    """0.06 A s^2/rad; with the rows that are cut off it comes out a quarter too small."""
    table = cut(run(5, 0.0, "drag", 0.0), 0.7)
    found = diagnose(Joint(), [table])
    value = found.result.evidence.parameters["inertia_As2_per_rad"]
    assert value.ci95[0] < 0.06 < value.ci95[1] and not found.result.causes


def test_a_recording_that_is_cut_off_for_half_of_its_rows_is_refused():
    table = cut(run(5, 0.0, "drag", 0.0), 0.25)
    with pytest.raises(UserError, match=r"joint 5: current_A: \d+\.\d% of its values are cut off"):
        diagnose(Joint(), [table])


def swinging(limit_rad, count_rad=1e-3, rate_hz=1000.0):
    """An angle in counts that creeps to the end of each of six swings and rests there, cut off at a limit."""
    time_s = np.arange(6 * 1000) / rate_hz
    side = np.where(np.floor(time_s) % 2 == 0, 1.0, -1.0)
    angle = 0.4 * side * (1.0 - 2.0 * np.exp(-(time_s % 1.0) / 0.12))
    shown = count_rad * np.round(np.clip(angle, -limit_rad, limit_rad) / count_rad)
    return Table(time_s, {"angle_rad": shown}, (slice(0, len(time_s)),), "swings", {})


def test_a_joint_that_creeps_to_its_last_count_and_rests_there_is_not_cut_off():
    """It arrives there by a whole count from one row to the next, as fast as it usually moves."""
    table = swinging(1.0)
    assert np.count_nonzero(table["angle_rad"] == np.max(table["angle_rad"])) > 300
    assert not np.any(signals.clipped(table, table["angle_rad"]))


def test_counts_that_are_cut_off_in_mid_swing_are_found():
    table = swinging(0.25)
    found = signals.clipped(table, table["angle_rad"])
    assert np.count_nonzero(found) > 0.8 * np.count_nonzero(np.abs(table["angle_rad"]) == 0.25)


STAMPS_S = np.round(np.arange(1000) * 1.001 - 0.003 * (np.arange(1000) % 7), 3)  # a clock that is off by 0.1 %


def beside(channel, rate_hz=4.0):
    """The channel's table on the stamps of a quicker one."""
    time_s = np.arange(0.0, channel.time_s[-1], 1.0 / rate_hz)
    return Dataset(
        "run", {"quick_V": Channel("quick_V", "V", time_s, np.ones(len(time_s))), channel.name: channel}
    ).table(["quick_V", channel.name])


def made_even(channel):
    """The channel's table on even stamps."""
    return signals.uniform(Dataset("run", {channel.name: channel}).table([channel.name]))


@pytest.mark.parametrize("rows_of, without", [(made_even, 60), (beside, 396)])
def test_a_settled_channel_in_counts_is_not_cut_off_between_uneven_stamps(rows_of, without):
    """A heated body, 20 to 65 C, in counts of 0.3223 C that the log rounds to 0.01 C.

    A row between two samples is in no counts. Without those of the samples, as many of them as `without` were cut off.
    """
    noise = generator(3, "thermometer").normal(0.0, 0.1, 1000)
    counts = np.round((20.0 + 45.0 * (1.0 - np.exp(-STAMPS_S / 120.0)) + noise) / 0.3223)
    table = rows_of(Channel("T_degC", "degC", STAMPS_S, np.round(0.3223 * counts, 2)))
    assert np.count_nonzero(signals.clipped(table, table["T_degC"])) == without
    for part in (table, table.part(slice(0, 900))):
        assert signals.counts_of(part, "T_degC") == pytest.approx(0.3223, rel=1e-3)
        assert not np.any(signals.clipped(part, part["T_degC"], signals.counts_of(part, "T_degC")))


@pytest.mark.parametrize("rows_of", [made_even, lambda channel: beside(channel, 3000.0)])
def test_counts_that_are_cut_off_in_mid_swing_are_found_between_uneven_stamps(rows_of):
    swings = swinging(0.25)
    uneven_s = swings.time_s * 1.001 - 3e-6 * (np.arange(len(swings)) % 7)
    table = rows_of(Channel("angle_rad", "rad", uneven_s, swings["angle_rad"]))
    found = signals.clipped(table, table["angle_rad"], signals.counts_of(table, "angle_rad"))
    assert np.count_nonzero(found) > 0.8 * np.count_nonzero(np.abs(table["angle_rad"]) == 0.25)
