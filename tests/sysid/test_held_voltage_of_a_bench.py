"""A bench whose voltage is set once a row: the mechanical balance is one of means, and its inertia the true one.

The motor has no friction that changes its sign: from row to row its speed settles exponentially, in closed form.
"""

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.machines.motor_bench import MotorBench

STEP_S, ROWS, FINE = 0.01, 1500, 100
R, V_C, K, C, J = 1.3, 0.7, 0.25, 0.003, 9e-4
SETTLES_S = J / (K * K / R + C)


def turned(held):
    """Voltages that move about 6 V, held over each row or on straight lines; its speed keeps its sign."""
    rows = np.arange(ROWS + 1)
    volts = 6.0 + 2.5 * np.sin(2.0 * np.pi * 2.3 * STEP_S * rows) + np.sin(2.0 * np.pi * 0.7 * STEP_S * rows)
    places = np.arange(ROWS * FINE) / FINE
    fine = np.repeat(volts[:-1], FINE) if held else np.interp(places, rows, volts)
    keep, speed, speeds = np.exp(-STEP_S / FINE / SETTLES_S), 18.0, []
    load = 0.2 * np.sin(2.0 * np.pi * 0.37 * STEP_S * places)
    for each, torque in zip(fine.tolist(), load.tolist(), strict=True):
        speeds.append(speed)
        final = (K * (each - V_C) / R - torque) / (K * K / R + C)
        speed = final + (speed - final) * keep
    w = np.array(speeds)
    noise = generator(3, f"held voltage {held}").normal(size=(4, ROWS))
    columns = {
        "voltage_V": volts[:-1],
        "current_A": ((fine - V_C - K * w) / R)[::FINE] + 2e-3 * noise[1],
        "speed_rad_per_s": w[::FINE] + 2e-3 * noise[2],
        "torque_Nm": load[::FINE] + 1e-4 * noise[3],
        "motor_angle_rad": (14.0 * STEP_S / FINE * (np.cumsum(w) - 0.5 * (w + w[0])))[::FINE],
    }
    return Table(STEP_S * rows[:-1], columns, (slice(0, ROWS),), "bench")


def balance(table):
    made = MotorBench().prepare(table)
    equation = made.equations["mechanical"]
    names = ("torque_constant_Nm_per_A", "viscous_friction_Nms", "inertia_kg_m2")
    columns = np.column_stack([equation.columns[name] for name in names])[equation.valid]
    response = equation.response[equation.valid]
    return made, dict(zip(names, np.linalg.lstsq(columns, response, rcond=None)[0], strict=True)), names


def test_a_held_voltage_gives_means_whose_numbers_are_the_motors():
    """The load, which moves within a row, makes the inertia 2 % too small; the slope at a row's start is the steepest,
    and a balance at the rows has an inertia that is too large."""
    made, found, names = balance(turned(held=True))
    assert made.between_rows["voltage_V"] == "held"
    assert [found[name] for name in names] == pytest.approx([K, C, J], rel=0.03)


def test_a_held_voltage_leaves_little_between_angle_and_speed():
    """Simpson's rule takes the speed for smooth: a bend at each row leaves some times as much."""
    table = turned(held=True)
    transmission = balance(table)[0].equations["transmission"]
    turning = np.gradient(table["motor_angle_rad"], STEP_S) / 14.0
    smooth = turning - np.convolve(table["speed_rad_per_s"], (1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0), mode="same")
    assert np.std(transmission.response[transmission.valid]) < 0.2 * np.std(smooth[transmission.valid])


def test_a_voltage_on_straight_lines_leaves_the_balance_at_its_rows():
    made = balance(turned(held=False))[0]
    assert "voltage_V" not in made.between_rows
    assert np.array_equal(made.equations["mechanical"].response, made.table["torque_Nm"])
