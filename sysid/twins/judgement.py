"""Which cause moves a walk away from its sound twins, how far, and since which step."""

import copy
import dataclasses
import functools
from collections.abc import Callable, Sequence

import numpy as np
from scipy import linalg, stats

from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.twins.model import Direction, Knot, Mean, View, mean_of, scatter
from ranger_sim.sysid.twins.step_map import Rest

# of an effect's length: what a line, a square and a cube leave of it. Chosen by us, looking at five hidden causes
CURVATURE = 0.18
GRID = 61  # sizes of either sign
EMULATIONS = 10  # of a cause at a size, at most, for one log
FIRST, NEAR_BEST = 3, 0.5  # of the likeliest causes, and the share of the best one's gain, that are confirmed
AMONG_TWINS = 0.3  # of the largest size of a cause's twins: between it and the largest they count themselves
CLOSE = 0.05  # of a size: nearer to an emulated one it is not emulated again
SMOOTHER_M = 0.0003  # than the floor of a cause's first walks, by what these show that it adds: they walk again there
USUAL = 0.95  # quantile of sound walks: a cause that leaves more is not yet at its best size
NEXT_TO = 1.25  # to such a size: next to it on either side the cause is emulated as well
KNOWN, FAR_KNOWN = 4.0, 2.0  # times its error's squared length that a direction has: near 0, and by a far walk
MOST_NOISE = 0.5  # of a direction's squared length, that its noise may have added
AT_KNOT = 0.1  # the same where the cause was emulated for the log
FARTHEST = 2.5  # times the largest size that was made
FURTHER = 1.6  # times the largest size that was emulated for the log
BEYOND = 4.0  # times the sizes that are sought, to judge which cause is worth emulating
BELOW_FALL = 0.8  # of a size with which the robot falls at once
TIE = 6.0  # of twice the log-likelihood, within which causes are not distinguished
ALIKE = 0.95  # cosine of directions above which they never are
ALARM = 0.99  # quantile of sound walks that had no part: half of the aim, since tails are known by some hundred walks
FAR = 0.98  # quantile of sound walks, on any floor
TOLERATED = 3.0  # deviations of sound robots: a size up to them is not a fault
SIZE_ERROR = 0.2  # of a size: 95 %, by which twins of other seeds, batteries and floors differ
HOLDS = 3.84  # of twice the log-likelihood: 95 %
ONSET_EVERY, ONSET_AFTER, ONSET_LEAST = 2, 10, 8  # steps: between onsets, before the first, after the last
# A later begin must gain so many times what all steps do and the limit of a sound walk: chosen by us, looking at false
# alarms on 1 mm of roughness, of which most were begins.
ONSET_PAYS, ONSET_LIMITS = 1.25, 3.0
STANDS_OUT = 0.67  # of a cause's gain: with less than this of every other one it may be named by walks like it
FEWEST_REPEATS = 4  # walks with the named cause by whose sizes its interval is checked
UNEXPLAINED = 1.3  # times the distance that few walks exceed: what is left under it is as with them


@dataclasses.dataclass(frozen=True)
class Walks:
    """Emulated walks as a vector. floor_m: as rough as their steps look, on a floor that was made or beyond."""

    mean: Mean
    floor_m: float


Emulate = Callable[[Direction, float, float], Walks | None]
"""(cause, size, roughness of the floor in m) to emulated walks; None when the robot falls at once."""
Repeat = Callable[[Direction, float, float], Sequence[Rest]]
"""The same to single walks of other seeds and of bodies within tolerances."""


@dataclasses.dataclass(frozen=True)
class Fit:
    """One cause. gain: what it takes of the squared distance; left: distance with it, over its degrees of freedom."""

    direction: Direction
    size: float
    low: float
    high: float
    gain: float
    left: float


