"""Runs of the benches against other integrators and balances; terms of a model on them by their own formulas."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.plant import terms as plant_terms
from ranger_sim.plant.electrics.motor_parameters import ANKLE_MOTOR, HIP_MOTOR
from ranger_sim.plant.mechanics.parameters import BodyParameters
from ranger_sim.sysid.benches import ankle_sine, leg, motor, motor_run, pulley, springs
from ranger_sim.sysid.benches.bench_terms import NOTHING, BenchTerms


def term(form, at, **values):
    """A term of a model file with these parameters, and what is left out as its form has it."""
    made = plant_terms.FORMS[form]
    return plant_terms.Term(made, at, {each.name: values.get(each.name, each.default) for each in made.parameters})


# --- the ankle on its sine --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cubic", [0.0, 30.0])
def test_an_ankle_on_its_sine_moves_as_another_integrator_says(cubic):
    """Without friction, so that every integrator is at its best; the cable stiffer with the cube of its stretch."""
    body = dataclasses.replace(BodyParameters(), foot_inertia_kg_m2=0.004, ankle_return_Nm_per_rad=0.5)
    smooth = dataclasses.replace(ANKLE_MOTOR, constant_friction_Nm=0.0, load_friction=0.0, viscous_friction_Nms=0.02)
    spring = 0.7 if cubic else 0.0
    chosen = [
        term("cable_stiffening", "inner_cable", cubic_Nm_per_rad3=cubic),
        term("spring", "inner_ankle", linear_Nm_per_rad=spring),
        term("spring", "inner_motor", linear_Nm_per_rad=0.5 * spring),
    ]
    with_terms = BenchTerms(chosen).of_bench("ankle-sine") if cubic else NOTHING
    found = ankle_sine.tracked(body, smooth, 1.0, 0.5, with_terms)
    GK, J_A = smooth.gear * smooth.torque_constant_Nm_per_A, smooth.reflected_inertia_kg_m2
    w = 2.0 * math.pi

    def target(t):
        return 1.05 + 0.85 * math.sin(w * t), 0.85 * w * math.cos(w * t)

    def current_of(t, p, u):
        angle, rate = target(t)
        return 11.219 * (angle - p) + 1.634 * (rate - u)

    def rates(t, y):
        p, a, u, v = y
        pull = body.ankle_spring_Nm_per_rad * (p - a) + cubic * (p - a) ** 3
        # a spring of a model pulls back; the one at the motor stands at the joint's side of its gear
        on_motor = GK * current_of(t, p, u) - 0.02 * u - pull - 0.5 * spring * p
        on_foot = pull - 0.5 * (a - body.ankle_return_rest_rad) - spring * a
        return u, v, on_motor / J_A, on_foot / 0.004

    start = (1.05, 1.05, 0.85 * w, 0.85 * w)
    t = found[:, 0]
    done = solve_ivp(rates, (-1.0, t[-1]), start, "DOP853", t, rtol=1e-9, atol=1e-11)
    assert t == pytest.approx(0.0005 * np.arange(1000), abs=1e-12)
    p, a, u, v = done.y
    for column, course in ((1, p), (2, a), (3, v)):
        assert found[:, column] == pytest.approx(course, abs=2e-5), column
    wanted = np.array(
        [(*target(each), current_of(each, *rest)) for each, rest in zip(t, zip(p, u, strict=True), strict=True)]
    )
    assert found[:, 4:6] == pytest.approx(wanted[:, :2]) and found[:, 6] == pytest.approx(wanted[:, 2], abs=2e-3)
    angle, rate = ankle_sine.sine(t, 1.0)
    assert angle == pytest.approx(found[:, 4]) and rate == pytest.approx(found[:, 5])


def test_a_log_of_the_sine_has_a_row_every_4_ms_and_a_current_every_52():
    made = ankle_sine.ankle_sine(frequency_hz=2.0, seconds=0.5)
    assert made.name == "ankle-sine 2 Hz"
    assert list(made.channels) == ["motor_angle_rad", "joint_angle_rad", "joint_rate_rad_per_s", "target_angle_rad",
                                   "target_rate_rad_per_s", "motor_current_A"]  # fmt: skip
    assert made["motor_angle_rad"].time_s == pytest.approx(0.004 * np.arange(125), abs=1e-9)
    assert made["motor_current_A"].time_s == pytest.approx(0.052 * np.arange(10), abs=1e-9)
    truth = ankle_sine.tracked(ankle_sine.HANGING, ankle_sine.MOTOR, 2.0, 0.5)
    for column, (name, noise) in enumerate((("motor_angle_rad", 5e-4), ("joint_angle_rad", 5e-4),
                                            ("joint_rate_rad_per_s", 0.05)), 1):  # fmt: skip
        off = made[name].value - truth[::8, column]
        assert 0.2 * noise < np.std(off) < noise and abs(np.mean(off)) < 0.2 * noise, name
    assert np.array_equal(made["target_angle_rad"].value, truth[::8, 4])
    assert np.array_equal(made["target_rate_rad_per_s"].value, truth[::8, 5])
    # a gain of 1 % and an offset of 0.01 A as deviations
    assert made["motor_current_A"].value == pytest.approx(truth[::104, 6], abs=0.03 * np.max(np.abs(truth[:, 6])) + 0.1)


# --- the motor's run --------------------------------------------------------------------------------------------------


def test_the_course_of_a_run_is_pieces_joined_without_jumps_under_a_sine_that_gets_faster():
    t = 0.00025 * np.arange(20_000)
    voltage, brake = motor_run.course(3, t)
    levels = generator(3, "motor-run: course").uniform(-6.0, 6.0, 7)
    assert np.max(np.abs(voltage)) <= 6.0 and 0.0 <= brake.min() <= brake.max() <= 0.2
    # each piece ramps for 0.3 s and then holds, below the sine
    sine = 1.5 * np.sin(2.0 * math.pi * t * (0.5 + 3.5 * t / t[-1]))
    for number in range(5):
        held = (t > number + 0.001) & (t < number + 0.299)
        assert voltage[held] == pytest.approx(np.clip(levels[number] + sine[held], -6.0, 6.0), abs=1e-9) or number == 0
    assert np.max(np.abs(np.diff(brake))) < 0.2 * 0.00025 * 1.01 / 1.0
    assert np.max(np.abs(np.diff(voltage))) < 12.0 / 0.3 * 0.00025 + 0.05


@pytest.mark.parametrize("warm", [False, True])
def test_a_run_of_the_motor_keeps_its_balances(warm):
    """What the cell shows is brake and load; what the motor has more turns its rotor; the winding's voltages add up."""
    chosen = [term("coulomb_friction", "hip_motor", change_Nm=0.2)] if warm else []
    t, run = motor_run.simulated(motor.BENCH_MOTOR, 2, BenchTerms(chosen), 6.0)
    assert t == pytest.approx(0.002 * np.arange(3000), abs=1e-9)
    p = motor.BENCH_MOTOR
    I, w, cell = run["current_A"], run["speed_rad_per_s"], run["torque_Nm"]  # noqa: E741
    voltage, brake = motor_run.course(2, 0.00025 * np.arange(24_000))
    assert np.array_equal(run["voltage_V"], voltage[::8])
    slope = np.gradient(w, 0.002)
    calm = np.abs(w) > 1.0
    calm[:50] = calm[-3:] = False
    sign = np.sign(w)
    held = brake[::8] * sign
    # slopes over two rows of 2 ms: some per cent where they change
    assert np.median(np.abs(cell - held - 0.002 * slope)[calm]) < 2e-4
    GK = p.gear * p.torque_constant_Nm_per_A
    # friction of a model stands at the robot's joint: by the bench's gear it is less
    friction = p.constant_friction_Nm + (0.2 * 14.0 / 66.0 if warm else 0.0) + p.load_friction * GK * np.abs(I)
    drives = GK * I - friction * sign - p.viscous_friction_Nms * w
    left = drives - cell - p.reflected_inertia_kg_m2 * slope
    assert np.median(np.abs(left)[calm]) < 1e-3 and np.median(np.abs(drives[calm])) > 0.05
    assert np.gradient(run["motor_angle_rad"], 0.002)[1:-1] == pytest.approx(14.0 * w[1:-1], abs=0.5)
    flows = calm & (np.abs(I) > 0.5)
    drops = p.loop_resistance_ohm * I + p.contact_drop_V * np.sign(I) + GK * w
    assert np.median(np.abs(run["voltage_V"] - drops)[flows]) < 0.03
    assert (
        run["temperature_C"][0] == pytest.approx(25.0, abs=0.01) and run["temperature_C"][-1] > run["temperature_C"][0]
    )


