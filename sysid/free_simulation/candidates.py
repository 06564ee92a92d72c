"""Candidate causes that every machine given by its simulator has, without a line of the user's.

At every output an offset, a scale, a drift and a lag, as a pure delay or as a filter; at every input an offset, a lag,
a saturation and a dead zone; at every joint that the machine declares viscous, Coulomb and Stribeck friction, friction
that differs between the directions or grows with the load, drag, and what is periodic in the position; at every
parameter a drift. Lags, speeds,
limits and periods are on grids that suit the recordings. They enter at places that the engine adds to the simulator
(`simulator.py`), so that `step` and `observe` need not know of them.

A candidate that the machine's own parameters explain cannot be seen and is not named; one that a term of the user's
equals is left out.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Protocol

import numpy as np
from scipy.signal import lfilter

from ranger_sim.sysid.dataset import Array, Table
from ranger_sim.sysid.forms import (
    CHANGES,
    DELAY,
    FILTER,
    JUMP,
    LAGS,
    RAMP,
    Change,
    Lag,
    delayed,
    filtered,
    jumped,
    jumps,
)
from ranger_sim.sysid.free_simulation.recording import SimulatedRecording, Way
from ranger_sim.sysid.free_simulation.terms import Joint, Output, Shape, Term, into, of, on, sensed, shown
from ranger_sim.sysid.machine import PARAMETER, Known, Recording

SPEEDS = (0.05, 0.15, 0.5)  # of a rate's rms: about which Stribeck's excess falls off
SLOW = 0.01  # of a rate's rms: about which a smoothed sign turns, where the joint does not say
CLIPPED = (0.2, 0.35, 0.5, 0.7, 0.85, 0.95, 0.99)  # quantiles of an input's size at which it may saturate
# Of a dead zone or a saturation: a hard one has 1, at the right limit. At the grid's limit near it the share may be a
# multiple; much less or more is another effect's shadow (131 in a ship's zigzag). Chosen by us
LEAST_SHARE, MOST_SHARE = 0.5, 20.0
DEAD = (0.002, 0.005, 0.02, 0.05, 0.1, 0.2, 0.4)  # of an input's largest size


class Declares(Protocol):
    """What the candidates need of a machine."""

    outputs: tuple[Output, ...]
    joints: tuple[Joint, ...]
    parameters: tuple[Known, ...]
    impossible: Collection[str]


Signal = Callable[[Mapping[str, Array], Shape], Array]


def candidates(machine: Declares, inputs: Sequence[str], recordings: Sequence[Recording]) -> list[Term]:
    """All of them. inputs: names of the simulator's inputs."""
    made: list[Term] = []
    # a single output shows late inputs as it shows its own lag
    one_lag = len(machine.outputs) == 1 and "sensor_lag" not in machine.impossible
    for output in machine.outputs:
        made += at_output(output, recordings, "; or the inputs are late by as much" if one_lag else "")
    for name in inputs:
        made += [each for each in at_input(name, recordings) if not (one_lag and each.cause == "input_lag")]
    for joint in machine.joints:
        made += at_joint(joint, recordings)
    for known in machine.parameters:
        made += at_parameter(known, recordings)
    return made


def at_output(output: Output, recordings: Sequence[Recording], or_late: str = "") -> list[Term]:
    """An output's offset, scale, drift and lag. or_late: what else its lag may be, in words."""
    name, place, unit = output.channel, shown(output.channel), _word(output.unit)

    def sensor(cause: str, coefficient: str, make: Callable[[Table, Array], Array], meaning: str) -> Term:
        return Term(
            cause, name, "sensor", (coefficient,),
            lambda r, shape, values: {place: make(r.table, r.signals[sensed(name)])}, meaning=meaning, independent=True,
        )  # fmt: skip

    def drift(change: Change, form: str, coefficient: str) -> Term:
        return Term(
            "sensor_drift", name, "sensor", (coefficient,),
            lambda r, shape, values: {place: change.factor(r.table.elapsed_s, shape)}, change.shapes(recordings),
            meaning=f"{name} drifts: true value + {change.words.format(coefficient)}",
            independent=True, form=form, scale=change.scale, once=change.once,
        )  # fmt: skip

    def lag(each: Lag) -> Term:
        def make(r: Recording, shape: Shape, values: Mapping[str, float]) -> dict[str, Array]:
            seen, lag_s = r.signals[sensed(name)], shape[each.time]
            return {place: (each.late(r.table, seen, lag_s) - seen) / lag_s}

        def before(r: Recording, shape: Shape) -> dict[str, Array]:
            seen, lag_s = r.signals[sensed(name)], shape[each.time]
            return {place: each.before(r.table, seen, each.late(r.table, seen, lag_s), lag_s)}

        return Term(
            "sensor_lag", name, "sensor", ("lag_s",), make, each.shapes(recordings), each.fits(recordings),
            meaning=f"{name} {each.words}{or_late}", independent=True, form=each.form, scale=each.time,
            before=before,
        )  # fmt: skip

    return [
        sensor("sensor_offset", f"offset_{unit}", lambda table, seen: np.ones(len(table)),
               f"{name} shows a constant too much: true value + offset_{unit}"),
        sensor("sensor_scale", "share", lambda table, seen: seen,
               f"{name} shows a multiple of what it measures: true value * (1 + share)"),
        drift(RAMP, "", f"drift_{unit}_per_s"),
        drift(JUMP, JUMP.form, f"change_{unit}"),
        *map(lag, LAGS),
    ]  # fmt: skip


