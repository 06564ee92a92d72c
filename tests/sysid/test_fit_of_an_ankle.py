"""The ankle's fit piece by piece: runs and commands, starts, what is missed, its slopes by differences, its cost."""

import math

import numpy as np
import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.machines import ankle, ankle_motion
from ranger_sim.sysid.machines.ankle import Acting, Ankle, _Fit
from ranger_sim.sysid.machines.ankle_motion import PARAMETERS, USUAL

H = 0.004
LONG, SHORT = 300, 49  # rows of the runs; the short one is left out
T_LONG, T_SHORT = H * np.arange(LONG), 2.0 + H * np.arange(SHORT)
TIME_S = 5.0 + np.concatenate((T_LONG, T_SHORT))
RUNS = (slice(0, LONG), slice(LONG, LONG + SHORT))
K, D = 11.219, 1.634
OMEGA = 5.0
REST = 1.66


def table(motor=True, command=False, low=0.9, **columns):
    t = TIME_S - 5.0
    target, rate = low + 0.15 + 0.15 * np.sin(OMEGA * t), 0.15 * OMEGA * np.cos(OMEGA * t)
    made = {"joint_angle_rad": target + 0.02 * np.sin(31.0 * t)}
    if motor:
        made["motor_angle_rad"] = target - 0.01
    if command:
        made["command_current_A"] = 1.1 * (K * target + D * rate)
    else:
        made |= {"target_angle_rad": target, "target_rate_rad_per_s": rate}
    return Table(TIME_S, made | columns, RUNS, "sine")


def fit_of(run, **more):
    return _Fit(run, Ankle.parameters, **more)


# --- runs and what drives them ----------------------------------------------------------------------------------------


def test_runs_of_fifty_rows_and_a_second_count_from_half_a_second_on():
    fit = fit_of(table())
    assert [each.rows for each in fit.runs] == [slice(0, LONG)]
    assert np.array_equal(fit.valid, np.concatenate((T_LONG > 0.5, np.zeros(SHORT, dtype=bool))))
    for rows, seconds, there in ((50, 1.0, True), (49, 1.5, False), (60, 0.99, False)):
        t = np.linspace(0.0, seconds, rows)
        columns = {name: np.interp(t, T_LONG, column[:LONG]) for name, column in table().columns.items()}
        run = Table(t, columns, (slice(0, rows),), "run")
        if there:
            assert len(fit_of(run).runs) == 1
        else:
            with pytest.raises(UserError, match="run: ankle needs a stretch of 1 s without a gap"):
                fit_of(run)


def test_the_law_s_command_is_made_of_the_target_or_is_the_logged_one():
    run = table()
    target, rate = run["target_angle_rad"][:LONG], run["target_rate_rad_per_s"][:LONG]
    (plain,) = fit_of(run).runs
    assert np.allclose(plain.drive.command_A, K * target + D * rate)
    assert np.allclose(plain.target_rad, np.interp(plain.motion.time_s, TIME_S[:LONG], target))
    assert np.allclose(plain.target_rate_rad_per_s, np.interp(plain.motion.time_s, TIME_S[:LONG], rate))
    assert (plain.drive.stiffness_A_per_rad, plain.drive.dampness_As_per_rad, plain.drive.filter_s) == (K, D, 0.0)
    # the robot's program: not below 0.3 rad, and 0.134 N m/rad about 1.662 rad fed forward
    low = table(low=0.2)
    (program,) = fit_of(low, of_program=True).runs
    raised = np.maximum(low["target_angle_rad"][:LONG], 0.3)
    wanted = K * raised + D * low["target_rate_rad_per_s"][:LONG] + 0.134 / 0.612 * (raised - 1.662)
    assert np.allclose(program.drive.command_A, wanted) and program.drive.filter_s == pytest.approx(0.00775)
    logged = table(command=True)
    fit = fit_of(logged)
    (one,) = fit.runs
    assert np.array_equal(one.drive.command_A, logged["command_current_A"][:LONG])
    asked = logged["command_current_A"][:LONG] / K
    assert np.allclose(one.target_rad, np.interp(one.motion.time_s, TIME_S[:LONG], asked))
    assert np.allclose(one.target_rate_rad_per_s, np.interp(one.motion.time_s, TIME_S[:LONG], np.gradient(asked, H)))
    # the command itself is logged: it is late by next to nothing
    assert fit.spread["target_late_s"] == 0.0001 and fit_of(run).spread["target_late_s"] == 0.002


