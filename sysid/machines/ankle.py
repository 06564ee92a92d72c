"""An ankle that follows a sine while the robot hangs: the board's law on the motor's angle, and what the angles show.

The law is stiff: 1 ms of latency is 0.25 A at the fast sine, as much as the motor draws. So no current is computed
from angles. The law is inside the simulation (`ankle_motion.py`), the angles of a free simulation are compared, and
an equation is one angle, linearised about the motion that fits best:

    joint         a - a_simulated = sum over parameters of change x sensitivity        where only the joint is measured
    motor         the same of p
    transmission  the same of a - p                                                    where both are measured
    joint rate    the same of a', where it is measured

Free in it is what no two ankles share: foot, spring, friction with its part under load, cable, rotor, the zero of one
angle against the other, the lag of the current. What of these the angles do not tell stays where it is known to be
(`SPREAD`). The motor creeps inside its friction, as the simulator's does, or stands still, as a machine does: whichever
fits.

The response is that difference plus the found values times their sensitivities, so that values come out as they are.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.signal import lfilter

from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant.motor_parameters import ANKLE_MOTOR
from ranger_sim.sysid import plausibility, signals
from ranger_sim.sysid.dataset import Array, Finding, Table
from ranger_sim.sysid.machine import Columns, Effect, Equation, Known, Quantity, Recording, Values
from ranger_sim.sysid.machines import ankle_motion
from ranger_sim.sysid.machines.ankle_motion import (
    CABLE,
    COULOMB,
    INERTIA,
    LAG,
    LOAD,
    PARAMETERS,
    RATE_FILTER_S,
    ROTOR,
    SMOOTHED,
    STANDING,
    STIFFNESS,
    TORQUE,
    USUAL,
    VISCOUS,
    ZERO,
    Drive,
    Motion,
)
from ranger_sim.sysid.machines.forms import bristles
from ranger_sim.sysid.regression import Regression

# of the robot's foot-inertia logs, which do not hold them (robot.md C6.2)
STIFFNESS_A_per_rad, DAMPNESS_As_per_rad = 11.219, 1.634
SETTLED_S = 0.5  # from a run's start, which is not known exactly: the law's slow pole is K / D = 7 to 15 1/s
SHORTEST_S = 1.0  # of a run
FEWEST = 50  # rows of a run
EVERY, WIDTH = 3, 1.5  # samples: rows that count, and the Gaussian over both sides
MOST_STEPS, MOST_TRIES = 25, 8  # of the fit, and of one step's damping
# The robot's program limits the target from below and feeds forward the return spring that it believes in: the sine
# logs hold I_0 (docs/ankle-measured.md). A log with targets only may come of it, or of the plain law.
FLOOR_rad, FORWARD_A_per_rad, FORWARD_REST_rad = 0.3, 0.134 / (34.0 * 0.018), 1.662
ROUGHLY, FULLY = 1e-2, 1e-4  # of the sum of squares that a step must win for another one
INERTIA_STARTS = (1.0, 2.5)  # of its value: the cable's ringing makes the sum of squares rugged along the inertia
# Chosen by us: a motor's ripple is a part of its torque, cogging is of the size of its friction, and an encoder whose
# disc is out of centre by more than 2 % of its radius does not read.
LARGEST_RIPPLE, LARGEST_COGGING_Nm, LARGEST_ECCENTRICITY_rad = 0.5, 0.1, 0.02
SLOW = 5.0  # times what is new in it from row to row: noise of these encoders has 1.1 to 1.4, on blind recordings
SLOWEST_NOISE = 0.9  # memory from row to row (12 ms) of what the base leaves, at most: beyond it, it is an effect's
MEMORY = 10.0  # samples of a misfit that tell the same
JOINT, MOTOR, TRANSMISSION, RATE = "joint", "motor", "transmission", "joint rate"
# How well a parameter is known before any data: where the angles do not tell it, the fit stays there. Chosen by us: a
# motor's torque constant, in whose unit all torques are, is known to 20 %, its friction under load to half; a cable's
# stiffness depends on how it lies, a foot's inertia on what is screwed to it; the robot's logs have zeros of 0.02 to
# 0.04 rad (docs/ankle-measured.md); half a slot of the board (0.25 ms) and its current loop are 0.5 to 1 ms.
SPREAD = {INERTIA: 0.0013, LOAD: 0.05, CABLE: 5.0, ROTOR: 0.0004, ZERO: 0.04, LAG: 0.0005}

Shape = Mapping[str, float]


@dataclasses.dataclass
class Run:
    """One run of a recording and the motion that was found for it. rows: in the table."""

    rows: slice
    drive: Drive
    motion: Motion
    target_rad: Array  # (m,) at the motion's steps; of the command where no target is logged
    target_rate_rad_per_s: Array


@dataclasses.dataclass
class AnkleRecording(Recording):
    """A recording with its simulated runs, and the values that the simulation has."""

    simulated: list[Run] = dataclasses.field(default_factory=list)
    values: dict[str, float] = dataclasses.field(default_factory=dict)
    made: dict[tuple, Columns] = dataclasses.field(default_factory=dict)  # columns of effects, by effect and shape


# torques (m,) at motor and foot of a run, for one coefficient; or what motor and joint show beside it, (m,) each
Pair = tuple[Array, Array]
Make = Callable[[Run, Table, Shape], list[Pair]]
Torque = Callable[[Motion], Array]


class Ankle:
    """The robot's inner ankle, hanging."""

    name = "ankle"
    quantities = (
        Quantity("joint_angle_rad", "rad", "of the ankle"),
        Quantity("motor_angle_rad", "rad", "of the motor's shaft over the gear", needed=False),
        Quantity("joint_rate_rad_per_s", "rad/s", "of the ankle", needed=False),
        Quantity("target_angle_rad", "rad", "asked for", needed=False),
        Quantity("target_rate_rad_per_s", "rad/s", "asked for", needed=False),
        Quantity("command_current_A", "A", "the law's current at angle 0 and rate 0", needed=False),
        Quantity("command_stiffness_A_per_rad", "A/rad", "gain on the angle", needed=False),
        Quantity("command_dampness_A_s_per_rad", "A s/rad", "gain on the rate", needed=False),
    )
    # Values: robot.md P3, the inner ankle. Limits chosen by us, far beyond any ankle of this size.
    parameters = (
        Known(INERTIA, "kg m^2", 0.0013, 1e-4, 0.1, "of the foot about the ankle"),
        Known(STIFFNESS, "N m/rad", 0.33, -5.0, 5.0, "of the return spring"),
        Known(TORQUE, "N m", 0.55, -5.0, 5.0, "of the return spring at angle 0"),
        Known(COULOMB, "N m", 0.06, 0.0, 2.0, "of motor and gearbox"),
        Known(VISCOUS, "N m s/rad", 0.01, -0.5, 1.0, "of motor and gearbox"),
        Known(LOAD, "", USUAL[LOAD], 0.0, 0.9, "part of the motor's torque that friction takes"),
        Known(CABLE, "N m/rad", USUAL[CABLE], 1.0, 1e3, "of the cable"),
        Known(ROTOR, "kg m^2", USUAL[ROTOR], 1e-4, 0.1, "of the rotor behind the gear; another torque constant too"),
        Known(LAG, "s", USUAL[LAG], 0.0, 0.02, "of the current behind the law"),
        Known(ZERO, "rad", USUAL[ZERO], -0.5, 0.5, "what the joint's encoder shows at the motor's zero"),
    )

    def prepare(self, table: Table) -> AnkleRecording:
        """Fits the base to the angles in free simulation, and linearises about it."""
        _check(table)
        table = signals.uniform(table)
        fit = _Fit(table, self.parameters)
        fit.improve()
        if "command_current_A" not in table and float(np.min(table["target_angle_rad"])) < FLOOR_rad:
            other = _Fit(table, self.parameters, of_program=True)
            other.improve()
            if float(other.missed @ other.missed) < float(fit.missed @ fit.missed):
                fit = other
        recording = AnkleRecording(table, {}, {}, width=WIDTH, every=EVERY, left_over=True, simulated=fit.runs)
        recording.values = dict(fit.values)
        recording.priors = {name: (fit.usual[name], spread) for name, spread in SPREAD.items()}
        if fit.of_program:
            recording.findings.append(_program_found(table))
        s = recording.signals = _signals(table, fit.runs)
        valid = fit.valid
        sensitivity = np.zeros((len(table), ankle_motion.STATES, len(PARAMETERS)))
        for run in fit.runs:
            sensitivity[run.rows] = ankle_motion.sensitivities(run.motion)[run.motion.rows]

        def equation(name: str, letter: str, subsystem: str, missed: Array, slopes: Array) -> None:
            columns = {each: slopes[:, PARAMETERS.index(each)] for each in PARAMETERS}
            response = missed + sum(fit.values[each] * column for each, column in columns.items())
            unit = "rad/s" if name == RATE else "rad"
            recording.equations[name] = Equation(name, letter, subsystem, unit, response, columns, valid)

        missed = table["joint_angle_rad"] - s["a"]
        if "motor_angle_rad" in table:
            of_motor = table["motor_angle_rad"] - s["p"]
            equation(MOTOR, "M", "mechanical", of_motor, sensitivity[:, 0])
            equation(TRANSMISSION, "T", "transmission", missed - of_motor, sensitivity[:, 2] - sensitivity[:, 0])
        else:
            equation(JOINT, "M", "mechanical", missed, sensitivity[:, 2])
        if "joint_rate_rad_per_s" in table:
            equation(RATE, "S", "sensor", table["joint_rate_rad_per_s"] - s["w"], sensitivity[:, 3])
        fast = np.abs(s["u"]) > 0.3 * np.max(np.abs(s["u"][valid]))
        recording.regimes = {"upward": s["u"] > 0.0, "downward": s["u"] < 0.0, "near reversals": ~fast}
        # By the joint alone an error of the model far above the noise is as slow as the foot, and whitening it would
        # high-pass what is wrong. The joint against the motor tells of faster things.
        left = Regression([recording])
        recording.whitened = "motor_angle_rad" in table or all(
            (plausibility.slowness(left, name) or 0.0) < SLOW for name in left.equations
        )
        recording.memory = SLOWEST_NOISE
        return recording

    def generic(self, recording: Recording) -> dict[str, dict[str, Array]]:
        """Signals over which each angle is looked at without a cause in mind."""
        s = recording.signals
        about = {name: s[name] for name in ("p", "u", "t")}
        return {name: ({"w": s["w"], "t": s["t"]} if name == RATE else about) for name in recording.equations}

    def effects(self, recordings: Sequence[Recording]) -> list[Effect]:
        """What an ankle, its cable, its encoders and its board's law can have."""
        top = max(float(np.quantile(np.abs(r.signals["u"]), 0.98)) for r in recordings)
        both = any(MOTOR in r.equations for r in recordings)
        return [
            *_springs(), *_friction(top), *_periodic(), *_cable(),
            *_sensors(both, any(RATE in r.equations for r in recordings)), *_law(recordings),
        ]  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Prediction:
    """A held-out recording in free simulation with values of another. angle, simulated, law_rad: (n,) of each row that
    counts; law_rad: where the law alone would hold a motor without load. channel: whose angle."""

    channel: str
    time_s: Array
    angle: Array
    simulated: Array
    law_rad: Array

    @property
    def rms(self) -> float:
        """Of what the simulation misses, rad."""
        return float(np.sqrt(np.mean((self.angle - self.simulated) ** 2)))

    @property
    def nrmse(self) -> float:
        """That over the standard deviation of what the law leaves to explain."""
        return self.rms / float(np.std(self.angle - self.law_rad))


