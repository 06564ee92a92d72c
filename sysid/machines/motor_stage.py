"""Motor stages by their own meters: what a board takes from the battery against its motor's current and rate.

    P = V / 30 V (gates + switching) + R I^2 + V_c |I| + ripple + factor G K w I          EQUATIONS 10.6, 10.7

A robot sends these channels slowly, one after the other: `<BOARD>_BATT_POWER`, `_MOTOR_CURRENT`, `_MOTOR_VELOCITY` or
`_MOTOR_POSITION`, `_BATT_VOLTAGE`. Where the joint is at rest the distance between power and current does not matter,
and mechanical power is 0: holds give gates, R and V_c. Samples of one hold are not independent, because the brushes lie
on the same bars, so each hold is one row. Where the joint moves, the same law must explain the power with a factor of
1 before G K w I: a battery meter or a current sensor with a wrong scale has another one, a smaller drop has not. The
lag between the two channels is unknown there and found with the factor.
"""

import csv
import dataclasses
import math
import pathlib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy import stats

from ranger_sim.foundation.user_error import DataError
from ranger_sim.plant.body_files import BodyFile
from ranger_sim.plant.electrics.motor_parameters import MotorParameters
from ranger_sim.sysid.dataset import Array, Channel, Dataset

NAME = "motor-stage"
POWER, CURRENT, RATE = "BATT_POWER", "MOTOR_CURRENT", "MOTOR_VELOCITY"
POSITION, VOLTAGE = "MOTOR_POSITION", "BATT_VOLTAGE"
MOTORS = {"MCH": "hip", "MCFO": "outer_ankle", "MCFI": "inner_ankle", "MCSI": "steering"}
LONG = ("variable", "value")  # columns of a table with one sample a row, after its column of stamps
STAMPS = {"t_ms": 1e-3, "time_ms": 1e-3, "t_s": 1.0, "time_s": 1.0}  # that column, and its unit in s

AT_REST = 0.02  # rad/s of the joint: slower is standing where a neighbouring current agrees
QUITE_AT_REST = 0.002  # rad/s: standing whatever the neighbouring currents are
STILL = 0.1  # s before and after a sample in which a joint at rest does not move, where that was measured
SAME_ANGLE = 0.05  # rad that the joint may have moved within a hold
NO_CURRENT = 0.02  # A: below it the motor carries none
LEAST_V = 1.0  # of a battery: below it nothing was measured yet
FAR = 0.5  # s: the current of a power must have been measured within it
NEAR = 0.008  # s: for a moving joint
LAGS_S = np.arange(-40, 41) * 1e-3
FEWEST_SAMPLES = 3
FEWEST_HOLDS, FEWEST_MOVING, FEWEST_BLOCKS = 5, 50, 10
LEAST_W, SHARE = 0.02, 0.06  # deviation of a hold about the law: that of the meter, and the part of P of the brushes
NOT_IN_THE_LAW = 0.02  # of the factor: the ripple of a moving joint, stamps
CHANGED_W = 0.06  # between recordings at rest: five counts of the robot's meters
BEYOND = 1.2  # times the largest current of a fit: further out its prediction is named as such
LAW = ("gates", "R", "V_c", "switching")
NAMED_LEVEL = 0.01  # of all comparisons of all boards together
UNITS = {
    "gates": "W at 30 V",
    "switching": "W at 30 V",
    "R": "ohm",
    "V_c": "V",
    "current_zero": "A",
    "factor": "1",
    "lag": "s",
}


@dataclasses.dataclass(frozen=True)
class Value:
    """A parameter of one board: value, 95 % interval, and what the simulation has (None: nothing to compare with)."""

    name: str
    unit: str
    value: float
    low: float
    high: float
    simulated: float | None
    differs: bool = False


@dataclasses.dataclass
class Stage:
    """One board. holds, of them with current; values by name; held_out_*: of logs that were left aside, W."""

    board: str
    holds: int
    holds_with_current: int
    moving: int
    values: dict[str, Value]
    notes: list[str]
    left_W: float
    held_out_holds: int = 0
    held_out_before_W: float = math.nan
    held_out_after_W: float = math.nan
    held_out_inside: float = math.nan


