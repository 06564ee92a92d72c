"""The interface of a machine that can be diagnosed: its channels, its equations, and its possible faults.

The diagnosis knows no particular machine. A machine is an object with the members of `Machine`; this package's own are
in `machines/`, a user's is given as `module:object`. An equation is a balance, linear in its parameters:

    response = sum over parameters of value x column + noise

and the same name in two equations is the same parameter. An `Effect` is a cause that adds its own columns to one
or more equations: one for each of its coefficients, with shapes (a speed, a number of periods, a lag) from a grid.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from ranger_sim.foundation.user_error import ModelError
from ranger_sim.sysid.dataset import Array, Finding, Table

DRIVING = ("command", "cmd", "target", "reference", "setpoint", "input")  # words in the names of inputs

PARAMETER = "parameter"  # subsystem of a parameter that does not stay as it is
LAGS = ("sensor_lag", "input_lag")  # causes that may be stamps, or a part of how an input goes between its rows

Values = Mapping[str, float]
Columns = dict[str, Array]  # by equation, each of shape (n, k): k coefficients


@dataclasses.dataclass(frozen=True)
class Quantity:
    """A channel that the machine knows. `needed`: without it there is no diagnosis.

    drives: True for an input of the machine, whose values are repaired only on request; when not set, a voltage is an
    input, and so is anything named command, target, reference or setpoint, but for the outputs of a simulated machine.
    """

    name: str
    unit: str
    meaning: str
    needed: bool = True
    drives: bool | None = None

    @property
    def is_input(self) -> bool:
        """True for an input of the machine."""
        if self.drives is not None:
            return self.drives
        return self.unit == "V" or any(word in DRIVING for word in self.name.lower().split("_"))


def inputs_of(machine: "Machine") -> set[str]:
    """Names of the channels that drive the machine: not those of its outputs, unless their quantity says so."""
    outputs = simulated_outputs(machine)
    return {each.name for each in machine.quantities if each.is_input and (each.drives or each.name not in outputs)}


def simulated_outputs(machine: "Machine") -> set[str]:
    """Names of the channels that a simulator shows; none of a machine without one."""
    return {each.channel for each in getattr(machine, "outputs", ())}


@dataclasses.dataclass(frozen=True)
class Known:
    """A parameter of the equations: value as the simulation has it, and limits that no machine exceeds."""

    name: str
    unit: str
    value: float
    low: float
    high: float
    meaning: str


@dataclasses.dataclass(frozen=True)
class Equation:
    """One balance over one recording. response: (n,); columns: (n,) by parameter; valid: (n,), rows that count.

    The columns are measured, noise included. stand_ins: for a parameter, a column (n,) that moves as the parameter's
    own does and shares no noise with any measurement of this equation; fits and tests go against these (instrumental
    variables), because a noisy column would bias the residual. lines: whether a line in the residual's spectrum means
    anything; a counter's steps beat with the samples. few: with fewer rows, which are also a small part of the
    recording, the report says that the equation says next to nothing.
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
    """A point where something unknown may enter and pass through the machine's dynamics before it reaches an equation.

    respond: columns (n, k) at the entry -> columns (n, k) of the equations, to first order.
    """

    subsystem: str
    respond: Callable[[Array], Columns]


