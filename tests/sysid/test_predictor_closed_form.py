"""The predictor and smoother of a linearised simulator against dense matrices: all outputs of a segment at once.

With every noise Gaussian, the outputs of a segment have one covariance matrix. What a Kalman predictor whitens
sample by sample, the inverse of that matrix's Cholesky factor whitens at once; the most probable states are
the conditional mean, by one solution of a linear system. No recursion over covariances is in it.
"""

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.free_simulation import held, runge_kutta
from ranger_sim.sysid.free_simulation.predictor import Jacobians, Predictor, forcing
from ranger_sim.sysid.signals import averaged, roughness

N, S, IN, OUT = 24, 2, 2, 2
STARTS = np.array([0, 10])
ENDS = (10, N)


class System:
    """A random linear, time-varying machine."""

    def __init__(self, seed, noisy=True):
        rng = generator(seed, "predictor")
        self.rng = rng
        self.lin = Jacobians(
            next_state=np.zeros((N, S)),
            output=np.zeros((N, OUT)),
            f_x=np.array([[0.9, 0.2], [-0.3, 0.8]]) + 0.1 * rng.normal(size=(N, S, S)),
            f_u=rng.normal(size=(N, S, IN)),
            f_p=np.zeros((N, S, 1)),
            f_q=np.zeros((N, S, 1)),
            h_x=rng.normal(size=(N, OUT, S)),
            h_u=0.5 * rng.normal(size=(N, OUT, IN)),
            h_p=np.zeros((N, OUT, 1)),
            h_q=np.zeros((N, OUT, 1)),
        )
        self.noise_u = np.array([0.3, 0.7]) if noisy else np.zeros(IN)
        self.noise_y = np.array([0.2, 0.5])
        self.loose = np.abs(rng.normal(size=(N, S))) * (0.4 if noisy else 0.0)
        self.away = np.array([2.0, 3.0])

    def predictor(self, **more):
        return Predictor(self.lin, self.noise_u, self.noise_y, self.loose, STARTS, self.away, **more)

    def segment(self, start, end):
        """Of the samples start ... end - 1: (states, inputs, outputs) as linear maps of (first state, inputs, loose
        steps, sensors), the deviations of these, and the map of forcings into states, (samples, S, samples, S)."""
        lin, n = self.lin, end - start
        width = S + n * (IN + S + OUT)
        place_u = [S + k * (IN + S + OUT) + np.arange(IN) for k in range(n)]
        place_w = [S + k * (IN + S + OUT) + IN + np.arange(S) for k in range(n)]
        place_v = [S + k * (IN + S + OUT) + IN + S + np.arange(OUT) for k in range(n)]
        states, outputs = np.zeros((n, S, width)), np.zeros((n, OUT, width))
        driven = np.zeros((n, S, n, S))
        inputs = np.zeros((n, IN, width))
        deviations = np.zeros(width)
        deviations[:S] = self.away
        states[0, :, :S] = np.eye(S)
        for k in range(n):
            deviations[place_u[k]] = self.noise_u
            deviations[place_w[k]] = self.loose[start + k]
            deviations[place_v[k]] = self.noise_y
            inputs[k][:, place_u[k]] = np.eye(IN)
            outputs[k] = lin.h_x[start + k] @ states[k] + lin.h_u[start + k] @ inputs[k]
            outputs[k][:, place_v[k]] += np.eye(OUT)
            if k + 1 < n:
                states[k + 1] = lin.f_x[start + k] @ states[k] + lin.f_u[start + k] @ inputs[k]
                states[k + 1][:, place_w[k]] += np.eye(S)
                driven[k + 1] = np.einsum("ab,bkc->akc", lin.f_x[start + k], driven[k])
                driven[k + 1, :, k] += np.eye(S)
        return states, inputs, outputs, deviations, driven


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("noisy", [True, False])
def test_errors_are_white_as_by_the_factor_of_the_whole_covariance(seed, noisy):
    system = System(seed, noisy)
    predictor = system.predictor()
    state, output = system.rng.normal(size=(N, S, 3)), system.rng.normal(size=(N, OUT, 3))
    found = predictor.white(predictor.errors(state, output)) / predictor.unit[None, :, None]
    for start, end in zip(STARTS, ENDS, strict=True):
        _, _, outputs, deviations, driven = system.segment(start, end)
        flat = outputs.reshape((end - start) * OUT, -1) * deviations
        factor = np.linalg.cholesky(flat @ flat.T)
        moved = np.einsum("akbc,bcj->akj", driven, state[start:end])
        shown = np.einsum("koa,kaj->koj", system.lin.h_x[start:end], moved) + output[start:end]
        wanted = np.linalg.solve(factor, shown.reshape((end - start) * OUT, 3))
        assert found[start:end].reshape(-1, 3) == pytest.approx(wanted, rel=1e-8, abs=1e-8)
        spread = np.array([factor[OUT * k : OUT * k + OUT, OUT * k : OUT * k + OUT] for k in range(end - start)])
        assert predictor.spread[start:end] == pytest.approx(spread, rel=1e-8, abs=1e-8)
    # white errors are told in the channels' units: the middle one of their deviations
    diagonal = predictor.spread[:, np.arange(OUT), np.arange(OUT)]
    assert predictor.unit == pytest.approx(np.median(diagonal, axis=0), rel=1e-12)