def test_a_recorded_run_is_what_truly_was_with_each_instrument_s_noise():
    made = motor_run.motor_run(seed=4, seconds=2.0)
    t, truth = motor_run.simulated(motor.BENCH_MOTOR, 4, NOTHING, 2.0)
    instruments = {"voltage_V": 0.004, "current_A": 0.004, "speed_rad_per_s": 0.03, "torque_Nm": 0.002}
    assert list(made.channels) == [*instruments, "motor_angle_rad"]
    for name, noise in instruments.items():
        off = made[name].value - truth[name]
        assert np.std(off) == pytest.approx(noise, rel=0.15) and abs(np.mean(off)) < 0.15 * noise, name
        assert np.array_equal(made[name].time_s, t)
    turns = made["motor_angle_rad"].value - truth["motor_angle_rad"]
    assert np.max(np.abs(turns)) <= math.pi / 4096 + 1e-9
    same = motor_run.error(made, motor.BENCH_MOTOR, 4, NOTHING)
    assert same == pytest.approx({"current_A": 0.004, "speed_rad_per_s": 0.03, "torque_Nm": 0.002}, rel=0.15)
    other = motor_run.error(made, dataclasses.replace(motor.BENCH_MOTOR, constant_friction_Nm=0.05), 4, NOTHING)
    assert other["speed_rad_per_s"] > 10.0 * same["speed_rad_per_s"]


