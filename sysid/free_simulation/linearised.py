"""A fitted simulator as equations that are linear in its parameters, and the response of these to what enters."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.free_simulation.fit import AWAY, TrajectoryFit
from ranger_sim.sysid.free_simulation.predictor import Jacobians, Predictor
from ranger_sim.sysid.free_simulation.recording import SimulatedRecording
from ranger_sim.sysid.free_simulation.terms import Port, Ports, Shape, Term
from ranger_sim.sysid.machine import Columns, Entry, Equation, Values

LAGS_S = (0.0, 0.01, 0.03, 0.1)  # lags at which the general tests use slopes
SHORTEST_WINDOW = 50  # samples of a free simulation, of which the free initial state takes some
DRAWS = 8  # of noise, from which its part in free simulation is known to a tenth
TOGETHER = 24  # responses that are computed side by side
SILENT = 1e-6  # share of an effect's length below which an equation does not have it
ROUNDED = 1e-10  # of the square of what an effect adds to the outputs: less is rounding, 6e-14 for such an offset
MOST_KEPT = 4_000_000  # rows of responses of a machine's own terms: some 100 MB
SHARE_OPEN = 0.01  # of the largest deviation of the open law: there it is open


@dataclasses.dataclass(kw_only=True)
class LinearisedRecording(SimulatedRecording):
    """A recording with its linearised simulator. fitted: parameters about which it was linearised; fit: continues with
    an effect in the simulator."""

    fitted: dict[str, float]
    linear: Jacobians
    predictor: Predictor
    outputs: tuple[str, ...]
    fit: TrajectoryFit
    free: dict[tuple[int, int], Columns] = dataclasses.field(default_factory=dict)  # by term and number of its shape
    own: dict[tuple[int, tuple[float, ...]], tuple[Term, Ports, Columns]] = dataclasses.field(default_factory=dict)

    def respond(self, entries: Ports) -> Columns:
        """First-order response of the equations to an input at the ports: (n, k) each."""
        state, output = self._forcing(entries)
        return self._reached(self.predictor.white(self.predictor.errors(state, output)), output)

    def _forcing(self, entries: Ports) -> tuple[Array, Array]:
        return self.fit.simulator.forcing(self.linear, self.entering(entries))

    def _reached(self, white: Array, shown: Array) -> Columns:
        """(n, k) of each equation that has the effect; shown: (n, o, k) what it adds to the outputs themselves.

        None has what a free initial state takes up, as an offset of an output that is a state: rounding is left of it,
        which fits anything at a size that nothing has.
        """
        power, direct = ((each**2).sum(axis=(0, 2)) / self.predictor.unit**2 for each in (white, shown))
        if power.sum() <= ROUNDED * direct.sum():
            return {}
        return {
            name: white[:, number] for number, name in enumerate(self.outputs) if power[number] > SILENT * power.sum()
        }

    def of_own(self, term: Term, shape: Shape, values: Values) -> Columns:
        """The response to a term of the machine's own; naming asks for it again and again with the same input."""
        key = (id(term), tuple(shape.values()))
        entries = term.make(self, shape, values)
        if kept := self.own.get(key):
            _, before, found = kept
            if before.keys() == entries.keys() and all(np.array_equal(before[name], entries[name]) for name in entries):
                return found
        found = self.respond(entries)
        if len(self.own) * len(self.table) < MOST_KEPT:
            self.own[key] = term, entries, found
        return found

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
        forcings = [self._forcing(ports) for _, _, ports in made]
        state, output = (np.concatenate(each, axis=2) for each in zip(*forcings, strict=True))
        white = self.predictor.white(self.predictor.errors(state, output))
        first = 0
        for (term, place, _), (each, _) in zip(made, forcings, strict=True):
            some = slice(first, first + each.shape[2])
            self.free[id(term), place] = self._reached(white[:, :, some], output[:, :, some])
            first += each.shape[2]


def one_step_ahead(fit: TrajectoryFit) -> LinearisedRecording:
    """The equations as white errors of a prediction by one sample."""
    fit.round_again()
    predictor = fit.predictor
    assert predictor is not None
    _forget(fit, predictor, fit.columns)
    return _made(fit, predictor, predictor.known(fit.response), predictor.known(fit.columns), predictor.unit)


