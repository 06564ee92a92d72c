"""What an ankle on its board's law can have, compared with a second book: torques at motor and foot, encoders."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.signal import lfilter

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.machine import Equation
from ranger_sim.sysid.machines import ankle, ankle_motion
from ranger_sim.sysid.machines.ankle import Ankle, AnkleEffect, AnkleRecording, Run
from ranger_sim.sysid.machines.ankle_motion import PARAMETERS, USUAL, Drive, Motion

H = 0.002  # five steps a row
ROWS, M_STEPS = 41, 201
TIME_S = 7.0 + H * np.arange(M_STEPS)
RNG = generator(7, "ankle's book")
CABLE, CONSTANT = 11.0, 0.55


def a_motion():
    """Any signals: effects are functions of them."""
    states = RNG.normal(size=(6, M_STEPS))
    states[1, ::9] = 0.0
    values = {
        **USUAL,
        "cable_stiffness_Nm_per_rad": CABLE,
        "torque_constant_Nm_per_A": CONSTANT,
        "joint_zero_rad": 0.03,
    }
    nothing = np.zeros(M_STEPS)
    sliding = np.tanh(states[1])
    rows = slice(None, None, 5)
    slopes, stands = RNG.normal(size=(4, M_STEPS)), sliding == 0.0
    return Motion(TIME_S, states, slopes, nothing, nothing, sliding, stands, rows, values, None)


MOTION = a_motion()
P, U, A, W, _, CURRENT = MOTION.states
DRIVE = Drive(TIME_S[::5], RNG.normal(size=ROWS), 11.0, 1.5)
RUN = Run(slice(0, ROWS), DRIVE, MOTION, RNG.uniform(0.2, 2.0, M_STEPS), RNG.normal(size=M_STEPS))
TABLE = Table(TIME_S[::5], {"joint_angle_rad": A[::5]}, (slice(0, ROWS),), "book")
NONE = np.zeros(M_STEPS)
SLIDING = MOTION.sliding
TWIST = P + 0.03 - A


def behind(values, tau):
    keep = math.exp(-H / tau)
    return lfilter([1.0 - keep], [1.0, -keep], values)


def bend(rate, way):
    out, state = [], 0.0
    for each in rate:
        x = each * H / way
        state = state if x == 0.0 else math.copysign(1.0, x) + (state - math.copysign(1.0, x)) * math.exp(-abs(x))
        out.append(state)
    return np.array(out)


def cosine_sine(angle, load=1.0):
    return [load * np.cos(angle), load * np.sin(angle)]


@dataclasses.dataclass
class Row:
    """torques(shape): pairs, one of each coefficient, of what is put in at motor and foot, or shown by them."""

    cause: str
    at: str
    subsystem: str
    coefficients: tuple
    pairs: object
    grid: tuple = ({},)
    yes: tuple = ({"x": -1.0}, {"x": 1.0})
    no: tuple = ()
    form: str = ""
    shown: bool = False
    phase_is_free: bool = False


def at_motor(*made):
    return lambda p: [(each, NONE) for each in made[0](p)]


def at_foot(*made):
    return lambda p: [(NONE, each) for each in made[0](p)]


def positive(name):
    return {"yes": ({name: 1e-9},), "no": ({name: 0.0}, {name: -1.0})}


def below(*names, limit):
    """An amplitude within a limit, however it is turned."""
    one, other = names
    return {
        "yes": ({one: 0.7 * limit, other: -0.7 * limit}, {one: 0.0, other: 0.99 * limit}),
        "no": ({one: 0.8 * limit, other: -0.8 * limit}, {one: -limit, other: 0.0}),
    }


def book(top, both, rate, logged, low):
    gear, M, T, S, F = 34.0, "mechanical", "transmission", "sensor", "firmware"
    turns = tuple({"periods_per_turn": float(n)} for n in range(1, 9))
    cable = CABLE * TWIST
    later = -np.gradient(np.interp(TIME_S, DRIVE.time_s, DRIVE.command_A), TIME_S)
    asked = 0.0 if logged else RUN.target_rad

    def longer(p, made):
        return [(CABLE * made, -CABLE * made)]

    def driven(current):
        return [(CONSTANT * current, NONE)]

    rows = [
        Row("return_spring", "inner_ankle", M, ("square_Nm_per_rad2",), at_foot(lambda p: [-A * A]), form="square"),
        Row("return_spring", "inner_ankle", M, ("cubic_Nm_per_rad3",), at_foot(lambda p: [-A * A * A]), form="cube"),
        Row("return_spring", "inner_ankle", M, ("square_Nm_per_rad2", "cubic_Nm_per_rad3"),
            at_foot(lambda p: [-np.square(A - 1.66), -((A - 1.66) * np.square(A - 1.66))]), ({"rest_rad": 1.66},),
            form="square and cube"),
        Row("stribeck", "inner_motor", M, ("excess_Nm",),
            at_motor(lambda p: [-SLIDING * np.exp(-np.square(U / p["speed_rad_s"]))]),
            tuple({"speed_rad_s": share * top} for share in (0.04, 0.08, 0.16, 0.3, 0.5)), **positive("excess_Nm")),
        Row("presliding", "inner_motor", M, ("friction_Nm",),
            at_motor(lambda p: [SLIDING - bend(U, p["slide_rad"])]),
            tuple({"slide_rad": way} for way in (0.003, 0.01, 0.03, 0.1)), **positive("friction_Nm")),
        Row("direction_friction", "inner_motor", M, ("viscous_Nms",), at_motor(lambda p: [-abs(U)])),
        Row("friction_warm_up", "inner_motor", M, ("Nm_s_per_rad",),
            at_motor(lambda p: [SLIDING * behind(abs(U), p["time_constant_s"])]),
            tuple({"time_constant_s": each} for each in (3.0, 10.0, 30.0)), **positive("Nm_s_per_rad")),
        Row("drag", "inner_motor", M, ("quadratic_Nms2",), at_motor(lambda p: [-np.sign(U) * U * U]),
            **positive("quadratic_Nms2")),
        Row("cogging", "inner_motor", M, ("cosine_Nm", "sine_Nm"),
            at_motor(lambda p: cosine_sine(p["periods_per_turn"] * gear * P)), turns, phase_is_free=True,
            **below("cosine_Nm", "sine_Nm", limit=0.1)),
        Row("commutation_ripple", "inner_motor", M, ("cosine", "sine"),
            at_motor(lambda p: cosine_sine(p["periods_per_turn"] * gear * P, CONSTANT * CURRENT)), turns,
            phase_is_free=True, **below("cosine", "sine", limit=0.5)),
        Row("once_per_turn", "inner_ankle", M, ("cosine_Nm", "sine_Nm"),
            at_foot(lambda p: cosine_sine(p["periods_per_turn"] * A)), turns[:3]),
        Row("cable_stiffening", "inner_cable", T, ("cubic_Nm_per_rad3",), lambda p: [(-(TWIST**3), TWIST**3)]),
        Row("cable_backlash", "inner_cable", T, ("half_gap_rad",),
            lambda p: longer(p, np.tanh(cable / p["torque_Nm"])),
            ({"torque_Nm": 0.01}, {"torque_Nm": 0.03}, {"torque_Nm": 0.1}), **positive("half_gap_rad")),
        Row("cable_creep", "inner_cable", T, ("rad_per_Nm",),
            lambda p: longer(p, behind(cable - np.mean(cable), p["time_constant_s"])),
            tuple({"time_constant_s": each} for each in (0.3, 1.0, 3.0, 10.0)), **positive("rad_per_Nm")),
        Row("sensor_scale", "joint_angle_rad", S, ("change",), at_foot(lambda p: [A]), shown=True),
        Row("sensor_lag", "joint_angle_rad", S, ("time_constant_s",), at_foot(lambda p: [-W]), shown=True),
        Row("eccentricity", "joint_angle_rad", S, ("cosine_rad", "sine_rad"),
            at_foot(lambda p: cosine_sine(p["periods_per_turn"] * A)), turns[:2], shown=True,
            **below("cosine_rad", "sine_rad", limit=0.02)),
        Row("clock_drift", "joint_angle_rad", S, ("share",), at_foot(lambda p: [-W * (TIME_S - 7.0)]), shown=True),
    ]  # fmt: skip
    if both:
        rows.append(Row("sensor_lag", "motor_angle_rad", S, ("time_constant_s",), at_motor(lambda p: [-U]), shown=True))
    if rate:
        at = "joint_rate_rad_per_s"
        rows += [
            Row("sensor_lag", at, S, ("time_constant_s",), None),
            Row("sensor_scale", at, S, ("change",), None),
            Row("sensor_offset", at, S, ("offset_rad_s",), None),
        ]
    rows += [
        Row("firmware_parameter", "stiffness", F, ("A_per_rad",), lambda p: driven(asked - P)),
        # nothing follows a command before it, nor by more than 25 frames of 2 ms
        Row("sensor_lag", "command", F, ("time_constant_s",), lambda p: driven(later),
            yes=({"time_constant_s": 1e-6}, {"time_constant_s": 0.0499}),
            no=({"time_constant_s": 0.0}, {"time_constant_s": 0.05})),
    ]  # fmt: skip
    if not logged:
        rows += [
            Row("firmware_parameter", "target_floor", F, ("share",),
                lambda p: driven(11.0 * np.clip(p["floor_rad"] - RUN.target_rad, 0.0, None)),
                tuple({"floor_rad": round(low + 0.02 * n, 3)} for n in range(1, 11))),
            Row("firmware_parameter", "feed_forward", F, ("A_per_rad",), lambda p: driven(RUN.target_rad)),
        ]  # fmt: skip
    return rows


def recording(motor=True, rate=True, logged=False, size=1.0):
    names = ["motor", "transmission"] if motor else ["joint"]
    names += ["joint rate"] if rate else []
    columns = {name: np.full(ROWS, 3.0) for name in PARAMETERS}
    ones = np.ones(ROWS, dtype=bool)
    equations = {name: Equation(name, "M", "m", "rad", np.zeros(ROWS), columns, ones) for name in names}
    there = TABLE.columns | ({"command_current_A": DRIVE.command_A} if logged else {})
    found = AnkleRecording(Table(TABLE.time_s, there, TABLE.runs, "book"), {}, equations, simulated=[RUN])
    found.signals = {"u": size * U[::5], "w": W[::5], "rate": 2.0 * W[::5], "slope": 3.0 * A[::5]}
    return found


@pytest.mark.parametrize("motor", [True, False])
@pytest.mark.parametrize("rate", [True, False])
@pytest.mark.parametrize("logged", [True, False])
def test_an_ankle_can_have_what_the_book_says(motor, rate, logged):
    recordings = [recording(False, False), recording(motor, rate, logged, 2.0)]
    found = [each for each in Ankle().effects(recordings) if not (each.shapes == [{}] and each.meaning)]
    top = 2.0 * float(np.quantile(abs(U[::5]), 0.98))
    rows = book(top, motor, rate, logged, float(RUN.target_rad.min()))
    assert [(each.cause, each.at, each.coefficients) for each in found] == [
        (row.cause, row.at, row.coefficients) for row in rows
    ]
    for effect, row in zip(found, rows, strict=True):
        what = f"{row.cause} at {row.at} {row.coefficients}"
        same = ("subsystem", "form", "phase_is_free")
        assert [getattr(effect, name) for name in same] == [getattr(row, name) for name in same], what
        assert [list(each) for each in effect.shapes] == [list(each) for each in row.grid], what
        shapes = [value for each in effect.shapes for value in each.values()]
        assert np.allclose(shapes, [value for each in row.grid for value in each.values()], rtol=1e-9, atol=0.0), what
        assert all(effect.admissible(each) for each in row.yes), what
        assert not any(effect.admissible(each) for each in row.no), what
        if row.pairs is None:
            continue
        assert isinstance(effect, AnkleEffect) and effect.shown is row.shown, what
        for shape in row.grid[:: max(1, len(row.grid) - 1)]:
            pairs, wanted = effect.pairs(RUN, TABLE, shape), row.pairs(shape)
            assert len(pairs) == len(row.coefficients) == len(wanted), what
            for pair, other in zip(pairs, wanted, strict=True):
                assert np.allclose(pair[0], other[0], rtol=1e-9, atol=1e-12), what
                assert np.allclose(pair[1], other[1], rtol=1e-9, atol=1e-12), what


def test_a_wrong_value_is_seen_as_the_parameter_itself_and_none_in_a_loose_recording():
    wanted = {
        ("inertia", "inner_foot"): "inertia_kg_m2",
        ("spring_value", "inner_ankle"): "return_stiffness_Nm_per_rad",
        ("spring_value", "inner_ankle_rest"): "return_torque_Nm",
        ("spring_value", "inner_motor"): "motor_spring_Nm_per_rad",
        ("spring_value", "inner_cable"): "cable_stiffness_Nm_per_rad",
        ("coulomb_friction", "inner_motor"): "coulomb_friction_Nm",
        ("viscous_friction", "inner_motor"): "viscous_friction_Nms",
        ("load_friction", "inner_motor"): "load_friction",
        ("sensor_offset", "joint_angle_rad"): "joint_zero_rad",
    }
    made = recording()
    for number, name in enumerate(PARAMETERS):
        for equation in made.equations.values():
            equation.columns[name] = np.full(ROWS, float(number))
    found = [each for each in Ankle().effects([made]) if each.shapes == [{}] and each.meaning]
    assert [(each.cause, each.at) for each in found] == list(wanted)
    for effect in found:
        columns = effect.columns(made, {}, {})
        assert set(columns) == {"motor", "transmission", "joint rate"}
        number = float(PARAMETERS.index(wanted[effect.cause, effect.at]))
        assert all(np.array_equal(each, np.full((ROWS, 1), number)) for each in columns.values())
    made.loose = True
    assert all(effect.columns(made, {}, {}) == {} for effect in found)


def test_what_the_rate_s_sensor_has_is_in_the_rate_s_equation_alone():
    made, bare = recording(), recording(rate=False)
    found = [each for each in Ankle().effects([made]) if each.at == "joint_rate_rad_per_s"]
    wanted = (-3.0 * A[::5], 2.0 * W[::5], np.ones(ROWS))
    for effect, column in zip(found, wanted, strict=True):
        columns = effect.columns(made, {}, {})
        assert list(columns) == ["joint rate"] and np.allclose(columns["joint rate"], column[:, None])
        assert effect.columns(bare, {}, {}) == {}


@pytest.mark.parametrize("channel", ["joint_angle_rad", "motor_angle_rad"])
def test_a_lag_that_acts_is_linearised_about_itself_and_shown_whole(channel):
    """Behind a lag of first order: the change by more of it, and all of it, by the recursion for straight lines."""
    (lag,) = (each for each in Ankle().effects([recording()]) if (each.cause, each.at) == ("sensor_lag", channel))
    side = 0 if channel == "motor_angle_rad" else 1
    angle = (P, A)[side]

    def shown(tau):
        keep, share = math.exp(-H / tau), tau / H * (1.0 - math.exp(-H / tau))
        out = [angle[0]]
        for before, now in zip(angle[:-1], angle[1:], strict=True):
            out.append(keep * out[-1] + (share - keep) * before + (1.0 - share) * now)
        return np.array(out) - angle

    whole = lag.seen(RUN, TABLE, {}, (0.01,))
    assert np.allclose(whole[side], shown(0.01), atol=1e-12) and not np.any(whole[1 - side])
    (change,) = lag.pairs(RUN, TABLE, {}, 0.01)
    slope = (shown(0.01 + 1e-7) - shown(0.01 - 1e-7)) / 2e-7
    assert np.allclose(change[side], slope, atol=1e-3 * np.max(np.abs(slope))) and not np.any(change[1 - side])
    # a lag below 0 is none: then what is shown is its first order
    before = lag.seen(RUN, TABLE, {}, (-0.01,))
    assert np.allclose(before[side], 0.01 * (U, W)[side], atol=1e-12)
    (first,) = lag.pairs(RUN, TABLE, {}, 0.0)
    assert np.allclose(first[side], -(U, W)[side])


def test_coefficients_of_one_effect_add_up():
    (wave,) = (each for each in Ankle().effects([recording()]) if each.cause == "cogging")
    motor, foot = wave.seen(RUN, TABLE, {"periods_per_turn": 2.0}, (0.3, -0.2))
    assert np.allclose(motor, 0.3 * np.cos(68.0 * P) - 0.2 * np.sin(68.0 * P)) and not np.any(foot)
    other = (
        each for each in Ankle().effects([recording()]) if (each.cause, each.at) == ("cable_backlash", "inner_cable")
    )
    motor, foot = next(other).seen(RUN, TABLE, {"torque_Nm": 0.1}, (0.05,))
    assert np.allclose(motor, 0.05 * CABLE * np.tanh(10.0 * CABLE * TWIST)) and np.allclose(foot, -motor)


# --- columns of the equations -----------------------------------------------------------------------------------------


def moved(filter_s=0.0):
    """Two runs of a smooth motion, with everything that the equations' columns need."""
    t = 0.01 * np.arange(ROWS)
    runs, table_t = [], np.concatenate((t, 5.0 + t))
    for number in range(2):
        time_s = t + 5.0 * number
        drive = Drive(time_s, 8.0 + 5.0 * np.sin(9.0 * time_s), 11.0, 1.5, filter_s)
        motion = ankle_motion.simulated(drive, {"load_friction": 0.0}, (1.0, 0.3, 1.0, 0.3))
        runs.append(Run(slice(number * ROWS, (number + 1) * ROWS), drive, motion, motion.p, motion.u))
    table = Table(table_t, {"joint_angle_rad": 0.0 * table_t}, (slice(0, ROWS), slice(ROWS, 2 * ROWS)), "two")
    columns = {name: np.zeros(2 * ROWS) for name in PARAMETERS}
    ones = np.ones(2 * ROWS, dtype=bool)
    names = ("joint", "motor", "transmission", "joint rate")
    equations = {name: Equation(name, "M", "m", "rad", np.zeros(2 * ROWS), columns, ones) for name in names}
    made = AnkleRecording(table, {}, equations, simulated=runs)
    made.signals = ankle._signals(table, runs)
    return made