# --- terms on a bench -------------------------------------------------------------------------------------------------


def test_each_bench_takes_what_it_can_show():
    electric = ["resistance_change", "contact_drop_change", "torque_constant_change", "resistance_temperature",
                "torque_constant_temperature", "dead_time"]  # fmt: skip
    friction, steady = ["coulomb_friction", "viscous_friction"], ["stribeck", "direction_friction", "drag"]
    wanted = {
        ("stall", "hip_motor"): electric,
        ("cantilever", "hip_motor"): electric + friction + steady,
        ("motor-run", "hip_motor"): [*electric, *friction, *steady, "cogging", "commutation_ripple"],
        ("motor-run", "hip_joint"): ["once_per_turn"],
        ("pulley", "hip_motor"): ["torque_constant_change", *friction],
        ("hip-spring", "hip_joint"): ["spring"],
        ("ankle-spring", "inner_ankle"): ["spring"],
        ("ankle-spring", "inner_cable"): ["cable_stiffening"],
        ("ankle-sine", "inner_motor"): [
            "torque_constant_change",
            *friction,
            *steady,
            "cogging",
            "commutation_ripple",
            "spring",
        ],
        ("ankle-sine", "inner_ankle"): [*friction, *steady, "once_per_turn", "spring"],
        ("ankle-sine", "inner_cable"): ["cable_stiffening", "cable_backlash", "cable_slack", "cable_damping"],
    }
    every = [
        term(form.name, at, **{each.name: each.low + 0.25 * (each.high - each.low) for each in form.parameters})
        for form in plant_terms.FORMS.values()
        for at in form.places
        if at in ("hip_motor", "hip_joint", "inner_motor", "inner_ankle", "inner_cable")
    ]
    for bench in {bench for bench, _ in wanted} | {"level"}:
        held = BenchTerms(every).of_bench(bench)
        for at in {each.at for each in every}:
            taken = [each.form.name for each in held.terms if each.at == at]
            assert sorted(taken) == sorted(wanted.get((bench, at), [])), (bench, at)
        left = BenchTerms(every).not_of_bench(bench)
        assert len(left) + len(held.terms) == len(every) and "sensor_lag at hip_motor" not in left
        assert all(f"{each.form.name} at {each.at}" in left for each in every if each not in held.terms)


