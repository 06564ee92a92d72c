"""A term without a cause, learned where nothing of the catalogue explains a misfit."""

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.machine import Equation, Known, Quantity, Recording
from ranger_sim.sysid.pipeline import diagnose
from ranger_sim.sysid.residual_term import learn

SIZE = 6000
NOISE = 0.05


def hidden(x):
    """What no cause of the machine explains: a bump between 0 and 1."""
    return 0.2 * np.sin(np.pi * np.clip(x, 0.0, 1.0))


class Slide:
    """force = slope x + noise, and an empty catalogue."""

    name = "slide"
    quantities = (Quantity("x_m", "m", "way"), Quantity("force_N", "N", "force"))
    parameters = (Known("slope_N_per_m", "N/m", 1.0, 0.0, 10.0, "of the spring"),)

    def prepare(self, table):
        x = table["x_m"]
        everywhere = np.ones(len(table), dtype=bool)
        columns = {"slope_N_per_m": x, "zero_N": np.ones_like(x)}
        made = Equation("force", "M", "mechanical", "N", table["force_N"], columns, everywhere)
        # noise that the machine knows: a learned term belongs to the benches, which do
        return Recording(table, {"x": x}, {"force": made}, lags=(0, 10), noise_by_candidates=False)

    def effects(self, recordings):
        return []

    def generic(self, recording):
        return {"force": {"x": recording.signals["x"]}}


def recorded(seed, bump, reach=2.0):
    rng = generator(seed, "slide")
    x = reach * np.sin(np.arange(SIZE) * 0.013) + 0.05 * np.sin(np.arange(SIZE) * 0.19)
    force = 1.1 * x + 0.3 + bump * hidden(x) + NOISE * rng.normal(size=SIZE)
    return Table(np.arange(SIZE) * 1e-3, {"x_m": x, "force_N": force}, (slice(0, SIZE),), f"run{seed}")


def test_a_sound_machine_has_no_learned_term():
    answer = diagnose(Slide(), [recorded(1, 0.0)], [recorded(2, 0.0)]).answer
    assert not answer["detected"]
    assert answer["evidence"]["residual_term"] is None


def test_what_no_cause_explains_is_learned_and_wins_on_data_that_it_has_not_seen():
    answer = diagnose(Slide(), [recorded(1, 1.0)], [recorded(2, 1.0)]).answer
    assert answer["detected"]
    assert answer["abstained"]
    assert answer["causes"] == []
    term = answer["evidence"]["residual_term"]
    assert (term["equation"], term["unit"], term["over"]) == ("force", "N", ["x"])
    without, left = term["holdout_rms"]
    # rms of the bump beside its own line: 0.052; with the noise 0.072
    assert without == pytest.approx(0.072, rel=0.1)
    assert left == pytest.approx(NOISE, rel=0.1)
    # the same table by one plain least squares: line and cell means together
    table = recorded(1, 1.0)
    x, force = table["x_m"], table["force_N"]
    cell = np.searchsorted(term["edges"][0], x, side="right")
    line = np.column_stack([x, np.ones_like(x)])
    whole = np.hstack([line, np.eye(len(term["value"]))[cell]])
    wanted = whole @ np.linalg.lstsq(whole, force, rcond=None)[0]
    ours = np.array(term["value"])[cell, 0]
    ours = ours + line @ np.linalg.lstsq(line, force - ours, rcond=None)[0]
    # 600 samples a cell: 0.05 / sqrt(600) = 0.002; five of them
    assert ours == pytest.approx(wanted, abs=0.01)


def test_outside_its_domain_the_learned_term_is_nothing():
    """Trained to 0.85 and held out to 2: beyond its training the base stands alone."""
    inside = diagnose(Slide(), [recorded(1, 1.0, reach=0.8)], [recorded(2, 1.0, reach=2.0)])
    term = inside.answer["evidence"]["residual_term"]
    assert term["domain"][0][1] < 0.9
    again = learn(inside.machine, inside.recordings, inside.plain, inside.before)
    column = again.column(inside.machine, Slide().prepare(recorded(2, 1.0, reach=2.0)))[:, 0]
    x = recorded(2, 1.0, reach=2.0)["x_m"]
    assert np.all(column[np.abs(x) > 0.9] == 0.0)
    assert np.any(column[np.abs(x) < 0.8] != 0.0)