def at_input(name: str, recordings: Sequence[Recording]) -> list[Term]:
    """An input's offset, lag, saturation and dead zone: a share of 1 is a hard one."""
    size = np.concatenate([np.abs(each.signals[name]) for each in recordings])
    largest = float(np.max(size, initial=0.0))
    if not largest > 0.0 or np.ptp(size) == 0.0 and len(set(np.sign(recordings[0].signals[name]))) == 1:
        return []
    limits = sorted({float(np.quantile(size, each)) for each in CLIPPED} - {largest, 0.0})

    def term(cause: str, coefficient: str, make: Signal, meaning: str, shapes: Sequence[Shape] = ({},)) -> Term:
        least, most = (LEAST_SHARE, MOST_SHARE) if coefficient == "share" else (-np.inf, np.inf)
        return Term(
            cause, name, "input", (coefficient,), lambda r, shape, values: {into(name): make(r.signals, shape)},
            shapes, lambda found: least < found[coefficient] < most, meaning, independent=True,
            scale="limit" if shapes[0] else None,
        )  # fmt: skip

    slips = Term(
        "input_offset", name, "input", ("change",),
        lambda r, shape, values: {into(name): jumped(r.table.elapsed_s, shape)}, jumps(recordings),
        meaning=f"the machine gets {name} + change from at_s after the recording's start on",
        independent=True, form="jump", scale="at_s", once=True,
    )  # fmt: skip
    made = [term("input_offset", "offset", lambda s, _: np.ones_like(s[name]),
                 f"the machine gets {name} + offset"), slips]  # fmt: skip

    def lag(form: Lag, late: Callable[[Table, Array, float, Way], Array], meaning: str) -> Term:
        def make(r: SimulatedRecording, shape: Shape, values: Mapping[str, float]) -> dict[str, Array]:
            given, lag_s = r.signals[name], shape[form.time]
            return {into(name): (late(r.table, given, lag_s, r.ways[name]) - given) / lag_s}

        def before(r: SimulatedRecording, shape: Shape) -> dict[str, Array]:
            given, lag_s = r.signals[name], shape[form.time]
            return {into(name): form.before(r.table, given, late(r.table, given, lag_s, r.ways[name]), lag_s)}

        return Term(
            "input_lag", name, "input", ("lag_s",), make, form.shapes(recordings), form.fits(recordings),
            meaning=f"the machine gets {name} {meaning}", independent=True, form=form.form, scale=form.time,
            before=before,
        )  # fmt: skip

    made += [
        lag(DELAY, given_late, "late: its value of lag_s before"),
        lag(FILTER, given_slowly, "behind a low-pass of first order with the time constant lag_s"),
    ]
    if limits:
        beyond: Signal = lambda s, shape: np.clip(s[name], -shape["limit"], shape["limit"]) - s[name]  # noqa: E731
        made.append(
            term(
                "saturation",
                "share",
                beyond,
                f"the machine does not get the share of {name} that is beyond the limit",
                [{"limit": each} for each in limits],
            )
        )
    inside: Signal = lambda s, shape: -np.clip(s[name], -shape["limit"], shape["limit"])  # noqa: E731
    text = f"the machine does not get the share of {name} that is within the limit"
    made.append(term("dead_zone", "share", inside, text, [{"limit": each * largest} for each in DEAD]))
    return made


