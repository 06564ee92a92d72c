"""What a machine must tell to be diagnosed: its channels, its equations, and what could be wrong with it.

The diagnosis knows no machine. One is an object with the members of `Machine`; those of this room stand in
`machines/`, a user's own comes by `module:object`. An equation is a balance, linear in its parameters:

    response = sum over parameters of value x column + noise

and the same name in two equations is the same parameter. An `Effect` is a cause that adds columns of its own to one
or more equations: one for each of its coefficients, with shapes (a speed, a number of periods, a lag) from a grid.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import numpy as np

from ranger_sim.sysid.dataset import Array, Finding, Table

DRIVING = ("command", "cmd", "target", "reference", "setpoint", "input")  # words in the names of inputs

Values = Mapping[str, float]
Columns = dict[str, Array]  # by equation, each of shape (n, k): k coefficients


@dataclasses.dataclass(frozen=True)
class Quantity:
    """A channel that the machine knows. `needed`: without it there is no diagnosis.

    drives: True for what drives the machine, whose values are never repaired without being asked; where nothing is
    said, a voltage is such a channel, and what is called a command, target, reference or setpoint.
    """

    name: str
    unit: str
    meaning: str
    needed: bool = True
    drives: bool | None = None

    @property
    def is_input(self) -> bool:
        """True for what drives the machine."""
        if self.drives is not None:
            return self.drives
        return self.unit == "V" or any(word in DRIVING for word in self.name.lower().split("_"))


@dataclasses.dataclass(frozen=True)
class Known:
    """A parameter of the equations: value as the simulation has it, and limits beyond which no machine is."""

    name: str
    unit: str
    value: float
    low: float
    high: float
    meaning: str


@dataclasses.dataclass(frozen=True)
class Equation:
    """One balance over one recording. response: (n,); columns: (n,) by parameter; valid: (n,), rows that count.

    The columns are what was measured, noise and all. stand_ins: for a parameter, a column (n,) that moves as its own
    does and has no noise in common with any measurement of this equation; fits and tests go against these
    (instrumental variables), for a noisy column would leave its shadow in the residual. lines: whether a line in the
    residual's spectrum says anything; a counter's steps beat with the samples. few: rows below which it is told that
    next to nothing is said of the equation, where they are also a small part of the recording.
    """

    name: str
    letter: str  # balance of the catalogue: E, M, T, S, P, t
    subsystem: str
    unit: str
    response: Array
    columns: dict[str, Array]
    valid: np.ndarray
    stand_ins: dict[str, Array] = dataclasses.field(default_factory=dict)
    lines: bool = True
    few: int = 50


@dataclasses.dataclass(frozen=True)
class Entry:
    """A place where something unknown may enter and pass through the machine's dynamics before an equation sees it.

    respond: columns (n, k) there -> columns (n, k) of the equations, to first order.
    """

    subsystem: str
    respond: Callable[[Array], Columns]


@dataclasses.dataclass
class Recording:
    """A table made ready: even stamps, the machine's derived signals (n,) by name, its equations."""

    table: Table
    signals: dict[str, Array]
    equations: dict[str, Equation]
    regimes: dict[str, np.ndarray] = dataclasses.field(default_factory=dict)
    width: float = 0.0  # samples; standard deviation of the Gaussian that is still to be put over both sides
    every: int = 1  # rows that count after it: one in so many
    # False where what the equations miss is far above the noise: whitening it would weigh frequencies by what is
    # wrong. Then fits are plain least squares, and only the count of samples is that of independent ones.
    whitened: bool = True
    noise_above: float = (
        0.0  # part of the kept rows' frequency above which the machine moves no more: noise is found there
    )
    memory: float = 0.99  # largest autocorrelation from row to row that is taken for noise's, and not for an effect's
    # by equation, (n,) whole numbers: rows of one number are repeats of each other, as the strides of a walk are; -1: a
    # row without repeats. Noise is then what differs between repeats (pure error), however much the model misses.
    repeats: dict[str, np.ndarray] = dataclasses.field(default_factory=dict)
    floors: dict[str, float] = dataclasses.field(default_factory=dict)  # by equation: least deviation that noise has
    # parameter -> (value, standard deviation) of sound machines: as good as a measurement of it
    priors: dict[str, tuple[float, float]] = dataclasses.field(default_factory=dict)
    lags: tuple[int, ...] = (0, 10, 30, 100)  # samples back at which the general tests look at slopes
    findings: list[Finding] = dataclasses.field(default_factory=list)  # what the machine noticed about the data
    left_over: bool = False  # responses are what a simulation leaves over, not what was measured
    entries: dict[str, Entry] = dataclasses.field(default_factory=dict)  # none where equations are instantaneous


@dataclasses.dataclass(frozen=True)
class Effect:
    """A cause that may be at work. columns(recording, shape, values) -> for some equations (n, k) columns.

    cause, at: identifier of the catalogue and the place. coefficients: names of the k linear parameters, with units in
    their names. shapes: the grid. values: the machine's parameters as fitted without the effect. admissible: of the
    found parameters (coefficients and shape), False for what no machine can have.
    """

    cause: str
    at: str
    subsystem: str
    coefficients: tuple[str, ...]
    shapes: Sequence[Mapping[str, float]]
    columns: Callable[[Recording, Mapping[str, float], Values], Columns]
    admissible: Callable[[Mapping[str, float]], bool] = lambda found: True
    meaning: str = ""
    form: str = ""  # of several forms of one cause at one place: only one of them is named, the others may be its ties
    scale: str | None = None  # a shape between whose values others are possible, all above 0: it is refined
    free: tuple[str, ...] = ()  # coefficients that another run does not share, as what was left from before it
    phase_is_free: bool = (
        False  # pairs of coefficients, cosine and sine, of an angle whose zero another run does not share
    )

    @property
    def name(self) -> str:
        return f"{self.cause} at {self.at}" + (f" ({self.form})" if self.form else "")

    def excludes(self, other: "Effect") -> bool:
        """True when both cannot be named: the same effect, or another form of it."""
        same = (self.cause, self.at) == (other.cause, other.at)
        return self is other or (same and bool(self.form) and bool(other.form))


class Machine(Protocol):
    """What can be diagnosed.

    A machine may have more: `table(dataset, names)`, a time base of its own for channels that come at rates of their
    own; `labels`, {signal: how the report calls it on an axis}; `gear`, of its gearbox, and `motor`, which of the
    simulator's motors is measured (plant/terms.py), for the model file; `again(recording, [(effect, shape,
    coefficients)], fixed)`, the recording with these effects in its simulation, and `free(recording)`, its equations as
    errors of free simulation (sysid/free_simulation.py has both).
    """

    name: str
    quantities: tuple[Quantity, ...]
    parameters: tuple[Known, ...]

    def prepare(self, table: Table) -> Recording:
        """Signals and equations of one recording; UserError when a needed channel is missing."""

    def effects(self, recordings: Sequence[Recording]) -> list[Effect]:
        """Everything that could be wrong, with grids that suit these recordings."""

    def generic(self, recording: Recording) -> dict[str, dict[str, Array]]:
        """The signals over which a misfit is looked for without any cause in mind, by name (n,).

        For each equation, or for an entry of the recordings: then what depends on the signals goes through it.
        """
