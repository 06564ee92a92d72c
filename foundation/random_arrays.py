"""Seeded random numbers in arrays, for statistics: the only module that creates numpy generators.

A simulation draws from `random_stream`, whose numbers never change with platform or version; numpy guarantees that for
its bits, but not for its distributions.
"""

import numpy as np

from ranger_sim.foundation.random_stream import stream_key


def generator(seed: int, name: str) -> np.random.Generator:
    """A separate generator for each seed and name."""
    return np.random.Generator(np.random.PCG64(stream_key(seed, name)))