@pytest.mark.parametrize("filter_s", [0.0, 0.01])
def test_columns_are_what_motor_joint_and_rate_answer_on_the_table_s_rows(filter_s):
    made = moved(filter_s)
    effects = {(each.cause, each.at, each.form): each for each in Ankle().effects([made])}
    square = effects["return_spring", "inner_ankle", "square"]
    columns = square.columns(made, {}, {})
    assert set(columns) == set(made.equations)
    for run in made.simulated:
        m = run.motion
        answer = m.answer(np.zeros((len(m.p), 1)), -(m.a**2)[:, None])
        rate = answer[:, 3]
        if filter_s:
            rate = ankle.behind(rate, run, filter_s)
        for name, wanted in (("motor", answer[:, 0]), ("joint", answer[:, 2]),
                             ("transmission", answer[:, 2] - answer[:, 0]), ("joint rate", rate)):  # fmt: skip
            assert np.allclose(columns[name][run.rows], wanted[::5], atol=1e-12), name
    shown = effects["clock_drift", "joint_angle_rad", ""].columns(made, {}, {})
    for run in made.simulated:
        m = run.motion
        drift = (-m.w * (m.time_s - m.time_s[0]))[::5, None]
        assert np.allclose(shown["joint"][run.rows], drift) and np.allclose(shown["transmission"][run.rows], drift)
        assert not np.any(shown["motor"]) and not np.any(shown["joint rate"])
    # they are kept, by the effect and its shape
    assert square.columns(made, {}, {})["motor"] is columns["motor"]
    wave = effects["cogging", "inner_motor", ""]
    one, other = (wave.columns(made, {"periods_per_turn": n}, {})["motor"] for n in (1.0, 2.0))
    assert one.shape == (2 * ROWS, 2) and not np.allclose(one, other)
    del made.equations["motor"]
    assert "motor" not in square.columns(made, {}, {})


