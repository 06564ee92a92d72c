"""A walk's recording with its equations as functions of the body's numbers."""

import dataclasses
import functools
from collections.abc import Callable, Mapping

import numpy as np

from ranger_sim.plant import body_files
from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.machine import Recording
from ranger_sim.sysid.machines.walk.mechanics import Numbers

FEWEST_ROWS = 60  # of a usable equation
GYRO_BIAS_REACH_RAD_S = 0.02  # of any sound gyro: its log at rest spans -0.006 to 0.024 (robot.md C6.2)
SIGN_RAD_S = 0.05  # rate over which a sign changes, as in the plant (EQUATIONS 2.1)


@dataclasses.dataclass
class Rows:
    """One equation before it is linearised: left(numbers) -> (k,) at the rows `where`, and measured columns."""

    name: str
    letter: str
    subsystem: str
    unit: str
    where: np.ndarray
    left: Callable[[Numbers], Array]
    base: tuple[str, ...] = ()  # fields of Numbers that are fitted
    columns: dict[str, Array] = dataclasses.field(default_factory=dict)  # (n,), by parameter
    repeats: bool = False  # noise is the difference from stride to stride, otherwise the equation's whole residual
    fewest: int = FEWEST_ROWS
    floor: float = 0.0  # of the noise: the part that is the same in all strides, which their differences do not show


@functools.cache
def numbers_of(body: str) -> tuple[Numbers, float]:
    """Numbers of a body by name or file, and the joint angle of its sweet spot."""
    p = body_files.load(body).parameters
    return Numbers.of(p), p.ankle_zero_rad


@dataclasses.dataclass
class WalkRecording(Recording):
    """A recording with its equations as functions of `Numbers`, for the effects' columns."""

    rows: list[Rows] = dataclasses.field(default_factory=list)
    numbers: Numbers = dataclasses.field(default_factory=lambda: numbers_of("ranger")[0])
    gyro_bias_rad_s: float = 0.0  # in addition to the known one, by closures
    closures: tuple[np.ndarray, Array] | None = None  # rows of strikes, and the gyro's gain since the last, rad/s
    loads: dict[str, Array] = dataclasses.field(default_factory=dict)  # N m, of the cable, by equation
    places: np.ndarray | None = None  # (n,) of rows that may count: number of their place in the stride, else -1
    seen: dict[str, Array] = dataclasses.field(default_factory=dict)

    def slope(self, equation: str, changes: tuple[tuple[str, float], ...]) -> Array:
        """(n,) minus the derivative of an equation's residual, on a change of numbers: {field: weight}.

        The mean over the other strides at the same place: a stride's own derivative would share the noise of its
        accelerations with the residual, and its square would look like a mass of 3 % too much.
        """
        if changes == (("leg_lag_drift_s", 1.0),):  # the lag's, as it grows: it differs between the strides
            return self.slope(equation, (("leg_lag_s", 1.0),)) * np.linspace(-1.0, 1.0, len(self.table))
        key = f"{equation} by {changes}"
        if key not in self.seen:
            rows = next(each for each in self.rows if each.name == equation)
            steps = {field: weight * STEP for field, weight in changes}
            up, down = (_moved(self.numbers, steps, sign) for sign in (1.0, -1.0))
            out = np.zeros(len(self.table))
            out[rows.where] = -(rows.left(up) - rows.left(down)) / (2.0 * STEP)
            if self.places is not None:
                out[rows.where] = _of_others(out[rows.where], self.places[rows.where])
            self.seen[key] = out
        return self.seen[key]


def _of_others(values: Array, places: np.ndarray) -> Array:
    """Mean of the other values at the same place; where there are none, the value itself."""
    _, place, count = np.unique(places, return_inverse=True, return_counts=True)
    others = np.bincount(place, values)[place] - values
    return np.where(count[place] > 1, others / np.maximum(count[place] - 1, 1), values)


STEP = 1e-4  # of differences; all numbers are between 0.001 and 20 in SI, and residuals nearly linear in them


def _moved(numbers: Numbers, steps: Mapping[str, float], sign: float) -> Numbers:
    return dataclasses.replace(
        numbers, **{field: getattr(numbers, field) + sign * step for field, step in steps.items()}
    )
