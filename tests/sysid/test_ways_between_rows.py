"""How an input goes from a row to the next is found by likelihood, and a sound machine is silent with each way."""

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid import signals
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.forms import delayed
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


def waved(seed, held, late_rows=0):
    """The disc on a smooth voltage, held from row to row or not, and a speed that is shown `late_rows` late."""
    random = generator(seed, "smooth ways")
    time_s = STEP_s * np.arange(ROWS + 1)
    phases = random.uniform(0.0, 2.0 * np.pi, 3)

    def volts(at_s):
        waves = zip((0.3, 0.9, 2.1), phases, strict=True)
        return sum(2.0 * np.sin(2.0 * np.pi * hertz * at_s + phase) for hertz, phase in waves)

    keeps, speed, now = np.exp(-STEP_s / FINER), np.zeros(ROWS), 0.0
    for k in range(ROWS):
        speed[k] = now
        for part in range(FINER):
            at_s = time_s[k] + (0.0 if held else (part + 0.5) / FINER * STEP_s)
            now = keeps * now + (1.0 - keeps) * 5.0 * volts(at_s)
    speed = np.concatenate((np.zeros(late_rows), speed[: ROWS - late_rows])) + NOISE * random.normal(size=ROWS)
    columns = {"voltage_V": volts(time_s[:-1]), "speed_rad_per_s": speed}
    return Table(time_s[:-1], columns, (slice(0, ROWS),), f"smooth {seed}", {})


@pytest.mark.parametrize(("held", "way"), [(True, "held"), (False, "cubic")])
def test_a_smooth_input_that_a_controller_holds_is_not_a_late_sensor(held, way):
    result = diagnose(Disc(), [waved(3, held)], [waved(4, held)]).result
    assert not result.detected and result.evidence.between_rows == {"smooth 3": {"voltage": way}}


def test_a_sensor_that_is_three_rows_late_is_not_taken_for_half_a_row_of_a_hold():
    result = diagnose(Disc(), [waved(3, False, 3)], [waved(4, False, 3)]).result
    assert result.evidence.between_rows == {"smooth 3": {"voltage": "cubic"}}
    [cause] = result.causes
    low, high = cause.parameters["lag_s"].ci95
    assert cause.name == "sensor_lag" and low < 3.0 * STEP_s < high


@pytest.mark.parametrize("held", [True, False])
def test_next_to_a_late_sensor_a_hold_is_a_part_of_what_is_known_of_the_lag(held):
    """Three rows: late by 3.5 on a cubic or by 3 of what is held, which these data do not show apart."""
    result = diagnose(Disc(), [waved(3, held, 3)], [waved(4, held, 3)]).result
    [cause] = result.causes
    low, high = cause.parameters["lag_s"].ci95
    assert cause.name == "sensor_lag" and low < 3.0 * STEP_s < high
    assert STEP_s < high - low < 1.3 * STEP_s  # half a row either way, and the noise


def test_what_is_late_is_on_cubics_between_the_rows():
    """Of a wave of 40 rows: straight lines are off by (2 pi / 40)^2 / 8 of it, cubics by a hundredth of that."""
    table = Table(0.1 * np.arange(400), {}, (slice(0, 150), slice(150, 400)), "late", {})
    wave = np.sin(2.0 * np.pi / 4.0 * table.time_s)
    found = delayed(table, wave, 0.05)
    true = np.sin(2.0 * np.pi / 4.0 * (table.time_s - 0.05))
    inside = np.ones(400, dtype=bool)
    inside[[0, 150]] = False
    assert found[inside] == pytest.approx(true[inside], abs=3e-5)
    assert found[[0, 150]].tolist() == wave[[0, 150]].tolist()  # nothing is known of before a run


