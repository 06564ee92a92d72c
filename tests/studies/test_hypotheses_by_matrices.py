"""Surfaces, hypotheses and pieces of the fit against matrices that are written out whole."""

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import fit
from ranger_sim.sysid.fit import Parameter, _Objective
from studies.figures import hypotheses
from studies.figures.diagnose import Simulated
from studies.figures.hypotheses import Evidence, Judge
from studies.figures.question import Candidate, Figure, Outcome
from studies.figures.surface import Surface

RNG = generator(13, "surfaces")
PLACES = RNG.uniform(-2.0, 2.0, (9, 2))


def runs_of(places, noise=0.02):
    values = 3.0 + 0.8 * places[:, 0] - 0.3 * places[:, 0] * places[:, 1] + 0.2 * np.sin(2.0 * places[:, 1])
    return [value + noise * RNG.normal(size=1 + number % 3) for number, value in enumerate(values)]


def process(first, second, scales):
    """One element at a time, as the module's text has it."""
    C, L, Q, R = scales
    out = np.empty((len(first), len(second)))
    for i, z in enumerate(first):
        for j, y in enumerate(second):
            dot = float(z @ y)
            bend = (dot**2 + sum(a**2 * b**2 for a, b in zip(z, y, strict=True))) / 2.0
            out[i, j] = C**2 + L**2 * dot + Q**2 * bend + R**2 * math.exp(-0.5 * float((z - y) @ (z - y)))
    return out


def test_a_surface_is_the_gaussian_process_that_makes_the_points_most_likely():
    runs = runs_of(PLACES)
    found = Surface(PLACES, runs)
    means = np.array([each.mean() for each in runs])
    counts = np.array([len(each) for each in runs])
    squares = np.array([np.sum((each - each.mean()) ** 2) for each in runs])
    # a point's scatter: its own, and that of all as four runs more
    scatter = (4.0 * squares.sum() / (counts - 1).sum() + squares) / (4.0 + counts - 1)
    assert found.run_variance == pytest.approx(scatter)
    size = means.std()
    target = (means - means.mean()) / size
    noise = np.diag(scatter / counts / size**2 + 1e-10)

    def likelihood(scales):
        whole = process(PLACES, PLACES, scales) + noise
        return -0.5 * target @ np.linalg.solve(whole, target) - 0.5 * np.linalg.slogdet(whole)[1]

    grid = itertools.product((10.0,), (0.1, 0.3, 1.0, 3.0), (0.01, 0.03, 0.1, 0.3, 1.0), (0.01, 0.03, 0.1, 0.3, 1.0))
    assert found.scales == max(grid, key=likelihood)
    asked = RNG.uniform(-2.0, 2.0, (5, 2))
    whole = process(PLACES, PLACES, found.scales) + noise
    across = process(asked, PLACES, found.scales)
    mean = means.mean() + size * across @ np.linalg.solve(whole, target)
    variance = size**2 * np.diag(process(asked, asked, found.scales) - across @ np.linalg.solve(whole, across.T))
    told, spread = found(asked)
    assert told == pytest.approx(mean) and found.mean(asked) == pytest.approx(mean)
    assert spread == pytest.approx(variance, abs=1e-8 * size**2)
    slopes = found.slopes(asked)
    for number in range(2):
        step = np.zeros(2)
        step[number] = 1e-5
        assert slopes[:, number] == pytest.approx(
            (found.mean(asked + step) - found.mean(asked - step)) / 2e-5, abs=1e-5
        )


def test_a_figure_that_does_not_change_is_a_flat_surface():
    found = Surface(PLACES, [np.array([5.0, 5.0])] * 9)
    mean, variance = found(RNG.uniform(-2.0, 2.0, (4, 2)))
    assert mean == pytest.approx(np.full(4, 5.0)) and np.all(variance < 1e-6)


# --- hypotheses -------------------------------------------------------------------------------------------------------


class Flat:
    """A simulated figure that is linear in the candidates, with its own variance."""

    def __init__(self, start, slopes, variance):
        self.start, self.each, self.variance = start, np.array(slopes), variance

    def __call__(self, places):
        return self.start + places @ self.each, np.full(len(places), self.variance)

    def slopes(self, places):
        return np.tile(self.each, (len(places), 1))


def candidate(name, value, low, high, known_sd, step):
    return Candidate(name, "", value, low, high, known_sd, step, "geometry", {name: 1.0})