@dataclasses.dataclass(frozen=True)
class Result:
    """The stages by board."""

    stages: dict[str, Stage]

    @property
    def detected(self) -> bool:
        """True when a parameter is not what the simulation has."""
        return any(value.differs for stage in self.stages.values() for value in stage.values.values())

    @property
    def compared(self) -> bool:
        """True when any parameter of a board could be compared with the simulation's."""
        values = (value for stage in self.stages.values() for value in stage.values.values())
        return any(value.simulated is not None for value in values)

    def to_dict(self) -> dict[str, Any]:
        """For programs: JSON's types only; a number that is not known is None."""
        return {
            "experiment": NAME,
            "detected": self.detected,
            "boards": {
                name: _finite({**dataclasses.asdict(stage), "values": list(map(dataclasses.asdict, each))})
                for name, stage in self.stages.items()
                for each in (stage.values.values(),)
            },
        }


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


# ---- reading ------------------------------------------------------------------------------------------------


def read_long(path: pathlib.Path) -> Dataset | None:
    """The channels of a table `t_ms, variable, value`; None when the file has another form. DataError for a bad row."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = csv.reader(file)
            head = [cell.strip() for cell in next(rows, [])]
            if len(head) != 3 or head[0] not in STAMPS or tuple(head[1:]) != LONG:
                return None
            found: dict[str, list[tuple[float, float]]] = {}
            for row in rows:
                if not row:
                    continue
                try:
                    stamp, name, value = row
                    pair = (STAMPS[head[0]] * float(stamp), float(value))
                except ValueError:
                    text = f"{path}:{rows.line_num}: {','.join(row)[:60]!r} is not {', '.join(head)}"
                    raise DataError(text) from None
                if not math.isfinite(pair[0]) or not math.isfinite(pair[1]):
                    raise DataError(f"{path}:{rows.line_num}: {name} is {value} at {stamp}: not a finite number")
                found.setdefault(name.strip(), []).append(pair)
    except (OSError, UnicodeDecodeError, csv.Error):
        return None  # the reader of all formats says what is wrong
    if not found:
        raise DataError(f"{path}: the table has no rows")
    channels = {}
    for name, pairs in found.items():
        time_s, value = np.array(sorted(pairs)).T
        channels[name] = Channel(name, "", time_s, value)
    return Dataset(path.name, channels)


def boards_of(datasets: Iterable[Dataset]) -> list[str]:
    """The boards that have battery power and motor current in one of these recordings. DataError for none."""
    found: dict[str, None] = {}
    names = []
    for dataset in datasets:
        names.append(dataset.name)
        for name in dataset.channels:
            board = name.removesuffix(f"_{POWER}")
            if board != name and f"{board}_{CURRENT}" in dataset:
                found[board] = None
    if not found:
        raise DataError(
            f"{', '.join(names)}: {NAME} needs BOARD_{POWER} and BOARD_{CURRENT} of at least one board, as MCH_{POWER} "
            f"and MCH_{CURRENT}; --map NAME=MCH_{POWER} names a channel"
        )
    return sorted(found, key=lambda board: [*MOTORS, board].index(board))


# ---- samples ------------------------------------------------------------------------------------------------


@dataclasses.dataclass
class Samples:
    """Of one board in one recording: power W, the nearest current A and rate rad/s, battery V, all (n,)."""

    name: str
    time_s: Array
    power: Array
    current: Array
    rate: Array
    volts: Array
    standing: np.ndarray
    angle: Array
    currents: Channel
    rate_of: Any  # stamps -> rad/s


def _nearest(channel: Channel, time_s: Array) -> np.ndarray:
    after = np.clip(np.searchsorted(channel.time_s, time_s), 1, max(1, len(channel.time_s) - 1))
    if len(channel.time_s) == 1:
        return np.zeros(len(time_s), dtype=int)
    earlier = time_s - channel.time_s[after - 1] < channel.time_s[after] - time_s
    return np.where(earlier, after - 1, after)


def _largest(channel: Channel, time_s: Array) -> Array:
    """The channel's largest size within STILL of each time, at least that of the nearest sample."""
    sizes = np.abs(channel.value)
    first, last = (np.searchsorted(channel.time_s, time_s + shift) for shift in (-STILL, STILL))
    near = _nearest(channel, time_s)
    first, last = np.minimum(first, near), np.maximum(last, near + 1)
    return np.array([float(np.max(sizes[a:b])) for a, b in zip(first, last, strict=True)])


