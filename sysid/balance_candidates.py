"""Candidate causes that every machine of one balance has, without a line of the user's.

At the response's sensor an offset, a drift, a slip and a lag; at every input a saturation and a dead zone; at the joint
frictions, drag, a spring, gravity, and what is periodic in the angle; at every parameter a change during the run.
Lags and changes have the forms of a simulated machine (`forms.py`).
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from ranger_sim.sysid import bands, regression, signals, units
from ranger_sim.sysid.dataset import Array, Table
from ranger_sim.sysid.forms import CHANGES, JUMP, LAGS, RAMP, Change, Lag, Shape
from ranger_sim.sysid.machine import PARAMETER, Columns, Effect, Known, Quantity, Recording, Values

SPEEDS = (0.02, 0.05, 0.1, 0.2, 0.4)  # of the fastest rate
PERIODS = (2.0, 3.0, 4.0, 6.0, 8.0, 12.0)  # per turn of the joint, or of the way that it travels
LIMITS = (0.2, 0.35, 0.5, 0.7, 0.85, 0.95)  # of the largest input: where it may saturate
ZONES = (0.005, 0.02, 0.05, 0.1, 0.2, 0.4)  # of the largest input: where nothing may come of it
RADIAN = units.Unit(("rad",))
SAME_FRICTION = 0.95  # correlation of a parameter's column with a friction that it is; a sine and its sign have 0.9
# Of the response's noise: what is late has less, or its columns are smoothed, by Gaussians of so many rows
QUIET, SMOOTHER = 0.05, (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
KEPT_ROWS = 50_000  # of a recording whose candidates' columns are made once, at 0.1 kB a row. Chosen by us
LEAST_SHOWN = 0.25  # of the rows that count: with fewer behind a lag all of them go on counting
CAUSES = "what named causes add"  # a signal of a recording whose sensor is late

Signals = Mapping[str, Array]
Made = Callable[[Signals, Shape], Sequence[Array]]  # the columns, (n,), of an effect at a shape
Fits = Callable[[Mapping[str, float]], bool]  # of an effect's coefficients and shape: a machine may have them


class Declares(Protocol):
    """What the candidates need of a machine."""

    name: str
    quantities: tuple[Quantity, ...]
    parameters: tuple[Known, ...]
    response: str
    angle: str
    rate: str

    def columns(self, s: Signals) -> Mapping[str, Array]: ...

    def more(self, s: Signals) -> Mapping[str, Sequence[Array]]: ...


def candidates(machine: Declares, recordings: Sequence[Recording]) -> list[Effect]:
    """All of them."""
    found = _of_sensor(machine, recordings)
    for each in machine.quantities:
        if each.is_input and each.name != machine.response:
            found += _of_input(machine, each.name, recordings)
    if machine.angle or machine.rate:
        found += _of_joint(machine, recordings)
    found += _of_parameters(machine, recordings)
    for cause, columns in machine.more(recordings[0].signals).items():
        names = tuple(f"size_{number}" for number in range(1, 1 + len(columns))) if len(columns) > 1 else ("size",)
        found.append(_effect(machine, cause, machine.name, names, _of_machine(machine, cause)))
    return found


def fastest(rate: Array) -> float:
    """Size of the fastest rate, without a few rows."""
    return max(float(np.quantile(np.abs(rate), 0.98)), 1e-12)


def _of_machine(machine: Declares, cause: str) -> Made:
    return lambda s, _: machine.more(s)[cause]


def _effect(
    machine: Declares,
    cause: str,
    at: str,
    names: tuple[str, ...],
    make: Made,
    shapes: Sequence[Shape] = ({},),
    form: str = "",
    forms: int = 1,
    scale: str | None = None,
    once: bool = False,
    real: Fits = lambda found: True,
) -> Effect:
    known: dict[tuple[int, tuple[float, ...]], tuple[Recording, Columns]] = {}

    def columns(recording: Recording, shape: Shape, _: Values) -> Columns:
        key = id(recording), tuple(shape.values())
        if key in known:
            return known[key][1]
        made = {machine.response: np.column_stack(make(recording.signals, shape))}
        if len(recording.table) <= KEPT_ROWS:
            known[key] = recording, made
        return made

    part = "sensor" if cause.startswith("sensor_") else PARAMETER if cause == "parameter_drift" else "mechanical"
    return Effect(
        cause, at, part, names, list(shapes), columns, form=form, forms=forms, scale=scale, once=once, real=real
    )


def _of_sensor(machine: Declares, recordings: Sequence[Recording]) -> list[Effect]:
    """An offset, a drift, a slip and a lag of what shows the response."""
    at = machine.response
    slip = JUMP.shapes(recordings)
    return [
        _effect(machine, "sensor_offset", at, ("offset",), lambda s, _: [np.ones_like(s["t"])]),
        _effect(machine, "sensor_drift", at, ("per_s",), lambda s, _: [s["t"]]),
        _effect(machine, "sensor_drift", at, ("change",), lambda s, shape: [JUMP.factor(s["t"], shape)], slip,
                JUMP.form, scale=JUMP.scale, once=JUMP.once),
        *(_lag(machine, each, recordings) for each in LAGS),
    ]  # fmt: skip


def _lag(machine: Declares, lag: Lag, recordings: Sequence[Recording]) -> Effect:
    """What the sensor shows less what it would show without the lag, by the equation as it is fitted with it.

    The equation without the lag has other parameters, those that explain the lag best. The response's noise is its
    sensor's, and is late in neither. The noise of the other sensors is taken off what is late: else a filter would
    explain that it is there.
    """
    seen: list[tuple[Recording, Array, Array]] = []  # with its columns and their slow parts
    made: dict[tuple[int, float], Columns] = {}

    def sensed(recording: Recording) -> tuple[Array, Array]:
        for one, columns, slow in seen:
            if one is recording:
                return columns, slow
        columns, slow = _sensed(recording, machine.response)
        seen.append((recording, columns, slow))
        return columns, slow

    shapes = lag.shapes(recordings)

    def columns(recording: Recording, shape: Shape, values: Values) -> Columns:
        lag_s = shape[lag.time]
        if shape == shapes[0]:
            return _of_first_order(machine, recording, values)
        known, slow = sensed(recording)
        if (id(recording), lag_s) not in made:
            late = lag.late(recording.table, slow, lag_s) - slow
            sizes = _fitted(recording, machine.response, known + late)
            made[id(recording), lag_s] = {machine.response: (late @ sizes / lag_s)[:, None]}
        return made[id(recording), lag_s]

    return Effect(
        "sensor_lag", machine.response, "sensor", ("lag_s",), shapes, columns, lag.fits(recordings),
        f"{machine.response} {lag.words}", form=lag.form, scale=lag.time, equals=lag.time,
    )  # fmt: skip


def _of_first_order(machine: Declares, recording: Recording, values: Values) -> Columns:
    """A lag of less than a row, or of the other sensors: by the slope of the equation as it is fitted without it."""
    made, step_s = recording.equations[machine.response].columns, recording.table.step_s
    shown = sum((values.get(name, 0.0) * column for name, column in made.items()), np.zeros(len(recording.table)))
    slope = signals.per_run(recording.table, lambda part: np.gradient(part, step_s), shown)
    return {machine.response: -slope[:, None]}


def behind(
    machine: Declares, recording: Recording, effects: Sequence[tuple[Effect, Shape, Sequence[float]]]
) -> Recording:
    """The recording with a lag that is among these effects: without rows at which the late sensor shows what the
    equation does not have, and with the other effects in what it measures. Itself without a lag."""
    late = [(effect, shape) for effect, shape, _ in effects if effect.cause == "sensor_lag"]
    if not late:
        return recording
    table, made = recording.table, recording.equations[machine.response]
    (effect, shape), *_ = late
    reach_s = max(float(shape[each.time]) * each.reaches for each in LAGS if each.form == effect.form)
    unknown = np.zeros(len(table), dtype=bool)
    unknown[[run.start for run in table.runs]] = True
    if machine.angle or machine.rate:
        unknown |= signals.resting(table, recording.signals["rate"])
    shown = made.valid & ~_after(table, unknown, reach_s)
    if np.count_nonzero(shown) < LEAST_SHOWN * np.count_nonzero(made.valid):
        shown = made.valid
    measured = [
        each.columns(recording, at, {})[machine.response] @ np.array(sizes)
        for each, at, sizes in effects
        if each.subsystem != "sensor"
    ]
    more = {CAUSES: np.sum(measured, axis=0)} if measured else {}
    equation = dataclasses.replace(made, valid=shown)
    return dataclasses.replace(
        recording, signals=recording.signals | more, equations=recording.equations | {machine.response: equation}
    )


def _after(table: Table, rows: np.ndarray, seconds: float) -> np.ndarray:
    """(n,) True for rows at most so long after one of these."""
    out = np.zeros(len(table), dtype=bool)
    for run in table.runs:
        stamps = np.where(rows[run], table.time_s[run], -np.inf)
        out[run] = table.time_s[run] - np.maximum.accumulate(stamps) <= seconds
    return out


def _sensed(recording: Recording, name: str) -> tuple[Array, Array]:
    """(n, k) columns of what a response's sensor measures, and what is left of them without most of their noise.

    They are those of the parameters, and the sum of what named causes add.
    """
    table, made = recording.table, recording.equations[name]
    columns = np.column_stack(
        [*made.columns.values(), *([recording.signals[CAUSES]] if CAUSES in recording.signals else [])]
    )
    sizes = _fitted(recording, name, columns)
    quiet = QUIET * signals.roughness(table, made.response)
    slow = columns.copy()
    for number, size in enumerate(sizes):
        for width in SMOOTHER:
            if abs(size) * signals.roughness(table, slow[:, number]) <= quiet:
                break
            slow[:, number] = _flat(table, columns[:, number], width)
    return columns, slow


def _flat(table: Table, column: Array, width: float) -> Array:
    """The column under a Gaussian of so many rows, taken so that it leaves slow motion as it is."""
    out = signals.smooth(table, column, width)
    for _ in range(2):
        out = out + signals.smooth(table, column - out, width)
    return out


def _fitted(recording: Recording, name: str, columns: Array) -> Array:
    """(k,) an equation's parameters with these columns (n, k)."""
    made = recording.equations[name]
    valid = regression.kept_rows(recording, made.valid)
    both = regression.reduced(recording, np.column_stack([columns, made.response]), name)[valid]
    return bands.least_squares(both[:, :-1], both[:, -1])


