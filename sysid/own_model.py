"""Check of a user's own simulator before any verdict: what these recordings determine, limits, and its own steps."""

import itertools
from collections.abc import Sequence

import numpy as np

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.dataset import Finding
from ranger_sim.sysid.free_simulation import numerical_floor
from ranger_sim.sysid.free_simulation.fit import TrajectoryFit
from ranger_sim.sysid.machine import Machine, Recording
from ranger_sim.sysid.regression import Regression

RANK = 1e-5  # of the largest singular value: derivatives by differences are right to a part in a million
IN_IT = 0.1  # of the direction that nothing determines: a smaller part is not of it
ALIKE = 0.95  # correlation of two estimates above which only a combination of them is known
COARSE = 0.15  # of an output's noise: 2 % of its square, which an alarm needs
TOO_COARSE = 1.0  # the same, from which on no cause is named


def determined(machine: Machine, regression: Regression) -> list[Finding]:
    """Pairs of parameters of which little more than a combination is known. UserError where some are undetermined."""
    own = [known.name for known in machine.parameters if known.name in regression.names]
    columns = regression.measured[:, [regression.names.index(name) for name in own]]
    length = np.linalg.norm(columns, axis=0)
    moving = length > 0.0
    names = [name for name, moves in zip(own, moving, strict=True) if moves]
    if not names:
        return []
    _, sizes, directions = np.linalg.svd(columns[:, moving] / length[moving], full_matrices=False)
    rank = int(np.count_nonzero(sizes > RANK * sizes[0]))
    if rank < len(names):
        part = np.max(np.abs(directions[rank:]), axis=0)
        mixed = [name for name, each in zip(names, part, strict=True) if each > IN_IT]
        raise UserError(
            f"{machine.name}: {', '.join(mixed)} cannot be determined together: a change of all of them leaves every "
            f"output of {', '.join(each.table.name for each in regression.recordings)} as it is. Take one of them as "
            "known (a weight, a measured inertia), or record an output that shows it"
        )
    inverse = (directions.T / sizes**2) @ directions
    scale = np.sqrt(np.diag(inverse))
    found = []
    for one, other in itertools.combinations(range(len(names)), 2):
        alike = float(inverse[one, other] / (scale[one] * scale[other]))
        if abs(alike) > ALIKE:
            text = f"it and {names[other]} are known together only (correlation {alike:.3f}): neither is sure alone"
            found.append(Finding(names[one], "correlated", 0.0, 0.0, alike, "", text, "note"))
    return found


def limits(machine: Machine, fit: TrajectoryFit) -> list[Finding]:
    """Parameters that a fit left at a limit other than 0, with that limit."""
    found = []
    for known, value in zip(machine.parameters, fit.p_at, strict=False):
        for limit in (known.low, known.high):
            if limit and abs(value - limit) <= 1e-9 * abs(limit):
                text = (
                    f"the fit ends at its limit of {limit:g} {known.unit}: widen the limit where the machine can have "
                    "more, otherwise the model lacks something"
                )
                found.append(Finding(known.name, "at_limit", 0.0, 0.0, float(value), known.unit, text))
    return found


def steps(fit: TrajectoryFit) -> list[Finding]:
    """Outputs whose prediction the simulator's own steps move by a part of their noise; steps of a sixteenth."""
    found = []
    for each, size in zip(fit.machine.outputs, numerical_floor.by_finer_steps(fit).tolist(), strict=True):
        if size > COARSE:
            text = (
                f"steps of a sixteenth move the simulated {each.channel} by {size:.2g} of its noise from row to row: "
                f"a finding may be the simulator's own; take more than {fit.simulator.numerics.parts} `parts`"
            )
            kind = "too_coarse" if size > TOO_COARSE else "coarse"
            found.append(Finding(each.channel, kind, 0.0, 0.0, size, "", text))
    return found


def unmeasured(fit: TrajectoryFit) -> list[Finding]:
    """Outputs that lack measurements, with how many rows."""
    found = []
    for each, rows in zip(fit.machine.outputs, fit.unmeasured.T, strict=True):
        places = np.flatnonzero(rows)
        if len(places):
            first, last = (float(fit.table.time_s[place]) for place in (places[0], places[-1]))
            text = (
                f"{len(places)} of {len(rows)} rows have no measurement of it (cut off, or not a number): the "
                "simulator runs through them, and nothing is concluded from them"
            )
            found.append(Finding(each.channel, "unmeasured", first, last, float(len(places)), "rows", text, "note"))
    return found


def of(machine: Machine, recordings: Sequence[Recording], regression: Regression) -> list[Finding]:
    """All findings about a simulated machine as it is at the end of a diagnosis; none for another machine."""
    found: dict[tuple[str, str], Finding] = {}
    fits = [fit for each in recordings if (fit := getattr(each, "fit", None)) is not None]
    for fit in fits:
        for one in (*limits(machine, fit), *steps(fit), *unmeasured(fit)):
            found.setdefault((one.channel, one.kind), one)
    return [*found.values(), *(determined(machine, regression) if fits else [])]
