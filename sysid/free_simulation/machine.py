"""A `Machine` (sysid/machine.py) of a simulator: what the diagnosis calls."""

import functools
from collections.abc import Sequence
from typing import cast

import numpy as np

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import signals
from ranger_sim.sysid.dataset import Array, Table
from ranger_sim.sysid.free_simulation import linearised, numerical_floor
from ranger_sim.sysid.free_simulation.candidates import candidates
from ranger_sim.sysid.free_simulation.declared import DeclaredMachine
from ranger_sim.sysid.free_simulation.fit import TrajectoryFit
from ranger_sim.sysid.free_simulation.linearised import LinearisedRecording
from ranger_sim.sysid.free_simulation.terms import Acting, Shape, SimulatedEffect, Term
from ranger_sim.sysid.machine import Columns, Effect, Recording, Values, inputs_of

MOST_ROWS = 12000  # of a recording; a longer one is averaged over neighbours
SHORTEST_S, FEWEST_ROWS = 2.0, 400  # a recording is as long, or has as many rows, where its machine says nothing
AGAIN = 12  # rounds with an effect in the simulator, at most: they start at the end of the fit without it
SAME = 1.0 - 1e-6  # cosine of two responses: candidates of two names for one effect


class SimulatedMachine(DeclaredMachine):
    """An ordinary differential equation with measured inputs, as a user declares it."""

    def prepare(self, table: Table) -> LinearisedRecording:
        """Fit the simulator to one recording and linearise it there."""
        missing = [each.name for each in self.quantities if each.needed and each.name not in table]
        if missing:
            there = ", ".join(table.columns)
            raise UserError(f"{table.name}: {self.name} needs {', '.join(missing)}; there are {there}")
        longest_s = max(float(np.ptp(table.time_s[run])) for run in table.runs) + table.step_s
        needed_s = min(SHORTEST_S, FEWEST_ROWS * table.step_s) if self.shortest_s is None else self.shortest_s
        if longest_s < needed_s:
            raise UserError(
                f"{table.name}: the longest stretch without a gap is {longest_s:.3g} s, "
                f"{self.name} needs {needed_s:.3g} s (its shortest_s)"
            )
        table = signals.uniform(signals.cut_where_lost(table, inputs_of(self), bool(self.held_inputs)))
        fit = TrajectoryFit(self, table, -(-len(table) // MOST_ROWS))
        fit.settle(follow=True)
        _chosen(fit)
        if numerical_floor.take_finer_steps(fit, AGAIN):
            _chosen(fit)
        return linearised.one_step_ahead(fit)

    def effects(self, recordings: Sequence[Recording]) -> list[Effect]:
        """The terms as effects on the outputs."""
        simulated = cast(Sequence[LinearisedRecording], recordings)
        own = self.terms(simulated)
        free = self._free(own, simulated)

        def columns(recording: Recording, shape: Shape, values: Values, term: Term) -> Columns:
            here = cast(LinearisedRecording, recording)
            if term.independent and any(term is each for each in free):
                return here.of_free(free, term, shape)
            return here.of_own(term, shape, values)

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
                once=term.once,
                term=term,
            )
            for term in (*own, *free)
        ]

    def _free(self, own: Sequence[Term], recordings: Sequence[LinearisedRecording]) -> list[Term]:
        """The free candidates that are not the same as a term of the machine's own."""
        if not self.free_candidates:
            return []
        inputs = list(recordings[0].fit.simulator.inputs)
        named = {(each.cause, each.at) for each in own}
        made = [
            each
            for each in candidates(self, inputs, recordings)
            if (each.cause, each.at) not in named and each.cause not in self.impossible
        ]
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
        """The recording fitted and linearised with these effects in the simulator; fixed: their coefficients stay.

        A fit that has settled with the same effects is the answer already: it would end at the same place again.
        """
        acting = [
            Acting(effect.term, shape, tuple(coefficients))
            for effect, shape, coefficients in effects
            if isinstance(effect, SimulatedEffect) and effect.term is not None
        ]
        if not fixed and _fit(recording).settled_with(acting):
            return recording
        fit = _fit(recording).acted_on(acting, fixed)
        fit.settle(AGAIN)
        _chosen(fit)
        return linearised.one_step_ahead(fit if fixed else numerical_floor.likelier_held(fit))

    def about_all(
        self,
        recording: Recording,
        effects: Sequence[tuple[Effect, Shape]],
        families: Sequence[Sequence[tuple[Effect, Shape]]] = (),
    ) -> Recording:
        """The recording linearised where the simulator fits with all of these effects in it, and not only without.

        families: tried one after the other as well, as long as the simulator is lost; where it ended without its fault
        the likeliest effects need not be the right ones.
        """
        best = fit = _fit(recording)
        for number, each in enumerate((effects, *families)):
            if number and not best.lost:
                break
            acting = [
                Acting(effect.term, shape, (0.0,) * len(effect.coefficients))
                for effect, shape in each
                if isinstance(effect, SimulatedEffect) and effect.term is not None
            ]
            if not acting:
                continue
            tried = fit.with_all(acting)
            try:
                tried.settle(follow=True)
                _chosen(tried)
                made = linearised.one_step_ahead(tried)
            except (UserError, np.linalg.LinAlgError):  # it runs away with these: another fit is the better one
                continue
            if tried.surprise < best.surprise:
                best, recording = tried, made
        return recording

    def numerical(self, recording: Recording) -> Array:
        """(variants, coefficients): what the coefficients of what acts move by with other numerics."""
        return numerical_floor.moved(_fit(recording))

    def surprise(self, recording: Recording) -> float:
        """-2 log likelihood of a recording with what acts in its simulator, up to a constant."""
        return _fit(recording).surprise

    def free(self, recording: Recording) -> Recording:
        """The recording with errors of free simulation as its equations: the outputs' errors over `window_s`, with the
        simulator started at the most probable state of each window. Inputs count as exact."""
        return linearised.free(_fit(recording))

    def generic(self, recording: Recording) -> dict[str, dict[str, Array]]:
        """The signals of `looked_over`."""
        return self.looked_over(cast(LinearisedRecording, recording))


def _chosen(fit: TrajectoryFit) -> None:
    """Settle the fit on the likeliest way of its inputs between samples, a change at a time.

    Where rows next to a jump weigh less, another way may be the likelier one again.
    """
    at_once = fit.simulator.shown_at_once(fit.u, fit.p)
    now = fit.simulator
    for _ in range(len(now.open_ways) + len(now.staying) + len(now.curving) + 2 * len(at_once)):
        if not fit.choose_way():
            break
        fit.settle_anew(AGAIN)


def _fit(recording: Recording) -> TrajectoryFit:
    return cast(LinearisedRecording, recording).fit


def _direction(columns: Columns, recording: LinearisedRecording) -> Array:
    """An effect's response with one coefficient as a vector of length 1, each output in its noise."""
    nothing = np.zeros((len(recording.table), 1))
    stacked = np.concatenate(
        [columns.get(name, nothing)[:, 0] / unit
         for name, unit in zip(recording.outputs, recording.predictor.unit, strict=True)]
    )  # fmt: skip
    return np.asarray(stacked / max(float(np.linalg.norm(stacked)), 1e-300))
