"""What a mass on a guide can have, compared with a second book; its signals, its equation and the rows that count."""

import math

import numpy as np
import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.machine import Recording
from ranger_sim.sysid.machines.positioning import Positioning
from tests.sysid.books import TIME_S, Row, behind, bend, hold, noise, positive, table, waves

SIGNALS = noise(2, ("x", "v", "sgn_v", "dF"), 0.1)
SMALL = {name: 0.3 * values for name, values in SIGNALS.items()}
GUIDE = ("guide", "mechanical")


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
        Row("sensor_lag", "drive", "timing", ("time_constant_s",), force(lambda p: -s["dF"])),
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
    """A sine of 1.5 rad/s under a Gaussian of 1.5 ms is itself; its slope at steps of 2 ms to a part in a thousand."""
    run = swung()
    t = run.time_s
    made = Positioning().prepare(run)
    inside = slice(50, -50)
    force = made.equations["force"]
    v, a = 0.3 * np.cos(1.5 * t), -0.45 * np.sin(1.5 * t)
    assert list(force.columns) == [each.name for each in Positioning.parameters]
    mass, viscous, coulomb, offset = force.columns.values()
    assert np.allclose(mass[inside], a[inside], atol=5e-4) and np.allclose(viscous[inside], v[inside], atol=5e-4)
    top = np.quantile(np.abs(viscous), 0.98)
    # a hundredth of the fastest speed is near standstill, a quarter of that turns the sign
    assert np.allclose(coulomb, np.tanh(viscous / (0.0025 * top)))
    assert np.array_equal(offset, np.ones(len(t)))
    assert np.array_equal(force.valid, np.abs(viscous) > 0.01 * top) and not force.valid.all()
    assert force.response == pytest.approx(35.15065188 * 4.0 * np.cos(1.5 * t))
    s = made.signals
    assert s["x"] is run["position_m"] and s["v"] is viscous and s["a"] is mass and s["F"] is force.response
    assert s["t"] == pytest.approx(t - 5.0, abs=1e-12) and s["sgn_v"] is coulomb
    assert np.allclose(s["dF"][1:-1], np.gradient(force.response, 0.002)[1:-1])
    assert np.array_equal(made.regimes["forward"], v > 0.0) and np.array_equal(made.regimes["backward"], v < 0.0)
    assert np.array_equal(made.regimes["fast"], np.abs(viscous) > 0.2 * top)
    assert np.array_equal(made.regimes["low speed"], ~made.regimes["fast"])
    # the diagnosis chooses the band
    assert (made.width, made.every, made.noise_by_candidates) == (0.0, 1, True)
    assert Positioning(2.0).prepare(run).equations["force"].response == pytest.approx(2.0 * run["voltage_V"])
    generic = Positioning().generic(made)
    assert {name: list(each) for name, each in generic.items()} == {"force": ["v", "a", "x", "t"]}
    assert all(generic["force"][name] is s[name] for name in generic["force"])


def test_the_speed_lies_under_a_gaussian_of_a_quarter_of_6_ms():
    """Of a jump of the position at steps of 0.25 ms the speed is that Gaussian, whose height gives its width."""
    t = 0.00025 * np.arange(4000)
    jump = np.where(t < 0.5, 0.0, 0.01)
    made = Positioning().prepare(Table(t, {"position_m": jump + 1e-4 * t, "voltage_V": t}, (slice(0, 4000),)))
    assert made.signals["v"].max() == pytest.approx(0.01 / (0.0015 * math.sqrt(2.0 * math.pi)), rel=0.01)


def test_a_guide_that_rests_or_has_no_voltage_is_reported():
    rest = Table(
        TIME_S, {"position_m": np.full(len(TIME_S), 0.3), "voltage_V": TIME_S}, (slice(0, len(TIME_S)),), "log"
    )
    with pytest.raises(UserError, match="log: position_m does not move"):
        Positioning().prepare(rest)
    with pytest.raises(UserError, match="log: positioning needs voltage_V; there are position_m"):
        Positioning().prepare(Table(TIME_S, {"position_m": TIME_S}, (slice(0, len(TIME_S)),), "log"))
