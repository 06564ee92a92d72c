"""What `diagnose` and `identify` return: frozen values in SI units, named as in the JSON of the commands.

`to_dict()` gives that JSON as plain data. docs/diagnose-report.md and docs/identify.md describe the keys.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any

from ranger_sim.sysid.dataset import Finding, Repair

Interval = tuple[float, float]  # 95 %: its lower and upper end
OPTIONAL = {"optional": True}  # of a field that is left out of the plain data while it is None
NOT_DATA = {"plain": False}  # of a field that is not in the plain data


def plain(value: Any) -> Any:
    """A result as dictionaries, lists, numbers and texts."""
    if dataclasses.is_dataclass(value):
        found = {each.name: (getattr(value, each.name), each.metadata) for each in dataclasses.fields(value)}
        return {
            name: plain(each)
            for name, (each, metadata) in found.items()
            if metadata.get("plain", True) and not (each is None and metadata.get("optional"))
        }
    if isinstance(value, Mapping):
        return {name: plain(each) for name, each in value.items()}
    return [plain(each) for each in value] if isinstance(value, tuple | list) else value


@dataclasses.dataclass(frozen=True)
class Value:
    """An estimate with its 95 % interval."""

    value: float
    ci95: Interval


@dataclasses.dataclass(frozen=True)
class KnownValue:
    """A coefficient that the model had: in the model, and by these data."""

    model: float
    value: float
    ci95: Interval


@dataclasses.dataclass(frozen=True)
class ChannelMisfit:
    """Misfit of one equation in one regime. rms, noise: in the equation's unit; repeatable_fraction: 0 to 1."""

    channel: str
    regime: str
    rms: float
    noise: float
    repeatable_fraction: float


@dataclasses.dataclass(frozen=True)
class CauseEvidence:
    """Evidence for a cause. bic: gain of the information criterion; ties: effects that explain the data as well;
    behind: by rival, its deficit in the criterion; predicted: ties that the experiment's structure predicts;
    moved_by_numerics: by coefficient, the most by which other numerics of the simulator move it."""

    chi2: float
    p: float
    bic: float
    ties: tuple[str, ...]
    behind: Mapping[str, float]
    predicted: Mapping[str, Any] | None
    moved_by_numerics: Mapping[str, float] | None = dataclasses.field(default=None, metadata=OPTIONAL)


@dataclasses.dataclass(frozen=True)
class Cause:
    """A named cause of the catalogue. balance: letters of the equations in which it acts; form: of several forms of
    one cause, None where there is one only; parameters: by name, which carries the unit; waves: of what is periodic and
    given by cosine and sine, the amplitude, and the phase in radians at which it is largest."""

    name: str
    at: str
    form: str | None = dataclasses.field(metadata=OPTIONAL)
    balance: str
    parameters: Mapping[str, Value]
    tied_with: tuple[str, ...]
    evidence: CauseEvidence
    waves: Mapping[str, Value] | None = dataclasses.field(default=None, metadata=OPTIONAL)


@dataclasses.dataclass(frozen=True)
class KnownCause:
    """An effect that the given model has already: its coefficients in the model and by these data, and its shape."""

    name: str
    at: str
    parameters: Mapping[str, KnownValue]
    shape: Mapping[str, float]


@dataclasses.dataclass(frozen=True)
class Gain:
    """What the named causes gain on held-out data, of what can be gained there. worse: the model lost by them."""

    fraction_of_achievable: float
    ci95: Interval
    holdout: str
    worse: bool


@dataclasses.dataclass(frozen=True)
class HeldOutError:
    """Error of one equation on held-out data, as a share of what was measured: rms over the response's rms, or over a
    simulated channel's deviation. after: with the named causes; black_box: the least that a learned predictor leaves,
    with or without the physics; ratio95: interval of after over before by a bootstrap of blocks."""

    before: float
    after: float
    black_box: float | None
    ratio95: Interval


@dataclasses.dataclass(frozen=True)
class NoiseFloor:
    """left: rms of what an equation leaves; channel: its channels' own noise, a lower bound; both in `unit`. held_out:
    of the held-out data. Of a simulated machine one step ahead or in free simulation, whichever is farther above."""

    left: float
    channel: float
    unit: str
    held_out: bool


@dataclasses.dataclass(frozen=True)
class LearnedTerm:
    """A term without a cause: a table over one or two signals. domain: by signal; edges: by signal, the inner borders
    of its cells; value, deviation: rows of cells, in `unit`; holdout_rms: of the equation's residual on held-out data
    without and with the term."""

    equation: str
    unit: str
    over: tuple[str, ...]
    domain: tuple[Interval, ...]
    edges: tuple[tuple[float, ...], ...]
    value: tuple[tuple[float, ...], ...]
    deviation: tuple[tuple[float, ...], ...]
    holdout_rms: Interval | None = dataclasses.field(default=None, metadata=OPTIONAL)