def test_an_effect_that_acts_is_linearised_about_its_size():
    made = moved()
    (lag,) = (each for each in Ankle().effects([made]) if (each.cause, each.at) == ("sensor_lag", "joint_angle_rad"))
    made.acting = {lag.key({}): (0.01,)}
    columns = lag.columns(made, {}, {})
    for run in made.simulated:
        ((_, change),) = lag.pairs(run, made.table, {}, 0.01)
        assert np.allclose(columns["joint"][run.rows, 0], change[::5], atol=1e-12)
        assert not np.allclose(change[::5], -run.motion.w[::5], atol=1e-3)


@pytest.mark.parametrize("filter_s", [0.0, 0.01])
def test_signals_are_the_simulated_motion_on_the_table_s_rows(filter_s):
    made = moved(filter_s)
    s = made.signals
    assert s["t"] == pytest.approx(made.table.time_s)
    for run in made.simulated:
        m = run.motion
        for name, values in (("p", m.p), ("u", m.u), ("a", m.a), ("w", m.w), ("I", m.I), ("acceleration", m.slopes[3])):
            assert np.array_equal(s[name][run.rows], values[::5]), name
        for name, values in (("rate", m.w), ("slope", m.slopes[3])):
            told = ankle.behind(values, run, 0.01) if filter_s else values
            assert np.allclose(s[name][run.rows], told[::5]), name


