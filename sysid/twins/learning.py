"""Maps, scatter and directions from the features of twins: what `ranger-sim twins` keeps in its file."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.twins import judgement, step_map
from ranger_sim.sysid.twins.features import NAMES
from ranger_sim.sysid.twins.model import RARE, Direction, Knot, Mean, View, mean_of
from ranger_sim.sysid.twins.step_map import FOOTHOLD, VOLTAGE, LegMap, Rest
from ranger_sim.sysid.twins.steps import INNER, OUTER

FOLDS = 4  # of sound twins, for thresholds
SHRUNK = 0.02  # of a correlation towards none
LEAST = 1e-4  # of a feature's size: a scatter below it is a constant's
FEWEST_STEPS = 6  # of a walk that counts: others fell at once
SIDES = (OUTER, INNER)


@dataclasses.dataclass(frozen=True)
class Twinned:
    """One twin. floor: its number; leg: (k,); found: (k, all features); key: of its cause, "" for a sound robot;
    loose: of a body within tolerances; far: of a size far beyond those of the cause's line, square and cube."""

    floor: int
    leg: np.ndarray
    found: Array
    key: str = ""
    size: float = 0.0
    loose: bool = False
    far: bool = False


@dataclasses.dataclass(frozen=True)
class Cause:
    """What a direction is called, its tolerance among sound robots, and the size that these reach by themselves."""

    key: str
    cause: str
    at: str
    parameter: str
    form: str
    tolerance: float
    sound: float = 0.0


def learned(twins: Sequence[Twinned], causes: Sequence[Cause], floors_m: Sequence[float], few: bool) -> View:
    """The view by these twins."""
    sound = [each for each in twins if not each.key and not each.loose]
    legs = tuple(_map(sound, side, few) for side in SIDES)
    near = [each for each in twins if not each.far]
    rests = {id(each): step_map.rest(legs, each.leg, each.found, few) for each in near}
    view = _scattered([(each, rests[id(each)]) for each in sound], (legs[0], legs[1]), floors_m, few)
    made = {each.key: [twin for twin in near if twin.key == each.key] for each in causes}
    directions = [
        direction
        for each in causes
        if (direction := _direction(view, each, [(twin, rests[id(twin)]) for twin in made[each.key]])) is not None
    ]
    view = dataclasses.replace(view, directions=tuple(directions))
    loose = [(each, rests[id(each)]) for each in near if each.loose]
    alarms = []
    for fold in range(FOLDS):
        kept = [(each, rests[id(each)]) for number, each in enumerate(sound) if number % FOLDS != fold]
        part = _scattered(kept, (legs[0], legs[1]), floors_m, few)
        part = dataclasses.replace(part, directions=view.directions)
        part = _loosened(part, [pair for number, pair in enumerate(loose) if number % FOLDS != fold])
        others = [pair for number, pair in enumerate(loose) if number % FOLDS == fold]
        others += [(each, rests[id(each)]) for number, each in enumerate(sound) if number % FOLDS == fold]
        alarms += [_alarm(part, *pair) for pair in others]
    view = _loosened(view, loose)
    view = dataclasses.replace(view, alarms=np.array([each for each in alarms if each is not None]))
    return with_far(view, causes, [each for each in twins if each.far])


def with_far(view: View, causes: Sequence[Cause], twins: Sequence[Twinned]) -> View:
    """The view whose directions have these twins of far sizes: what they move by and in how many steps."""
    keys = {(each.cause, each.at, each.parameter): each.key for each in causes}
    made: dict[str, list[Twinned]] = {}
    for twin in twins:
        made.setdefault(twin.key, []).append(twin)
    return dataclasses.replace(
        view,
        directions=tuple(
            dataclasses.replace(each, far=_far(view, made.get(keys[each.cause, each.at, each.parameter], [])))
            for each in view.directions
        ),
    )


def _far(view: View, twins: Sequence[Twinned]) -> tuple[Knot, ...]:
    """A knot by size."""
    knots = []
    for size in sorted({each.size for each in twins}):
        moved, steps = np.zeros(view.middle.shape[1]), 0
        for twin in twins:
            if twin.size != size or len(twin.leg) < FEWEST_STEPS:
                continue
            mean = mean_of(step_map.rest(view.legs, twin.leg, twin.found, view.few))
            if mean is not None:
                moved = moved + sum(mean.steps) * np.nan_to_num(mean.value - view.middle[twin.floor])
                steps += sum(mean.steps)
        knots.append(Knot(size, moved / max(steps, 1), steps))
    return tuple(knots)


def _loosened(view: View, loose: Sequence[tuple[Twinned, Rest]]) -> View:
    """The view with what bodies within tolerances show beyond the sum of their tolerances."""
    vectors = []
    middle: judgement.Space | None = None
    for twin, rest in loose:
        mean = mean_of(rest)
        if mean is not None:
            middle = judgement.Space(view, mean, np.eye(len(view.floors_m))[twin.floor])
            vectors.append(middle.value)
    if middle is None:
        return view
    rows = _above_noise(np.array(vectors)) @ middle.lower.T
    return dataclasses.replace(view, loose=rows)


def _map(sound: Sequence[Twinned], side: int, few: bool) -> LegMap:
    before, footholds, after = [], [], []
    for each in sound:
        rows = np.flatnonzero(each.leg[1:] == side) + 1
        start = each.found[rows - 1][:, step_map.columns(step_map.starts(few))]
        before.append(start if few else np.hstack((start, each.found[rows][:, step_map.columns([VOLTAGE])])))
        footholds.append(each.found[rows, NAMES.index(FOOTHOLD)])
        after.append(each.found[rows][:, step_map.columns(step_map.outcomes(few))])
    return step_map.learn(np.vstack(before), None if few else np.concatenate(footholds), np.vstack(after))


