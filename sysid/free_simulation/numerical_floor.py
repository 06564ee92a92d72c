"""What other numerics, which a simulator could as well have, move the sizes of effects by."""

import copy
import dataclasses

import numpy as np

from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.free_simulation.fit import TrajectoryFit

ROUNDS = 4  # with other numerics, from the fit without them
NARROW = 0.25  # of what is open at standstill
OPEN = 1e-6  # of a state's size: a law that leaves less open is not open


def moved(fit: TrajectoryFit) -> Array:
    """(variants, coefficients): what the coefficients of what acts move by."""
    count = len(fit.simulator.names)
    out = []
    for other in _otherwise(fit):
        other.settle(ROUNDS)
        out.append(other.p[count:] - fit.p_at[count:])
    return np.array(out)


def _otherwise(fit: TrajectoryFit) -> list[TrajectoryFit]:
    """Fits that continue from here with other numerics: half the step; inputs on straight lines instead of cubics, or
    on straight lines instead of held where they seem to stay; a quarter of what is open at standstill."""
    now = fit.simulator.numerics
    variants = [dataclasses.replace(now, parts=2 * now.parts)]
    straight = dataclasses.replace(now, curved=frozenset(), held=now.held - fit.simulator.staying)
    if straight != now:
        variants.append(straight)
    if np.any(fit.loose() > OPEN * fit.size_x):
        variants.append(dataclasses.replace(now, open_share=NARROW))
    made = []
    for variant in variants:
        other = copy.copy(fit)
        other.simulator = fit.simulator.stepping(variant)
        made.append(other)
    return made
