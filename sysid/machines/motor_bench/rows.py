"""The mechanical balance at the rows, or as means from each row to the next.

A voltage that is held from row to row changes in steps, and the acceleration with it: a difference of speeds over two
rows is then another one than that at the row. From a row to the next the balance of the means holds: the speed's
change is known, and the current falls from its value at the row with the voltage that the speed induces.
"""

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from ranger_sim.sysid import signals
from ranger_sim.sysid.dataset import Array, Table
from ranger_sim.sysid.machines.motor_bench.stand_ins import current_by_voltage

CLEARLY = 0.98  # of what is left: the voltage is held only where that leaves less

ROUNDS = 2  # of the time in which the motor settles, which the means depend on


@dataclasses.dataclass(frozen=True)
class Rows:
    """held: means from row to row under a held voltage. induced: the current's change per change of the speed; weight:
    of the next row in the mean of the speed, which is above a half where it settles exponentially."""

    table: Table
    held: bool
    induced: float
    weight: float = 0.5

    def mean(self, column: Array) -> Array:
        """Of a channel that moves in straight lines between rows."""
        return self._with_next(lambda here, there: 0.5 * (here + there), column) if self.held else column

    def mean_speed(self, speed: Array) -> Array:
        """Of the speed, whose slope falls from each row to the next."""
        share = self.weight
        return self._with_next(lambda a, b: (1.0 - share) * a + share * b, speed) if self.held else speed

    def current(self, current: Array, speed: Array) -> Array:
        """Mean of the current, whose voltage stays while the speed moves."""
        return current - self.induced * (self.mean_speed(speed) - speed)

    def slope(self, speed: Array) -> Array:
        """Rate of change of the speed."""
        step_s = self.table.step_s
        if self.held:
            return self._with_next(lambda here, there: (there - here) / step_s, speed)
        return np.gradient(speed, step_s)

    def _with_next(self, made: Callable[[Array, Array], Array], column: Array) -> Array:
        def of_run(part: Array) -> Array:
            return np.asarray(made(part, np.append(part[1:], part[-1:])))

        return signals.per_run(self.table, of_run, column)


def rows_of(
    table: Table, rough: tuple[float, float, float], s: dict[str, Array], w: Array, T: Array, counts: np.ndarray
) -> Rows:
    """Means where they clearly leave less than the balance at the rows, and than means of a voltage in straight lines.

    s: signals; rough: R, V_c, K G. The current is that of the voltage, whose noise is small.
    """
    at, held = Rows(table, False, 0.0), Rows(table, True, rough[2] / rough[0])
    current = current_by_voltage(table["voltage_V"], w, *rough)
    sign = -s["sgn_w"] * np.sign(s["I"])

    def left(rows: Rows, current: Array) -> tuple[float, float]:
        """(norm of what is left, time in which the motor settles, s)."""
        rest = [rows.mean(s["sgn_w"]), rows.mean_speed(w), rows.slope(w)]
        columns, response = np.column_stack([current, sign * current, *rest])[counts], rows.mean(T)[counts]
        found = np.linalg.lstsq(columns, response, rcond=None)[0]
        slows = rough[2] / rough[0] * (found[0] - found[1]) - found[3]  # torque lost per speed, while it drives
        settles_s = float(-found[-1] / slows) if slows > 0.0 else 0.0
        return float(np.linalg.norm(response - columns @ found)), settles_s

    others = left(at, current)[0], left(held, held.mean(current))[0]
    mine, settles_s = left(held, held.current(current, w))
    if mine >= CLEARLY * min(others):
        return at
    for _ in range(ROUNDS):
        if settles_s <= 0.0:
            break
        part = table.step_s / settles_s
        settled = -math.expm1(-part)
        held = dataclasses.replace(held, weight=(1.0 - settled / part) / settled)
        settles_s = left(held, held.current(current, w))[1]
    return held
