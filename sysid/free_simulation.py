"""A machine given by its simulator: fitted in the simulation, diagnosed as a linear regression.

An equation error needs every derivative of the measured signals, and a noisy column biases the residual. Here nothing
measured is differentiated. The simulator's trajectory is fitted to the recording, parameters and all;
along it the simulator is linearised, for all samples together:

    x[k+1] = f(x[k], u[k], p) + noise of the inputs          states, measured inputs, parameters
    y[k]   = h(x[k], u[k], p) + noise of the sensors         outputs that were measured

    response   the simulation's error in the outputs, one step ahead
    columns    the outputs' sensitivities to the parameters: the forward sensitivity equations
    effects    the outputs' first-order response to an extra torque, voltage or sensor's error at a port

All three pass one linear, time-varying filter, the Kalman predictor of the linearised simulator. It makes the residual
white: a sensor's noise stays unchanged, an input's noise is followed through the machine, and an initial state is
projected out. With exact inputs it is the output error of multiple shooting, segment by segment (`horizon_s`) with
free initial states; the trajectory itself is found by multiple shooting with segments of one sample (Bock 1987), whose
gaps are closed as far as the inputs' noise does not explain them. So a distant start converges, and errors do not
accumulate in a machine that forgets nothing.

A named effect acts in the simulator from then on (`again`): trajectory, parameters and its own size are fitted
together, so that a large effect is not judged by its first order about a model without it. The gain of an extension is
measured in simulations that run freely over windows (`free`).

A user's machine is a subclass of `SimulatedMachine`; `examples/servo_arm.py` is a complete one.
"""

import abc
import copy
import dataclasses
import functools
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import cast

import numpy as np
from scipy.linalg import lapack
from scipy.signal import savgol_filter

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import signals
from ranger_sim.sysid.dataset import Array, Table
from ranger_sim.sysid.free_candidates import candidates
from ranger_sim.sysid.machine import Columns, Effect, Entry, Equation, Known, Quantity, Recording, Values
from ranger_sim.sysid.simulated_terms import (
    Acting,
    Joint,
    Output,
    Port,
    Ports,
    Shape,
    SimulatedEffect,
    Term,
    into,
    on,
    sensed,
    shown,
)

# for machines, which need nothing else
__all__ = [
    "Acting", "Joint", "Output", "Port", "Ports", "Predictor", "Shape", "SimulatedEffect", "SimulatedMachine",
    "SimulatedRecording", "Term", "averaged", "forced", "held", "roughness", "runge_kutta", "standing",
]  # fmt: skip

ROUNDS = 30  # of Gauss and Newton, at most
RENEWED = 2  # times that the sensors' noise is estimated again, each time when the rounds have converged
WORSE = 4.0  # times the least sum of squares: a round that ended there went too far
STEADY = 0.1  # standard errors of a parameter: a smaller step of all of them ends the rounds
LAGS_S = (0.0, 0.01, 0.03, 0.1)  # lags at which the general tests use slopes
NUDGE = 1e-6  # of a quantity's size: step of a central difference
ROUGH_S = 0.1  # window in which a parabola separates a channel's own noise from its course
MOST_ROWS = 12000  # of a recording; a longer one is averaged over neighbours
AWAY = 30.0  # a free initial state's deviation, in rms of the state: practically unknown
STRETCH = 400  # samples of a stretch; covariances of all stretches are computed side by side
LOUDER = 2.0  # times the channel's own noise estimate (`roughness`), which misses slower noise. Chosen by us
OPEN_S = 0.01  # memory of dry friction's reaction where it holds; chosen by us
AGAIN = 12  # rounds with an effect in the simulator, at most: they start at the end of the fit without it
JUMPS = 0.2  # of the samples at most: an input that changes at no more of them is held in between
SHORTEST_WINDOW = 50  # samples of a free simulation, of which the free initial state takes some
FAR_OFF = 100.0  # mean square of the errors, in their noise: from here on the fit follows the measurement
FOLLOWED = (0.3, 0.1, 0.03, 0.01)  # of a state's usual step, by which it may leave the law
FOLLOWING, MISSED = 6, 3.0  # rounds with each of them; mean square of the errors that a share no longer explains
SMOOTHER = 0.25  # of the straight lines' square that a cubic leaves: there it is the better way between samples
NUMERICAL = 4  # rounds with other numerics, from the fit without them
NARROW = 0.25  # of what is open at standstill, in the numerical floor
DAMPED = 0.01  # of its length: pull on a candidate of which a ten-thousandth of the square is its own
SHARE_OPEN = 0.01  # of the largest deviation of the open law: there it is open
TOGETHER = 24  # responses that are computed side by side
SAME = 1.0 - 1e-6  # cosine of two responses: candidates of two names for one effect
SILENT = 1e-6  # share of an effect's length below which an equation does not have it

Quantities = Mapping[str, Array]  # by name, all of one shape


def held(rate: Array, braking: Array) -> Array:
    """A rate after dry friction that can take `braking` of it in this step: it stops at zero and does not reverse.

    This is the implicit step of Coulomb's law: true standstill, without a smoothed sign that creeps.
    """
    return cast(Array, np.sign(rate) * np.maximum(np.abs(rate) - braking, 0.0))


def standing(rate: Array, friction: Array, slow: float, step_s: float) -> Array:
    """Deviation of dry friction's impulse per step near standstill, where friction balances any torque (for `loose`).

    rate: (n,); friction: its limit, torque or force; slow: rate about which a smoothed sign turns. Otherwise a machine
    that truly rests would differ from every simulation with a smoothed sign, and that would be called an effect.
    """
    return np.asarray(friction * np.exp(-0.5 * (rate / (2.0 * slow)) ** 2) * np.sqrt(2.0 * OPEN_S * step_s))


def runge_kutta(
    rates: Callable[[Quantities, Quantities, Quantities], Quantities],
    x: Quantities,
    u: Quantities,
    p: Quantities,
    step_s: float,
) -> dict[str, Array]:
    """One step of the classical fourth-order method; inputs keep their values of the step's middle. For `step`."""

    def at(rate: Quantities, part_s: float) -> dict[str, Array]:
        return {name: x[name] + part_s * rate[name] for name in x}

    first = rates(x, u, p)
    second = rates(at(first, 0.5 * step_s), u, p)
    third = rates(at(second, 0.5 * step_s), u, p)
    fourth = rates(at(third, step_s), u, p)
    return {
        name: x[name] + step_s / 6.0 * (first[name] + 2.0 * (second[name] + third[name]) + fourth[name]) for name in x
    }


@dataclasses.dataclass
class Jacobians:
    """The simulator about a trajectory. n samples, s states, i noisy inputs, p parameters, o outputs, q ports.

    next_state: (n, s) f; output: (n, o) h; the rest: their derivatives, `f_x` (n, s, s) to `h_q` (n, o, q).
    """

    next_state: Array
    output: Array
    f_x: Array
    f_u: Array
    f_p: Array
    f_q: Array
    h_x: Array
    h_u: Array
    h_p: Array
    h_q: Array


