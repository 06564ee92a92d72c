"""Where something unknown enters a simulated machine: the port at which a noise explains best what is left.

An unknown torque moves an angle; an unknown voltage moves the angle through the current, and the current itself. Which
output shows the most says little of it: a strong winding hides in the current what a light leg shows in its angle.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.free_simulation.fit import AWAY
from ranger_sim.sysid.free_simulation.linearised import LinearisedRecording
from ranger_sim.sysid.free_simulation.predictor import Predictor
from ranger_sim.sysid.free_simulation.terms import Port
from ranger_sim.sysid.machine import PARAMETER

SIZES = (1.0, 6.0, 36.0)  # of the noise, in units of what doubles the errors' variance
ALIKE = 10.0  # of -2 log likelihood: ports by so much less likely than the best one are alike. Chosen by us


def subsystem(recordings: Sequence[LinearisedRecording]) -> str:
    """Of the likeliest port; of those that are alike, of the first one: the machine's own are in front."""
    ports = places(recordings[0])
    scores = np.sum([surprises(recording) for recording in recordings], axis=0)
    return ports[int(np.flatnonzero(scores <= np.min(scores) + ALIKE)[0])].subsystem


def places(recording: LinearisedRecording) -> list[Port]:
    """Ports but those of parameters: what enters at one of these enters where the parameter acts."""
    return [each for each in recording.ports if each.subsystem != PARAMETER]


def surprises(recording: LinearisedRecording) -> list[float]:
    """-2 log likelihood by port, up to a constant, with a noise of the likeliest size there."""
    found: list[float] = []
    forcings: list[tuple[Array, Array]] = []
    ones = np.ones(len(recording.table))
    for port in places(recording):
        forcing = recording.fit.simulator.forcing(recording.linear, recording.entering({port.name: ones}))
        same = (
            score
            for score, other in zip(found, forcings, strict=True)
            if all(np.array_equal(*each) for each in zip(forcing, other, strict=True))
        )
        score = next(same, None)
        found.append(least(recording, *forcing) if score is None else score)
        forcings.append(forcing)
    return found


def least(recording: LinearisedRecording, state: Array, output: Array) -> float:
    """That with a noise of the likeliest size which enters so. state: (n, s, 1), output: (n, o, 1)."""
    random = generator(0, "where it enters").normal(size=(len(recording.table), 1, 1))
    shown = recording.predictor.white(recording.predictor.errors(state * random, output * random))
    power = float(np.mean((shown / recording.predictor.unit[None, :, None]) ** 2))
    if not power > 0.0:
        return np.inf
    found = [surprise(recording, state, output, size / np.sqrt(power)) for size in SIZES]
    return min((each for each in found if np.isfinite(each)), default=np.inf)


def surprise(recording: LinearisedRecording, state: Array, output: Array, size: float) -> float:
    """That with a noise of this size; the parameters move with it. NaN where the predictor has no numbers."""
    fit, lin = recording.fit, recording.linear
    noisy = dataclasses.replace(
        lin, f_u=np.concatenate((lin.f_u, state), axis=2), h_u=np.concatenate((lin.h_u, output), axis=2)
    )
    try:
        wide = Predictor(noisy, np.append(fit.noise_u, size), fit.open_outputs(), fit.open_steps(), fit.starts,
                         AWAY * fit.size_x, recording.predictor)  # fmt: skip
    except np.linalg.LinAlgError:
        return np.nan
    missed = np.concatenate((fit.state[:, :, None], lin.f_p), axis=2)
    shown = np.concatenate((fit.output[:, :, None], lin.h_p), axis=2)
    left = wide.left(missed, shown).reshape(-1)
    return float(left @ left) + wide.surprise_of_spread
