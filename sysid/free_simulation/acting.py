"""Effects that act in a simulator: what they put into its ports, and how that depends on the states."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.free_simulation.recording import SimulatedRecording
from ranger_sim.sysid.free_simulation.terms import Acting, Term
from ranger_sim.sysid.machine import Values

NUDGE = 1e-6  # of a state's size: step of a central difference

SAME = 1e-6  # of what enters

Entering = dict[int, Array]  # by number of the port (n, k), for a unit of each of an effect's k coefficients


def entering(each: Acting, seen: SimulatedRecording, values: Values) -> Entering:
    """What an effect puts into the ports along a trajectory."""
    return seen.entering(each.term.make(seen, each.shape, values))


def before(each: Acting, seen: SimulatedRecording) -> list[Acting]:
    """What was there before the recording, where an effect remembers it; the numbers begin at 0."""
    remembered = each.term.before
    if remembered is None:
        return []
    count = next(iter(remembered(seen, each.shape).values())).shape[1]
    term = Term("", each.term.at, each.term.subsystem, (), lambda recording, shape, _: remembered(recording, shape))
    return [Acting(term, each.shape, (0.0,) * count, unknown=True)]


def total(enter: Sequence[Entering], coefficients: Sequence[Array], rows: int, ports: int) -> Array:
    """(rows, ports) of effects together."""
    out = np.zeros((rows, ports))
    for each, own in zip(enter, coefficients, strict=True):
        for number, column in each.items():
            out[:, number] += column @ own
    return out


def same(one: Entering, other: Entering) -> bool:
    """True where an effect puts the same into the ports, to a part of its size."""
    return one.keys() == other.keys() and all(
        np.max(np.abs(one[number] - other[number])) <= SAME * np.max(np.abs(one[number])) for number in one
    )


def fed_back(
    each: Acting, enter: Entering, seen: SimulatedRecording, values: Values, own: Array, sizes: Mapping[str, float]
) -> dict[tuple[int, str], Array]:
    """By port and state (n,): how what acts depends on the states, as gravity does on an angle; by differences.

    Only where it depends on the states of its own sample: what remembers is not fed back. own: its coefficients;
    sizes: of the states.
    """
    rows = len(seen.table)
    every_second = np.arange(rows) % 2 == 0
    now = total([enter], [own], rows, len(seen.ports))

    def moved(by: Mapping[str, Array | float]) -> Array:
        there = dataclasses.replace(seen, signals=seen.signals | {name: seen.signals[name] + by[name] for name in by})
        return total([entering(each, there, values)], [own], rows, len(seen.ports))

    out: dict[tuple[int, str], Array] = {}
    if np.array_equal(moved({name: NUDGE * size for name, size in sizes.items()}), now):
        return out
    for name, size in sizes.items():
        nudge = NUDGE * size
        up = moved({name: nudge * every_second})
        if np.array_equal(up, now) or not np.array_equal(up[~every_second], now[~every_second]):
            continue
        slope = (moved({name: nudge}) - moved({name: -nudge})) / (2.0 * nudge)
        out |= {(number, name): slope[:, number] for number in enter}
    return out