def test_a_term_of_the_rotor_is_felt_by_the_bench_s_gear():
    """66:1 on the robot, 14:1 on the bench: torque over r at r times... the rate over r, r = 66 / 14."""
    r = 66.0 / 14.0
    drag = BenchTerms([term("drag", "hip_motor", quadratic_Nms2=0.3), term("drag", "hip_joint", quadratic_Nms2=0.05)])
    assert drag.torque_Nm("hip_motor", 0.0, 2.0) == pytest.approx(-0.3 * 4.0)
    assert drag.torque_Nm("hip_joint", 0.0, -2.0) == pytest.approx(0.05 * 4.0)
    assert drag.torque_Nm("inner_motor", 0.0, 2.0) == 0.0
    assert drag.output_Nm(0.0, 3.0, 14.0) == pytest.approx(-0.3 * (3.0 / r) ** 2 / r - 0.05 * 9.0)
    spring = BenchTerms([term("spring", "hip_joint", linear_Nm_per_rad=2.0)])
    assert spring.output_Nm(0.4, 0.0, 14.0) == pytest.approx(-0.8)
    at_rotor = BenchTerms([term("spring", "hip_motor", linear_Nm_per_rad=2.0)])
    assert at_rotor.output_Nm(0.4, 0.0, 14.0) == pytest.approx(-2.0 * 0.4 / r / r)
    assert NOTHING.output_Nm(0.4, 3.0, 14.0) == 0.0


@pytest.mark.parametrize(
    ("form", "value", "field", "wanted"),
    [
        ("resistance_change", 0.5, "series_resistance_ohm", lambda p, r: p.series_resistance_ohm + 0.5),
        ("contact_drop_change", 0.3, "contact_drop_V", lambda p, r: p.contact_drop_V + 0.3),
        ("torque_constant_change", 1.2, "torque_constant_Nm_per_A", lambda p, r: 1.2 * p.torque_constant_Nm_per_A),
        ("resistance_temperature", 0.004, "resistance_per_K", lambda p, r: p.resistance_per_K + 0.004),
        ("torque_constant_temperature", -0.002, "torque_constant_per_K", lambda p, r: p.torque_constant_per_K - 0.002),
        ("dead_time", 0.05, "dead_time_fraction", lambda p, r: p.dead_time_fraction + 0.05),
        ("coulomb_friction", 0.4, "constant_friction_Nm", lambda p, r: p.constant_friction_Nm + 0.4 / r),
        ("viscous_friction", 0.4, "viscous_friction_Nms", lambda p, r: p.viscous_friction_Nms + 0.4 / r / r),
    ],
)
def test_a_term_of_the_winding_or_of_friction_is_a_number_of_the_motor(form, value, field, wanted):
    base = motor.BENCH_MOTOR
    name = plant_terms.FORMS[form].parameters[0].name
    one = BenchTerms([term(form, "hip_motor", **{name: value})])
    assert one.places == []  # no torque beside the motor's own
    changed = one.motor("hip_motor", base)
    r = 66.0 / 14.0
    assert getattr(changed, field) == pytest.approx(wanted(base, r))
    assert dataclasses.replace(changed, **{field: getattr(base, field)}) == base
    assert one.motor("inner_motor", base) == base
    other = BenchTerms([term(form, "inner_motor", **{name: value})]).motor("inner_motor", ANKLE_MOTOR)
    assert getattr(other, field) == pytest.approx(wanted(ANKLE_MOTOR, 34.0 / ANKLE_MOTOR.gear))


def test_a_resistance_below_what_the_leads_have_is_the_winding_s():
    base = dataclasses.replace(motor.BENCH_MOTOR, series_resistance_ohm=0.1)
    less = BenchTerms([term("resistance_change", "hip_motor", change_ohm=-0.3)]).motor("hip_motor", base)
    assert less.series_resistance_ohm == 0.0 and less.loop_resistance_ohm == pytest.approx(
        base.loop_resistance_ohm - 0.3
    )
    some = BenchTerms([term("resistance_change", "hip_motor", change_ohm=-0.05)]).motor("hip_motor", base)
    assert some.series_resistance_ohm == pytest.approx(0.05) and some.resistance_ohm == base.resistance_ohm