def test_a_smooth_input_is_on_a_cubic_or_held():
    time_s = STEP_s * np.arange(ROWS)
    columns = {"voltage_V": np.sin(time_s), "speed_rad_per_s": np.cos(time_s)}
    fit = TrajectoryFit(Disc(), Table(time_s, columns, (slice(0, ROWS),), "smooth", {}))
    assert [each.way("voltage") for each in fit.simulator.ways()] == ["cubic", "held"]


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
        """A lag of 50 ms of what drives it, in place of the free candidate, which tries others as well."""

        def make(r, shape, values):
            return {into("voltage"): (filtered(r.table, r.signals["voltage"], 0.05) - r.signals["voltage"]) / 0.05}

        return [Term("input_lag", "voltage", "input", ("lag_s",), make, independent=True)]


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
    assert [each.name for each in found.causes] == ["input_lag"]
    low, high = found.causes[0].parameters["lag_s"].ci95
    assert low < 0.05 < high < 1.02 * low


def stepped(seed, at_rows, count_V=0.0):
    """A disc on voltages that stay for 0.2 to 0.6 s, w' = 5 V - w, exactly solved; steps at rows or anywhere between.

    count_V: of the voltage's measurement, whose own noise is a fifth of a count.
    """
    random = generator(seed, "steps between rows")
    ends_s = np.cumsum(random.uniform(0.2, 0.6, 200))
    ends_s = STEP_s * np.round(ends_s / STEP_s) if at_rows else ends_s
    levels = random.uniform(-6.0, 6.0, len(ends_s))
    time_s = STEP_s * np.arange(ROWS)
    speed, voltage, now, since, level = np.zeros(ROWS), np.zeros(ROWS), 0.0, 0.0, 0
    for k, until in enumerate(time_s):
        while ends_s[level] <= until + 1e-9:  # a row at a step shows the new level
            now = 5.0 * levels[level] + (now - 5.0 * levels[level]) * np.exp(-(ends_s[level] - since))
            since, level = ends_s[level], level + 1
        now = 5.0 * levels[level] + (now - 5.0 * levels[level]) * np.exp(-(until - since))
        since, speed[k], voltage[k] = until, now, levels[level]
    if count_V:
        voltage = count_V * np.round(voltage / count_V + 0.2 * random.normal(size=ROWS))
    columns = {"voltage_V": voltage, "speed_rad_per_s": speed + NOISE * random.normal(size=ROWS)}
    return Table(time_s, columns, (slice(0, ROWS),), f"steps {seed}", {})


@pytest.mark.parametrize(("at_rows", "way"), [(True, "held"), (False, "straight line, jumps anywhere inside a step")])
def test_a_step_is_where_the_data_show_it_and_nothing_is_named(at_rows, way):
    """Held until the row that first shows it, a step that was between the rows is half a row late."""
    result = diagnose(Disc(), [stepped(5, at_rows)], [stepped(6, at_rows)]).result
    assert result.evidence.between_rows == {"steps 5": {"voltage": way}}
    assert not result.detected
    for name, true in (("gain", 5.0), ("damping", 1.0)):
        low, high = result.evidence.parameters[name].ci95
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        assert abs(middle - true) < 2.0 * half, name  # 3.9 standard errors


def test_the_rounding_of_a_level_lasts_as_long_as_the_level():
    """1 / sqrt(12) of a count, by the root of a level's rows; a command on whole values is not rounded."""
    table = stepped(5, False, count_V=0.1)
    level_rows = ROWS / (1 + np.count_nonzero(np.abs(np.diff(table["voltage_V"])) > 0.15))
    wanted = 0.1 / np.sqrt(12.0) * np.sqrt(level_rows)
    assert signals.rounding(table, table["voltage_V"]) == pytest.approx(wanted, rel=0.02)
    assert signals.rounding(table, np.round(stepped(5, False)["voltage_V"])) == 0.0
    assert signals.rounding(table, stepped(5, False)["voltage_V"]) == 0.0
    assert signals.rounding(table, np.zeros(ROWS)) == 0.0


def test_a_voltage_in_coarse_counts_shows_nothing_that_is_not_there():
    """A level's rounding moves the speed at rest by up to 0.25 rad/s, twelve times the speed's noise."""
    result = diagnose(Disc(), [stepped(5, False, 0.1)], [stepped(6, False, 0.1)]).result
    assert not result.detected
    low, high = result.evidence.parameters["gain"].ci95
    assert low < 5.0 < high
