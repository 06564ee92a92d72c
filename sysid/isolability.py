"""Before any data: causes that given channels can show and separate, and changes that would separate the rest.

An experiment's linearised equations (`experiment_models.py`) answer two questions:

    structure   does a cause enter where there are more equations than unknowns, and does it still without the
                equation of another? Then they can be separated whatever their shape (`structure.py`).
    signature   the remainder of a cause's regressor after everything that is not measured and all fitted parameters
                have explained as much as they can; the cosine of two such remainders is their similarity in the
                reference motion. Above 0.95 they are a tie.

Causes in one equation look the same to the structure and may still differ in shape; causes in different equations
may still look alike once the parameters are fitted. A tie names its kind.
"""

import dataclasses
import functools
import itertools
from collections.abc import Iterable

import numpy as np
from scipy.sparse import csc_matrix, diags, hstack, vstack
from scipy.sparse.linalg import splu

from ranger_sim.foundation.user_error import UserError, unknown
from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.experiment_models import MODELS, SAMPLES, Equation, Model
from ranger_sim.sysid.structure import isolable, overdetermined

TIE = 0.95  # |cos|: beyond it, N_eff r^2 (1 - c^2) >= 16 needs ten times the data
TAKEN_UP = 0.05  # remainder of a signature: below it, the fitted parameters explain the rest
INVISIBLE = 1e-6  # remainder of a regressor that unknown signals explain entirely: rounding, and the ridge below
# Remainder where unknowns explain all but single times: their coefficient passes through zero there, as the swing
# foot's torque in the balance of the stance leg. The structure does not know about times.
AT_INSTANTS = 1e-3
RIDGE = 1e-12  # keeps unknowns that nothing determines from dividing by zero
ROUNDS = 5
SHOWN, AS_PARAMETER, HIDDEN = "shown", "as a parameter", "not shown"


@dataclasses.dataclass(frozen=True)
class Tie:
    """Two causes that these channels do not separate. reason: "structure" or "signature"; cosine: of the remainders."""

    first: str
    second: str
    reason: str
    cosine: float


@dataclasses.dataclass
class Analysis:
    """Abilities of an experiment's channels. status: {cause: SHOWN, AS_PARAMETER or HIDDEN}; left: {cause: part of the
    signature that no parameter explains}; by_structure: {cause: causes that structure separates from it}.
    """

    experiment: str
    channels: tuple[str, ...]
    status: dict[str, str]
    left: dict[str, float]
    by_structure: dict[str, set[str]]
    ties: list[Tie]

    def of(self, status: str) -> list[str]:
        """The causes of this status."""
        return [cause for cause, each in self.status.items() if each == status]

    def apart(self, first: str, second: str) -> bool:
        """True when these channels show both causes and separate them."""
        shown = all(self.status.get(cause, HIDDEN) != HIDDEN for cause in (first, second))
        return shown and not any({tie.first, tie.second} == {first, second} for tie in self.ties)


@dataclasses.dataclass(frozen=True)
class Advice:
    """Remedies. causes: a hidden one, or the two of a tie; channels of this experiment; other experiments;
    motion: another run of the same experiment, in words.
    """

    causes: tuple[str, ...]
    channels: tuple[str, ...]
    experiments: tuple[str, ...]
    motion: str = ""


# Remedies for two causes that look alike in one run, by the signals that their signatures depend on.
MOTIONS = {
    frozenset(("contact_drop_change", "dead_time")): "a run at another battery voltage, with which a dead time grows",
    frozenset(("coulomb_friction", "viscous_friction")): "a run at another speed",
    frozenset(("viscous_friction", "drag")): "a run at another speed",
    frozenset(("direction_friction", "once_per_turn")): "a run over a larger range of the angle",
    frozenset(("once_per_turn", "eccentricity")): "a slow run without load: only the torque remains without an encoder",
    frozenset(("once_per_turn", "sensor_offset@angle")): "a run over a larger range of the angle",
    frozenset(("sensor_offset@angle", "eccentricity")): "a run over a larger range of the angle",
    frozenset(("direction_friction", "sensor_offset@angle")): "a still reading at a known angle",
    frozenset(("firmware_parameter", "sensor_lag")): "a run at another speed, or the firmware's own log of its gains",
}


