"""The comparison with twins as a part of a walk's diagnosis, next to the equations."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
from threadpoolctl import threadpool_limits

from ranger_sim.sysid import causes
from ranger_sim.sysid.dataset import Array, Dataset
from ranger_sim.sysid.results import Cause, CauseEvidence, DiagnosisResult, TwinCause, TwinsEvidence, Value
from ranger_sim.sysid.twins import features, judgement, step_map, steps, twin_file
from ranger_sim.sysid.twins.judgement import Fit, Verdict
from ranger_sim.sysid.twins.model import Direction, View, mean_of
from ranger_sim.sysid.twins.step_map import Rest
from ranger_sim.sysid.twins.twin_file import TwinFile

STANDARD = "record-2011"  # of a log without the controller's parameters
FALLING = 3  # steps before a fall that do not count
LAUNCH = 2  # steps after the robot is let go that do not count
FEWEST = 4  # steps of a recording
SHOWN = 8  # unusual features and other causes that an answer lists
SAME = 1e-6  # relative, of a parameter's two values
SUBSYSTEMS = {
    "geometry": "geometry",
    "floor": "floor",
    "sensor_offset": "sensor",
    "sensor_scale": "sensor",
    "sensor_lag": "sensor",
    "clock_drift": "network",
    "firmware_parameter": "firmware",
    "cable_backlash": "transmission",
    "pulley_slip": "transmission",
    "torque_constant_temperature": "electrical",
    "resistance_temperature": "electrical",
}


@dataclasses.dataclass(frozen=True)
class Walked:
    """A recording's steps. fell: its last ones are a fall; end_s: of each step, from the recording's begin."""

    leg: np.ndarray
    found: Array
    usable: np.ndarray
    every_s: float
    end_s: Array


def fell(dataset: Dataset) -> bool:
    """Whether a recording ends with a fall."""
    return any(each.kind == "fell" for each in dataset.findings)


def walked(dataset: Dataset) -> Walked | None:
    """The steps of a recording; None when it does not show where steps end, or has too few."""
    cut = steps.of_dataset(dataset)
    if cut is None or cut.count < FEWEST:
        return None
    found = features.of(cut)
    usable = steps.usual(cut)
    if fell(dataset):
        usable[-FALLING:] = False
    number = dataset["E_STEP_COUNT"].value if "E_STEP_COUNT" in dataset else None
    if number is None or not len(number) or number[0] < LAUNCH:
        usable[:LAUNCH] = False
    return Walked(cut.leg, found, usable, cut.every_s, cut.ends[1:] * steps.CLOCK_S)


def view_of(file: TwinFile, walks: Sequence[Walked]) -> tuple[str, View]:
    """The view that the recordings' rate and channels allow."""
    needed = [name for name in step_map.START if name not in (step_map.FOOTHOLD,)] + [
        step_map.FOOTHOLD,
        step_map.VOLTAGE,
    ]
    rich = all(np.isfinite(each.found[:, step_map.columns(needed)]).any(0).all() for each in walks)
    if not rich:
        return twin_file.FEW, file.views[twin_file.FEW]
    fast = all(each.every_s < steps.FAST_S for each in walks)
    name = twin_file.FULL if fast else twin_file.LINK
    return name, file.views[name]


def rest_of(view: View, walks: Sequence[Walked], since_s: float = 0.0, part: tuple[float, float] = (0.0, 1.0)) -> Rest:
    """What the maps leave of all recordings; part: of each recording by time."""
    made = []
    for each in walks:
        share = each.end_s / each.end_s[-1]
        usable = each.usable & (share > part[0]) & (share <= part[1] + 1e-9) & (each.end_s >= since_s)
        made.append(step_map.rest(view.legs, each.leg, each.found, view.few, usable))
    return joined(made)


def joined(made: Sequence[Rest]) -> Rest:
    """Steps of several walks in one."""
    return Rest(*(np.concatenate([getattr(each, field.name) for each in made]) for field in dataclasses.fields(Rest)))


@dataclasses.dataclass(frozen=True)
class Asked:
    """Walks that a comparison asks for: of a controller and body, with a cause of a size, by floor and battery;
    repeats: more of them, of bodies within tolerances."""

    controller: str
    body: str
    cause: str
    at: str
    parameter: str
    size: float
    floor_m: float
    voltage_V: float
    repeats: bool = False


