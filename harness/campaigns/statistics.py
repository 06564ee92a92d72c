"""Intervals that fit a campaign's design, and rules for stopping early.

A census covers every member of its population: its shares are exact and have no interval. A random sample of
a stated population has one: Clopper and Pearson's, which covers at least its nominal confidence, or Wilson's, which is
shorter and covers it on average. Repeated looks at a growing sample would break both; O'Brien and Fleming's or
Pocock's bounds repair that: with them the interval may be inspected at `looks` looks and is valid at each.

Times are compared with a tolerance interval of order statistics: it assumes nothing about the distribution, and a run
in which nothing was detected counts as later than any limit.

Sources: Clopper and Pearson, Biometrika 26 (1934); Wilson, JASA 22 (1927); Wilks, Ann. Math. Stat. 12 (1941); Armitage,
McPherson and Rowe, JRSS A 132 (1969) for the recursion; Jennison and Turnbull, "Group Sequential Methods" (2000),
chapter 9 for repeated intervals.
"""

import dataclasses
import functools
import math
import statistics
from collections.abc import Sequence

import numpy as np

from ranger_sim.foundation.user_error import CampaignError

CONFIDENCE = 0.95
# Points of the grid on which the score statistic's density is carried from look to look: the integrands are smooth, and
# four times as many change no bound in the fifth decimal.
GRID_POINTS = 101
WIDEST_Z = 8.0  # beyond it a standard normal has 1e-15 left


@dataclasses.dataclass(frozen=True)
class Share:
    """`count` of `total`; from `low` to `high` with `confidence`, or exactly (None) when it covers all members."""

    count: int
    total: int
    low: float | None = None
    high: float | None = None
    confidence: float | None = None

    @property
    def value(self) -> float:
        """The share itself, 0-1; NaN for 0 of 0."""
        return self.count / self.total if self.total else math.nan


def _check(count: int, total: int, confidence: float) -> None:
    if not (0 <= count <= total and total > 0):
        raise CampaignError(f"share: {count} of {total}: a count from 0 to the total is expected, of at least one")
    if not 0.0 < confidence < 1.0:
        raise CampaignError(f"share: confidence is {confidence!r}, allowed is above 0 and below 1")


def clopper_pearson(count: int, total: int, confidence: float = CONFIDENCE) -> Share:
    """Exact interval: a share outside gives a count this extreme with at most (1 - confidence) / 2."""
    _check(count, total, confidence)
    from scipy import special  # here and below: scipy takes longer to import than a small campaign to run

    tail = (1.0 - confidence) / 2.0
    low = 0.0 if count == 0 else float(special.betaincinv(count, total - count + 1, tail))
    high = 1.0 if count == total else float(special.betaincinv(count + 1, total - count, 1.0 - tail))
    return Share(count, total, low, high, confidence)


def wilson(count: int, total: int, confidence: float = CONFIDENCE) -> Share:
    """Wilson's score interval."""
    _check(count, total, confidence)
    low, high = _score_interval(count, total, statistics.NormalDist().inv_cdf(0.5 + confidence / 2.0))
    return Share(count, total, low, high, confidence)


def _score_interval(count: int, total: int, z: float) -> tuple[float, float]:
    """The shares p for which `count` differs from p total by at most z sqrt(p (1 - p) total)."""
    share, square = count / total, z * z / total
    middle = (share + square / 2.0) / (1.0 + square)
    half = z * math.sqrt(share * (1.0 - share) / total + square / (4.0 * total)) / (1.0 + square)
    return (0.0 if count == 0 else middle - half), (1.0 if count == total else middle + half)


def census(count: int, total: int) -> Share:
    """The share of a population of which every member was counted."""
    return Share(count, total)


# --- tolerance intervals ------------------------------------------------------------------------------------------


def upper_tolerance(values: Sequence[float], share: float, confidence: float) -> float | None:
    """Limit below which at least `share` of the population lies, with `confidence`; None when there are too few values.

    The limit is the smallest sufficient order statistic: value number m with P(Binomial(n, share) < m) >= confidence.
    """
    ordered = sorted(values)
    place = tolerance_place(len(ordered), share, confidence)
    return None if place is None else ordered[place - 1]


def tolerance_place(total: int, share: float, confidence: float) -> int | None:
    """Which order statistic (1 ... total) of `total` values is the upper tolerance limit; None: none suffices."""
    for name, value in (("share", share), ("confidence", confidence)):
        if not 0.0 < value < 1.0:
            raise CampaignError(f"tolerance: {name} is {value!r}, allowed is above 0 and below 1")
    if total == 0:
        return None
    from scipy import special

    enough = np.flatnonzero(special.bdtr(np.arange(total), total, share) >= confidence)
    return int(enough[0]) + 1 if len(enough) else None