@dataclasses.dataclass(frozen=True)
class Verdict:
    """The comparison of a walk with its twins.

    detected; named: the best cause, None when nothing is detected or what is left is not sound; fits: all causes, the
    best first; ties, alike: names that explain as well, and that these channels can never distinguish from it; since:
    step from which on, 0 for all; distance: over its degrees of freedom; gain: of the best cause; limits: of both;
    visible: (cause, least size, unit) for every cause; unseen: causes without a size; floor_m; steps that counted;
    unusual: (feature, deviations) of the largest; view: with the knots of what was emulated; habits: causes of sizes
    that a sound robot reaches, with which the walk is a sound one.
    """

    detected: bool
    named: Fit | None
    fits: tuple[Fit, ...]
    ties: tuple[Direction, ...]
    alike: tuple[Direction, ...]
    since: int
    distance: float
    limits: tuple[float, float]
    visible: tuple[tuple[Direction, float], ...]
    unseen: tuple[Direction, ...]
    floor_m: float
    steps: int
    unusual: tuple[tuple[str, float], ...]
    view: View
    habits: tuple[Fit, ...] = ()


def _polynomial(each: Direction, sizes: Array) -> Array:
    """(m, 3) size, square and cube; beyond the sizes that were made a line."""
    edge = np.where(sizes > 0.0, each.high, -each.low)
    inside = np.minimum(np.abs(sizes), edge) * np.sign(sizes)
    stretch = np.where(inside != 0.0, sizes / np.where(inside == 0.0, 1.0, inside), 1.0)
    return np.asarray(np.stack((inside, inside**2, inside**3), axis=1) * stretch[:, None])


def _walked(each: Direction) -> list[Knot]:
    """The knots in which the robot walked, by size."""
    return sorted((knot for knot in (*each.far, *each.knots) if knot.steps), key=lambda knot: knot.size)


def _shares(each: Direction, sizes: Array) -> Array:
    """(m, k) share of each knot at these sizes. A far knot begins to count where the other twins end."""
    knots = _walked(each)
    own = [knot.size for knot in each.knots if knot.steps]
    edges = [edge for edge in (each.low, each.high) if edge and not any(0.0 < size / edge <= 1.0 for size in own)]
    bends = [edge for edge in edges if any(knot.size / edge > 1.0 for knot in each.far)]
    at = np.array([0.0, *bends, *(knot.size for knot in knots)])
    order = np.argsort(at)
    out = np.zeros((len(sizes), len(knots)))
    for place, knot in enumerate(knots, 1 + len(bends)):
        out[:, place - 1 - len(bends)] = np.interp(sizes, at[order], (np.arange(len(at)) == place)[order].astype(float))
        if knot.size in (at.min(), at.max()):  # the outermost on its side
            beyond = sizes / knot.size > 1.0
            out[beyond, place - 1 - len(bends)] = sizes[beyond] / knot.size
    return out


def reach_of(each: Direction) -> tuple[float, float]:
    """Sizes among which the best is sought: some times those that were made or emulated, below any at which it fell."""
    low, high = FARTHEST * each.low, FARTHEST * each.high
    walked = [knot.size for knot in _walked(each)]
    for size in walked:
        low, high = min(low, FURTHER * size), max(high, FURTHER * size)
    for knot in (*each.far, *each.knots):
        if not knot.steps:
            inside = [size for size in walked if 0.0 < size / knot.size < 1.0]
            last = max((BELOW_FALL * knot.size, *inside), key=abs)
            low, high = (max(low, last), high) if knot.size < 0.0 else (low, min(high, last))
    return low, high


