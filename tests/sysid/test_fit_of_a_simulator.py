"""A toy that is simulated: its Jacobians, noises, ports and equations as they are worked out by hand."""

import dataclasses
import math

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.free_simulation import (
    Joint,
    Output,
    Port,
    SimulatedMachine,
    SimulatedRecording,
    Term,
    numerical_floor,
    runge_kutta,
    standing,
)
from ranger_sim.sysid.free_simulation.fit import TrajectoryFit
from ranger_sim.sysid.free_simulation.terms import Acting
from ranger_sim.sysid.machine import Known, Quantity
from ranger_sim.sysid.signals import roughness

H, COUNT = 0.01, 400
TIME_S = 3.0 + H * np.arange(COUNT) + 1.0 * (np.arange(COUNT) >= 250)
RUNS = (slice(0, 250), slice(250, COUNT))
RNG = generator(9, "toy")
U, D = RNG.normal(size=COUNT), RNG.normal(size=COUNT)
X, V = RNG.normal(size=COUNT), RNG.normal(size=COUNT)


class Toy(SimulatedMachine):
    """x' = v, v' = - k x - c v^3 + u + push; shown are k x and v + u / 2."""

    name = "toy"
    quantities = (Quantity("y_m", "m", ""), Quantity("z_m_per_s", "m/s", ""))
    parameters = (Known("k", "", 2.0, 0.5, 9.0, ""), Known("c", "", 0.0, -1.0, 3.0, ""))
    states = ("x", "v")
    outputs = (Output("y_m", "M", "mechanical", "m"), Output("z_m_per_s", "S", "sensor", "m/s"))
    ports = (Port("push", "N", "mechanical", "gate"), Port("shown", "m", "sensor"))
    noisy_inputs = {"u": 0.3}  # noqa: RUF012
    parts = 1  # so that a step is one line of Euler

    def inputs(self, table):
        return {"u": table["u"], "d": table["d"]}

    def first_guess(self, table):
        return {"x": table["x"], "v": table["v"]}

    def step(self, x, u, p, step_s):
        push = -p["k"] * x["x"] - p["c"] * x["v"] ** 3 + u["u"] + u["push"]
        return {"x": x["x"] + step_s * x["v"] + 0.1 * u["u"] * u["d"], "v": x["v"] + step_s * push}

    def observe(self, x, u, p):
        return {"y_m": p["k"] * x["x"] + u["shown"], "z_m_per_s": x["v"] + 0.5 * u["u"]}

    def loose(self, x, u, p, step_s):
        return {"v": 0.2 * np.abs(x["x"]) + step_s * p["k"] + 0.01 * np.abs(u["push"])}

    def extra_signals(self, along, table):
        return {"gate": np.where(along["x"] > 0.0, 1.0, 0.25)}

    def counts(self, along, table):
        return {"z_m_per_s": along["v"] > 0.0}

    def terms(self, recordings):
        return [Term("a", "there", "mechanical", ("size",), lambda r, p, v: {"push": p["n"] * r.signals["v"]},
                     ({"n": 2.0},), lambda found: found["size"] > 0.0, "what it is", True)]  # fmt: skip


def table(**columns):
    made = {"u": U, "d": D, "x": X, "v": V, "y_m": 2.0 * X, "z_m_per_s": V + 0.5 * U} | columns
    return Table(TIME_S, made, RUNS, "toy run", {"y_m": 0.6})


