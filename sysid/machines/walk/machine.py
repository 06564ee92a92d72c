"""Whole walking logs: balances of single stance and swing, closures at strikes, encoders, drives; as channels allow.

    floor       0 = ankle's torque - C dF - moments of everything about the contact point        EQUATIONS 5, 9.1
    legs        0 = both legs about the stance ankle, which needs no torque of the hip
    hip         torque of the hip's motor = K I - mu K |I| sgn w - C_0 sgn w
    outer foot, inner foot   foot in the air: its inertia against cable and return spring
    closure     at strikes both soles are on the floor: the gyro's gain from one to the next, its bias
    hip drive, ...           stage's power = R I^2 + V_c |I| + K w I + gates
    hip winding, ...         V = R I + V_c sgn I + K w
    hip encoders, ...        rate against the angle's derivative

The fit covers differences between robots (a drive's R, K and friction, zeros of motor encoders, the gyro's lag and the
constant of its integral) and not the body file's numbers: their deviations are causes. `Numbers` lists both.
"""

import functools
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy import ndimage

from ranger_sim.sysid import channels, signals
from ranger_sim.sysid.dataset import Array, Dataset, Table
from ranger_sim.sysid.machine import Effect, Equation, Known, NoEquationError, Quantity, Recording
from ranger_sim.sysid.machines.walk import causes, mechanics, strikes
from ranger_sim.sysid.machines.walk.base import PRIORS, TOLERATED, HIP_K_Nm_per_A
from ranger_sim.sysid.machines.walk.mechanics import LEGS, Course, Left, Motion, Numbers
from ranger_sim.sysid.machines.walk.recording import GYRO_BIAS_REACH_RAD_S, SIGN_RAD_S, Rows, WalkRecording, numbers_of
from ranger_sim.sysid.machines.walk.timebase import even_table, freshness

SMOOTH_S = 0.020  # Gaussian of all courses: stamps of 2 ms leave 0.3 rad/s^2 of noise in the hip's acceleration
SPACING_S = 3.0 * SMOOTH_S  # of rows that count: nearer ones repeat the information
AFTER_S, BEFORE_S = 0.150, 0.070  # of a strike that do not count: three Gaussians, and the trailing foot's push before
UNSURE_S = 0.040  # more on either side where only the hip indicates strikes
STEADY_A = 0.6  # between neighbouring samples of a slow current: above it, the time of the change is unknown
JUMP_REACH = 1.5  # Gaussians about such a jump that do not count
GYRO_BIAS_RAD_S = -0.004  # as the firmware of 2011 subtracts it (robot.md C3.1); the leg's rate has the opposite sign
LOAD_FRICTION = 0.1  # mu of the hip's gearhead: appendix table 3; the constant itself is fitted
SIGN_A = 0.05  # current over which the brushes' drop changes; chosen by us: a few counts of the sensors
STICKS_RAD_S = 0.3  # near standstill friction may be anything up to its limit (appendix eq. 35)
SLOW_FOOT_RAD_S = 1.5  # above it, stamps of a millisecond between motor and joint are two counts of the cable
COUNT_RAD = 2.0 * np.pi / 8192.0  # of a joint's encoder: a cable's stretch is not known better
ROBUST_ROUNDS = 8
SPIKE, FEW = 6.0, 0.08  # deviations beyond which single rows do not count, if they are at most this part

ANGLES = ("hip_angle_rad", "outer_ankle_angle_rad", "inner_ankle_angle_rad", "outer_motor_angle_rad",
          "inner_motor_angle_rad")  # fmt: skip
LEAN = ("outer_leg_angle_rad", "outer_leg_rate_rad_per_s")
MOTORS = {"hip": "hip", "outer_ankle": "outer", "inner_ankle": "inner"}
NEEDS = {
    "hip (spring, masses)": "hip_angle_rad, outer_leg_rate_rad_per_s or outer_leg_angle_rad, both ankle angles, "
    "hip_current_A",
    "floor and legs (geometry, masses, zeros)": "hip_angle_rad, outer_leg_rate_rad_per_s or outer_leg_angle_rad, both "
    "ankle angles, outer_motor_angle_rad and inner_motor_angle_rad",
    "a foot in the air (cable)": "its ankle's and its motor's angle, and the above",
    "a drive (resistance, constant)": "its battery power, current, and rate or angle",
    "a winding": "its voltage, current, and rate or angle",
    "encoders": "an angle and its rate",
}