class Space:
    """The vector of a walk in coordinates in which a sound walk is white noise of deviation 1."""

    def __init__(self, view: View, mean: Mean, weights: Array, without: str = "") -> None:
        self.there = np.isfinite(mean.value)
        self.lower = self._lower(scatter(view, weights, mean.steps, without))
        self.value = self.of(np.nan_to_num(mean.value) - weights @ view.middle)
        self.directions = view.directions
        self._vectors = [np.vstack((each.terms, self._beyond_terms(each))) for each in view.directions]
        self.terms = self._each(self.lower)
        self.steps = sum(mean.steps)
        self._of_nominal = functools.partial(scatter, view, weights, mean.steps, nominal=True)

    @functools.cached_property
    def nominal(self) -> Array:
        """The lower triangle of the covariance without tolerances."""
        return self._lower(self._of_nominal())

    @functools.cached_property
    def lengths(self) -> list[Array]:
        """Products of the terms where tolerances count nothing: a direction's error goes with its whole length."""
        return [terms @ terms.T for terms in self._each(self.nominal)]

    @functools.cached_property
    def noise(self) -> float:
        """Squared length of a nominal robot's noise: what the noise of a direction adds to its own."""
        return float(np.sum(linalg.solve_triangular(self.lower, self.nominal, lower=True) ** 2))

    def _lower(self, covariance: Array) -> Array:
        part = covariance[np.ix_(self.there, self.there)]
        return np.asarray(np.linalg.cholesky(part + 1e-9 * np.trace(part) / len(part) * np.eye(len(part))))

    @property
    def freedom(self) -> int:
        """Number of features."""
        return len(self.value)

    def of(self, vector: Array, lower: Array | None = None) -> Array:
        """A vector of features (or columns of them) in these coordinates, or in those of another covariance."""
        lower = self.lower if lower is None else lower
        return np.asarray(linalg.solve_triangular(lower, vector[self.there], lower=True))

    def _each(self, lower: Array) -> list[Array]:
        """Every cause's vectors, (3 + k, 2 p) each, in the coordinates of a covariance: solved at once."""
        if not self._vectors:
            return []
        ends = np.cumsum([len(each) for each in self._vectors])[:-1]
        return np.split(self.of(np.vstack(self._vectors).T, lower).T, ends)

    def most(self) -> float:
        """What no cause can gain more than, at whatever size: twice the squared part of the walk in a cause's terms.

        `profile` is 2 p b - L + n with L = p G p and n <= L / 2, at most 2 b inv(G) b."""
        found = 0.0
        for terms in self.terms:
            part = terms.T @ np.linalg.lstsq(terms.T, self.value, rcond=None)[0]
            found = max(found, 2.0 * float(part @ part))
        return found

    def moved(self, number: int, size: float) -> Array:
        """Where a cause of this size moves a sound walk."""
        return np.asarray(self._powers(number, np.array([size]))[0] @ self.terms[number])

    def _powers(self, number: int, sizes: Array) -> Array:
        """(m, 3 + k) what the terms are multiplied by: size, square and cube, beyond the sizes that were made a line;
        and the share of each knot, in straight lines from 0 over the knots, beyond the last in proportion."""
        each = self.directions[number]
        return np.hstack((_polynomial(each, sizes), _shares(each, sizes)))

    def _beyond_terms(self, each: Direction) -> Array:
        """(k, 2 p) what the terms leave of each knot."""
        knots = _walked(each)
        if not knots:
            return np.zeros((0, each.terms.shape[1]))
        moved = np.array([knot.moved for knot in knots])
        return np.asarray(moved - _polynomial(each, np.array([knot.size for knot in knots])) @ each.terms)

    def unsure(self, number: int, powers: Array) -> Array:
        """(m,) variance of a walk with a cause over that of a sound walk: the direction's error and its curvature."""
        length = np.einsum("mi,ij,mj->m", powers, self.lengths[number], powers)
        allowed = np.full(len(powers), CURVATURE**2)
        for place in range(3, powers.shape[1]):  # at a knot its walks count, not the terms
            share = np.minimum(powers[:, place], 1.0)
            allowed = (1.0 - share) * allowed + share * AT_KNOT**2
        return np.asarray(1.0 + self.error(number, powers) + allowed * length / self.freedom)

    def error(self, number: int, powers: Array) -> Array:
        """(m,) variance of a direction over that of a sound walk."""
        each = self.directions[number]
        found = np.einsum("mi,ij,mj->m", powers[:, :3], each.unsure, powers[:, :3])
        for place, knot in enumerate(_walked(each), 3):
            share = np.minimum(powers[:, place], 1.0)
            found = (1.0 - share) * found + share * powers[:, place] ** 2 / knot.steps
        return np.asarray(self.steps * found)

    def profile(self, number: int, sizes: Array) -> Array:
        """What each size takes of the squared distance. A direction's noise makes it longer, and would make every size
        too small: that part of its length does not count."""
        powers, terms = self._powers(number, sizes), self.terms[number]
        length = np.einsum("mi,ij,mj->m", powers, terms @ terms.T, powers)
        length -= np.minimum(self.noise * self.error(number, powers), MOST_NOISE * length)
        return np.asarray(2.0 * powers @ (terms @ self.value) - length)

    def fit(self, number: int) -> Fit:
        """The best size of a cause with its interval, which carries the error of the direction."""
        each = self.directions[number]
        least, most = reach_of(each)
        below = np.linspace(least, 0.0, GRID)[:-1] if least < 0.0 else np.empty(0)
        above = np.linspace(0.0, most, GRID)[1:] if most > 0.0 else np.empty(0)
        sizes = np.concatenate((below, above))
        gains = self.profile(number, sizes)
        for _ in range(2):  # finer about the best
            best = int(np.argmax(gains))
            finer = sizes[best] + np.linspace(-1.0, 1.0, 41) * (sizes[1] - sizes[0])
            finer = finer[(finer != 0.0) & (finer >= least) & (finer <= most)]
            sizes = np.unique(np.concatenate((sizes, finer)))
            gains = self.profile(number, sizes)
        best = int(np.argmax(gains))
        size, gain = float(sizes[best]), float(gains[best])
        left = max(float(self.value @ self.value) - gain, 0.0) / self.freedom
        at_best = self._powers(number, np.array([size]))
        # the walks of the direction have a sound walk's noise as well, less by their steps
        noise = max(1.0, left) * (1.0 + float(self.error(number, at_best)[0]))
        within = sizes[gains > gain - HOLDS * noise]
        reach = float(np.hypot(float(np.ptp(within)) / 2.0, SIZE_ERROR * abs(size)))
        middle = 0.5 * (float(within.min()) + float(within.max()))
        low, high = middle - reach, middle + reach
        unsure = float(self.unsure(number, at_best)[0])
        return Fit(each, size, min(low, size), max(high, size), gain, left / unsure)

    def potential(self, number: int) -> float:
        """What a cause would gain if its present line held beyond the sizes that are sought."""
        least, most = reach_of(self.directions[number])
        return float(self.profile(number, BEYOND * np.linspace(least, most, 2 * GRID)).max())

    def is_known(self, number: int) -> bool:
        """Whether a cause moves a walk by more than the error of its direction at any size that was made, or was
        emulated for the log."""
        each = self.directions[number]
        if any(knot.steps for knot in each.knots):
            return True
        far = [knot.size for knot in each.far if knot.steps]
        powers = self._powers(number, np.array([each.high or each.low, *far]))
        length = np.sum((powers @ self.terms[number]) ** 2, axis=1)
        enough = np.array([KNOWN] + [FAR_KNOWN] * len(far))
        return bool(np.any(length > enough * self.error(number, powers) * self.freedom))

    def fits(self) -> list[Fit]:
        """All causes, the likeliest first."""
        found = [self.fit(number) for number in range(len(self.directions)) if self.is_known(number)]
        return sorted(found, key=lambda each: -each.gain)