@functools.cache
def model_of(experiment: str) -> Model:
    """The equations of an experiment. UserError with all names for an unknown one."""
    if experiment not in MODELS:
        raise UserError(unknown("experiment", experiment, MODELS))
    return MODELS[experiment]()


def measured(model: Model, channels: Iterable[str] | None) -> tuple[str, ...]:
    """These channels in the model's order, all when None. UserError for one that the experiment does not have."""
    if channels is None:
        return model.channels
    given = list(channels)
    for channel in given:
        if channel not in model.channels:
            raise UserError(f"{model.name}: {unknown('channel', channel, model.channels)}")
    return tuple(channel for channel in model.channels if channel in given)


@functools.cache
def _analysed(experiment: str, channels: tuple[str, ...]) -> Analysis:
    model = model_of(experiment)
    equations = [each for each in model.equations if not each.channel or each.channel in channels]
    incidence = {each.name: frozenset(term[0] for term in each.terms) for each in equations}
    faults = {cause: [each.name for each in equations if cause in each.causes] for cause in model.causes}
    faults = {cause: where for cause, where in faults.items() if where}
    redundant = overdetermined(incidence)
    by_structure = isolable(incidence, faults)
    signatures = Signatures(equations, float(model.time_s[1]))
    status, left = {}, {}
    for cause in model.causes:
        where = faults.get(cause, [])
        raw = signatures.raw(cause)
        if raw <= (INVISIBLE if redundant & set(where) else AT_INSTANTS):
            status[cause], left[cause] = HIDDEN, 0.0
            continue
        left[cause] = signatures.left(cause)
        status[cause] = SHOWN if left[cause] > TAKEN_UP else AS_PARAMETER
    ties = []
    for first, second in itertools.combinations(model.causes, 2):
        if status[first] != status[second] or status[first] == HIDDEN:
            continue  # one of them is explained by parameters, the other is not
        cosine = signatures.cosine(first, second, fitted=status[first] == SHOWN)
        if cosine > TIE:
            told = second in by_structure.get(first, ()) or first in by_structure.get(second, ())
            ties.append(Tie(first, second, "signature" if told else "structure", cosine))
    return Analysis(experiment, channels, status, left, by_structure, ties)


def analyse(experiment: str, channels: Iterable[str] | None = None) -> Analysis:
    """Causes that these channels (all when None) of an experiment can show and separate."""
    return _analysed(experiment, measured(model_of(experiment), channels))


def advice(analysis: Analysis) -> list[Advice]:
    """For every hidden cause and every tie, the single channels and other experiments that would help."""
    model = model_of(analysis.experiment)
    missing = [channel for channel in model.channels if channel not in analysis.channels]
    more = {channel: analyse(analysis.experiment, (*analysis.channels, channel)) for channel in missing}
    others = {name: analyse(name) for name in MODELS if name != analysis.experiment}
    found = []
    for cause in analysis.of(HIDDEN):
        helping = tuple(name for name, each in more.items() if each.status[cause] != HIDDEN)
        elsewhere = tuple(name for name, each in others.items() if each.status.get(cause, HIDDEN) != HIDDEN)
        found.append(Advice((cause,), helping, elsewhere))
    for tie in analysis.ties:
        helping = tuple(name for name, each in more.items() if each.apart(tie.first, tie.second))
        elsewhere = tuple(name for name, each in others.items() if each.apart(tie.first, tie.second))
        motion = MOTIONS.get(frozenset((tie.first, tie.second)), "")
        found.append(Advice((tie.first, tie.second), helping, elsewhere, motion))
    return found


