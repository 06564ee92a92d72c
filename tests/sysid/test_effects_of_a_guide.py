"""What a mass on a guide can have, compared with a second book; its signals, its equation and the rows that count."""

import math

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.machines.positioning import GuideRecording, Positioning
from ranger_sim.sysid.weak_form import WeakForm, way_between_rows
from tests.sysid.books import RUNS, STEP_S, TIME_S, Row, behind, bend, hold, noise, positive, table

SIGNALS = noise(2, ("x", "v", "sgn_v", "dF", "F"), 0.1)
SMALL = {name: 0.3 * values for name, values in SIGNALS.items()}
GUIDE = ("guide", "mechanical")
PLACE = 0.01 * SIGNALS["x"]
EIGHTHS = np.arange(-8, 9) / 8.0
TRIANGLE = (1.0 - np.abs(EIGHTHS)) / np.sum(1.0 - np.abs(EIGHTHS))


def mean(of, order=3, values=PLACE, slope=0):
    """Sum by the triangle of a row to either side, in eighths of a row, of what is made of a spline; an end stays."""
    out = np.zeros(len(values))
    for run in RUNS:
        rows = np.arange(run.stop - run.start)
        spline = make_interp_spline(rows, values[run], k=order)
        for row in rows:
            places = np.clip(row + EIGHTHS, 0, rows[-1])
            out[run.start + row] = TRIANGLE @ of(spline(places, nu=slope) / STEP_S**slope)
    return out


def of_rate(of):
    return mean(of, slope=1)


def slow_at(shape):
    return lambda w: np.sign(w) * np.exp(-np.square(w / shape["speed_m_per_s"]))


def straight(values):
    return mean(lambda at: at, 1, values)


def after(values, delay_s):
    """So much later, on straight lines, run by run; an end stays."""
    return np.concatenate([np.interp(TIME_S[run] + delay_s, TIME_S[run], values[run]) for run in RUNS])


def book():
    s = SIGNALS
    v, sign = s["v"], s["sgn_v"]
    top = float(np.quantile(abs(v), 0.98))
    slow = [{"speed_m_per_s": part * top / 100.0} for part in (2, 4, 8, 16, 30)]
    heats = [{"time_constant_s": each} for each in (3.0, 10.0, 30.0, 100.0)]

    def force(make):
        return lambda shape: {"force": make(shape)}

    return [
        Row("direction_friction", *GUIDE, ("viscous_Ns_per_m",), force(lambda p: of_rate(abs))),
        Row("drag", *GUIDE, ("quadratic_Ns2_per_m2",), force(lambda p: of_rate(lambda w: np.sign(w) * w * w))),
        Row("stribeck", *GUIDE, ("excess_N",), force(lambda p: of_rate(slow_at(p))),
            slow, **positive("excess_N")),
        Row("presliding", *GUIDE, ("friction_N",), force(lambda p: straight(bend(v, p["slide_m"])) - sign),
            [{"slide_m": way} for way in (1e-4, 3e-4, 1e-3, 3e-3, 0.01)], form="by the way", **positive("friction_N")),
        Row("presliding", *GUIDE, ("friction_N",), force(lambda p: -of_rate(slow_at(p))),
            slow, form="by the speed", **positive("friction_N")),
        Row("sensor_lag", "drive", "timing", ("time_constant_s",),
            force(lambda p: (s["F"] - after(s["F"], p["delay_s"])) / p["delay_s"] if p["delay_s"] else -s["dF"]),
            [{"delay_s": 0.01 * n} for n in (0, -10, -6, -4, -3, -2, -1, 1, 2, 3, 4, 6, 10)]),
        # screws of 1 to 30 mm a turn, by half a millimetre
        Row("once_per_turn", *GUIDE, ("cosine_N", "sine_N"),
            force(lambda p: np.stack([mean(lambda x, wave=wave: wave(2.0 * math.pi / p["pitch_m"] * x))
                                      for wave in (np.cos, np.sin)], axis=1)),
            [{"pitch_m": 0.001 + 0.0005 * n} for n in range(59)]),
        Row("friction_warm_up", *GUIDE, ("N_per_m",),
            force(lambda p: straight(-sign * behind(abs(v), p["time_constant_s"]))), heats, **positive("N_per_m")),
    ]  # fmt: skip


def test_a_guide_can_have_what_the_book_says():
    weak = WeakForm(table(), PLACE, 0.0037)
    recordings = [GuideRecording(table(), each, {}, weak=weak) for each in (SMALL, SIGNALS)]
    hold(Positioning().effects(recordings), book(), lambda effect, shape: effect.columns(recordings[1], shape, {}))