def limits_of(view: View, weights: Array) -> tuple[float, float]:
    """Gain and distance that one sound walk in a hundred exceeds on a floor: tails differ by floor."""
    quantiles = [
        np.quantile(view.alarms[view.alarms[:, 2] == floor, :2], ALARM, axis=0) for floor in np.flatnonzero(weights)
    ]
    gain, distance = weights[weights != 0.0] @ np.array(quantiles)
    return float(gain), float(distance)


def sound_distance(view: View) -> float:
    """The distance up to which what a cause leaves is taken for a sound walk, on whichever floor."""
    return UNEXPLAINED * float(np.quantile(view.alarms[:, 1], FAR))


def judge(
    view: View,
    found: Rest,
    names: Sequence[str],
    floor_m: float,
    emulate: Emulate | None = None,
    repeat: Repeat | None = None,
) -> Verdict | None:
    """The verdict about what the map leaves of a walk. names: of the features; floor_m: its roughness;
    emulate: walks of a cause at a size, by which the likeliest causes are confirmed; repeat: walks by whose sizes the
    interval of the named cause is checked. None for a walk with too few steps."""
    mean = mean_of(found)
    if mean is None:
        return None
    weights = view.weights(floor_m)
    whole = view
    view = _near(view)  # limits are those of sound walks with the sizes near 0
    space = Space(view, mean, weights)
    fits, since = space.fits(), 0
    if not fits:
        return None
    gain_limit, distance_limit = limits_of(view, weights)
    pays = ONSET_PAYS * fits[0].gain + ONSET_LIMITS * gain_limit  # the search has many tries: a bump must not pay
    for onset in _onsets(found):
        part = mean_of(found, found.step >= onset)
        if part is None:
            continue
        later = Space(view, part, weights)
        if later.most() <= pays:
            continue
        tried = later.fits()
        if tried and tried[0].gain > pays and _begins(view, found, onset, weights, tried[0]):
            fits, since, space, mean, pays = tried, onset, later, part, tried[0].gain
    distance = float(space.value @ space.value) / space.freedom
    visible, unusual = _visible(space, gain_limit), _unusual(view, mean, weights, names)
    limits = gain_limit, distance_limit
    detected = fits[0].gain > gain_limit or distance > distance_limit
    habits = habits_of(space, fits, limits) if detected else ()
    own, looks_m = dict[tuple[str, str], float](), floor_m
    if detected and not habits:
        view = whole
        if emulate is not None:
            looks_m = view.looks(found)
            view, own = confirmed(view, mean, weights, looks_m, emulate)
        space = Space(view, mean, weights)
        fits = space.fits()
        habits = habits_of(space, fits, limits)
    detected = detected and not habits
    fits, most = best_known_first(space, fits, gain_limit, emulate is not None)
    best = fits[0]
    named = None
    if detected and best.gain > gain_limit:
        is_sound, walks = best.left < sound_distance(view), list[Rest]()
        if repeat is not None and (is_sound or _stands_out(fits)):
            sized = _sized(view, mean, weights, best)
            there = _floor_without(view, looks_m, own.get(_key(best.direction), 0.0))
            walks = list(repeat(sized.direction, sized.size, there))
        if is_sound or is_as_repeated(view, mean, weights, best, walks):
            named = as_repeated(view, _sized(view, mean, weights, best), sum(mean.steps), walks)
            if named.low < 0.0 < named.high:  # of either sign: a cause of which nothing is known
                named = None
    scale = max(1.0, (distance * space.freedom - best.gain) / space.freedom)
    ties = tuple(each.direction for each in fits[1:] if most - each.gain < TIE * scale)
    return Verdict(
        detected,
        named,
        tuple(fits),
        ties if named else (),
        _alike(space, best) if named else (),
        since,
        distance,
        limits,
        *visible,
        floor_m,
        sum(mean.steps),
        unusual,
        view,
        habits,
    )


