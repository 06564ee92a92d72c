"""A walk's log on an even clock, cut into steps."""

import dataclasses
from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np

from ranger_sim.datatable.generated.all_variables import ID_OF, UNITS
from ranger_sim.sysid.channels import EXPERIMENTS
from ranger_sim.sysid.dataset import Array, Dataset

CLOCK_S = 0.002  # of the main brain's slots
SHORTEST_STEP_S, LONGEST_STEP_S = 0.25, 1.2
OUTER, INNER = 0, 1
# Signals by name: variables of the main brain's table; two with a sign between them are added or multiplied.
PLAIN = {
    "hip angle": "MCH_ANGLE",
    "hip rate": "MCH_ANG_RATE",
    "gyro": "UI_ANG_RATE_X",
    "outer leg angle": "E_LO_ANGLE",
    "inner leg angle": "E_LI_ANGLE",
    "outer leg rate": "E_LO_RATE",
    "inner leg rate": "E_LI_RATE",
    "hip motor angle": "MCH_MOTOR_POSITION",
    "hip motor rate": "MCH_MOTOR_VELOCITY",
    "hip current": "MCH_MOTOR_CURRENT",
    "hip command": "MCH_COMMAND_CURRENT",
    "hip power": "MCH_BATT_POWER",
    "hip battery current": "MCH_BATT_CURRENT",
    "outer ankle angle": "MCFO_RIGHT_ANKLE_ANGLE",
    "outer ankle rate": "MCFO_RIGHT_ANKLE_RATE",
    "outer motor angle": "MCFO_MOTOR_POSITION",
    "outer motor rate": "MCFO_MOTOR_VELOCITY",
    "outer current": "MCFO_MOTOR_CURRENT",
    "outer command": "MCFO_COMMAND_CURRENT",
    "outer power": "MCFO_BATT_POWER",
    "outer contact": "MCFO_LEFT_HEEL_SENSE",
    "inner ankle angle": "MCFI_MID_ANKLE_ANGLE",
    "inner ankle rate": "MCFI_ANKLE_RATE",
    "inner motor angle": "MCFI_MOTOR_POSITION",
    "inner motor rate": "MCFI_MOTOR_VELOCITY",
    "inner current": "MCFI_MOTOR_CURRENT",
    "inner command": "MCFI_COMMAND_CURRENT",
    "inner power": "MCFI_BATT_POWER",
    "inner contact": "MCFI_LEFT_HEEL_SENSE",
    "battery voltage": "MCH_BATT_VOLTAGE",
    "way": "E_DISTANCE",
    "foothold": "E_ANKLE_HEIGHT",
    "lean correction": "E_LO_ERROR",
    "mid-stance leg rate": "E_AM_L_ABSRATE",
    "mid-stance hip angle": "E_AM_H_ANG",
    "mid-stance hip rate": "E_AM_H_RATE",
    "time to mid-stance": "E_AM_TIME",
    "stance leg angle": "E_SS_L_ANG",
    "stance leg rate": "E_SS_L_ABSRATE",
    "leg state": "FSM_LEG",
    "hip state": "FSM_HIP",
    "outer state": "FSM_FO",
    "inner state": "FSM_FI",
}
VARIABLES = tuple(PLAIN.values())
COUNTED = ("FSM_LEG", "E_STEP_COUNT")  # each shows where a step ends
TOGETHER = (
    ("hip work", "hip current", "hip motor rate", "times"),
    ("outer work", "outer current", "outer motor rate", "times"),
    ("inner work", "inner current", "inner motor rate", "times"),
    ("hip twist", "hip angle", "hip motor angle", "less"),
    ("outer stretch", "outer ankle angle", "outer motor angle", "less"),
    ("inner stretch", "inner ankle angle", "inner motor angle", "less"),
)
SMOOTHED, SMOOTH_ROWS = {"slow gyro": "gyro"}, 9
ONCE_PER_STEP = ("FSM_", "E_STEP_COUNT", "E_AM_", "E_SS_", "E_LO_ERROR", "E_DISTANCE")
FAST_S = 0.009  # between the hip angle's values: above it, the log is of the data link


@dataclasses.dataclass(frozen=True)
class Steps:
    """A log's steps. signals: by name, (n,) on the even clock; ends: rows of strikes (k + 1,); leg: that swings (k,).

    A step is from a strike to the next one. every_s: usual time between two values of the hip's angle.
    """

    signals: Mapping[str, Array]
    ends: np.ndarray
    leg: np.ndarray
    every_s: float

    @property
    def late_rows(self) -> int:
        """Rows after a strike until every variable of it has its new value."""
        return 3 if self.every_s < FAST_S else 12

    @property
    def count(self) -> int:
        """Number of steps."""
        return len(self.leg)