CANDIDATES = [
    candidate("a", 1.0, -3.0, 5.0, 0.3, 0.5),
    candidate("b", 2.0, -6.0, 10.0, 0.4, 0.8),
    candidate("c", 0.0, -9.0, 9.0, 0.2, 0.1),
]
SLOPES = np.array([[1.0, 0.3, -0.2], [0.2, 1.0, 0.4], [0.5, -0.6, 1.0]])
STARTS, VARIANCES = np.array([5.0, 2.0, -1.0]), np.array([0.01, 0.02, 0.005])
GAIT = [Figure("f", 6.1, 0.2, 0.1), Figure("g", 2.2, 0.3), Figure("h", -0.7, 0.1, 0.05)]
SURFACES = {each.name: Flat(STARTS[n], SLOPES[n], VARIANCES[n]) for n, each in enumerate(GAIT)}


def evidence(survived=(100.0, 40.0), failures=(0.0, 3.0)):
    places = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    return Evidence(SURFACES, places, np.array(survived), np.array(failures), 20.0)


def dense(at, free_value, endurance=0.0):
    """Deviance, place and misfit with candidate `at` held at a value and the others with their known errors."""
    others = [n for n in range(3) if n != at]
    known = np.array([each.known_sd / each.step for each in CANDIDATES])[others]
    D = np.array([each.error**2 for each in GAIT]) + VARIANCES
    J = SLOPES[:, others]
    V = np.diag(D) + J @ np.diag(known**2) @ J.T
    r = np.array([each.value for each in GAIT]) - STARTS - (0.0 if at is None else SLOPES[:, at] * free_value)
    misfit = r @ np.linalg.solve(V, r)
    place = np.zeros(3)
    place[others] = known**2 * (J.T @ np.linalg.solve(V, r))
    if at is not None:
        place[at] = free_value
    sd = np.zeros(3)
    sd[others] = np.sqrt(
        np.diag(np.diag(known**2) - np.diag(known**2) @ J.T @ np.linalg.solve(V, J) @ np.diag(known**2))
    )
    return misfit + np.sum(np.log(D)) - 2.0 * endurance, place, misfit, sd, D


def test_with_nothing_wrong_the_deviance_is_that_of_generalised_least_squares():
    judge = Judge(CANDIDATES, GAIT, None)
    found = judge.weigh(evidence(), ())
    deviance, place, misfit, sd, D = dense(None, 0.0)
    assert found.deviance == pytest.approx(deviance) == found.bic and found.misfit == pytest.approx(misfit)
    assert found.place == pytest.approx(place) and found.sd == pytest.approx(sd)
    assert (found.free, found.freedom, found.intervals, judge.count) == ((), 3, {}, 3)
    assert found.residual == pytest.approx(np.array([each.value for each in GAIT]) - STARTS - SLOPES @ place)
    assert found.error == pytest.approx(np.sqrt(D))


def test_a_free_candidate_is_at_its_best_with_an_interval_by_the_profile():
    found = Judge(CANDIDATES, GAIT, None).weigh(evidence(), ("a",))
    tried = np.linspace(-40.0 / 3.0, 40.0 / 3.0, 40_001)
    deviance = np.array([dense(0, value)[0] for value in tried[::20]])
    best = int(np.argmin(deviance))
    assert found.deviance == pytest.approx(deviance[best], abs=1e-2)
    assert found.place[0] == pytest.approx(tried[::20][best], abs=0.05)
    assert found.bic == pytest.approx(found.deviance + math.log(3.0)) and found.freedom == 2
    wanted = dense(0, found.place[0])
    assert found.deviance == pytest.approx(wanted[0]) and found.place == pytest.approx(wanted[1])
    assert found.misfit == pytest.approx(wanted[2]) and found.sd == pytest.approx(wanted[3])
    inside = tried[::20][deviance <= deviance[best] + 3.84]
    low, high = found.intervals["a"]
    assert (low, high) == (pytest.approx(inside[0], abs=0.05), pytest.approx(inside[-1], abs=0.05))
    axis, profile = found.profiles["a"]
    assert profile.min() == 0.0 and len(axis) == len(profile) >= 61
    # the window that is left reaches 14 above the least, and a step of the last grid more
    assert 14.0 < max(profile[0], profile[-1]) < 60.0