def predicted(
    training: Table, held: Table, extra: Mapping[str, Torque] | None = None, of_program: bool = False
) -> tuple[dict[str, float], list[Prediction]]:
    """Values of the base and of `extra` by least squares of free simulation of `training`, and `held` with them."""
    fit = _Fit(signals.uniform(training), Ankle.parameters, of_program, extra)
    fit.improve()
    other = _Fit(signals.uniform(held), Ankle.parameters, of_program, extra)
    other.held_as(fit)
    table, found = other.table, []
    for channel in ("motor_angle_rad", "joint_angle_rad"):
        if channel not in table:
            continue
        parts = []
        for run in other.runs:
            good, motion, drive = other.valid[run.rows], run.motion, run.drive
            way = motion.p if channel == "motor_angle_rad" else motion.a
            keep = math.exp(-table.step_s * drive.stiffness_A_per_rad / drive.dampness_As_per_rad)
            asked = drive.command_A / drive.stiffness_A_per_rad
            begin = [keep * float(table[channel][run.rows][0])]
            law, _ = lfilter([1.0 - keep], [1.0, -keep], asked, zi=begin)
            parts.append((drive.time_s, table[channel][run.rows], way[motion.rows], law, good))
        time_s, angle, way, law, good = (np.concatenate(each) for each in zip(*parts, strict=True))
        good = good.astype(bool)
        zero = (
            float(np.mean((angle - way)[good])) if "motor_angle_rad" in table and channel == "joint_angle_rad" else 0.0
        )
        found.append(Prediction(channel, time_s[good], angle[good], way[good] + zero, law[good]))
    return fit.values, found