def shown_to_miss(within: int, total: int, share: float, confidence: float) -> bool:
    """Whether `within` of `total` shows, with `confidence`, that less than `share` of the population is within.

    At exactly `share`, this few have a probability of at most 1 - confidence: Clopper and Pearson, one side.
    """
    from scipy import special

    return bool(special.bdtr(within, total, share) <= 1.0 - confidence)


def values_needed(share: float, confidence: float) -> int:
    """The fewest values whose largest is an upper tolerance limit (Wilks): 59 for 95 % with 95 %."""
    return math.ceil(math.log(1.0 - confidence) / math.log(share))


# --- repeated looks --------------------------------------------------------------------------------------------------


def crossing_probability(bounds: Sequence[float]) -> float:
    """P(|Z_k| >= bounds[k] at one of the looks) of a score statistic without effect, looks after equal shares of data.

    S_k = sqrt(k) Z_k is a sum of k independent standard normals; its density is carried from look to look over the
    region not yet crossed (Simpson's rule).
    """
    inside = 1.0
    points = density = np.empty(0)
    for k, bound in enumerate(bounds, start=1):
        edge = min(bound, WIDEST_Z) * math.sqrt(k)
        grid = np.linspace(-edge, edge, GRID_POINTS)
        if k == 1:
            here = _normal_density(grid)
        else:
            weights = _simpson(points)
            here = _normal_density(grid[:, None] - points[None, :]) @ (weights * density)
        points, density = grid, here
        inside = float(_simpson(points) @ density)
    return 1.0 - inside


def _normal_density(values: np.ndarray) -> np.ndarray:
    density: np.ndarray = np.exp(-0.5 * values**2) / math.sqrt(2.0 * math.pi)
    return density


def _simpson(points: np.ndarray) -> np.ndarray:
    weights = np.ones(len(points))
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
    return weights * (points[1] - points[0]) / 3.0


def obrien_fleming(looks: int, error: float = 1.0 - CONFIDENCE) -> list[float]:
    """Two-sided bounds of |Z| at each of `looks` looks: strict at first, C sqrt(looks / k) at look k."""
    return _bounds([math.sqrt(looks / k) for k in range(1, looks + 1)], error)


def pocock(looks: int, error: float = 1.0 - CONFIDENCE) -> list[float]:
    """Two-sided bounds of |Z|, the same at every one of `looks` looks."""
    return _bounds([1.0] * looks, error)


def _bounds(shape: list[float], error: float) -> list[float]:
    if not 1 <= len(shape) <= 50:
        raise CampaignError(f"stopping rule: {len(shape)} looks, allowed are 1 to 50")
    if not 0.0 < error < 0.5:
        raise CampaignError(f"stopping rule: an error of {error!r}, allowed is above 0 and below 0.5")
    from scipy import optimize

    constant = optimize.brentq(
        lambda c: crossing_probability([c * each for each in shape]) - error, 0.5, WIDEST_Z, xtol=1e-6
    )
    return [float(constant) * each for each in shape]


@dataclasses.dataclass(frozen=True)
class Stopping:
    """When a sample suffices: at a look, the repeated interval of a class's share is on one side of `limit`.

    runs: of the whole sample; looks: the number of equal parts after each of which it may stop; rule: "obrien-fleming"
    or "pocock".
    """

    outcome: str
    limit: float
    runs: int
    looks: int = 5
    rule: str = "obrien-fleming"
    confidence: float = CONFIDENCE

    def __post_init__(self) -> None:
        if self.rule not in RULES:
            raise CampaignError(f"stopping rule {self.rule!r}: allowed are {', '.join(RULES)}")
        if not 0.0 < self.limit < 1.0:
            raise CampaignError(f"stopping rule: limit is {self.limit!r}, allowed is above 0 and below 1")
        if not 1 <= self.looks <= min(50, self.runs):
            raise CampaignError(f"stopping rule: {self.looks} looks at {self.runs} runs, allowed are 1 to 50, one each")

    @functools.cached_property
    def bounds(self) -> list[float]:
        """Bounds of |Z|, one per look."""
        return RULES[self.rule](self.looks, 1.0 - self.confidence)

    def look_after(self, look: int) -> int:
        """The number of runs after which look number `look` (from 1) happens."""
        return math.ceil(self.runs * look / self.looks)

    def interval(self, count: int, total: int, look: int) -> Share:
        """The repeated interval at look number `look` (from 1): Wilson's, with this look's bound as its z."""
        _check(count, total, self.confidence)
        low, high = _score_interval(count, total, self.bounds[look - 1])
        return Share(count, total, low, high, self.confidence)

    def decides(self, share: Share) -> bool:
        """True when the interval is on one side of the limit."""
        return bool(share.low is not None and share.high is not None and not share.low <= self.limit <= share.high)


RULES = {"obrien-fleming": obrien_fleming, "pocock": pocock}
INTERVALS = {"clopper-pearson": clopper_pearson, "wilson": wilson}