def at_joint(joint: Joint, recordings: Sequence[Recording]) -> list[Term]:
    """Friction of a joint, drag, and what is periodic in its position."""
    rates = np.concatenate([each.signals[joint.rate] for each in recordings])
    usual = float(np.sqrt(np.mean(rates**2)))
    slow = joint.slow or SLOW * usual
    unit = joint.unit

    def term(
        cause: str,
        coefficients: tuple[str, ...],
        make: Signal,
        meaning: str,
        shapes: Sequence[Shape] = ({},),
        admissible: Callable[[Mapping[str, float]], bool] = lambda found: True,
        phase: bool = False,
    ) -> Term:
        return Term(
            cause, joint.rate, "mechanical", coefficients,
            lambda r, shape, values: {on(joint.rate): make(r.signals, shape)}, shapes, admissible,
            f"{joint.rate}: {meaning}", phase_is_free=phase, independent=True,
        )  # fmt: skip

    def sign(s: Mapping[str, Array]) -> Array:
        return np.asarray(np.tanh(s[joint.rate] / slow))

    def low(s: Mapping[str, Array], shape: Shape) -> Array:
        return np.asarray(-sign(s) * np.exp(-((s[joint.rate] / shape["speed"]) ** 2)))

    def around(s: Mapping[str, Array], shape: Shape) -> Array:
        angle = shape["periods"] * joint.turns * s[joint.position]
        return np.column_stack((np.cos(angle), np.sin(angle)))

    made = [
        term("viscous_friction", (f"viscous_{unit}_s",), lambda s, _: -s[joint.rate],
             f"further friction, -viscous_{unit}_s * rate"),
        term("coulomb_friction", (f"coulomb_{unit}",), lambda s, _: -sign(s),
             f"further dry friction, -coulomb_{unit} * sign(rate)"),
        term("stribeck", (f"excess_{unit}",), low,
             f"friction is larger at low speed, -excess_{unit} * sign(rate) * exp(-(rate / speed)^2)",
             [{"speed": each * usual} for each in SPEEDS],
             lambda found: found[f"excess_{unit}"] > 0.0),
        term("direction_friction", (f"difference_{unit}",), lambda s, _: -np.abs(sign(s)),
             f"friction differs between the directions, -difference_{unit} * |sign(rate)|"),
        term("drag", (f"quadratic_{unit}_s2",), lambda s, _: -s[joint.rate] * np.abs(s[joint.rate]),
             f"drag, -quadratic_{unit}_s2 * rate * |rate|"),
    ]  # fmt: skip
    if joint.load:
        friction: Signal = lambda s, _: -sign(s) * np.abs(s[joint.load])  # noqa: E731
        made.append(
            term(
                "load_friction",
                ("share",),
                friction,
                f"friction grows with the load, share * |{joint.load}|",
                admissible=lambda found: found["share"] > 0.0,
            )
        )
    if joint.position:
        periods = [{"periods": float(each)} for each in joint.periods]
        made.append(term("once_per_turn", (f"cosine_{unit}", f"sine_{unit}"), around,
                         f"periodic, cosine and sine of periods * {joint.turns:g} * {joint.position}",
                         periods, phase=True))  # fmt: skip
    return made


def at_parameter(known: Known, recordings: Sequence[Recording]) -> list[Term]:
    """A parameter that does not stay as it is: a wall that fouls, a friction that warms up, a battery that ages."""
    unit = f"_{_word(known.unit)}" if known.unit else ""

    def term(change: Change) -> Term:
        coefficient = f"drift{unit}_per_s" if change is RAMP else f"change{unit}"
        return Term(
            "parameter_drift", known.name, PARAMETER, (coefficient,),
            lambda r, shape, values: {of(known.name): change.factor(r.table.elapsed_s, shape)},
            change.shapes(recordings),
            meaning=f"{known.name} changes during the run: value + {change.words.format(coefficient)}",
            independent=True, form=change.form, scale=change.scale, once=change.once,
        )  # fmt: skip

    return [term(change) for change in CHANGES]


def given_late(table: Table, column: Array, lag_s: float, way: Way) -> Array:
    """An input (n,) as it was `lag_s` before. One that is held, or a mean, has its mean over a step."""
    if way is Way.CUBIC:
        return delayed(table, column, lag_s)
    out = np.empty_like(column)
    for run in table.runs:
        out[run] = np.interp(table.time_s[run] - lag_s, table.time_s[run], column[run])
    return out


def given_slowly(table: Table, column: Array, lag_s: float, way: Way) -> Array:
    """An input (n,) behind a low-pass of first order. One that is held, or a mean, has its mean over a step."""
    if way in (Way.CUBIC, Way.LINE):
        return filtered(table, column, lag_s)
    ratio = table.step_s / lag_s
    kept = float(np.exp(-ratio))
    out = np.empty_like(column)
    for run in table.runs:
        given = column[run]
        before, _ = lfilter([0.0, 1.0 - kept], [1.0, -kept], given, zi=given[:1])  # at the start of each row's step
        out[run] = given + (before - given) * (1.0 - kept) / ratio
    return out


def _word(unit: str) -> str:
    """A unit as part of a name."""
    return unit.replace("/", "_per_").translate(str.maketrans("", "", " ^()")) or "unit"
