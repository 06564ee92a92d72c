# cython: boundscheck=False, wraparound=False, cdivision=True
# (the interval is kept inside the curve; the voltage is above zero where it divides)
"""Battery packs in parallel: open-circuit voltage against charge, internal resistance, charge counted.

Seven packs of 25.9 V and 67 Wh nominal (appendix 3.10); 493 Wh were used on the long walk, so capacity and
number are parameters. The terminal voltage of a step follows from the current of the motors and the constant
power of the electronics together (EQUATIONS 10.8):

    V = E(q) - R (I_motors + P / V)    solved for V as a quadratic, so a load of constant power is stable

When a pack is empty its protection opens (appendix 3.10, "undercharge"): voltage 0, `cut_off` true.
"""

import dataclasses
import math

import cython
from cython.cimports.libc.math import sqrt

from ranger_sim.foundation.numbers import reals
from ranger_sim.foundation.user_error import ModelError

# Open-circuit volts of one lithium-ion cell of the 18650 class at charge 0, 0.1 ... 1. Chosen by us after usual
# discharge curves of lithium cobalt oxide: 3.0 V and 4.2 V at the ends (appendix 3.10: 9 and 12.6 V for three
# cells), mean 3.70 V (25.9 V for seven).
CELL_VOLTS = (3.00, 3.45, 3.55, 3.60, 3.64, 3.68, 3.74, 3.82, 3.92, 4.02, 4.20)


@dataclasses.dataclass(frozen=True)
class BatteryParameters:
    """Packs in parallel, all alike."""

    packs: int = 7  # [A 3.10, the 65 km walk]
    cells_in_series: int = 7  # 25.9 V nominal at 3.7 V a cell [A 3.10]
    pack_energy_Wh: float = 67.0  # [A 3.10]
    # Chosen by us: seven cells at 55 mohm and a protection circuit of about 0.1 ohm. One pack then sags 3 V at
    # 140 W, as the battery logged at 24.0-27.5 V sags to 21.5 V (robot.md C6.2).
    pack_resistance_ohm: float = 0.5
    # Charge at power-up, 1 is full. Chosen by us: 26.7 V without load, in the logged range.
    charge: float = 0.7
    cell_volts: tuple[float, ...] = CELL_VOLTS

    def __post_init__(self) -> None:
        for name in ("packs", "cells_in_series", "pack_energy_Wh"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ModelError(f"battery: {name} is {value!r}, it must be above 0")
        if not (math.isfinite(self.pack_resistance_ohm) and self.pack_resistance_ohm >= 0.0):
            raise ModelError(f"battery: pack_resistance_ohm is {self.pack_resistance_ohm!r}, it must be 0 or more")
        if not 0.0 < self.charge <= 1.0:
            raise ModelError(f"battery: charge is {self.charge!r}, allowed is above 0 to 1 (full)")
        volts = self.cell_volts
        if len(volts) < 2 or any(a >= b for a, b in zip(volts, volts[1:], strict=False)) or volts[0] <= 0.0:
            raise ModelError(f"battery: cell_volts {volts!r} must hold at least two values that rise from above 0")

    @property
    def capacity_As(self) -> float:
        """Charge of all packs, from full to empty."""
        mean = sum(0.5 * (a + b) for a, b in zip(self.cell_volts, self.cell_volts[1:], strict=False)) / (
            len(self.cell_volts) - 1
        )
        return self.packs * self.pack_energy_Wh * 3600.0 / (self.cells_in_series * mean)


@cython.final
@cython.cclass
class Battery:
    """All packs. `voltage_V`: at the terminals; `charge`: 1 full ... 0 empty; `current_A`: out of the battery."""

    voltage_V: cython.double
    current_A: cython.double
    open_voltage_V: cython.double
    resistance_ohm: cython.double
    per_As: cython.double
    charge: cython.double
    delivered_J: cython.double
    lost_J: cython.double
    cut_off: cython.bint
    intervals: cython.longlong
    curve: cython.double[::1]
    parameters: object

    def __init__(self, parameters=None) -> None:
        p = parameters if parameters is not None else BatteryParameters()
        self.parameters = p
        self.curve = reals(p.cells_in_series * volts for volts in p.cell_volts)
        self.intervals = len(p.cell_volts) - 1
        self.resistance_ohm = p.pack_resistance_ohm / p.packs
        self.per_As = 1.0 / p.capacity_As
        self.charge = p.charge
        self.cut_off = False
        self.current_A = 0.0
        self.open_voltage_V = self.open_circuit_V(p.charge)
        self.voltage_V = self.open_voltage_V
        self.delivered_J = 0.0  # at the terminals
        self.lost_J = 0.0  # in the internal resistance

    @cython.ccall
    @cython.exceptval(check=False)
    def open_circuit_V(self, charge: cython.double) -> cython.double:
        """Voltage without load at a charge, straight between table points, extended straight above full."""
        x: cython.double = charge * self.intervals
        i: cython.longlong
        if x < 0.0:
            x = 0.0
        i = int(x)
        if i > self.intervals - 1:
            i = self.intervals - 1
        V: cython.double = self.curve[i]
        return V + (self.curve[i + 1] - V) * (x - i)

    @cython.ccall
    def step(self, h: cython.double, motor_current_A: cython.double, electronics_W: cython.double) -> cython.void:
        """`h` seconds at this mean current of all motors (A) and power of the electronics (W)."""
        a: cython.double
        root: cython.double
        V: cython.double
        amps: cython.double
        if self.cut_off:
            self.voltage_V = 0.0
            self.current_A = 0.0
            return
        a = self.open_voltage_V - self.resistance_ohm * motor_current_A
        root = a * a - 4.0 * self.resistance_ohm * electronics_W
        if root < 0.0:
            root = 0.0  # more than the battery can give: it gives the most it can
        V = 0.5 * (a + sqrt(root))
        if V <= 0.0:
            self.voltage_V = 0.0
            self.cut_off = True  # short circuit: the protection opens
            self.current_A = 0.0
            return
        amps = motor_current_A + electronics_W / V
        self.voltage_V = V
        self.current_A = amps
        self.charge -= amps * h * self.per_As
        self.delivered_J += V * amps * h
        self.lost_J += self.resistance_ohm * amps * amps * h
        self.open_voltage_V = self.open_circuit_V(self.charge)
        if self.charge <= 0.0:
            self.cut_off = True
            self.voltage_V = 0.0