def test_friction_and_inertia_are_those_that_were_fitted_at_the_bench_s_gear():
    found = {"constant_friction_Nm": 0.03, "viscous_friction_Nms": 0.004, "torque_constant_Nm_per_A": 0.25,
             "load_friction_Nm_per_A": 0.02, "inertia_kg_m2": 0.0004}  # fmt: skip
    made = BenchTerms([], found, gear=14.0)
    r = 66.0 / 14.0
    hip = made.motor("hip_motor", HIP_MOTOR)
    assert hip.constant_friction_Nm == pytest.approx(0.03 * r) and hip.viscous_friction_Nms == pytest.approx(
        0.004 * r * r
    )
    assert hip.load_friction == pytest.approx(0.08) and hip.rotor_inertia_kg_m2 == pytest.approx(0.0004 / 196.0)
    assert made.motor("inner_motor", ANKLE_MOTOR) == ANKLE_MOTOR
    # a small negative value is none, and what was not fitted stays
    none = BenchTerms([], {"constant_friction_Nm": -1e-3, "viscous_friction_Nms": -1e-4, "load_friction_Nm_per_A": -0.1,
                           "torque_constant_Nm_per_A": 0.2, "inertia_kg_m2": -1.0})  # fmt: skip
    hip = none.motor("hip_motor", HIP_MOTOR)
    assert (hip.constant_friction_Nm, hip.viscous_friction_Nms, hip.load_friction) == (0.0, 0.0, 0.0)
    assert hip.rotor_inertia_kg_m2 == HIP_MOTOR.rotor_inertia_kg_m2
    for part in ({"load_friction_Nm_per_A": 0.02}, {"inertia_kg_m2": 0.0, "torque_constant_Nm_per_A": 0.0}):
        same = BenchTerms([], part).motor("hip_motor", HIP_MOTOR)
        for each in dataclasses.fields(HIP_MOTOR):
            value, was = getattr(same, each.name), getattr(HIP_MOTOR, each.name)
            assert value == (pytest.approx(was) if isinstance(was, float) else was), each.name
    assert NOTHING.motor("hip_motor", HIP_MOTOR) == HIP_MOTOR


# --- pulley, springs, legs --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("tapped", [True, False])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_first_mass_that_moves_is_counted_by_5_g_from_the_one_that_balances(tapped, side):
    friction = pulley.StickFriction(C0s=0.02, C0d=0.012, mu_s=0.15, mu_d=0.1, C1=0.0033)
    for drive in (0.0, 0.1, -0.25):
        for scale in (1.0, 1.3):
            limit = scale * ((0.012 + 0.1 * abs(drive)) if tapped else (0.02 + 0.15 * abs(drive)))
            step = 0.005 * 9.81 * 0.025
            wanted = math.nan
            counts = range(600) if side > 0.0 else range(599, -1, -1)
            for steps in counts:
                over = steps * step - abs(drive)
                if over * side > limit:
                    wanted = 0.005 * steps
                    break
            found = pulley.first_mass_kg(friction, drive, side, tapped, scale)
            assert found == pytest.approx(wanted, nan_ok=True), (drive, scale)


def test_a_pulley_s_shaft_turns_by_what_is_over_its_friction():
    friction = pulley.StickFriction(C0s=0.02, C0d=0.012, mu_s=0.15, mu_d=0.1, C1=0.004)
    assert friction.speed(0.1, 0.2) == pytest.approx((0.1 - 0.012 - 0.02) / 0.004)
    assert friction.speed(-0.1, -0.2) == pytest.approx(-(0.1 - 0.032) / 0.004)
    assert friction.speed(0.032, 0.2) == 0.0 and friction.speed(-0.03, 0.2) == 0.0
    assert friction.holds(0.05, 0.2) and not friction.holds(-0.0501, 0.2)
    assert friction.moves(0.0321, -0.2) and not friction.moves(-0.032, 0.2)
    alike = pulley.StickFriction.of(motor.BENCH_MOTOR)
    assert dataclasses.astuple(alike) == (0.01, 0.01, 0.1, 0.1, 0.0033)


def test_trials_of_the_pulley_are_all_there_and_falling_masses_fall_by_their_weight():
    made = pulley.pulley(seed=2)
    current, mass, side, tapped, speed = (each.value for each in made.channels.values())
    falling = np.isin(mass, (0.06, 0.1, 0.14, 0.18, 0.22, 0.26, 0.3)) & (speed != 0.0)
    assert np.count_nonzero(falling) == 14
    over = mass[falling] * 9.81 * 0.025 - 0.01
    # friction scatters by 5 %, the encoder by 0.03 rad/s
    assert np.max(np.abs(speed[falling] - over / 0.0033)) < 4.0 * (0.05 * 0.01 / 0.0033) + 0.1
    rest = ~falling
    asked = {round(float(each), 2) for each in np.round(current[rest], 1)}
    assert asked == {-1.2, -0.9, -0.6, -0.3, 0.0, 0.3, 0.6, 0.9, 1.2}
    assert np.array_equal(np.unique(side), [-1.0, 1.0]) and np.array_equal(np.unique(tapped), [0.0, 1.0])
    assert np.count_nonzero(rest & (np.abs(current) < 0.1)) == 12
    assert not np.any(speed[rest]) and np.all(np.diff(made["mass_kg"].time_s) == 2.0)