class Walk:
    """body: the model that is diagnosed, by name or as a .toml file."""

    name = "walk"
    quantities = tuple(
        Quantity(each.name, each.unit, each.meaning, needed=False) for each in channels.EXPERIMENTS["walk"].channels
    )

    def __init__(self, body: str = "ranger") -> None:
        self.numbers, self.ankle_zero_rad = numbers_of(body)
        self.parameters = tuple(_known())

    def table(self, dataset: Dataset, names: Sequence[str]) -> Table:
        """The channels, which have different rates, on one time base."""
        return even_table(dataset, list(names), (*ANGLES, *LEAN))

    def prepare(self, table: Table) -> Recording:
        """Courses, strikes and every equation whose channels exist; UserError when no equation has its channels."""
        table = signals.uniform(table)
        recording = WalkRecording(
            table,
            {"t": table.elapsed_s},
            {},
            whitened=False,
            lags=(0,),
            left_over=True,
            noise_by_candidates=False,
        )
        recording.numbers = self.numbers
        motion, stands, single = self._motion(table, recording)
        rows: list[Rows] = []
        if motion is not None:
            rows += _stance_rows(table, motion, stands, single, recording)
        if recording.closures is not None:
            places, rates = recording.closures
            sound = abs(recording.gyro_bias_rad_s) < GYRO_BIAS_REACH_RAD_S
            columns = {"gyro_bias_rad_s": np.ones(len(table))} if sound else {}
            rows.append(Rows("closure", "S", "sensor", "rad/s", places, _fixed(rates), (), columns, fewest=8))
        rows += _drive_rows(table, single, recording)
        rows += _encoder_rows(table, single, recording)
        recording.rows = [each for each in rows if len(each.where) >= each.fewest]
        if not recording.rows:
            raise NoEquationError(_too_short(table, rows) if any(len(each.where) for each in rows) else _nothing(table))
        for each in recording.rows:
            recording.equations[each.name] = _equation(recording, each, self.numbers)
            if recording.places is not None and each.repeats:
                recording.repeats[each.name] = recording.places
            recording.floors[each.name] = each.floor
        fitted = {name for each in recording.equations.values() for name in each.columns}
        recording.priors = {name: prior for name, prior in PRIORS.items() if name in fitted}
        return recording

    def _motion(self, table: Table, recording: WalkRecording) -> tuple[Motion | None, np.ndarray, np.ndarray]:
        """Smoothed courses; the stance leg; single stance. No motion without hip, lean and both ankles."""
        everywhere = np.ones(len(table), dtype=bool)
        nobody = np.full(len(table), -1)
        if "hip_angle_rad" not in table:
            return None, nobody, everywhere
        touches = strikes.find(table)
        unsure = 0.0 if strikes.by_contact(table) else UNSURE_S
        stands, single = strikes.standing(table, touches, AFTER_S + unsure, BEFORE_S + unsure)
        single &= _inside(table, 3.0 * SMOOTH_S)
        both = all(name in table for name in ANGLES[1:3])
        lean = [name for name in LEAN if name in table]
        hip = _course(table, table["hip_angle_rad"])
        recording.signals |= {"hip": hip[0], "hip_rate": hip[1], "stands": stands.astype(float)}
        if np.any(single):
            recording.places = strikes.places(table, touches, stands, AFTER_S, SPACING_S)
        recording.regimes = {"on outer feet": stands == 0, "on inner feet": stands == 1, "swing": single}
        if not (both and lean and np.any(single)):
            return None, stands, single
        joints = [table[name] - self.ankle_zero_rad for name in ANGLES[1:3]]
        if "outer_leg_angle_rad" in table:
            leg = _course(table, table["outer_leg_angle_rad"])
            if "outer_leg_rate_rad_per_s" in table:
                rate = table["outer_leg_rate_rad_per_s"] + GYRO_BIAS_RAD_S
                leg = _course(table, table["outer_leg_angle_rad"], rate)
        else:
            leg = self._integrated(table, touches, joints, recording)
        ankles = tuple(_course(table, joint) for joint in joints)
        motors = tuple(
            _course(table, table[name] - self.ankle_zero_rad) if name in table else None for name in ANGLES[3:]
        )
        motion = Motion(hip, leg, (ankles[0], ankles[1]), (motors[0], motors[1]), np.linspace(-1.0, 1.0, len(table)))
        recording.signals |= {"lean": leg[0] - np.where(stands == 1, hip[0], 0.0), "lean_rate": leg[1]}
        return motion, stands, single

    def _integrated(
        self, table: Table, touches: Sequence[strikes.Strike], joints: Sequence[Array], recording: WalkRecording
    ) -> Course:
        """The outer leg's lean by the gyro: a constant in each run, and one bias in all, by the closures at strikes."""
        rate = table["outer_leg_rate_rad_per_s"] + GYRO_BIAS_RAD_S
        lean = np.zeros(len(table))
        for run in table.runs:
            steps = 0.5 * (rate[run][1:] + rate[run][:-1]) * table.step_s
            lean[run] = np.concatenate(([0.0], np.cumsum(steps)))
        places = np.array([int(np.searchsorted(table.time_s, each.time_s)) for each in touches], dtype=int)
        kept = [number for number, place in enumerate(places) if place < len(table)]
        runs = np.array([touches[number].run for number in kept], dtype=int)
        places = places[kept]
        offsets = _closing(self.numbers, table, lean, joints, places)
        good = np.isfinite(offsets) & (np.abs(offsets - np.nanmedian(offsets)) < 3.0)
        runs, places, offsets = runs[good], places[good], offsets[good]
        time_s = table.time_s - 0.5 * (table.time_s[0] + table.time_s[-1])
        if len(places) < 6:
            return _course(table, lean, rate)
        numbers = np.unique(runs)
        basis = np.column_stack([*(runs == number for number in numbers), time_s[places]]).astype(float)
        found = np.linalg.lstsq(basis, offsets, rcond=None)[0]
        left = offsets - basis @ found
        near = np.abs(left) < 3.0 * max(float(np.median(np.abs(left))) / 0.6745, 1e-4)
        found = np.linalg.lstsq(basis[near], offsets[near], rcond=None)[0]
        drift = float(found[-1])
        steps, same = np.diff(table.time_s[places[near]]), np.diff(runs[near]) == 0
        rates = -np.diff(offsets[near])[same] / steps[same]
        recording.closures = (places[near][1:][same], rates)
        recording.gyro_bias_rad_s = -drift
        lean += drift * time_s
        rate = rate + drift
        for number, constant in zip(numbers, found[:-1], strict=True):
            lean[table.runs[number]] += constant
        return _course(table, lean, rate)

    def generic(self, recording: Recording) -> dict[str, dict[str, Array]]:
        """Signals over which each equation is examined without a cause in mind."""
        s = recording.signals
        out: dict[str, dict[str, Array]] = {}
        for name, equation in recording.equations.items():
            wanted = ["hip", "lean", "t"] if equation.letter == "M" else ["t"]
            wanted += [name] if name in s else []
            out[name] = {each: s[each] for each in wanted if each in s}
        return out

    def effects(self, recordings: Sequence[Recording]) -> list[Effect]:
        """The catalogue's causes that such a log can have."""
        walks = [each for each in recordings if isinstance(each, WalkRecording)]
        return causes.made(walks)