def test_errors_stay_white_with_unknown_numbers_from_before_the_recording():
    """Their products are those by the inverse of the whole covariance, to which the unknown numbers add."""
    system = System(5)
    predictor = system.predictor()
    state, output = system.rng.normal(size=(N, S, 5)), system.rng.normal(size=(N, OUT, 5))
    white = predictor.white(predictor.errors(state, output))
    predictor.forget(white[:, :, 3:])
    found = (predictor.known(white) / predictor.unit[None, :, None]).reshape(N * OUT, 5)
    assert predictor.known(white[:, :, 0]) == pytest.approx(predictor.known(white)[:, :, 0], rel=1e-12)
    assert predictor.white(predictor.errors(state, output)) == pytest.approx(predictor.known(white), rel=1e-12)
    covariance, shown = np.zeros((N * OUT, N * OUT)), np.zeros((N * OUT, 5))
    for start, end in zip(STARTS, ENDS, strict=True):
        _, _, outputs, deviations, driven = system.segment(start, end)
        flat = outputs.reshape((end - start) * OUT, -1) * deviations
        rows = slice(start * OUT, end * OUT)
        covariance[rows, rows] = flat @ flat.T
        moved = np.einsum("akbc,bcj->akj", driven, state[start:end])
        shown[rows] = (np.einsum("koa,kaj->koj", system.lin.h_x[start:end], moved) + output[start:end]).reshape(-1, 5)
    wanted = shown.T @ np.linalg.solve(covariance + shown[:, 3:] @ shown[:, 3:].T, shown)
    assert found.T @ found == pytest.approx(wanted, rel=1e-8, abs=1e-8)


@pytest.mark.parametrize("seed", range(4))
def test_the_most_probable_states_and_inputs_are_the_conditional_mean(seed):
    """x[k+1] = A x[k] - state[k] + B u[k] + what is loose; output[k] = C x[k] + D u[k] + the sensors' noise."""
    system = System(seed)
    predictor, lin = system.predictor(), system.lin
    state, output = system.rng.normal(size=(N, S)), system.rng.normal(size=(N, OUT))
    x, errors = predictor.predicted(state[:, :, None], output[:, :, None])
    dx, du = predictor.smoothed(x[:, :, 0], errors[:, :, 0], lin.f_u, lin.h_u, system.noise_u)
    for start, end in zip(STARTS, ENDS, strict=True):
        states, inputs, outputs, deviations, driven = system.segment(start, end)
        n = end - start
        moved = -np.einsum("akbc,bc->ak", driven, state[start:end])
        left = output[start:end] - np.einsum("koa,ka->ko", lin.h_x[start:end], moved)
        flat = outputs.reshape(n * OUT, -1) * deviations
        noises = deviations * (flat.T @ np.linalg.solve(flat @ flat.T, left.reshape(-1)))
        assert dx[start:end] == pytest.approx(moved + states @ noises, rel=1e-7, abs=1e-8)
        assert du[start:end] == pytest.approx(inputs @ noises, rel=1e-7, abs=1e-8)


def test_stretches_side_by_side_come_to_the_covariances_of_one_after_the_other():
    """Each round hands the covariance at a stretch's end to the next one: after four of four stretches all is known."""
    system = System(7)
    whole = system.predictor()
    rounds = system.predictor(stretch=6)
    assert np.allclose(rounds.spread[:6], whole.spread[:6], rtol=1e-12)
    assert not np.allclose(rounds.spread, whole.spread, rtol=1e-3)  # the others know nothing yet
    for _ in range(3):
        rounds = system.predictor(before=rounds, stretch=6)
    assert np.allclose(rounds.spread, whole.spread, rtol=1e-9)
    assert np.allclose(rounds.gain, whole.gain, rtol=1e-8, atol=1e-10)