@dataclasses.dataclass(frozen=True)
class Emulated:
    """One emulated walk. leg: that swings (k,); full, link: (k, all features) by the table's rate and the link's."""

    leg: np.ndarray
    full: Array
    link: Array


Emulator = Callable[[Asked], Sequence[Emulated]]


class Repeated(Protocol):
    """Walks with a cause: two to confirm it, or repeats of bodies within tolerances."""

    def __call__(
        self, direction: Direction, size: float, floor_m: float, repeats: bool = True, /
    ) -> Sequence[Rest]: ...  # a walk each


def of(
    datasets: Sequence[Dataset],
    holdout: Sequence[Dataset] = (),
    holdout_part: float | None = None,
    emulator: Emulator | None = None,
) -> tuple[TwinsEvidence, Verdict | None]:
    """The comparison of recordings with the twins of their controller. emulator: makes walks with the likeliest causes,
    by which they are confirmed."""
    walks = [each for each in map(walked, datasets) if each is not None]
    controller, changed = controller_of(datasets)
    file = twin_file.of_controller(controller)
    if file is None or not walks:
        why = f"no twins of {controller} are here: `ranger-sim twins {controller}` makes them"
        return TwinsEvidence(controller, note=why if file is None else _without_steps(datasets)), None
    rate, view = view_of(file, walks)
    view = dataclasses.replace(
        view, directions=tuple(each for each in view.directions if _is_open(each, file, datasets))
    )
    part = (0.0, 1.0 if holdout_part is None else 1.0 - holdout_part)
    found = rest_of(view, walks, part=part)
    floor_m = view.roughness(found)
    emulate, repeat, why_not = None, None, unconfirmed(file, changed)
    if emulator is not None and not why_not:
        repeat = _repeat(emulator, file, rate, view, _voltage(walks))
        emulate = _emulate(repeat, view)
    with threadpool_limits(1):  # threads of the linear algebra cost more than they save, and change last digits
        verdict = judgement.judge(view, found, step_map.outcomes(view.few), floor_m, emulate, repeat)
    if verdict is None:
        note = f"{int(found.inside.sum())} steps that can be compared are too few"
        return TwinsEvidence(controller, note=note + _fallen(datasets)), None
    held = [each for each in map(walked, holdout) if each is not None]
    later = rest_of(view, held) if held else None
    if holdout_part is not None:
        later = rest_of(view, walks, part=(part[1], 1.0))
    compared = _evidence(controller, rate, verdict, changed, _held_out(verdict, later), is_old(file))
    return dataclasses.replace(compared, unconfirmed=why_not if verdict.detected else ""), verdict


def unconfirmed(file: TwinFile, changed: Sequence[str]) -> str:
    """Why causes cannot be confirmed by walks of the recordings' robot; empty when they can."""
    if is_old(file):
        return "the body has other numbers now"
    candidates = {each.at for each in next(iter(file.views.values())).directions if each.cause == "firmware_parameter"}
    others = [name for name in changed if name not in candidates]
    return f"the controller of these recordings is not known ({len(others)} other parameters)" if others else ""


def _voltage(walks: Sequence[Walked]) -> float:
    """Median of the battery's voltage in V; not a number where the recordings do not have it."""
    found = np.concatenate([each.found[:, step_map.columns([step_map.VOLTAGE])[0]] for each in walks])
    found = found[np.isfinite(found)]
    return float(np.median(found)) if len(found) else float("nan")


def _repeat(emulator: Emulator, file: TwinFile, rate: str, view: View, voltage_V: float) -> Repeated:
    """What the maps leave of walks with a cause."""

    def repeat(direction: Direction, size: float, floor_m: float, repeats: bool = True) -> Sequence[Rest]:
        controller, body = file.made_of["controller"], file.made_of["body"]
        cause = direction.cause, direction.at, direction.parameter
        asked = Asked(controller, body, *cause, size, floor_m, voltage_V, repeats)
        rests = []
        for each in emulator(asked):
            found = each.full if rate == twin_file.FULL else each.link
            count = min(len(each.leg), len(found))
            rests.append(step_map.rest(view.legs, each.leg[:count], found[:count], view.few))
        return rests

    return repeat