def test_the_chance_to_endure_counts_runs_near_by_and_a_failure_by_its_density():
    judged = evidence()
    asked = np.array([[0.5, 0.0, 0.0], [9.0, 9.0, 9.0]])
    for figure in (Figure("e", 30.0, endurance=True, at_least=True), Figure("e", 30.0, endurance=True)):
        found = judged.log_endurance(asked, figure)
        for number, place in enumerate(asked):
            weights = [math.exp(-0.5 * float((place - each) @ (place - each)) / 0.25) for each in judged.places]
            seen = 20.0 + weights[0] * 100.0 + weights[1] * 40.0
            power = 0.5 + weights[1] * 3.0
            chance = (seen / (seen + 30.0)) ** power
            if not figure.at_least:
                chance *= power / (seen + 30.0)
            assert found[number] == pytest.approx(math.log(chance))
    figure = Figure("e", 30.0, endurance=True, at_least=True)
    judge = Judge(CANDIDATES, GAIT, figure)
    whole = judge.weigh(judged, ())
    place = dense(None, 0.0)[1]
    assert judge.count == 4
    assert whole.deviance == pytest.approx(dense(None, 0.0, float(judged.log_endurance(place[None], figure)[0]))[0])


def test_an_interval_ends_where_the_profile_crosses_3_84_or_at_the_limits():
    axis = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    profile = np.array([8.0, 2.0, 0.0, 1.0, 5.0])
    low, high = hypotheses._interval(axis, profile, (0.0, 4.0))
    assert low == pytest.approx(1.0 - (3.84 - 2.0) / 6.0) and high == pytest.approx(3.0 + (3.84 - 1.0) / 4.0)
    open_ended = np.array([3.0, 2.0, 0.0, 1.0, 3.0])
    assert hypotheses._interval(axis, open_ended, (0.0, 4.0)) == (None, None)
    assert hypotheses._interval(axis, open_ended, (-1.0, 5.0)) == (0.0, 4.0)


def test_axes_have_the_simulation_as_it_stands_among_their_values():
    (axis,) = hypotheses._axes([(-1.0, 2.0)], 3)
    assert axis.tolist() == [-1.0, 0.0, 0.5, 2.0]
    (beyond,) = hypotheses._axes([(1.0, 2.0)], 3)
    assert beyond.tolist() == [1.0, 1.5, 2.0]
    (below,) = hypotheses._axes([(-3.0, -1.0)], 3)
    assert below.tolist() == [-3.0, -2.0, -1.0]


# --- pieces of the fit ------------------------------------------------------------------------------------------------


def test_a_step_of_a_parameter_is_what_matters_of_it():
    for parameter, step in (
        (Parameter("p", "", 3.0), 3.0), (Parameter("p", "", -3.0), 3.0), (Parameter("p", "", 0.0), 1.0),
        (Parameter("p", "", 0.0, -2.0, 4.0), 0.6), (Parameter("p", "", 3.0, uncertainty=0.2), 0.2),
        (Parameter("p", "", 3.0, uncertainty=0.2, scale=0.7), 0.7),
    ):  # fmt: skip
        assert parameter.step == pytest.approx(step)
    for more in ({"uncertainty": -0.1}, {"scale": -0.1}):
        with pytest.raises(UserError, match="parameter p: uncertainty and scale must not be negative"):
            Parameter("p", "", 1.0, **more)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 50.0])
def test_neighbours_correlate_by_their_products_over_the_squares(scale):
    values = scale * RNG.normal(size=30)
    centred = values - values.mean()
    wanted = np.sum(centred[1:] * centred[:-1]) / np.sum(centred**2)
    assert fit.neighbours_correlation(values) == pytest.approx(wanted)
    parts = [centred[:12], centred[12:]]
    wanted = sum(np.sum(each[1:] * each[:-1]) for each in parts) / np.sum(centred**2)
    assert fit.neighbours_correlation(values, [slice(0, 12), slice(12, 30)]) == pytest.approx(wanted)
    assert fit.neighbours_correlation(np.full(5, scale)) == 0.0


def test_samples_that_hang_together_are_worth_fewer_and_never_more():
    assert fit.independent_samples(90, 0.5) == pytest.approx(30.0) and fit.independent_samples(90, -0.5) == 90.0
    assert 0.0 < fit.independent_samples(90, 1.0) == pytest.approx(90.0 * 0.5e-9, rel=1e-6)


