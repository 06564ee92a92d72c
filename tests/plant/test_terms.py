"""Additional named terms: each acts where it says, costs nothing when absent, and a bad file is refused by name."""

import math

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant import terms
from ranger_sim.plant.mechanics.leg import INNER, OUTER, Leg
from ranger_sim.plant.mechanics.parameters import BodyParameters
from ranger_sim.plant.mechanics.term_torques import TermTorques
from ranger_sim.plant.ranger import RangerPlant

STEP = 125_000


def torques(form, at, state=(0.0,) * 10, **values):
    """The five torques of one term at a state: h, outer, inner angle and rate, outer, inner motor angle and rate."""
    term = terms.Model([dict(form=form, at=at, **values)]).terms[0]
    rows = TermTorques(1.68, 66.0, 34.0, 0.05)
    rows.add(term.form.torque, *terms.ROW_PLACES[at], list(term.values.values()))
    outer, inner = Leg(OUTER, BodyParameters()), Leg(INNER, BodyParameters())
    hip = rows.torque_on_hip(state[0], state[1])
    rows.act_on_ankle(outer, *state[2:4], *state[6:8])
    rows.act_on_ankle(inner, *state[4:6], *state[8:10])
    return (hip, outer.extra_ankle, inner.extra_ankle, outer.extra_motor, inner.extra_motor)


MOVING = (0.2, 1.5, 0.3, -2.0, -0.1, 3.0, 0.35, -2.5, -0.15, 2.0)


def test_stribeck_friction_is_largest_at_low_speed():
    slow = torques("stribeck", "hip_joint", state=(0, 0.2) + (0,) * 8, excess_Nm=0.3, speed_rad_s=0.5)[0]
    fast = torques("stribeck", "hip_joint", state=(0, 5.0) + (0,) * 8, excess_Nm=0.3, speed_rad_s=0.5)[0]
    assert slow == pytest.approx(-0.3 * math.exp(-0.16) * math.tanh(4.0))
    assert abs(fast) < 1e-9


@pytest.mark.parametrize(
    "form, values, expected",
    [
        ("coulomb_friction", dict(change_Nm=0.2), -0.2 * math.tanh(30.0)),
        ("viscous_friction", dict(change_Nms=0.2), -0.3),
        ("drag", dict(quadratic_Nms2=0.2), -0.45),
        ("direction_friction", dict(coulomb_Nm=0.1, viscous_Nms=0.2), -0.4),
        ("spring", dict(linear_Nm_per_rad=2.0, square_Nm_per_rad2=3.0, rest_rad=0.1), -(0.2 + 0.03)),
        ("once_per_turn", dict(amplitude_Nm=0.5, phase_rad=0.1), 0.5 * math.sin(0.3)),
    ],
)
def test_torque_forms_have_their_formulas_at_the_hip(form, values, expected):
    assert torques(form, "hip_joint", state=MOVING, **values) == (pytest.approx(expected), 0.0, 0.0, 0.0, 0.0)


def test_the_five_places_of_a_torque_are_told_apart():
    for at, place in (("outer_ankle", 1), ("inner_ankle", 2), ("outer_motor", 3), ("inner_motor", 4)):
        rate = (-2.0, 3.0, -2.5, 2.0)[place - 1]
        shown = torques("viscous_friction", at, state=MOVING, change_Nms=1.0)
        assert shown[place] == -rate
        assert sum(x != 0.0 for x in shown) == 1


def test_angles_of_the_ankle_are_those_of_the_joint_sensor():
    # relative angle 0.3 of the body is 1.98 rad at the joint
    shown = torques("spring", "outer_ankle", state=MOVING, square_Nm_per_rad2=0.1)
    assert shown[1] == pytest.approx(-0.1 * 1.98**2)


def test_cogging_repeats_with_the_rotor():
    period = 2.0 * math.pi / (12 * 66.0)
    first = torques("cogging", "hip_motor", state=(0.1,) + (0,) * 9, amplitude_Nm=0.05, periods_per_turn=12)[0]
    later = torques("cogging", "hip_motor", state=(0.1 + period,) + (0,) * 9, amplitude_Nm=0.05, periods_per_turn=12)[0]
    assert first == pytest.approx(0.05 * math.sin(12 * 6.6))
    assert later == pytest.approx(first)


def test_a_commutation_ripple_is_one_of_torque_and_back_emf_where_the_motor_stands():
    plant = built(dict(form="commutation_ripple", at="outer_motor", fraction=0.1, periods_per_turn=14))
    plant.hold("outer", 0.1, 0.3)
    motor = plant.outer_ankle
    angle = plant.body.outer.motor_angle + plant.parameters.ankle_zero_rad
    plant.step()
    expected = 1.0 + 0.1 * math.sin(14 * 34 * angle)  # at rest: no mean over what the rotor goes through
    assert motor.angle_factor == pytest.approx(expected) and abs(expected - 1.0) > 0.01
    assert motor.torque_Nm(2.0, 0.0) == pytest.approx(34 * 0.018 * 2.0 * expected)
    assert plant.inner_ankle.angle_factor == plant.hip.angle_factor == 1.0 and plant.body.terms is None


