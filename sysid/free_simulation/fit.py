"""Trajectory and parameters of one recording, by Gauss and Newton over all samples at once."""

import copy
import dataclasses
import itertools
from collections.abc import Collection, Sequence

import numpy as np

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import signals
from ranger_sim.sysid.dataset import Array, Table
from ranger_sim.sysid.free_simulation import acting as effects
from ranger_sim.sysid.free_simulation.contract import check_columns, check_methods
from ranger_sim.sysid.free_simulation.declared import DeclaredMachine
from ranger_sim.sysid.free_simulation.predictor import STRETCH, Jacobians, Predictor
from ranger_sim.sysid.free_simulation.recording import SimulatedRecording
from ranger_sim.sysid.free_simulation.simulator import Simulator
from ranger_sim.sysid.free_simulation.terms import Acting, into, sensed
from ranger_sim.sysid.machine import Values

SHORT_STRETCH = 100  # samples, in rounds that only lead to the answer: covariances of four times as many side by side
NEAR = 100.0  # standard errors: a round after a smaller step is near the end. Chosen by us
ROUNDS = 30  # of Gauss and Newton, at most
RENEWED = 2  # times that the sensors' noise is estimated again, each time when the rounds have converged
WORSE = 4.0  # times the least sum of squares: a round that ended there went too far
# Of a step, after one that went too far, or after which the errors rose by so much, and otherwise: what acts may depend
# on what the simulator shows, which the derivatives do not have, and then full steps go to and fro for ever
SHORTER, RISES, SHORT, LONGER = 0.25, 1.1, 0.6, 1.2
STEADY = 0.1  # standard errors of a parameter: a smaller step of all of them ends the rounds
CLOSING = 5  # times that outputs and what acts are computed from each other, at most
AWAY = 30.0  # a free initial state's deviation, in rms of the state: practically unknown
LOUDER = 2.0  # times the channel's own noise estimate (`signals.roughness`), which misses slower noise. Chosen by us
# Rounds, and the part to which the errors' square must fall within them, while a parameter still moves by so many of
# its standard errors: otherwise the rounds end
PATIENCE, FALLS, WANDERING = 5, 0.9, 10.0
FAR_OFF = 100.0  # mean square of the errors, in their noise: from here on the fit follows the measurement
FOLLOWED = (0.3, 0.1, 0.03, 0.01)  # of a state's usual step, by which it may leave the law
# Such a fit only leads to the next one: it ends with a smaller step in standard errors, or relative change of its cost
ON_THE_WAY, HARDLY = 1.0, 0.02
FOLLOWING, MISSED = 6, 3.0  # rounds with each of them; mean square of the errors that a share no longer explains
CARRIED = 2  # rounds in which covariances go from one stretch to the next
OTHER_CLOCK = 0.5  # of a jump: deviation of a row that shows it or not, alike likely
UNKNOWN_PLACE = 0.29  # of a jump: deviation of a step's mean where its place is anywhere in the step, 1 / sqrt(12)
CHOSEN = 20.0  # of -2 log likelihood: by so much another way between samples is the likelier one
MOST_UNMEASURED = 0.5  # of an output's rows: its noise is estimated from the rest. Chosen by us
DAMPED = 0.01  # of its length: pull on a candidate of which a ten-thousandth of the square is its own