def objective(parameters, matrix, y, earlier=()):
    names = [each.name for each in parameters]
    return _Objective(lambda v: y - matrix @ np.array([v[name] for name in names]), parameters, earlier, 1e-5)


def test_what_is_known_before_is_next_to_the_data_as_rows():
    matrix, y = RNG.normal(size=(20, 3)), RNG.normal(size=20)
    asked = [
        Parameter("a", "", 2.0, uncertainty=0.5),
        Parameter("b", "", 1.0),
        Parameter("c", "", -1.0, uncertainty=2.0),
    ]
    covariance = np.array([[0.3, 0.1, 0.05], [0.1, 9.0, 0.0], [0.05, 0.0, 0.2]])
    values = {"b": 1.5, "x": 7.0, "c": -0.5}
    known = SimpleNamespace(names=("b", "x", "c"), refused="", covariance=covariance, values=values)
    stranger = SimpleNamespace(names=("y",), refused="refused", covariance=np.eye(1), values={})
    made = objective(asked, matrix, y, [known, stranger])
    precision = np.diag([1.0 / 0.25, 0.0, 0.25])
    inverse = np.linalg.inv(np.array([[0.3, 0.05], [0.05, 0.2]]))
    precision[1:, 1:] += inverse
    pull = np.diag([4.0, 0.0, 0.25]) @ [2.0, 1.0, -1.0]
    pull[1:] += inverse @ [1.5, -0.5]
    centre = np.linalg.solve(precision, pull)
    assert made.precision == pytest.approx(precision) and made.rank == 3
    assert made.root.T @ made.root == pytest.approx(precision) and made.centre == pytest.approx(centre)
    assert made.start.tolist() == [2.0, 1.5, -0.5]  # where the earlier fit ended
    made.weigh(0.4, 0.5)
    at = np.array([1.0, 2.0, 3.0])
    rows = made.rows(at)
    data = (y - matrix @ at) * math.sqrt(0.5) / 0.4
    assert rows[:20] == pytest.approx(data)
    off = at - centre
    assert made.cost(at) == pytest.approx(float(data @ data) + float(off @ precision @ off))
    hessian = matrix.T @ matrix * 0.5 / 0.16 + precision
    best = np.linalg.solve(hessian, matrix.T @ y * 0.5 / 0.16 + precision @ centre)
    found, cost, trouble = made.solve(made.start)
    assert found == pytest.approx(best, rel=1e-6) and cost == pytest.approx(made.cost(best)) and trouble == ""
    assert made.derivatives(at) == pytest.approx(-matrix, rel=1e-6)
    spread, lost = made.covariance(made.derivatives(at))
    assert spread == pytest.approx(np.linalg.inv(hessian), rel=1e-6) and lost == ""
    used = np.trace(np.linalg.solve(hessian, matrix.T @ matrix * 0.5 / 0.16))
    assert made.parameters_used(made.derivatives(at)) == pytest.approx(used, rel=1e-6)
    # one held: the others follow
    held, cost, _ = made.solve(made.start, fixed=(1, 2.5))
    left = [0, 2]
    follow = np.linalg.solve(hessian[np.ix_(left, left)], (hessian @ best - hessian[:, 1] * 2.5)[left])
    assert held == pytest.approx([follow[0], 2.5, follow[1]], rel=1e-6) and cost == pytest.approx(made.cost(held))
    with pytest.raises(UserError, match="an earlier fit was refused: why; nothing can be taken from it"):
        objective(asked, matrix, y, [SimpleNamespace(names=("a",), refused="why")])


def test_nothing_known_before_is_not_a_row():
    matrix, y = RNG.normal(size=(20, 2)), RNG.normal(size=20)
    made = objective([Parameter("a", "", 2.0), Parameter("b", "", 1.0)], matrix, y)
    assert made.rank == 0 and len(made.rows(made.start)) == 20 and made.weight == 1.0
    assert made.cost(np.zeros(2)) == pytest.approx(float(y @ y))
    (alone,) = objective([Parameter("a", "", 2.0)], matrix[:, :1], y).solve(np.array([2.0]), fixed=(0, 3.0))[:1]
    assert alone.tolist() == [3.0]