def test_a_misfit_of_an_angle_is_looked_for_over_the_motor_and_one_of_the_rate_over_the_rate():
    made = recording()
    made.signals |= {"p": P[::5], "t": TABLE.time_s}
    look = Ankle().generic(made)
    assert {name: list(each) for name, each in look.items()} == {
        "motor": ["p", "u", "t"], "transmission": ["p", "u", "t"], "joint rate": ["w", "t"],
    }  # fmt: skip
    assert look["motor"]["u"] is made.signals["u"] and look["joint rate"]["w"] is made.signals["w"]


# --- the law's numbers ------------------------------------------------------------------------------------------------


def law(**columns):
    made = {"joint_angle_rad": np.linspace(0.0, 1.0, 10)}
    made |= {name: np.asarray(each, dtype=float) * np.ones(10) for name, each in columns.items()}
    return Table(0.01 * np.arange(10), made, (slice(0, 10),), "log")


def test_the_law_s_gains_are_those_of_the_log_or_of_the_foot_s_logs():
    assert ankle._gains(law()) == (11.219, 1.634)
    logged = law(command_stiffness_A_per_rad=8.0, command_dampness_A_s_per_rad=0.5)
    assert ankle._gains(logged) == (8.0, 0.5)
    # within a hundredth they are taken for one
    near = [8.0] * 9 + [8.0799]
    assert ankle._gains(law(command_stiffness_A_per_rad=near))[0] == 8.0
    with pytest.raises(UserError, match=r"log: command_stiffness_A_per_rad goes from 8 to 8\.09, it must stay"):
        ankle._gains(law(command_stiffness_A_per_rad=[8.0] * 9 + [8.09]))
    with pytest.raises(UserError, match="log: command_dampness_A_s_per_rad is 0, it must be above 0"):
        ankle._gains(law(command_dampness_A_s_per_rad=0.0))
    with pytest.raises(UserError, match="command_stiffness_A_per_rad is -2, it must be above 0"):
        ankle._gains(law(command_stiffness_A_per_rad=-2.0))