def _program_found(table: Table) -> Finding:
    return Finding(
        "target_angle_rad", "law", float(table.time_s[0]), float(table.time_s[-1]), FLOOR_rad, "rad",
        f"the law that fits has its target limited to {FLOOR_rad:g} rad from below, and {FORWARD_A_per_rad:.3f} A/rad "
        f"of it fed forward about {FORWARD_REST_rad:g} rad, as the robot's program",
        "note",
    )  # fmt: skip


def _check(table: Table) -> None:
    """UserError when the channels do not tell what the ankle was to do."""
    if "joint_angle_rad" not in table:
        raise UserError(f"{table.name}: ankle needs joint_angle_rad; there are {', '.join(table.columns)}")
    if "command_current_A" not in table and not ("target_angle_rad" in table and "target_rate_rad_per_s" in table):
        raise UserError(
            f"{table.name}: ankle needs command_current_A, or target_angle_rad and target_rate_rad_per_s; "
            f"there are {', '.join(table.columns)}"
        )


def _gains(table: Table) -> tuple[float, float]:
    """The law's stiffness and dampness, as logged or those of the foot-inertia logs."""
    found = []
    for name, usual in (
        ("command_stiffness_A_per_rad", STIFFNESS_A_per_rad),
        ("command_dampness_A_s_per_rad", DAMPNESS_As_per_rad),
    ):
        value = float(np.median(table[name])) if name in table else usual
        if name in table and float(np.ptp(table[name])) > 0.01 * abs(value):
            raise UserError(
                f"{table.name}: {name} goes from {table[name].min():g} to {table[name].max():g}, it must stay"
            )
        if not value > 0.0:
            raise UserError(f"{table.name}: {name} is {value:g}, it must be above 0")
        found.append(value)
    return found[0], found[1]