@pytest.mark.parametrize("motor", [True, False])
def test_a_run_starts_with_a_cable_that_carries_what_the_foot_needs(motor):
    """A cubic's angle, rate and second derivative; the foot's balance, and its rate."""
    angle = 1.2 + 0.3 * T_LONG - 0.8 * T_LONG**2 + 0.5 * T_LONG**3
    both = np.concatenate((angle, T_SHORT))
    columns = {"joint_angle_rad": both} | ({"motor_angle_rad": both} if motor else {})
    fit = fit_of(table(motor, **columns))
    values = {**USUAL, "return_stiffness_Nm_per_rad": 0.4, "return_torque_Nm": 0.07, "inertia_kg_m2": 0.003,
              "cable_stiffness_Nm_per_rad": 12.0, "joint_zero_rad": 0.02}  # fmt: skip
    p, u, a, w = fit._start(slice(0, LONG), values)
    needs = 0.4 * (1.2 - REST) - 0.07 + 0.003 * -1.6
    twist, slower = needs / 12.0 - 0.02, 0.4 * 0.3 / 12.0
    if motor:
        assert (p, u, a, w) == pytest.approx((1.2, 0.3, 1.2 - twist, 0.3 - slower), abs=1e-9)
    else:
        assert (p, u, a, w) == pytest.approx((1.2 + twist, 0.3 + slower, 1.2, 0.3), abs=1e-9)


# --- what is missed, and its slopes -----------------------------------------------------------------------------------


@pytest.mark.parametrize("motor", [True, False])
def test_what_is_missed_is_motor_and_joint_against_motor_or_the_joint_alone(motor):
    run = table(motor)
    fit = fit_of(run)
    good, m = fit.valid[:LONG], fit.runs[0].motion
    joint = (run["joint_angle_rad"][:LONG] - m.a[m.rows])[good]
    if motor:
        of_motor = (run["motor_angle_rad"][:LONG] - m.p[m.rows])[good]
        joint = np.concatenate((of_motor, joint - of_motor))
    assert np.allclose(fit.missed, joint)


def held_start(fit):
    """The start stays: another test shows that it goes with the values."""
    start = fit._start(slice(0, LONG), fit.values)
    fit._start = lambda rows, values: start
    fit._take(fit.values, *fit._moved(fit.values))
    return fit._slopes()


def put(fit, chosen):
    """Effects with their coefficients among what is fitted."""
    for number, (effect, shape, coefficients) in enumerate(chosen):
        names = tuple(f"{number} {name}" for name in effect.coefficients)
        fit.acting.append(Acting(effect, shape, names))
        fit.all += names
        fit.values = fit.values | dict(zip(names, coefficients, strict=True))


@pytest.mark.parametrize("motor", [True, False])
def test_slopes_are_differences_of_what_is_missed(motor):
    """Of every parameter, of a lag and a wave that are shown: next to nothing, for they are not in others' slopes."""
    fit = fit_of(table(motor))
    effects = {(each.cause, each.at): each for each in Ankle().effects([ankle._recording(fit)])}
    put(fit, [
        (effects["sensor_lag", "joint_angle_rad"], {}, (5e-5,)),
        (effects["eccentricity", "joint_angle_rad"], {"periods_per_turn": 1.0}, (3e-5, 1e-5)),
    ])  # fmt: skip
    fit.values |= {"joint_zero_rad": 0.01}
    slopes = held_start(fit)
    assert fit.all == [*PARAMETERS, "0 time_constant_s", "1 cosine_rad", "1 sine_rad"]
    assert slopes.shape == (len(fit.missed), len(fit.all))
    for number, name in enumerate(fit.all):
        change = 1e-3 * (abs(fit.values[name]) or 0.01)
        up, down = (fit._moved(fit.values | {name: fit.values[name] + sign * change})[1] for sign in (1.0, -1.0))
        found = (down - up) / (2.0 * change)  # what is missed falls as what is simulated grows
        # friction turns its sign within a step or two of these: some per cent where that is pushed about
        assert np.max(np.abs(found - slopes[:, number])) < 0.08 * np.max(np.abs(found)) + 1e-9, name
    # what stays has no slope
    fit.all = fit.all[:-2]
    assert np.array_equal(fit._slopes(), slopes[:, :-2])