@pytest.fixture(scope="module", autouse=True)
def as_it_steps():
    """The toy's one step of Euler from sample to sample is what is worked out by hand here."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(numerical_floor, "MOST_PARTS", 1)
        yield


def middle(values):
    return np.append(0.5 * (values[1:] + values[:-1]), values[-1])


def test_derivatives_by_differences_are_the_toy_s_own():
    fit = TrajectoryFit(Toy(), table())
    fit.p = np.array([2.0, 0.7])
    lin = fit.linearise()
    zero, one = np.zeros(COUNT), np.ones(COUNT)

    def stacked(*rows):
        return np.stack([np.stack(row, axis=-1) for row in rows], axis=1)

    wanted = {
        "f_x": stacked((one, H * one), (-2.0 * H * one, 1.0 - 3.0 * H * 0.7 * V**2)),
        "f_u": stacked((0.1 * middle(D),), (H * one,)),
        "f_p": stacked((zero, zero), (-H * X, -H * V**3)),
        # two of the toy's own, then the engine's: at both outputs, into both inputs, of both parameters
        "f_q": stacked(
            (zero, zero, zero, zero, 0.1 * middle(D), 0.1 * middle(U), zero, zero),
            (H * one, zero, zero, zero, H * one, zero, -H * X, -H * V**3),
        ),
        "h_x": stacked((2.0 * one, zero), (zero, one)),
        "h_u": stacked((zero,), (0.5 * one,)),
        "h_p": stacked((X, zero), (zero, zero)),
        "h_q": stacked(
            (zero, one, one, zero, zero, zero, X, zero), (zero, zero, zero, one, 0.5 * one, zero, zero, zero)
        ),
    }
    for name, matrix in wanted.items():
        assert getattr(lin, name).shape == matrix.shape
        assert np.allclose(getattr(lin, name), matrix, atol=1e-6), name
    after = (X + H * V + 0.1 * middle(U) * middle(D), V + H * (-2.0 * X - 0.7 * V**3 + middle(U)))
    assert np.allclose(lin.next_state, np.stack(after, axis=1))
    assert np.allclose(lin.output, np.stack((2.0 * X, V + 0.5 * U), axis=1))


def test_an_effect_that_acts_pushes_with_its_size_and_is_a_parameter():
    """A push of 2 v gate, of which the simulator has 0.3; a step sees the middle of a sample and the next."""
    toy = Toy()
    fit = TrajectoryFit(toy, table())
    fit.p_at, fit.lin = np.array([2.0, 0.7]), fit.linearise()
    (term,) = toy.terms([])
    acting = fit.acted_on([Acting(term, {"n": 2.0}, (0.3,))], fixed=False)
    assert acting.p.tolist() == [2.0, 0.7, 0.3] and acting.moves.tolist() == [1.0, 1.0, 1.0]
    assert acting.low.tolist() == [0.5, -1.0, -math.inf] and acting.high.tolist() == [9.0, 3.0, math.inf]
    assert acting.size_p[2] == 0.3 and fit.acted_on([Acting(term, {"n": 2.0}, (0.0,))], False).size_p[2] == 1.0
    assert fit.acted_on([Acting(term, {"n": 2.0}, (-0.3,))], False).size_p[2] == 0.3
    assert fit.acted_on([Acting(term, {"n": 2.0}, (0.3,))], fixed=True).moves.tolist() == [1.0, 1.0, 0.0]
    assert fit.acting == [] and fit.p.tolist() == [2.0, 0.0]  # the fit that it comes from stays
    lin = acting.linearise()
    # where it enters is weighed by the gate
    push = 2.0 * V * np.where(X > 0.0, 1.0, 0.25)
    (entering,) = acting.enter
    assert list(entering) == [0] and np.allclose(entering[0][:, 0], push)
    free = V + H * (-2.0 * X - 0.7 * V**3 + middle(U))
    assert np.allclose(lin.next_state[:, 1], free + 0.3 * H * middle(push))
    assert lin.f_p.shape == (COUNT, 2, 3) and np.allclose(lin.f_p[:, 1, 2], H * middle(push), atol=1e-9)
    assert not np.any(lin.h_p[:, :, 2])
    # the law leaves open what it says at the ports as they are, and a trace in every state
    loose = acting.loose()
    assert np.allclose(loose[:, 1], 0.2 * abs(X) + 2.0 * H + 0.003 * abs(push) + 1e-9 * fit.size_x[1], rtol=1e-9)
    assert np.allclose(loose[:, 0], 1e-9 * np.sqrt(np.mean(X**2)), rtol=1e-9)


def test_noises_sizes_and_starts_are_reported_by_the_recording():
    rough = [roughness(table(), column) for column in (2.0 * X, V + 0.5 * U)]
    fit = TrajectoryFit(Toy(), table())
    # a lattice of 0.6 has an error of 0.6 / sqrt(12) beside the channel's own noise
    assert fit.noise_y == pytest.approx([math.hypot(rough[0], 0.6 / math.sqrt(12.0)), rough[1]])
    assert fit.noise_u.tolist() == [0.3]
    assert fit.size_x == pytest.approx([math.sqrt(np.mean(X**2)), math.sqrt(np.mean(V**2))])
    assert fit.size_u == pytest.approx([math.sqrt(np.mean(U**2))])
    # a parameter of 0 has a hundredth of what its limits leave, and never of more than a million
    assert fit.size_p.tolist() == [2.0, 0.04]
    assert fit.starts.tolist() == [0, 250] and np.flatnonzero(fit.ends).tolist() == [249, COUNT - 1]

    class Other(Toy):
        noisy_inputs = {"u": None}  # noqa: RUF012
        horizon_s = 1.2
        parameters = (Known("k", "", -2.0, -9.0, 9.0, ""), Known("c", "", 0.0, -1e9, 1e9, ""))

    other = TrajectoryFit(Other(), table())
    assert other.noise_u == pytest.approx([roughness(table(), U)])
    assert other.starts.tolist() == [0, 120, 240, 250, 370] and other.size_p.tolist() == [2.0, 1e4]

    class Short(Toy):
        horizon_s = 0.001
        noisy_inputs = {}  # noqa: RUF012

    short = TrajectoryFit(Short(), table())
    assert short.starts.tolist() == [*range(0, 250, 2), *range(250, COUNT, 2)] and short.u.shape == (COUNT, 0)
    # a channel without any noise is known to a thousand millionth of its range
    line = TrajectoryFit(Toy(), table(z_m_per_s=5.0 * np.arange(COUNT)))
    assert line.noise_y[1] == pytest.approx(1e-9 * 5.0 * (COUNT - 1), rel=0.5)
    with pytest.raises(UserError, match="toy run: y_m never changes; toy can be judged in motion only"):
        TrajectoryFit(Toy(), table(y_m=np.full(COUNT, 3.0)))


def test_a_long_recording_is_averaged_with_what_the_machine_makes_of_it():
    fit = TrajectoryFit(Toy(), table(), 3)
    assert len(fit.table) == 83 + 50 and fit.step_s == pytest.approx(3.0 * H)
    for found, whole in (
        (fit.simulator.inputs["u"], U),
        (fit.simulator.inputs["d"], D),
        (fit.x[:, 0], X),
        (fit.x[:, 1], V),
        (fit.y[:, 0], 2.0 * X),
    ):
        parts = np.concatenate([whole[run][: len(whole[run]) // 3 * 3].reshape(-1, 3).mean(axis=1) for run in RUNS])
        assert np.allclose(found, parts)


class Still(Toy):
    """Driven by nothing, and certain of its law."""

    noisy_inputs = {}  # noqa: RUF012

    def loose(self, x, u, p, step_s):
        return {}


def swinging(stiffness):
    """Three seconds of the toy's own recursion, with c = 0.2."""
    x, v, rows = 1.0, 0.0, []
    for _ in range(300):
        rows.append((x, v))
        x, v = x + H * v, v + H * (-stiffness * x - 0.2 * v**3)
    x, v = np.array(rows).T
    columns = {"u": 0.0 * x, "d": 0.0 * x, "x": x, "v": v, "y_m": stiffness * x, "z_m_per_s": v}
    return Table(H * np.arange(300), columns, (slice(0, 300),), "swing")


