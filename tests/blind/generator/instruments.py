"""What the bench's instruments make of the truth: noise with memory, steps of a converter, a text file.

All channels pass the same integrating converter (mean over a sample's interval), as good data acquisition has it.
"""

import dataclasses

import numpy as np
from scipy.signal import lfilter

from tests.blind.generator.excitation import STEP_S

# Standard deviation of the noise and size of a step. Voltage: 16 bit over +/-20 V. Current: Hall sensor, 12 bit over
# +/-10 A. Speed: encoder of the brake by differences, filtered. Torque: load cell, 16 bit over +/-16 N m. Angle: 512
# lines, four edges each, on the rotor. Temperature: on the housing.
NOISE = {"V": 0.008, "I": 0.020, "w": 0.040, "T": 0.008}
LSB = {"V": 0.001, "I": 0.005, "w": 0.005, "T": 0.0005, "theta": 2.0 * np.pi / 2048.0, "temperature": 0.1}
TEMPERATURE_NOISE_C = 0.05
COLUMNS = ("t_s", "voltage_V", "current_A", "speed_rad_per_s", "torque_Nm", "temperature_C", "motor_angle_rad")


@dataclasses.dataclass(frozen=True)
class Instruments:
    """noise: standard deviations by channel; memory: of one sample of noise in the next."""

    noise: dict
    memory: float

    def balance_deviation(self, base, gear):
        """Standard deviation of the noise in balances E, M, T, from the four channels; of the slow part of it.

        The rotor's inertia times the speed's noise and the angle's counts over a sample are left out: both grow with
        frequency and are little where the effects are.
        """
        v = {name: deviation**2 + LSB[name] ** 2 / 12.0 for name, deviation in self.noise.items()}
        back = (gear * base["K"]) ** 2
        E = v["V"] + base["R"] ** 2 * v["I"] + back * v["w"]
        M = v["T"] + back * v["I"] + base["C1"] ** 2 * v["w"]
        return np.sqrt((E, M, v["w"]))

    def show(self, rng, true):
        """Columns of a file from the true channels."""
        count = len(true["V"])
        out = {"t_s": np.round(np.arange(count) * STEP_S, 6)}
        whole = {}
        for name in ("V", "I", "w", "T"):
            start = rng.standard_normal()
            shocks = rng.standard_normal(count) * np.sqrt(1.0 - self.memory**2)
            noise = lfilter([1.0], [1.0, -self.memory], shocks, zi=[self.memory * start])[0]
            whole[name] = true[name] + self.noise[name] * noise
        whole["theta"] = np.floor(true["theta"] / LSB["theta"]) * LSB["theta"]
        whole["temperature"] = true["temperature"] + TEMPERATURE_NOISE_C * rng.standard_normal(count)
        for column, name in zip(COLUMNS[1:], ("V", "I", "w", "T", "temperature", "theta"), strict=True):
            step = LSB[name]
            out[column] = np.round(whole[name] / step) * step
        return out


def write(path, columns):
    """A text file of the columns."""
    names = list(columns)
    decimals = {"t_s": 3, "voltage_V": 3, "current_A": 3, "speed_rad_per_s": 3, "torque_Nm": 4, "temperature_C": 1}
    row = ",".join(f"%.{decimals.get(name, 6)}f" for name in names) + "\n"
    table = np.column_stack([columns[name] for name in names])
    with open(path, "w", encoding="ascii") as file:
        file.write(",".join(names) + "\n")
        file.write(row * len(table) % tuple(table.ravel()))