def samples(dataset: Dataset, board: str) -> Samples | None:
    """The samples of a board; None when this recording has too few. DataError without a battery voltage."""
    if f"{board}_{POWER}" not in dataset or f"{board}_{CURRENT}" not in dataset:
        return None
    power, current = dataset[f"{board}_{POWER}"], dataset[f"{board}_{CURRENT}"]
    if len(power.value) < FEWEST_SAMPLES or len(current.value) < FEWEST_SAMPLES:
        return None
    names = (f"{board}_{VOLTAGE}", *(name for name in dataset.channels if name.endswith(VOLTAGE)))
    measured = (dataset[name] for name in names if name in dataset and np.any(dataset[name].value > LEAST_V))
    voltage = next(measured, None)
    if voltage is None:
        raise DataError(f"{dataset.name}: {NAME} needs {board}_{VOLTAGE}, or the battery voltage of another board")
    inside = (power.time_s >= current.time_s[0] - FAR) & (power.time_s <= current.time_s[-1] + FAR)
    inside &= np.isfinite(power.value) & (voltage.value[_nearest(voltage, power.time_s)] > LEAST_V)
    time_s, watts = power.time_s[inside], power.value[inside]
    if len(time_s) < FEWEST_SAMPLES:
        return None
    near = _nearest(current, time_s)
    amps = current.value[near]
    before, after = np.maximum(near - 1, 0), np.minimum(near + 1, len(current.value) - 1)
    away = np.minimum(np.abs(current.value[before] - amps), np.abs(current.value[after] - amps))
    steady = away < 0.1 * np.abs(amps) + 0.01
    rests = np.maximum(np.abs(current.value[before]), np.abs(current.value[after])) < 1.5 * NO_CURRENT
    position = dataset.channels.get(f"{board}_{POSITION}")
    rate = dataset.channels.get(f"{board}_{RATE}")
    if position is not None and len(position.value) > 3:
        angle = np.interp(time_s, position.time_s, position.value)
    else:
        angle = np.zeros(len(time_s))

    def rate_of(at: Array) -> Array:
        """Of the angle over 30 ms where it is sampled that densely, else the rate's sample within 20 ms, or NaN."""
        if position is not None and len(position.value) > 3 and float(np.median(np.diff(position.time_s))) < 0.03:
            ahead, back = (np.interp(at + shift, position.time_s, position.value) for shift in (0.015, -0.015))
            return np.asarray((ahead - back) / 0.03)
        if rate is not None and len(rate.value):
            near = _nearest(rate, at)
            return np.where(np.abs(rate.time_s[near] - at) < 0.02, rate.value[near], np.nan)
        return np.full(len(at), np.nan)

    if rate is not None and len(rate.value):
        slow = _largest(rate, time_s)
    else:
        slow = np.abs(np.nan_to_num(rate_of(time_s)))
    held = (slow < QUITE_AT_REST) | ((slow < AT_REST) & steady)
    standing = np.where(np.abs(amps) < NO_CURRENT, (slow < AT_REST) & rests, held)
    volts = np.interp(time_s, voltage.time_s, voltage.value)
    return Samples(dataset.name, time_s, watts, amps, slow, volts, standing, angle, current, rate_of)


@dataclasses.dataclass
class Holds:
    """One row a hold: mean power, |I|, I^2, battery V, and whether it carries a current, (n,)."""

    power: Array
    size: Array
    square: Array
    volts: Array
    loaded: np.ndarray
    zero: Array  # mean signed current

    def __len__(self) -> int:
        return len(self.power)