def _emulate(repeat: Repeated, view: View) -> judgement.Emulate:
    """Walks of a cause as a vector of the view."""

    def emulate(direction: Direction, size: float, floor_m: float) -> judgement.Walks | None:
        rests = repeat(direction, size, floor_m, False)
        together = joined(rests) if rests else None
        mean = mean_of(together) if together is not None else None
        if together is None or mean is None:
            return None
        return judgement.Walks(mean, view.looks(together))

    return emulate


def _without_steps(datasets: Sequence[Dataset]) -> str:
    """Why recordings have no steps to compare."""
    counts = [cut.count for each in datasets if (cut := steps.of_dataset(each)) is not None]
    if counts:
        return f"{sum(counts)} steps are too few{_fallen(datasets)}"
    return "these recordings do not show where steps end (FSM_LEG, walk_state or E_STEP_COUNT, and the hip's angle)"


def _fallen(datasets: Sequence[Dataset]) -> str:
    found = [each.start_s for data in datasets for each in data.findings if each.kind == "fell"]
    return f": the robot falls after {min(found):.3g} s" if found else ""


def is_old(file: TwinFile) -> bool:
    """Whether the body of this version has other numbers than the twins had."""
    return twin_file.of_body(file.made_of["body"]) != file.made_of["body_fingerprint"]


def controller_of(datasets: Sequence[Dataset]) -> tuple[str, tuple[str, ...]]:
    """The set whose parameters the recordings have, or the standard one, and the parameters that differ from it."""
    logged = parameters_of(datasets)
    differing: dict[str, list[str]] = {}
    for name in twin_file.available():
        file = twin_file.of_controller(name)
        assert file is not None
        known = file.made_of["parameters"]
        differing[name] = [key for key in sorted(known) if key in logged and not _same(logged[key], known[key])]
    if not logged or not differing:
        return STANDARD, ()
    nearest = min(differing, key=lambda name: (len(differing[name]), name != STANDARD))
    return nearest, tuple(differing[nearest])


def parameters_of(datasets: Sequence[Dataset]) -> dict[str, float]:
    """The last values of the controller's parameters in the recordings' channels, by name."""
    found: dict[str, float] = {}
    for dataset in datasets:
        for name, channel in dataset.channels.items():
            if name.startswith(("C_", "P_", "D_", "DC_", "DP_", "DC2_", "DC3_")) and len(channel.value):
                found[name] = float(channel.value[-1]) * steps.in_table_units(name, channel.unit)
    return found


def _same(one: float, other: float) -> bool:
    return abs(one - other) <= SAME * max(abs(one), abs(other), 1e-9)


def _is_open(direction: Direction, file: TwinFile, datasets: Sequence[Dataset]) -> bool:
    """False for a parameter of the firmware that the recordings show to be what it should be."""
    if direction.cause != "firmware_parameter":
        return True
    logged = parameters_of(datasets)
    return direction.at not in logged or not _same(logged[direction.at], file.made_of["parameters"][direction.at])


def _held_out(verdict: Verdict, later: Rest | None) -> tuple[float, float] | None:
    """Distance of held-out steps without and with the named cause, over its degrees of freedom."""
    view = verdict.view
    mean = mean_of(later) if later is not None else None
    if mean is None:
        return None
    space = judgement.Space(view, mean, view.weights(verdict.floor_m))
    before = float(space.value @ space.value) / space.freedom
    if verdict.named is None:
        return before, before
    number = next(n for n, each in enumerate(view.directions) if each is verdict.named.direction)
    left = space.value - space.moved(number, verdict.named.size)
    return before, float(left @ left) / space.freedom


def _cause(fit: Fit) -> TwinCause:
    each = fit.direction
    return TwinCause(each.cause, each.at, {each.parameter: Value(fit.size, (fit.low, fit.high))}, fit.gain)