class Signatures:
    """Remainder of each cause's regressor behind unmeasured signals, and behind the fitted parameters."""

    def __init__(self, equations: list[Equation], step_s: float) -> None:
        unknowns = sorted({term[0] for each in equations for term in each.terms})
        self.place = {unknown: index for index, unknown in enumerate(unknowns)}
        self.equations = equations
        self.step_s = step_s
        rows = vstack([self._rows(each) for each in equations]).tocsc()
        sizes = np.sqrt(np.asarray(rows.multiply(rows).sum(axis=0)).ravel())
        self.matrix = (rows @ diags(1.0 / np.where(sizes > 0.0, sizes, 1.0))).tocsc()  # units of unknowns do not matter
        normal = self.matrix.T @ self.matrix
        self.solver = splu((normal + RIDGE * diags(np.ones(normal.shape[0]))).tocsc())
        names = list(dict.fromkeys(name for each in equations for name in each.parameters))
        self.tangent = self._basis([self._behind(self._column(name, "parameters")) for name in names])
        self.columns = {
            cause: self._column(cause, "causes")
            for cause in dict.fromkeys(cause for each in equations for cause in each.causes)
        }
        self.behind = {cause: self._behind(column) for cause, column in self.columns.items()}
        self.fitted = {
            cause: column - self.tangent @ (self.tangent.T @ column) for cause, column in self.behind.items()
        }

    def raw(self, cause: str) -> float:
        """The part of a cause's regressor that unknown signals do not explain; 0 for one that enters nowhere."""
        if cause not in self.columns:
            return 0.0
        size = float(np.linalg.norm(self.columns[cause]))
        return float(np.linalg.norm(self.behind[cause])) / size if size else 0.0

    def left(self, cause: str) -> float:
        """The part of it that fitted parameters do not explain."""
        size = float(np.linalg.norm(self.behind[cause]))
        return float(np.linalg.norm(self.fitted[cause])) / size if size else 0.0

    def cosine(self, first: str, second: str, fitted: bool = True) -> float:
        """Similarity of two signatures: |cos|, behind the fitted parameters or not."""
        of = self.fitted if fitted else self.behind
        a, b = of[first], of[second]
        size = float(np.linalg.norm(a) * np.linalg.norm(b))
        return abs(float(a @ b)) / size if size else 0.0

    def _rows(self, equation: Equation) -> csc_matrix:
        """An equation at every sample; one with a derivative between every two, by differences and means."""
        dynamic = any(order for _, _, order in equation.terms)
        count = SAMPLES - 1 if dynamic else SAMPLES
        rows = csc_matrix((count, SAMPLES * len(self.place)))
        for name, coefficient, order in equation.terms:
            weight = diags(coefficient) if not dynamic else _means() @ diags(coefficient)
            if order:
                weight = diags(0.5 * (coefficient[1:] + coefficient[:-1])) @ _differences() / self.step_s
            start = self.place[name] * SAMPLES
            left = csc_matrix((count, start))
            right = csc_matrix((count, SAMPLES * len(self.place) - start - SAMPLES))
            rows = rows + hstack([left, csc_matrix(weight), right]).tocsc()
        return rows / equation.sigma

    def _column(self, name: str, kind: str) -> Array:
        """A regressor in all rows, each in units of its equation's sigma."""
        parts = []
        for equation in self.equations:
            regressor = getattr(equation, kind).get(name)
            value = np.zeros(SAMPLES) if regressor is None else regressor
            if any(order for _, _, order in equation.terms):
                value = 0.5 * (value[1:] + value[:-1])
            parts.append(value / equation.sigma)
        return np.concatenate(parts)

    def _behind(self, column: Array) -> Array:
        """The part that unknown signals cannot explain; in rounds, because of the ridge and of rounding."""
        for _ in range(ROUNDS):
            column = column - self.matrix @ self.solver.solve(self.matrix.T @ column)
        return column

    @staticmethod
    def _basis(columns: list[Array]) -> Array:
        """An orthonormal basis of columns, without those in the span of the others."""
        sizes = [float(np.linalg.norm(column)) for column in columns]
        kept = [column / size for column, size in zip(columns, sizes, strict=True) if size > 0.0]
        if not kept:
            return np.zeros((len(columns[0]) if columns else 1, 0))
        u, s, _ = np.linalg.svd(np.column_stack(kept), full_matrices=False)
        return u[:, s > 1e-6 * s[0]]


@functools.cache
def _means() -> csc_matrix:
    return diags([0.5, 0.5], [0, 1], shape=(SAMPLES - 1, SAMPLES)).tocsc()


@functools.cache
def _differences() -> csc_matrix:
    """Differences of neighbours."""
    return diags([-1.0, 1.0], [0, 1], shape=(SAMPLES - 1, SAMPLES)).tocsc()