def holds(groups: Sequence[Samples], zero_A: float = 0.0) -> Holds:
    """The holds of a board: standing samples in a row, at one angle, with a current or without."""
    rows = []
    for each in groups:
        loaded = np.abs(each.current) >= NO_CURRENT
        at = np.flatnonzero(each.standing)
        if not len(at):
            continue
        cuts = (
            (np.diff(at) > 1) | (np.abs(np.diff(each.angle[at])) > SAME_ANGLE) | (np.diff(loaded[at].astype(int)) != 0)
        )
        cuts |= np.abs(np.diff(each.current[at])) > 0.3 * np.abs(each.current[at][1:]) + NO_CURRENT
        for run in np.split(at, np.flatnonzero(cuts) + 1):
            # where the motor carries none, what the sensor shows is noise, whose size is not a current's
            amps = (each.current[run] - zero_A) * loaded[run[0]]
            rows.append(
                (
                    float(np.median(each.power[run])),
                    float(np.mean(np.abs(amps))),
                    float(np.mean(amps**2)),
                    float(np.mean(each.volts[run])),
                    float(loaded[run[0]]),
                    float(np.mean(each.current[run])),
                )
            )
    table = np.array(rows, dtype=float).reshape(-1, 6)
    return Holds(table[:, 0], table[:, 1], table[:, 2], table[:, 3], table[:, 4] > 0.0, table[:, 5])


# ---- fits ---------------------------------------------------------------------------------------------------


@dataclasses.dataclass
class Fit:
    """Values (p,), their covariance (p, p), degrees of freedom, and weighted residuals (n,).

    cautious: a covariance (p, p) that counts rows which decide a value by themselves for more. Intervals hold with
    `covariance`; far out in its tails, where a value is named, they would not.
    """

    values: Array
    covariance: Array
    cautious: Array
    freedom: int
    left: Array

    def half(self, number: int) -> float:
        """Half of the 95 % interval of a value."""
        return self._half(self.covariance, number, 0.05)

    def named(self, number: int, level: float) -> float:
        """How far a value may be from another at this level before it is named."""
        return self._half(self.cautious, number, level)

    def _half(self, covariance: Array, number: int, level: float) -> float:
        return float(stats.t.ppf(1.0 - 0.5 * level, self.freedom) * math.sqrt(max(covariance[number, number], 0.0)))


def fitted(
    columns: Array, response: Array, deviation: Array, groups: np.ndarray | None = None, least: float = 1.0
) -> Fit:
    """Weighted least squares with Huber's weights beyond 2.5 deviations; the covariance allows for each row's own
    scatter (HC3; cautious: HC4 where that is more), or for that of groups of rows. least: deviations are not taken for
    smaller than this part of themselves."""
    weight = 1.0 / deviation
    for _ in range(20):
        a, y = columns * weight[:, None], response * weight
        values = np.asarray(np.linalg.lstsq(a, y, rcond=None)[0], dtype=np.float64)
        left = (response - columns @ values) / deviation
        scale = max(1.4826 * float(np.median(np.abs(left))), least)
        weight = np.sqrt(np.minimum(1.0, 2.5 * scale / np.maximum(np.abs(left), 1e-300))) / deviation
    a, y = columns * weight[:, None], response * weight
    bread = np.linalg.pinv(a.T @ a)
    rest = y - a @ values
    if groups is None:
        leverage = np.clip(np.einsum("ij,jk,ik->i", a, bread, a), 0.0, 0.95)
        more = np.maximum(2.0, np.minimum(4.0, leverage * len(y) / columns.shape[1]))
        meats = [(a * (rest**2 / (1.0 - leverage) ** power)[:, None]).T @ a for power in (np.full(len(y), 2.0), more)]
        count = len(y)
    else:
        numbers = np.unique(groups)
        sums = np.array([a[groups == number].T @ rest[groups == number] for number in numbers])
        count = len(numbers)
        meats = [sums.T @ sums * count / max(count - 1, 1)] * 2
    covariance, cautious = (np.asarray(bread @ meat @ bread, dtype=float) for meat in meats)
    return Fit(np.asarray(values, dtype=float), covariance, cautious, max(1, count - columns.shape[1]), left)