class TrajectoryFit:
    """n samples, s states, i noisy inputs, o outputs; p: the machine's parameters, and then the coefficients of what
    acts."""

    def __init__(self, machine: DeclaredMachine, table: Table, count: int = 1) -> None:
        """count: samples averaged into one, also for the machine's own signals."""
        table = _marked(machine, table)
        given, guess = machine.inputs(table), machine.first_guess(table)
        check_columns(machine, table, given, guess)
        if count > 1:
            whole = dataclasses.replace(table, columns=table.columns | given | {f"first {n}": guess[n] for n in guess})
            table = signals.averaged(whole, count)
            given = {name: table[name] for name in given}
            guess = {name: table[f"first {name}"] for name in guess}
        self.machine, self.table, self.step_s = machine, table, table.step_s
        self.simulator = Simulator(machine, table, given)
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
        noisy = self.simulator.noisy
        self.noise_u = np.array(
            [
                self._shown_by(given[name], name) if known is None else known
                for name, known in machine.noisy_inputs.items()
            ]
        )
        steps = np.array([table.resolution.get(each.channel, 0.0) for each in machine.outputs])
        nowhere = np.zeros(len(table), dtype=bool)
        self.unmeasured = np.column_stack([table.unmeasured.get(each.channel, nowhere) for each in machine.outputs])
        rough = np.array([signals.roughness(table, *each) for each in zip(self.y.T, self.unmeasured.T, strict=True)])
        self.noise_y = np.maximum(np.hypot(rough, steps / np.sqrt(12.0)), 1e-9 * np.ptp(self.y, axis=0))
        self.shown_y = self.noise_y
        self.u = np.column_stack([given[name] for name in noisy]) if noisy else np.zeros((len(table), 0))
        self.measured_u = self.u.copy()
        driven = self.simulator.driven(self.u, np.zeros((len(table), len(self.simulator.ports))))
        values = {name: self.p[None, None, i] for i, name in enumerate(self.simulator.names)}
        check_methods(machine, self.x, driven, values, self.step_s / machine.parts)
        self.size_x, self.size_u = (np.maximum(np.sqrt(np.mean(each**2, axis=0)), 1e-9) for each in (self.x, self.u))
        self.size_p = np.where(self.p != 0.0, np.abs(self.p), 0.01 * np.minimum(self.high - self.low, 1e6))
        self.lin: Jacobians  # of the last round
        self.predictor: Predictor | None = None
        self.came_from = self.began = (self.x, self.u, self.p)
        reach = len(table) if not np.isfinite(machine.horizon_s) else max(2, round(machine.horizon_s / self.step_s))
        self.starts = np.array([k for run in table.runs for k in range(run.start, run.stop, reach)])
        self.ends = np.zeros(len(table), dtype=bool)  # no step leads from here to the next sample
        self.ends[[run.stop - 1 for run in table.runs]] = True
        self.far_off = False  # or unsettled, the plain fit was: one with candidates follows the measurement at once
        self.acting: list[Acting] = []
        self.enter: list[effects.Entering] = []  # of what acts, along the trajectory of the last round
        self.slack: Array = np.zeros(len(machine.states))  # deviation of each state's step from the law
        self.moves = np.ones(len(self.p))  # 0 for a parameter that stays
        self.damped = np.zeros(len(self.p))  # of a column's length: pull of a parameter towards 0
        self.last_step = np.inf  # largest one of a parameter in the last round, in its standard errors
        self.settled = False  # nothing moved any more where the last rounds ended

    def _shown_by(self, column: Array, name: str) -> float:
        """Noise of an input as its channel shows it."""
        rough = signals.roughness(self.table, column)
        return max(rough, signals.rounding(self.table, column)) if name in self.simulator.staying else rough

    @property
    def count(self) -> int:
        """Number of the machine's own parameters."""
        return len(self.simulator.names)

    @property
    def unknown(self) -> int:
        """Number of the last coefficients, which are of what was there before the recording."""
        return sum(len(each.coefficients) for each in self.acting if each.unknown)

    @property
    def surprise(self) -> float:
        """-2 log likelihood of the recording under the last round's simulator and noise, up to a constant."""
        assert self.predictor is not None
        found = float(np.sum((self.response / self.predictor.unit) ** 2) + self.predictor.surprise_of_spread)
        if self.unknown:
            columns = (self.columns[:, :, -self.unknown :] / self.predictor.unit[:, None]).reshape(-1, self.unknown)
            spread = np.linalg.slogdet(np.eye(self.unknown) + columns.T @ columns)[1]
            found += float(np.sum(self.unknown_at**2) + spread)
        return found

    @property
    def lost(self) -> bool:
        """True where the fit ended far off, or left errors above the noise with a parameter at its limit."""
        own = self.p_at[: self.count]
        at_limit = np.any((own <= self.low[: self.count]) | (own >= self.high[: self.count]))
        return not self.cost < FAR_OFF or bool(at_limit) and not self.cost < MISSED

    def acted_on(self, acting: Sequence[Acting], fixed: bool) -> "TrajectoryFit":
        """A fit that continues from here with effects in the simulator; their coefficients follow the parameters."""
        new, count = copy.copy(self), self.count
        unknown = [each for one in acting if one.term.before for each in effects.before(one, self.seen())]
        new.acting = [*acting, *unknown]
        added = np.array([each for one in new.acting for each in one.coefficients])
        new.p = np.concatenate((self.p_at[:count], added))
        new.low, new.high = (
            np.concatenate((limit[:count], np.full(len(added), beyond)))
            for limit, beyond in ((self.low, -np.inf), (self.high, np.inf))
        )
        new.size_p = np.concatenate((self.size_p[:count], np.where(added != 0.0, np.abs(added), 1.0)))
        new.moves = np.ones(len(new.p))
        new.moves[count : len(new.p) - new.unknown] = 0.0 if fixed else 1.0
        new.damped = np.zeros(len(new.p))
        new.came_from = (new.x, new.u, new.p)
        new.enter, new.last_step = [], np.inf  # until the first round
        return new

    def settled_with(self, acting: Sequence[Acting]) -> bool:
        """True where nothing moves any more with just these effects, whatever their coefficients started from."""
        known = [each for each in self.acting if not each.unknown]
        same = len(known) == len(acting) and all(
            here.term is other.term and here.shape == other.shape for here, other in zip(known, acting, strict=True)
        )
        return same and self.settled and not np.any(self.damped) and bool(np.all(self.moves))

    def with_all(self, acting: Sequence[Acting]) -> "TrajectoryFit":
        """A fit from the start, with candidates in the simulator that are pulled towards 0; their coefficients are 0.

        What a model without its fault ends at may be far from the machine, and not only in the faulty place; first
        order about it says little. Candidates that these data cannot distinguish stay small.
        """
        count = self.count
        new = self.acted_on(acting, fixed=False)
        new.x, new.u, start = self.began
        new.p = np.concatenate((start[:count], np.zeros(len(new.p) - count)))
        new.damped[count : len(new.p) - new.unknown] = DAMPED
        new.came_from, new.predictor = (new.x, new.u, new.p), None
        new.noise_y = self.shown_y
        return new

    def seen(self) -> SimulatedRecording:
        """Signals along the trajectory, without equations."""
        machine, simulator = self.machine, self.simulator
        along = {name: self.x[:, i] for i, name in enumerate(machine.states)}
        along |= simulator.inputs | {name: self.u[:, i] for i, name in enumerate(simulator.noisy)}
        along |= {each.channel: self.lin.output[:, i] for i, each in enumerate(machine.outputs)}
        entering = self.entering()
        for number, each in enumerate(machine.outputs, len(machine.ports)):
            along[sensed(each.channel)] = along[each.channel] - entering[:, number]
        along["t"] = self.table.elapsed_s
        along |= machine.extra_signals(along, self.table)
        ways = {name: simulator.numerics.between(name) for name in simulator.inputs}
        return SimulatedRecording(self.table, along, {}, ports=simulator.ports, ways=ways)

    def _coefficients(self) -> list[Array]:
        """Of each effect that acts."""
        ends = np.cumsum([self.count, *(len(each.coefficients) for each in self.acting)])
        return [self.p[a:b] for a, b in itertools.pairwise(ends)]

    def entering(self) -> Array:
        """(n, ports): what acts puts into the ports."""
        coefficients = self._coefficients() if self.enter else []
        return effects.total(self.enter, coefficients, len(self.x), len(self.simulator.ports))

    def _closed(self, values: Values) -> SimulatedRecording:
        """Signals along the trajectory, and `enter` by them: what acts may depend on an output that it changes.

        Half of each change: where an effect takes more away than there was, as a winding that heats by its own current
        does, the whole change would go to and fro.
        """
        for _ in range(CLOSING):
            if self.enter:
                driven = self.simulator.driven(self.u, self.entering())
                shown = self.simulator.at(self.x, self.p, driven)[1]
                self.lin = dataclasses.replace(self.lin, output=0.5 * (self.lin.output + shown))
            seen, before = self.seen(), self.enter
            self.enter = [effects.entering(each, seen, values) for each in self.acting]
            if before and all(effects.same(one, other) for one, other in zip(before, self.enter, strict=True)):
                break
        return seen

    def linearise(self, final: bool = True) -> Jacobians:
        """About the present trajectory, with the effects that act; final: by all ports, not only by those in which one
        acts, and by central differences (so is all without effects)."""
        simulator, states = self.simulator, self.machine.states
        values = dict(zip(simulator.names, self.p, strict=False))
        seen = self._closed(values) if self.acting else None
        there = sorted(
            {number for each in self.enter for number in each} | set(self._ports(self.simulator.numerics.open_jumps))
        )
        sizes = self.size_x, self.size_u, self.size_p[: self.count]
        ports = range(len(simulator.ports)) if final else there
        with np.errstate(over="ignore", invalid="ignore"):  # a machine that runs away is refused below
            lin = simulator.linearised(
                self.x, self.u, self.p, self.entering(), sizes, ports, final or not self.acting
            )  # fmt: skip
        back = np.zeros((len(self.x), len(simulator.ports), len(states)))
        for each, enter, own in zip(self.acting, self.enter, self._coefficients(), strict=True):
            assert seen is not None
            slopes = effects.fed_back(each, enter, seen, values, own, dict(zip(states, self.size_x, strict=True)))
            for (number, name), slope in slopes.items():
                back[:, number, states.index(name)] += slope
            state, output = simulator.forcing(lin, enter)
            lin.f_p, lin.h_p = np.concatenate((lin.f_p, state), axis=2), np.concatenate((lin.h_p, output), axis=2)
        if np.any(back):
            after = np.concatenate((back[1:], back[-1:]))  # a step has the mean of its two ends
            lin.f_x, lin.h_x = lin.f_x + 0.5 * lin.f_q @ (back + after @ lin.f_x), lin.h_x + lin.h_q @ back
        for derivative in (lin.h_x, lin.h_u, lin.h_p, lin.h_q):  # an output that is not measured shows nothing
            derivative[self.unmeasured] = 0.0
        numbers = (lin.next_state, lin.output, lin.f_x, lin.h_x, lin.f_p, lin.h_p)
        if not all(np.all(np.isfinite(each)) for each in numbers):
            raise UserError(
                f"{self.table.name}: the simulator of {self.machine.name} gives no numbers on this recording"
            )
        return lin

    def loose(self) -> Array:
        """(n, s) deviations that the law leaves open in each step."""
        machine, simulator = self.machine, self.simulator
        states = {name: self.x[:, i] for i, name in enumerate(machine.states)}
        values = {name: np.full(len(self.x), self.p[i]) for i, name in enumerate(simulator.names)}
        given = simulator.inputs | {name: self.u[:, i] for i, name in enumerate(simulator.noisy)}
        entering = self.entering()
        given |= {each.name: entering[:, i] for i, each in enumerate(simulator.ports)}
        found = machine.loose(states, given, values, self.step_s)
        nothing = np.zeros(len(self.x))
        # a trace of noise keeps the predictor from being certain of what it has not seen
        return (
            np.column_stack([simulator.numerics.open_share * found.get(name, nothing) for name in machine.states])
            + 1e-9 * self.size_x
            + self.slack
        )

    def _ports(self, inputs: Collection[str]) -> dict[int, str]:
        """Inputs by number of their port."""
        names = {into(name): name for name in inputs}
        return {number: names[port.name] for number, port in enumerate(self.simulator.ports) if port.name in names}

    def open_steps(self) -> Array:
        """(n, s) deviations of each step: what the law leaves open, and inputs' jumps at an unknown place inside it."""
        square = self.loose() ** 2
        for number, name in self._ports(self.simulator.numerics.unsure).items():
            square = square + (UNKNOWN_PLACE * self.lin.f_q[:, :, number] * self.simulator.jumps[name][:, None]) ** 2
        return np.asarray(np.sqrt(square))

    def open_outputs(self) -> Array:
        """(n, o) deviations of each row: the sensors' noise, and jumps of inputs that another clock stamps."""
        square = np.broadcast_to(self.noise_y**2, self.y.shape)
        for number, name in self._ports(self.simulator.numerics.apart).items():
            square = square + (OTHER_CLOCK * self.lin.h_q[:, :, number] * self.simulator.jumps[name][:, None]) ** 2
        return np.asarray(np.sqrt(square))

    def choose_way(self) -> bool:
        """Take the likeliest way of the inputs between samples, to first order about the fit; True when it is another.

        Its gain counts in units of what the fit leaves, so that an error of the model does not choose.
        """
        ways = self.simulator.ways(self.simulator.shown_at_once(self.u, self.p))
        if len(ways) == 1:
            return False
        here = self._end()
        self.round(final=True)
        assert self.predictor is not None
        first, now = self.predictor, self.simulator
        self.x, self.u, self.p, self.noise_y, self.predictor = here
        driven, lefts, spreads = now.driven(self.u, self.entering()), list[Array](), list[float]()
        f = now.at(self.x, self.p, driven)[0]
        for way in ways:
            self.simulator = now.stepping(way)
            moved = self.simulator.at(self.x, self.p, self.simulator.driven(self.u, self.entering()))[0] - f
            moved[self.ends] = 0.0
            wide = first
            if (way.unsure, way.apart) != (now.numerics.unsure, now.numerics.apart):
                wide = Predictor(self.lin, self.noise_u, self.open_outputs(), self.open_steps(), self.starts,
                                 AWAY * self.size_x, first)  # fmt: skip
            missed = np.concatenate(((self.state - moved)[:, :, None], self.lin.f_p), axis=2)
            shown = np.concatenate((self.output[:, :, None], self.lin.h_p), axis=2)
            lefts.append(wide.left(missed, shown).reshape(-1))
            spreads.append(wide.surprise_of_spread)
        squares = [float(left @ left) for left in lefts]
        for number, way in enumerate(ways):
            other = way.held ^ now.numerics.held
            # A lag of the machine is of any size, a hold of half a row: what asks for more or less is not one
            if other and other <= now.curving and not _is_whole(lefts[0], lefts[number]):
                squares[number] = np.inf
        inflated = max(1.0, min(squares) / len(lefts[0]))
        scores = [square / inflated + spread for square, spread in zip(squares, spreads, strict=True)]
        best = int(np.argmin(scores))
        if best and scores[0] - scores[best] < CHOSEN:
            best = 0
        self.simulator = now.stepping(ways[best])
        return best > 0

    def round(self, final: bool = False) -> float:
        """One round; returns the largest step of a parameter in its standard errors.

        final: the answer comes from it; where effects act the others only lead there, by simple differences, and by
        short stretches where a stretch need not learn much: near the end, where the covariances that it begins with
        hardly change any more, and where the law is open. A fit without effects may end far off, where every detail
        decides where: its rounds are careful.
        """
        self.lin = lin = self.linearise(final)
        self.unknown_at = self.p[len(self.p) - self.unknown :]
        short = (
            not final
            and bool(self.acting)
            and (self.predictor is not None and self.last_step < NEAR or bool(np.any(self.slack)))
        )
        self.predictor = Predictor(lin, self.noise_u, self.open_outputs(), self.open_steps(), self.starts,
                                   AWAY * self.size_x, self.predictor, SHORT_STRETCH if short else STRETCH)  # fmt: skip
        wide = self.predictor
        assert wide is not None
        offset = self.measured_u - self.u  # the part that the inputs' noise has to explain already
        gap = lin.next_state - np.concatenate((self.x[1:], self.x[-1:]))
        gap[self.ends] = 0.0
        self.state = -(gap + (lin.f_u @ offset[:, :, None])[:, :, 0])
        self.output = self.y - lin.output - (lin.h_u @ offset[:, :, None])[:, :, 0]
        self.output[self.unmeasured] = 0.0
        x, errors = wide.predicted(
            np.concatenate((self.state[:, :, None], lin.f_p), axis=2),
            np.concatenate((self.output[:, :, None], lin.h_p), axis=2),
        )
        white = wide.white(errors)
        self.response, self.columns = white[:, :, 0], white[:, :, 1:]
        n = self.response.size
        self.cost = float(np.mean((self.response / wide.unit)[~self.unmeasured] ** 2))
        a = (self.columns / wide.unit[None, :, None]).reshape(n, len(self.p)) * (self.size_p * self.moves)
        b = (self.response / wide.unit).reshape(n)
        change, error = self._step(a, b)
        # positive parameters are divisors, far from linear: no step more than halves or doubles one
        ratio = np.divide(self.p + change, self.p, out=np.ones_like(self.p), where=self.low > 0.0)
        change *= min(1.0, *(0.5 / (1.0 - r) if r < 0.5 else 1.0 / (r - 1.0) if r > 2.0 else 1.0 for r in ratio))
        # the rest of the response, after the parameters' step, gives trajectory and inputs
        step = np.concatenate(([1.0], -change))
        self.rest = errors @ step
        dx, du = wide.smoothed(x @ step, self.rest, lin.f_u, lin.h_u, self.noise_u)
        self.x, self.u, self.p = self.x + dx, self.u + offset + du, self.p + change
        self.last_step = float(np.max(np.abs(change) / np.maximum(error, 1e-30)))
        return self.last_step

    def _step(self, a: Array, b: Array) -> tuple[Array, Array]:
        """(change of the parameters, their standard errors) by least squares within the limits.

        a: (n, p) columns for a change of `size_p`; b: (n,). A parameter that would leave its limits goes to the limit,
        and the others are fitted again: cut off alone, it would leave them where only its full step belongs to them.
        """
        known = np.zeros(len(self.p))
        known[len(known) - self.unknown :] = self.size_p[len(known) - self.unknown :]  # 0, with a deviation of 1
        length = np.maximum(np.hypot(np.linalg.norm(a, axis=0), known), 1e-30)
        pull = self.damped + known / length
        scaled = np.vstack((a / length, np.diag(pull)))
        wanted = np.concatenate((b, -pull * self.p * length / self.size_p))
        change, error = np.zeros(len(self.p)), np.zeros(len(self.p))
        free = np.ones(len(self.p), dtype=bool)
        # a triangle with the same products of columns: of few rows, and none of the digits is lost by squaring
        triangle: Array = np.asarray(np.linalg.qr(np.column_stack((scaled, wanted)), mode="r"))
        scaled, wanted = triangle[:, :-1], triangle[:, -1]
        while np.any(free):
            u, sv, vt = np.linalg.svd(scaled[:, free], full_matrices=False)
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
        left = np.nanmedian(np.where(self.unmeasured, np.nan, np.abs(self.rest)), axis=0) / 0.6745
        self.noise_y = np.clip(left, 1e-9 * np.ptp(self.y, axis=0), LOUDER * self.shown_y)

    def settle(self, rounds: int = ROUNDS, follow: bool = False) -> None:
        """Rounds until nothing moves any more. follow: the measurement, where they end far off, if that is likelier."""
        if follow and self.far_off:
            self._follow()
            return
        self.settled = self._settled(rounds)
        if not follow or self.cost < MISSED or self.settled and self.cost <= FAR_OFF:
            return
        self.far_off, self.settled = True, False
        ended, reached = self._end(), self._surprise_here()
        self._follow()
        if not self._surprise_here() <= reached:
            self.x, self.u, self.p, self.noise_y, self.predictor = ended

    def settle_anew(self, rounds: int) -> None:
        """Rounds with another way of the inputs: a fit that was far off by its way between samples alone is not."""
        self.settled = self._settled(rounds)
        self.far_off = self.far_off and not self.cost < MISSED

    def _end(self) -> tuple[Array, Array, Array, Array, Predictor | None]:
        return self.x, self.u, self.p, self.noise_y, self.predictor

    def _surprise_here(self) -> float:
        """`surprise` where the fit is; infinite where the simulator runs away. Nothing moves."""
        here = self._end()
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                for _ in range(CARRIED):
                    self.x, self.u, self.p = here[:3]
                    self.round()
            found = self.surprise
        except (UserError, np.linalg.LinAlgError):
            found = np.inf
        self.x, self.u, self.p, self.noise_y, self.predictor = here
        return found if np.isfinite(found) else np.inf

    def _settled(self, rounds: int) -> bool:
        """False when parameters still move after these rounds, or go far and lead nowhere."""
        renewed, best, before, share = 0, np.inf, np.inf, 1.0
        fell, low = 0, np.inf  # round in which the errors last fell, and to what
        for number in range(rounds):
            accepted = (self.x, self.u, self.p)
            try:
                with np.errstate(over="ignore", invalid="ignore"):  # far from a solution a machine may run away
                    step = self.round()
            except (UserError, np.linalg.LinAlgError):
                if self.x is self.began[0]:
                    raise
                if self.x is self.came_from[0]:  # nothing leads on from where another simulator ended
                    self.came_from = (*self.began[:2], self.p)
                self.cost, self.predictor = np.inf, None
            if not self.cost < WORSE * best:
                # too far: a part of the step from where it began, whose cost is another with the covariances of now
                (self.x, self.u, self.p), best, share = self.came_from, np.inf, SHORTER * share
                before = np.inf
                continue
            if self.cost > RISES * before:
                share *= SHORT
            hardly = step < ON_THE_WAY or abs(self.cost - before) < HARDLY * self.cost
            led = np.any(self.slack) and (hardly if self.acting else step <= STEADY)
            before = self.cost
            if share < 1.0:
                self.x, self.u, self.p = (
                    old + share * (new - old) for old, new in zip(accepted, (self.x, self.u, self.p), strict=True)
                )
                share = min(1.0, LONGER * share)
            self.came_from = accepted
            best = min(best, self.cost)
            if best < FALLS * low or step < WANDERING:
                fell, low = number, best
            elif number - fell >= PATIENCE:
                return False
            if led:
                return True
            if step > STEADY:
                continue
            if renewed == RENEWED:
                return True
            self._renew_noise()
            renewed, best, before = renewed + 1, np.inf, np.inf
        return False

    def _follow(self) -> None:
        """Fit again from the start, along the measurement: states may leave the law by a share of their steps.

        A simulator without a large fault's cause has no good trajectory, and where its fit ends means nothing. The
        share becomes smaller as long as it explains what is left; a law that explains all of it is fitted from there.
        """
        self.x, self.u, start = self.began
        self.p = np.concatenate((start[: self.count], np.zeros(len(self.p) - self.count)))
        self.noise_y, self.predictor = self.shown_y, None
        moved = np.diff(self.x, axis=0)
        moved[self.ends[:-1]] = 0.0
        usual = np.sqrt(np.mean(moved**2, axis=0))
        kept = (self.x, self.u, self.p)
        for share in FOLLOWED:
            self.slack = share * usual
            self.came_from = (self.x, self.u, self.p)
            self._settled(FOLLOWING)
            if not self.cost < MISSED and share < FOLLOWED[0]:
                break
            kept = (self.x, self.u, self.p)
        else:
            self.slack, self.came_from = np.zeros_like(usual), kept
            if self._settled(ROUNDS) and self.cost < FAR_OFF:
                return
        (self.x, self.u, self.p), self.slack, self.predictor = kept, np.zeros_like(usual), None

    def round_again(self) -> None:
        """Linearise where the last round ended, without moving."""
        self.p_at = self.p.copy()
        x, u = self.x, self.u
        self.round(final=True)
        self.x, self.u = x, u


