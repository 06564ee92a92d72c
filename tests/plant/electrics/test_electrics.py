"""The voltages at the boards' converters, turned back by the firmware's constants; the electrical robot as a whole."""

import dataclasses
import os
import pathlib
import subprocess
import sys

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant import wiring_points as points
from ranger_sim.plant.electrics.drive import Drive
from ranger_sim.plant.electrics.electrics import Electrics, ElectricsParameters

STEP = 125_000
QUIET = ElectricsParameters(
    pwm_offset_A=0.0,
    motor_current_noise_A=0.0,
    battery_current_noise_A=0.0,
    steering_current_noise_A=0.0,
    voltage_noise_V=0.0,
    foot_noise_counts=0.0,
    steering_noise_V=0.0,
    battery_current_lag_s=0.0,
)
# robot.md N5, as the firmware writes them: the motor's current is -g (raw - off), the battery's
# g (raw - off), its voltage g raw; gains of the converter from robot.md N4.5.
FIRMWARE = {
    "hip": (0.00154, -9, 2, 0.000506, -4, 2, 0.0323),
    "outer_ankle": (-0.00152, 0, 2, 0.000502, -9, 2, 0.0327),
    "inner_ankle": (0.001525, -1, 2, 0.000502, -3, 2, 0.0324),
    "steering": (0.0001535, 25, 2, 0.0000505, -75, 20, 0.0327),
}


def ads7871(volts, gain):
    """14-bit counts, reference 2.5 V."""
    return round(gain * volts / 2.5 * 8192.0)


def internal(volts):
    """10-bit counts, reference 3.3 V."""
    return min(1023, int(volts / 3.3 * 1024.0))


def units(electrics):
    return (electrics.hip, electrics.outer_ankle, electrics.inner_ankle, electrics.steering)


def run(electrics, steps, start=0, rates=(0.0, 0.0, 0.0, 0.0), feet=(False, 0.0, False, 0.0), steering=0.0):
    for k in range(start, start + steps):
        for unit in units(electrics):
            unit.drive.watchdog_edge(k * STEP)
        electrics.step_motors(k * STEP, (k + 1) * STEP, *rates)
        electrics.sense(k * STEP, (k + 1) * STEP, *feet, steering)


@pytest.mark.parametrize("motor", range(4))
@pytest.mark.parametrize("counts", [150, -120])
def test_the_firmwares_constants_give_back_the_motors_current_and_the_batterys(motor, counts):
    electrics = Electrics(QUIET)
    unit = units(electrics)[motor]
    bridge = counts * (-1 if motor == points.OUTER_ANKLE else 1)
    unit.drive.write_pwm(0, max(0, bridge), max(0, -bridge), 600)
    run(electrics, 80)
    g, off, gain, battery_g, battery_off, battery_gain, volt_g = FIRMWARE[unit.name]
    raw = ads7871(electrics.analog_end[3 * motor], gain)
    assert -g * (raw - off) == pytest.approx(unit.current_A, abs=0.51 * abs(g))
    assert unit.current_A * counts > 0.0
    raw = ads7871(electrics.analog_end[3 * motor + 1], battery_gain)
    assert battery_g * (raw - battery_off) == pytest.approx(unit.battery_current_A, abs=0.51 * battery_g)
    raw = internal(electrics.analog_end[3 * motor + 2])
    assert 0.0 <= electrics.battery.voltage_V - volt_g * raw <= volt_g * 1.0001


def test_no_current_reads_as_the_boards_offsets():
    electrics = Electrics(QUIET)
    for motor, name in enumerate(points.MOTOR_NAMES):
        constants = FIRMWARE[name]
        assert ads7871(electrics.analog_end[3 * motor], constants[2]) == constants[1]
        assert ads7871(electrics.analog_end[3 * motor + 1], constants[5]) == constants[4]


def test_the_router_measures_voltage_and_current_of_the_electronics():
    # robot.md N5: A = 0.000501 (raw + 6), V = 0.03046 (raw + 5)
    electrics = Electrics(QUIET)
    run(electrics, 8)
    current = 0.000501 * (internal(electrics.analog_end[points.ROUTER_CURRENT]) + 6)
    volts = 0.03046 * (internal(electrics.analog_end[points.ROUTER_VOLTAGE]) + 5)
    assert volts == pytest.approx(electrics.battery.voltage_V, abs=0.031)
    assert current * volts == pytest.approx(5.15, abs=0.02)