def _scattered(
    pairs: Sequence[tuple[Twinned, Rest]],
    legs: tuple[LegMap, LegMap],
    floors_m: Sequence[float],
    few: bool,
) -> View:
    """The view without directions: scatter of steps by floor, and of walks as a whole."""
    p = len(legs[0].deviation)
    count = len(floors_m)
    middle, deviation = np.zeros((count, 2 * p)), np.ones((count, 2 * p))
    products = np.zeros((2, p, p))
    means: list[tuple[int, Mean]] = []
    for floor in range(count):
        here = [rest for twin, rest in pairs if twin.floor == floor]
        found = [(floor, mean) for rest in here if (mean := mean_of(rest)) is not None]
        means += found
        middle[floor] = np.mean([mean.value for _, mean in found], axis=0)
        for side in SIDES:
            rows = slice(side * p, (side + 1) * p)
            left = np.vstack([rest.left[rest.inside & (rest.leg == side)] for rest in here])
            left = np.clip(left - np.median(left, 0), -RARE, RARE)  # one rare step would hide the others
            left = left - left.mean(0)
            deviation[floor, rows] = np.maximum(left.std(0), LEAST)
            z = left / deviation[floor, rows]
            products[side] += z.T @ z / len(z) / count
    for side in SIDES:
        products[side] = (1.0 - SHRUNK) * products[side] + SHRUNK * np.eye(p)
        scale = np.sqrt(np.diag(products[side]))
        products[side] /= np.outer(scale, scale)
    view = View(few, legs, np.array(floors_m, dtype=float), middle, deviation, products,
                np.zeros((0, 2 * p)), np.zeros((0, 2 * p)), (), np.zeros((0, 3)))  # fmt: skip
    return dataclasses.replace(view, between=_between(view, means))


def _between(view: View, means: Sequence[tuple[int, Mean]]) -> Array:
    """(k, 2 p): in which walks of sound robots differ more than their steps explain: crystals, phases, slow habits."""
    white = []
    lowers: dict[tuple[int, tuple[int, int]], judgement.Space] = {}
    for floor, mean in means:
        weights = np.eye(len(view.floors_m))[floor]
        space = judgement.Space(view, mean, weights)
        lowers[floor, mean.steps] = space
        white.append(space.value)
    z = np.array(white)
    if len(z) < 12:
        return np.zeros((0, z.shape[1]))
    return np.asarray(_above_noise(z) @ next(iter(lowers.values())).lower.T)


def _above_noise(z: Array) -> Array:
    """(k, size) rows whose products are the covariance of (n, size) vectors beyond white noise of deviation 1."""
    n, size = z.shape
    values, vectors = np.linalg.eigh(z.T @ z / n)
    above = values > (1.0 + np.sqrt(size / n)) ** 2  # the largest that white noise has
    rest = max(float((values.sum() - values[above].sum()) / max(size - above.sum(), 1)) - 1.0, 0.0)
    rows = np.sqrt(values[above] - 1.0)[:, None] * vectors[:, above].T
    return np.vstack((rows, np.sqrt(rest) * np.eye(size))) if rest > 0.0 else rows


def _direction(view: View, cause: Cause, pairs: Sequence[tuple[Twinned, Rest]]) -> Direction | None:
    """A line, a square and a cube through the vectors of a cause's twins, each weighed by its steps; None with too
    few."""
    sizes, vectors, counts = [], [], []
    for twin, rest in pairs:
        mean = mean_of(rest)
        if mean is not None and sum(mean.steps) >= 8:
            sizes.append(twin.size)
            vectors.append(mean.value - view.middle[twin.floor])
            counts.append(sum(mean.steps))
    if len(sizes) < 2:
        return None
    size, weight = np.array(sizes), np.array(counts, dtype=float)
    reach = float(np.abs(size).max())
    powers = min(3, max(1, len(np.unique(np.round(size / reach, 6))) - 1)) if len(sizes) > 2 else 1
    basis = np.column_stack([(size / reach) ** (power + 1) for power in range(powers)]) * np.sqrt(weight)[:, None]
    solved = np.linalg.lstsq(basis, np.array(vectors) * np.sqrt(weight)[:, None], rcond=None)[0]
    scale = reach ** -np.arange(1.0, powers + 1.0)
    terms, unsure = np.zeros((3, solved.shape[1])), np.zeros((3, 3))
    terms[:powers] = solved * scale[:, None]
    unsure[:powers, :powers] = np.linalg.inv(basis.T @ basis) * np.outer(scale, scale)
    low, high = min(0.0, float(size.min())), max(0.0, float(size.max()))
    return Direction(
        cause.cause, cause.at, cause.parameter, cause.form, low, high, cause.tolerance, terms, unsure, sound=cause.sound
    )


def _alarm(view: View, twin: Twinned, rest: Rest) -> tuple[float, float, float] | None:
    """Best gain and distance of a sound walk, and the number of its floor."""
    mean = mean_of(rest)
    if mean is None:
        return None
    weights = view.weights(view.roughness(rest))
    space = judgement.Space(view, mean, weights)
    fits = space.fits()
    return fits[0].gain if fits else 0.0, float(space.value @ space.value) / space.freedom, float(twin.floor)
