"""How an input goes from a row to the next is found by likelihood, and a sound machine is silent with each way."""

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid import signals
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.free_simulation import Term, filtered, into
from ranger_sim.sysid.free_simulation.fit import TrajectoryFit
from ranger_sim.sysid.pipeline import diagnose
from tests.sysid.test_noise_floor import Disc, STEP_s

ROWS, FINER, NOISE = 1500, 50, 0.02
WAYS = {
    "held": lambda v, after, share: v,
    "straight line": lambda v, after, share: v + share * (after - v),
    "mean of the step before the row": lambda v, after, share: after,
}


def spun(seed, way):
    """A disc whose voltage is another one in every row, w' = 5 V - w in 50 parts of a row."""
    random = generator(seed, "ways between rows")
    voltage = random.uniform(-6.0, 6.0, ROWS + 1)
    keeps, speed, now = np.exp(-STEP_s / FINER), np.zeros(ROWS), 0.0
    for k in range(ROWS):
        speed[k] = now
        for part in range(FINER):
            volts = WAYS[way](voltage[k], voltage[k + 1], (part + 0.5) / FINER)
            now = keeps * now + (1.0 - keeps) * 5.0 * volts
    columns = {"voltage_V": voltage[:-1], "speed_rad_per_s": speed + NOISE * random.normal(size=ROWS)}
    return Table(STEP_s * np.arange(ROWS), columns, (slice(0, ROWS),), f"{way} {seed}", {})


@pytest.mark.parametrize("way", WAYS)
def test_the_way_of_a_rough_input_is_found_and_nothing_is_named(way):
    result = diagnose(Disc(), [spun(3, way)], [spun(4, way)]).result
    assert not result.detected and result.evidence.above_noise_floor == ()
    assert result.evidence.between_rows == {f"{way} 3": {"voltage": way}}
    gain = result.evidence.parameters["gain"]
    assert gain.ci95[0] < 5.0 < gain.ci95[1]


def test_a_smooth_input_has_one_way_only():
    time_s = STEP_s * np.arange(ROWS)
    columns = {"voltage_V": np.sin(time_s), "speed_rad_per_s": np.cos(time_s)}
    fit = TrajectoryFit(Disc(), Table(time_s, columns, (slice(0, ROWS),), "smooth", {}))
    assert len(fit.simulator.ways()) == 1 and fit.simulator.numerics.way("voltage") == "cubic"


def test_a_jump_is_in_the_step_in_which_it_is_and_in_its_neighbours():
    column = np.repeat([0.0, 3.0, 1.0], 20)
    table = Table(np.arange(60.0), {}, (slice(0, 60),), "steps", {})
    expected = np.zeros(60)
    expected[18:21], expected[38:41] = 3.0, 2.0
    assert signals.jumps(table, column).tolist() == expected.tolist()


class Averaged(Disc):
    """The disc, whose logger is known to write means, and whose sensor is known to have no lag."""

    mean_inputs = ("voltage",)
    impossible = ("sensor_lag",)

    def terms(self, recordings):
        """A lag of 50 ms of what drives it, independent of the parameters as a free candidate is."""

        def make(r, shape, values):
            return {into("voltage"): (filtered(r.table, r.signals["voltage"], 0.05) - r.signals["voltage"]) / 0.05}

        return [Term("actuator_lag", "disc", "input", ("lag_s",), make, independent=True)]


def test_a_declared_mean_is_not_chosen_and_stays_one_where_the_input_is_smooth():
    time_s = STEP_s * np.arange(ROWS)
    columns = {"voltage_V": np.sin(time_s), "speed_rad_per_s": np.cos(time_s)}
    fit = TrajectoryFit(Averaged(), Table(time_s, columns, (slice(0, ROWS),), "smooth", {}))
    assert len(fit.simulator.ways()) == 1
    assert fit.simulator.numerics.way("voltage") == "mean of the step before the row"


def test_a_lag_of_the_drive_is_named_where_the_sensor_is_known_to_have_none():
    """The voltage behind a low-pass of 50 ms, by finer steps; rows have the means of what entered it."""

    def lagging(seed):
        table, random = spun(seed, "mean of the step before the row"), generator(seed, "lag")
        voltage, speed, now, behind = table["voltage_V"], np.zeros(ROWS), 0.0, 0.0
        keeps, follows = np.exp(-STEP_s / FINER), np.exp(-STEP_s / FINER / 0.05)
        for k in range(1, ROWS):
            for _ in range(FINER):
                behind = follows * behind + (1.0 - follows) * voltage[k]
                now = keeps * now + (1.0 - keeps) * 5.0 * behind
            speed[k] = now
        shown = {"voltage_V": voltage, "speed_rad_per_s": speed + NOISE * random.normal(size=ROWS)}
        return Table(table.time_s, shown, table.runs, f"lag {seed}", {})

    found = diagnose(Averaged(), [lagging(3)], [lagging(4)]).result
    assert [each.name for each in found.causes] == ["actuator_lag"]
    low, high = found.causes[0].parameters["lag_s"].ci95
    assert low < 0.05 < high < 1.02 * low
