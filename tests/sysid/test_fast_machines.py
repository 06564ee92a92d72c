"""Motion within a tenth of a second is not noise, and a lost row of a changing input is not the machine's."""

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid import signals
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.pipeline import diagnose
from tests.sysid.machines_of_a_user import ElasticJoint
from tests.sysid.other_machines import elastic_joint

STEP_s = 2.5e-4
TIME_s = STEP_s * np.arange(8000)


def _table(**columns):
    return Table(TIME_s, columns, (slice(0, len(TIME_s)),), "fast")


@pytest.mark.parametrize(
    ("hertz", "noise"), [(0.5, 0.01), (5.0, 0.01), (30.0, 0.01), (100.0, 0.01), (0.5, 1e-4), (5.0, 1e-4), (30.0, 1e-4)]
)
def test_noise_is_measured_next_to_a_motion_of_any_frequency(hertz, noise):
    """Within 60 %: of a motion, what is less than the noise counts as noise. Over 0.1 s all is 0.02 to 1."""
    column = np.sin(2.0 * np.pi * hertz * TIME_s) + noise * generator(1, "fast").normal(size=len(TIME_s))
    assert signals.roughness(_table(a=column), column) == pytest.approx(noise, rel=0.6)


def test_noise_with_a_memory_is_seen_whole():
    """An autoregression of 0.9 has its whole size only beyond some twenty rows."""
    shocks = generator(2, "fast").normal(size=len(TIME_s))
    column = np.zeros(len(TIME_s))
    for k in range(1, len(column)):
        column[k] = 0.9 * column[k - 1] + shocks[k]
    assert signals.roughness(_table(a=column), column) == pytest.approx(float(np.std(column)), rel=0.15)


def test_counts_of_a_slow_channel_are_seen():
    """A line rounded to 0.01 that needs 40 rows for a count: errors are even within a count, half of them below 1/4."""
    column = np.round(TIME_s, 2)
    assert signals.roughness(_table(a=column), column) == pytest.approx(0.25 * 0.01 / 0.6745, rel=0.1)


def _without(rows, **columns):
    kept = np.setdiff1d(np.arange(len(TIME_s)), rows)
    return Table(TIME_s[kept], {name: each[kept] for name, each in columns.items()}, (slice(0, len(kept)),), "lost")


def test_a_lost_row_is_unmeasured_and_lies_on_a_cubic():
    smooth = np.sin(2.0 * np.pi * 20.0 * TIME_s)
    even = signals.uniform(_without([1000, 3333], a=smooth))
    assert len(even) == len(TIME_s)
    assert np.flatnonzero(even.unmeasured["a"]).tolist() == [1000, 3333]
    assert np.max(np.abs(even["a"] - smooth)) < 1e-6  # straight lines miss by 1e-4


def test_a_run_ends_where_a_held_input_changes_over_a_lost_row():
    """Levels of 40 rows: the one lost at the end of a level may have had the next, those within have the level."""
    steps = np.floor(TIME_s / 0.01)
    table = _without([1020, 1999, 3333], u=steps)
    cut = signals.cut_where_lost(table, ["u"], held=False).runs
    assert [run.start for run in cut] == [0, 1998]  # a row is lost before it
    assert table.time_s[1998] == pytest.approx(2000 * STEP_s)
    assert signals.cut_where_lost(table, [], held=True).runs == table.runs


def test_a_smooth_input_goes_on_over_a_lost_row_unless_it_is_held():
    table = _without([1020], u=np.sin(2.0 * np.pi * 20.0 * TIME_s))
    assert len(signals.cut_where_lost(table, ["u"], held=False).runs) == 1
    assert len(signals.cut_where_lost(table, ["u"], held=True).runs) == 2


def test_a_sound_joint_of_which_a_twelfth_of_the_rows_is_lost_is_silent():
    runs = []
    for seed in (1, 101):
        whole = elastic_joint("none", 0.0, seed, seconds=6.0)
        kept = np.flatnonzero(generator(seed, "lost").uniform(size=len(whole)) > 1.0 / 12.0)
        columns = {name: column[kept] for name, column in whole.columns.items()}
        table = Table(whole.time_s[kept], columns, (slice(0, len(kept)),), whole.name, whole.resolution)
        runs.append(table)
    assert not diagnose(ElasticJoint(), [runs[0]], [runs[1]]).result.detected