def best_known_first(
    space: Space, fits: Sequence[Fit], gain_limit: float, are_confirmed: bool
) -> tuple[list[Fit], float]:
    """The causes in the order in which they are named, and the most that the gain of one counts.

    Noise is left of a sound walk as well. What a cause gains beyond it is chance, and its direction's own noise, which
    far sizes have much of: of the causes that leave no more than a sound walk does, the one with the best known
    direction comes first, and they tie. are_confirmed: the likeliest have walked at their sizes for this log; they keep
    their order then, because their directions are known there.
    """
    most = max(float(space.value @ space.value) - space.freedom, gain_limit)
    if are_confirmed:
        return list(fits), min(most, fits[0].gain)
    number = {id(each): place for place, each in enumerate(space.directions)}

    def error(fit: Fit) -> float:
        place = number[id(fit.direction)]
        return float(space.error(place, space._powers(place, np.array([fit.size])))[0])

    sound = sorted((each for each in fits if each.gain >= most), key=error)
    return [*sound, *(each for each in fits if each.gain < most)], min(most, fits[0].gain)


def _near(view: View) -> View:
    """Without the far twins."""
    return dataclasses.replace(view, directions=tuple(dataclasses.replace(each, far=()) for each in view.directions))


def habits_of(space: Space, fits: Sequence[Fit], limits: tuple[float, float]) -> tuple[Fit, ...]:
    """The likeliest causes one after the other, as long as a sound robot reaches their sizes by itself, until what they
    leave is a sound walk; none when it never is. limits: of gain and distance."""
    left, taken = copy.copy(space), list[Fit]()
    while fits and _is_habit(fits[0]):
        taken.append(fits[0])
        number = _number(space.directions, fits[0])
        left.value = left.value - left.moved(number, fits[0].size)
        fits = [fit for fit in left.fits() if all(fit.direction is not each.direction for each in taken)]
        gain, distance = fits[0].gain if fits else 0.0, float(left.value @ left.value) / left.freedom
        if gain <= limits[0] and distance <= limits[1]:
            return tuple(taken)
    return ()


