"""The motor alone: stalled, and turning a shaft against a brake (appendix 8.2, figures 26, 28, 29, 31).

Both measure the plant's own motor (`plant/electrics/motor_unit.py`), fed by a DC supply: a bridge that does not switch.
A reading is taken when speed and current have settled.

    stall        voltage_V, current_A at a shaft that is held
    cantilever   voltage_V, current_A, speed_rad_per_s, torque_Nm at the output of the 14:1 gearbox, for -6 ... 6 V,
                 braking torque rising and falling, through zero speed and on into generating
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ranger_sim.plant.electrics.motor_parameters import MotorParameters
from ranger_sim.plant.electrics.motor_unit import MotorUnit
from ranger_sim.sysid.benches.bench_terms import NOTHING, BenchTerms
from ranger_sim.sysid.dataset import Channel, Dataset
from ranger_sim.sysid.instruments import CURRENT_SENSOR, SHAFT_SPEED, TORQUE_CELL, VOLTMETER, Instrument

Array = NDArray[np.float64]

# The bench's motor: 14:1 gearbox, C_0 of that box, no inductor, no bridge [A 8.2, 8.4; table 3]. C_1 by eq. 37.
BENCH_MOTOR = dataclasses.replace(
    MotorParameters(),
    gear=14.0,
    series_resistance_ohm=0.0,
    bridge_resistance_ohm=0.0,
    series_inductance_H=0.0,
    constant_friction_Nm=0.01,
    viscous_friction_Nms=0.0033,
)
VOLTAGES = (-6.0, -4.0, -2.0, 0.0, 2.0, 4.0, 6.0)  # [A 8.2]
BRAKES_Nm = 0.36  # largest braking torque. Chosen by us: about 2 A, which a gearbox of this size takes for a while
BRAKE_STEPS = 13  # from one end to the other, and back. Chosen by us
STALL_VOLTAGES = tuple(float(v) for v in (*np.arange(-3.6, -0.9, 0.2), *np.arange(1.0, 3.7, 0.2)))
SETTLED_NS = 50_000_000  # thousand time constants of the winding
READING_S = 2.0  # from one reading to the next. Chosen by us
LARGEST_SPEED = 80.0  # rad/s, where the search for a steady speed ends


class SuppliedMotor:
    """A motor at a DC supply: its current and torque at a voltage and an output speed."""

    def __init__(self, parameters: MotorParameters, terms: BenchTerms = NOTHING) -> None:
        parameters = terms.motor("hip_motor", parameters)
        self.terms = terms
        self.unit = MotorUnit("bench", dataclasses.replace(parameters, watchdog_ns=10**18))
        self.unit.drive.watchdog_edge(0)
        self.now = 0
        self.leads = (-1, -1)

    def settle(self, voltage_V: float, speed_rad_per_s: float) -> tuple[float, float]:
        """Current in A and output torque in N m after the current has settled."""
        leads = (600 if voltage_V > 0.0 else 0, 600 if voltage_V < 0.0 else 0)
        if leads != self.leads:
            self.unit.drive.write_pwm(self.now, *leads, 600)
            self.leads = leads
        self.unit.step_electrical(self.now, self.now + SETTLED_NS, speed_rad_per_s, abs(voltage_V))
        self.now += SETTLED_NS
        current = float(self.unit.current_A)
        more = self.terms.output_Nm(0.0, speed_rad_per_s, self.unit.gear)
        return current, float(self.unit.torque_Nm(current, speed_rad_per_s)) + more

    def steady_speed(self, voltage_V: float, load_Nm: float) -> float:
        """Output speed at which the motor carries `load_Nm`: torque falls with speed, so bisection finds it."""
        low, high = -LARGEST_SPEED, LARGEST_SPEED
        while high - low > 1e-7:
            middle = 0.5 * (low + high)
            if self.settle(voltage_V, middle)[1] > load_Nm:
                low = middle
            else:
                high = middle
        return 0.5 * (low + high)


def readings(name: str, seed: int, measured: dict[str, tuple[Array, Instrument | None]]) -> Dataset:
    """A dataset of single readings, READING_S apart; a column without an instrument has the set values."""
    count = len(next(iter(measured.values()))[0])
    time_s = np.asarray(READING_S * np.arange(count), dtype=np.float64)
    channels = {}
    for column, (truth, instrument) in measured.items():
        if instrument is None:
            channels[column] = Channel(column, "1", time_s, np.asarray(truth, dtype=np.float64), source="set")
        else:
            shown = instrument.read(truth, seed, name)
            channels[column] = Channel(
                column, instrument.unit, time_s, shown, instrument.resolution, f"{instrument.name}: {instrument.source}"
            )
    return Dataset(name, channels)


def stall(parameters: MotorParameters = BENCH_MOTOR, seed: int = 1, terms: BenchTerms = NOTHING) -> Dataset:
    """The shaft held, voltages of both signs from above the contact drop up."""
    motor = SuppliedMotor(parameters, terms.of_bench("stall"))
    voltages = np.array(STALL_VOLTAGES)
    currents = np.array([motor.settle(voltage, 0.0)[0] for voltage in STALL_VOLTAGES])
    return readings("stall", seed, {"voltage_V": (voltages, VOLTMETER), "current_A": (currents, CURRENT_SENSOR)})


def cantilever(parameters: MotorParameters = BENCH_MOTOR, seed: int = 1, terms: BenchTerms = NOTHING) -> Dataset:
    """Every voltage, the brake from driving to braking and back, each reading at its steady speed."""
    motor = SuppliedMotor(parameters, terms.of_bench("cantilever"))
    up = np.linspace(-BRAKES_Nm, BRAKES_Nm, BRAKE_STEPS)
    rows = []
    for voltage in VOLTAGES:
        for load in up:
            speed = motor.steady_speed(voltage, float(load))
            rows.append((voltage, motor.settle(voltage, speed)[0], speed, float(load)))
    there = np.array(rows).reshape(len(VOLTAGES), BRAKE_STEPS, 4)
    # the motor has no memory beyond its current: the way back passes the same points
    both = np.concatenate([there, there[:, ::-1]], axis=1).reshape(-1, 4)
    names = ("voltage_V", "current_A", "speed_rad_per_s", "torque_Nm")
    instruments = (VOLTMETER, CURRENT_SENSOR, SHAFT_SPEED, TORQUE_CELL)
    return readings("cantilever", seed, {n: (both[:, k], instruments[k]) for k, n in enumerate(names)})
