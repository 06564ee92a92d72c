"""What a mass on a guide can have, compared with a second book; its signals, its equation and the rows that count."""

import math

import numpy as np
import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.machine import Recording
from ranger_sim.sysid.machines.positioning import Positioning
from ranger_sim.sysid.weak_form import WeakForm, way_between_rows
from tests.sysid.books import RUNS, TIME_S, Row, behind, bend, hold, noise, positive, table, waves

SIGNALS = noise(2, ("x", "v", "sgn_v", "dF", "F"), 0.1)
SMALL = {name: 0.3 * values for name, values in SIGNALS.items()}
GUIDE = ("guide", "mechanical")


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
        Row("direction_friction", *GUIDE, ("viscous_Ns_per_m",), force(lambda p: abs(v))),
        Row("drag", *GUIDE, ("quadratic_Ns2_per_m2",), force(lambda p: np.sign(v) * v * v)),
        Row("stribeck", *GUIDE, ("excess_N",), force(lambda p: sign * np.exp(-np.square(v / p["speed_m_per_s"]))),
            slow, **positive("excess_N")),
        Row("presliding", *GUIDE, ("friction_N",), force(lambda p: bend(v, p["slide_m"]) - sign),
            [{"slide_m": way} for way in (1e-4, 3e-4, 1e-3, 3e-3, 0.01)], form="by the way", **positive("friction_N")),
        Row("presliding", *GUIDE, ("friction_N",), force(lambda p: -sign * np.exp(-np.square(v / p["speed_m_per_s"]))),
            slow, form="by the speed", **positive("friction_N")),
        Row("sensor_lag", "drive", "timing", ("time_constant_s",),
            force(lambda p: (s["F"] - after(s["F"], p["delay_s"])) / p["delay_s"] if p["delay_s"] else -s["dF"]),
            [{"delay_s": 0.01 * n} for n in (0, -10, -6, -4, -3, -2, -1, 1, 2, 3, 4, 6, 10)]),
        # screws of 1 to 30 mm a turn, by half a millimetre
        Row("once_per_turn", *GUIDE, ("cosine_N", "sine_N"),
            force(lambda p: waves(2.0 * math.pi / p["pitch_m"] * s["x"])),
            [{"pitch_m": 0.001 + 0.0005 * n} for n in range(59)]),
        Row("friction_warm_up", *GUIDE, ("N_per_m",),
            force(lambda p: -sign * behind(abs(v), p["time_constant_s"])), heats, **positive("N_per_m")),
    ]  # fmt: skip


def test_a_guide_can_have_what_the_book_says():
    recordings = [Recording(table(), SMALL, {}), Recording(table(), SIGNALS, {})]
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
        turns[at - 2 : at + 4] = True
    ends = np.arange(len(t))
    counted = (np.abs(v) > 0.01 * 0.3) & ~turns & (ends >= 2) & (ends < len(t) - 2)
    unsure = np.abs(np.abs(v) - 0.01 * 0.3) < 1e-4  # the fastest speed is that of the sample
    assert np.array_equal(force.valid[~unsure], counted[~unsure]) and not force.valid.all()
    assert force.response[inside] == pytest.approx(35.15065188 * 4.0 * np.cos(1.5 * t)[inside], abs=1e-3)
    s = made.signals
    assert s["x"] is run["position_m"] and s["v"] is viscous and s["a"] is mass and s["F"] is force.response
    assert s["t"] == pytest.approx(t - 5.0, abs=1e-12) and s["sgn_v"] is coulomb
    assert np.allclose(s["dF"][1:-1], np.gradient(force.response, 0.002)[1:-1])
    assert np.array_equal(made.regimes["forward"], v > 0.0) and np.array_equal(made.regimes["backward"], v < 0.0)
    assert np.array_equal(made.regimes["fast"], np.abs(viscous) > 0.2 * top)
    assert np.array_equal(made.regimes["low speed"], ~made.regimes["fast"])
    assert made.between_rows == {"voltage_V": "straight line"}
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


def test_an_input_that_is_held_is_found_to_be():
    """The same motion with a force that stays from row to row at 100 Hz, and with one on straight lines."""
    t = 0.01 * np.arange(2000)
    force = np.sin(2.0 * t) + np.sin(7.3 * t)
    weak = WeakForm(Table(t, {}, (slice(0, 2000),)), np.zeros(2000), 0.01)
    for made, name in ((weak.held, "held"), (weak.straight, "straight line")):
        response = made(force)
        found, way = way_between_rows(weak, force, np.column_stack([response]), weak.complete)
        assert way == name and np.array_equal(found, response)


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