class _Fit:
    """The base fitted to one recording: Gauss and Newton in free simulation, damped (Levenberg and Marquardt)."""

    def __init__(
        self,
        table: Table,
        parameters: Sequence[Known],
        of_program: bool = False,
        extra: Mapping[str, "Torque"] | None = None,
    ) -> None:
        """extra: more torques on the foot, for one of their coefficients, by the coefficient's name."""
        self.extra = dict(extra or {})
        self.table, self.both, self.of_program = table, "motor_angle_rad" in table, of_program
        self.limits = {each.name: (each.low, each.high) for each in parameters}
        self.usual = {each.name: each.value for each in parameters if each.name in PARAMETERS}
        self.usual |= {name: 0.0 for name in self.extra}
        self.limits |= {name: (-math.inf, math.inf) for name in self.extra}
        self.creep_rad_s, self.filter_s = SMOOTHED, 0.0
        self.all = [*PARAMETERS, *self.extra]
        self.values = dict(self.usual)
        K, D = _gains(table)
        self.valid = np.zeros(len(table), dtype=bool)
        self.runs: list[Run] = []
        for rows in table.runs:
            t = table.time_s[rows]
            if len(t) < FEWEST or t[-1] - t[0] < SHORTEST_S:
                continue
            self.valid[rows] = t - t[0] > SETTLED_S
            if "command_current_A" in table:
                command = table["command_current_A"][rows]
            else:
                target = table["target_angle_rad"][rows]
                if of_program:
                    target = np.maximum(target, FLOOR_rad)
                command = K * target + D * table["target_rate_rad_per_s"][rows]
                if of_program:
                    command = command + FORWARD_A_per_rad * (target - FORWARD_REST_rad)
            drive = Drive(t, command, K, D)
            motion = ankle_motion.simulated(drive, self.values, self._start(rows, self.values))
            target, target_rate = self._target(rows, command / K)
            self.runs.append(Run(rows, drive, motion, *(np.interp(motion.time_s, t, x) for x in (target, target_rate))))
        if not self.runs:
            raise UserError(f"{table.name}: ankle needs a stretch of {SHORTEST_S:g} s without a gap")
        self.missed = self._missed([run.motion for run in self.runs])

    def _start(self, rows: slice, values: Values) -> tuple[float, float, float, float]:
        """States at a run's start, whose cable carries what the foot needs: a foot that starts off it would ring on,
        for the base's cable has no damping."""
        measured = self.table["motor_angle_rad" if self.both else "joint_angle_rad"][rows]
        some = slice(0, FEWEST)
        along = np.polynomial.Polynomial.fit(np.arange(FEWEST) * self.table.step_s, measured[some], 3).convert()
        angle, rate, half = along.coef[:3]
        needs = values[STIFFNESS] * angle - values[TORQUE] + values[INERTIA] * 2.0 * half
        twist = needs / values[CABLE] - values[ZERO]
        slower = values[STIFFNESS] * rate / values[CABLE]
        if self.both:
            return angle, rate, angle - twist, rate - slower
        return angle + twist, rate + slower, angle, rate

    def _target(self, rows: slice, by_command: Array) -> tuple[Array, Array]:
        """Target and its rate; by the command where they are not logged."""
        table = self.table
        target = table["target_angle_rad"][rows] if "target_angle_rad" in table else by_command
        if "target_rate_rad_per_s" in table:
            return target, table["target_rate_rad_per_s"][rows]
        return target, np.gradient(target, table.step_s)

    def _stacked(self, part: Callable[[int], tuple[Array, Array]]) -> Array:
        """Motor, and joint against it, of every run one below the other."""
        of_motor, of_joint = [], []
        for number, run in enumerate(self.runs):
            good = self.valid[run.rows]
            p, a = part(number)
            of_motor.append(p[good])
            of_joint.append(a[good] - (p[good] if self.both else 0.0))
        return np.concatenate([*of_motor, *of_joint] if self.both else of_joint)

    def _missed(self, motions: Sequence[Motion]) -> Array:
        def part(number: int) -> tuple[Array, Array]:
            rows, motion = self.runs[number].rows, motions[number]
            a = self.table["joint_angle_rad"][rows] - motion.a[motion.rows]
            return (self.table["motor_angle_rad"][rows] - motion.p[motion.rows] if self.both else a), a

        return self._stacked(part)

    def _slopes(self) -> Array:
        def part(number: int) -> tuple[Array, Array]:
            motion = self.runs[number].motion
            slopes = ankle_motion.sensitivities(motion)[motion.rows]
            if self.extra:
                pushed = np.column_stack([torque(motion) for torque in self.extra.values()])
                slopes = np.concatenate([slopes, motion.answer(np.zeros_like(pushed), pushed)[motion.rows]], axis=2)
            return slopes[:, 0], slopes[:, 2]

        return self._stacked(part)

    def improve(self) -> None:
        """To the least squares, with what is known before; friction that creeps or that stands, whichever fits."""
        found = []
        for factor in INERTIA_STARTS:
            values = {**self.usual, INERTIA: factor * self.usual[INERTIA], ZERO: self._zero()}
            moved = self._moved(values)
            if moved is not None:
                self._take(values, *moved)
                self._settle(ROUGHLY)
                found.append(self._state())
        if found:
            self._take(*min(found, key=lambda each: each[0])[1:])
        self._if_better(creep_rad_s=STANDING)
        if self.of_program:
            self._if_better(filter_s=RATE_FILTER_S)
        self._settle()

    def _if_better(self, creep_rad_s: float | None = None, filter_s: float | None = None) -> None:
        """Another friction or law where it fits better, each at its best values."""
        was, old = self._state(), (self.creep_rad_s, self.filter_s)
        self._made_so(old[0] if creep_rad_s is None else creep_rad_s, old[1] if filter_s is None else filter_s)
        moved = self._moved(self.values)
        if moved is not None:
            self._take(self.values, *moved)
            self._settle(ROUGHLY)
        if moved is None or self._state()[0] > was[0]:
            self._made_so(*old)
            self._take(*was[1:])

    def _made_so(self, creep_rad_s: float, filter_s: float) -> None:
        """Friction that changes its sign over a speed, and a law that sees the rate through a filter."""
        self.creep_rad_s, self.filter_s = creep_rad_s, filter_s
        for run in self.runs:
            run.drive = dataclasses.replace(run.drive, filter_s=filter_s)

    def _state(self) -> tuple[float, dict[str, float], list[Motion], Array]:
        return float(self.missed @ self.missed), self.values, [run.motion for run in self.runs], self.missed

    def _zero(self) -> float:
        """Joint less motor, on the mean; 0 where the motor is not measured."""
        if not self.both:
            return self.usual[ZERO]
        return float(np.mean((self.table["joint_angle_rad"] - self.table["motor_angle_rad"])[self.valid]))

    def _beside(self, values: Values) -> Array:
        """How far values are from what is known before, in its spreads."""
        return np.array([(values[name] - self.usual[name]) / spread for name, spread in SPREAD.items()])

    def _settle(self, enough: float = FULLY) -> None:
        damping = 1e-3
        pull = np.zeros((len(SPREAD), len(self.all)))
        for number, (name, spread) in enumerate(SPREAD.items()):
            pull[number, self.all.index(name)] = 1.0 / spread
        # what neighbouring rows miss is the same, so that they count for less
        level = math.sqrt(MEMORY) * float(np.std(self.missed))
        for _ in range(MOST_STEPS):
            slopes = np.vstack([self._slopes(), level * pull])
            missed = np.concatenate([self.missed, -level * self._beside(self.values)])
            lengths = np.maximum(np.linalg.norm(slopes, axis=0), 1e-12)
            least = float(missed @ missed)
            won = 0.0
            for _ in range(MOST_TRIES):
                left = np.vstack([slopes / lengths, math.sqrt(damping) * np.eye(len(lengths))])
                right = np.concatenate([missed, np.zeros(len(lengths))])
                step = np.linalg.lstsq(left, right, rcond=None)[0] / lengths
                tried = dict(self.values)
                for name, change in zip(self.all, step, strict=True):
                    tried[name] = float(np.clip(tried[name] + change, *self.limits[name]))
                moved = self._moved(tried)
                if moved is not None:
                    beside = level * self._beside(tried)
                    reached = float(moved[1] @ moved[1] + beside @ beside)
                    if reached < least:
                        won = least - reached
                        self._take(tried, *moved)
                        damping *= 0.1
                        break
                damping *= 10.0
            if won <= enough * least:
                return

    def _moved(self, values: Values) -> tuple[list[Motion], Array] | None:
        """Motions with these values and what they miss; None when there are none."""
        try:
            motions = [
                ankle_motion.simulated(
                    run.drive,
                    values,
                    self._start(run.rows, values),
                    self._torques(values),
                    self.creep_rad_s,
                )
                for run in self.runs
            ]
        except UserError:
            return None
        return motions, self._missed(motions)

    def _torques(self, values: Values) -> ankle_motion.Torques | None:
        if not any(values[name] for name in self.extra):
            return None
        return lambda m: (_none(m), sum((values[name] * torque(m) for name, torque in self.extra.items()), _none(m)))

    def held_as(self, other: "_Fit") -> None:
        """Takes the values of another fit, with its friction and its law."""
        self._made_so(other.creep_rad_s, other.filter_s)
        moved = self._moved(other.values)
        if moved is None:
            raise UserError(f"{self.table.name}: the ankle cannot be simulated with these values")
        self._take(other.values, *moved)

    def _take(self, values: Mapping[str, float], motions: Sequence[Motion], missed: Array) -> None:
        self.values, self.missed = dict(values), missed
        for run, motion in zip(self.runs, motions, strict=True):
            run.motion = motion


