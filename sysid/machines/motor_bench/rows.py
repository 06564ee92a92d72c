"""The mechanical balance at the rows, or as means from each row to the next.

A voltage that is held from row to row changes in steps, and the acceleration with it: a difference of speeds over two
rows is then another one than that at the row. From a row to the next the balance of the means holds: the speed's
change is known, and the current falls from its value at the row with the voltage that the speed induces.
"""

import dataclasses
from collections.abc import Callable

import numpy as np

from ranger_sim.sysid import signals
from ranger_sim.sysid.dataset import Array, Table
from ranger_sim.sysid.machines.motor_bench.stand_ins import current_by_voltage

CLEARLY = 0.98  # of what is left: the voltage is held only where that leaves less


@dataclasses.dataclass(frozen=True)
class Rows:
    """held: means from row to row under a held voltage. induced: the current's change per change of the speed."""

    table: Table
    held: bool
    induced: float

    def mean(self, column: Array) -> Array:
        """Of a channel that moves in straight lines between rows."""
        return self._with_next(lambda here, there: 0.5 * (here + there), column) if self.held else column

    def current(self, current: Array, speed: Array) -> Array:
        """Mean of the current, whose voltage stays while the speed moves."""
        return current - self.induced * (self.mean(speed) - speed)

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

    def left(rows: Rows, current: Array) -> float:
        rest = [rows.mean(s["sgn_w"]), rows.mean(w), rows.slope(w)]
        columns, response = np.column_stack([current, sign * current, *rest])[counts], rows.mean(T)[counts]
        found = np.linalg.lstsq(columns, response, rcond=None)[0]
        return float(np.linalg.norm(response - columns @ found))

    others = left(at, current), left(held, held.mean(current))
    return held if left(held, held.current(current, w)) < CLEARLY * min(others) else at
