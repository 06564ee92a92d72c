"""One data set with what is hidden in it, before it is written."""

import dataclasses


@dataclasses.dataclass
class Case:
    """kind: single, null, pair, outside or confusable; effects: [(name, strength)], the rest in the same order."""

    number: int
    kind: str
    variant: str = ""
    effects: list = dataclasses.field(default_factory=list)
    shapes: list = dataclasses.field(default_factory=list)
    signs: list = dataclasses.field(default_factory=list)
    amplitudes: list = dataclasses.field(default_factory=list)
    base: dict = dataclasses.field(default_factory=dict)
    instruments: object = None
    runs: list = dataclasses.field(default_factory=list)
    supplies_V: list = dataclasses.field(default_factory=list)  # of the runs
    poor: bool = False  # a poor experiment, in which causes cannot be told apart
    reached: list = dataclasses.field(default_factory=list)  # (r, N_eff, strength) of each effect, where simulated