def _of_input(machine: Declares, name: str, recordings: Sequence[Recording]) -> list[Effect]:
    """A saturation and a dead zone."""
    top = max(float(np.max(np.abs(each.signals[name]))) for each in recordings)

    def saturated(s: Signals, p: Shape) -> list[Array]:
        return [-np.sign(s[name]) * np.maximum(np.abs(s[name]) - p["limit"], 0.0)]

    def dead(s: Signals, p: Shape) -> list[Array]:
        return [-np.clip(s[name], -p["zone"], p["zone"])]

    limits, zones = [{"limit": share * top} for share in LIMITS], [{"zone": share * top} for share in ZONES]
    return [
        _effect(machine, "saturation", name, ("share",), saturated, limits, scale="limit"),
        _effect(machine, "dead_zone", name, ("share",), dead, zones, scale="zone"),
    ]


def _of_parameters(machine: Declares, recordings: Sequence[Recording]) -> list[Effect]:
    """Changes of the parameters; one whose column is a constant changes as the response's sensor does."""
    first = recordings[0].equations[machine.response].columns
    names = [each.name for each in machine.parameters if each.name in first and np.ptp(first[each.name]) > 0.0]
    return [_change(machine, name, change, recordings) for name in names for change in CHANGES]


def _change(machine: Declares, name: str, change: Change, recordings: Sequence[Recording]) -> Effect:
    return _effect(
        machine, "parameter_drift", name, ("per_s" if change is RAMP else "change",),
        lambda s, shape: [machine.columns(s)[name] * change.factor(s["t"], shape)], change.shapes(recordings),
        change.form, scale=change.scale, once=change.once,
    )  # fmt: skip


