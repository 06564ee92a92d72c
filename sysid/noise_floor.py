"""The noise floor: what an equation leaves, next to the noise that its channels have without any model.

A model in which nothing was found is sound only where it leaves no more than that. The noise is a lower bound: what
departs from a parabola over a tenth of a second, what differs between repeats, or what is above the machine's motion;
of a free simulation, what the noise of inputs and sensors leaves of it.
"""

import math
from collections.abc import Mapping

import numpy as np
from scipy.signal import lfilter

from ranger_sim.sysid import signals
from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.machine import Recording
from ranger_sim.sysid.regression import Regression, autoregression_above
from ranger_sim.sysid.results import NoiseFloor

FAR = 3.5  # times the noise of the channel itself: a residual above it is not at the noise floor
# Of what was measured: a smaller error in free simulation or on held-out data may be the integrator's. Chosen by us
LARGE = 0.05
FAST = 0.25  # of the rows' frequency: machines move below that. Chosen by us
SETTLE = 2000  # samples, longer than the memory of any noise here


def far(floor: NoiseFloor) -> bool:
    """True for an equation that leaves far more than its channels' noise."""
    return floor.left > FAR * floor.channel


def by_channels(
    regression: Regression, sizes: Mapping[str, float] | None = None, held_out: bool = False
) -> dict[str, NoiseFloor]:
    """By equation, in its band. sizes: of what was measured; an error below a part of it is at the floor."""
    found = {}
    for name, (left, residual) in _left(regression).items():
        own = [_own(each, name) for each in regression.recordings if name in each.equations]
        noise = float(np.sqrt(np.mean(np.square(own))))
        if any(name not in each.own_noise for each in regression.recordings):
            noise = max(noise, _of_fast_part(regression, name, residual))
        if sizes is not None and left < LARGE * sizes[name]:
            noise = max(noise, left)
        found[name] = NoiseFloor(left, noise, _unit(regression, name), held_out)
    return found


def by_band_or_repeats(regression: Regression, held_out: bool = False) -> dict[str, NoiseFloor]:
    """By equation whose noise is known from repeats, or from above the machine's motion."""
    found = {}
    above = max(each.noise_above for each in regression.recordings)
    for name, (left, residual) in _left(regression).items():
        part = regression.parts[name]
        error, freedom = part.pure_error(residual)
        if freedom:
            noise = math.sqrt(float(error @ error) / freedom)
        elif above:
            noise = _of_fast_part(regression, name, residual, above)
        else:
            continue
        floor = max(each.floors.get(name, 0.0) for each in regression.recordings)
        found[name] = NoiseFloor(left, math.hypot(noise, floor), _unit(regression, name), held_out)
    return found


def farther(one: Mapping[str, NoiseFloor], other: Mapping[str, NoiseFloor]) -> dict[str, NoiseFloor]:
    """By equation the one that is more times above its noise."""
    out = dict(one)
    for name, floor in other.items():
        if name not in out or floor.left * out[name].channel > out[name].left * floor.channel:
            out[name] = floor
    return out


def _left(regression: Regression) -> dict[str, tuple[float, Array]]:
    """By equation (rms over the rows that count, residual (n,) not whitened)."""
    values = np.array([regression.values[each] for each in regression.names])
    out = {}
    for name, part in regression.parts.items():
        residual, good = part.response - part.measured @ values, regression.good[name]
        if np.any(good):
            out[name] = (float(np.sqrt(np.mean(residual[good] ** 2))), residual)
    return out


def _of_fast_part(regression: Regression, name: str, residual: Array, above: float = FAST) -> float:
    """Noise that a residual's part above this share of the rows' frequency is of, with a memory that it may have.

    The response alone does not show it: the noise of what is differentiated is in the columns, and that of a slow
    sensor has a memory.
    """
    first, part = regression.recordings[0], regression.parts[name]
    memory, deviation = autoregression_above(residual, part.valid & ~part.starts, above, first.width, first.every)
    impulse = lfilter([1.0], np.concatenate(([1.0], -memory)), np.eye(1, SETTLE)[0])
    return deviation * float(np.linalg.norm(impulse))


def _own(recording: Recording, name: str) -> float:
    """Noise of what an equation responds with, in the recording's band."""
    if name in recording.own_noise:
        return recording.own_noise[name]
    alone = signals.roughness(recording.table, recording.equations[name].response)
    return alone / math.sqrt(max(1.0, 2.0 * recording.width * math.sqrt(math.pi)))


def _unit(regression: Regression, name: str) -> str:
    return next(each.equations[name].unit for each in regression.recordings if name in each.equations)