def simulated_of(motor: MotorParameters) -> dict[str, float]:
    """The law's parameters as simulated: at rest a lead toggles in every other slot, else in every one."""
    half = 0.5 * motor.gate_power_W if motor.gate_scheme == "switching" else 0.0
    return {
        "gates": motor.gate_power_W - half,
        "switching": half,
        "R": motor.loop_resistance_ohm,
        "V_c": motor.contact_drop_V,
        "current_zero": 0.0,
        "factor": 1.0,
    }


def ripple(motor: MotorParameters | None, size: Array, volts: Array, R: float, V_c: float) -> Array:
    """Loss of the current's ripple at rest, W, by the inductance that is simulated; 0 for an unknown motor."""
    if motor is None:
        return np.zeros_like(size)
    duty = np.clip((R * size + V_c * (size > 0.0)) / volts, 0.0, 1.0)
    swing = volts * duty * (1.0 - duty) / (motor.inductance_H(motor.pwm_frequency_hz) * motor.pwm_frequency_hz)
    return np.asarray(R * swing**2 / 12.0)


def law(found: Holds, values: Mapping[str, float], motor: MotorParameters | None) -> Array:
    """Power of holds, W."""
    gates = values["gates"] + found.loaded * values["switching"]
    rest = ripple(motor, found.size * found.loaded, found.volts, values["R"], values["V_c"])
    return np.asarray(found.volts / 30.0 * gates + values["R"] * found.square + values["V_c"] * found.size + rest)


def _deviation(power: Array) -> Array:
    return np.hypot(LEAST_W, SHARE * power)


def _columns(found: Holds, names: Sequence[str]) -> Array:
    at_30 = found.volts / 30.0
    every = {"gates": at_30, "switching": at_30 * found.loaded, "R": found.square, "V_c": found.size}
    return np.column_stack([every[name] for name in names])


def diagnose(data: Sequence[Dataset], holdout: Sequence[Dataset] = (), body: BodyFile | None = None) -> Result:
    """Every board of these recordings; holdout: recordings that are only predicted. body: what the simulation has.

    DataError for recordings without a motor stage.
    """
    boards = boards_of(data)
    stages = {}
    tests = 5 * len(boards)
    for board in boards:
        groups = [each for dataset in data if (each := samples(dataset, board)) is not None]
        if not groups:
            continue
        motor = getattr(body.electrics, MOTORS[board]) if body is not None and board in MOTORS else None
        stages[board] = stage(board, groups, motor, tests)
        kept = [each for dataset in holdout if (each := samples(dataset, board)) is not None]
        if kept:
            _predict(stages[board], kept, motor, holds(groups))
    if not stages:
        text = f"fewer than {FEWEST_SAMPLES} samples of power or current of {', '.join(boards)}"
        raise DataError(f"{', '.join(each.name for each in data)}: {text}")
    return Result(stages)


