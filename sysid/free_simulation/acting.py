"""Effects that act in a simulator: what they put into its ports, and how that depends on the states."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.free_simulation.recording import SimulatedRecording
from ranger_sim.sysid.free_simulation.terms import Acting
from ranger_sim.sysid.machine import Values

NUDGE = 1e-6  # of a state's size: step of a central difference


def entering(acting: Sequence[Acting], seen: SimulatedRecording, values: Values) -> Array:
    """(n, ports, coefficients): the effects' input at the ports, for a unit of each coefficient."""
    return np.concatenate([seen.entering(each.term.make(seen, each.shape, values)) for each in acting], axis=2)


def fed_back(
    acting: Sequence[Acting],
    seen: SimulatedRecording,
    values: Values,
    coefficients: Array,
    sizes: Mapping[str, float],
) -> Array:
    """(n, ports, states): what acts depends on the states, as gravity does on an angle; by differences.

    Only where it depends on the states of its own sample: what remembers is not fed back. sizes: of the states.
    """
    rows = len(seen.table)
    out = np.zeros((rows, len(seen.ports), len(sizes)))
    every_second = np.arange(rows) % 2 == 0
    first = 0
    for each in acting:
        own = coefficients[first : first + len(each.coefficients)]
        first += len(each.coefficients)

        def moved(name: str, by: Array, each: Acting = each, own: Array = own) -> Array:
            there = dataclasses.replace(seen, signals=seen.signals | {name: seen.signals[name] + by})
            return np.asarray(there.entering(each.term.make(there, each.shape, values)) @ own)

        for number, (name, size) in enumerate(sizes.items()):
            nudge = NUDGE * size
            up, down = moved(name, nudge * every_second), moved(name, -nudge * every_second)
            if np.array_equal(up[~every_second], down[~every_second]) and not np.array_equal(up, down):
                up, down = moved(name, np.full(rows, nudge)), moved(name, np.full(rows, -nudge))
                out[:, :, number] += (up - down) / (2.0 * nudge)
    return out
