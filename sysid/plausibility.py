"""Checks that a fit's values can belong to the machine at all, before any cause is named.

A channel in another unit, a wrong channel under its name, or one that does not belong to the others, still gives a fit:
its parameters show the error, and equations that share a parameter contradict each other. A doubt forbids naming a
cause; a warning is only reported.
"""

import dataclasses
import itertools
import math
from collections.abc import Sequence

import numpy as np

from ranger_sim.sysid.dataset import Array, Finding
from ranger_sim.sysid.machine import Known, Machine
from ranger_sim.sysid.naming import Named
from ranger_sim.sysid.regression import Part, Regression

SURE = 5.0  # standard errors beyond a limit: chance and a small model error do not reach that far
OTHER_WAY = 0.5  # of its known value: this far on the other side of zero a sign is wrong, in the data or in the model
FACTOR = 5.0  # to the simulation's value: between a machine of the same kind and rpm taken for rad/s (9.5)
LITTLE = 0.01  # of its known value: so far beyond a limit the errors of a model take it
NOTHING = 1e-4  # of its known value: less than any unit makes of it; a parameter may be 0
CLEAR = 0.2  # relative error up to which a factor is reported
EXPLAINED = 0.2  # of an equation's balance: below it the channels do not belong together
# Or below this share where the residual moves slowly, as a machine does and a sensor's noise does not. Chosen by us:
# fits explain 0.98 and more of the motor bench's recordings with a fault, and mostly less than 0.75 with a channel 1 s
# late or reversed; the blind cases' noise has a memory of 0.93 at most from sample to sample.
COHERENT, SLOW = 0.9, 0.95
FEWEST = 100  # rows
FEW = 0.02  # of the rows; decimation to independent rows may leave a small part
APART = 0.25  # of the mean square: equations leave less than this share when a parameter may differ between them
TELLS = 0.05  # of a column's length: the part that the others leave when the equation alone determines its parameter
SLOWEST = 6.0  # a memory of 0.986 from sample to sample; instruments have up to 0.95 (3.2), a voltage 10 ms late has 12
# Of what a named cause adds: parameters that leave less than this of it resemble it, and each takes at least TAKES of
# it; a parameter among them and the cause are one thing, and are judged together. Chosen by us
RESEMBLES, TAKES = 0.05, 0.05
MOST = 5  # causes at once: where everything seems wrong, it is another machine, or other data
LARGEST_SCALE = 0.5  # largest change of a sensor's scale: beyond it, the channel shows another signal or another unit
UNIT_TOLERANCE = 0.05  # of a factor that is reported as a unit's: friction and noise move it by per cents
# kinds of findings that forbid naming a cause
FORBID = (
    "impossible", "unexplained", "contradiction", "slow", "too_many", "other_signal", "other_machine", "at_limit",
    "too_coarse", "runs_away", "other_held_out",
)  # fmt: skip
# small compared with the rest, or of an instrument: a model error moves them by any factor
MAY_BE_ANY = ("friction", "inductance", "lag", "filter", "gates", "zero", "offset", "bias")
# {unit of a channel: {other unit that its numbers may have: how many of them make one of ours}}
OTHER_UNITS = {
    "rad/s": {"rpm": 30.0 / np.pi, "deg/s": 180.0 / np.pi, "turns/s": 0.5 / np.pi},
    "rad": {"deg": 180.0 / np.pi, "turns": 0.5 / np.pi, "mrad": 1e3},
    "N m": {"lbf ft": 0.73756, "lbf in": 8.8507, "kgf cm": 10.197, "N cm": 100.0, "ozf in": 141.61, "N mm": 1e3},
    "N": {"lbf": 0.22481, "kgf": 0.10197, "kN": 1e-3, "mN": 1e3},
    "m": {"mm": 1e3, "cm": 100.0, "inches": 39.370},
    "A": {"mA": 1e3, "steps of 10 mA": 100.0},
    "V": {"mV": 1e3},
}


@dataclasses.dataclass(frozen=True)
class Doubts:
    """findings: for the answer; forbid: True when no cause may be named."""

    findings: list[Finding]
    forbid: bool