def test_a_value_that_is_off_pulls_with_its_square_and_beyond_far_hardly_more():
    """Student's law: far^2 log(1 + (x / far)^2)."""
    assert ankle._pulls(np.array([0.0]), 3.0) == 0.0
    assert ankle._pulls(np.array([0.01, -0.02]), 3.0) == pytest.approx(5e-4, rel=1e-4)
    assert ankle._pulls(np.array([3.0]), 3.0) == pytest.approx(9.0 * math.log(2.0))
    assert ankle._pulls(np.array([6.0, -6.0]), 3.0) == pytest.approx(18.0 * math.log(5.0))


def test_a_prediction_is_judged_by_its_rms_over_what_the_law_leaves():
    found = ankle.Prediction("motor_angle_rad", np.arange(4.0), np.array([1.0, 3.0, 1.0, 3.0]),
                             np.array([1.5, 3.5, 0.5, 2.5]), np.array([0.0, 0.0, 0.0, 0.0]))  # fmt: skip
    assert found.rms == pytest.approx(0.5) and found.nrmse == pytest.approx(0.5)
    shifted = dataclasses.replace(found, law_rad=np.array([0.0, 0.0, 2.0, 0.0]))
    assert shifted.nrmse == pytest.approx(0.5 / np.std([1.0, 3.0, -1.0, 3.0]))


def test_a_rate_is_reported_behind_the_law_s_filter_or_as_it_is():
    values = RNG.normal(size=(M_STEPS, 2))
    assert RUN.shown(values) is values
    filtered = dataclasses.replace(RUN, drive=dataclasses.replace(DRIVE, filter_s=0.02))
    assert np.array_equal(filtered.shown(values), ankle.behind(values, filtered, 0.02))