def swung(step_s=0.002, seconds=8.0):
    t = 5.0 + step_s * np.arange(round(seconds / step_s))
    columns = {"position_m": 0.2 * np.sin(1.5 * t), "voltage_V": 4.0 * np.cos(1.5 * t)}
    return Table(t, columns, (slice(0, len(t)),), "guide")


def test_the_balance_of_a_guide_is_force_against_mass_and_friction():
    """Of a sine of 1.5 rad/s the mean under a triangle of +-4 ms is the sine, less three parts in a million."""
    run = swung()
    t = run.time_s
    made = Positioning().prepare(run)
    force = made.equations["force"]
    v, a = 0.3 * np.cos(1.5 * t), -0.45 * np.sin(1.5 * t)
    assert list(force.columns) == [each.name for each in Positioning.parameters]
    mass, viscous, coulomb, offset = force.columns.values()
    inside = slice(2, -2)
    assert np.allclose(mass[inside], a[inside], atol=5e-6) and np.allclose(viscous[inside], v[inside], atol=5e-6)
    top = 0.3
    # a hundredth of the fastest speed is near standstill, a quarter of that turns the sign
    far = np.abs(v) > 0.02 * top
    assert np.allclose(coulomb[far], np.sign(v)[far], atol=1e-5)
    assert np.array_equal(offset, np.ones(len(t)))
    turns = np.zeros(len(t), dtype=bool)
    for at in np.flatnonzero(np.diff(np.sign(v))):
        turns[at - 3 : at + 5] = True
    ends = np.arange(len(t))
    counted = (np.abs(v) > 0.025 * 0.3) & ~turns & (ends >= 2) & (ends < len(t) - 2)
    unsure = np.abs(np.abs(v) - 0.025 * 0.3) < 2e-4  # the fastest speed is that of the sample
    assert np.array_equal(force.valid[~unsure], counted[~unsure]) and not force.valid.all()
    assert force.response[inside] == pytest.approx(35.15065188 * 4.0 * np.cos(1.5 * t)[inside], abs=1e-3)
    s = made.signals
    assert s["x"] is run["position_m"] and s["v"] is viscous and s["a"] is mass and s["F"] is force.response
    assert s["t"] == pytest.approx(t - 5.0, abs=1e-12) and s["sgn_v"] is coulomb
    assert np.allclose(s["dF"][1:-1], np.gradient(force.response, 0.002)[1:-1])
    assert np.array_equal(made.regimes["forward"], v > 0.0) and np.array_equal(made.regimes["backward"], v < 0.0)
    assert np.array_equal(made.regimes["fast"], np.abs(viscous) > 0.2 * top)
    assert np.array_equal(made.regimes["low speed"], ~made.regimes["fast"])
    assert made.between_rows == {"voltage_V": "smooth"}
    # the diagnosis chooses the band
    assert (made.width, made.every, made.noise_by_candidates) == (0.0, 1, True)
    halved = Positioning(0.5 * 35.15065188).prepare(run).equations["force"].response
    assert halved == pytest.approx(0.5 * force.response)
    generic = Positioning().generic(made)
    assert {name: list(each) for name, each in generic.items()} == {"force": ["v", "a", "x", "t"]}
    assert all(generic["force"][name] is s[name] for name in generic["force"])


def test_the_speed_lies_under_a_triangle_of_3_7_ms():
    """Of a kink of the position at steps of 0.1 ms the speed is the triangle's integral: half way in the middle."""
    t = 0.0001 * np.arange(8000)
    made = (
        Positioning()
        .prepare(Table(t, {"position_m": 0.5 * np.abs(t - 0.4), "voltage_V": t}, (slice(0, 8000),)))
        .signals
    )
    assert made["a"].max() == pytest.approx(1.0 / 0.0037, rel=1e-9)  # a step of 1 m/s, at the triangle's tip
    early, late = made["v"][4000 - 19], made["v"][4000 + 18]
    assert made["v"][4000] == pytest.approx(0.0, abs=1e-9)
    assert late == pytest.approx(0.5 - (1.0 - 18.0 / 37.0) ** 2 / 2.0, abs=2e-3)
    assert early == pytest.approx(-0.5 + (1.0 - 19.0 / 37.0) ** 2 / 2.0, abs=2e-3)