@pytest.mark.parametrize("motor", [True, False])
def test_slopes_of_torques_next_to_the_base_are_differences_too(motor):
    """Motions with such torques are found to a millionth of a radian, so that they have to move it by more."""
    fit = fit_of(table(motor), extra={"square": lambda m: -(m.a**2)})
    effects = {(each.cause, each.at): each for each in Ankle().effects([ankle._recording(fit_of(table(motor)))])}
    put(fit, [(effects["once_per_turn", "inner_ankle"], {"periods_per_turn": 2.0}, (1e-6, -1e-6))])
    slopes = held_start(fit)
    assert fit.all == [*PARAMETERS, "square", "0 cosine_Nm", "0 sine_Nm"]
    for number, name in enumerate(fit.all[len(PARAMETERS) :], len(PARAMETERS)):
        up, down = (fit._moved(fit.values | {name: sign * 1e-3})[1] for sign in (1.0, -1.0))
        found = (down - up) / 2e-3
        assert np.max(np.abs(found - slopes[:, number])) < 0.05 * np.max(np.abs(found)), name


def test_an_effect_shows_next_to_the_motion_what_it_shows():
    fit = fit_of(table())
    effects = {(each.cause, each.at): each for each in Ankle().effects([ankle._recording(fit)])}
    fit.acting = [
        Acting(effects["sensor_scale", "joint_angle_rad"], {}, ("scale",)),
        Acting(effects["sensor_lag", "motor_angle_rad"], {}, ("lag",)),
        Acting(effects["drag", "inner_motor"], {}, ("drag",)),
    ]
    fit.values |= {"scale": 0.1, "lag": 0.01, "drag": 0.5}
    p, a = fit.shown_beside()
    m = fit.runs[0].motion
    assert np.allclose(a[:LONG], 0.1 * m.a[m.rows]) and not np.any(a[LONG:]) and not np.any(p[LONG:])
    assert np.allclose(p[:LONG], (ankle.behind(m.p, fit.runs[0], 0.01) - m.p)[m.rows])
    # pushing moves the motion and shows nothing
    at_motor, at_foot = fit._torques(fit.runs[0], fit.values)(m)
    assert np.allclose(at_motor, -0.5 * m.u * np.abs(m.u)) and not np.any(at_foot)
    fit.acting = fit.acting[:2]
    assert fit._torques(fit.runs[0], fit.values) is None


# --- how probable it is -----------------------------------------------------------------------------------------------


def test_the_cost_is_of_independent_rows_and_of_values_off_what_is_known():
    fit = fit_of(table())
    spread = {name: value for name, value in ankle.SPREAD.items()}
    fit.values = {**fit.values, "inertia_kg_m2": USUAL["inertia_kg_m2"] + 2.0 * spread["inertia_kg_m2"],
                  "law_lag_s": USUAL["law_lag_s"] - 4.0 * spread["law_lag_s"]}  # fmt: skip
    fit.missed = np.array([0.1, -0.1, 0.3, 0.1] * 10)
    beside = 9.0 * (math.log(1.0 + 4.0 / 9.0) + math.log(1.0 + 16.0 / 9.0))
    assert fit.cost() == pytest.approx(40 / 4.0 * math.log(0.03) + beside)
    beside = fit._beside(fit.values)
    assert len(beside) == 14 and sorted(np.round(beside[np.abs(beside) > 1e-9], 9)) == [-4.0, 2.0]


def test_the_joint_s_zero_is_what_it_shows_more_than_the_motor_on_the_mean():
    run = table()
    fit = fit_of(run)
    assert fit._zero() == pytest.approx(np.mean((run["joint_angle_rad"] - run["motor_angle_rad"])[fit.valid]))
    assert fit_of(table(motor=False))._zero() == 0.0