def _known() -> list[Known]:
    """Base parameters of all equations, with limits that no robot exceeds (chosen by us: ten times either way)."""
    from ranger_sim.sysid.machines.walk.base import PARAMETERS

    return list(PARAMETERS)


def _slope(table: Table, column: Array) -> Array:
    """Rate of a column, run by run."""
    return signals.per_run(table, lambda part: np.gradient(part, table.step_s) if len(part) > 1 else 0.0 * part, column)


def _course(table: Table, column: Array, rate: Array | None = None) -> Course:
    """A column under the Gaussian, with rate, acceleration and its rate; `rate`: measured, not the column's slope."""
    width = SMOOTH_S / table.step_s
    smooth = signals.smooth(table, column, width)
    first = _slope(table, smooth) if rate is None else signals.smooth(table, rate, width)
    second = _slope(table, first)
    return smooth, first, second, _slope(table, second)


def _inside(table: Table, reach_s: float) -> np.ndarray:
    """True farther than reach_s from both ends of a run."""
    out = np.zeros(len(table), dtype=bool)
    for run in table.runs:
        time_s = table.time_s[run]
        out[run] = (time_s > time_s[0] + reach_s) & (time_s < time_s[-1] - reach_s)
    return out


def _closing(numbers: Numbers, table: Table, lean: Array, joints: Sequence[Array], places: np.ndarray) -> Array:
    """Correction of the outer leg's lean at each strike so that both soles are on the floor, (k,), or nan."""
    zeros = np.zeros(len(places))
    hip = (table["hip_angle_rad"][places], zeros, zeros, zeros)
    ankles = tuple((joint[places], zeros, zeros, zeros) for joint in joints)
    offset = 0.5 * hip[0] - lean[places]  # legs alike: the outer leg leans by half of the angle between them
    for _ in range(12):
        gaps = []
        for change in (0.0, 1e-5):
            leg = (lean[places] + offset + change, zeros, zeros, zeros)
            motion = Motion(hip, leg, (ankles[0], ankles[1]), (None, None), zeros)
            gaps.append(mechanics.height_difference(numbers, motion))
        slope = (gaps[1] - gaps[0]) / 1e-5
        step = np.where(np.abs(slope) > 0.02, -gaps[0] / np.where(slope == 0.0, 1.0, slope), np.nan)
        offset = offset + np.clip(step, -0.2, 0.2)
    return offset


