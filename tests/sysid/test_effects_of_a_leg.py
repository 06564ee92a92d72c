"""What a swinging leg can have, compared with a second book; its signals, inputs, steps and rows that count."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid.free_simulation import Port
from ranger_sim.sysid.machines.leg_swing import LegSwing
from tests.sysid.books import COUNT, STEP_S, TIME_S, Row, behind, bend, hold, noise, positive, summed, table, waves

SIGNALS = noise(1, ("q", "w", "I", "V", "sgn_w", "sgn_I", "moves", "w_moving", "angle", "dI", "dV"), 2.0)
SIGNALS["t"] = TIME_S - TIME_S[0]
SIGNALS["V"][7] = 0.02 * np.quantile(np.abs(SIGNALS["V"]), 0.98)  # at the edge of the dead time
SMALL = {name: 0.3 * values for name, values in SIGNALS.items()}
HEATS = [{"time_constant_s": each} for each in (3.0, 10.0, 30.0, 100.0, 300.0)]
M, E, S = "mechanical", "electrical", "sensor"


def top(name):
    """The largest value but for outliers: what 98 of 100 samples stay below."""
    return float(np.quantile(np.abs(SIGNALS[name]), 0.98))


def torques():
    s = SIGNALS
    current, w, sign = s["I"], s["w"], s["sgn_w"]
    drives = np.array([1.0 if a * b > 0.0 else 0.0 for a, b in zip(current, w, strict=True)])
    motor, turns = "hip_motor", [{"periods_per_turn": float(n)} for n in range(1, 61)]

    def torque(make):
        return lambda shape: {"torque_Nm": make(shape)}

    return [
        Row("hip_spring_bend", "hip_joint", M, ("cubic_Nm_per_rad3",), torque(lambda p: -s["q"] * s["q"] * s["q"])),
        Row("stribeck", motor, M, ("excess_Nm",),
            torque(lambda p: -sign * np.exp(-np.square(w / p["speed_rad_s"]))),
            [{"speed_rad_s": part * top("w") / 100.0} for part in (1, 2, 4, 8, 16, 30, 50)], **positive("excess_Nm")),
        Row("presliding", motor, M, ("friction_Nm",), torque(lambda p: sign - bend(w, p["slide_rad"])),
            [{"slide_rad": way} for way in (1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1)], **positive("friction_Nm")),
        Row("load_friction", motor, M, ("per_A",), torque(lambda p: -drives * abs(current) * sign)),
        Row("direction_friction", motor, M, ("coulomb_Nm",), torque(lambda p: -abs(sign))),
        Row("direction_friction", motor, M, ("viscous_Nms",), torque(lambda p: -abs(w))),
        Row("friction_warm_up", motor, M, ("Nm_s_per_rad",),
            torque(lambda p: sign * behind(abs(w), p["time_constant_s"])), HEATS, **positive("Nm_s_per_rad")),
        Row("drag", motor, M, ("quadratic_Nms2",), torque(lambda p: -np.sign(w) * w * w), **positive("quadratic_Nms2")),
        Row("cogging", motor, M, ("cosine_Nm", "sine_Nm"),
            torque(lambda p: waves(p["periods_per_turn"] * s["angle"])), turns, phase_is_free=True),
        Row("commutation_ripple", motor, M, ("cosine", "sine"),
            lambda p: {"constant_share": waves(p["periods_per_turn"] * s["angle"])}, turns, phase_is_free=True),
        Row("once_per_turn", "hip_joint", M, ("cosine_Nm", "sine_Nm"),
            torque(lambda p: waves(p["periods_per_turn"] * s["q"])), turns[:3]),
        # the disc of 10 mm radius lies 0.1 mm beside its axis at most
        Row("sensor_lag", "hip_angle_rad", S, ("time_constant_s",), lambda p: {"angle_shown_rad": -w}),
        Row("eccentricity", "hip_angle_rad", S, ("cosine_rad", "sine_rad"),
            lambda p: {"angle_shown_rad": waves(p["periods_per_turn"] * s["q"])},
            [{"periods_per_turn": 1.0}, {"periods_per_turn": 2.0}],
            yes=[{"cosine_rad": 0.007, "sine_rad": -0.007}, {"cosine_rad": 0.0, "sine_rad": 0.0099}],
            no=[{"cosine_rad": 0.008, "sine_rad": -0.008}, {"cosine_rad": -0.0101, "sine_rad": 0.0},
                {"cosine_rad": 0.01, "sine_rad": 0.0}]),
        Row("sensor_lag", "current_A", S, ("time_constant_s",), lambda p: {"current_shown_A": -s["dI"]}),
        Row("clock_drift", "current_A", "timing", ("share",), lambda p: {"current_shown_A": s["t"] * s["dI"]}),
    ]  # fmt: skip


def heated():
    return [
        Row("torque_constant_temperature", "hip_motor", E, ("per_heat",),
            lambda p: {"constant_share": behind(SIGNALS["I"] ** 2, p["time_constant_s"])}, HEATS),
    ]  # fmt: skip


def electric():
    s = SIGNALS
    current, V = s["I"], s["V"]
    top_V = top("V")

    def drop(make):
        return lambda shape: {"drop_V": make(shape)}

    def beyond(p):
        return np.where(V > p["limit_V"], V - p["limit_V"], np.where(V < -p["limit_V"], V + p["limit_V"], 0.0))

    return [
        Row("contact_drop_change", "hip_motor", E, ("change_V",),
            drop(lambda p: s["sgn_I"] * -np.expm1(-abs(current) / p["current_A"])),
            [{"current_A": part * top("I")} for part in (0.1, 0.3, 1.0)]),
        Row("resistance_temperature", "hip_motor", E, ("ohm_per_heat",),
            drop(lambda p: current * behind(current**2, p["time_constant_s"])), HEATS),
        Row("dead_time", "hip_motor", E, ("drop_V",), drop(lambda p: np.where(abs(V) > top_V / 50.0, s["sgn_I"], 0.0))),
        Row("pwm_ripple", "hip_motor", E, ("V_per_V",), drop(lambda p: V - V * abs(V) / top_V)),
        Row("battery_sag", "supply", E, ("per_A",), drop(lambda p: V * abs(current))),
        Row("charge_drift", "supply", E, ("per_As",), drop(lambda p: V * summed(abs(current)))),
        Row("voltage_clip", "voltage_V", E, ("share",), drop(beyond),
            [{"limit_V": part * top_V / 100.0} for part in (50, 60, 70, 80, 90, 95)]),
        Row("sensor_offset", "voltage_V", S, ("offset_V",), drop(lambda p: np.ones(COUNT))),
        Row("sensor_lag", "voltage_V", S, ("time_constant_s",), drop(lambda p: -s["dV"])),
    ]  # fmt: skip


def made(effect, shape):
    return effect.make(SimpleNamespace(table=table(), signals=SIGNALS), shape, {})


def recordings():
    return [SimpleNamespace(table=table(), signals=SMALL), SimpleNamespace(table=table(), signals=SIGNALS)]


def test_a_leg_by_its_current_can_have_what_the_book_says():
    step = Row("current_step_at_zero_duty", "current_A", S, ("offset_A",),
               lambda p: {"current_shown_A": SIGNALS["sgn_I"]})  # fmt: skip
    hold(LegSwing().by_current.terms(recordings()), [*torques(), step, *heated()], made)


def test_a_leg_by_its_voltage_can_have_what_the_book_says():
    near = 0.02 * top("V")
    shown = [
        Row("sensor_offset", "current_A", S, ("offset_A",), lambda p: {"current_shown_A": np.ones(COUNT)}),
        Row("current_step_at_zero_duty", "current_A", S, ("offset_A",),
            lambda p: {"current_shown_A": np.tanh(SIGNALS["V"] / near)}),
    ]  # fmt: skip
    hold(LegSwing().by_voltage.terms(recordings()), [*torques(), *shown, *heated(), *electric()], made)


def test_a_leg_that_hardly_moves_is_asked_at_speeds_and_currents_that_are_some():
    still = SimpleNamespace(table=table(), signals={name: 1e-9 * values for name, values in SIGNALS.items()})
    terms = {(each.cause, each.at): each for each in LegSwing().by_voltage.terms([still])}
    assert [each["speed_rad_s"] for each in terms["stribeck", "hip_motor"].shapes][-1] == pytest.approx(0.015)
    assert [each["current_A"] for each in terms["contact_drop_change", "hip_motor"].shapes][-1] == 1e-3


def test_signals_of_the_leg_are_what_their_names_say():
    along = {name: SIGNALS[name] for name in ("q", "w", "I", "V")} | {"current_A": SIGNALS["I"] + 1.0}
    along["w"] = 0.05 * along["w"]
    by_current = LegSwing().by_current.extra_signals(along, table())
    by_voltage = LegSwing().by_voltage.extra_signals(along, table())
    assert "dV" not in by_current and by_current["I"] is along["I"] and by_voltage["I"] is along["current_A"]
    w = along["w"]
    moves = np.array([1.0 - math.exp(-(each**2) / (2.0 * 0.03**2)) for each in w])
    for found, current in ((by_current, SIGNALS["I"]), (by_voltage, SIGNALS["I"] + 1.0)):
        assert found["sgn_I"].tolist() == [float(np.sign(each)) for each in current]
        assert found["sgn_w"] == pytest.approx(np.tanh(100.0 * w))
        assert found["moves"] == pytest.approx(moves)
        assert found["w_moving"].tolist() == [a if b > 0.5 else 0.0 for a, b in zip(w, moves, strict=True)]
        assert found["angle"] == pytest.approx(66.0 * SIGNALS["q"])
    # slopes behind a Gaussian of 3 ms: of a straight line they are the line's
    line = {name: 2.0 * TIME_S for name in along}
    found = LegSwing().by_voltage.extra_signals(line, table())
    inside = np.r_[5:170, 190:290]
    assert found["dI"][inside] == pytest.approx(2.0) and found["dV"][inside] == pytest.approx(2.0)


def test_a_gaussian_of_3_ms_rounds_what_a_sensor_s_lag_is_multiplied_with():
    """Of a jump at steps of 1 ms the slope is the Gaussian itself: its height gives its width."""
    fine = table()
    fine = type(fine)(0.001 * np.arange(COUNT), {}, (slice(0, COUNT),))
    jump = (np.arange(COUNT) >= 150).astype(float)
    along = {"q": jump, "w": jump, "I": jump, "current_A": jump, "V": jump}
    found = LegSwing().by_voltage.extra_signals(along, fine)
    # between the samples 149 and 150, half a millisecond off either
    height = math.exp(-0.5 * (0.5 / 3.0) ** 2) / (0.003 * math.sqrt(2.0 * math.pi))
    assert found["dI"].max() == pytest.approx(height, rel=0.1) and found["dV"].max() == pytest.approx(height, rel=0.1)


def test_the_current_does_not_count_about_jumps_of_the_voltage_and_turns_of_its_sign():
    V = np.zeros(COUNT)
    V[50:] = 0.9
    V[100:] = 0.931  # more than 3 % of all that it moves
    V[150:] = 0.96  # less
    V[200:] = 1.0
    sign = np.ones(COUNT)
    sign[250:] = -1.0
    sign[280:282] = 0.0
    counted = LegSwing().by_voltage.counts({"V": V, "sgn_I": sign}, table())
    assert list(counted) == ["current_A"]
    wanted = np.ones(COUNT, dtype=bool)
    for place in (50, 100, 200, 250, 280, 282):
        wanted[max(place - 4, 0) : place + 5] = False
    assert np.array_equal(counted["current_A"], wanted)
    assert not wanted[46] and wanted[45] and not wanted[54] and wanted[55]
    assert LegSwing().by_current.counts({"V": V, "sgn_I": sign}, table()) == {}
    at_once = LegSwing().by_voltage.counts({"V": np.linspace(0.0, 1.0, COUNT), "sgn_I": np.ones(COUNT)}, table())
    assert at_once["current_A"].all()


def test_a_misfit_is_looked_for_over_the_motion_and_the_calm_current():
    recording = SimpleNamespace(table=table(), signals=SIGNALS)
    by_current, by_voltage = (each.looked_over(recording) for each in (LegSwing().by_current, LegSwing().by_voltage))
    assert list(by_current) == ["torque_Nm"] and list(by_voltage) == ["torque_Nm", "drop_V"]
    assert list(by_voltage["torque_Nm"]) == ["q", "w", "I", "t"] and list(by_voltage["drop_V"]) == ["I", "w", "t"]
    assert by_voltage["torque_Nm"]["w"] is SIGNALS["w_moving"] and by_voltage["drop_V"]["t"] is SIGNALS["t"]
    # white noise under a Gaussian of 4 samples keeps 1 / (2 sqrt(pi) 4) of its power, known to sqrt(2 x 8 / 20,000)
    long = np.arange(20_000)
    white = generator(1, "white").normal(size=len(long))
    calm = LegSwing().by_current.looked_over(
        SimpleNamespace(
            table=type(table())(STEP_S * long, {}, (slice(0, len(long)),)),
            signals={"I": white, "q": white, "w_moving": white, "t": white},
        )
    )["torque_Nm"]["I"]
    assert np.var(calm) == pytest.approx(1.0 / (8.0 * math.sqrt(math.pi)), rel=0.1)


def test_what_drives_the_leg_is_the_voltage_with_the_slope_of_what_is_left_of_it_or_the_current():
    """An angle t^2: K q' = 1.188 (2 t), of which the slope is 2.376; of the voltage 3 t it is 3."""
    t = STEP_S * np.arange(COUNT)
    one = type(table())(t, {"hip_angle_rad": t**2, "current_A": 5.0 + t, "voltage_V": 3.0 * t}, (slice(0, COUNT),))
    leg = LegSwing()
    assert list(leg.by_current.inputs(one)) == ["I"] and leg.by_current.inputs(one)["I"] is one["current_A"]
    driven = leg.by_voltage.inputs(one)
    inside = slice(20, -20)
    assert driven["V"] is one["voltage_V"]
    # Gaussians end at four deviations, and a part in a thousand of a slope with them
    assert driven["slope"][inside] == pytest.approx(3.0 - 2.0 * 1.188, abs=0.006)
    guess = leg.by_voltage.first_guess(one)
    # a Gaussian of 20 ms adds its variance to t^2
    assert guess["q"][inside] == pytest.approx(t[inside] ** 2 + 0.02**2, abs=5e-5)
    assert guess["w"][inside] == pytest.approx(2.0 * t[inside], rel=2e-3)
    half = LegSwing(gear=33.0)
    assert half.by_voltage.inputs(one)["slope"][inside] == pytest.approx(3.0 - 1.188, abs=0.004)