def free(fit: TrajectoryFit) -> LinearisedRecording:
    """Errors of free simulation over windows, about the same trajectory: without noise, each window starts free.

    Where the law is open (`loose`) it stays so. Not whitened: a sum of squares is that of the outputs' errors.
    """
    window = max(SHORTEST_WINDOW, round(fit.machine.window_s / fit.step_s))
    starts = np.array([k for run in fit.table.runs for k in range(run.start, run.stop, window)])
    predictor = Predictor(fit.lin, np.zeros_like(fit.noise_u), fit.open_outputs(), fit.open_steps(), starts,
                          AWAY * fit.size_x, stretch=window)  # fmt: skip
    columns = predictor.white(predictor.errors(fit.lin.f_p, fit.lin.h_p))
    _forget(fit, predictor, columns)
    missed = predictor.white(predictor.errors(fit.state[:, :, None], fit.output[:, :, None]))[:, :, 0]
    columns = predictor.known(columns)
    made = _made(fit, predictor, missed, columns, _by_noise(fit, predictor))
    made.whitened = False
    return made


def _forget(fit: TrajectoryFit, predictor: Predictor, columns: Array) -> None:
    """What was there before the recording is not known: the last of these white columns (n, o, parameters)."""
    if fit.unknown:
        predictor.forget(columns[:, :, -fit.unknown :])


def _by_noise(fit: TrajectoryFit, predictor: Predictor) -> Array:
    """(outputs,) rms of the errors that the noise of inputs and sensors, and an open law, leave in free simulation."""
    random = generator(0, "noise in free simulation")

    def drawn(deviations: Array) -> Array:
        return random.normal(size=(len(fit.x), deviations.shape[-1], DRAWS)) * deviations[..., None]

    inputs = drawn(fit.noise_u)
    state = fit.lin.f_u @ inputs + drawn(fit.open_steps())
    shown = drawn(np.where(fit.unmeasured, 0.0, fit.open_outputs()))
    left = predictor.white(predictor.errors(state, fit.lin.h_u @ inputs + shown))
    measured = np.count_nonzero(~fit.unmeasured, axis=0)
    return np.asarray(np.sqrt(np.sum(np.mean(left**2, axis=2), axis=0) / measured))


def _made(fit: TrajectoryFit, predictor: Predictor, missed: Array, columns: Array, noise: Array) -> LinearisedRecording:
    """The recording whose equations are a predictor's errors, (n, o), with columns (n, o, parameters). noise: (o,)."""
    machine, table, names = fit.machine, fit.table, fit.simulator.names
    seen = fit.seen()
    along = seen.signals
    counts = machine.counts(along, table)
    equations = {}
    widths = _standstill(fit, predictor)
    for number, each in enumerate(machine.outputs):
        own = {name: columns[:, number, i] for i, name in enumerate(names)}
        own |= {name: column[:, number] for name, column in widths.items()}
        valid = counts.get(each.channel, np.ones(len(table), dtype=bool)) & ~fit.unmeasured[:, number]
        response = missed[:, number] + columns[:, number] @ fit.p_at
        equations[each.channel] = Equation(each.channel, each.letter, each.subsystem, each.unit, response, own, valid)
    made = LinearisedRecording(
        table,
        along,
        equations,
        own_noise={each.channel: float(one) for each, one in zip(machine.outputs, noise, strict=True)},
        between_rows={name: fit.simulator.numerics.way(name) for name in fit.simulator.inputs},
        lags=tuple(round(time_s / fit.step_s) for time_s in LAGS_S),
        fitted=dict(zip(names, (float(each) for each in fit.p_at), strict=False)),
        linear=fit.lin,
        predictor=predictor,
        ports=seen.ports,
        ways=seen.ways,
        outputs=tuple(each.channel for each in machine.outputs),
        fit=fit,
    )

    def entry(port: Port) -> Entry:
        return Entry(port.subsystem, lambda columns: made.respond({port.name: columns}))

    made.entries = {each.name: entry(each) for each in made.ports}
    return made


def _standstill(fit: TrajectoryFit, predictor: Predictor) -> dict[str, Array]:
    """By name (n, outputs): the outputs' response to a wrong width of the smoothed sign about standstill.

    A smoothed sign lacks friction just before a machine comes to rest, where the law is open (`loose`): the base
    fits how much, and no cause is made of it.
    """
    open_by, found = fit.loose(), {}
    for number, state in enumerate(fit.machine.states):
        active = open_by[:, number] > SHARE_OPEN * np.max(open_by[:, number])
        if not 0 < np.count_nonzero(active) < len(active):
            continue
        forcing = np.zeros((len(fit.x), len(fit.machine.states), 1))
        forcing[:, number, 0] = -open_by[:, number] * np.sign(fit.x[:, number])
        nothing = np.zeros((len(fit.x), len(fit.machine.outputs), 1))
        found[f"width of standstill@{state}"] = predictor.white(predictor.errors(forcing, nothing))[:, :, 0]
    return found