def look(
    machine: Machine,
    regression: Regression,
    named: Sequence[Named] = (),
    by_candidates: bool = False,
    base: Regression | None = None,
    more: Sequence[Finding] = (),
) -> Doubts:
    """Implausible values of a fit. regression: with every named cause in it.

    by_candidates: the noise is what all candidates leave. Then a slow residual is what a model error looks like, and a
    start value only starts: neither forbids a name. base: without the named causes; a scale of a channel could hide
    that its equations contradict each other. more: findings about the model itself (own_model.py).
    """
    findings: list[Finding] = [*more]
    if len(named) >= MOST and not by_candidates:
        text = f"{len(named)} causes at once explain it: where everything is wrong it is another machine, or other data"
        findings.append(_finding("", "too_many", len(named), "", text))
    for each in named:
        findings += _of_sensor(regression, each)
    shared = with_causes(regression, machine.parameters, named)
    in_part = {name for each in regression.recordings for name in each.in_part} if named else set()
    for known in machine.parameters:
        if known.name not in regression.values:
            continue
        value = regression.values[known.name]
        number = regression.names.index(known.name)
        error = float(np.sqrt(max(0.0, float(regression.covariance[number, number]))))
        whole = value + shared.get(known.name, 0.0)
        together = ", together with what the named causes add" if known.name in shared else ""
        if known.name in in_part and not together:
            continue
        if absurd(known, value, error) and absurd(known, whole, error):
            text = f"it comes out as {whole:.4g} {known.unit}{together}, which no machine has"
            findings.append(_finding(known.name, "impossible", whole, known.unit, text))
        elif known.value * value * whole != 0.0 and error < CLEAR * min(abs(value), abs(whole)):
            nothing = known.low <= 0.0 and abs(whole) < NOTHING * abs(known.value)  # as the machine may have of it
            if not nothing and not any(1.0 / FACTOR <= abs(each / known.value) <= FACTOR for each in (value, whole)):
                simulated = _of_a_simulator(regression) and not by_candidates
                findings.append(_factor(known, whole, together, simulated))
    few = {name: each.few for recording in regression.recordings for name, each in recording.equations.items()}
    for name in regression.equations:
        counted, rows = int(np.count_nonzero(regression.good[name])), len(regression.parts[name].valid)
        if counted < FEW * rows and counted < few[name]:
            text = f"{counted} of {rows} rows of this equation count: its residual shows next to nothing"
            findings.append(_finding(name, "few_rows", counted, "rows", text))
        share = explained(regression, name)
        moves = share is not None and not by_candidates and _memory(_left(regression, name)) > SLOW
        if share is not None and (share < EXPLAINED or (share < COHERENT and moves)):
            text = (
                f"the equation explains {max(0.0, share):.0%} of what was measured: the channels do not belong together"
            )
            findings.append(_finding(name, "unexplained", share, "", text))
        new = None if by_candidates else slowness(regression, name)
        if new is not None and new > SLOWEST:
            text = (
                f"what the equation leaves is {new:.0f} times what is new in it from sample to sample: no instrument's "
                "noise is so slow; a channel is late, or is not what its name says"
            )
            findings.append(_finding(name, "slow", new, "", text))
    findings += _contradictions(machine, regression if base is None else base)
    return Doubts(findings, any(each.kind in FORBID for each in findings))


def of_held_out(machine: Machine, held: Regression) -> list[Finding]:
    """Parameters that only the held-out recordings ask for and that no machine has: they are of another machine.

    held: of balances, without causes; a value that merely differs may be another day's friction or another load.
    """
    if _of_a_simulator(held):
        return []
    found = []
    for known in machine.parameters:
        if known.name not in held.values or known.name in held.idle:
            continue
        value, number = held.values[known.name], held.names.index(known.name)
        error = float(np.sqrt(max(0.0, float(held.covariance[number, number]))))
        if absurd(known, value, error):
            text = (
                f"in the held-out recordings it comes out as {value:.4g} {known.unit}, which no machine has: another "
                "machine, or a channel in another unit or with the other sign"
            )
            found.append(_finding(known.name, "other_held_out", value, known.unit, text))
    return found


def with_causes(regression: Regression, parameters: Sequence[Known], named: Sequence[Named]) -> dict[str, float]:
    """By parameter that is one thing with a named cause: the change of it that resembles what they add.

    A spring's cube has a slope where it is measured, which is a part of the whole spring's stiffness, and the linear
    spring's value next to it is that of an angle where nothing may have been measured. The parameter that is most like
    the causes' columns comes first, and others follow while they take a part of the rest.
    """
    names = [each for cause in named for each in cause.coefficients]
    if not all(name in regression.names for name in names) or not names:
        return {}
    places = [regression.names.index(name) for name in names]
    own = [each.name for each in parameters if each.name in regression.names]
    of_own = [regression.names.index(each) for each in own]
    values = np.array([regression.values[each] for each in names])
    columns, added = [], []
    for name, part in regression.parts.items():
        measured = part.measured[_counting(part)] / regression.whitening[name].deviation
        columns.append(measured[:, of_own])
        added.append(measured[:, places] @ values)
    x, y = np.concatenate(columns), np.concatenate(added)
    lengths = np.linalg.norm(x, axis=0)
    whole = float(y @ y)
    taken: list[int] = []
    found, left = np.zeros(0), y
    while whole > 0.0 and float(left @ left) > RESEMBLES * whole and len(taken) < len(own):
        likeness = np.abs(x.T @ left) / np.where(lengths > 0.0, lengths, np.inf)
        likeness[taken] = 0.0
        tried = [*taken, int(np.argmax(likeness))]
        scaled = x[:, tried] / np.maximum(lengths[tried], 1e-300)
        new = np.linalg.lstsq(scaled, y, rcond=1e-9)[0]
        rest = y - scaled @ new
        if float(left @ left) - float(rest @ rest) < TAKES * whole:
            break
        taken, found, left = tried, new / lengths[tried], rest
    return {own[number]: float(value) for number, value in zip(taken, found, strict=True)}