def _thinned(mask: np.ndarray, recording: WalkRecording, spacing_s: float = SPACING_S) -> np.ndarray:
    """Numbers of rows that are True and at least this far from each other: at the same times after each strike."""
    time_s = recording.table.time_s
    if recording.places is not None:
        return np.flatnonzero(mask & (recording.places >= 0))
    kept: list[int] = []
    last = -np.inf
    for number in np.flatnonzero(mask).tolist():
        if time_s[number] - last >= spacing_s - 1e-9:
            kept.append(number)
            last = time_s[number]
    return np.asarray(kept, dtype=int)


def _stance_rows(
    table: Table, motion: Motion, stands: np.ndarray, single: np.ndarray, recording: WalkRecording
) -> list[Rows]:
    """floor, legs, hip and both feet in the air."""
    shared: tuple[str, ...] = ("leg_lag_s", "leg_lag_drift_s")
    if "outer_leg_angle_rad" not in table:
        shared += ("leg_zero_rad",)
    where = _thinned(single, recording)
    rows = []

    def of(what: Callable[[Left], Array | None], chosen: np.ndarray) -> Callable[[Numbers], Array]:
        parts = [np.flatnonzero(stands[chosen] == leg) for leg in (0, 1)]
        motions = [motion.part(chosen[part]) for part in parts]

        def left(numbers: Numbers) -> Array:
            out = np.zeros(len(chosen))
            for leg, part, moving in zip((0, 1), parts, motions, strict=True):
                made = what(mechanics.stance(numbers, moving, leg))
                assert made is not None
                out[part] = made
            return out

        return left

    of_leg = [(f"motor_zero_{name}_rad", f"motor_lag_{name}_s") for name in LEGS]
    if all(each is not None for each in motion.motor):
        for leg, name in enumerate(LEGS):
            chosen = where[stands[where] == leg]
            base = (*shared, *of_leg[leg], *TOLERATED)
            rows.append(
                Rows(
                    f"floor, {name}",
                    "M",
                    "mechanical",
                    "N m",
                    chosen,
                    of(lambda e: e.floor, chosen),
                    base,
                    repeats=True,
                )
            )
            rows.append(
                Rows(
                    f"legs, {name}", "M", "mechanical", "N m", chosen, of(lambda e: e.legs, chosen), base, repeats=True
                )
            )
    if "hip_current_A" in table:
        current, steady = _current(table, "hip_current_A")
        width = SMOOTH_S / table.step_s
        slow = ndimage.binary_dilation(np.abs(motion.hip[1]) < STICKS_RAD_S, iterations=round(width))
        chosen = _thinned(single & steady & ~slow, recording)
        sign = signals.smooth(table, np.tanh(_course(table, table["hip_angle_rad"])[1] / SIGN_RAD_S), width)
        recording.signals["hip_current"] = current
        columns = {
            "hip_torque_constant_Nm_per_A": current - LOAD_FRICTION * np.abs(current) * sign,
            "hip_constant_friction_Nm": -sign,
            "hip_viscous_friction_Nms": -motion.hip[1],
            "hip_current_offset_Nm": np.ones(len(table)),
            "hip_current_lag_s": HIP_K_Nm_per_A * _slope(table, current),
        }
        left = of(lambda e: e.hip_torque, chosen)
        rows.append(Rows("hip", "M", "mechanical", "N m", chosen, left, (*shared, *TOLERATED), columns, True))
    for leg, name in enumerate(LEGS):
        if motion.motor[leg] is None:
            continue
        slow = np.abs(_course(table, table[ANGLES[3 + leg]])[1]) < SLOW_FOOT_RAD_S
        chosen = _thinned(single & (stands == 1 - leg) & slow, recording)
        part = motion.part(chosen)
        left = functools.partial(_foot_left, motion=part, leg=leg)
        base = (*of_leg[leg], *TOLERATED)
        cable = getattr(recording.numbers, f"cable_{name}_Nm_per_rad")
        rows.append(
            Rows(f"{name} foot", "M", "transmission", "N m", chosen, left, base, fewest=20, floor=COUNT_RAD * cable)
        )
        recording.loads[f"{name} foot"] = mechanics.cable_torque(recording.numbers, motion, leg)
    return rows


