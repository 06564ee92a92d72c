"""Causes held against their nearest rivals in the simulator itself.

First order cannot distinguish causes that differ by a small share of a large effect.
"""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import held_out, likelihood, naming
from ranger_sim.sysid.likelihood import Selection
from ranger_sim.sysid.machine import Effect, Machine, Recording
from ranger_sim.sysid.naming import Named
from ranger_sim.sysid.regression import Regression

CLOSE, MOST_CLOSE = 0.03, 3  # of a cause's chi-square: rivals so near are simulated as well, so many of them
# Of -2 log likelihood: a rival that is so far behind in the simulator is not simulated again. Chosen by us, 16 ties
SURELY = 100.0


class Simulations:
    """A machine's recordings fitted anew with causes in the simulator; the same ones are simulated once."""

    def __init__(self, machine: Machine, had: Sequence[Named]) -> None:
        """had: effects that the model has already; they are in every simulation."""
        self.machine, self.had = machine, list(had)
        self.made: list[tuple[Sequence[Recording], list[tuple[object, ...]], list[Recording]]] = []
        self.lost: dict[tuple[str, str], float] = {}  # (cause, rival) -> by how much, in -2 log likelihood

    def again(self, recordings: Sequence[Recording], named: Sequence[Named], extended: Regression) -> list[Recording]:
        """The recordings with these causes; extended: the regression that has their coefficients."""
        causes = [*self.had, *named]
        wanted = [
            (each.effect.name, *each.shape.items(), *(extended.values[name] for name in each.coefficients))
            for each in causes
        ]
        for begun, had, made in self.made:
            if begun is recordings and had == wanted:
                return made
        made = held_out.simulated_again(self.machine, recordings, causes, extended)
        self.made.append((recordings, wanted, made))
        return made

    def decided(self, recordings: Sequence[Recording], found: Selection, fixed: Sequence[Named]) -> Selection:
        """The selection with the likeliest of each cause and its near rivals. fixed: causes that are in the base."""
        named = list(found.named)
        for place, each in enumerate(found.named):
            options = self._options(each, named, found, fixed)
            if len(options) == 1:
                continue
            scores = [
                self._score(recordings, option, [*named[:place], option, *named[place + 1 :]], found, fixed)
                for option in options
            ]
            order = sorted(range(len(options)), key=lambda number: scores[number])
            best, least = options[order[0]], scores[order[0]]
            if not math.isfinite(least):
                continue
            for option, score in zip(options, scores, strict=True):
                if score - least > SURELY:
                    self.lost[best.effect.name, option.effect.name] = score - least
            behind = {id(options[n].effect): scores[n] - least for n in order if math.isfinite(scores[n])}
            rivals = [(effect, behind.get(id(effect), far)) for effect, far in [(each.effect, 0.0), *each.rivals]
                      if effect is not best.effect]  # fmt: skip
            rivals.sort(key=lambda one: one[1])
            named[place] = dataclasses.replace(
                best,
                tied=[options[number].effect for number in order[1:] if scores[number] - least < naming.TIE],
                rivals=rivals,
            )
        if all(new is old for new, old in zip(named, found.named, strict=True)):
            return found
        return dataclasses.replace(
            found, named=named, with_named=naming.refit(found.base, named, [*fixed, *named]) if named else found.base
        )

    def _options(self, each: Named, named: Sequence[Named], found: Selection, fixed: Sequence[Named]) -> list[Named]:
        """The cause and its near rivals that have not lost to it yet."""
        close = [rival for rival, behind in each.rivals if behind < max(CLOSE * each.chi2, naming.TIE)][:MOST_CLOSE]
        others = [other for other in named if other.effect is not each.effect]
        close = [
            rival
            for rival in close
            if (each.effect.name, rival.name) not in self.lost and all(rival is not one.effect for one in others)
        ]
        if not close:
            return [each]
        base = naming.refit(found.base, others, [*fixed, *others])
        tried = (_at_best(rival, each, base) for rival in close)
        return [each, *(option for option in tried if option is not None)]

    def _score(
        self,
        recordings: Sequence[Recording],
        option: Named,
        together: Sequence[Named],
        found: Selection,
        fixed: Sequence[Named],
    ) -> float:
        """-2 log likelihood with a cause among the others, and what its coefficients cost; infinite where the simulator
        runs away."""
        extended = naming.refit(found.base, together, [*fixed, *together])
        try:
            simulated = self.again(recordings, together, extended)
        except (UserError, np.linalg.LinAlgError):
            return math.inf
        free = len(option.effect.coefficients) + (option.effect.choices > 1)
        surprise = sum(self.machine.surprise(one) for one in simulated)  # type: ignore[attr-defined]
        return float(surprise + free * math.log(found.base.size) + 2.0 * math.log(option.effect.choices))


def _at_best(effect: Effect, instead_of: Named, base: Regression) -> Named | None:
    """A rival as it would be named, at its best shape; None where a machine cannot have it so."""
    ranked = likelihood.ranking(naming.trials([effect], base), base.size)
    if not ranked or not naming.possible(ranked[0][3]):
        return None
    best = ranked[0]
    return dataclasses.replace(
        instead_of, effect=effect, shape=best[3].shape, chi2=best[1], freedom=best[2], bic=best[0]
    )