def test_derivatives_stay_within_the_limits():
    seen = []

    def residual(v):
        seen.append(v["a"])
        return np.array([v["a"] ** 2, 1.0])

    made = _Objective(residual, [Parameter("a", "", 1.0, 0.999999, 5.0)], (), 1e-3)
    assert made.derivatives(np.array([1.0]))[0, 0] == pytest.approx(2.0, rel=1e-2)
    assert min(seen) == 0.999999 and max(seen) == pytest.approx(1.001)


def test_identifiability_is_reported_by_singular_values_of_the_scaled_derivatives():
    matrix = RNG.normal(size=(20, 3))
    asked = [Parameter("a", "", 2.0), Parameter("b", "", 0.5), Parameter("c", "", 0.0, -5.0, 5.0)]
    found = fit.identifiability(lambda v: matrix @ np.array([v["a"], v["b"], v["c"]]), asked)
    scaled = matrix * np.array([2.0, 0.5, 1.0])
    _, sizes, axes = np.linalg.svd(scaled, full_matrices=False)
    assert found.singular_values == pytest.approx(sizes, rel=1e-6) and found.condition == pytest.approx(
        sizes[0] / sizes[2]
    )
    assert np.abs(list(found.weakest.values())) == pytest.approx(np.abs(axes[-1]), rel=1e-5)
    assert list(found.sensitivity.values()) == pytest.approx(np.sqrt(np.mean(scaled**2, axis=0)), rel=1e-6)
    twin = np.column_stack((matrix[:, 0], matrix[:, 0] + 1e-3 * matrix[:, 1], matrix[:, 2]))
    tied = fit.identifiability(lambda v: twin @ np.array([v["a"], v["b"], v["c"]]), asked)
    ((first, second, cosine),) = tied.ties
    assert {first, second} == {"a", "b"} and cosine > 0.999
    assert any("a and b are not separable" in line or "b and a are not separable" in line for line in tied.lines())
    still = fit.Identifiability(("a",), np.array([1.0, 0.0]), {}, {}, np.eye(1))
    assert still.condition == math.inf


def test_a_value_stands_on_a_limit_within_a_thousandth_of_its_error():
    asked = [Parameter("a", "V", 5.0, 0.0, 10.0), Parameter("b", "A", 1.0, 0.0, 10.0)]
    for a, told in (
        (0.9e-3, "a is at its lower limit 0 V"),
        (1.1e-3, ""),
        (10.0 - 0.9e-3, "a is at its upper limit 10 V"),
    ):
        assert fit._limits_met(asked, np.array([a, 5.0]), np.array([1.0, 1.0])) == told
    # with no error at all within a millionth of its step
    assert fit._limits_met(asked, np.array([4e-6, 5.0]), np.zeros(2)) == "a is at its lower limit 0 V"
    assert fit._limits_met(asked, np.array([6e-6, 5.0]), np.zeros(2)) == ""
    both = fit._limits_met(asked, np.array([0.0, 10.0]), np.ones(2))
    assert both == "a is at its lower limit 0 V; b is at its upper limit 10 A"


# --- what was simulated -----------------------------------------------------------------------------------------------


def test_outcomes_are_gathered_by_place_and_a_figure_of_no_run_is_reported():
    runs = [
        [Outcome({"f": 1.0}, 10.0), Outcome({"f": 3.0, "g": 5.0}, 4.0, failed=True)],
        [Outcome({"f": 2.0}, 7.0, failed=True), Outcome({}, 1.0, failed=True)],
    ]
    made = Simulated(CANDIDATES, [np.array([0.0, 0.0, 0.0]), np.array([1.0, 0.0, 2.0])], runs)
    found = made.evidence(["f"], 3)
    assert found.survived.tolist() == [14.0, 8.0] and found.failures.tolist() == [1.0, 2.0]
    # as if at every place as many runs as there are seeds had come as far as the farthest
    assert found.unseen == 30.0 and found.places.tolist() == [[0.0, 0.0, 0.0], [1.0, 0.0, 2.0]]
    assert found.surfaces["f"].means.tolist() == [2.0, 2.0]
    assert made.evidence(["g"], 3).surfaces["g"].places.tolist() == [[0.0, 0.0, 0.0]]
    with pytest.raises(UserError, match="figure h: none of 4 simulated runs reached it"):
        made.evidence(["h"], 3)
    assert made.nearest(np.array([1.0, 3.0, -2.0])) == pytest.approx(math.sqrt(1.0 + 9.0 + 4.0))
