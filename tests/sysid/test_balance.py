"""A machine in twenty lines has the candidates of its channels and its joint without naming them."""

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.balance import Balance
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.machine import Known, Quantity
from ranger_sim.sysid.pipeline import diagnose
from tests.sysid.robot_joint import HeavyJoint, Joint


class ThrustStand(Balance):
    """A motor's thrust by its rate squared, and nothing else."""

    name = "thrust-stand"
    quantities = (Quantity("command_rad_per_s", "rad/s", "of the rotor"), Quantity("thrust_N", "N", "of the load cell"))
    parameters = (Known("thrust_per_rate2", "N s^2/rad^2", 1e-5, 0.0, 1.0, "of the propeller"),)
    response = "thrust_N"

    def columns(self, s):
        return {"thrust_per_rate2": s["command_rad_per_s"] ** 2}


def stand(seed, offset=0.0, drift=0.0, rows=4000):
    draw = generator(seed, "thrust stand")
    time_s = 0.01 * np.arange(rows)
    rate = 400.0 + 200.0 * np.sin(0.7 * time_s + draw.uniform(0.0, 6.0)) + 80.0 * np.sin(2.9 * time_s)
    thrust = 2e-5 * rate**2 + offset + drift * time_s + 0.05 * draw.normal(size=rows)
    return Table(time_s, {"command_rad_per_s": rate, "thrust_N": thrust}, (slice(0, rows),), f"stand {seed}")


@pytest.mark.parametrize(
    ("hidden", "cause", "coefficient"), [("offset", "sensor_offset", "offset"), ("drift", "sensor_drift", "per_s")]
)
def test_an_error_of_the_load_cell_is_named_with_its_size(hidden, cause, coefficient):
    size = {"offset": 0.08, "drift": 0.004}[hidden]
    found = diagnose(ThrustStand(), [stand(1, **{hidden: size})], [stand(2, **{hidden: size})]).result
    first = found.causes[0]
    low, high = first.parameters[coefficient].ci95
    assert first.name == cause and low < size < high


def test_a_sound_stand_has_no_cause_and_reaches_its_noise():
    found = diagnose(ThrustStand(), [stand(3)], [stand(4)]).result
    assert not found.detected and found.evidence.above_noise_floor == ()


def test_a_joint_has_its_frictions_and_its_sensors_as_candidates():
    table = Table(
        0.01 * np.arange(500),
        {
            "angle_rad": np.sin(0.02 * np.arange(500)),
            "rate_rad_per_s": 2.0 * np.cos(0.02 * np.arange(500)),
            "current_A": np.cos(0.02 * np.arange(500)),
        },
        (slice(0, 500),),
    )
    joint = Joint()
    causes = {each.cause for each in joint.effects([joint.prepare(table)])}
    assert causes == {
        "sensor_offset", "sensor_drift", "sensor_lag", "viscous_friction", "coulomb_friction", "drag", "stribeck",
        "direction_friction", "load_friction", "parameter_drift", "spring", "once_per_turn", "gravity",
    }  # fmt: skip


def test_a_friction_that_grows_with_the_load_is_not_taken_for_a_lag():
    """A weight of 4 A on a joint, with 6 % of the load as friction: the arm of a robot, whose lag was -39 ms."""
    draw = generator(7, "loaded joint")
    t = 0.01 * np.arange(6000)
    angle = 1.2 * np.sin(0.9 * t) + 0.3 * np.sin(3.1 * t + 1.0)
    rate = 1.08 * np.cos(0.9 * t) + 0.93 * np.cos(3.1 * t + 1.0)
    acceleration = -0.972 * np.sin(0.9 * t) - 2.883 * np.sin(3.1 * t + 1.0)
    load = 0.4 * acceleration + 4.0 * np.cos(angle)
    current = load + 1.0 * rate + (0.6 + 0.06 * np.abs(load)) * np.sign(rate) + 0.03 * draw.normal(size=len(t))
    values = {"angle_rad": angle, "rate_rad_per_s": rate, "current_A": current}
    parts = [
        Table(t[part], {name: each[part] for name, each in values.items()}, (slice(0, 3000),), f"rows {part}")
        for part in (slice(0, 3000), slice(3000, 6000))
    ]
    first = diagnose(HeavyJoint(), parts[:1], parts[1:]).result.causes[0]
    low, high = first.parameters["share"].ci95
    assert first.name == "load_friction" and low < 0.06 < high


def test_gravity_and_a_turn_are_the_same_for_a_joint_in_degrees():
    class InDegrees(Joint):
        quantities = (Quantity("angle_rad", "deg", "of the joint"), *Joint.quantities[1:])

    def columns(machine, angle):
        values = {"angle_rad": angle, "rate_rad_per_s": np.gradient(angle, 0.01), "current_A": np.cos(time_s)}
        recording = machine.prepare(Table(time_s, values, (slice(0, 500),)))
        effects = {
            each.cause: each for each in machine.effects([recording]) if each.cause in ("gravity", "once_per_turn")
        }
        return {cause: each.columns(recording, each.shapes[0], {})["current_A"] for cause, each in effects.items()}

    time_s = 0.01 * np.arange(500)
    radians, degrees = columns(Joint(), np.sin(2.0 * time_s)), columns(InDegrees(), np.degrees(np.sin(2.0 * time_s)))
    assert set(degrees) == {"gravity", "once_per_turn"}
    for cause, expected in radians.items():
        assert degrees[cause] == pytest.approx(expected, abs=1e-12)


