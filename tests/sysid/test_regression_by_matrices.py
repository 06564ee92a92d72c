"""The regression, the naming and the general tests on small data, against dense matrices and sums of squares."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import gain, intervals, misfit, naming, regression
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.machine import Effect, Equation, Recording
from ranger_sim.sysid.naming import Named
from ranger_sim.sysid.regression import Regression, Whitening

RNG = generator(10, "matrices")
FIRST, SECOND = 150, 100  # rows of two recordings
RHO = {"one": np.array([0.5]), "two": np.array([0.3, -0.2])}
DEVIATION = {"one": 0.4, "two": 2.0}
SHARED = 0.35


def table(count, *runs):
    return Table(0.01 * np.arange(count), {}, runs or (slice(0, count),), f"rows {count}")


def recordings(**more):
    """Two recordings of two equations; the second has no equation "two"; some rows do not count."""
    made = []
    for count in (FIRST, SECOND):
        a, b, c, d = RNG.normal(size=(4, count))
        valid = np.ones(count, dtype=bool)
        valid[[40, 41, 77]] = False
        equations = {
            "one": Equation("one", "M", "m", "N", 2.0 * a - b + RNG.normal(size=count), {"p": a, "q": b}, valid,
                            {"q": b + 0.3 * c}),
        }  # fmt: skip
        if count == FIRST:
            response = 2.0 * d + 5.0 * c + RNG.normal(size=count)
            equations["two"] = Equation("two", "E", "m", "V", response, {"p": d, "r": c}, np.roll(valid, 9))
        made.append(Recording(table(count), {}, equations, **more))
    return made


def known(shared=SHARED):
    return SimpleNamespace(
        whitening={name: Whitening(RHO[name], DEVIATION[name]) for name in RHO}, shared={("one", "two"): shared}
    )


def whitener(name, count):
    out = np.eye(count)
    for lag, each in enumerate(RHO[name], 1):
        out -= each * np.eye(count, k=-lag)
    return out / DEVIATION[name]


class Dense:
    """The same, by matrices: rows of equation one of both recordings, then two, then what is known before."""

    def __init__(self, made, shared=SHARED, priors=(("p", 1.9, 0.05),)):
        names = ["p", "q", "r"]
        responses, measured, stand_ins, self.takes = [], [], [], {}
        start = 0
        for name in ("one", "two"):
            count = FIRST + SECOND
            X, Z, y = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros(count)
            valid, begins = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
            for offset, each in zip((0, FIRST), made, strict=True):
                begins[offset : offset + 8] = True
                if name not in each.equations:
                    continue
                e, rows = each.equations[name], slice(offset, offset + len(each.table))
                y[rows], valid[rows] = e.response, e.valid
                for key, column in e.columns.items():
                    X[rows, names.index(key)] = column
                    Z[rows, names.index(key)] = e.stand_ins.get(key, column)
            good = valid & ~begins
            for k in np.flatnonzero(good):
                good[k] = all(valid[k - lag] for lag in range(1, len(RHO[name]) + 1))
            # a recording's first rows do not count, so that no forecast goes over its start
            W = whitener(name, count)[good]
            self.takes[name] = (W, np.flatnonzero(good), slice(start, start + len(W)))
            start += len(W)
            responses.append(W @ y)
            measured.append(W @ X)
            stand_ins.append(W @ Z)
        for key, value, deviation in priors:
            row = np.array([[float(name == key) / deviation for name in names]])
            responses.append(np.array([value / deviation]))
            measured.append(row)
            stand_ins.append(row)
        self.y, self.X, self.Z = np.concatenate(responses), np.vstack(measured), np.vstack(stand_ins)
        inverse = np.linalg.inv(self.Z.T @ self.X)
        self.values = inverse @ self.Z.T @ self.y
        self.noise = np.eye(len(self.y))
        (_, first, at_one), (_, second, at_two) = self.takes["one"], self.takes["two"]
        for i, row in enumerate(first):
            for j, other in enumerate(second):
                if row == other:
                    self.noise[at_one.start + i, at_two.start + j] = shared
                    self.noise[at_two.start + j, at_one.start + i] = shared
        self.covariance = inverse @ self.Z.T @ self.noise @ self.Z @ inverse.T
        self.residual = self.y - self.X @ self.values
        self.puts_beside = np.eye(len(self.y)) - self.Z @ inverse.T @ self.X.T

    def white(self, columns):
        """(N, k) from {equation: (FIRST + SECOND, k)}."""
        out = np.zeros((len(self.y), next(iter(columns.values())).shape[1]))
        for name, each in columns.items():
            W, _, at = self.takes[name]
            out[at] = W @ each
        return out


def prepared(shared=SHARED):
    made = recordings(priors={"p": (1.9, 0.05), "nobody's": (0.0, 1.0)})
    return made, Regression(made, noise=known(shared)), Dense(made, shared)


def test_values_their_covariance_and_the_residual_are_those_of_dense_matrices():
    _, found, dense = prepared()
    assert found.names == ["p", "q", "r"] and found.equations == ["one", "two"]
    assert list(found.values.values()) == pytest.approx(dense.values, rel=1e-9)
    assert np.allclose(found.covariance, dense.covariance, rtol=1e-9)
    assert np.allclose(found.residual, dense.residual) and found.chi2 == pytest.approx(
        float(dense.residual @ dense.residual)
    )
    assert found.size == len(dense.y) and found.unseparable == [] and found.idle == []
    for name, (_, _, rows) in dense.takes.items():
        assert found.rows[name] == found.rows_of(name) == rows


def test_columns_of_an_effect_are_put_next_to_the_base_as_by_matrices():
    made, found, dense = prepared()
    widths = RNG.normal(size=(FIRST + SECOND, 2)), RNG.normal(size=(FIRST + SECOND, 2))
    both = [{"one": widths[0][:FIRST], "two": widths[1][:FIRST]}, {"one": widths[0][FIRST:]}]
    second = widths[1].copy()
    second[FIRST:] = 0.0
    white = dense.white({"one": widths[0], "two": second})
    parts = found.whitened(both)
    assert np.allclose(found.full(parts), white)
    beside = dense.puts_beside @ white
    assert np.allclose(found.columns(both), beside) and np.allclose(found.beside(white), beside)
    shadow = found.shadow(parts)
    assert np.allclose(white - found.z @ shadow, beside)
    assert np.allclose(found.gram(parts, shadow), beside.T @ beside)
    assert np.allclose(found.product(parts, shadow, found.residual), beside.T @ dense.residual)
    # the variance of its product with the residual grows by what the equations share: twice the correlation
    added = np.diag(beside.T @ (dense.noise - np.eye(len(dense.y))) @ beside) / (2.0 * SHARED)
    worst = 1.0 + 2.0 * SHARED * np.max(np.abs(added)) * 2 / np.trace(beside.T @ beside)
    assert found.inflation(parts, shadow, found.gram(parts, shadow)) == pytest.approx(worst)
    # in one equation alone: what the base shares still counts
    alone = [{"one": widths[0][:FIRST]}, {"one": widths[0][FIRST:]}]
    parts = found.whitened(alone)
    assert list(parts) == ["one"]
    beside = dense.puts_beside @ dense.white({"one": widths[0]})
    shadow = found.shadow(parts)
    gram = found.gram(parts, shadow)
    added = np.diag(beside.T @ (dense.noise - np.eye(len(dense.y))) @ beside) / (2.0 * SHARED)
    assert found.inflation(parts, shadow, gram) == pytest.approx(
        1.0 + 2.0 * SHARED * np.max(np.abs(added)) * 2 / np.trace(gram)
    )
    # what no recording has an equation for is nothing
    assert found.whitened([{"three": widths[0][:FIRST]}, {}]) == {}
    assert found.whitened([{}, {"two": widths[1][FIRST:]}]) == {}
    # of the second recording alone there are zeros for the first
    late = found.full(found.whitened([{}, {"one": widths[0][FIRST:]}]))
    shifted = widths[0].copy()
    shifted[:FIRST] = 0.0
    assert np.allclose(late, dense.white({"one": shifted}))


def test_a_column_that_the_base_has_already_leaves_nothing():
    made, found, _ = prepared()
    same = [{name: e.columns["p"][:, None] for name, e in each.equations.items()} for each in made]
    for each, recording in zip(same, made, strict=True):
        each["one"] = np.hstack((each["one"], recording.equations["one"].columns["p"][:, None] ** 2))
        if "two" in each:
            each["two"] = np.hstack((each["two"], 0.0 * each["two"]))
    parts = found.whitened(same)
    gram = found.gram(parts, found.shadow(parts))
    # but for the prior of p, in whose row the effect has nothing: 20^2 of some 3000
    assert gram[0, 0] < 0.2 * gram[1, 1]
    free = Regression(recordings(), noise=known())
    parts = free.whitened(
        [{name: e.columns["p"][:, None] for name, e in each.equations.items()} for each in free.recordings]
    )
    assert np.array_equal(free.gram(parts, free.shadow(parts)), np.zeros((1, 1)))


def test_parameters_that_cannot_be_distinguished_or_are_nowhere_are_named():
    made = recordings()
    for each in made:
        e = each.equations["one"]
        e.columns.update(twin=3.0 * e.columns["q"], still=np.zeros(len(each.table)))
        e.stand_ins["twin"] = 3.0 * e.stand_ins["q"]
    found = Regression(made, noise=known(0.0))
    assert found.idle == ["still"] and found.unseparable in (["twin"], ["q"])
    lost = found.unseparable[0]
    assert found.values["still"] == found.values[lost] == 0.0
    row = found.names.index(lost)
    assert not np.any(found.covariance[row]) and not np.any(found.covariance[:, found.names.index("still")])


def test_a_parameter_needs_ten_samples_unless_it_is_known_before():
    t = table(40)
    columns = {name: RNG.normal(size=40) for name in "abcd"}
    for rows, priors, there in ((40, {}, False), (40, {"a": (0.0, 1.0)}, True)):
        valid = np.zeros(40, dtype=bool)
        valid[:rows] = True
        # eight rows at the start never count: 32 are left
        made = Recording(t, {}, {"one": Equation("one", "M", "m", "N", columns["a"], columns, valid)}, priors=priors)
        if there:
            Regression([made])
        else:
            with pytest.raises(UserError, match="rows 40: 32 samples count, too few for 4 parameters"):
                Regression([made])


# --- rows, repeats and noise ------------------------------------------------------------------------------------------


def test_rows_are_kept_from_each_run_s_start_under_a_separate_gaussian_of_the_rows_that_count():
    runs = (slice(0, 31), slice(31, 60))
    valid = np.ones(60, dtype=bool)
    valid[[12, 13, 14, 40]] = False
    made = Equation("one", "M", "m", "N", np.zeros(60), {}, valid)
    one = Recording(table(60, *runs), {}, {"one": made}, width=1.5, every=3)
    column = RNG.normal(size=(60, 2))
    found = regression.reduced(one, column, "one")
    rows = [*range(0, 31, 3), *range(31, 60, 3)]
    reach = 6  # four deviations
    bell = np.exp(-0.5 * (np.arange(-reach, reach + 1) / 1.5) ** 2)
    bell /= bell.sum()
    for place, row in enumerate(rows):
        run = runs[0] if row < 31 else runs[1]
        there = [n for n in range(max(run.start, row - reach), min(run.stop, row + reach + 1)) if valid[n]]
        weights = bell[np.array(there) - row + reach]
        assert found[place] == pytest.approx(weights / weights.sum() @ column[there])
        whole = run.start + reach <= row < run.stop - reach
        assert regression._counts(one, made)[place] == (whole and weights.sum() >= 0.5)
    assert not regression._counts(one, made)[rows.index(12)]  # three of the rows under its top do not count
    assert np.array_equal(regression.kept_rows(one, column), column[rows])
    assert regression._starts(one).tolist() == [row - (0 if row < 31 else 31) < 24 for row in rows]
    plain = Recording(table(60, *runs), {}, {"one": made})
    assert np.array_equal(regression.reduced(plain, column, "one"), column)
    assert np.array_equal(regression._counts(plain, made), valid)


def test_pure_error_is_what_repeats_differ_by():
    part = regression.Part(
        *(None,) * 3, valid=np.ones(60, dtype=bool), starts=None, repeats=np.arange(60) // 3, run=np.zeros(60)
    )
    part.repeats[57:] = -1
    part.valid[0] = False
    residual = RNG.normal(size=60)
    found, freedom = part.pure_error(residual)
    assert freedom == 56 - 19
    assert found[0] == 0.0 and not np.any(found[57:])
    assert found[1:3] == pytest.approx(residual[1:3] - residual[1:3].mean())
    assert found[3:57].reshape(-1, 3) == pytest.approx(
        residual[3:57].reshape(-1, 3) - residual[3:57].reshape(-1, 3).mean(axis=1)[:, None]
    )
    # 20 degrees of freedom are enough, 19 are not
    for pairs, there in ((20, 20), (19, 0)):
        few = regression.Part(
            *(None,) * 3, valid=np.ones(60, dtype=bool), starts=None, repeats=np.full(60, -1), run=np.zeros(60)
        )
        few.repeats[: 2 * pairs] = np.arange(2 * pairs) // 2
        assert few.pure_error(residual)[1] == there
        if not there:
            assert few.pure_error(residual)[0] is residual


def unwhitened(noise, repeats=None, **more):
    """An equation without parameters but one, whose residual is `noise` but for a mean."""
    count = len(noise)
    e = Equation("one", "M", "m", "N", noise, {"level": np.ones(count)}, np.ones(count, dtype=bool))
    one = Recording(table(count), {}, {"one": e}, whitened=False, **more)
    if repeats is not None:
        one.repeats["one"] = repeats
    return one


def test_noise_that_hangs_together_counts_as_so_much_louder_white_noise():
    noise = np.repeat(RNG.normal(size=150), 2)
    found = Regression([unwhitened(noise)]).whitening["one"]
    left = noise[8:] - noise[8:].mean()
    rho = np.mean(left[1:] * left[:-1]) / np.mean(left**2)
    assert 0.3 < rho < 0.6 and len(found.coefficients) == 0
    assert found.deviation == pytest.approx(math.sqrt(np.mean(left**2) * (1.0 + rho) / (1.0 - rho)), rel=1e-3)
    # a memory is believed up to a limit, and never below 0
    held = Regression([unwhitened(noise, memory=0.2)]).whitening["one"]
    assert held.deviation == pytest.approx(math.sqrt(np.mean(left**2) * 1.2 / 0.8), rel=1e-3)
    turning = np.where(np.arange(300) % 2, 1.0, -1.0) + 0.1 * RNG.normal(size=300)
    assert Regression([unwhitened(turning)]).whitening["one"].deviation == pytest.approx(np.std(turning[8:]), rel=1e-2)
    # and it is no less than what is the same in all strides
    floor = Regression([unwhitened(noise, floors={"one": 3.0})]).whitening["one"]
    assert floor.deviation == pytest.approx(math.hypot(found.deviation, 3.0))


@pytest.mark.parametrize("memory", [0.0, 0.4, 0.9])
def test_samples_with_a_memory_that_are_thinned_to_one_in_three_have_its_third_power(memory):
    """The spectrum of every third sample of such a noise is that of a memory m^3, but for a factor."""
    f = np.linspace(0.01, 0.5, 30)
    found = regression._spectrum(f, memory, 0.0, 3)
    wanted = 1.0 / (1.0 + memory**6 - 2.0 * memory**3 * np.cos(2.0 * math.pi * f))
    assert found / found[0] == pytest.approx(wanted / wanted[0])
    # a Gaussian of two samples takes its square off, sample by sample
    one = regression._spectrum(f, memory, 2.0, 1)
    bare = 1.0 / (1.0 + memory**2 - 2.0 * memory * np.cos(2.0 * math.pi * f))
    assert one == pytest.approx(bare * np.exp(-((4.0 * math.pi * f) ** 2)))


def test_noise_from_repeats_is_taken_at_the_upper_limit_of_its_interval():
    noise = np.concatenate((np.zeros(8), RNG.normal(size=60)))
    repeats = np.concatenate((np.full(8, -1), np.arange(60) // 2))
    found = Regression([unwhitened(noise, repeats, memory=0.0)]).whitening["one"]
    apart = noise[8::2] - noise[9::2]
    total = float(apart @ apart) / 2.0
    # thirty pairs have thirty degrees of freedom
    assert found.deviation == pytest.approx(math.sqrt(total / stats.chi2.ppf(0.05, 30)), rel=1e-6)


def test_a_noiseless_equation_is_known_to_a_thousand_millionth_of_its_response():
    ramp = np.linspace(0.0, 7.0, 200)
    e = Equation("one", "M", "m", "N", ramp, {"level": ramp}, np.ones(200, dtype=bool))
    found = Regression([Recording(table(200), {}, {"one": e})]).whitening["one"]
    assert found.deviation == pytest.approx(7e-9)


def test_what_two_equations_share_is_found_and_needs_more_than_40_rows():
    for rows, there in ((49, True), (48, False)):
        a, b = RNG.normal(size=(2, 300))
        valid = np.zeros(300, dtype=bool)
        valid[:rows] = True
        everywhere = np.ones(300, dtype=bool)
        equations = {
            "one": Equation("one", "M", "m", "N", a, {"p": np.ones(300)}, everywhere),
            "two": Equation("two", "E", "m", "V", 3.0 * (0.6 * a + 0.8 * b), {"q": np.ones(300)}, valid),
        }
        found = Regression([Recording(table(300), {}, equations, whitened=False, memory=0.0)])
        assert bool(found.shared) is there
        if there:
            both = slice(8, rows)
            one = (a - found.values["p"])[both] / found.whitening["one"].deviation
            two = (3.0 * (0.6 * a + 0.8 * b) - found.values["q"])[both] / found.whitening["two"].deviation
            assert found.shared["one", "two"] == pytest.approx(np.mean(one * two), abs=0.02)
    twins = {"one": equations["one"], "two": dataclasses.replace(equations["one"], name="two")}
    assert Regression([Recording(table(300), {}, twins, whitened=False)]).shared["one", "two"] == 0.98


def test_an_orthonormal_basis_spans_what_the_columns_do():
    columns = RNG.normal(size=(50, 3)) * np.array([1e-3, 1.0, 1e4])
    more = np.column_stack((columns, columns @ np.array([1.0, 2.0, 1e-4]), np.full(50, 1e-12)))
    basis = regression.orthonormal(more)
    assert basis.shape == (50, 3) and np.allclose(basis.T @ basis, np.eye(3), atol=1e-9)
    assert np.allclose(basis @ basis.T, columns @ np.linalg.pinv(columns), atol=1e-8)


def test_what_columns_explain_is_the_square_of_the_projection():
    columns = RNG.normal(size=(50, 3)) * np.array([1e-3, 1.0, 1e4])
    more = np.column_stack((columns, columns[:, 0] + columns[:, 1]))
    residual = RNG.normal(size=50)
    wanted = float(residual @ (columns @ np.linalg.pinv(columns)) @ residual)
    assert regression.explained(more.T @ more, more.T @ residual) == (pytest.approx(wanted, rel=1e-6), 3)
    assert regression.explained(np.zeros((2, 2)), np.zeros(2)) == (0.0, 0)
    gram = np.diag([4.0, 0.0])
    assert regression.explained(gram, np.array([6.0, 0.0])) == (pytest.approx(9.0), 1)


# --- naming -----------------------------------------------------------------------------------------------------------

N = 600
QUIET = SimpleNamespace(whitening={"one": Whitening(np.zeros(0), 1.0)}, shared={})
BASE, A, B, C, E = RNG.normal(size=(5, N))
NOISE = RNG.normal(size=N)


def asked(response):
    e = Equation("one", "M", "m", "N", response, {"p": BASE}, np.ones(N, dtype=bool))
    return Regression([Recording(table(N), {"t": np.arange(N) * 0.01}, {"one": e})], noise=QUIET)


def effect(cause, make, shapes=({},), admissible=lambda found: True, coefficients=("size",), **more):
    def columns(recording, shape, values):
        made = make(shape)
        return {"one": made[:, None] if made.ndim == 1 else made}

    return Effect(cause, "there", "m", coefficients, shapes, columns, admissible, **more)


def left(response, *columns):
    """Sum of squares of what least squares leave, of rows that count."""
    matrix = np.column_stack((BASE, *columns))[8:]
    return float(np.sum((response[8:] - matrix @ np.linalg.lstsq(matrix, response[8:], rcond=None)[0]) ** 2))


def test_causes_are_taken_the_most_informative_first_with_what_they_are_worth():
    near = A + 0.05 * E  # does nearly as well as A itself
    response = 3.0 * BASE + 1.0 * A + 0.5 * B + NOISE
    effects = [
        effect("b", lambda p: p["n"] * B + (p["n"] - 2.0) * E, [{"n": 1.0}, {"n": 2.0}, {"n": 3.0}]),
        effect("a", lambda p: A),
        effect("near", lambda p: near),
        effect("c", lambda p: C),
    ]
    first, second = naming.select(effects, asked(response))
    assert (first.effect.cause, second.effect.cause) == ("a", "b")
    assert [each.cause for each in first.tied] == ["near"] and second.tied == []
    size, trials = N - 8, 6
    start, with_a = left(response), left(response, A)
    with_both = left(response, A, B)
    assert first.chi2 == pytest.approx(start - with_a) and first.freedom == 1 and first.shape == {}
    assert second.chi2 == pytest.approx(with_a - with_both) and second.shape == {"n": 2.0}
    assert first.bic == pytest.approx(start - with_a - math.log(size))
    # a shape from a grid of three is a parameter too, and one of three that could have come
    assert second.bic == pytest.approx(with_a - with_both - 2.0 * math.log(size) - 2.0 * math.log(3.0))
    assert second.p == pytest.approx(trials * stats.chi2.sf(with_a - with_both, 1)) and first.p < second.p < 1e-6
    behind = {each.cause: by for each, by in first.rivals}
    assert behind["near"] == pytest.approx(left(response, near) - with_a) and 0.0 < behind["near"] < 6.0
    assert behind["c"] == pytest.approx(left(response, C) - with_a) and set(behind) == {"near", "c", "b"}


def test_a_cause_that_explains_no_more_than_chance_among_all_that_was_tried_is_not_taken():
    beside = C - BASE * (BASE[8:] @ C[8:]) / (BASE[8:] @ BASE[8:])
    lone = NOISE - beside * (beside[8:] @ NOISE[8:]) / (beside[8:] @ beside[8:])
    # it pays for itself by 10, and among 401 that were tried one of 100 would have
    for chi2, others, taken in ((16.5, 0, True), (16.3, 0, False), (17.2, 400, False), (18.0, 400, True)):
        assert taken == (chi2 - math.log(N - 8) > 10.0 and (others + 1) * stats.chi2.sf(chi2, 1) < 0.01)
        response = lone + beside * math.sqrt(chi2 / float(beside[8:] @ beside[8:]))
        rest = [effect(f"other {number}", lambda p: E) for number in range(others)]
        found = naming.select([effect("c", lambda p: C), *rest], asked(response))
        assert [each.effect.cause for each in found] == (["c"] if taken else [])


def test_what_no_machine_can_have_is_not_taken_and_no_tie():
    response = -1.0 * A + NOISE
    positive = effect("a", lambda p: A, admissible=lambda found: found["size"] > 0.0)
    same = effect("same", lambda p: A)
    assert naming.select([positive], asked(response)) == []
    (named,) = naming.select([positive, same], asked(response))
    assert named.effect is same and named.tied == []
    (named,) = naming.select([positive], asked(-response))
    assert named.effect is positive
    # within two errors of 0 it may be of either sign
    for size, possible in ((-1.9, True), (-2.1, False)):
        beside = A - BASE * (BASE[8:] @ A[8:]) / (BASE[8:] @ BASE[8:])
        lone = NOISE - beside * (beside[8:] @ NOISE[8:]) / (beside[8:] @ beside[8:])
        (trial,) = naming.trials([positive], asked(lone + size * beside / math.sqrt(float(beside[8:] @ beside[8:]))))
        assert naming.possible(trial) is possible


def test_forms_of_one_cause_at_one_place_are_taken_once_and_four_causes_at_most():
    forms = [effect("a", lambda p: A, form="one"), effect("a", lambda p: B, form="other")]
    response = A + 0.9 * B + NOISE
    assert len(naming.select(forms, asked(response))) == 1
    free = [dataclasses.replace(each, form="") for each in forms]
    assert len(naming.select([free[0], dataclasses.replace(free[1], cause="b")], asked(response))) == 2
    many = [RNG.normal(size=N) for _ in range(5)]
    effects = [effect(str(number), lambda p, each=each: each) for number, each in enumerate(many)]
    assert len(naming.select(effects, asked(sum(many) + NOISE))) == 4
    assert len(naming.select(effects, asked(sum(many) + NOISE), most=2)) == 2


def test_a_refit_has_the_effect_s_columns_in_its_base():
    response = 3.0 * BASE + A + NOISE
    plain = asked(response)
    (named,) = naming.select([effect("a", lambda p: A)], plain)
    assert named.coefficients == ("a@there:size",)
    extended = naming.refit(plain, [named])
    assert extended.chi2 == pytest.approx(left(response, A)) and extended.names == ["p", "a@there:size"]
    assert extended.whitening == plain.whitening and naming.refit(plain, []) is plain
    assert naming.refit(plain, [named], []) is plain
    fresh = naming.refit(plain, [named], fresh=True)
    assert fresh.whitening["one"].deviation == pytest.approx(math.sqrt(left(response, A) / (N - 8)), rel=0.01)


# --- general tests ----------------------------------------------------------------------------------------------------


def test_general_tests_are_chi_squares_of_their_groups_and_of_all_together():
    response = 2.0 * BASE + 0.3 * A + NOISE
    made = asked(response)
    groups = {"g": np.column_stack((A, B)), "h": C[:, None]}
    general = [("one", name, [{"one": columns}]) for name, columns in groups.items()]
    found = misfit.look(made, general)
    (line, g, h) = found.tests
    start = left(response)
    assert (g.equation, g.features, g.freedom) == ("one", "g", 2) and g.chi2 == pytest.approx(
        start - left(response, A, B)
    )
    assert (h.features, h.freedom) == ("h", 1) and h.chi2 == pytest.approx(start - left(response, C))
    assert g.p == pytest.approx(stats.chi2.sf(g.chi2, 2)) and h.p == pytest.approx(stats.chi2.sf(h.chi2, 1))
    assert found.excess == pytest.approx(max(0.0, start - left(response, A, B, C) - 3.0))
    assert found.p == pytest.approx(min(1.0, 3.0 * min(line.p, g.p, h.p))) and found.telling is g
    assert line.chi2 == 0.0 and line.p == 1.0  # of so few rows no line is looked for
    nothing = misfit.look(asked(2.0 * BASE + 1e-12 * NOISE), general)
    assert nothing.p == 1.0 and nothing.excess == 0.0
    quiet = Recording(made.recordings[0].table, {}, made.recordings[0].equations, whitened=False)
    unwhite = Regression([quiet], noise=QUIET)
    assert [each.features for each in misfit.look(unwhite, general).tests] == ["g", "h"]
    assert misfit.look(unwhite, []) == misfit.Misfit([], 1.0, 0.0)


@pytest.mark.parametrize("periods", [300, 700])
def test_a_line_in_the_spectrum_stands_over_the_median_next_to_it(periods):
    rng = generator(11, "line")
    count = 8000
    response = rng.normal(size=count) + 0.15 * np.sin(2.0 * math.pi * periods * np.arange(count) / count)
    e = Equation("one", "M", "m", "N", response, {"p": np.ones(count)}, np.ones(count, dtype=bool))
    made = Regression([Recording(table(count), {}, {"one": e})], noise=QUIET)
    found = misfit.line("one", made)
    assert (found.equation, found.features, found.freedom) == ("one", f"a line at {periods} periods of the data", 2)
    even = np.concatenate((np.zeros(8), made.residual))
    power = np.abs(np.fft.rfft(even)) ** 2
    level = np.median(power[periods - 100 : periods + 101]) / math.log(2.0)
    assert found.chi2 == pytest.approx(2.0 * power[periods] / level)
    # of the lines from 201 to a fifth of the spectrum the largest: an exponential law for each
    tried = int(0.2 * 3999) - 201
    assert found.p == pytest.approx(1.0 - (1.0 - math.exp(-0.5 * found.chi2)) ** tried, rel=1e-6)
    none = dataclasses.replace(e, response=rng.normal(size=count))
    assert misfit.line("one", Regression([Recording(table(count), {}, {"one": none})], noise=QUIET)).p > 0.001


def test_features_are_made_of_each_equation_s_signals_of_all_recordings():
    one, other = asked(NOISE).recordings[0], asked(NOISE).recordings[0]
    looked = {id(one): {"one": {"a": A}}, id(other): {"one": {"a": B}, "two": {"t": C}}}
    machine = SimpleNamespace(generic=lambda r: looked[id(r)])
    found = {(place, group): columns for place, group, columns in misfit.general_features(machine, [one, other])}
    assert list(found) == [("one", "over a"), ("one", "history of a")]
    both = misfit.features({"a": np.concatenate((A, B))}, (0, 10, 30, 100))
    for group in ("over a", "history of a"):
        first, second = found["one", group]
        assert np.array_equal(first["one"], both[group][:N]) and np.array_equal(second["one"], both[group][N:])


# --- intervals and gains ----------------------------------------------------------------------------------------------


def test_an_interval_holds_every_size_whose_sum_of_squares_is_within_3_84_of_the_best():
    response = 2.0 * A + NOISE
    base = asked(response)
    shaped = effect("a", lambda p: A + p["n"] * E, [{"n": n} for n in (-0.2, -0.05, 0.0, 0.05, 0.2)])
    (named,) = naming.select([shaped], base)
    shape, found = intervals.profile(named, base)
    assert set(found) == {"size", "n"}
    squares = {n: left(response, A + n * E) for n in (-0.2, -0.05, 0.0, 0.05, 0.2)}
    best = min(squares, key=squares.get)
    assert shape == {"n": best}
    low, high, tried = math.inf, -math.inf, sorted(squares)
    near = [n for n in tried if squares[n] - squares[best] <= 1.959964**2]
    for n in near:
        matrix = np.column_stack((BASE, A + n * E))[8:]
        size = np.linalg.lstsq(matrix, response[8:], rcond=None)[0][1]
        spread = math.sqrt(np.linalg.inv(matrix.T @ matrix)[1, 1])
        reach = math.sqrt(1.959964**2 - (squares[n] - squares[best])) * spread
        low, high = min(low, size - reach), max(high, size + reach)
    assert found["size"] == pytest.approx((low, high), abs=1e-3 * (high - low))
    places = tried.index(near[0]), tried.index(near[-1])
    ends = (tried[0] if places[0] == 0 else 0.5 * (tried[places[0]] + tried[places[0] - 1]),
            tried[-1] if places[1] == 4 else 0.5 * (tried[places[1]] + tried[places[1] + 1]))  # fmt: skip
    assert found["n"] == pytest.approx(ends)


@pytest.mark.parametrize("part", [1.0, 0.5])
def test_a_gain_is_what_an_effect_wins_of_what_it_could(part):
    """With the size of training: the whole of it, or half of what would be right."""
    response = 1.5 * BASE + 0.8 * A + NOISE
    plain = asked(response)
    cause = effect("a", lambda p: A)
    named = Named(cause, {}, 1.0, 1, 0.0, 1.0, [], [])
    beside = (A - BASE * (BASE[8:] @ A[8:]) / (BASE[8:] @ BASE[8:]))[8:]
    before = plain.residual
    right = float(beside @ before) / float(beside @ beside)
    found = gain.measure(plain, [named], {"a@there:size": part * right}, [], 1)
    after = before - part * right * beside
    assert found.rms_before == pytest.approx(math.sqrt(np.mean(before**2)))
    assert found.rms_after == pytest.approx(math.sqrt(np.mean(after**2))) and not found.worse
    assert found.chi2_won == pytest.approx(float(before @ before - after @ after))
    assert found.chi2_expected == pytest.approx((part * right) ** 2 * float(beside @ beside))
    assert found.holdout == "rows 600"
    # what could be won: the projection, less what noise gives to one column; by blocks of 50 whole rows
    rows = (N - 8) // 50 * 50
    rest = before - right * beside
    possible = before**2 - rest**2 * (1.0 + 1.0 / (N - 9))
    won = before**2 - after**2
    bound = max(float(possible[:rows].sum()), float(won[:rows].sum()))
    assert found.fraction == pytest.approx(float(won[:rows].sum()) / bound)
    assert found.ci95[0] <= found.fraction <= 1.0 and found.ci95[0] <= found.ci95[1] <= 1.0
    wrong = gain.measure(plain, [named], {"a@there:size": -right}, [], 1)
    assert wrong.worse and wrong.fraction < 0.0 and wrong.chi2_won < 0.0


def test_a_phase_is_free_and_its_size_that_of_training():
    angle = 0.7 * np.arange(N)
    response = BASE + 0.9 * np.cos(angle + 0.8) + NOISE
    plain = asked(response)
    wave = effect("w", lambda p: np.column_stack((np.cos(angle), np.sin(angle))), coefficients=("cosine", "sine"),
                  phase_is_free=True)  # fmt: skip
    named = Named(wave, {}, 1.0, 2, 0.0, 1.0, [], [])
    matrix = np.column_stack((BASE, np.cos(angle), np.sin(angle)))[8:]
    cosine, sine = np.linalg.lstsq(matrix, response[8:], rcond=None)[0][1:]
    found = gain.measure(plain, [named], {"w@there:cosine": 0.0, "w@there:sine": -math.hypot(cosine, sine)}, [], 1)
    whole = plain.residual @ plain.residual - left(response, np.cos(angle), np.sin(angle))
    assert found.chi2_won == pytest.approx(whole) and found.fraction == pytest.approx(1.0, abs=0.02)


def test_what_another_run_does_not_share_is_fitted_there():
    response = BASE + 0.9 * A + 0.7 * B + NOISE
    two = effect("a", lambda p: np.column_stack((A, B)), coefficients=("size", "rest"), free=("rest",))
    named = Named(two, {}, 1.0, 2, 0.0, 1.0, [], [])
    found = gain.measure(asked(response), [named], {"a@there:size": 0.9, "a@there:rest": -55.0}, [], 1)
    shifted = response - 0.9 * A
    assert found.rms_after**2 * (N - 8) == pytest.approx(left(shifted, B), rel=2e-3)
