"""What the bench's instruments make of the truth: noise with memory, steps of a converter, a text file.

All channels pass the same integrating converter (mean over a sample's interval), as good data acquisition has it.
"""

import dataclasses

import numpy as np
from scipy.signal import lfilter

from tests.blind.generator.excitation import STEP_S

# Size of a step. Voltage: 16 bit over +/-20 V. Current: Hall sensor, 12 bit over
# +/-10 A. Speed: encoder of the brake by differences, filtered. Torque: load cell, 16 bit over +/-16 N m. Angle: 512
# lines, four edges each, on the rotor; of a joint an absolute encoder of 13 bit. Temperature: on the housing.
LSB = {
    "V": 0.001,
    "I": 0.005,
    "w": 0.005,
    "T": 0.0005,
    "q": 2.0 * np.pi / 8192.0,
    "theta": 2.0 * np.pi / 2048.0,
    "temperature": 0.1,
}
TEMPERATURE_NOISE_C = 0.05
SLOW_RAD_S = 12.0  # a joint's rate from its angle has the angle's noise times this, of what matters to a leg


@dataclasses.dataclass(frozen=True)
class Instruments:
    """noise: standard deviations by channel; memory: of one sample in the next; columns: {name in a file: channel}."""

    noise: dict
    memory: float
    columns: dict

    def balance_deviations(self, base, count):
        """(3, count // 2 + 1): standard deviation of the noise in balances E, M, T at the frequencies of a run's FFT.

        From the channels. Derivatives of a measured current (inductance), speed (inertia) and angle grow with
        frequency: they drown what an effect does within a few samples, and nothing slow. A leg's acceleration comes
        from its angle or from the back-EMF, whichever is quieter; its rate counts with what of it matters to a leg.
        Without a second angle there is no balance T.
        """
        v = {name: deviation**2 + LSB[name] ** 2 / 12.0 for name, deviation in self.noise.items()}
        turn = (2.0 * np.sin(np.pi * np.fft.rfftfreq(count)) / STEP_S) ** 2  # of a difference over one sample
        angle, torque = v.get("q", 0.0), v.get("T", 0.0)
        speed = v.get("w", angle * SLOW_RAD_S**2)
        back = (base["G"] * base["K"]) ** 2
        E = v["V"] + (base["R"] ** 2 + base["L"] ** 2 * turn) * v["I"] + back * speed
        M = torque + back * v["I"] + base["C1"] ** 2 * speed + (base["kh"] + base["mgc"]) ** 2 * angle
        M = M + base["J"] ** 2 * turn * v.get("w", 1.0 / (1.0 / np.maximum(turn * angle, 1e-300) + back / E))
        counts = LSB["theta"] ** 2 / 12.0 / base["G"] ** 2
        T = v["w"] + turn * counts if "w" in v else np.full(len(turn), np.inf)
        return np.sqrt((E, M, T))

    def show(self, rng, true):
        """Columns of a file from the true channels."""
        count = len(true["V"])
        out = {"t_s": np.round(np.arange(count) * STEP_S, 6)}
        for column, name in self.columns.items():
            step, value = LSB[name], true[name]
            if name in self.noise:
                start = rng.standard_normal()
                shocks = rng.standard_normal(count) * np.sqrt(1.0 - self.memory**2)
                noise = lfilter([1.0], [1.0, -self.memory], shocks, zi=[self.memory * start])[0]
                value = value + self.noise[name] * noise
            elif name == "temperature":
                value = value + TEMPERATURE_NOISE_C * rng.standard_normal(count)
            count_of = np.floor if name == "theta" else np.round
            out[column] = count_of(value / step) * step
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
