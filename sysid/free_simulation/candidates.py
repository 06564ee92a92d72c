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

import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from ranger_sim.sysid.dataset import Array, Table
from ranger_sim.sysid.free_simulation.recording import SimulatedRecording, Way
from ranger_sim.sysid.free_simulation.terms import Joint, Output, Ports, Shape, Term, into, of, on, sensed, shown
from ranger_sim.sysid.machine import PARAMETER, Known, Recording, Values

FINEST_LAG, COARSER = 0.5, 1.6  # samples; from one lag of the grid to the next
NEAR = 2.0  # times a lag of the grid: what a lag made with it may come out as, but for the shortest
MOST_LAG_SAMPLES, LAGS_IN_A_RECORDING = 400, 20.0  # a lag is shorter, and so many fit into the recording
SPEEDS = (0.05, 0.15, 0.5)  # of a rate's rms: about which Stribeck's excess falls off
SLOW = 0.01  # of a rate's rms: about which a smoothed sign turns, where the joint does not say
CLIPPED = (0.2, 0.35, 0.5, 0.7, 0.85, 0.95, 0.99)  # quantiles of an input's size at which it may saturate
# Of a dead zone or a saturation: a hard one has 1, at the right limit. At the grid's limit near it the share may be a
# multiple; much less or more is another effect's shadow (131 in a ship's zigzag). Chosen by us
LEAST_SHARE, MOST_SHARE = 0.5, 20.0
JUMPED = (0.03, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 0.97)  # of the longest recording: when something jumps
SETTLED = (0.15, 0.5, 1.5, 5.0)  # of the longest recording: time constants of a parameter that settles
DEAD = (0.002, 0.005, 0.02, 0.05, 0.1, 0.2, 0.4)  # of an input's largest size


class Declares(Protocol):
    """What the candidates need of a machine."""

    outputs: tuple[Output, ...]
    joints: tuple[Joint, ...]
    parameters: tuple[Known, ...]


Signal = Callable[[Mapping[str, Array], Shape], Array]


def candidates(machine: Declares, inputs: Sequence[str], recordings: Sequence[Recording]) -> list[Term]:
    """All of them. inputs: names of the simulator's inputs."""
    made: list[Term] = []
    for output in machine.outputs:
        made += at_output(output, recordings)
    for name in inputs:
        made += at_input(name, recordings)
    for joint in machine.joints:
        made += at_joint(joint, recordings)
    for known in machine.parameters:
        made += at_parameter(known, recordings)
    return made


def at_output(output: Output, recordings: Sequence[Recording]) -> list[Term]:
    """An output's offset, scale, drift and lag."""
    name, place, unit = output.channel, shown(output.channel), _word(output.unit)

    def sensor(cause: str, coefficient: str, make: Callable[[Table, Array], Array], meaning: str) -> Term:
        return Term(
            cause, name, "sensor", (coefficient,),
            lambda r, shape, values: {place: make(r.table, r.signals[sensed(name)])}, meaning=meaning, independent=True,
        )  # fmt: skip

    def drift(form: str, coefficient: str, make: Callable[[Array, Shape], Array], words: str, shapes: Sequence[Shape],
              scale: str | None = None, once: bool = False) -> Term:  # fmt: skip
        return Term(
            "sensor_drift", name, "sensor", (coefficient,),
            lambda r, shape, values: {place: make(r.table.elapsed_s, shape)}, shapes,
            meaning=f"{name} drifts: {words}", independent=True, form=form, scale=scale, once=once,
        )  # fmt: skip

    def lag(form: str, time: str, late: Callable[[Table, Array, float], Array], meaning: str) -> Term:
        def make(r: Recording, shape: Shape, values: Mapping[str, float]) -> dict[str, Array]:
            seen, lag_s = r.signals[sensed(name)], shape[time]
            return {place: (late(r.table, seen, lag_s) - seen) / lag_s}

        return _lag("sensor_lag", name, "sensor", form, time, make, meaning, recordings)

    return [
        sensor("sensor_offset", f"offset_{unit}", lambda table, seen: np.ones(len(table)),
               f"{name} shows a constant too much: true value + offset_{unit}"),
        sensor("sensor_scale", "share", lambda table, seen: seen,
               f"{name} shows a multiple of what it measures: true value * (1 + share)"),
        drift("", f"drift_{unit}_per_s", lambda t, _: t,
              f"true value + drift_{unit}_per_s * time since the recording's start", [{}]),
        drift("jump", f"change_{unit}", _jumped, f"true value + change_{unit} from at_s after the recording's start on",
              _jumps(recordings), "at_s", once=True),
        lag("delay", "delay_s", delayed, f"{name} is late: it shows the true value of lag_s before"),
        lag("filter", "time_constant_s", filtered,
            f"{name} lags: it shows the true value behind a low-pass of first order with the time constant lag_s"),
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
        lambda r, shape, values: {into(name): _jumped(r.table.elapsed_s, shape)}, _jumps(recordings),
        meaning=f"the machine gets {name} + change from at_s after the recording's start on",
        independent=True, form="jump", scale="at_s", once=True,
    )  # fmt: skip
    made = [term("input_offset", "offset", lambda s, _: np.ones_like(s[name]),
                 f"the machine gets {name} + offset"), slips]  # fmt: skip

    def lag(form: str, time: str, late: Callable[[Table, Array, float, Way], Array], meaning: str) -> Term:
        def make(r: SimulatedRecording, shape: Shape, values: Mapping[str, float]) -> dict[str, Array]:
            given, lag_s = r.signals[name], shape[time]
            return {into(name): (late(r.table, given, lag_s, r.ways[name]) - given) / lag_s}

        return _lag("input_lag", name, "input", form, time, make, meaning, recordings)

    made += [
        lag("delay", "delay_s", given_late, f"the machine gets {name} late: its value of lag_s before"),
        lag("filter", "time_constant_s", given_slowly,
            f"the machine gets {name} behind a low-pass of first order with the time constant lag_s"),
    ]  # fmt: skip
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
            term("load_friction", ("share",), friction, f"friction grows with the load, share * |{joint.load}|")
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
    longest_s = _longest_s(recordings)

    def term(form: str, coefficient: str, make: Callable[[Array, Shape], Array], words: str, shapes: Sequence[Shape],
             scale: str | None = None, once: bool = False) -> Term:  # fmt: skip
        return Term(
            "parameter_drift", known.name, PARAMETER, (coefficient,),
            lambda r, shape, values: {of(known.name): make(r.table.elapsed_s, shape)}, shapes,
            meaning=f"{known.name} changes during the run: {words}",
            independent=True, form=form, scale=scale, once=once,
        )  # fmt: skip

    drift, change = f"drift{unit}_per_s", f"change{unit}"
    return [
        term("ramp", drift, lambda t, _: t, f"value + {drift} * time since the recording's start", [{}]),
        term("settling", change, lambda t, shape: -np.expm1(-t / shape["tau_s"]),
             f"value + {change} * (1 - exp(-time since the recording's start / tau_s))",
             [{"tau_s": share * longest_s} for share in SETTLED], "tau_s"),
        term("jump", change, _jumped, f"value + {change} from at_s after the recording's start on",
             _jumps(recordings), "at_s", once=True),
    ]  # fmt: skip