def of_columns(columns: Mapping[str, Array], every_s: float = CLOCK_S) -> Steps | None:
    """Steps of variables on the even clock, each (n,); None where no variable shows where a step ends."""
    touches = _touches(columns)
    if touches is None or "MCH_ANGLE" not in columns:
        return None
    signals = {name: columns[variable] for name, variable in PLAIN.items() if variable in columns}
    for name, one, other, how in TOGETHER:
        if one in signals and other in signals:
            signals[name] = signals[one] * signals[other] if how == "times" else signals[one] - signals[other]
    for name, source in SMOOTHED.items():
        if source in signals:
            signals[name] = np.convolve(signals[source], np.full(SMOOTH_ROWS, 1.0 / SMOOTH_ROWS), "same")
    hip = signals["hip angle"]
    legs = np.where(hip[np.maximum(touches[1:] - 3, 0)] > 0.0, INNER, OUTER)
    return Steps(signals, touches, legs, every_s)


def _touches(columns: Mapping[str, Array]) -> np.ndarray | None:
    """Rows at which a step ends: where the leg machine changes its leg, or where the steps' number grows."""
    for name in COUNTED:
        if name in columns:
            number = columns[name] // 3 if name == "FSM_LEG" else columns[name]
            return np.asarray(np.flatnonzero(np.diff(number) != 0) + 1)
    return None


def of_dataset(dataset: Dataset) -> Steps | None:
    """Steps of a recording with the robot's variables or the names that the experiment `walk` gives them."""
    found = {}
    for name in {*VARIABLES, *COUNTED}:
        channel = _channel(dataset, name)
        if channel is not None and len(channel[0]) > 2:
            found[name] = channel
    hip = found.get("MCH_ANGLE")
    if hip is None or len(hip[0]) < 100:
        return None
    start, stop = float(hip[0][0]), float(hip[0][-1])
    grid = np.asarray(start + CLOCK_S * np.arange(int((stop - start) / CLOCK_S + 1e-6) + 1), dtype=np.float64)
    every_s = float(np.median(np.diff(hip[0])))
    columns = {name: on_clock(name, time_s, value, grid, every_s < FAST_S) for name, (time_s, value) in found.items()}
    return of_columns(columns, every_s)


def shows_steps(names: Collection[str]) -> bool:
    """Whether channels of these names show where a walk's steps end."""

    def has(variable: str) -> bool:
        return variable in names or any(name in names for name, _ in _other_names(variable))

    return has("MCH_ANGLE") and any(map(has, COUNTED))


def in_table_units(variable: str, unit: str) -> float:
    """Factor from a recording's unit of a variable to the master table's; recordings have s where the table has ms."""
    return 1e3 if unit == "s" and UNITS[ID_OF[variable]] == "ms" else 1.0


def _channel(dataset: Dataset, variable: str) -> tuple[Array, Array] | None:
    """Stamps and values of a variable under any of its names."""
    if variable in dataset:
        channel = dataset[variable]
        return channel.time_s, channel.value * in_table_units(variable, channel.unit)
    for name, sign in _other_names(variable):
        if name in dataset:
            return dataset[name].time_s, sign * dataset[name].value
    return None


def _other_names(variable: str) -> Iterator[tuple[str, float]]:
    """Names of a variable in the experiment `walk`, each with its sign against the variable."""
    wanted = {"E_LO_ANGLE": "outer_leg_angle_rad"}.get(variable, "")
    for each in EXPERIMENTS["walk"].channels:
        signs = {other.removeprefix("-"): -1.0 if other.startswith("-") else 1.0 for other in each.also}
        if variable in signs or each.name == wanted:
            to_name = signs.get(variable, 1.0)  # the variable's sign against the experiment's name
            for name, sign in ((each.name, 1.0), *signs.items()):
                yield name, to_name * sign


def by_link(columns: Mapping[str, Array], every: int, phases: Sequence[int]) -> dict[str, Array]:
    """Variables as a slow link brings them: one row in `every`, each variable with a phase (as many as variables, below
    `every`), on the even clock again."""
    out = {}
    for phase, (name, value) in zip(phases, sorted(columns.items()), strict=True):
        rows = np.arange(phase, len(value), every)
        clock = np.asarray(CLOCK_S * np.arange(len(value)), dtype=np.float64)
        out[name] = on_clock(name, clock[rows], value[rows], clock, fast=False)
    return out


def on_clock(name: str, time_s: Array, value: Array, grid: Array, fast: bool) -> Array:
    """A variable's values at the grid's times: held, as the main brain has them; of a slow log in straight lines, but
    for what changes once per step."""
    if fast or name.startswith(ONCE_PER_STEP):
        rows = np.searchsorted(time_s, grid + 0.25 * CLOCK_S, side="right") - 1
        return np.asarray(value[np.maximum(rows, 0)])
    return np.asarray(np.interp(grid, time_s, value))


def usual(steps: Steps) -> np.ndarray:
    """(k,) True for steps of a walk's usual length whose neighbour before is one too."""
    length_s = np.diff(steps.ends) * CLOCK_S
    good = (length_s > SHORTEST_STEP_S) & (length_s < LONGEST_STEP_S)
    alternate = np.ones(len(good), dtype=bool)
    alternate[1:] = steps.leg[1:] != steps.leg[:-1]
    return good & alternate