def stage(board: str, groups: Sequence[Samples], motor: MotorParameters | None, tests: int = 5) -> Stage:
    """One board's parameters out of its samples. motor: as simulated."""
    simulated = simulated_of(motor) if motor is not None else {}
    level = NAMED_LEVEL / tests
    notes: list[str] = []
    values: dict[str, Value] = {}

    def add(name: str, value: float, half: float, named: float) -> None:
        was = simulated.get(name)
        differs = was is not None and bool(abs(value - was) > max(named, 0.02 * abs(was)))
        values[name] = Value(name, UNITS[name], value, float(value - half), float(value + half), was, differs)

    first = holds(groups)
    rest = ~first.loaded
    zero = float(np.mean(first.zero[rest])) if np.any(rest) else 0.0
    found = holds(groups, zero)
    loaded = int(np.count_nonzero(found.loaded))
    result = Stage(board, len(found), loaded, 0, values, notes, math.nan)
    if np.count_nonzero(rest) > 2:
        spread = float(np.std(first.zero[rest], ddof=1)) / math.sqrt(float(np.count_nonzero(rest)))
        freedom = int(np.count_nonzero(rest)) - 1
        add(
            "current_zero",
            zero,
            stats.t.ppf(0.975, freedom) * spread,
            stats.t.ppf(1 - level / 2, freedom) * spread + 0.01,
        )
    ranges = float(np.ptp(found.size[found.loaded])) if loaded else 0.0
    names = list(LAW) if loaded >= FEWEST_HOLDS and ranges > 0.2 else ["gates"]
    if len(names) == 1:
        text = f"{loaded} holds with a current"
        notes.append(
            f"R, V_c: not to be seen, there are {text} over {ranges:.2g} A ({FEWEST_HOLDS} over 0.2 are needed)"
        )
    if len(names) > 1 and np.count_nonzero(~found.loaded) < 3:  # at rest a lead toggles in every other slot
        names.remove("switching")
        notes.append("switching: not to be seen without holds that carry no current; it is in gates")
    kept = found if len(names) > 1 else holds([_unloaded(each) for each in groups], zero)
    if len(kept) < 3:
        notes.append(f"gates: not to be seen, the joint is at rest in {len(kept)} stretches (3 are needed)")
        return result
    power = kept.power
    fit = fitted(_columns(kept, names), power, _deviation(kept.power))
    for _ in range(2 if len(names) > 1 else 0):  # the ripple goes with the duty, so with R and V_c
        power = kept.power - ripple(motor, kept.size * kept.loaded, kept.volts, *map(float, fit.values[1:3]))
        fit = fitted(_columns(kept, names), power, _deviation(kept.power))
    for number, name in enumerate(names):
        add(name, float(fit.values[number]), fit.half(number), fit.named(number, level))
    result.left_W = float(np.sqrt(np.mean((power - _columns(kept, names) @ fit.values) ** 2)))
    _note_changes(result, groups)
    _move(result, groups, zero, motor, fit, names, add, level)
    if "R" in values and values["R"].differs != values["V_c"].differs and simulated:
        notes.append("R and V_c are bound together: what one of them has less the other may have more")
    if any(values[each].differs for each in ("R", "V_c") if each in values) and "factor" not in values:
        notes.append("a drop (R, V_c) and the scale of a meter are tied: no moving joint says which of them it is")
    return result


def _note_changes(result: Stage, groups: Sequence[Samples]) -> None:
    """A note where recordings disagree about the power at rest: another program or another zero of the meter."""
    found = {each.name: holds([_unloaded(each)]) for each in groups}
    rests = {name: float(np.median(each.power)) for name, each in found.items() if len(each)}
    if len(rests) < 2:
        return
    middle = float(np.median(list(rests.values())))
    odd = [f"{name} {watts:.2f} W" for name, watts in rests.items() if abs(watts - middle) > CHANGED_W]
    if odd:
        text = f"gates: recordings disagree, {middle:.2f} W at rest in the middle one, but {', '.join(odd)}"
        result.notes.append(f"{text}; one fit of all does not hold for each")


def _unloaded(each: Samples) -> Samples:
    return dataclasses.replace(each, standing=each.standing & (np.abs(each.current) < NO_CURRENT))