def _signals(table: Table, runs: Sequence[Run]) -> dict[str, Array]:
    """The simulated motion on the table's rows: what has no noise in common with any measurement."""
    s = {name: np.zeros(len(table)) for name in ("p", "u", "a", "w", "I", "acceleration")}
    for run in runs:
        m = run.motion
        for name, values in (("p", m.p), ("u", m.u), ("a", m.a), ("w", m.w), ("I", m.I), ("acceleration", m.slopes[3])):
            s[name][run.rows] = values[m.rows]
    s["t"] = table.time_s - table.time_s[0]
    return s


# --- effects -----------------------------------------------------------------------------------------------------


def _columns(key: str, make: Make, shown: bool) -> Callable[[Recording, Shape, Values], Columns]:
    """Columns of an effect by what it pushes, or shows beside the motion; kept with the recording."""

    def columns(recording: Recording, shape: Shape, values: Values) -> Columns:
        assert isinstance(recording, AnkleRecording)
        name = (key, *sorted(shape.items()))
        if name not in recording.made:
            recording.made[name] = _made(recording, shape, make, shown)
        return recording.made[name]

    return columns


def _made(recording: AnkleRecording, shape: Shape, make: Make, shown: bool) -> Columns:
    out: Columns = {}
    for run in recording.simulated:
        pairs = make(run, recording.table, shape)
        motion = run.motion
        if shown:
            p, a = (np.column_stack(each)[motion.rows] for each in zip(*pairs, strict=True))
            w = np.zeros_like(a)
        else:
            answer = motion.answer(*(np.column_stack(each) for each in zip(*pairs, strict=True)))[motion.rows]
            p, a, w = answer[:, 0], answer[:, 2], answer[:, 3]
        parts = {JOINT: a, MOTOR: p, TRANSMISSION: a - p, RATE: w}
        for name in recording.equations:
            if name in parts:
                out.setdefault(name, np.zeros((len(recording.table), len(pairs))))[run.rows] = parts[name]
    return out