@pytest.mark.parametrize(("true", "after_one"), [(8.0, 4.0), (0.9, 1.0)])
def test_a_round_goes_no_farther_than_to_a_half_or_the_double_of_what_must_be_positive(true, after_one):
    fit = TrajectoryFit(Still(), swinging(true))
    fit.noise_y = np.array([0.01, 0.01])
    step = fit.round()
    assert fit.p[0] == pytest.approx(after_one, rel=1e-6) and step > 1.0


def test_rounds_end_at_the_toy_s_own_numbers():
    fit = TrajectoryFit(Still(), swinging(2.4))
    fit.noise_y = np.array([0.01, 0.01])
    steps = [fit.round() for _ in range(6)]
    assert fit.p == pytest.approx([2.4, 0.2], abs=0.005)
    assert steps[0] > 1.0 > 0.01 > steps[-1]


def test_simple_differences_are_the_central_ones_to_a_ten_thousandth_of_the_largest():
    """The toy is linear but for a product of a state and an input, whose error is the nudge of 1e-6."""
    fit = TrajectoryFit(Toy(), table())
    sizes = fit.size_x, fit.size_u, fit.size_p
    central, simple = (
        fit.simulator.linearised(fit.x, fit.u, fit.p, fit.entering(), sizes, (), each) for each in (True, False)
    )
    for name in ("f_x", "f_u", "f_p", "h_x", "h_u", "h_p"):
        wanted = getattr(central, name)
        assert getattr(simple, name) == pytest.approx(wanted, abs=1e-4 * float(np.max(np.abs(wanted), initial=1e-9)))


@pytest.mark.parametrize(("true", "limit"), [(8.0, 2.05), (0.9, 1.9)])
def test_limits_hold_in_every_round(true, limit):
    class Narrow(Still):
        parameters = (Known("k", "", 2.0, 1.9, 2.05, ""), Known("c", "", 0.0, -1.0, 3.0, ""))

    fit = TrajectoryFit(Narrow(), swinging(true))
    fit.noise_y = np.array([0.01, 0.01])
    fit.round()
    assert fit.p[0] == limit