@pytest.mark.parametrize(("width_s", "part"), [(0.004, "voltage_V"), (0.02, "hip_angle_rad")])
def test_what_drives_the_current_lies_under_a_gaussian_of_4_ms_and_the_turning_under_one_of_20(width_s, part):
    """At steps of 1 ms; a jump's slope is the Gaussian. The turning is its slope and passes both."""
    t = 0.001 * np.arange(COUNT)
    jump = (np.arange(COUNT) >= 150).astype(float)
    columns = {"hip_angle_rad": 0.0 * t, "current_A": t, "voltage_V": 0.0 * t} | {part: jump}
    slope = LegSwing().by_voltage.inputs(type(table())(t, columns, (slice(0, COUNT),)))["slope"]
    if part == "voltage_V":
        assert slope.max() == pytest.approx(1.0 / (width_s * math.sqrt(2.0 * math.pi)), rel=0.1)
        return
    # - K times the derivative of a Gaussian of sqrt(20^2 + 4^2) ms, largest one deviation off its middle
    both = math.hypot(0.02, 0.004)
    assert slope.max() == pytest.approx(1.188 * math.exp(-0.5) / (both**2 * math.sqrt(2.0 * math.pi)), rel=0.05)


def test_a_step_is_the_midpoint_rule_in_parts_of_2_ms_at_most():
    leg = LegSwing().by_voltage
    p = {each.name: np.array([1.3 * each.value + 0.01]) for each in leg.parameters}
    u = {"V": 3.0, "slope": 40.0, "drop_V": 0.2, "torque_Nm": 0.3, "constant_share": 0.05}
    u = {name: np.array([value]) for name, value in u.items()}
    x = {"q": np.array([0.2]), "w": np.array([-0.4])}
    for step_s, parts in ((0.001, 1), (0.002, 1), (0.0021, 2), (0.004, 2), (0.005, 3)):
        q, w, h = 0.2, -0.4, step_s / parts
        for _ in range(parts):
            q_half, w_half = q + h / 2.0 * w, w + h / 2.0 * acceleration(leg, q, w, u, p)
            q, w = q + h * w_half, w + h * acceleration(leg, q_half, w_half, u, p)
        found = leg.step(x, u, p, step_s)
        assert (found["q"][0], found["w"][0]) == pytest.approx((q, w), rel=1e-12)