class Predictor:
    """The Kalman predictor of a linearised simulator: turns forcings into white prediction errors.

    A forcing has a part in the states, (n, s, k), and a part in the outputs, (n, o, k).
    """

    def __init__(self, lin: Jacobians, noise_u: Array, noise_y: Array, loose: Array, starts: np.ndarray, away: Array,
                 before: "Predictor | None" = None, stretch: int = STRETCH) -> None:  # fmt: skip
        """noise_u: (i,), noise_y: (o,) standard deviations; loose: (n, s) of each step; starts: samples at which the
        state is free, with standard deviations `away` (s,). before: of the last round of a fit."""
        n, s = lin.next_state.shape
        o = lin.output.shape[1]
        self.n, self.s, self.o = n, s, o
        self.h_x = lin.h_x
        self.ends: Array  # (stretches, s, s) covariances at the end of each stretch
        self.gain = np.empty((n, s, o))
        self.spread = np.empty((n, o, o))  # Cholesky factor of the prediction error's covariance
        self.covariance = np.empty((n, s, s))
        variance = noise_u**2
        state_noise = (lin.f_u * variance) @ lin.f_u.transpose(0, 2, 1)
        state_noise[:, np.arange(s), np.arange(s)] += loose**2
        output_noise = (lin.h_u * variance) @ lin.h_u.transpose(0, 2, 1)
        output_noise[:, np.arange(o), np.arange(o)] += noise_y**2
        both_noise = (lin.f_u * variance) @ lin.h_u.transpose(0, 2, 1)
        is_start = np.zeros(n, dtype=bool)
        is_start[starts] = True
        # Side by side in stretches, each from the covariance at the end of the one before in the last round; in the
        # first round a stretch has no prior knowledge, which is textbook multiple shooting.
        free = np.asarray(np.diag(away**2), dtype=float)
        length = min(n, stretch)
        P: Array = np.tile(free, (-(-n // length), 1, 1))
        if before is not None:
            P[1:] = before.ends[:-1]
        self.ends = P.copy()
        for k in range(length):
            at = np.arange(k, n, length)
            P = P[: len(at)]
            P[is_start[at]] = free
            A, C = lin.f_x[at], lin.h_x[at]
            PC = P @ C.transpose(0, 2, 1)
            error = C @ PC + output_noise[at]
            K = np.linalg.solve(error, (A @ PC + both_noise[at]).transpose(0, 2, 1)).transpose(0, 2, 1)
            self.covariance[at], self.gain[at], self.spread[at] = P, K, error
            P = A @ P @ A.transpose(0, 2, 1) + state_noise[at] - K @ error @ K.transpose(0, 2, 1)
            P[:] = 0.5 * (P + P.transpose(0, 2, 1))
            self.ends[: len(at)] = P
        self.spread = np.asarray(np.linalg.cholesky(self.spread), dtype=float)
        self.unspread = np.linalg.inv(self.spread)
        self.inner = lin.f_x - self.gain @ lin.h_x
        self.inner[starts[1:] - 1] = 0.0
        self.into = np.ones((n, 1, 1))  # a start forgets the forcing of the sample before it
        self.into[starts[1:] - 1] = 0.0
        # Rows of the recursion x[k+1] - inner[k] x[k] = forcing[k] as a banded lower triangle
        self.band = np.zeros((2 * s, n * s))
        self.band[0] = 1.0
        for row in range(s):
            for column in range(s):
                place = np.arange(n - 1) * s + column
                self.band[s + row - column, place] = -self.inner[:-1, row, column]
        # in units of the channels: the errors are white, and as large as the middle one
        self.unit = np.median(np.abs(self.spread[:, np.arange(o), np.arange(o)]), axis=0)

    def _march(self, forcing: Array, backward: bool = False) -> Array:
        """x (n, s, k) with x[0] = forcing[0] and x[k] = inner[k-1] x[k-1] + forcing[k]; or its transpose."""
        k = forcing.shape[2]
        flat = forcing.reshape(self.n * self.s, k)
        out, info = lapack.dtbtrs(self.band, flat, uplo="L", trans="T" if backward else "N", diag="U")
        if info:
            raise AssertionError(f"dtbtrs: {info}")
        return np.asarray(out, dtype=float).reshape(self.n, self.s, k)

    def errors(self, state: Array, output: Array) -> Array:
        """(n, o, k) prediction errors of forcings, not whitened."""
        driven = self.into * (state - self.gain @ output)
        x = self._march(np.concatenate((np.zeros_like(driven[:1]), driven[:-1])))
        return self.h_x @ x + output

    def white(self, errors: Array) -> Array:
        """(n, o, k) of one deviation each, in the channels' units."""
        return (self.unspread @ errors) * self.unit[None, :, None]

    def smoothed(self, state: Array, output: Array, f_u: Array, h_u: Array, noise_u: Array) -> tuple[Array, Array]:
        """(n, s) and (n, i): the most probable deviations of states and noisy inputs, given all samples.

        state, output: (n, s), (n, o), forcings of the response (Bryson and Frazier's form of the smoother).
        """
        driven = self.into * (state[:, :, None] - self.gain @ output[:, :, None])
        x = self._march(np.concatenate((np.zeros_like(driven[:1]), driven[:-1])))
        error = self.h_x @ x + output[:, :, None]
        weighed = self.unspread.transpose(0, 2, 1) @ (self.unspread @ error)
        adjoint = self._march(self.h_x.transpose(0, 2, 1) @ weighed, backward=True)
        after = self.into * np.concatenate((adjoint[1:], np.zeros_like(adjoint[:1])))
        states = -x + self.covariance @ adjoint
        weighed_less = weighed - self.gain.transpose(0, 2, 1) @ after
        inputs = h_u.transpose(0, 2, 1) @ weighed_less + f_u.transpose(0, 2, 1) @ after
        return states[:, :, 0], noise_u**2 * inputs[:, :, 0]


@dataclasses.dataclass
class SimulatedRecording(Recording):
    """A recording with its linearised simulator. fitted: parameters about which it was linearised."""

    fitted: dict[str, float] = dataclasses.field(default_factory=dict)
    linear: Jacobians | None = None
    predictor: Predictor | None = None
    ports: tuple[Port, ...] = ()
    outputs: tuple[str, ...] = ()
    fit: "_Fit | None" = None  # the fit that made it, which continues with an effect in the simulator
    held_ports: frozenset[str] = frozenset()
    free: dict[tuple[int, int], Columns] = dataclasses.field(default_factory=dict)  # by term and number of its shape

    def entering(self, entries: Ports) -> Array:
        """(n, ports, k): the input at the ports, (n,) or (n, k) by name, weighted by each port's `where`."""
        columns = {name: each[:, None] if each.ndim == 1 else each for name, each in entries.items()}
        out = np.zeros((len(self.table), len(self.ports), next(iter(columns.values())).shape[1]))
        for number, port in enumerate(self.ports):
            if port.name in columns:
                out[:, number] = columns[port.name]
                if port.where:
                    out[:, number] *= self.signals[port.where][:, None]
        return out

    def respond(self, entries: Ports) -> Columns:
        """First-order response of the equations to an input at the ports: (n, k) each."""
        lin, predictor = self.linear, self.predictor
        assert lin is not None and predictor is not None
        unknown = [name for name in entries if name not in {port.name for port in self.ports}]
        if unknown:
            raise UserError(f"a term puts something into {', '.join(unknown)}; ports are {_names(self.ports)}")
        entering = self.entering(entries)
        held = np.array([port.name in self.held_ports for port in self.ports])
        state, output = forced(lin.f_q, _between(entering, held)), forced(lin.h_q, entering)
        white = predictor.white(predictor.errors(state, output))
        return self._reached(white)

    def _reached(self, white: Array) -> Columns:
        """(n, k) of each equation that has the effect."""
        assert self.predictor is not None
        power = (white**2).sum(axis=(0, 2)) / self.predictor.unit**2
        return {
            name: white[:, number] for number, name in enumerate(self.outputs) if power[number] > SILENT * power.sum()
        }

    def of_free(self, terms: Sequence[Term], term: Term, shape: Shape) -> Columns:
        """The response to a free term at a shape; on its grid, that of all free `terms` is computed together."""
        place = next((number for number, each in enumerate(term.shapes) if each is shape), None)
        if place is None:
            return self.respond(term.make(self, shape, {}))
        if (id(term), place) not in self.free:
            made = [(each, number, each.make(self, one, {}))
                    for each in terms for number, one in enumerate(each.shapes)]  # fmt: skip
            for some in (made[begin : begin + TOGETHER] for begin in range(0, len(made), TOGETHER)):
                self._fill(some)
        return self.free[id(term), place]

    def _fill(self, made: Sequence[tuple[Term, int, Ports]]) -> None:
        lin, predictor = self.linear, self.predictor
        assert lin is not None and predictor is not None
        entering = [self.entering(ports) for _, _, ports in made]
        held = np.array([port.name in self.held_ports for port in self.ports])
        together = np.concatenate(entering, axis=2)
        white = predictor.white(predictor.errors(forced(lin.f_q, _between(together, held)), forced(lin.h_q, together)))
        first = 0
        for (term, place, _), each in zip(made, entering, strict=True):
            self.free[id(term), place] = self._reached(white[:, :, first : first + each.shape[2]])
            first += each.shape[2]


def _between(column: Array, held: np.ndarray) -> Array:
    """(n, ports, k): means of each sample and the next, for the step between them; a held port's are the samples."""
    after = np.concatenate((column[1:], column[-1:]))
    return np.where(held[None, :, None], column, 0.5 * (column + after))


def forced(sensitivity: Array, entering: Array) -> Array:
    """(n, r, k): the input at the ports, (n, q, k), times sensitivities (n, r, q) to it."""
    out = np.zeros((len(entering), sensitivity.shape[1], entering.shape[2]))
    for number in range(entering.shape[1]):
        if np.any(entering[:, number]):
            out += sensitivity[:, :, number, None] * entering[:, None, number]
    return out


def _direction(columns: Columns, recording: SimulatedRecording) -> Array:
    """An effect's response with one coefficient as a vector of length 1, each output in its noise."""
    assert recording.predictor is not None
    nothing = np.zeros((len(recording.table), 1))
    stacked = np.concatenate(
        [columns.get(name, nothing)[:, 0] / unit
         for name, unit in zip(recording.outputs, recording.predictor.unit, strict=True)]
    )  # fmt: skip
    return np.asarray(stacked / max(float(np.linalg.norm(stacked)), 1e-300))


def _names(ports: Sequence[Port]) -> str:
    return ", ".join(port.name for port in ports)


def roughness(table: Table, column: Array) -> float:
    """Deviation of a channel's own noise: its departure from a parabola over a tenth of a second, without jumps."""
    size = max(7, 2 * round(0.5 * ROUGH_S / table.step_s) + 1)
    parts = [savgol_filter(column[run], size, 2) - column[run] for run in table.runs if run.stop - run.start > size]
    if not parts:
        return 0.0
    rest = np.concatenate(parts)
    # the parabola uses three of these degrees of freedom
    return float(np.median(np.abs(rest))) / 0.6745 * float(np.sqrt(size / (size - 3.0)))


def _stays(table: Table, column: Array) -> bool:
    """True for an input that stays at a value for several samples and then jumps: its source holds it."""
    return all(
        np.count_nonzero(np.diff(column[run])) < JUMPS * (run.stop - run.start)
        for run in table.runs
        if run.stop - run.start > 1
    )


def _is_smooth(table: Table, column: Array) -> bool:
    """True where a cubic through every second sample meets the samples between better than straight lines do."""
    straight = cubic = 0.0
    for run in table.runs:
        c = column[run]
        if len(c) < 8:
            continue
        middle, near, far = c[3:-3], 0.5 * (c[2:-4] + c[4:-2]), 0.5 * (c[:-6] + c[6:])
        straight += float(np.sum((middle - near) ** 2))
        cubic += float(np.sum((middle - (9.0 * near - far) / 8.0) ** 2))
    return cubic < SMOOTHER * straight


def averaged(table: Table, count: int) -> Table:
    """The table with every `count` samples of a run averaged into one."""
    if count == 1:
        return table
    runs, start = [], 0
    stamps: list[Array] = []
    columns: dict[str, list[Array]] = {name: [] for name in table.columns}
    for run in table.runs:
        size = (run.stop - run.start) // count
        if not size:
            continue
        inside = slice(run.start, run.start + size * count)
        stamps.append(table.time_s[inside].reshape(size, count).mean(axis=1))
        for name, column in table.columns.items():
            columns[name].append(column[inside].reshape(size, count).mean(axis=1))
        runs.append(slice(start, start + size))
        start += size
    return Table(
        np.concatenate(stamps),
        {name: np.concatenate(parts) for name, parts in columns.items()},
        tuple(runs),
        table.name,
        table.resolution,
    )


class SimulatedMachine(abc.ABC):
    """A `Machine` (sysid/machine.py) that is an ordinary differential equation with measured inputs.

    A subclass defines the names below and the methods `inputs`, `first_guess`, `step`, `observe`, `terms`; and `loose`,
    `extra_signals` and `looked_over` when it needs them. All of these take and return arrays of any one shape: samples,
    and stacks of samples for the differences; they must work element by element.
    """

    name: str
    quantities: tuple[Quantity, ...]
    parameters: tuple[Known, ...]
    states: tuple[str, ...]
    outputs: tuple[Output, ...]
    ports: tuple[Port, ...] = ()
    joints: tuple[Joint, ...] = ()  # where friction is sought, without a port or a term
    free_candidates: bool = True  # what every machine can have (sysid/free_candidates.py), next to its own terms
    # Inputs with noise, by name: its standard deviation, or None for the channel's own estimate
    noisy_inputs: Mapping[str, float | None] = {}
    # From one sample to the next inputs and ports are straight lines, but for those that a converter holds, and for
    # inputs that stay at a value and jump, in these data
    held_inputs: Collection[str] = ()
    parts: int = 2  # steps from one sample to the next, each with the inputs of its own middle
    horizon_s: float = float("inf")  # after this time the state is free again: shorter for a model with large errors
    shortest_s: float = 2.0  # least duration of a usable recording
    window_s: float = 2.0  # over which the gain is measured in free simulation, or 50 samples

    @abc.abstractmethod
    def inputs(self, table: Table) -> dict[str, Array]:
        """Inputs of the simulator, (n,) by name: measured channels, or a target that its law follows."""

    @abc.abstractmethod
    def first_guess(self, table: Table) -> dict[str, Array]:
        """Rough states, (n,) by name: a measured angle and its smoothed slope are enough."""

    @abc.abstractmethod
    def step(self, x: Quantities, u: Quantities, p: Quantities, step_s: float) -> Quantities:
        """The states after a step, a sample or a part of it. u: inputs and ports in the step's middle."""

    @abc.abstractmethod
    def observe(self, x: Quantities, u: Quantities, p: Quantities) -> Quantities:
        """The outputs, by channel."""

    def terms(self, recordings: Sequence[SimulatedRecording]) -> list[Term]:
        """Candidate causes of this machine alone, with grids that suit these recordings."""
        return []

    def loose(self, x: Quantities, u: Quantities, p: Quantities, step_s: float) -> Quantities:
        """Deviations of states per step that the law leaves open, by name: where dry friction holds, for example."""
        return {}

    def extra_signals(self, along: dict[str, Array], table: Table) -> dict[str, Array]:
        """More signals along the trajectory for `terms`."""
        return {}

    def counts(self, along: Quantities, table: Table) -> dict[str, np.ndarray]:
        """By output, (n,): False for samples that carry no information on it; an output not listed always counts."""
        return {}

    def looked_over(self, recording: SimulatedRecording) -> dict[str, dict[str, Array]]:
        """For ports and equations, the signals over which a misfit is sought without a cause in mind."""
        everything = {name: recording.signals[name] for name in (*self.states, "t")}
        places = [each.name for each in self.ports] or [on(each.rate) for each in self.joints]
        return {each: everything for each in places or [each.channel for each in self.outputs]}

    # --- called by the diagnosis ---------------------------------------------------------------------------------

    def prepare(self, table: Table) -> SimulatedRecording:
        """Fit the simulator to one recording and linearise it there."""
        missing = [each.name for each in self.quantities if each.needed and each.name not in table]
        if missing:
            there = ", ".join(table.columns)
            raise UserError(f"{table.name}: {self.name} needs {', '.join(missing)}; there are {there}")
        table = signals.uniform(table)
        longest_s = max((run.stop - run.start) * table.step_s for run in table.runs)
        if longest_s < self.shortest_s:
            raise UserError(
                f"{table.name}: the longest stretch without a gap is {longest_s:.3g} s, "
                f"{self.name} needs {self.shortest_s:g} s"
            )
        return _Fit(self, table, -(-len(table) // MOST_ROWS)).recording(follow=True)

    def effects(self, recordings: Sequence[Recording]) -> list[Effect]:
        """The terms as effects on the outputs."""
        simulated = cast(Sequence[SimulatedRecording], recordings)
        own = self.terms(simulated)
        free = self._free(own, simulated)

        def columns(recording: Recording, shape: Shape, values: Values, term: Term) -> Columns:
            here = cast(SimulatedRecording, recording)
            return here.of_free(free, term, shape) if term.independent else here.respond(term.make(here, shape, values))

        return [
            SimulatedEffect(
                term.cause,
                term.at,
                term.subsystem,
                term.coefficients,
                term.shapes,
                functools.partial(columns, term=term),
                term.admissible,
                term.meaning,
                phase_is_free=term.phase_is_free,
                form=term.form,
                scale=term.scale,
                term=term,
            )
            for term in (*own, *free)
        ]

    def _free(self, own: Sequence[Term], recordings: Sequence[SimulatedRecording]) -> list[Term]:
        """The free candidates that are not the same as a term of the machine's own."""
        if not self.free_candidates:
            return []
        fit = recordings[0].fit
        assert fit is not None
        named = {(each.cause, each.at) for each in own}
        made = [each for each in candidates(self, list(fit.inputs), recordings) if (each.cause, each.at) not in named]
        first, values = recordings[0], recordings[0].fitted
        known = [_direction(first.respond(each.make(first, shape, values)), first)
                 for each in own for shape in each.shapes if len(each.coefficients) == 1]  # fmt: skip
        return [
            each
            for each in made
            if len(each.coefficients) > 1
            or all(
                abs(float(_direction(first.of_free(made, each, shape), first) @ other)) < SAME
                for shape in each.shapes
                for other in known
            )
        ]

    def again(
        self, recording: Recording, effects: Sequence[tuple[Effect, Shape, Sequence[float]]], fixed: bool = False
    ) -> Recording:
        """The recording fitted and linearised with these effects in the simulator; fixed: their coefficients stay."""
        acting = [
            Acting(effect.term, shape, tuple(coefficients))
            for effect, shape, coefficients in effects
            if isinstance(effect, SimulatedEffect) and effect.term is not None
        ]
        fit = cast(SimulatedRecording, recording).fit
        assert fit is not None
        return fit.acted_on(acting, fixed).recording(AGAIN)

    def about_all(self, recording: Recording, effects: Sequence[tuple[Effect, Shape]]) -> Recording:
        """The recording linearised where the simulator fits with all of these effects in it, and not only without."""
        fit = cast(SimulatedRecording, recording).fit
        assert fit is not None
        acting = [
            Acting(effect.term, shape, (0.0,) * len(effect.coefficients))
            for effect, shape in effects
            if isinstance(effect, SimulatedEffect) and effect.term is not None
        ]
        if not acting:
            return recording
        tried = fit.with_all(acting)
        made = tried.recording(follow=True)
        return made if tried.surprise < fit.surprise else recording

    def numerical(self, recording: Recording) -> Array:
        """(variants, coefficients): what the coefficients of what acts move by with other numerics."""
        fit = cast(SimulatedRecording, recording).fit
        assert fit is not None
        count = len(fit.names)
        moved = []
        for other in fit.otherwise():
            other.recording(NUMERICAL)
            moved.append(other.p_at[count:] - fit.p_at[count:])
        return np.array(moved)

    def surprise(self, recording: Recording) -> float:
        """-2 log likelihood of a recording with what acts in its simulator, up to a constant."""
        fit = cast(SimulatedRecording, recording).fit
        assert fit is not None
        return fit.surprise

    def free(self, recording: Recording) -> Recording:
        """The recording with errors of free simulation as its equations: the outputs' errors over `window_s`, with the
        simulator started at the most probable state of each window. Inputs count as exact."""
        fit = cast(SimulatedRecording, recording).fit
        assert fit is not None
        return fit.free()

    def generic(self, recording: Recording) -> dict[str, dict[str, Array]]:
        """The signals of `looked_over`."""
        return self.looked_over(cast(SimulatedRecording, recording))


def _own_ports(machine: SimulatedMachine, inputs: Sequence[str]) -> list[Port]:
    """The ports that the engine adds to a machine."""
    made = [Port(shown(each.channel), each.unit, "sensor") for each in machine.outputs]
    made += [Port(into(name), "", "input") for name in inputs]
    return made + [Port(on(each.rate), "", "mechanical") for each in machine.joints]


@dataclasses.dataclass(frozen=True)
class Numerics:
    """How a fit steps: parts of a sample; inputs that are held, and on cubics; share of what is open at standstill."""

    parts: int
    held: frozenset[str]
    curved: frozenset[str]
    open_share: float = 1.0

    @property
    def held_ports(self) -> frozenset[str]:
        """Ports of the inputs that are held."""
        return frozenset(into(name) for name in self.held)


class _Fit:
    """Trajectory and parameters of one recording, by Gauss and Newton."""

    def __init__(self, machine: SimulatedMachine, table: Table, count: int = 1) -> None:
        """count: samples averaged into one, also for the machine's own signals."""
        given, guess = machine.inputs(table), machine.first_guess(table)
        if count > 1:
            whole = dataclasses.replace(table, columns=table.columns | given | {f"first {n}": guess[n] for n in guess})
            table = averaged(whole, count)
            given = {name: table[name] for name in given}
            guess = {name: table[f"first {name}"] for name in guess}
        self.machine, self.table, self.step_s = machine, table, table.step_s
        self.inputs = given
        held = {*machine.held_inputs, *(name for name in given if _stays(table, given[name]))}
        curved = {name for name in given if name not in held and _is_smooth(table, given[name])}
        self.numerics = Numerics(machine.parts, frozenset(held), frozenset(curved))
        self.inside = np.zeros(len(table))  # 1 where a step has neighbours on both sides in its run
        for run in table.runs:
            self.inside[run.start + 1 : run.stop - 2] = 1.0
        self.names = [known.name for known in machine.parameters]
        self.x = np.column_stack([guess[name] for name in machine.states])
        self.p = np.array([known.value for known in machine.parameters])
        self.low = np.array([known.low for known in machine.parameters])
        self.high = np.array([known.high for known in machine.parameters])
        self.y = np.column_stack([table[each.channel] for each in machine.outputs])
        for number, each in enumerate(machine.outputs):
            if np.ptp(self.y[:, number]) == 0.0:
                raise UserError(
                    f"{table.name}: {each.channel} never changes; {machine.name} can be judged in motion only"
                )
        self.noisy = list(machine.noisy_inputs)
        self.noise_u = np.array(
            [
                roughness(table, self.inputs[name]) if given is None else given
                for name, given in machine.noisy_inputs.items()
            ]
        )
        steps = np.array([table.resolution.get(each.channel, 0.0) for each in machine.outputs])
        rough = np.array([roughness(table, column) for column in self.y.T])
        self.noise_y = np.maximum(np.hypot(rough, steps / np.sqrt(12.0)), 1e-9 * np.ptp(self.y, axis=0))
        self.shown_y = self.noise_y
        self.u = (
            np.column_stack([self.inputs[name] for name in self.noisy]) if self.noisy else np.zeros((len(table), 0))
        )
        self.measured_u = self.u.copy()
        self.size_x, self.size_u = (np.maximum(np.sqrt(np.mean(each**2, axis=0)), 1e-9) for each in (self.x, self.u))
        self.size_p = np.where(self.p != 0.0, np.abs(self.p), 0.01 * np.minimum(self.high - self.low, 1e6))
        self.predictor: Predictor | None = None
        self.came_from = self.began = (self.x, self.u, self.p)
        reach = len(table) if not np.isfinite(machine.horizon_s) else max(2, round(machine.horizon_s / self.step_s))
        self.starts = np.array([k for run in table.runs for k in range(run.start, run.stop, reach)])
        self.ends = np.zeros(len(table), dtype=bool)  # no step leads from here to the next sample
        self.ends[[run.stop - 1 for run in table.runs]] = True
        self.acting: list[Acting] = []
        self.slack: Array = np.zeros(len(machine.states))  # deviation of each state's step from the law
        self.moves = np.ones(len(self.p))  # 0 for a parameter that stays
        self.damped = np.zeros(len(self.p))  # of a column's length: pull of a parameter towards 0
        self.ports = (*machine.ports, *_own_ports(machine, list(given)))
        self.at_ports = np.zeros((len(table), len(self.ports), 0))  # input for a unit of each coefficient

    @property
    def surprise(self) -> float:
        """-2 log likelihood of the recording under the last round's simulator and noise, up to a constant."""
        assert self.predictor is not None
        errors = self.response / self.predictor.unit
        spread = self.predictor.spread[:, np.arange(errors.shape[1]), np.arange(errors.shape[1])]
        return float(np.sum(errors**2) + 2.0 * np.sum(np.log(spread)))

    def acted_on(self, acting: Sequence[Acting], fixed: bool) -> "_Fit":
        """A fit that continues from here with effects in the simulator; their coefficients follow the parameters."""
        new, count = copy.copy(self), len(self.names)
        new.acting = list(acting)
        added = np.array([each for one in acting for each in one.coefficients])
        new.p = np.concatenate((self.p_at[:count], added))
        new.low, new.high = (
            np.concatenate((limit[:count], np.full(len(added), beyond)))
            for limit, beyond in ((self.low, -np.inf), (self.high, np.inf))
        )
        new.size_p = np.concatenate((self.size_p[:count], np.where(added != 0.0, np.abs(added), 1.0)))
        new.moves = np.concatenate((np.ones(count), np.full(len(added), 0.0 if fixed else 1.0)))
        new.damped = np.zeros(len(new.p))
        new.came_from = (new.x, new.u, new.p)
        new.at_ports = np.zeros((*self.at_ports.shape[:2], len(added)))  # filled by the first round, if any effect acts
        return new

    def with_all(self, acting: Sequence[Acting]) -> "_Fit":
        """A fit from the start, with candidates in the simulator that are pulled towards 0; their coefficients are 0.

        What a model without its fault ends at may be far from the machine, and not only in the faulty place; first
        order about it says little. Candidates that these data cannot distinguish stay small.
        """
        count = len(self.names)
        new = self.acted_on(acting, fixed=False)
        new.x, new.u, start = self.began
        new.p = np.concatenate((start[:count], np.zeros(len(new.p) - count)))
        new.damped = np.concatenate((np.zeros(count), np.full(len(new.p) - count, DAMPED)))
        new.came_from, new.predictor = (new.x, new.u, new.p), None
        new.noise_y = self.shown_y
        return new

    def otherwise(self) -> "list[_Fit]":
        """Fits that continue from here with other numerics: half the step; inputs on straight lines instead of cubics,
        or on straight lines instead of held; a quarter of what is open at standstill."""
        finer, straight, narrow = (copy.copy(self) for _ in range(3))
        now = self.numerics
        finer.numerics = dataclasses.replace(now, parts=2 * now.parts)
        straight.numerics = dataclasses.replace(now, curved=frozenset(), held=frozenset(self.machine.held_inputs))
        narrow.numerics = dataclasses.replace(now, open_share=NARROW)
        made = [finer]
        if straight.numerics != now:
            made.append(straight)
        if np.any(self._loose() > 1e-6 * self.size_x):
            made.append(narrow)
        return made

    def is_held(self) -> np.ndarray:
        """(ports,) flags: the port of an input that is held."""
        return np.array([port.name in self.numerics.held_ports for port in self.ports], dtype=bool)

    def _acting_now(self) -> Array:
        """(n, ports, coefficients): the effects' input at the ports along the present trajectory."""
        if not self.acting:
            return self.at_ports
        seen, values = self._seen(), dict(zip(self.names, self.p, strict=False))
        return np.concatenate([seen.entering(each.term.make(seen, each.shape, values)) for each in self.acting], axis=2)

    def _fed_back(self) -> Array:
        """(n, ports, states): what acts depends on the states, as gravity does on an angle; by differences.

        Only where it depends on the states of its own sample: what remembers is not fed back.
        """
        seen, values = self._seen(), dict(zip(self.names, self.p, strict=False))
        out = np.zeros((len(self.x), len(self.ports), len(self.machine.states)))
        every_second = np.arange(len(self.x)) % 2 == 0
        first = len(self.names)
        for each in self.acting:
            coefficients = self.p[first : first + len(each.coefficients)]
            first += len(coefficients)

            def entering(name: str, by: Array, each: Acting = each, coefficients: Array = coefficients) -> Array:
                moved = dataclasses.replace(seen, signals=seen.signals | {name: seen.signals[name] + by})
                return np.asarray(moved.entering(each.term.make(moved, each.shape, values)) @ coefficients)

            for number, name in enumerate(self.machine.states):
                nudge = NUDGE * self.size_x[number]
                up, down = entering(name, nudge * every_second), entering(name, -nudge * every_second)
                if np.array_equal(up[~every_second], down[~every_second]) and not np.array_equal(up, down):
                    up, down = entering(name, np.full(len(self.x), nudge)), entering(name, np.full(len(self.x), -nudge))
                    out[:, :, number] += (up - down) / (2.0 * nudge)
        return out

    def _seen(self) -> SimulatedRecording:
        """Signals along the trajectory, without equations."""
        machine, table = self.machine, self.table
        along = {name: self.x[:, i] for i, name in enumerate(machine.states)}
        along |= self.inputs | {name: self.u[:, i] for i, name in enumerate(self.noisy)}
        along |= {each.channel: self.lin.output[:, i] for i, each in enumerate(machine.outputs)}
        acting = self.at_ports @ self.p[len(self.names) :] if self.acting else np.zeros(self.at_ports.shape[:2])
        for number, each in enumerate(machine.outputs, len(machine.ports)):
            along[sensed(each.channel)] = along[each.channel] - acting[:, number]
        along["t"] = table.time_s - table.time_s[0]
        along |= machine.extra_signals(along, table)
        return SimulatedRecording(table, along, {}, ports=self.ports)

    def _at(self, x: Array, u: Array, p: Array, ports: Array) -> tuple[Array, Array]:
        """(f, h) as (m, n, s) and (m, n, o). x: (m, n, s), u: (m, n, i), p: (m, n or 1, p), ports: (m, n or 1, q)."""
        machine = self.machine
        shape = np.broadcast_shapes(x.shape[:2], u.shape[:2], p.shape[:2], ports.shape[:2])
        states = {name: x[..., i] for i, name in enumerate(machine.states)}
        values = {name: p[..., i] for i, name in enumerate(self.names)}
        given = {name: column[None] for name, column in self.inputs.items()}
        given |= {name: u[..., i] for i, name in enumerate(self.noisy)}
        at_ports = {each.name: ports[..., i] for i, each in enumerate(self.ports)}
        given = {name: column + at_ports[into(name)] for name, column in given.items()}
        given |= at_ports
        between = {name: self._between_samples(name, c) for name, c in given.items()}
        after: Quantities = states
        for part in range(self.numerics.parts):
            share = (part + 0.5) / self.numerics.parts
            middle = {name: at(share) for name, at in between.items()}
            after = dict(machine.step(after, middle, values, self.step_s / self.numerics.parts))
            for joint in machine.joints:
                inertia = values[joint.inertia] if isinstance(joint.inertia, str) else joint.inertia or 1.0
                after[joint.rate] = (
                    after[joint.rate] + middle[on(joint.rate)] * self.step_s / self.numerics.parts / inertia
                )
        seen = dict(machine.observe(states, given, values))
        for each in machine.outputs:
            seen[each.channel] = seen[each.channel] + at_ports[shown(each.channel)]
        f = np.stack([np.broadcast_to(after[name], shape) for name in machine.states], axis=-1)
        h = np.stack([np.broadcast_to(seen[each.channel], shape) for each in machine.outputs], axis=-1)
        return f, h

    def _between_samples(self, name: str, c: Array) -> Callable[[float], Array]:
        """An input or port between its samples (m, n), at a share of the way to the next: held, on a cubic through its
        neighbours where the samples lie on one, or on a straight line."""
        if name in self.numerics.held or name in self.numerics.held_ports:
            return lambda share: c
        after = np.concatenate((c[:, 1:], c[:, -1:]), axis=1)
        if name not in self.numerics.curved:
            return lambda share: c + share * (after - c)
        before, second = (
            np.concatenate(each, axis=1) for each in ((c[:, :1], c[:, :-1]), (after[:, 1:], after[:, -1:]))
        )
        inside = self.inside if c.shape[1] > 1 else np.zeros(1)
        bend = after - 2.0 * c + before, second - 2.0 * after + c

        def at(share: float) -> Array:
            rest = 1.0 - share
            curve = (rest * (rest * rest - 1.0) * bend[0] + share * (share * share - 1.0) * bend[1]) / 6.0
            return np.asarray(c + share * (after - c) + inside * curve)

        return at

    def linearise(self) -> Jacobians:
        """By central differences, all samples at once; with the effects that act."""
        x, u, p = self.x[None], self.u[None], self.p[None, None]
        count = len(self.names)
        self.at_ports = self._acting_now()
        ports = (self.at_ports @ self.p[count:])[None] if self.acting else np.zeros((1, 1, len(self.ports)))
        f, h = self._at(x, u, p, ports)

        def derivative(which: int, sizes: Array, some: Sequence[int] | None = None) -> tuple[Array, Array]:
            columns = []
            for number, size in enumerate(sizes):
                if some is not None and number not in some:
                    continue
                arguments = [x, u, p, ports]
                up, down = arguments[which].copy(), arguments[which].copy()
                up[..., number] += NUDGE * size
                down[..., number] -= NUDGE * size
                high = self._at(*(up if i == which else each for i, each in enumerate(arguments)))
                low = self._at(*(down if i == which else each for i, each in enumerate(arguments)))
                columns.append([(a[0] - b[0]) / (2.0 * NUDGE * size) for a, b in zip(high, low, strict=True)])
            if not columns:
                return np.zeros((*f.shape[1:], 0)), np.zeros((*h.shape[1:], 0))
            return np.stack([a for a, _ in columns], axis=-1), np.stack([b for _, b in columns], axis=-1)

        f_x, h_x = derivative(0, self.size_x)
        f_u, h_u = derivative(1, self.size_u)
        f_p, h_p = derivative(2, self.size_p[:count])
        f_q, h_q = self._at_ports(derivative, f_u, h_u)
        if self.acting:
            fed_back = self._fed_back()
            after = np.concatenate((fed_back[1:], fed_back[-1:]))  # a step has the mean of its two ends
            f_x, h_x = f_x + 0.5 * f_q @ (fed_back + after @ f_x), h_x + h_q @ fed_back
            f_p = np.concatenate((f_p, forced(f_q, _between(self.at_ports, self.is_held()))), axis=2)
            h_p = np.concatenate((h_p, forced(h_q, self.at_ports)), axis=2)
        if not all(np.all(np.isfinite(each)) for each in (f, h, f_x, h_x, f_p, h_p)):
            raise UserError(
                f"{self.table.name}: the simulator of {self.machine.name} gives no numbers on this recording"
            )
        return Jacobians(f[0], h[0], f_x, f_u, f_p, f_q, h_x, h_u, h_p, h_q)

    def _at_ports(self, derivative: Callable[..., tuple[Array, Array]], f_u: Array, h_u: Array) -> tuple[Array, Array]:
        """(f_q, h_q). What the engine adds itself is known: an output's port moves it alone, a noisy input's as its
        noise does."""
        n, s = self.x.shape
        f_q, h_q = np.zeros((n, s, len(self.ports))), np.zeros((n, len(self.machine.outputs), len(self.ports)))
        names = [each.name for each in self.ports]
        for number, each in enumerate(self.machine.outputs):
            h_q[:, number, names.index(shown(each.channel))] = 1.0
        known = {shown(each.channel) for each in self.machine.outputs} | {into(name) for name in self.noisy}
        for number, name in enumerate(self.noisy):
            f_q[:, :, names.index(into(name))], h_q[:, :, names.index(into(name))] = (
                f_u[:, :, number],
                h_u[:, :, number],
            )
        rest = [number for number, name in enumerate(names) if name not in known]
        f_q[:, :, rest], h_q[:, :, rest] = derivative(3, np.ones(len(names)), rest)
        return f_q, h_q

    def _loose(self) -> Array:
        machine = self.machine
        states = {name: self.x[:, i] for i, name in enumerate(machine.states)}
        values = {name: np.full(len(self.x), self.p[i]) for i, name in enumerate(self.names)}
        given = self.inputs | {name: self.u[:, i] for i, name in enumerate(self.noisy)}
        entering = self.at_ports @ self.p[len(self.names) :]
        given |= {each.name: entering[:, i] for i, each in enumerate(self.ports)}
        found = machine.loose(states, given, values, self.step_s)
        nothing = np.zeros(len(self.x))
        # a trace of noise keeps the predictor from being certain of what it has not seen
        return (
            np.column_stack([self.numerics.open_share * found.get(name, nothing) for name in machine.states])
            + 1e-9 * self.size_x
            + self.slack
        )

    def round(self) -> float:
        """One round; returns the largest step of a parameter in its standard errors."""
        self.lin = lin = self.linearise()
        self.predictor = Predictor(
            lin, self.noise_u, self.noise_y, self._loose(), self.starts, AWAY * self.size_x, self.predictor
        )
        wide = self.predictor
        assert wide is not None
        offset = self.measured_u - self.u  # the part that the inputs' noise has to explain already
        gap = lin.next_state - np.concatenate((self.x[1:], self.x[-1:]))
        gap[self.ends] = 0.0
        self.state = -(gap + (lin.f_u @ offset[:, :, None])[:, :, 0])
        self.output = self.y - lin.output - (lin.h_u @ offset[:, :, None])[:, :, 0]
        errors = wide.errors(self.state[:, :, None], self.output[:, :, None])
        moved = wide.errors(lin.f_p, lin.h_p)
        self.response, self.columns = wide.white(errors)[:, :, 0], wide.white(moved)
        n = self.response.size
        self.cost = float(np.mean((self.response / wide.unit) ** 2))
        a = (self.columns / wide.unit[None, :, None]).reshape(n, len(self.p)) * (self.size_p * self.moves)
        b = (self.response / wide.unit).reshape(n)
        change, error = self._step(a, b)
        # positive parameters are divisors, far from linear: no step more than halves or doubles one
        ratio = np.divide(self.p + change, self.p, out=np.ones_like(self.p), where=self.low > 0.0)
        change *= min(1.0, *(0.5 / (1.0 - r) if r < 0.5 else 1.0 / (r - 1.0) if r > 2.0 else 1.0 for r in ratio))
        # the rest of the response, after the parameters' step, gives trajectory and inputs
        state = self.state - (lin.f_p @ change)
        output = self.output - (lin.h_p @ change)
        dx, du = wide.smoothed(state, output, lin.f_u, lin.h_u, self.noise_u)
        self.x, self.u, self.p = self.x + dx, self.u + offset + du, self.p + change
        self.rest = wide.errors(state[:, :, None], output[:, :, None])[:, :, 0]
        return float(np.max(np.abs(change) / np.maximum(error, 1e-30)))

    def _step(self, a: Array, b: Array) -> tuple[Array, Array]:
        """(change of the parameters, their standard errors) by least squares within the limits.

        a: (n, p) columns for a change of `size_p`; b: (n,). A parameter that would leave its limits goes to the limit,
        and the others are fitted again: cut off alone, it would leave them where only its full step belongs to them.
        """
        length = np.maximum(np.linalg.norm(a, axis=0), 1e-30)
        scaled = np.vstack((a / length, np.diag(self.damped)))
        wanted = np.concatenate((b, -self.damped * self.p * length / self.size_p))
        change, error = np.zeros(len(self.p)), np.zeros(len(self.p))
        free = np.ones(len(self.p), dtype=bool)
        while np.any(free):
            columns = scaled[:, free]
            u, sv, vt = np.linalg.svd(columns, full_matrices=False)
            strong = sv > 1e-6 * sv[0]
            found = vt[strong].T @ ((u.T @ wanted)[strong] / sv[strong])
            scale = self.size_p[free] / length[free]
            change[free] = found * scale
            error[free] = np.sqrt(((vt[strong] / sv[strong, None]) ** 2).sum(axis=0)) * scale
            beyond = free & ((self.p + change < self.low) | (self.p + change > self.high))
            if not np.any(beyond):
                break
            change[beyond] = np.clip(self.p + change, self.low, self.high)[beyond] - self.p[beyond]
            wanted = wanted - scaled[:, beyond] @ (change * length / self.size_p)[beyond]
            free &= ~beyond
        return change, error

    def _renew_noise(self) -> None:
        """Estimate the sensors' noise from the residual; the median ignores a short error.

        Noise that the channels do not show themselves is the model's error: taken for noise, it would let a very wrong
        model pull the trajectory away from the measurement, and the fit would not return.
        """
        left = np.median(np.abs(self.rest), axis=0) / 0.6745
        self.noise_y = np.clip(left, 1e-9 * np.ptp(self.y, axis=0), LOUDER * self.shown_y)

    def recording(self, rounds: int = ROUNDS, follow: bool = False) -> SimulatedRecording:
        """Fitted and linearised. follow: the measurement, where the fit ends far off."""
        if (not self._settle(rounds) or self.cost > FAR_OFF) and follow:
            self._follow()
        self.round_again()
        assert self.predictor is not None
        return self._told(self.predictor, self.response, self.columns)

    def _settle(self, rounds: int) -> bool:
        """Rounds until nothing moves any more; False when it still does after them."""
        renewed, best, share = 0, np.inf, 1.0
        for _ in range(rounds):
            accepted = (self.x, self.u, self.p)
            try:
                with np.errstate(over="ignore", invalid="ignore"):  # far from a solution a machine may run away
                    step = self.round()
            except (UserError, np.linalg.LinAlgError):
                if self.x is self.came_from[0]:
                    raise
                self.cost, self.predictor = np.inf, None
            if not self.cost < WORSE * best:
                # too far: a part of the step from where it began, whose cost is another with the covariances of now
                (self.x, self.u, self.p), best, share = self.came_from, np.inf, 0.25 * share
                continue
            if share < 1.0:
                self.x, self.u, self.p = (
                    old + share * (new - old) for old, new in zip(accepted, (self.x, self.u, self.p), strict=True)
                )
                share = min(1.0, 2.0 * share)
            self.came_from = accepted
            best = min(best, self.cost)
            if step > STEADY:
                continue
            if renewed == RENEWED:
                return True
            self._renew_noise()
            renewed, best = renewed + 1, np.inf
        return False

    def _follow(self) -> None:
        """Fit again from the start, along the measurement: states may leave the law by a share of their steps.

        A simulator without a large fault's cause has no good trajectory, and where its fit ends means nothing. The
        share becomes smaller as long as it explains what is left.
        """
        self.x, self.u, start = self.began
        self.p = np.concatenate((start[: len(self.names)], np.zeros(len(self.p) - len(self.names))))
        self.noise_y, self.predictor = self.shown_y, None
        moved = np.diff(self.x, axis=0)
        moved[self.ends[:-1]] = 0.0
        usual = np.sqrt(np.mean(moved**2, axis=0))
        kept = (self.x, self.u, self.p)
        for share in FOLLOWED:
            self.slack = share * usual
            self.came_from = (self.x, self.u, self.p)
            self._settle(FOLLOWING)
            if not self.cost < MISSED and share < FOLLOWED[0]:
                break
            kept = (self.x, self.u, self.p)
        (self.x, self.u, self.p), self.slack, self.predictor = kept, np.zeros_like(usual), None

    def free(self) -> SimulatedRecording:
        """Errors of free simulation over windows, about the same trajectory: without noise, each window starts free.

        Where the law is open (`loose`) it stays so. Not whitened: a sum of squares is that of the outputs' errors.
        """
        window = max(SHORTEST_WINDOW, round(self.machine.window_s / self.step_s))
        starts = np.array([k for run in self.table.runs for k in range(run.start, run.stop, window)])
        predictor = Predictor(self.lin, np.zeros_like(self.noise_u), self.noise_y, self._loose(), starts,
                              AWAY * self.size_x, stretch=window)  # fmt: skip
        missed = predictor.white(predictor.errors(self.state[:, :, None], self.output[:, :, None]))[:, :, 0]
        columns = predictor.white(predictor.errors(self.lin.f_p, self.lin.h_p))
        told = self._told(predictor, missed, columns)
        told.whitened = False
        return told

    def _told(self, predictor: Predictor, missed: Array, columns: Array) -> SimulatedRecording:
        """The recording whose equations are a predictor's errors, (n, o), with columns (n, o, parameters)."""
        machine, table = self.machine, self.table
        along = self._seen().signals
        counts = machine.counts(along, table)
        equations = {}
        widths = self._standstill(predictor)
        for number, each in enumerate(machine.outputs):
            own = {name: columns[:, number, i] for i, name in enumerate(self.names)}
            own |= {name: column[:, number] for name, column in widths.items()}
            valid = counts.get(each.channel, np.ones(len(table), dtype=bool))
            response = missed[:, number] + columns[:, number] @ self.p_at
            equations[each.channel] = Equation(
                each.channel, each.letter, each.subsystem, each.unit, response, own, valid
            )
        made = SimulatedRecording(
            table,
            along,
            equations,
            lags=tuple(round(time_s / self.step_s) for time_s in LAGS_S),
            fitted=dict(zip(self.names, (float(each) for each in self.p_at), strict=False)),
            linear=self.lin,
            predictor=predictor,
            ports=self.ports,
            held_ports=self.numerics.held_ports,
            outputs=tuple(each.channel for each in machine.outputs),
            fit=self,
        )

        def entry(port: Port) -> Entry:
            return Entry(port.subsystem, lambda columns: made.respond({port.name: columns}))

        made.entries = {each.name: entry(each) for each in self.ports}
        return made

    def _standstill(self, predictor: Predictor) -> dict[str, Array]:
        """By name (n, outputs): the outputs' response to a wrong width of the smoothed sign about standstill.

        A smoothed sign lacks friction just before a machine comes to rest, where the law is open (`loose`): the base
        fits how much, and no cause is made of it.
        """
        open_by, found = self._loose(), {}
        for number, state in enumerate(self.machine.states):
            active = open_by[:, number] > SHARE_OPEN * np.max(open_by[:, number])
            if not 0 < np.count_nonzero(active) < len(active):
                continue
            forcing = np.zeros((len(self.x), len(self.machine.states), 1))
            forcing[:, number, 0] = -open_by[:, number] * np.sign(self.x[:, number])
            nothing = np.zeros((len(self.x), len(self.machine.outputs), 1))
            found[f"width of standstill@{state}"] = predictor.white(predictor.errors(forcing, nothing))[:, :, 0]
        return found

    def round_again(self) -> None:
        """Linearise where the last round ended, without moving."""
        self.p_at = self.p.copy()
        x, u = self.x, self.u
        self.round()
        self.x, self.u = x, u