def surest_beyond(parameters: Sequence[Known], regression: Regression, named: Sequence[Named]) -> float:
    """Standard errors by which the surest of these parameters is beyond its limits, with and without what the named
    causes add to it. 0 where none is, and where one is so far beyond that no cause is named at all."""
    shared = with_causes(regression, parameters, named)
    in_part = {name for each in regression.recordings for name in each.in_part} - set(shared)
    surest = 0.0
    for known in parameters:
        if known.name not in regression.values or known.name in in_part:
            continue
        value, number = regression.values[known.name], regression.names.index(known.name)
        error = math.sqrt(max(float(regression.covariance[number, number]), 1e-300))
        both = (value, value + shared.get(known.name, 0.0))
        if all(absurd(known, each, error) for each in both):
            return 0.0
        beyond = min(max(known.low - each, each - known.high) for each in both) - LITTLE * abs(known.value)
        surest = max(surest, beyond / error)
    return surest


def outside(known: Known, value: float, reach: float) -> bool:
    """True for a value beyond the limits by more than that."""
    return value + reach < known.low or value - reach > known.high


def absurd(known: Known, value: float, error: float) -> bool:
    """True for values surely beyond the limits; a little below zero is not absurd where the usual value is small."""
    reach = SURE * error
    if known.low >= 0.0 and known.value > 0.0 and value < 0.0:
        return value + reach < -OTHER_WAY * known.value
    return outside(known, value, reach)


def explained(regression: Regression, name: str) -> float | None:
    """Share of an equation's balance (its response and its parameters' contributions) that the equation explains.

    None for an equation with fewer than two parameters only in it or few rows, and for a machine given by its
    simulator, whose response is already the simulation's error.
    """
    if _of_a_simulator(regression):
        return None
    own: dict[str, None] = {}
    for recording in regression.recordings:
        if name in recording.equations:
            own |= dict.fromkeys(recording.equations[name].columns)
    part = regression.parts[name]
    rows = _counting(part)
    if np.count_nonzero(rows) < FEWEST or len(own) < 2:
        return None
    added = part.measured[rows] * _values(regression)
    left = float(np.mean(_left(regression, name) ** 2))
    balanced = float(np.mean(part.response[rows] ** 2)) + float(np.sum(np.mean(added**2, axis=0)))
    return 1.0 - left / max(balanced, 1e-300)


def slowness(regression: Regression, name: str) -> float | None:
    """rms of an equation's residual over that of its innovations: sqrt(1 / (1 - rho^2)) for noise with a memory of rho.

    None where the residual is not whitened, or for few rows.
    """
    if not all(recording.whitened for recording in regression.recordings):
        return None
    if np.count_nonzero(_counting(regression.parts[name])) < FEWEST:
        return None
    return float(np.std(_left(regression, name))) / regression.whitening[name].deviation


def _of_a_simulator(regression: Regression) -> bool:
    """True where responses are errors of a simulation."""
    return any(recording.left_over or recording.entries for recording in regression.recordings)


def _counting(part: Part) -> np.ndarray:
    """(n,) rows that count: none at a run's start, where a machine may be switched on."""
    return part.valid & ~part.starts


def _values(regression: Regression) -> Array:
    return np.array([regression.values[each] for each in regression.names])


def _left(regression: Regression, name: str) -> Array:
    """An equation's residual, not whitened, at the rows that count."""
    part = regression.parts[name]
    rows = _counting(part)
    return part.response[rows] - part.measured[rows] @ _values(regression)


def _memory(left: Array) -> float:
    """Autocorrelation from one row to the next, 0 to 0.99."""
    return min(max(float(np.mean(left[1:] * left[:-1])) / max(float(np.mean(left**2)), 1e-300), 0.0), 0.99)


@dataclasses.dataclass(frozen=True)
class _Alone:
    """A parameter from one equation alone. better: the equation's residual then, over that with the other equations."""

    equation: str
    value: float
    better: float