def test_ripples_that_would_turn_the_torque_constant_round_are_refused():
    half = dict(form="commutation_ripple", at="hip_motor", fraction=0.5, periods_per_turn=7)
    with pytest.raises(UserError, match="ripples at hip_motor together are 1 of its torque constant"):
        built(half, half)
    assert len(built(half, half | dict(at="outer_motor")).hip.ripples) == 3


@pytest.mark.parametrize(
    "form, values, expected",
    [
        ("cable_stiffening", dict(cubic_Nm_per_rad3=1000.0), 1000.0 * 0.05**3),
        ("cable_backlash", dict(gap_rad=0.02), -14.0 * 0.02),
        ("cable_slack", dict(), 0.0),
        ("cable_damping", dict(damping_Nms=0.1), 0.1 * (-2.5 + 2.0)),
    ],
)
def test_cable_forms_pull_on_joint_and_motor_alike(form, values, expected):
    shown = torques(form, "outer_cable", state=MOVING, **values)  # stretch 0.05 rad, its rate -0.5 rad/s
    assert shown[1] == pytest.approx(expected) and shown[3] == pytest.approx(-expected)
    assert shown[0] == shown[2] == shown[4] == 0.0


def test_a_slack_cable_takes_the_linear_cables_push_away():
    shown = torques("cable_slack", "inner_cable", state=MOVING)  # stretch -0.05 rad
    assert shown[2] == pytest.approx(14.0 * 0.05)


def built(*tables):
    plant = RangerPlant(seed=1)
    terms.Model(list(tables)).apply(plant)
    return plant


def test_a_plant_without_terms_is_asked_for_none():
    plant = built()
    assert plant.body.terms is None and not plant.electrics.has_terms and not plant.hip.heat_matters
    assert built(dict(form="sensor_offset", at="gyro", value=0.01)).body.terms is None


def test_a_torque_term_of_zero_leaves_the_walk_as_it_is():
    ends = []
    for tables in ((), (dict(form="viscous_friction", at="outer_ankle", change_Nms=0.0),)):
        plant = built(*tables)
        plant.hold("outer", 0.1, 0.3)
        plant.release(0.7)
        for _ in range(400):
            plant.step()
        ends.append((plant.body.outer.angle, plant.body.inner.angle, plant.body.inner.foot_angle))
    assert ends[0] == ends[1]


def test_a_torque_term_acts_in_the_body():
    ends = []
    for k3 in (0.0, 20.0):
        plant = built(dict(form="spring", at="hip_joint", cubic_Nm_per_rad3=k3))
        plant.hold("outer", 0.1, 0.35)
        plant.release(0.7)
        for _ in range(800):
            plant.step()
        ends.append(plant.body.hip_angle())
    assert ends[1] < ends[0] - 1e-3  # the stiffer spring has pulled the legs together sooner


def test_electric_terms_reach_their_motor():
    plant = built(
        dict(form="resistance_temperature", at="hip_motor", per_K=0.0039),
        dict(form="torque_constant_temperature", at="outer_motor", per_K=-0.002),
        dict(form="resistance_change", at="inner_motor", change_ohm=0.2),
        dict(form="contact_drop_change", at="inner_motor", change_V=0.3),
        dict(form="dead_time", at="steering_motor", fraction=0.02),
    )
    assert plant.hip.heat_matters and plant.hip.resistance_per_K == 0.0039
    assert plant.outer_ankle.torque_constant_per_K == -0.002
    assert plant.inner_ankle.series_ohm == pytest.approx(0.258)
    assert plant.inner_ankle.contact_drop_V == pytest.approx(1.0)
    assert plant.steering_motor.dead_time_fraction == 0.02


def test_sensor_terms_change_what_the_boards_see():
    plain = built()
    plant = built(
        dict(form="sensor_scale", at="router_voltage", factor=0.5),
        dict(form="sensor_offset", at="outer_foot_left", value=0.1),
        dict(form="sensor_noise", at="steering_angle", deviation=0.0),
        dict(form="sensor_scale", at="hip_joint", factor=1.01),
        dict(form="eccentricity", at="outer_ankle_absolute", once_rad=0.01, twice_rad=0.002),
        dict(form="edge_jitter", at="hip_motor", edges=0.05),
        dict(form="disc_error", at="inner_motor", duty_edges=0.03),
        dict(form="bit_flip", at="hip_absolute", probability=0.5),
        dict(form="sensor_lag", at="gyro", time_constant_s=0.004),
        dict(form="gyro_misalignment", at="gyro", yaw_rad=0.02),
        dict(form="sensor_offset", at="roll", value=-0.03),
    )
    for p in (plain, plant):
        p.step()
    slope, zero = plant.electrics.slope_V[18], plant.electrics.zero_V[18]
    volts = (plant.analog_end[18] - zero) / slope
    assert volts == pytest.approx(0.5 * plant.electrics.battery.voltage_V, abs=0.15)
    assert plant.analog_end[12] - plain.analog_end[12] == pytest.approx(0.1, abs=0.03)
    assert plant.electrics.noise_V[16] == 0.0
    assert plant.hip_joint.scale == 1.01
    assert plant.outer_word.eccentricity_2 == 0.002
    assert plant.hip_motor.jitter == 0.05
    assert plant.inner_motor.has_errors and plant.inner_motor.threshold(3) == pytest.approx(3.03)
    assert plant.hip_word.bit_flip == 0.5
    assert plant.imu.lag_s == 0.004 and plant.imu.cross_x_from_z == 0.02
    assert plant.imu.roll_bias_rad == pytest.approx(plain.imu.roll_bias_rad - 0.03, abs=1e-15)
    assert plant.imu.bias_rad_s == plain.imu.bias_rad_s