def _evidence(
    controller: str,
    rate: str,
    verdict: Verdict,
    changed: Sequence[str],
    held: tuple[float, float] | None,
    other_body: bool,
) -> TwinsEvidence:
    refused = held is not None and verdict.named is not None and held[1] >= held[0]
    return TwinsEvidence(
        controller=controller,
        rate=rate,
        steps=verdict.steps,
        floor_roughness_m=verdict.floor_m,
        detected=verdict.detected,
        distance=verdict.distance,
        gain=verdict.fits[0].gain,
        limits=verdict.limits,
        named=_cause(verdict.named) if verdict.named is not None and not refused else None,
        refused_by_holdout=refused,
        since_step=verdict.since,
        likeliest=tuple(_cause(each) for each in verdict.fits[:SHOWN]) if verdict.detected else (),
        ties=tuple(each.name for each in verdict.ties),
        never_distinguished=tuple(each.name for each in verdict.alike),
        unusual=tuple(verdict.unusual[:SHOWN]),
        smallest_visible={f"{each.name}: {each.parameter}": size for each, size in verdict.visible},
        cannot_be_seen=tuple(f"{each.name}: {each.parameter}" for each in verdict.unseen),
        other_parameters=tuple(changed),
        other_body=other_body,
        held_out=held,
        habits=tuple(_cause(each) for each in verdict.habits),
        emulations=sum(len(each.knots) for each in verdict.view.directions),
        note="",
    )


def combined(result: DiagnosisResult, found: TwinsEvidence) -> DiagnosisResult:
    """The equations' result and the twins' in one.

    A cause that both name, or that the twins cannot distinguish from theirs, keeps the equations' name. Where they name
    different ones the twins' is first: they explain the whole gait, the equations only what single stance shows.
    """
    evidence = dataclasses.replace(result.evidence, twins=found)
    result = dataclasses.replace(result, evidence=evidence)
    if not found.detected:
        return result
    if found.named is None:
        if result.detected:
            return result
        suspects = tuple(f"{each.name} at {each.at}" for each in found.likeliest[:2])
        evidence = dataclasses.replace(evidence, suspects=suspects)
        return dataclasses.replace(result, detected=True, abstained=True, subsystem="gait", evidence=evidence)
    own = result_cause(found)
    equal = {f"{own.name} at {own.at}", *found.ties, *found.never_distinguished}
    agreed = [each for each in result.causes if f"{each.name} at {each.at}" in equal]
    if agreed and not result.abstained:
        first = agreed[0]
        if (first.name, first.at) == (own.name, own.at) and first.parameters.keys() == own.parameters.keys():
            first = dataclasses.replace(
                first, parameters={n: _nearer(first.parameters[n], own.parameters[n]) for n in own.parameters}
            )
        rest = [each for each in result.causes if each is not agreed[0]]
        return dataclasses.replace(result, causes=(first, *rest))
    tied = tuple(each.name for each in result.causes)
    own = dataclasses.replace(own, tied_with=tuple(dict.fromkeys((*own.tied_with, *tied))))
    return dataclasses.replace(
        result, detected=True, abstained=False, causes=(own,), subsystem=SUBSYSTEMS.get(own.name, "mechanical")
    )


def _nearer(one: Value, other: Value) -> Value:
    """The value with the narrower interval."""
    return min((other, one), key=lambda each: each.ci95[1] - each.ci95[0])


def _balance(own: TwinCause) -> str:
    """Letters of the equations in which a cause acts."""
    kinds = ("gyro", "current", "angle")  # of sensors, where the catalogue distinguishes them
    place = next((kind for kind in kinds if kind in own.at), "")
    known = causes.CAUSES
    each = known.get(own.name) or known.get(f"{own.name}@{place}") or known[f"{own.name}@gyro"]
    return "".join(each.balances)


def result_cause(found: TwinsEvidence) -> Cause:
    """The twins' cause as a diagnosis lists causes."""
    assert found.named is not None
    own, behind = (
        found.named,
        {f"{each.name} at {each.at}": found.named.gain - each.gain for each in found.likeliest[1:]},
    )
    return Cause(
        name=own.name,
        at=own.at,
        form=None,
        balance=_balance(own),
        parameters=dict(own.parameters),
        tied_with=tuple(
            dict.fromkeys(each.partition(" at ")[0] for each in found.ties if not each.startswith(f"{own.name} at"))
        ),
        evidence=CauseEvidence(own.gain, 0.0, own.gain, found.ties, behind, None),
    )