def _contradictions(machine: Machine, regression: Regression) -> list[Finding]:
    """Parameters with opposite or far different values in two equations: a channel has another sign or unit."""
    findings: list[Finding] = []
    if _of_a_simulator(regression):
        return findings
    for known in machine.parameters:
        if known.low < 0.0 or known.name not in regression.values:
            continue
        found = [one for name in regression.equations if (one := _alone(regression, name, known.name)) is not None]
        for first, second in itertools.combinations(found, 2):
            apart = min(abs(first.value), abs(second.value)) * FACTOR < max(abs(first.value), abs(second.value))
            if (apart or first.value * second.value < 0.0) and min(first.better, second.better) < APART:
                text = (
                    f"it is {first.value:.4g} {known.unit} by the {first.equation} equation and {second.value:.4g} by "
                    f"the {second.equation} one: a channel of one of the two has another sign or unit"
                )
                if meant := other_units(machine, abs(second.value / first.value)):
                    text += f"; {', or '.join(meant)} would do it"
                findings.append(_finding(known.name, "contradiction", second.value, known.unit, text))
    return findings


def _alone(regression: Regression, equation: str, name: str) -> _Alone | None:
    """None where the equation alone does not surely determine the parameter: absent, or among columns much like it."""
    part = regression.parts[equation]
    rows = _counting(part)
    measured, response = part.measured[rows], part.response[rows]
    lengths = np.linalg.norm(measured, axis=0)
    number = regression.names.index(name)
    kept = np.flatnonzero(lengths > 0.0)
    if number not in kept or len(kept) < 2 or len(response) < FEWEST:
        return None
    own = measured[:, number] / lengths[number]
    others = measured[:, kept[kept != number]] / lengths[kept[kept != number]]
    fitted = np.linalg.lstsq(others, np.column_stack([own, response]), rcond=1e-9)[0]
    rest, left = (np.column_stack([own, response]) - others @ fitted).T
    if np.linalg.norm(rest) < TELLS:
        return None
    value = float(rest @ left) / float(rest @ rest)
    left = left - value * rest
    square = float(np.mean(left**2))
    rho = _memory(left)
    error = math.sqrt(square * (1.0 + rho) / (1.0 - rho) / float(rest @ rest))
    if abs(value) < SURE * error:
        return None
    better = square / max(float(np.mean(_left(regression, equation) ** 2)), 1e-300)
    return _Alone(equation, value / float(lengths[number]), better)


def other_units(machine: Machine, factor: float) -> list[str]:
    """Channels and units in which numbers would be larger or smaller than ours by `factor`."""
    found = []
    for channel in machine.quantities:
        for unit, size in OTHER_UNITS.get(channel.unit, {}).items():
            if any(abs(factor / each - 1.0) < UNIT_TOLERANCE for each in (size, 1.0 / size)):
                found.append(f"{channel.name} in {unit}")
    return found


def _of_sensor(regression: Regression, named: Named) -> list[Finding]:
    """An impossible scale or offset of a sensor: its channel shows another signal, or has another unit."""
    value = regression.values[named.coefficients[0]]
    if named.effect.cause == "sensor_scale" and abs(value) > LARGEST_SCALE:
        text = f"it would show {1.0 + value:.3g} times its quantity: another signal, or another unit, and no scale"
        return [_finding(named.effect.at, "other_signal", 1.0 + value, "", text)]
    tables = [each.table for each in regression.recordings if named.effect.at in each.table]
    if named.effect.cause == "sensor_offset" and tables:
        reach = max(float(np.ptp(table[named.effect.at])) for table in tables)
        if abs(value) > reach:
            text = f"its offset would be {abs(value):.4g}, more than its whole range of {reach:.4g}: another signal"
            return [_finding(named.effect.at, "other_signal", value, "", text)]
    return []


def _factor(known: Known, value: float, together: str, simulated: bool) -> Finding:
    """A parameter far from the simulation's. together: words, where the named causes are a part of the value; they are
    then what is wrong. simulated: from equations that are linearised where a fit ended; a value far from the fit's
    start may then be an artefact.
    """
    factor = value / known.value
    meant = "" if together else ": another machine, or a channel in another unit"
    text = (
        f"it comes out as {value:.4g} {known.unit}{together}, {factor:.3g} times the model's {known.value:.4g}{meant}"
    )
    if simulated and not together and not any(word in known.name for word in MAY_BE_ANY):
        return _finding(known.name, "other_machine", factor, "", text)
    return _finding(known.name, "far_off", factor, "", text)


def _finding(channel: str, kind: str, size: float, unit: str, text: str) -> Finding:
    return Finding(channel, kind, 0.0, 0.0, float(size), unit, text)