def test_a_lagging_voltage_follows_with_its_time_constant():
    plant = built(
        dict(form="sensor_lag", at="outer_foot_left", time_constant_s=0.01),
        dict(form="sensor_noise", at="outer_foot_left", deviation=0.0),
    )
    electrics = plant.electrics
    electrics.settle(False, 0.0, False, 0.0, 0.0)
    low = electrics.analog_end[12]
    electrics.outer_feet.settle(True, 100.0)
    high = electrics.outer_feet.left_V
    for k in range(80):
        electrics.sense(k * STEP, (k + 1) * STEP, True, 100.0, False, 0.0, 0.0)
    assert (electrics.analog_end[12] - low) / (high - low) == pytest.approx(1.0 - math.exp(-1.0), abs=1e-9)


def write(folder, text):
    path = folder / "model.toml"
    path.write_text(text)
    return path


def test_a_model_file_is_read_and_checked(tmp_path):
    path = write(
        tmp_path,
        'title = "a rig"\n[[term]]\nform = "cogging"\nat = "hip_motor"\namplitude_Nm = 0.05\nperiods_per_turn = 12\n',
    )
    (term,) = terms.load(path).terms
    assert term.at == "hip_motor"
    assert term.values == {"amplitude_Nm": 0.05, "periods_per_turn": 12.0, "phase_rad": 0.0}
    plant = RangerPlant(model_file=path)
    assert plant.body.terms.count == 1


@pytest.mark.parametrize(
    "text, words",
    [
        ('[[term]]\nform = "coging"\n', "term 1: unknown form 'coging'"),
        ('[[term]]\nform = "drag"\nat = "nose"\n', "term 1 \\(drag\\): at is 'nose'; this form can stand at: hip_j"),
        ('[[term]]\nform = "drag"\nat = "hip_joint"\n', "quadratic_Nms2 is missing, a number from 0 to 10"),
        (
            '[[term]]\nform = "drag"\nat = "hip_joint"\nquadratic_Nms2 = -1\n',
            "quadratic_Nms2 is -1, allowed are 0 to 10 N m s",
        ),
        ('[[term]]\nform = "drag"\nat = "hip_joint"\nquadratic_Nms2 = nan\n', "quadratic_Nms2 is nan"),
        ('[[term]]\nform = "drag"\nat = "hip_joint"\nquadratic_Nms2 = "much"\n', "'much', it must be a number"),
        ('[[term]]\nform = "drag"\nat = "hip_joint"\nquadratic_Nms2 = true\n', "True, it must be a number"),
        (
            '[[term]]\nform = "drag"\nat = "hip_joint"\nquadratic_Nms2 = 1\nquadratic = 1\n',
            "quadratic is no parameter of this form; it has: quadratic_Nms2",
        ),
        ("terms = 1\n", "terms is not known here"),
        ("[term]\nform = 'drag'\n", "written \\[\\[term\\]\\]"),
        ("term = [3]\n", "term 1: a term is a table"),
        ("[[term]\n", "not valid TOML"),
    ],
)
def test_a_bad_model_file_is_refused_in_one_line_with_file_term_and_limit(tmp_path, text, words):
    path = write(tmp_path, text)
    with pytest.raises(UserError, match=words) as error:
        terms.load(path)
    assert str(error.value).startswith(str(path)) and "\n" not in str(error.value)


def test_a_model_file_that_is_not_there_is_a_users_mistake(tmp_path):
    with pytest.raises(UserError, match="No such file"):
        terms.load(tmp_path / "none.toml")


def test_a_file_that_is_no_text_is_a_users_mistake(tmp_path):
    path = tmp_path / "model.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(UserError, match="not UTF-8 text"):
        terms.load(path)


def test_terms_that_leave_no_resistance_are_refused():
    table = dict(form="resistance_change", at="hip_motor", change_ohm=-1.0)
    with pytest.raises(UserError, match="hip_motor together leave"):
        built(table, table)


def test_every_form_is_described_and_every_number_has_limits():
    text = terms.describe()
    for form in terms.FORMS.values():
        assert f"{form.name}: {form.meaning}" in text
        for p in form.parameters:
            assert p.low < p.high and p.unit
            assert p.default is None or p.low <= p.default <= p.high