@pytest.mark.parametrize("name", ["held", "straight line", "smooth"])
def test_the_way_of_an_input_from_row_to_row_is_found(name):
    """The same numbers at 100 Hz with a force that stays from row to row, on straight lines and on a cubic."""
    t = 0.01 * np.arange(2000)
    force = np.sin(2.0 * t) + np.sin(17.3 * t)
    weak = WeakForm(Table(t, {}, (slice(0, 2000),)), np.zeros(2000), 0.01)
    response = {"held": weak.held, "straight line": weak.straight, "smooth": weak.smooth}[name](force)
    noisy = response + 1e-3 * generator(5, "way of an input").normal(size=2000)
    way = way_between_rows(weak, force, np.column_stack([noisy]), weak.complete)
    assert way.name == name and np.array_equal(way.mean, response)
    assert np.mean(way.sure) > 0.99


def test_rows_about_a_corner_between_two_rows_do_not_count_unless_the_input_is_held():
    """A command that ends at its limit a third of a row after row 100, and steps a third after row 200."""
    rows, truth = np.arange(300), np.arange(300 * 48) / 48.0
    fine = np.minimum(0.05 * truth, 0.05 * (100.0 + 1.0 / 3.0)) + 2.0 * (truth > 200.0 + 1.0 / 3.0)
    column = fine[::48]
    run = Table(0.01 * rows, {}, (slice(0, 300),))
    weak = WeakForm(run, np.zeros(300), 0.01)
    triangle = np.convolve(np.ones(48), np.ones(48)) / 48.0**2
    true = np.convolve(fine, triangle, mode="same")[::48] + 1e-3 * generator(6, "corner").normal(size=300)
    way = way_between_rows(weak, column, np.column_stack([true, np.ones(300)]), weak.complete)
    off = np.abs(way.mean - true)[2:-2] > 5e-3
    assert np.count_nonzero(off) >= 4
    assert not np.any(off & way.sure[2:-2]) and np.count_nonzero(~way.sure) < 20
    held = way_between_rows(weak, column, np.column_stack([weak.held(column)]), weak.complete)
    assert held.name == "held" and held.sure.all()


def test_a_ripple_has_its_own_size_where_the_mass_moves_a_quarter_of_it_in_a_row():
    """At 0.5 m/s and 100 Hz a mean over a ripple of 20 mm is a fifth smaller than the ripple: (sin x / x)^2 at pi/4."""
    t = 0.01 * np.arange(400)
    place = 0.5 * t
    run = Table(t, {"position_m": place, "voltage_V": np.sin(t)}, (slice(0, 400),), "guide")
    made = Positioning().prepare(run)
    ripple = next(each for each in Positioning().effects([made]) if each.cause == "once_per_turn")
    size = ripple.columns(made, {"pitch_m": 0.02}, {})["force"][2:-2]
    assert np.hypot(*size.T) == pytest.approx(np.full(396, 8.0 / math.pi**2), rel=0.01)


def test_means_under_the_triangle_are_those_of_their_definition():
    """A step at row 5: held it has the weight of all that comes after, on straight lines a sixth more at its sides."""
    t = 0.01 * np.arange(12)
    step = (np.arange(12) >= 5).astype(float)
    weak = WeakForm(Table(t, {}, (slice(0, 12),)), t**3, 0.01)
    assert weak.complete.tolist() == [False, *[True] * 10, False]
    assert weak.held(step)[3:8] == pytest.approx([0.0, 0.0, 0.5, 1.0, 1.0], abs=0.01)
    assert weak.straight(step)[3:8] == pytest.approx([0.0, 1.0 / 6.0, 5.0 / 6.0, 1.0, 1.0], abs=0.01)
    assert weak.acceleration[1:-1] == pytest.approx(6.0 * t[1:-1])
    assert weak.of_rate()[1:-1] == pytest.approx(3.0 * t[1:-1] ** 2 + 0.01**2 / 2.0, rel=0.02)


def test_a_guide_that_rests_or_has_no_voltage_is_reported():
    rest = Table(
        TIME_S, {"position_m": np.full(len(TIME_S), 0.3), "voltage_V": TIME_S}, (slice(0, len(TIME_S)),), "log"
    )
    with pytest.raises(UserError, match="log: position_m does not move"):
        Positioning().prepare(rest)
    with pytest.raises(UserError, match="log: positioning needs voltage_V; there are position_m"):
        Positioning().prepare(Table(TIME_S, {"position_m": TIME_S}, (slice(0, len(TIME_S)),), "log"))