def test_straight_feet_read_4803_counts_at_the_steering_sensor():
    electrics = Electrics(QUIET)
    run(electrics, 1)
    assert ads7871(electrics.analog_end[points.STEERING_ANGLE], 2) == 4803
    run(electrics, 1, start=1, steering=0.0736)  # 12 of the sensor's 1024 steps
    assert ads7871(electrics.analog_end[points.STEERING_ANGLE], 2) == pytest.approx(4803 + 12 * 16.9, abs=1)


def test_the_steering_sensor_has_ten_bits():
    electrics = Electrics(QUIET)
    shown = set()
    for k in range(400):
        run(electrics, 1, start=k, steering=-0.05 + k * 0.00025)
        shown.add(electrics.analog_end[points.STEERING_ANGLE])
    assert len(shown) in (16, 17)  # 0.1 rad of 6.28 rad with 1024 steps


def test_feet_reach_the_boards_as_700_and_7000_counts():
    electrics = Electrics(QUIET)
    run(electrics, 1000, feet=(True, 97.0, False, 0.0))
    for point in (points.OUTER_FOOT_LEFT, points.OUTER_FOOT_RIGHT):
        assert ads7871(electrics.analog_end[point], 1) == pytest.approx(7000, abs=2)
    for point in (points.INNER_FOOT_LEFT, points.INNER_FOOT_RIGHT):
        assert ads7871(electrics.analog_end[point], 1) == 700


def test_the_lines_of_successive_steps_join():
    electrics = Electrics()
    run(electrics, 1)
    for k in range(1, 50):
        before = list(electrics.analog_end)
        run(electrics, 1, start=k, feet=(k % 2 == 0, 50.0, False, 0.0))
        assert list(electrics.analog_start) == before


def test_the_current_sensor_jumps_when_its_lead_starts_to_switch():
    electrics = Electrics(dataclasses.replace(QUIET, pwm_offset_A=0.05))
    drive = electrics.hip.drive
    shown = []
    for leads in ((5, 0), (600, 595)):  # the same small drive by either lead, below the contact drop
        drive.write_pwm(0, *leads, 600)
        run(electrics, 8)
        shown.append(ads7871(electrics.analog_end[points.HIP_MOTOR_CURRENT], 2))
    assert electrics.hip.current_A == 0.0
    assert shown[1] == -9
    assert shown[0] == -9 - round(0.05 / 0.00154)


def test_the_offset_of_a_mirrored_motor_has_the_same_sign_at_its_bridge():
    electrics = Electrics(dataclasses.replace(QUIET, pwm_offset_A=0.05))
    electrics.outer_ankle.drive.write_pwm(0, 5, 0, 600)
    run(electrics, 8)
    assert ads7871(electrics.analog_end[points.OUTER_ANKLE_MOTOR_CURRENT], 2) == -round(0.05 / 0.00152)


def test_the_battery_current_is_smoothed_with_its_time_constant():
    electrics = Electrics(dataclasses.replace(QUIET, battery_current_lag_s=0.0005))
    electrics.hip.drive.write_pwm(0, 150, 0, 600)
    run(electrics, 4)
    early = electrics.battery_A[0]
    final = electrics.hip.battery_current_A
    assert 0.4 * final < early < 0.65 * final
    run(electrics, 80, start=4)
    assert electrics.battery_A[0] == pytest.approx(electrics.hip.battery_current_A, rel=1e-8)  # e^-20 is left


def test_the_voltage_sensor_clips_when_its_amplifier_is_modelled():
    electrics = Electrics(dataclasses.replace(QUIET, voltage_clip_V=25.0))
    run(electrics, 1)
    assert electrics.battery.voltage_V > 26.0
    assert internal(electrics.analog_end[points.HIP_BATTERY_VOLTAGE]) * 0.0323 == pytest.approx(25.0, abs=0.033)


def test_all_currents_meet_in_the_battery():
    electrics = Electrics(QUIET)
    electrics.hip.drive.write_pwm(0, 200, 0, 600)
    electrics.inner_ankle.drive.write_pwm(0, 150, 0, 600)
    run(electrics, 80, rates=(1.0, 2.0, 3.0, 0.0))
    total = sum(unit.battery_current_A for unit in units(electrics))
    assert electrics.motor_current_A == pytest.approx(total, rel=1e-12)
    assert electrics.battery.current_A == pytest.approx(total + 5.15 / electrics.battery.voltage_V, rel=1e-12)
    assert electrics.battery.voltage_V < 26.74
    assert electrics.electronics_J == pytest.approx(5.15 * 80 * 125e-6)


