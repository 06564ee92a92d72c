"""Judgement by held-out data: the named effects that they refuse, and the gain of the others there."""

import dataclasses
import math
from collections.abc import Sequence

from ranger_sim.sysid import gain, misfit, naming
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.machine import Machine, Recording
from ranger_sim.sysid.naming import Named
from ranger_sim.sysid.regression import Regression
from ranger_sim.sysid.results import Gain

HOLDS_OUT = 0.0  # chi-square that a further effect must gain on held-out data
REFUSES = 2.33  # deviations, 1 % on one side, below the expected gain: held-out data that refuse an effect
TELLS = 9.0  # chi-square of an effect on held-out data, three deviations: below it these data do not judge the effect


@dataclasses.dataclass(frozen=True)
class Held:
    """gain: of the effects not refused; `tells`: False where the data excite none of them and judge nothing."""

    gain: gain.Gain | None
    holdout: str
    refused: list[Named]
    tells: bool

    @property
    def result(self) -> Gain | None:
        """The gain of the result; None where none was measured."""
        if self.gain is None or not self.tells:
            return None
        return Gain(self.gain.fraction, self.gain.ci95, self.holdout, self.gain.worse)


def judged(
    machine: Machine,
    plain: Regression,
    extended: Regression,
    holdout: Sequence[Table],
    skews: Sequence[Named],
    named: Sequence[Named],
    seed: int,
) -> Held:
    """Judgement of held-out recordings on effects that were found without them."""
    recordings = [machine.prepare(table) for table in holdout]
    if named and hasattr(machine, "again"):
        recordings = simulated_again(machine, recordings, named, extended, fixed=True)
    general = misfit.general_features(machine, recordings)
    base = naming.refit(Regression(recordings, noise=plain), skews, values=plain.values)
    kept: list[Named] = []
    refused: list[Named] = []
    found, tells = None, False
    for each in named:
        tried = gain.measure(base, [*kept, each], extended.values, general, seed)
        won = tried.chi2_won - (found.chi2_won if found is not None else 0.0)
        # an effect as strong as in training would gain about the expected value, within twice its root either way
        expected = tried.chi2_expected
        if won > HOLDS_OUT or won > expected - REFUSES * 2.0 * math.sqrt(expected):
            kept, found = [*kept, each], tried
            tells = tells or expected >= TELLS
        else:
            refused.append(each)
    return Held(found, ", ".join(table.name for table in holdout), refused, found is None or tells)


def simulated_again(
    machine: Machine,
    recordings: Sequence[Recording],
    named: Sequence[Named],
    extended: Regression,
    fixed: bool = False,
) -> list[Recording]:
    """The recordings of a machine given by its simulator, with the named effects in the simulation."""
    acting = [(each.effect, each.shape, [extended.values[name] for name in each.coefficients]) for each in named]
    return [machine.again(recording, acting, fixed) for recording in recordings]  # type: ignore[attr-defined]