def _load_friction(machine: Declares, joint: str, real: Fits) -> Effect:
    """Friction in proportion to the load: to inertia, gravity and what else of the machine is not a friction.

    It is of a fit with gravity and friction, whether or not the machine has them; a load that is measured would
    explain the response by itself.
    """

    def columns(recording: Recording, _: Shape, __: Values) -> Columns:
        s, equation = recording.signals, recording.equations[machine.response]
        columns = [s["rate"], s["direction"], np.ones_like(s["t"]), np.cos(s["angle"]), np.sin(s["angle"])]
        columns += equation.columns.values()
        both, valid = np.column_stack(columns), equation.valid
        size = np.linalg.lstsq(both[valid], equation.response[valid], rcond=None)[0]
        loads = [k for k, each in enumerate(columns) if np.ptp(each) > 0.0 and np.any(each * s["direction"] < 0.0)]
        return {machine.response: (s["direction"] * np.abs(both[:, loads] @ size[loads]))[:, None]}

    return Effect("load_friction", joint, "mechanical", ("share",), [{}], columns, real=real)


def _of_joint(machine: Declares, recordings: Sequence[Recording]) -> list[Effect]:
    """Frictions, drag, a spring, gravity, and what is periodic in the angle."""
    top = max(fastest(each.signals["rate"]) for each in recordings)
    reach = max(float(np.ptp(each.signals["angle"])) for each in recordings)
    angle_unit = next((units.unit_of(each.unit) for each in machine.quantities if each.name == machine.angle), RADIAN)
    turns = angle_unit is not None and angle_unit.same_kind(RADIAN)
    rad = angle_unit.factor if angle_unit is not None else 1.0  # of one unit of the angle
    cycle = 2.0 * np.pi / rad if turns else max(reach, 1e-9)
    joint = machine.angle or machine.rate
    resists = _resistance(machine, recordings[0], ("direction", "rate"))
    own_dry = _resistance(machine, recordings[0], ("direction",)) != 0.0

    def term(cause: str, names: tuple[str, ...], make: Made, shapes: Sequence[Shape] = ({},), **more: Any) -> Effect:
        return _effect(machine, cause, joint, names, make, shapes, **more)

    def waves(s: Signals, p: Shape) -> list[Array]:
        angle = 2.0 * np.pi * p["periods"] * s["angle"] / cycle
        return [np.cos(angle), np.sin(angle)]

    def slow(s: Signals, p: Shape) -> list[Array]:
        return [s["direction"] * np.exp(-((s["rate"] / p["speed"]) ** 2))]

    def friction(coefficient: str, in_part: bool = False) -> Fits:
        """In total a friction resists; what is a part of one that the machine has may be of either sign."""
        return lambda found: in_part or resists * found[coefficient] >= 0.0

    found = [
        term("viscous_friction", ("size",), lambda s, _: [s["rate"]]),
        term("coulomb_friction", ("size",), lambda s, _: [s["direction"]], real=friction("size", own_dry)),
        term("drag", ("size",), lambda s, _: [s["rate"] * np.abs(s["rate"])], form="square", forms=3),
        term("drag", ("size",), lambda s, _: [s["rate"] ** 3], form="cube", forms=3),
        term("drag", ("size",), lambda s, _: [s["direction"] * np.sqrt(np.abs(s["rate"]))], form="root", forms=3),
        term("stribeck", ("excess",), slow, [{"speed": share * top} for share in SPEEDS], real=friction("excess")),
        term("direction_friction", ("size",), lambda s, _: [np.abs(s["rate"])]),
        _load_friction(machine, joint, friction("share")),
        term("spring", ("size",), lambda s, _: [s["angle"]]),
        term("once_per_turn", ("cosine", "sine"), waves, [{"periods": n} for n in PERIODS]),
    ]
    if turns:
        gravity: Made = lambda s, _: [np.cos(rad * s["angle"]), np.sin(rad * s["angle"])]  # noqa: E731
        found.append(term("gravity", ("cosine", "sine"), gravity))
    return found


def _resistance(machine: Declares, recording: Recording, kinds: Sequence[str]) -> float:
    """1.0 where a friction goes with the rate in the response, as in a motor's torque; -1.0 where it goes against it;
    0.0 where no parameter is a friction. kinds: signals that are frictions."""
    s, made = recording.signals, recording.equations[machine.response]
    for known in machine.parameters:
        if known.low < 0.0 or known.name not in made.columns:
            continue
        column = made.columns[known.name][made.valid]
        for kind in kinds:
            one = s[kind][made.valid]
            size = float(np.linalg.norm(column) * np.linalg.norm(one))
            alike = float(column @ one) / size if size > 0.0 else 0.0
            if abs(alike) > SAME_FRICTION:
                return float(np.sign(alike))
    return 0.0