def acceleration(leg, q, w, u, p):
    """The balance is held by its own test; here friction's sign and the inertia."""
    torque, friction = leg._torques(np.array([q]), np.array([w]), u, p)
    return float(((torque - friction * math.tanh(w / 0.01)) / p["inertia_kg_m2"])[0])


def test_the_leg_shows_its_angle_and_the_current_that_flows_and_stands_open_where_it_stands():
    leg = LegSwing()
    p = {each.name: each.value for each in leg.parameters}
    one = {name: np.array([value]) for name, value in (("V", 6.7), ("slope", 0.0), ("I", 2.5))}
    one |= {name: np.array([0.0]) for name in ("drop_V", "torque_Nm", "constant_share")}
    one |= {"angle_shown_rad": np.array([0.03]), "current_shown_A": np.array([0.2])}
    x = {"q": np.array([0.5]), "w": np.array([0.0])}
    seen = leg.by_voltage.observe(x, one, p)
    assert seen["hip_angle_rad"][0] == pytest.approx(0.53)
    assert seen["current_A"][0] == pytest.approx((6.7 - 0.7) / 1.3 + 0.2)
    assert set(leg.by_current.observe(x, one, p)) == {"hip_angle_rad"}
    # by the current the sensor's error drives as well: 2.5 A shown are 2.3 A
    _, friction = leg.by_current._torques(x["q"], x["w"], one, p)
    assert friction[0] == pytest.approx(0.1 + 0.1188 * 2.3)
    # friction's impulse over a step: a memory of 10 ms, and half of it at 2 sqrt(2 log 2) times 10 mrad/s
    open_ = leg.by_current.loose(x, one, p, 0.002)
    assert list(open_) == ["w"]
    assert open_["w"][0] == pytest.approx(friction[0] * math.sqrt(2.0 * 0.01 * 0.002) / 0.557)
    moving = {"q": x["q"], "w": np.array([0.02 * math.sqrt(2.0 * math.log(2.0))])}
    assert leg.by_current.loose(moving, one, p, 0.002)["w"][0] == pytest.approx(0.5 * open_["w"][0])


def test_a_leg_has_ports_for_torques_constants_sensors_and_with_a_voltage_for_drops():
    four = (Port("torque_Nm", "N m", M, "moves"), Port("constant_share", "1", M), Port("angle_shown_rad", "rad", S),
            Port("current_shown_A", "A", S))  # fmt: skip
    leg = LegSwing()
    assert leg.by_current.ports == four and leg.by_voltage.ports == (*four, Port("drop_V", "V", E))
    assert leg.by_current.noisy_inputs == {"I": None} and leg.by_voltage.noisy_inputs == {"V": None}
    assert leg.parameters == leg.by_voltage.parameters and leg.by_current.parameters == leg.parameters[:7]
    assert leg.by_voltage.weight_Nm == pytest.approx(7.0632)
    assert LegSwing(first_moment_kg_m=1.0).by_current.weight_Nm == pytest.approx(9.81)