@dataclasses.dataclass
class Recording:
    """A prepared table: even stamps, the machine's derived signals (n,) by name, its equations."""

    table: Table
    signals: dict[str, Array]
    equations: dict[str, Equation]
    regimes: dict[str, np.ndarray] = dataclasses.field(default_factory=dict)
    width: float = 0.0  # samples; standard deviation of the Gaussian still to be applied to both sides
    every: int = 1  # rows that count after it: every n-th
    # False where the equations' errors are far above the noise: whitening would weight frequencies by the model's
    # error. Then fits are plain least squares, and only the count of samples is that of independent ones.
    whitened: bool = True
    noise_above: float = (
        0.0  # part of the kept rows' frequency above which the machine does not move: the noise is estimated there
    )
    memory: float = 0.99  # largest autocorrelation from row to row that counts as noise's, and not as an effect's
    # by equation, (n,) whole numbers: rows of one number are repeats of each other, as the strides of a walk are; -1: a
    # row without repeats. Noise is then the difference between repeats (pure error), however large the model's error.
    repeats: dict[str, np.ndarray] = dataclasses.field(default_factory=dict)
    floors: dict[str, float] = dataclasses.field(default_factory=dict)  # by equation: least deviation of the noise
    # parameter -> (value, standard deviation) of sound machines: equivalent to a measurement of it
    priors: dict[str, tuple[float, float]] = dataclasses.field(default_factory=dict)
    # parameters that are only a part of what they are named for, beside an effect that acts in the simulation
    in_part: tuple[str, ...] = ()
    lags: tuple[int, ...] = (0, 10, 30, 100)  # samples back at which the general tests use slopes
    own_noise: dict[str, float] = dataclasses.field(default_factory=dict)  # by equation that does not show it
    findings: list[Finding] = dataclasses.field(default_factory=list)  # the machine's own findings about the data
    # True: noise is what all candidates leave (sysid/by_candidates.py). False, for an ankle and a walk: it is estimated
    # from repeats or above the machine's band, and general tests are chi-squares over cells of the signals
    noise_by_candidates: bool = True
    # True where rows about corners (standstill, reversals, jumps) do not count and columns have stand-ins: what goes
    # with the signals is an error then. Elsewhere a corner between two samples, of a friction that sticks, is as well
    firm: bool = False
    between_rows: dict[str, str] = dataclasses.field(default_factory=dict)  # by input of a simulator, in words
    left_over: bool = False  # responses are a simulation's errors, not measurements
    entries: dict[str, Entry] = dataclasses.field(default_factory=dict)  # none where equations are instantaneous
    # by equation, width and every: weights of the rows in each kept one, as the regression has made them once
    averages: dict[tuple[str, float, int], Any] = dataclasses.field(default_factory=dict, init=False, repr=False)


class NoEquationError(ModelError):
    """No equation of the machine can be made of a recording."""


@dataclasses.dataclass(frozen=True)
class Effect:
    """A cause that may be present. columns(recording, shape, values) -> for some equations (n, k) columns.

    cause, at: identifier of the catalogue and the place. coefficients: names of the k linear parameters, with units in
    their names. shapes: the grid. values: the machine's parameters as fitted without the effect. admissible: of the
    found parameters (coefficients and shape), False for values that no machine can have.
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
    forms: int = 1  # of this cause at this place, of which the best is taken: it counts as a shape on a grid does
    scale: str | None = None  # a shape, above 0, that may also lie between the grid's values: it is refined
    # as `admissible`, of a whole answer: on the way to it a friction of the wrong sign may lead to the right causes
    real: Callable[[Mapping[str, float]], bool] = lambda found: True
    equals: str | None = None  # a shape beyond whose smallest value the coefficient is the shape itself, as a lag is
    free: tuple[str, ...] = ()  # coefficients that another run does not share, as the state before it
    once: bool = False  # it happens in one run, at its own time: another run may lack it, and does not judge it
    phase_is_free: bool = (
        False  # pairs of coefficients, cosine and sine, of an angle whose zero another run does not share
    )

    @property
    def choices(self) -> int:
        """Shapes and forms of which the best is taken."""
        return len(self.shapes) * self.forms

    @property
    def name(self) -> str:
        return f"{self.cause} at {self.at}" + (f" ({self.form})" if self.form else "")

    def excludes(self, other: "Effect") -> bool:
        """True when only one of them can be named: the same effect, or another form of it."""
        same = (self.cause, self.at) == (other.cause, other.at)
        return self is other or (same and bool(self.form or other.form))


class Machine(Protocol):
    """A machine that can be diagnosed.

    A machine may have more: `table(dataset, names)`, a time base for channels at different rates; `labels`, {signal:
    its label on the report's axes}; `gear`, of its gearbox, and `motor`, the name of the measured motor in the
    simulator (plant/terms.py), for the model file; `again(recording, [(effect, shape, coefficients)], fixed)`, the
    recording with these effects in its simulation, and `free(recording)`, its equations as errors of free simulation
    (sysid/free_simulation has both).
    """

    name: str
    quantities: tuple[Quantity, ...]
    parameters: tuple[Known, ...]

    def prepare(self, table: Table) -> Recording:
        """Signals and equations of one recording; UserError when a needed channel is missing."""

    def effects(self, recordings: Sequence[Recording]) -> list[Effect]:
        """All candidate causes, with grids that suit these recordings."""

    def generic(self, recording: Recording) -> dict[str, dict[str, Array]]:
        """The signals over which a misfit is sought without any cause in mind, by name (n,).

        For each equation, or for an entry of the recordings: then columns over the signals go through it.
        """
