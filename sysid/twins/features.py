"""Some hundred numbers per step: what a person would read off the curves, by signal and reduction."""

from collections.abc import Callable

import numpy as np

from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.twins.steps import CLOCK_S, Steps

END = 6  # rows before the strike of which a mean is taken
MID = 3  # rows on either side of the middle
EARLY_S, EARLY_ROWS = 0.05, 3  # after the strike: the swing's begin

Reduction = Callable[[Array, int, int], float]


def _end(x: Array, a: int, b: int) -> float:
    return float(x[max(a, b - END) : b - 1].mean())


def _mid(x: Array, a: int, b: int) -> float:
    middle = (a + b) // 2
    return float(x[middle - MID : middle + MID].mean())


def _early(x: Array, a: int, b: int) -> float:
    at = a + round(EARLY_S / CLOCK_S)
    return float(x[at - EARLY_ROWS : at + EARLY_ROWS].mean())


REDUCTIONS: dict[str, Reduction] = {
    "mean": lambda x, a, b: float(x[a:b].mean()),
    "square": lambda x, a, b: float((x[a:b] ** 2).mean()),
    "top": lambda x, a, b: float(np.abs(x[a:b]).max()),
    "high": lambda x, a, b: float(x[a:b].max()),
    "low": lambda x, a, b: float(x[a:b].min()),
    "spread": lambda x, a, b: float(x[a:b].std()),
    "end": _end,
    "mid": _mid,
    "early": _early,
    "before": lambda x, a, b: float(x[b - 1]),
    "after": lambda x, a, b: float(x[min(b, len(x) - 1)]),  # both of a signal moved to when the estimator has it
    "gain": lambda x, a, b: float(x[min(b, len(x) - 1)] - x[a]),
    "median": lambda x, a, b: float(np.median(x[a:b])),
    **{f"in state {n}": lambda x, a, b, n=n: float((x[a:b] == n).sum()) * CLOCK_S for n in range(9)},  # type: ignore[misc]
}
_MOTOR = (("command", "mean square"), ("power", "mean square"), ("current", "mean square top"), ("work", "mean"))
_TABLE: tuple[tuple[str, str], ...] = (
    ("hip angle", "early end mid top"),
    ("hip rate", "early end mid top"),
    ("gyro", "end mean"),
    ("slow gyro", "low high"),
    ("outer leg angle", "end"),
    ("inner leg angle", "end"),
    ("outer leg rate", "early mid end"),
    ("inner leg rate", "early mid end"),
    ("mid-stance leg rate", "before"),
    ("mid-stance hip angle", "before"),
    ("mid-stance hip rate", "before"),
    ("time to mid-stance", "before"),
    ("stance leg angle", "after"),
    ("stance leg rate", "after"),
    ("lean correction", "after"),
    ("way", "gain"),
    ("foothold", "end"),
    *((f"{motor} {signal}", how) for motor in ("hip", "outer", "inner") for signal, how in _MOTOR),
    ("hip battery current", "mean"),
    ("hip twist", "mean spread"),
    *(
        (f"{leg} {signal}", how)
        for leg in ("outer", "inner")
        for signal, how in (
            ("stretch", "mean spread high low"),
            ("ankle angle", "mean low high end mid"),
            ("ankle rate", "low high"),
            ("contact", "mean high"),
        )
    ),
    ("battery voltage", "median"),
)
_STATES = (
    ("hip state", range(1, 9)),
    ("leg state", range(6)),
    ("outer state", range(1, 6)),
    ("inner state", range(1, 6)),
)
FEATURES: tuple[tuple[str, str, str], ...] = (
    *((f"{signal} {each}", signal, each) for signal, how in _TABLE for each in how.split()),
    *((f"{signal} {n}", signal, f"in state {n}") for signal, numbers in _STATES for n in numbers),
)
TIME = "step time"
NAMES = (TIME, *(name for name, _, _ in FEATURES))


def of(steps: Steps) -> Array:
    """(k, len(NAMES)); not a number where a signal is missing or a step is too short to have it."""
    out = np.full((steps.count, len(NAMES)), np.nan)
    if steps.count:
        out[:, 0] = np.diff(steps.ends) * CLOCK_S
    for column, (_, signal, how) in enumerate(FEATURES, 1):
        x = steps.signals.get(signal)
        if x is None:
            continue
        reduce = REDUCTIONS[how]
        if how in ("after", "gain"):
            x = x[steps.late_rows :]
        for row, (a, b) in enumerate(zip(steps.ends[:-1], steps.ends[1:], strict=True)):
            if b - a > 60:
                out[row, column] = reduce(x, int(a), int(b))
    return out
