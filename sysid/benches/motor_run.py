"""A run of the motor bench: the motor drives an inertia and a brake while its voltage goes through steps and sines.

    J_all w' = T(I, w) + terms - T_brake        T of EQUATIONS 2.1, J_all: rotor through the gearbox, and the load
    T_cell   = J_load w' + T_brake              what the load cell between gearbox and load shows

Channels are those of the experiment `motor-bench`. Electrics are the plant's own (`plant/electrics/motor_unit.py`),
mechanics are integrated by the midpoint of STEP_S; the brake is a torque that goes with the motion.
"""

import dataclasses
import math

import numpy as np

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.plant.electrics.motor_parameters import MotorParameters
from ranger_sim.plant.mechanics.friction import smoothed_sign
from ranger_sim.sysid.benches.bench_terms import NOTHING, BenchTerms
from ranger_sim.sysid.benches.motor import BENCH_MOTOR, Array
from ranger_sim.sysid.dataset import Channel, Dataset
from ranger_sim.sysid.instruments import CURRENT_SENSOR, TORQUE_CELL, VOLTMETER, Instrument

LOAD_kg_m2 = 0.002  # chosen by us: the motor reaches its speed within a quarter of a second
RECORD_S = 0.002
STEP_S = 0.00025
SECONDS = 20.0
PIECE_S = 1.0  # of the voltage's course
LARGEST_V = 6.0  # [A 8.2]
BRAKE_Nm = 0.2
# Chosen by us: an encoder on the rotor, its rate over some samples; a bench is calibrated before a run.
SPEED = Instrument("output speed", "rad/s", 0.03, 0.001, 0.0, 0.0, "chosen by us, as SHAFT_SPEED")
ROTOR = Instrument("rotor encoder", "rad", 0.0, 2.0 * math.pi / 4096, 0.0, 0.0, "chosen by us: 1024 lines")


def course(seed: int, times: Array) -> tuple[Array, Array]:
    """(voltage, brake's largest torque) over time: pieces that hold, ramp or swing, joined without jumps."""
    random = generator(seed, "motor-run: course")
    knots = np.arange(0.0, times[-1] + 2.0 * PIECE_S, PIECE_S)
    levels = random.uniform(-LARGEST_V, LARGEST_V, len(knots))
    voltage = np.interp(times, np.sort(np.concatenate([knots, knots[1:] - 0.7 * PIECE_S])), np.repeat(levels, 2)[:-1])
    voltage += 1.5 * np.sin(2.0 * math.pi * times * np.interp(times, [0.0, times[-1]], [0.5, 4.0]))
    brake = np.interp(times, knots + 0.5 * PIECE_S, random.uniform(0.0, BRAKE_Nm, len(knots)))
    return np.clip(voltage, -LARGEST_V, LARGEST_V), brake


def simulated(
    motor: MotorParameters, seed: int, terms: BenchTerms, seconds: float = SECONDS
) -> tuple[Array, dict[str, Array]]:
    """(stamps, channels) without instruments: what truly was."""
    fine: Array = STEP_S * np.arange(round(seconds / STEP_S), dtype=np.float64)
    voltage, brake = course(seed, fine)
    terms = terms.of_bench("motor-run")
    motor = terms.motor("hip_motor", motor)
    unit = terms.unit("hip_motor", dataclasses.replace(motor, watchdog_ns=10**18), "bench")
    unit.drive.watchdog_edge(0)
    all_inertia = motor.reflected_inertia_kg_m2 + LOAD_kg_m2
    step_ns = round(STEP_S * 1e9)
    angle = w = 0.0
    leads = (-1, -1)
    rows = []
    every = round(RECORD_S / STEP_S)

    def slope(angle: float, w: float, current: float, most: float) -> tuple[float, float]:
        held = most * smoothed_sign(w / motor.friction_smoothing_rad_s)
        unit.turn(angle, 0.0, 0.0)
        torque = unit.torque_Nm(current, w) + terms.output_Nm(angle, w, motor.gear)
        return (torque - held) / all_inertia, held

    for number, (V, most) in enumerate(zip(voltage.tolist(), brake.tolist(), strict=True)):
        now = number * step_ns
        wanted = (600 if V > 0.0 else 0, 600 if V < 0.0 else 0)
        if wanted != leads:
            unit.drive.write_pwm(now, *wanted, 600)
            leads = wanted
        rate, held = slope(angle, w, unit.current_A, most)
        if number % every == 0:
            cell = LOAD_kg_m2 * rate + held
            rows.append((V, unit.current_A, w, cell, motor.gear * angle, unit.housing_temperature_C))
        # at the speed of the step's middle
        unit.turn(angle, w + 0.5 * STEP_S * rate, STEP_S)
        unit.step_electrical(now, now + step_ns, w + 0.5 * STEP_S * rate, abs(V))
        current = unit.mean_current_A
        middle, _ = slope(angle + 0.5 * STEP_S * w, w + 0.5 * STEP_S * rate, current, most)
        angle += STEP_S * (w + 0.5 * STEP_S * rate)
        w += STEP_S * middle
    table = np.array(rows)
    names = ("voltage_V", "current_A", "speed_rad_per_s", "torque_Nm", "motor_angle_rad", "temperature_C")
    return fine[::every], {name: table[:, place] for place, name in enumerate(names)}


def motor_run(
    motor: MotorParameters = BENCH_MOTOR, seed: int = 1, terms: BenchTerms = NOTHING, seconds: float = SECONDS
) -> Dataset:
    """One run as the bench's instruments show it."""
    time_s, truth = simulated(motor, seed, terms, seconds)
    instruments = {
        "voltage_V": VOLTMETER,
        "current_A": CURRENT_SENSOR,
        "speed_rad_per_s": SPEED,
        "torque_Nm": TORQUE_CELL,
        "motor_angle_rad": ROTOR,
    }
    channels = {}
    for name, instrument in instruments.items():
        calibrated = dataclasses.replace(instrument, offset=0.0, gain=0.0)
        shown = calibrated.read(truth[name], seed, "motor-run")
        channels[name] = Channel(name, instrument.unit, time_s, shown, instrument.resolution, instrument.source)
    return Dataset("motor-run", channels)


def error(recorded: Dataset, motor: MotorParameters, seed: int, terms: BenchTerms) -> dict[str, float]:
    """Rms of recorded less simulated by channel, on the same course of voltage and brake."""
    seconds = float(recorded["speed_rad_per_s"].time_s[-1]) + RECORD_S
    _, made = simulated(motor, seed, terms, seconds)
    names = ("current_A", "speed_rad_per_s", "torque_Nm")
    return {name: float(np.sqrt(np.mean((recorded[name].value - made[name]) ** 2))) for name in names}