def _effect(
    cause: str,
    at: str,
    subsystem: str,
    coefficients: tuple[str, ...],
    make: Make,
    shapes: Sequence[Mapping[str, float]] = ({},),
    shown: bool = False,
    admissible: Callable[[Mapping[str, float]], bool] = lambda found: True,
    meaning: str = "",
    form: str = "",
) -> Effect:
    key = f"{cause} at {at}: {', '.join(coefficients)}"
    return Effect(cause, at, subsystem, coefficients, shapes, _columns(key, make, shown), admissible, meaning, form)


def _below(limit: float) -> Callable[[Mapping[str, float]], bool]:
    """Amplitude of a cosine and a sine within a limit."""
    return lambda found: math.hypot(*(v for k, v in found.items() if k.startswith(("cosine", "sine")))) < limit


def _none(m: Motion) -> Array:
    return np.zeros_like(m.p)


def _at_motor(torque: Callable[[Motion, Shape], Array]) -> Make:
    return lambda run, table, shape: [(torque(run.motion, shape), _none(run.motion))]


def _at_foot(*torques: Callable[[Motion, Shape], Array]) -> Make:
    return lambda run, table, shape: [(_none(run.motion), each(run.motion, shape)) for each in torques]


def _springs() -> list[Effect]:
    M, at = "mechanical", "inner_ankle"
    return [
        _effect("return_spring", at, M, ("square_Nm_per_rad2",), _at_foot(lambda m, _: -m.a**2),
                form="square"),
        _effect("return_spring", at, M, ("cubic_Nm_per_rad3",), _at_foot(lambda m, _: -m.a**3),
                form="cube"),
    ]  # fmt: skip