def test_values_settle_at_those_that_a_motion_was_made_with():
    """Of a motion that the simulator itself has made. All torques together have no scale but what is known before."""
    run = table()
    true = {
        **USUAL,
        "inertia_kg_m2": 0.0014,
        "joint_zero_rad": 0.015,
        "coulomb_friction_Nm": 0.058,
        "load_friction": 0.11,
    }
    first = fit_of(run)
    (one,) = first.runs
    motion = ankle_motion.simulated(one.drive, true, first._start(slice(0, LONG), true))
    columns = dict(run.columns)
    for name, course in (("joint_angle_rad", motion.a), ("motor_angle_rad", motion.p)):
        columns[name] = np.concatenate((course[motion.rows], np.zeros(SHORT)))
    fit = fit_of(Table(TIME_S, columns, RUNS, "made"))
    fit.improve()
    assert (fit.dry, fit.filter_s) == (False, 0.0)
    for name, value in true.items():
        assert abs(fit.values[name] - value) < 0.6 * ankle.SPREAD[name], name
    assert np.std(fit.missed) < 2e-5


def test_a_loosened_fit_begins_anew_and_leaves_the_old_one():
    fit = fit_of(table(motor=False))
    before = dict(fit.values)
    other = fit.loosened()
    assert other.loose and not fit.loose and fit.values == before and fit.runs[0] is not other.runs[0]
    assert (other.far, other.memory) == (1e3, 10.0) and (fit.far, fit.memory) == (3.0, 4.0)
    assert set(other.spread) == set(ankle.LOOSE) and other.cost() < fit.cost() + 1e9


def test_effects_are_put_next_to_a_fit_with_their_coefficients_free_or_fixed():
    fit = fit_of(table())
    effects = {(each.cause, each.at): each for each in Ankle().effects([ankle._recording(fit)])}
    scale = effects["sensor_scale", "joint_angle_rad"]
    name = f"{scale.name}: change"
    for fixed in (True, False):
        other = fit.with_effects([(scale, {}, (0.05,))], fixed)
        assert (name in other.all) is not fixed and fit.acting == []
        assert other.limits[name] == (-math.inf, math.inf)
        assert (other.values[name] == 0.05) is fixed
        assert other.acting[0].of(other.values) == (other.values[name],)
        assert other.missed @ other.missed < fit.missed @ fit.missed


def test_a_fit_holds_the_values_of_another_with_its_friction_and_its_law():
    one, other = fit_of(table()), fit_of(table())
    other._made_so(True, 0.01)
    other.values = other.values | {"inertia_kg_m2": 0.002}
    one.held_as(other)
    assert one.values == other.values and (one.dry, one.filter_s) == (True, 0.01)
    assert one.runs[0].drive.filter_s == 0.01
    other.values = other.values | {"rotor_inertia_kg_m2": -0.002}
    with pytest.raises(UserError, match="sine: the ankle cannot be simulated with these values"):
        one.held_as(other)


# --- recordings -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("motor", [True, False])
def test_equations_are_what_is_missed_with_every_value_times_its_column(motor):
    rate = 0.15 * OMEGA * np.cos(OMEGA * (TIME_S - 5.0))
    run = table(motor, joint_rate_rad_per_s=rate)
    fit = fit_of(run)
    fit.values = {**fit.values, "inertia_kg_m2": 0.0015}
    fit._take(fit.values, *fit._moved(fit.values))
    made = ankle._recording(fit)
    m = fit.runs[0].motion
    slopes = ankle_motion.sensitivities(m)[m.rows]
    joint, of_motor = run["joint_angle_rad"][:LONG] - m.a[m.rows], m.p[m.rows]
    wanted = {"joint": (joint, slopes[:, 2], "M", "mechanical", "rad")}
    if motor:
        of_motor = run["motor_angle_rad"][:LONG] - of_motor
        wanted = {
            "motor": (of_motor, slopes[:, 0], "M", "mechanical", "rad"),
            "transmission": (joint - of_motor, slopes[:, 2] - slopes[:, 0], "T", "transmission", "rad"),
        }
    wanted["joint rate"] = (rate[:LONG] - m.w[m.rows], slopes[:, 3], "S", "sensor", "rad/s")
    assert list(made.equations) == list(wanted)
    for name, (missed, columns, letter, subsystem, unit) in wanted.items():
        found = made.equations[name]
        assert (found.letter, found.subsystem, found.unit) == (letter, subsystem, unit)
        assert list(found.columns) == list(PARAMETERS) and np.array_equal(found.valid, fit.valid)
        for number, parameter in enumerate(PARAMETERS):
            assert np.allclose(found.columns[parameter][:LONG], columns[:, number]), parameter
        told = sum(fit.values[each] * found.columns[each] for each in PARAMETERS)
        assert np.allclose((found.response - told)[:LONG], missed)
    assert made.priors == {name: (USUAL[name], deviation) for name, deviation in ankle.SPREAD.items()}
    assert made.values == fit.values and made.findings == [] and made.left_over
    assert (made.width, made.every, made.memory) == (1.5, 3, 0.9)
    assert made.noise_above == pytest.approx(10.0 * 3 * H)
    u = made.signals["u"]
    assert np.array_equal(made.regimes["upward"], u > 0.0) and np.array_equal(made.regimes["downward"], u < 0.0)
    assert np.array_equal(made.regimes["near reversals"], np.abs(u) <= 0.3 * np.max(np.abs(u[fit.valid])))
    if motor:
        assert made.whitened


