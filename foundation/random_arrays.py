"""Seeded random numbers in arrays, for statistics: the one place that makes numpy's generators.

A simulation draws from `random_stream`, whose numbers are the same everywhere and for ever; numpy promises that for
its bits but not for its distributions from one version to another.
"""

import numpy as np

from ranger_sim.foundation.random_stream import stream_key


def generator(seed: int, name: str) -> np.random.Generator:
    """A generator of its own for each seed and name."""
    return np.random.Generator(np.random.PCG64(stream_key(seed, name)))