def _friction(top: float) -> list[Effect]:
    M, at = "mechanical", "inner_motor"

    def presliding(run: Run, table: Table, shape: Shape) -> list[Pair]:
        m = run.motion
        part = Table(m.time_s, {}, (slice(0, len(m.time_s)),))
        built = bristles(Recording(part, {}, {}), m.u, shape["slide_rad"])
        return [(m.sliding - built, _none(m))]

    def warm_up(run: Run, table: Table, shape: Shape) -> list[Pair]:
        m = run.motion
        part = Table(m.time_s, {}, (slice(0, len(m.time_s)),))
        return [(m.sliding * signals.lagged(part, np.abs(m.u), shape["time_constant_s"]), _none(m))]

    return [
        _effect("stribeck", at, M, ("excess_Nm",),
                _at_motor(lambda m, p: -m.sliding * np.exp(-((m.u / p["speed_rad_s"]) ** 2))),
                [{"speed_rad_s": share * top} for share in (0.04, 0.08, 0.16, 0.3, 0.5)],
                admissible=lambda found: found["excess_Nm"] > 0.0),
        _effect("presliding", at, M, ("friction_Nm",), presliding,
                [{"slide_rad": slide} for slide in (0.003, 0.01, 0.03, 0.1)],
                admissible=lambda found: found["friction_Nm"] > 0.0),
        _effect("direction_friction", at, M, ("viscous_Nms",), _at_motor(lambda m, _: -np.abs(m.u))),
        _effect("friction_warm_up", at, M, ("Nm_s_per_rad",), warm_up,
                [{"time_constant_s": time_s} for time_s in (3.0, 10.0, 30.0)],
                admissible=lambda found: found["Nm_s_per_rad"] > 0.0),
        _effect("drag", at, M, ("quadratic_Nms2",), _at_motor(lambda m, _: -m.u * np.abs(m.u)),
                admissible=lambda found: found["quadratic_Nms2"] > 0.0),
    ]  # fmt: skip


def _periodic() -> list[Effect]:
    gear = ANKLE_MOTOR.gear

    def wave(load: Callable[[Motion], Array | float]) -> Make:
        def made(run: Run, table: Table, shape: Shape) -> list[Pair]:
            m = run.motion
            angle = shape["periods_per_turn"] * gear * m.p
            return [(load(m) * np.cos(angle), _none(m)), (load(m) * np.sin(angle), _none(m))]

        return made

    turns = [{"periods_per_turn": float(n)} for n in range(1, 9)]
    waves = (
        lambda m, p: np.cos(p["periods_per_turn"] * m.a),
        lambda m, p: np.sin(p["periods_per_turn"] * m.a),
    )
    M, at = "mechanical", "inner_motor"
    made = [
        _effect(
            "cogging",
            at,
            M,
            ("cosine_Nm", "sine_Nm"),
            wave(lambda m: 1.0),
            turns,
            admissible=_below(LARGEST_COGGING_Nm),
        ),
        _effect(
            "commutation_ripple",
            at,
            M,
            ("cosine", "sine"),
            wave(lambda m: ankle_motion.GEAR_K * m.I),
            turns,
            admissible=_below(LARGEST_RIPPLE),
        ),
    ]
    made = [dataclasses.replace(each, phase_is_free=True) for each in made]
    return [
        *made,
        _effect("once_per_turn", "inner_ankle", M, ("cosine_Nm", "sine_Nm"),
                _at_foot(*waves),
                [{"periods_per_turn": n} for n in (1.0, 2.0, 3.0)]),
    ]  # fmt: skip