def _move(
    result: Stage,
    groups: Sequence[Samples],
    zero: float,
    motor: MotorParameters | None,
    fit: Fit,
    names: Sequence[str],
    add: Any,
    level: float,
) -> None:
    """Factor of the mechanical power and lag of the current, where the joint moves."""
    if motor is None or len(names) == 1:
        return
    constant = motor.gear * motor.torque_constant_Nm_per_A

    def at(lag: float, static: Array) -> tuple[float, Fit, int] | None:
        """(how far samples are from the law, its factor, their number) with this lag; static: values of LAW."""
        rows = []
        for number, each in enumerate(groups):
            near = _nearest(each.currents, each.time_s + lag)
            stamps = each.currents.time_s[near]
            rate = each.rate_of(each.time_s)
            taken = (np.abs(stamps - each.time_s - lag) < NEAR) & (np.nan_to_num(np.abs(rate)) > 10.0 * AT_REST)
            amps = each.currents.value[near][taken] - zero
            block = 1e6 * number + np.floor(each.time_s[taken])
            rows.append(np.column_stack((each.power[taken], amps, rate[taken], each.volts[taken], block)))
        power, amps, rate, volts, block = np.concatenate(rows).T
        if len(power) < FEWEST_MOVING or len(np.unique(block)) < FEWEST_BLOCKS:
            return None
        loss = volts / 30.0 * (static[0] + sum(static[3:])) + static[1] * amps**2 + static[2] * np.abs(amps)
        columns = np.column_stack((np.ones(len(power)), constant * rate * amps))
        made = fitted(columns, power - loss, np.full(len(power), 1.0), block, 1e-12)
        size = np.abs(made.left)
        return float(np.mean(np.minimum(size, 3.0 * np.median(size) + 1e-12))), made, len(power)

    tried = {float(lag): found for lag in LAGS_S if (found := at(float(lag), fit.values)) is not None}
    if not tried:
        return
    lag = min(tried, key=lambda each: tried[each][0])
    _, made, result.moving = tried[lag]
    factor = float(made.values[1])
    # what R, V_c and the lag leave open moves the factor as well
    moved = [0.0]
    sizes, directions = np.linalg.eigh(fit.covariance)
    for size, direction in zip(sizes, directions.T, strict=True):
        other = at(lag, fit.values + 2.0 * math.sqrt(max(float(size), 0.0)) * direction)
        moved.append(float(other[1].values[1]) - factor if other else 0.0)
    lags = [float(tried[each][1].values[1]) - factor for each in tried if abs(each - lag) <= 0.5 * NEAR]
    more = math.hypot(max(map(abs, lags)), *moved)
    wide = float(stats.t.ppf(1.0 - 0.5 * level, made.freedom) / stats.t.ppf(0.975, made.freedom))
    half = math.hypot(made.half(1), more, NOT_IN_THE_LAW)
    add("factor", factor, half, wide * half)
    result.values["lag"] = Value("lag", "s", lag, lag - NEAR, lag + NEAR, None)


def _predict(stage: Stage, kept: Sequence[Samples], motor: MotorParameters | None, of_fit: Holds) -> None:
    """Holds of recordings that were left aside: errors of the simulation's law and of the one found. of_fit: the holds
    that it was found in; what lies far beyond their currents is named: R and V_c replace each other among them."""
    zero = stage.values["current_zero"].value if "current_zero" in stage.values else 0.0
    found = holds(kept, zero)
    if "R" not in stage.values:
        found = holds([_unloaded(each) for each in kept], zero)
    if not len(found) or "gates" not in stage.values:
        return
    values = {name: stage.values[name].value if name in stage.values else 0.0 for name in LAW}
    after = law(found, values, motor) - found.power
    stage.held_out_holds = len(found)
    stage.held_out_after_W = float(np.sqrt(np.mean(after**2)))
    most = float(np.max(of_fit.size[of_fit.loaded], initial=0.0))
    beyond = found.size > BEYOND * most
    if "R" in stage.values and np.any(beyond):
        rest = after[~beyond]
        others = f"; that of the others is {np.sqrt(np.mean(rest**2)):.2f} W" if len(rest) else ""
        stage.notes.append(
            f"held-out holds of up to {np.max(found.size):.2f} A exceed the {most:.2f} A of these recordings, where "
            f"R and V_c replace each other: their error is {np.sqrt(np.mean(after[beyond] ** 2)):.2f} W{others}"
        )
    stage.held_out_inside = float(np.mean(np.abs(after) < 2.0 * np.hypot(2.0 * LEAST_W, SHARE * found.power)))
    if motor is not None:
        stage.held_out_before_W = float(np.sqrt(np.mean((law(found, simulated_of(motor), motor) - found.power) ** 2)))