@dataclasses.dataclass(frozen=True)
class RecordingFinding(Finding):
    """A finding about a recording."""

    recording: str = ""


@dataclasses.dataclass(frozen=True)
class RecordingRepair(Repair):
    """A repair of a recording."""

    recording: str = ""


@dataclasses.dataclass(frozen=True)
class WithoutForm:
    """A cause that the simulator has no term for, with the reason."""

    name: str
    at: str
    reason: str


@dataclasses.dataclass(frozen=True)
class TwinCause:
    """A cause by the comparison with emulated walks. gain: twice the log-likelihood that it gains."""

    name: str
    at: str
    parameters: Mapping[str, Value]
    gain: float


@dataclasses.dataclass(frozen=True)
class TwinsEvidence:
    """A walk compared with its twins, emulated walks of sound robots and of robots with one cause each.

    controller: whose twins; rate: "full", "link" (50 Hz) or "few" (hip and leg angle alone); steps: that counted;
    since_step:
    the first step with the cause, 0 for all; distance: from sound walks, over its degrees of freedom; gain: of the
    likeliest cause; limits: of gain and distance, which one sound walk in a hundred exceeds; named: None where
    nothing was detected, or what is left with the likeliest cause is not sound; refused_by_holdout: it does not
    explain held-out steps; ties: causes that explain these steps as well; never_distinguished: whose direction is the
    same; unusual:
    features with their distance from sound walks, in their deviations; smallest_visible: by cause the least size that
    would have been detected; cannot_be_seen: causes that these channels do not show; other_parameters: of the
    controller,
    whose values in the recording are others; other_body: the body has other numbers now than the twins had; held_out:
    distance of held-out steps without and with the cause; emulations: by which the answer is confirmed, each some walks
    of a cause at a size; habits: causes of sizes that sound robots reach, with which the walk is a sound one;
    unconfirmed: why there are none, "" otherwise; note: why there is no comparison, "" where
    there is one.
    """

    controller: str
    rate: str = ""
    steps: int = 0
    floor_roughness_m: float = 0.0
    detected: bool = False
    distance: float = 0.0
    gain: float = 0.0
    limits: Interval = (0.0, 0.0)
    named: TwinCause | None = None
    refused_by_holdout: bool = False
    since_step: int = 0
    likeliest: tuple[TwinCause, ...] = ()
    ties: tuple[str, ...] = ()
    never_distinguished: tuple[str, ...] = ()
    unusual: tuple[tuple[str, float], ...] = ()
    smallest_visible: Mapping[str, float] = dataclasses.field(default_factory=dict)
    cannot_be_seen: tuple[str, ...] = ()
    other_parameters: tuple[str, ...] = ()
    other_body: bool = False
    held_out: Interval | None = None
    emulations: int = 0
    habits: tuple[TwinCause, ...] = ()
    unconfirmed: str = ""
    note: str = ""


@dataclasses.dataclass(frozen=True)
class DiagnosisEvidence:
    """The numbers behind a diagnosis.

    p_general, p_general_after: of the general tests before and after naming; explained: share of the repeatable misfit;
    suspects: effects that were found where none is named; parameters: of the machine, as fitted; impossible: those that
    no machine has; skew_samples: by channel, its stamps' delay; known: effects of the given model.
    Only with held-out data: refused_by_holdout, holdout_excites_it. Only with a model file: without_form.
    Only where noise is what all candidates leave: band_hz, edge of the band of the equations; held_out_errors and
    noise_floor, by equation; above_noise_floor, equations that leave far more than their channel's noise;
    smallest_visible, by effect and coefficient the least size that would have been named; cannot_be_seen, effects that
    the machine's own parameters explain in these data; too_short_s, by equation whose noise is too slow for these
    recordings, the length in seconds that they would need; learnable, equations without a finding in which a black box
    of the training data leaves far less of the held-out data; below_numerics, effects that are not clearly larger than
    what numerics move them by. Only of a simulated or positioning machine: between_rows, by recording and input its
    way from a row to the next. Only of a walk: twins, the comparison with emulated walks.
    """

    p_general: float
    p_general_after: float
    explained: float
    suspects: tuple[str, ...]
    parameters: Mapping[str, Value]
    parameters_are_physical: bool
    impossible: tuple[str, ...]
    skew_samples: Mapping[str, float]
    known: tuple[KnownCause, ...]
    residual_term: LearnedTerm | None
    refused_by_holdout: tuple[str, ...] | None = dataclasses.field(default=None, metadata=OPTIONAL)
    holdout_excites_it: bool | None = dataclasses.field(default=None, metadata=OPTIONAL)
    without_form: tuple[WithoutForm, ...] | None = dataclasses.field(default=None, metadata=OPTIONAL)
    band_hz: float | None = dataclasses.field(default=None, metadata=OPTIONAL)
    held_out_errors: Mapping[str, HeldOutError] | None = dataclasses.field(default=None, metadata=OPTIONAL)
    noise_floor: Mapping[str, NoiseFloor] | None = dataclasses.field(default=None, metadata=OPTIONAL)
    above_noise_floor: tuple[str, ...] | None = dataclasses.field(default=None, metadata=OPTIONAL)
    smallest_visible: Mapping[str, Mapping[str, float]] | None = dataclasses.field(default=None, metadata=OPTIONAL)
    cannot_be_seen: tuple[str, ...] | None = dataclasses.field(default=None, metadata=OPTIONAL)
    too_short_s: Mapping[str, float] | None = dataclasses.field(default=None, metadata=OPTIONAL)
    learnable: tuple[str, ...] | None = dataclasses.field(default=None, metadata=OPTIONAL)
    between_rows: Mapping[str, Mapping[str, str]] | None = dataclasses.field(default=None, metadata=OPTIONAL)
    below_numerics: tuple[str, ...] | None = dataclasses.field(default=None, metadata=OPTIONAL)
    twins: TwinsEvidence | None = dataclasses.field(default=None, metadata=OPTIONAL)