def _foot_left(numbers: Numbers, motion: Motion, leg: int) -> Array:
    return mechanics.swing_foot(numbers, motion, leg)


def _current(table: Table, name: str) -> tuple[Array, np.ndarray]:
    """(current under the Gaussian, rows where it is known): unknown near a jump between two samples of a slow one."""
    value, fresh = table[name], freshness(table, name)
    known = np.ones(len(value), dtype=bool)
    if np.mean(fresh) < 0.4:
        places = np.flatnonzero(fresh)
        unknown = (np.abs(np.diff(value[places])) > STEADY_A) | (np.diff(table.time_s[places]) > 0.1)
        for start, stop in zip(places[:-1][unknown], places[1:][unknown], strict=True):
            known[start : stop + 1] = False
        reach = round(JUMP_REACH * SMOOTH_S / table.step_s)
        known = ~ndimage.binary_dilation(~known, iterations=reach)
    return signals.smooth(table, value, SMOOTH_S / table.step_s), known


def _drive_rows(table: Table, single: np.ndarray, recording: WalkRecording) -> list[Rows]:
    """Each stage's power, each winding's voltage; outside strikes, where a current is known."""
    rows = []
    for motor, joint in MOTORS.items():
        names = (f"{joint}_motor_rate_rad_per_s", f"{joint}_motor_angle_rad", f"{motor}_angle_rad")
        angle = next((name for name in names[1:] if name in table), None)
        if f"{motor}_current_A" not in table or angle is None:
            continue
        rate = _course(table, table[angle])[1]
        width = SMOOTH_S / table.step_s
        current, known = _current(table, f"{motor}_current_A")
        raw, fresh = table[f"{motor}_current_A"], freshness(table, f"{motor}_current_A")
        if table.step_s / max(float(np.mean(fresh)), 1e-9) > 2.0 * SMOOTH_S:
            continue  # sampled more slowly than it changes: at intervals of 60 ms and more in an ankle's push
        squares, sizes = signals.smooth(table, raw**2, width), signals.smooth(table, np.abs(raw), width)
        where = _thinned(single & known, recording)
        label = motor.replace("_", " ")
        if f"{motor}_battery_power_W" in table:
            power = signals.smooth(table, table[f"{motor}_battery_power_W"], width)
            columns = {
                f"{motor}_resistance_ohm": squares,
                f"{motor}_contact_drop_V": sizes,
                f"{motor}_generator_constant_Vs_per_rad": current * rate,
                f"{motor}_gates_W": np.ones(len(table)),
                f"{motor}_power_lag_s": -_slope(table, power),
            }
            rows.append(Rows(f"{label} drive", "P", "supply", "W", where, _fixed(power[where]), (), columns))
        if f"{motor}_voltage_V" in table:
            volts = signals.smooth(table, table[f"{motor}_voltage_V"], width)
            columns = {
                f"{motor}_resistance_ohm": current,
                f"{motor}_contact_drop_V": signals.smooth(table, np.tanh(raw / SIGN_A), width),
                f"{motor}_generator_constant_Vs_per_rad": rate,
                f"{motor}_voltage_lag_s": -_slope(table, volts),
            }
            rows.append(Rows(f"{label} winding", "E", "electrical", "V", where, _fixed(volts[where]), (), columns))
    return rows