def _is_whole(before: Array, left: Array) -> bool:
    """True where what was `before` asks for a change by about as much as was made, which leaves `left`; both (n o,).

    Nearer to all of it than to nothing or to twice as much.
    """
    change = before - left
    return 0.5 * float(change @ change) < float(before @ change) < 1.5 * float(change @ change)


def _marked(machine: DeclaredMachine, table: Table) -> Table:
    """The table with all rows without a measurement of an output: cut off there, or lacking in the recording.

    UserError where that is most of an output, or where the machine's inputs need it.
    """
    unmeasured, columns = {}, dict(table.columns)
    for name in (each.channel for each in machine.outputs):
        rows = signals.clipped(table, table[name], signals.counts_of(table, name)) | table.unmeasured.get(name, False)
        if not np.any(rows):
            continue
        share = float(np.mean(rows))
        if share > MOST_UNMEASURED:
            raise UserError(
                f"{table.name}: {name}: {share:.1%} of its values are cut off or are not numbers, at most "
                f"{MOST_UNMEASURED:.0%} may be; nothing is concluded from such data"
            )
        unmeasured[name] = rows
        columns[name] = np.where(rows, np.nan, table[name])
    if unmeasured:
        given = machine.inputs(dataclasses.replace(table, columns=columns))
        spoilt = [name for name, column in given.items() if not np.all(np.isfinite(column))]
        if spoilt:
            raise UserError(
                f"{table.name}: {', '.join(unmeasured)}: values are cut off or are not numbers, and {machine.name} "
                f"makes its input {', '.join(spoilt)} of them; nothing is concluded from such data"
            )
    return dataclasses.replace(table, unmeasured=unmeasured)
