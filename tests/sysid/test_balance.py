"""A machine in twenty lines has the candidates of its channels and its joint without naming them."""

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.balance import Balance
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.machine import Known, Quantity
from ranger_sim.sysid.pipeline import diagnose
from tests.sysid.robot_joint import Joint


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
        "direction_friction", "friction_drift", "spring", "once_per_turn", "gravity",
    }  # fmt: skip


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