@dataclasses.dataclass(frozen=True)
class DiagnosisResult:
    """The errors of a simulation by measured data.

    detected: something is wrong; abstained: and no cause is named; subsystem: the part where it enters, of equations
    without a simulator that where it shows; causes: the likeliest first; gain: None without held-out data or a cause;
    next_experiment: what separates tied causes; model_file: where the command wrote the extended model; data_ledger:
    by recording and channel, what became of every sample; extended_model: the model with its named causes as text of a
    TOML file, "" where there is none.
    """

    detected: bool
    misfit: tuple[ChannelMisfit, ...]
    subsystem: str | None
    causes: tuple[Cause, ...]
    abstained: bool
    gain: Gain | None
    next_experiment: tuple[str, ...]
    model_file: str | None
    data_findings: tuple[RecordingFinding, ...]
    evidence: DiagnosisEvidence
    data_repairs: tuple[RecordingRepair, ...]
    data_ledger: Mapping[str, Mapping[str, Any]]
    extended_model: str = dataclasses.field(default="", repr=False, metadata=NOT_DATA)

    def to_dict(self) -> dict[str, Any]:
        """The JSON of `ranger-sim diagnose --json` as plain data."""
        return dict(plain(self))


@dataclasses.dataclass(frozen=True)
class FittedParameter:
    """A parameter of a fit. instrument: it belongs to a measuring instrument and not to the machine."""

    value: float
    standard_error: float
    ci95: Interval
    unit: str
    instrument: bool


@dataclasses.dataclass(frozen=True)
class Separability:
    """What a recording determines. singular_values: of the scaled sensitivities; not_separable: pairs of parameters
    with the size of the cosine, the worst first; sensitivity: by parameter, root mean square of the residual's change
    per step of it."""

    singular_values: tuple[float, ...]
    not_separable: tuple[tuple[str, str, float], ...]
    sensitivity: Mapping[str, float]


@dataclasses.dataclass(frozen=True)
class FitResult:
    """One fit. refused: why it has no parameters, None for a good one; residual_rms: in standard deviations of the
    instruments; unexplained: it is above what noise explains; rho: correlation of neighbouring residuals."""

    title: str
    refused: str | None
    parameters: Mapping[str, FittedParameter]
    residual_rms: float
    unexplained: bool
    samples: int
    effective_samples: float
    rho: float
    identifiability: Separability


@dataclasses.dataclass(frozen=True)
class LegBalance:
    """One quantity of both legs (eq. 31): outer less inner, and whether that is zero within measurement (95 %)."""

    name: str
    unit: str
    outer: float
    inner: float
    difference: float
    standard_error: float
    balanced: bool


@dataclasses.dataclass(frozen=True)
class IdentificationResult:
    """Parameters of a machine by the recordings of a bench.

    data: the recording, None where the virtual bench recorded with `seed`; gear: of the bench's gearbox; balance: of
    the legs, where both were fitted together; truth: of the virtual machine by parameter, empty for measured data.
    """

    bench: str
    data: str | None
    seed: int | None
    gear: float
    fits: tuple[FitResult, ...]
    balance: tuple[LegBalance, ...]
    truth: Mapping[str, float]

    def to_dict(self) -> dict[str, Any]:
        """The JSON of `ranger-sim identify --json` as plain data."""
        return dict(plain(self))