def test_the_motor_current_reaches_full_scale_near_12_6_amperes():
    # robot.md N5: full scale of the hip's converter
    electrics = Electrics(QUIET)
    volts = electrics.zero_V[0] + electrics.slope_V[0] * 12.6
    assert abs(ads7871(volts, 2)) == pytest.approx(8191, abs=10)


def test_noise_differs_by_seed_and_repeats_with_it():
    traces = []
    for seed in (1, 1, 2):
        electrics = Electrics(seed=seed)
        run(electrics, 20)
        traces.append(list(electrics.analog_end))
    assert traces[0] == traces[1] != traces[2]


def test_impossible_numbers_of_the_sensors_are_refused_by_name():
    with pytest.raises(UserError, match="foot_noise_counts"):
        ElectricsParameters(foot_noise_counts=-1.0)


TRACE = """
import struct
from ranger_sim.plant.electrics.electrics import Electrics
from ranger_sim.plant.sensors.imu import Imu
from ranger_sim.plant.sensors.incremental_encoder import IncrementalEncoder
from ranger_sim.plant.sensors.absolute_encoder import AbsoluteEncoder
from math import sin, cos
from ranger_sim.plant.electrics import electrics
e = Electrics(seed=7)
imu = Imu(seed=7)
encoder = IncrementalEncoder("m", 512, 34.0, -1, line_error=0.02, duty_error=0.03, jitter=0.02, seed=7)
word = AbsoluteEncoder("w", 1572, 1, bit_flip=0.01, seed=7)
for byte in (0xC4, 0xC1, 0x29, 0xCF):
    imu.receive_byte(0, byte)
out = []
for k in range(4000):
    t0, t1 = k * 125000, (k + 1) * 125000
    for unit in (e.hip, e.outer_ankle, e.inner_ankle, e.steering):
        unit.drive.watchdog_edge(t0)
        if k % 4 == 0:
            duty = int(200 * sin(k * 0.01))
            unit.drive.write_pwm(t0 + 3000, max(0, duty), max(0, -duty), 600)
    e.step_motors(t0, t1, 3 * sin(k * 0.003), 5 * cos(k * 0.01), 4.0 * sin(k * 0.02), 0.1)
    e.sense(t0, t1, k % 1000 < 500, 60.0 * (k % 500) / 500, k % 1000 > 450, 90.0, 0.05 * sin(k * 0.001))
    encoder.update(t0, t1, sin(k * 0.002), 16 * cos(k * 0.002), sin((k + 1) * 0.002), 16 * cos((k + 1) * 0.002))
    imu.update(t0, t1, 0.1 * sin(k * 0.002), 0.5, 0.1 * sin((k + 1) * 0.002), 0.5)
    out.append(struct.pack("<20d", *e.analog_end, e.battery.charge))
    out.append(struct.pack("<q", word.word(sin(k * 0.01))))
    for i in range(encoder.edges.count):
        out.append(struct.pack("<3q", *encoder.edges.edge(i)))
    for i in range(imu.bytes.count):
        out.append(struct.pack("<2q", imu.bytes.times[i], imu.bytes.values[i]))
for unit in (e.hip, e.outer_ankle, e.inner_ankle, e.steering):
    out.append(struct.pack("<4d", unit.drawn_J, unit.returned_J, unit.winding_J, unit.rotor_temperature_C))
import hashlib
print(electrics.__file__.endswith(".py"), hashlib.sha256(b"".join(out)).hexdigest())
"""


def test_interpreted_and_compiled_runs_give_the_same_bits():
    root = pathlib.Path(__file__).resolve().parents[3]
    shown = []
    for forced in ("0", "1"):
        result = subprocess.run(
            [sys.executable, "-c", TRACE],
            cwd=root,
            env={**os.environ, "RANGER_SIM_INTERPRETED": forced, "PYTHONHASHSEED": forced},
            capture_output=True,
            text=True,
            check=True,
        )
        shown.append(result.stdout.split())
    assert shown[1][0] == "True"
    assert shown[0][1] == shown[1][1]


def test_a_bridge_keeps_its_power_by_an_edge_in_time_and_gets_it_back_by_a_late_one():
    drive = Drive(watchdog_ns=10_000_000)
    drive.watchdog_edge(0)
    drive.apply(0)
    drive.watchdog_edge(10_000_000)  # at the last moment
    drive.apply(19_999_999)
    assert drive.powered and drive.power_losses == 0
    drive.watchdog_edge(20_000_001)  # too late: it has no power in between
    drive.apply(20_000_000)
    assert not drive.powered and drive.power_losses == 1
    drive.apply(20_000_001)
    assert drive.powered and drive.power_off_ns == 30_000_001