def _is_habit(fit: Fit) -> bool:
    """Whether a sound robot reaches this size: by its tolerance, or by itself now and then."""
    each = fit.direction
    return abs(fit.size) <= TOLERATED * each.tolerance or 0.0 < fit.size * each.sound <= each.sound**2


def confirmed(
    view: View, mean: Mean, weights: Array, looks_m: float, emulate: Emulate
) -> tuple[View, dict[tuple[str, str], float]]:
    """The view with the likeliest causes emulated at the sizes found; what an emulation shows may bring another cause
    or size to the front. It ends when the first ones have been emulated and the best explains the walk, or after too
    many. looks_m: roughness of the log's floor by its steps, to whose scatter a cause adds: its walks are on a floor of
    what is left. Also, by name and parameter, the square of the roughness (m2) that a cause adds."""
    middle, sound = weights @ view.middle, sound_distance(view)
    usual = float(np.quantile(view.alarms[:, 1], USUAL))
    own: dict[tuple[str, str], float] = {}
    for _ in range(EMULATIONS):
        space = Space(view, mean, weights)
        numbers = range(len(view.directions))  # what is not known from the twins becomes so by its own walks
        likely = sorted(((space.potential(number), space.fit(number)) for number in numbers), key=lambda each: -each[0])
        best = max((fit for _, fit in likely), key=lambda fit: fit.gain)
        if _is_confirmed(best, sound) and best.left < sound:
            likely = [each for each in likely[:FIRST] if each[0] > NEAR_BEST * best.gain]
        by_gain = sorted((fit for _, fit in likely), key=lambda fit: -fit.gain)
        wanted = [(fit.direction, fit.size) for fit in by_gain if not _is_confirmed(fit, sound)]
        if _is_confirmed(best, sound) and float(space.value @ space.value) - best.gain > usual * space.freedom:
            wanted = [(best.direction, size) for size in _next_to(best)] + wanted
        if not wanted:
            break
        direction, size = wanted[0]
        floor_m = _floor_without(view, looks_m, own.get(_key(direction), 0.0))
        walked = emulate(direction, size, floor_m)
        knots, is_first = direction.knots, _key(direction) not in own
        if walked is not None:
            own[_key(direction)] = max(walked.floor_m**2 - floor_m**2, 0.0)
            smoother_m = _floor_without(view, looks_m, own[_key(direction)])
            if not is_first or smoother_m > floor_m - SMOOTHER_M:
                moved = np.nan_to_num(walked.mean.value - middle)
                knots = (*knots, Knot(size, moved, sum(walked.mean.steps)))
        elif is_first and floor_m > SMOOTHER_M:
            own[_key(direction)] = looks_m**2  # the scatter may be the cause's alone: it may walk on a level floor
        else:
            knots = (*knots, Knot(size, np.zeros_like(middle), 0))
        renewed = dataclasses.replace(direction, knots=knots)
        view = dataclasses.replace(
            view, directions=tuple(renewed if each is direction else each for each in view.directions)
        )
    return view, own