def test_noise_is_found_anew_as_what_is_left_between_nothing_and_twice_what_was_shown():
    fit = TrajectoryFit(Toy(), table())
    fit.rest = np.column_stack((np.full(COUNT, 1e-30), np.full(COUNT, 1e6)))
    fit._renew_noise()
    assert fit.noise_y == pytest.approx([1e-9 * np.ptp(2.0 * X), 2.0 * fit.shown_y[1]])
    some = 0.5 * fit.shown_y * RNG.normal(size=(COUNT, 2))
    fit.rest = some
    fit._renew_noise()
    assert fit.noise_y == pytest.approx(np.median(np.abs(some), axis=0) / 0.6745)


def test_signals_along_the_trajectory_are_states_inputs_outputs_time_and_the_machine_s_own():
    fit = TrajectoryFit(Toy(), table())
    fit.lin = fit.linearise()
    seen = fit.seen()
    sensed = {"sensed y_m", "sensed z_m_per_s"}
    assert set(seen.signals) == {"x", "v", "u", "d", "y_m", "z_m_per_s", "t", "gate"} | sensed
    assert np.array_equal(seen.signals["sensed y_m"], seen.signals["y_m"])
    assert np.array_equal(seen.signals["x"], X) and np.array_equal(seen.signals["v"], V)
    assert np.allclose(seen.signals["y_m"], 2.0 * X) and np.allclose(seen.signals["z_m_per_s"], V + 0.5 * U)
    assert np.allclose(seen.signals["t"], TIME_S - 3.0) and np.array_equal(seen.signals["d"], D)


@pytest.fixture(scope="module")
def recording():
    return Toy().prepare(table())


def test_equations_have_what_is_missed_and_the_values_with_their_columns(recording):
    assert list(recording.equations) == ["y_m", "z_m_per_s"]
    first, second = recording.equations.values()
    assert (first.letter, first.subsystem, first.unit) == ("M", "mechanical", "m")
    assert (second.letter, second.subsystem, second.unit) == ("S", "sensor", "m/s")
    assert list(first.columns) == ["k", "c"] and first.valid.all()
    assert np.array_equal(second.valid, recording.signals["v"] > 0.0) and not second.valid.all()
    assert recording.lags == (0, 1, 3, 10) and recording.outputs == ("y_m", "z_m_per_s")
    fit = recording.fit
    for number, equation in enumerate((first, second)):
        told = sum(fit.p_at[i] * column for i, column in enumerate(equation.columns.values()))
        assert np.allclose(equation.response - told, fit.response[:, number])
    assert recording.fitted == dict(zip(("k", "c"), fit.p_at, strict=True))
    assert recording.whitened and not Toy().free(recording).whitened


def test_what_enters_at_a_port_is_weighed_there_and_seen_by_the_equations_that_it_reaches(recording):
    one, two = recording.signals["v"], np.column_stack((recording.signals["x"], np.ones(COUNT)))
    gate = recording.signals["gate"]
    entering = recording.entering({"push": one})
    assert list(entering) == [0] and np.allclose(entering[0], (gate * one)[:, None])
    both = recording.entering({"push": two, "shown": 3.0 * two})
    assert np.allclose(both[0], gate[:, None] * two) and np.allclose(both[1], 3.0 * two)
    lin, predictor = recording.linear, recording.predictor
    states, outputs = np.zeros((COUNT, 2, 1)), np.zeros((COUNT, 2, 1))
    states[:, 1, 0] = H * middle(gate * one)
    outputs[:, 0, 0] = one
    # a push goes through the states, a sensor's error into its output alone
    wanted = predictor.white(predictor.errors(states, np.zeros((COUNT, 2, 1))))
    found = recording.respond({"push": one})
    assert set(found) == {"y_m", "z_m_per_s"} and lin is not None
    for number, name in enumerate(found):
        assert np.allclose(found[name], wanted[:, number], atol=1e-6 * np.max(np.abs(wanted)))
    shown = predictor.white(predictor.errors(np.zeros((COUNT, 2, 1)), outputs))
    assert np.allclose(recording.respond({"shown": one})["y_m"], shown[:, 0], atol=1e-6 * np.max(np.abs(shown)))
    assert recording.entries["push"].subsystem == "mechanical" and recording.entries["shown"].subsystem == "sensor"
    through = recording.entries["push"].respond(one[:, None])
    assert np.allclose(through["y_m"], found["y_m"])
    with pytest.raises(UserError, match="a term puts something into pull, pulse; ports are push, shown, "):
        recording.respond({"pull": one, "push": one, "pulse": one})