def test_what_an_effect_in_the_simulation_does_is_in_the_response_again():
    fit = fit_of(table())
    effects = {(each.cause, each.at): each for each in Ankle().effects([ankle._recording(fit)])}
    scale = effects["sensor_scale", "joint_angle_rad"]
    fit.acting, fit.values = [Acting(scale, {}, ("scale",))], {**fit.values, "scale": 0.1}
    fit._take(fit.values, *fit._moved(fit.values))
    made = ankle._recording(fit)
    m = fit.runs[0].motion
    found = made.equations["transmission"]
    told = sum(fit.values[each] * found.columns[each] for each in PARAMETERS)
    run = fit.table
    missed = run["joint_angle_rad"] - run["motor_angle_rad"]
    missed = missed[:LONG] - (1.1 * m.a - m.p)[m.rows]
    assert np.allclose((found.response - told)[:LONG], missed + 0.1 * m.a[m.rows])
    assert made.acting == {scale.key({}): (0.1,)}


def test_a_law_that_fits_is_reported_as_a_note():
    run = table(low=0.2)
    (program, filtered) = ankle._recording(fit_of(run, of_program=True)).findings
    assert (program.channel, program.size, program.unit, program.severity) == ("target_angle_rad", 0.3, "rad", "note")
    assert (filtered.channel, filtered.size, filtered.unit, filtered.severity) == (
        "joint_angle_rad",
        0.00775,
        "s",
        "note",
    )
    for each in (program, filtered):
        assert each.kind == "law" and (each.start_s, each.end_s) == (TIME_S[0], TIME_S[-1])
    assert "limited to 0.3 rad from below, and 0.219 A/rad" in program.text and "7.75 ms" in filtered.text


def test_a_held_out_half_is_predicted_by_the_values_of_the_other(monkeypatch):
    """Without a fit: the prediction is the simulation's, the law alone a lag of D / K behind the command."""
    monkeypatch.setattr(_Fit, "improve", lambda self: None)
    run = table()
    values, (motor, joint) = ankle.predicted(run, run)
    assert (motor.channel, joint.channel) == ("motor_angle_rad", "joint_angle_rad")
    fit = fit_of(run)
    good, m = fit.valid[:LONG], fit.runs[0].motion
    assert values == fit.values
    for found, course in ((motor, m.p[m.rows]), (joint, m.a[m.rows])):
        angle = run[found.channel][:LONG]
        assert np.allclose(found.angle, angle[good]) and np.allclose(found.time_s, TIME_S[:LONG][good])
        shift = np.mean((angle - course)[good]) if found is joint else 0.0  # two encoders' zeros
        assert np.allclose(found.simulated, course[good] + shift)
        asked, keep, law = (
            (K * run["target_angle_rad"] + D * run["target_rate_rad_per_s"])[:LONG] / K,
            math.exp(-H * K / D),
            [],
        )
        state = angle[0]
        for each in asked:
            state = keep * state + (1.0 - keep) * each
            law.append(state)
        assert np.allclose(found.law_rad, np.array(law)[good])
    (alone,) = ankle.predicted(table(motor=False), table(motor=False))[1]
    assert alone.channel == "joint_angle_rad" and np.allclose(alone.simulated, fit_alone().a[fit_alone().rows][good])


def fit_alone():
    return fit_of(table(motor=False)).runs[0].motion