def _key(each: Direction) -> tuple[str, str]:
    return each.name, each.parameter


def _next_to(best: Fit) -> list[float]:
    """Sizes next to that of a confirmed cause at which it was not emulated: outside, then inside. Where the robot falls
    outside, half the way to it."""
    emulated = {knot.size / best.size: knot.steps for knot in best.direction.knots if knot.size * best.size > 0.0}
    if not emulated:
        return [best.size]
    outside = min((ratio for ratio in emulated if ratio > 1.0 + CLOSE), default=np.inf)
    inside = max((ratio for ratio in emulated if ratio < 1.0 - CLOSE), default=0.0)
    ratios = []
    if outside > NEXT_TO * (1.0 + CLOSE):
        ratios.append(NEXT_TO)
    elif not emulated[outside] and outside > (1.0 + CLOSE) ** 2:
        ratios.append(float(np.sqrt(outside)))
    if inside < (1.0 - CLOSE) / NEXT_TO:
        ratios.append(1.0 / NEXT_TO)
    return [ratio * best.size for ratio in ratios]


def _floor_without(view: View, looks_m: float, own_m2: float) -> float:
    """Roughness of a floor by its steps, without what a cause adds to their scatter: of those that were made."""
    return min(float(np.sqrt(max(looks_m**2 - own_m2, 0.0))), float(view.floors_m[-1]))


def is_as_repeated(view: View, mean: Mean, weights: Array, best: Fit, walks: Sequence[Rest]) -> bool:
    """Whether what a cause leaves of a walk is not more than what it leaves of walks with it: near a fall a gait may
    have two forms, and no walk is like the mean of others."""
    own = _left(view, mean, weights, best)
    left = [
        _left(view, part, view.weights(view.roughness(rest)), best)
        for rest in walks
        if (part := _last_of(rest, sum(mean.steps))) is not None
    ]
    return len(left) >= FEWEST_REPEATS and own < UNEXPLAINED * max(left)


def _left(view: View, mean: Mean, weights: Array, best: Fit) -> float:
    """Distance of a walk from one with a cause of this size."""
    space = Space(view, mean, weights, without=best.direction.name)
    rest = space.value - space.moved(_number(view.directions, best), best.size)
    return float(rest @ rest) / space.freedom


def _last_of(rest: Rest, steps: int) -> Mean | None:
    """The mean of so many steps at a walk's end."""
    return mean_of(rest, rest.step > rest.step[-1] - steps)


def _number(directions: Sequence[Direction], fit: Fit) -> int:
    return next(number for number, each in enumerate(directions) if each is fit.direction)


def _stands_out(fits: Sequence[Fit]) -> bool:
    """Whether the likeliest cause was emulated, and explains much more than every other one."""
    walked = any(knot.steps for knot in fits[0].direction.knots)
    return walked and all(each.gain < STANDS_OUT * fits[0].gain for each in fits[1:])


def as_repeated(view: View, named: Fit, steps: int, walks: Sequence[Rest]) -> Fit:
    """A cause whose interval reaches as far as the sizes that are found in walks with it: a walk with a cause may
    scatter more than a sound one, and a body's tolerances act otherwise there. steps: of the recording, as many count
    here."""
    errors = []
    for rest in walks:
        mean = _last_of(rest, steps)
        if mean is not None:
            space = Space(view, mean, view.weights(view.roughness(rest)), without=named.direction.name)
            errors.append(space.fit(_number(view.directions, named)).size - named.size)
    if len(errors) < FEWEST_REPEATS:
        return named
    reach = float(stats.t.ppf(0.975, len(errors)) * np.sqrt(np.mean(np.square(errors))))
    low, high = min(named.low, named.size - reach), max(named.high, named.size + reach)
    if named.size > 0.0:  # that there is something is known: the other sign was not found
        return dataclasses.replace(named, low=max(low, min(named.low, 0.0)), high=high)
    return dataclasses.replace(named, low=low, high=min(high, max(named.high, 0.0)))


