"""Cells of the matrix: how a recording was made. Any two levels of two factors meet in at least one cell."""

import dataclasses
import itertools

FACTORS = {
    "machine": ("bench", "leg", "ankle", "positioning", "axis"),
    "sampling": ("point", "mean", "multiplexed", "held"),
    "rate_hz": (100, 250, 500, 1000),
    "drive": ("steps", "chirp", "multisine", "feedback"),
    "noise": ("white", "coloured", "quantised"),
    "standstill": ("smooth", "stick"),
}
LEAST = 48  # cells


@dataclasses.dataclass(frozen=True)
class Cell:
    machine: str
    sampling: str
    rate_hz: int
    drive: str
    noise: str
    standstill: str

    @property
    def name(self):
        return " ".join(map(str, dataclasses.astuple(self)))


def pairs(levels):
    """The pairs of (factor, level) in a tuple of levels."""
    return set(itertools.combinations(zip(FACTORS, levels, strict=True), 2))


def covering():
    """Cells by greed: next comes the combination with the most pairs that were met least often; LEAST of them, and as
    many of each machine as of any other but one."""
    everything = list(itertools.product(*FACTORS.values()))
    met = dict.fromkeys(itertools.chain.from_iterable(map(pairs, everything)), 0)
    chosen = []
    while len(chosen) < LEAST or not all(met.values()):
        machine = FACTORS["machine"][len(chosen) % len(FACTORS["machine"])]
        free = [each for each in everything if each[0] == machine and each not in chosen]
        best = max(free, key=lambda each: sum(4.0 ** -met[pair] for pair in pairs(each)))
        chosen.append(best)
        for pair in pairs(best):
            met[pair] += 1
    return tuple(Cell(*each) for each in chosen)


CELLS = covering()