def test_a_column_without_a_parameter_is_a_mistake():
    class Wrong(ThrustStand):
        def columns(self, s):
            return {"thrust": s["command_rad_per_s"]}

    with pytest.raises(UserError, match="thrust-stand: columns of thrust, which are not among its parameters"):
        Wrong().prepare(stand(5))


def test_a_recording_without_a_channel_is_a_mistake_that_names_it():
    bare = Table(0.01 * np.arange(100), {"thrust_N": np.ones(100)}, (slice(0, 100),), "bare")
    with pytest.raises(UserError, match=r"bare: thrust-stand needs command_rad_per_s \(available: thrust_N\)"):
        ThrustStand().prepare(bare)


def test_an_inertia_is_found_where_the_rates_noise_exceeds_the_acceleration():
    """0.2 A s^2/rad on 40 s at 500 Hz; differences of the rate have twice the size of the acceleration in noise."""
    draw = generator(3, "noisy rate")
    t = 0.002 * np.arange(20_000)
    angle, rate, acceleration = np.zeros_like(t), np.zeros_like(t), np.zeros_like(t)
    for size, turn, phase in ((1.0, 2.1, 0.3), (0.4, 5.3, 1.1), (0.1, 11.7, 2.0)):
        angle += size * np.sin(turn * t + phase)
        rate += size * turn * np.cos(turn * t + phase)
        acceleration -= size * turn**2 * np.sin(turn * t + phase)
    current = 0.2 * acceleration + 0.7 * rate + 0.4 * np.sign(rate) + 0.05 * draw.normal(size=len(t))
    columns = {
        "angle_rad": angle + 2e-5 * draw.normal(size=len(t)),
        "rate_rad_per_s": rate + 0.1 * draw.normal(size=len(t)),
        "current_A": current,
    }
    noise = np.gradient(columns["rate_rad_per_s"], 0.002) - acceleration
    assert np.std(noise) > 2.0 * np.std(acceleration)
    found = diagnose(Joint(), [Table(t, columns, (slice(0, len(t)),), "noisy")]).result
    assert found.evidence.parameters["inertia_As2_per_rad"].value == pytest.approx(0.2, rel=0.05)


class Elbow(Balance):
    """A joint of which another one's acceleration is a part; the shoulder's channels have no declared role."""

    name = "elbow"
    quantities = (
        Quantity("shoulder_deg", "deg", "of the shoulder"),
        Quantity("shoulder_rate", "rad/s", "of the shoulder"),
        Quantity("angle_rad", "rad", "of the elbow"),
        Quantity("rate_rad_per_s", "rad/s", "of the elbow"),
        Quantity("torque_Nm", "N m", "of the elbow", drives=False),
    )
    parameters = (
        Known("inertia", "kg m^2", 0.1, 0.0, 10.0, ""),
        Known("coupling", "kg m^2", 0.1, 0.0, 10.0, ""),
        Known("coulomb", "N m", 0.1, 0.0, 10.0, ""),
    )
    response, angle, rate = "torque_Nm", "angle_rad", "rate_rad_per_s"

    def columns(self, s):
        shoulder = np.gradient(s["shoulder_rate"], s["t"])
        return {"inertia": s["acceleration"], "coupling": shoulder, "coulomb": s["direction"]}


def test_a_coupling_is_found_where_another_joints_rate_is_noisy():
    """0.05 kg m^2; the differences of the shoulder's rate have five times the noise that they have acceleration."""
    draw = generator(5, "elbow")
    t = 0.002 * np.arange(20_000)
    ways = [((1.0, 2.1, 0.3), (0.3, 6.1, 1.0)), ((0.8, 1.7, 0.9), (0.3, 4.9, 0.2))]
    angles, rates, accelerations = (
        [sum(made(size, turn, phase) for size, turn, phase in way) for way in ways]
        for made in (
            lambda size, turn, phase: size * np.sin(turn * t + phase),
            lambda size, turn, phase: size * turn * np.cos(turn * t + phase),
            lambda size, turn, phase: -size * turn**2 * np.sin(turn * t + phase),
        )
    )
    torque = 0.1 * accelerations[1] + 0.05 * accelerations[0] + 0.2 * np.sign(rates[1])
    columns = {
        "shoulder_deg": np.degrees(angles[0] + 2e-5 * draw.normal(size=len(t))),
        "shoulder_rate": rates[0] + 0.1 * draw.normal(size=len(t)),
        "angle_rad": angles[1] + 2e-5 * draw.normal(size=len(t)),
        "rate_rad_per_s": rates[1] + 0.1 * draw.normal(size=len(t)),
        "torque_Nm": torque + 0.02 * draw.normal(size=len(t)),
    }
    table = Table(t, columns, (slice(0, len(t)),), "elbow")
    stand_ins = Elbow().prepare(table).equations["torque_Nm"].stand_ins
    assert np.corrcoef(stand_ins["coupling"], accelerations[0])[0, 1] > 0.8  # 0.2 of the column itself
    found = diagnose(Elbow(), [table]).result
    assert not found.causes and found.evidence.parameters["coupling"].value == pytest.approx(0.05, rel=0.1)


def test_held_out_data_of_a_machine_with_the_other_sign_are_found():
    """Its parameters are fitted there anew; without checking them this was a sound answer."""
    other = stand(4)
    other.columns["thrust_N"] *= -1.0
    result = diagnose(ThrustStand(), [stand(3)], [other]).result
    assert [(each.channel, each.kind) for each in result.data_findings] == [("thrust_per_rate2", "other_held_out")]
    assert result.detected and not result.causes