def test_an_equation_that_sees_next_to_nothing_of_an_effect_does_not_have_it(recording):
    quiet = dataclasses.replace(recording)
    lin = recording.linear
    h_q = np.zeros_like(lin.h_q)
    for share, there in ((1e-2, True), (1e-5, False)):
        h_q[:, 0, 1], h_q[:, 1, 1] = 1.0, share
        quiet.linear = dataclasses.replace(lin, f_q=np.zeros_like(lin.f_q), h_q=h_q)
        # without memory an equation sees its own alone
        quiet.predictor = SeesItself(recording.predictor.unit)
        assert ("z_m_per_s" in quiet.respond({"shown": np.ones(COUNT)})) is there


class SeesItself:
    def __init__(self, unit):
        self.unit = np.ones_like(unit)

    def errors(self, state, output):
        return output

    def white(self, errors):
        return errors


def test_effects_are_the_terms_with_all_that_they_say(recording):
    effect, *free = Toy().effects([recording])
    assert {each.cause for each in free} >= {"sensor_offset", "sensor_scale", "sensor_lag", "dead_zone", "saturation"}
    assert (effect.cause, effect.at, effect.subsystem, effect.coefficients) == ("a", "there", "mechanical", ("size",))
    assert effect.shapes == ({"n": 2.0},) and effect.meaning == "what it is" and effect.phase_is_free
    assert effect.admissible({"size": 1.0}) and not effect.admissible({"size": -1.0})
    found = effect.columns(recording, {"n": 2.0}, {})
    assert np.allclose(found["y_m"], recording.respond({"push": 2.0 * recording.signals["v"]})["y_m"])
    looked = Toy().generic(recording)
    assert list(looked) == ["push", "shown"] and list(looked["push"]) == ["x", "v", "t"]


def test_a_recording_must_be_long_enough_and_whole():
    toy = Toy()
    with pytest.raises(UserError, match="toy run: the longest stretch without a gap is 1.9 s, toy needs 2 s"):
        toy.prepare(
            Table(TIME_S[:190], {name: c[:190] for name, c in table().columns.items()}, (slice(0, 190),), "toy run")
        )
    with pytest.raises(UserError, match="bare: toy needs y_m, z_m_per_s; there are u"):
        toy.prepare(Table(TIME_S, {"u": U}, RUNS, "bare"))
    assert isinstance(toy.prepare(table()), SimulatedRecording)


class Sliding(SimulatedMachine):
    """x' = v, v' = (u + what a joint gets) / 2: without friction a push moves it by half its acceleration times t^2."""

    name = "sliding"
    quantities = (Quantity("y_m", "m", ""),)
    parameters = (Known("m", "", 2.0, 0.5, 9.0, ""),)
    states = ("x", "v")
    outputs = (Output("y_m", "M", "mechanical", "m"),)
    joints = (Joint("v", inertia="m"),)

    def inputs(self, table):
        return {"u": table["u"]}

    def first_guess(self, table):
        return {"x": table["y_m"], "v": table["v"]}

    def step(self, x, u, p, step_s):
        return runge_kutta(lambda x, u, p: {"x": x["v"], "v": u["u"] / p["m"]}, x, u, p, step_s)

    def observe(self, x, u, p):
        return {"y_m": x["x"]}


def test_a_push_at_a_joint_moves_it_as_the_same_push_inside_the_law_does():
    """By the recording's own sample: rates by the push's impulse, positions by half of it."""
    fit = TrajectoryFit(Sliding(), table())
    lin = fit.linearise()
    into, on = (["shown y_m", "into u", "on v"].index(name) for name in ("into u", "on v"))
    assert np.allclose(lin.f_q[:, :, on], lin.f_q[:, :, into], atol=1e-9)
    assert np.allclose(lin.f_q[:, :, on], [0.25 * H**2, 0.5 * H], atol=1e-9)


def test_friction_is_open_within_two_widths_of_standstill():
    """An impulse of its limit over a memory of 10 ms, white: 2 C^2 tau h; at 2 widths less by exp(-1/2)."""
    found = standing(np.array([0.0, 0.04, -0.04, 1.0]), np.array([0.3]), 0.02, 0.005)
    size = 0.3 * math.sqrt(2.0 * 0.01 * 0.005)
    assert found == pytest.approx([size, size * math.exp(-0.5), size * math.exp(-0.5), 0.0], abs=1e-12)