def _fixed(values: Array) -> Callable[[Numbers], Array]:
    return lambda _: values


def _encoder_rows(table: Table, single: np.ndarray, recording: WalkRecording) -> list[Rows]:
    """A rate as its sensor gives it against the derivative of the angle; its lag is of the sensor."""
    rows = []
    for joint, name in (("hip", "hip"), ("outer_ankle", "outer ankle"), ("inner_ankle", "inner ankle")):
        angle, rate = f"{joint}_angle_rad", f"{joint}_rate_rad_per_s"
        if angle not in table or rate not in table or np.mean(freshness(table, rate)) < 0.3:
            continue
        course = _course(table, table[angle])
        given = signals.smooth(table, table[rate], SMOOTH_S / table.step_s)
        columns = {
            f"{joint}_rate_scale": course[1],
            f"{joint}_rate_lag_s": -course[2],
            f"{joint}_rate_filter_s2": course[3],
        }
        where = _thinned(single, recording)
        rows.append(Rows(f"{name} encoders", "S", "sensor", "rad/s", where, _fixed(given[where]), (), columns))
    return rows


def _equation(recording: WalkRecording, rows: Rows, numbers: Numbers) -> Equation:
    response = np.zeros(len(recording.table))
    response[rows.where] = rows.left(numbers)
    valid = np.zeros(len(recording.table), dtype=bool)
    valid[rows.where] = True
    columns = dict(rows.columns)
    for field in rows.base:
        column = recording.slope(rows.name, ((field, 1.0),))
        if np.any(column) or field not in PRIORS:
            columns[field] = column
    used = {name: column[rows.where] for name, column in columns.items()}
    valid[rows.where[_spikes(response[rows.where], used)]] = False
    return Equation(rows.name, rows.letter, rows.subsystem, rows.unit, response, columns, valid, few=rows.fewest)


def _spikes(response: Array, columns: Mapping[str, Array]) -> np.ndarray:
    """Numbers of single rows far outside all others: a foot that brushes the floor, lost or late samples; no effect.

    A fit of the base by least absolute deviations, which a single row does not attract, shows them.
    """
    left = response - np.median(response)
    names = list(columns)
    matrix = np.column_stack([columns[name] for name in names]) if names else np.zeros((len(response), 0))
    length = np.linalg.norm(matrix, axis=0)
    length = np.where(length > 0.0, length, 1.0)
    known = [(number, *PRIORS[name]) for number, name in enumerate(names) if name in PRIORS]
    for _ in range(ROBUST_ROUNDS):
        level = max(float(np.median(np.abs(left))) / 0.6745, 1e-12)
        weight = 1.0 / np.sqrt(np.maximum(np.abs(left) / level, 0.1))
        rows = [(matrix / length) * weight[:, None]]
        wanted = [response * weight]
        for number, value, deviation in known:  # in units of the residual
            row = np.zeros((1, len(names)))
            row[0, number] = level / (deviation * length[number])
            rows.append(row)
            wanted.append(np.array([level * value / deviation]))
        found = np.linalg.lstsq(np.vstack(rows), np.concatenate(wanted), rcond=1e-9)[0]
        left = response - (matrix / length) @ found
    left = left - np.median(left)
    far = np.flatnonzero(np.abs(left) > SPIKE * float(np.median(np.abs(left))) / 0.6745)
    return far if len(far) <= FEW * len(response) else far[:0]


def _too_short(table: Table, rows: Sequence[Rows]) -> str:
    most = max(rows, key=lambda each: len(each.where) / each.fewest)
    return (
        f"{table.name}: {table.time_s[-1] - table.time_s[0]:.3g} s of walking are too short: of its equations "
        f"{most.name!r} has most rows that count, {len(most.where)} of at least {most.fewest}"
    )


def _nothing(table: Table) -> str:
    there = ", ".join(name for name in table.columns if not name.endswith(" fresh"))
    needs = "; ".join(f"{what} needs {which}" for what, which in NEEDS.items())
    return f"{table.name}: no equation of a walk can be made of {there}: {needs}"