def _is_confirmed(fit: Fit, sound: float) -> bool:
    """Whether a cause was emulated near its size, or has a size among those of its twins, which are more walks."""
    each = fit.direction
    share = fit.size / (each.high if fit.size > 0.0 else each.low)
    if not each.knots and AMONG_TWINS <= share <= 1.0 and fit.left < sound:
        return True
    return any(abs(fit.size - knot.size) < CLOSE * abs(knot.size) for knot in fit.direction.knots)


def _begins(view: View, found: Rest, onset: int, weights: Array, later: Fit) -> bool:
    """Whether the steps before an onset are nearer to a sound walk than to one with the cause."""
    before = mean_of(found, found.step < onset)
    if before is None:
        return False
    space = Space(view, before, weights)
    number = _number(view.directions, later)
    return bool(space.profile(number, np.array([0.5 * later.size]))[0] < 0.0)


def _onsets(found: Rest) -> range:
    last = int(found.step[found.inside][-1]) if found.inside.any() else 0
    return range(ONSET_AFTER, last - ONSET_LEAST, ONSET_EVERY)


def _sized(view: View, mean: Mean, weights: Array, best: Fit) -> Fit:
    """The cause's size and interval without its tolerance: it is the size that is asked for."""
    if not best.direction.tolerance:
        return best
    space = Space(view, mean, weights, without=best.direction.name)
    number = _number(view.directions, best)
    sized = space.fit(number)
    return dataclasses.replace(best, size=sized.size, low=sized.low, high=sized.high)


def _alike(space: Space, best: Fit) -> tuple[Direction, ...]:
    """Causes whose direction is the best one's in the present features."""
    number = _number(space.directions, best)
    own = space.moved(number, best.size)
    out = []
    for other, each in enumerate(space.directions):
        if each is not best.direction:
            line = space.terms[other][0]
            cosine = own @ line / (np.linalg.norm(own) * np.linalg.norm(line) + 1e-30)
            if abs(cosine) > ALIKE:
                out.append(each)
    return tuple(out)


def _visible(space: Space, limit: float) -> tuple[tuple[tuple[Direction, float], ...], tuple[Direction, ...]]:
    """The least size of each cause that would have passed the limit, and the causes that have none."""
    seen, unseen = [], []
    for number, each in enumerate(space.directions):
        size = _least(space, number, limit)
        if size < FARTHEST * max(each.high, -each.low):
            seen.append((each, float(size)))
        else:
            unseen.append(each)
    return tuple(seen), tuple(unseen)


def _least(space: Space, number: int, limit: float) -> float:
    """The least size of a cause whose expected gain is the limit; infinite for a direction that is not known."""
    each = space.directions[number]
    if not space.is_known(number):
        return np.inf
    edge = each.high or -each.low
    sizes = np.linspace(0.0, FARTHEST * edge, 400)[1:]
    powers = space._powers(number, sizes if each.high else -sizes)
    terms = space.terms[number]
    length = np.einsum("mi,ij,mj->m", powers, terms @ terms.T, powers)
    length -= space.freedom * space.steps * np.einsum("mi,ij,mj->m", powers, each.unsure, powers)  # the error's own
    above = np.flatnonzero((length > limit) & (sizes > max(TOLERATED * each.tolerance, abs(each.sound))))
    return float(sizes[above[0]]) if len(above) else np.inf


def _unusual(view: View, mean: Mean, weights: Array, names: Sequence[str]) -> tuple[tuple[str, float], ...]:
    """Every feature's distance from sound walks in their deviations, the largest first."""
    deviation = np.sqrt(np.diag(scatter(view, weights, mean.steps)))
    away = (mean.value - weights @ view.middle) / deviation
    legs = ("outer", "inner")
    labels = [f"{name}, {leg} legs swing" for leg in legs for name in names]
    order = np.argsort(-np.nan_to_num(np.abs(away)))
    return tuple((labels[place], float(away[place])) for place in order if np.isfinite(away[place]))