def delayed(table: Table, column: Array, lag_s: float) -> Array:
    """A column (n,) as it was `lag_s` before, on cubics between its rows; a run's first value before its start.

    Straight lines would smooth what is late by half a row, as another sensor does.
    """
    out = np.empty_like(column)
    for run in table.runs:
        stamps, values = table.time_s[run], column[run]
        before = np.maximum(stamps - lag_s, stamps[0])
        out[run] = CubicSpline(stamps, values)(before) if len(stamps) > 1 else values
    return out


def filtered(table: Table, column: Array, lag_s: float) -> Array:
    """A column (n,) behind a low-pass of first order with this time constant, exact for straight lines in between."""
    ratio = table.step_s / lag_s
    kept = float(np.exp(-ratio))
    through = (1.0 - kept) / ratio
    out = np.empty_like(column)
    for run in table.runs:
        first = through * column[run][:1]  # so that the first value is the column's own
        out[run], _ = lfilter([1.0 - through, through - kept], [1.0, -kept], column[run], zi=first)
    return out


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
        before, _ = lfilter([0.0, 1.0 - kept], [1.0, -kept], given, zi=given[:1])  # at the begin of each row's step
        out[run] = given + (before - given) * (1.0 - kept) / ratio
    return out


def _lag(
    cause: str,
    at: str,
    subsystem: str,
    form: str,
    time: str,
    make: Callable[[SimulatedRecording, Shape, Values], Ports],
    meaning: str,
    recordings: Sequence[Recording],
) -> Term:
    """A lag on the grid; time: its name there."""
    grid = _lags(recordings)

    def fits(found: Mapping[str, float]) -> bool:
        return found[time] <= grid[0] or 1.0 / NEAR < found["lag_s"] / found[time] < NEAR

    return Term(
        cause, at, subsystem, ("lag_s",), make, [{time: each} for each in grid], fits,
        meaning=meaning, independent=True, form=form, scale=time,
    )  # fmt: skip


def _longest_s(recordings: Sequence[Recording]) -> float:
    return max(float(np.ptp(each.table.time_s)) for each in recordings)


def _jumps(recordings: Sequence[Recording]) -> list[Shape]:
    """Grid of times at which something jumps."""
    return [{"at_s": share * _longest_s(recordings)} for share in JUMPED]


def _jumped(elapsed_s: Array, shape: Shape) -> Array:
    """(n,) 0 before the jump and 1 from it on."""
    return np.where(elapsed_s < shape["at_s"], 0.0, 1.0)


def _lags(recordings: Sequence[Recording]) -> list[float]:
    """Grid of lags in seconds: from half a sample to a part of the shortest recording, each longer by a factor."""
    table = min((each.table for each in recordings), key=len)
    most = min(float(MOST_LAG_SAMPLES), len(table) / LAGS_IN_A_RECORDING)
    grid = itertools.takewhile(lambda lag: lag <= most, (FINEST_LAG * COARSER**n for n in itertools.count()))
    return [each * table.step_s for each in (*grid, most)]


def _word(unit: str) -> str:
    """A unit as part of a name."""
    return unit.replace("/", "_per_").translate(str.maketrans("", "", " ^()")) or "unit"