def _cable() -> list[Effect]:
    T, at = "transmission", "inner_cable"

    def twisted(twist: Callable[[Motion, Shape], Array]) -> Make:
        """The cable is longer by an angle: it pulls less by k_s times that."""

        def made(run: Run, table: Table, shape: Shape) -> list[Pair]:
            more = run.motion.values[CABLE] * twist(run.motion, shape)
            return [(more, -more)]

        return made

    def creep(m: Motion, shape: Shape) -> Array:
        part = Table(m.time_s, {}, (slice(0, len(m.time_s)),))
        return signals.lagged(part, m.cable - m.cable.mean(), shape["time_constant_s"])

    return [
        _effect("cable_stiffening", at, T, ("cubic_Nm_per_rad3",),
                twisted(lambda m, _: -(m.twist ** 3) / m.values[CABLE])),
        _effect("cable_backlash", at, T, ("half_gap_rad",), twisted(lambda m, p: np.tanh(m.cable / p["torque_Nm"])),
                [{"torque_Nm": load} for load in (0.01, 0.03, 0.1)],
                admissible=lambda found: found["half_gap_rad"] > 0.0),
        _effect("cable_creep", at, T, ("rad_per_Nm",), twisted(creep),
                [{"time_constant_s": time_s} for time_s in (0.3, 1.0, 3.0, 10.0)],
                admissible=lambda found: found["rad_per_Nm"] > 0.0),
    ]  # fmt: skip


def _sensors(both: bool, rate: bool) -> list[Effect]:
    S = "sensor"

    def joint(*shown: Callable[[Motion, Shape], Array]) -> Make:
        return lambda run, table, p: [(_none(run.motion), each(run.motion, p)) for each in shown]

    def motor(*shown: Callable[[Motion, Shape], Array]) -> Make:
        return lambda run, table, p: [(each(run.motion, p), _none(run.motion)) for each in shown]

    turns = [{"periods_per_turn": n} for n in (1.0, 2.0)]
    waves = (
        lambda m, p: np.cos(p["periods_per_turn"] * m.a),
        lambda m, p: np.sin(p["periods_per_turn"] * m.a),
    )
    found = [
        _effect("sensor_scale", "joint_angle_rad", S, ("change",), joint(lambda m, _: m.a), shown=True),
        _effect("sensor_lag", "joint_angle_rad", S, ("time_constant_s",), joint(lambda m, _: -m.w), shown=True),
        _effect("eccentricity", "joint_angle_rad", S, ("cosine_rad", "sine_rad"), joint(*waves), turns, shown=True,
                admissible=_below(LARGEST_ECCENTRICITY_rad)),
        _effect("clock_drift", "joint_angle_rad", S, ("share",),
                joint(lambda m, _: -m.w * (m.time_s - m.time_s[0])), shown=True),
    ]  # fmt: skip
    if both:
        found.append(
            _effect("sensor_lag", "motor_angle_rad", S, ("time_constant_s",), motor(lambda m, _: -m.u), shown=True)
        )
    if rate:
        found += [
            _of_rate("sensor_lag", "time_constant_s", lambda s: -s["acceleration"]),
            _of_rate("sensor_scale", "change", lambda s: s["w"]),
            _of_rate("sensor_offset", "offset_rad_s", lambda s: np.ones_like(s["w"])),
        ]
    return found


def _of_rate(cause: str, coefficient: str, make: Callable[[Mapping[str, Array]], Array]) -> Effect:
    def columns(recording: Recording, shape: Shape, values: Values) -> Columns:
        if RATE not in recording.equations:
            return {}
        return {RATE: make(recording.signals)[:, None]}

    return Effect(cause, "joint_rate_rad_per_s", "sensor", (coefficient,), [{}], columns)


def _law(recordings: Sequence[Recording]) -> list[Effect]:
    """What the board's law can have otherwise than thought."""
    F = "firmware"
    GK = ankle_motion.GEAR_K
    logged = any("command_current_A" in r.table for r in recordings)

    def driven(current: Callable[[Run, Shape], Array]) -> Make:
        return lambda run, table, p: [(GK * current(run, p), _none(run.motion))]

    def later(run: Run, _: Shape) -> Array:
        m = run.motion
        return -np.gradient(np.interp(m.time_s, run.drive.time_s, run.drive.command_A), m.time_s)

    def floor(run: Run, shape: Shape) -> Array:
        return run.drive.stiffness_A_per_rad * np.maximum(shape["floor_rad"] - run.target_rad, 0.0)

    low = min(float(run.target_rad.min()) for r in recordings if isinstance(r, AnkleRecording) for run in r.simulated)
    floors = [{"floor_rad": round(low + 0.02 * n, 3)} for n in range(1, 11)]
    found = [
        _effect("firmware_parameter", "stiffness", F, ("A_per_rad",),
                driven(lambda run, _: (0.0 if logged else run.target_rad) - run.motion.p)),
        _effect("sensor_lag", "command", F, ("time_constant_s",), driven(later)),
    ]  # fmt: skip
    if not logged:
        found += [
            _effect("firmware_parameter", "target_floor", F, ("share",),
                    driven(floor), floors),
            _effect("firmware_parameter", "feed_forward", F, ("A_per_rad",), driven(lambda run, _: run.target_rad)),
        ]  # fmt: skip
    return found