def test_what_enters_at_several_ports_adds_up():
    """A step has the mean of its two samples, and the last one its own; but for a port that is held."""
    lin = System(1).lin
    lin.f_q, lin.h_q = (np.repeat(each, 2, axis=2) for each in (lin.f_x[:, :, :1], lin.h_x[:, :, :1]))
    lin.f_q[:, :, 1] *= 3.0
    one, two = generator(1, "ports").normal(size=(2, N, 4))
    middle = np.concatenate((0.5 * (one[1:] + one[:-1]), one[-1:]))
    state, output = forcing(lin, {0: one, 1: two}, {1})
    assert state == pytest.approx(np.einsum("ns,nk->nsk", lin.f_x[:, :, 0], middle + 3.0 * two))
    assert output == pytest.approx(np.einsum("no,nk->nok", lin.h_x[:, :, 0], one + two))
    mean, _ = forcing(lin, {1: two}, (), {1})  # rows are means: the next row's belongs to the step
    assert mean == pytest.approx(np.einsum("ns,nk->nsk", 3.0 * lin.f_x[:, :, 0], np.concatenate((two[1:], two[-1:]))))


def test_dry_friction_brings_a_rate_to_rest_and_not_beyond():
    rate, braking = np.array([2.0, -2.0, 0.3, -0.3, 0.5, 0.0]), np.array([0.5, 0.5, 0.5, 0.5, 0.5, 0.5])
    assert list(held(rate, braking)) == [1.5, -1.5, 0.0, 0.0, 0.0, 0.0]


def test_a_step_of_runge_and_kutta_has_the_series_to_the_fourth_power():
    """x' = a x + u: exp's first five terms; with the input's share the same series of the forced part."""
    a, u, h = -1.7, 0.6, 0.3
    z = a * h
    grows = 1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24
    forcing = u * h * (1 + z / 2 + z**2 / 6 + z**3 / 24)
    found = runge_kutta(lambda x, u, p: {"x": p["a"] * x["x"] + u["u"]}, {"x": 2.0}, {"u": u}, {"a": a}, h)
    assert found["x"] == pytest.approx(2.0 * grows + forcing, rel=1e-14)


def test_a_channels_roughness_is_its_noise_and_neither_its_course_nor_its_jumps():
    time_s = 0.002 * np.arange(20_000)
    noise = 0.03 * generator(4, "rough").normal(size=20_000)
    course = 2.0 + time_s + 0.5 * np.sin(2.0 * np.pi * 0.5 * time_s) + 4.0 * (time_s > 20.0)
    table = Table(time_s, {}, (slice(0, 9000), slice(9000, 20_000)))
    # a median of 20,000 with a correlation of some samples: 2 % is four of its deviations
    assert roughness(table, course + noise) == pytest.approx(0.03, rel=0.02)
    assert roughness(table, course) < 1e-4
    short = Table(time_s[:51], {}, (slice(0, 51),))
    assert roughness(short, noise[:51]) == 0.0  # no longer than the window of 51 rows
    assert roughness(Table(time_s[:52], {}, (slice(0, 52),)), noise[:52]) > 0.01


def test_samples_of_a_run_are_averaged_and_what_is_left_over_goes():
    time_s = np.arange(13.0)
    table = Table(time_s, {"a": time_s**2}, (slice(0, 7), slice(7, 9), slice(9, 13)), "log", {"a": 0.5})
    found = averaged(table, 3)
    assert list(found.time_s) == [1.0, 4.0, 10.0]
    assert list(found["a"]) == pytest.approx([(0 + 1 + 4) / 3, (9 + 16 + 25) / 3, (81 + 100 + 121) / 3])
    assert found.runs == (slice(0, 2), slice(2, 3)) and (found.name, found.resolution) == ("log", {"a": 0.5})
    assert averaged(table, 1) is table


@pytest.mark.parametrize("seed", range(4))
def test_stretches_that_begin_where_another_predictor_was_are_as_good_as_one(seed):
    """One stretch of all samples is exact; short ones begin with its covariances, and others with theirs."""
    system = System(seed)
    one = system.predictor(stretch=N)
    short = system.predictor(stretch=3, before=one)
    again = system.predictor(stretch=4, before=short)
    for found in (short, again):
        assert found.covariance == pytest.approx(one.covariance, rel=1e-9, abs=1e-12)
        assert found.spread == pytest.approx(one.spread, rel=1e-9, abs=1e-12)
    alone = system.predictor(stretch=3)
    assert np.max(np.abs(alone.covariance - one.covariance)) > 0.01 * np.max(np.abs(one.covariance))