def test_springs_are_pulled_with_the_hand_s_angles_and_the_tape_s_arm():
    body = BodyParameters()
    made = springs.hip_spring(seed=5)
    angle, force, side, out = (each.value for each in made.channels.values())
    assert len(angle) == 2 * 2 * 10 and np.array_equal(side, np.repeat([1.0, -1.0], 20))
    aimed = np.tile([0.1, 0.2, 0.3, 0.4, 0.5, 0.5, 0.4, 0.3, 0.2, 0.1], 4) * side
    assert np.max(np.abs(angle - aimed)) < 4.0 * 0.006 and np.std(angle - aimed) == pytest.approx(0.005, rel=0.4)
    assert np.array_equal(out, np.tile(np.repeat([1.0, 0.0], 5), 4))
    held = body.hip_spring_Nm_per_rad * np.abs(angle) + np.where(out > 0.0, 1.0, -1.0) * HIP_MOTOR.constant_friction_Nm
    assert force == pytest.approx(held / 0.96, abs=0.15)
    made = springs.ankle_spring(seed=5)
    angle, force, side = (each.value for each in made.channels.values())
    assert len(angle) == 2 * 4 * 6
    aimed = np.tile([0.05, 0.1, 0.15, 0.2, 0.25, 0.3], 8) * side
    assert np.max(np.abs(angle - aimed)) < 4.0 * 0.006
    both = body.ankle_spring_Nm_per_rad + body.ankle_return_Nm_per_rad
    assert force == pytest.approx(both * np.abs(angle) / 0.15, rel=0.03, abs=0.3)
    # terms pull as well: a spring at the ankle, a cable that stiffens
    more = BenchTerms([term("spring", "inner_ankle", linear_Nm_per_rad=3.0),
                       term("cable_stiffening", "inner_cable", cubic_Nm_per_rad3=200.0)])  # fmt: skip
    stiff = springs.ankle_spring(seed=5, terms=more)["force_N"].value
    assert stiff - force == pytest.approx((3.0 * np.abs(angle) + 200.0 * np.abs(angle) ** 3) / 0.15, rel=0.05, abs=0.3)
    bent = springs.hip_spring(seed=5, terms=BenchTerms([term("spring", "hip_joint", linear_Nm_per_rad=2.0)]))
    plain = springs.hip_spring(seed=5)
    extra = bent["force_N"].value - plain["force_N"].value
    assert extra == pytest.approx(2.0 * np.abs(plain["angle_rad"].value) / 0.96, abs=0.11)


def test_legs_are_held_level_hung_and_swung_one_after_the_other():
    body = BodyParameters()
    held = leg.level(body, seed=3)
    assert held["inner"].value.tolist() == [0.0] * 8 + [1.0] * 8
    outer, inner = leg.legs_of(body)
    for one, rows in ((outer, slice(0, 8)), (inner, slice(8, 16))):
        assert held["force_N"].value[rows] == pytest.approx(9.81 * one.cm_kg_m / body.leg_length_m, abs=0.25)
    hung = leg.hang(body, seed=3)
    assert hung["inner"].value.tolist() == [0.0] * 12 + [1.0] * 12
    for one, rows in ((outer, slice(0, 12)), (inner, slice(12, 24))):
        reach = 0.004 / (9.81 * one.cm_kg_m)
        off = hung["angle_rad"].value[rows] - one.rest_rad
        assert np.max(np.abs(off)) < reach + 4.0 * math.radians(0.05) + 0.003 and np.std(off) > 0.2 * reach
    swung = leg.pendulum(body, seed=3)
    count = 600
    assert swung["angle_rad"].time_s[:count] == pytest.approx(0.02 * np.arange(count))
    assert swung["angle_rad"].time_s[count:] == pytest.approx(24.0 + 0.02 * np.arange(count))
    assert swung["inner"].value.tolist() == [0.0] * count + [1.0] * count
    assert swung["angle_rad"].value[[0, count]] == pytest.approx(
        [outer.rest_rad + 0.12, inner.rest_rad + 0.12], abs=0.02
    )
