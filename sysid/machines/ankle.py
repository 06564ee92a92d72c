"""An ankle that follows a sine while the robot hangs: a fit of the board's law and the ankle to the measured angles.

The law is stiff: 1 ms of latency is 0.25 A at the fast sine, as much as the motor draws. Therefore no current is
computed from angles. The simulation includes the law (`ankle_motion.py`), the fit compares the angles of a free
simulation, and each equation is one angle, linearised about the motion that fits best:

    joint         a - a_simulated = sum over parameters of change x sensitivity        where only the joint is measured
    motor         the same of p
    transmission  the same of a - p                                                    where both are measured
    joint rate    the same of a', where it is measured

The fit's free parameters are those that differ between ankles: foot, springs, friction with its load-dependent part,
cable, rotor, torque constant, the zero of one angle against the other, the delays of the law and of its target. Each
has a prior with the spread of sound ankles (`SPREAD`): a parameter that the angles do not determine keeps its prior
value, and one that they contradict is reported as a wrong value (`WRONG`). The motor either creeps inside its friction,
as in the simulator, or rests, as a real machine does; the law uses the rate behind the board's filter, or the
unfiltered rate. The fit keeps the better of each. A held command that jumps between two slow rows does so at a time
that is fitted.

The response is that difference plus the fitted values times their sensitivities, so that the regression returns values
and not changes.
"""

import copy
import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.signal import lfilter

from ranger_sim.foundation.user_error import ModelError, UserError
from ranger_sim.plant.electrics.motor_parameters import ANKLE_MOTOR
from ranger_sim.sysid import plausibility, signals
from ranger_sim.sysid.dataset import Array, Finding, Table
from ranger_sim.sysid.machine import Columns, Effect, Equation, Known, Quantity, Recording, Values
from ranger_sim.sysid.machines import ankle_motion
from ranger_sim.sysid.machines.ankle_motion import (
    BALANCE,
    CABLE,
    CONSTANT,
    COULOMB,
    INERTIA,
    LAG,
    LATE,
    LOAD,
    PARAMETERS,
    RATE_FILTER_S,
    ROTOR,
    SIGN_WIDTH,
    STIFFNESS,
    TORQUE,
    USUAL,
    VISCOUS,
    ZERO,
    Drive,
    Motion,
    REST_rad,
)
from ranger_sim.sysid.machines.forms import bristles
from ranger_sim.sysid.regression import ORDER, Regression

# of the robot's foot-inertia logs, which do not record them (robot.md C6.2)
STIFFNESS_A_per_rad, DAMPNESS_As_per_rad = 11.219, 1.634
SETTLED_S = 0.5  # from a run's start, whose state is not known exactly: the law's slow pole is K / D = 7 to 15 1/s
SHORTEST_S = 1.0  # least duration of a run
FEWEST = 50  # least rows of a run
# Spacing in samples of the rows that count, at most; the Gaussian that smooths both sides has half of it. Slower logs
# keep more: memory of the noise is known only from well above what the machine moves to.
EVERY, KEPT_Hz = 3, 80.0
MOST_STEPS, MOST_TRIES = 25, 8  # steps of the fit, and attempts at one step's damping
# The robot's program limits the target from below and feeds forward its own value of the return spring: the sine logs
# record I_0 (docs/ankle-measured.md). A log of targets alone may come from this program or from the plain law.
FLOOR_rad, FORWARD_A_per_rad, FORWARD_REST_rad = 0.3, 0.134 / (34.0 * 0.018), 1.662
ROUGHLY, FULLY = 1e-2, 1e-4  # share of the sum of squares that a step must gain for another step to follow
INERTIA_STARTS = (1.0, 2.5)  # of its value: the cable's ringing gives the sum of squares local minima along the inertia
# Chosen by us: a motor's ripple is a part of its torque, cogging is about as large as its friction, and an encoder
# whose disc is off centre by more than 2 % of its radius does not read.
LARGEST_RIPPLE, LARGEST_COGGING_Nm, LARGEST_ECCENTRICITY_rad = 0.5, 0.1, 0.02
LATEST_s = 0.05  # of a command, as of the target's `LATE`: 25 of the robot's frames. A longer delay is another fault
FRAME_s = 0.002  # from one target to the next: robot.md N4.2
MOST_JUMPS = 100  # of a held command whose times are fitted
NARROWEST_rad_s = 0.003  # of friction's sign: below it, it is dry
MOVES_TO_Hz = 10.0  # five times the fastest sine: above it, the angles' residual is noise
SLOW = 5.0  # times the innovation from row to row: noise of these encoders has 1.1 to 1.4, on blind recordings
SLOWEST_NOISE = 0.9  # largest row-to-row (12 ms) memory of the base's residual that is noise; more is an effect's
CLEARLY = 20.0  # gain in cost from which on the fit keeps a law that the board is not known to have
# Deviations from the prior beyond which a value hardly pulls; with `LOOSE` it always pulls, otherwise the value with
# the tightest prior would absorb an error of the model.
FAR, FAR_LOOSE = 3.0, 1e3
MEMORY, MEMORY_LOOSE = 4.0, 10.0  # rows worth one: of noise with a memory of 0.6, and of a model's error
JOINT, MOTOR, TRANSMISSION, RATE = "joint", "motor", "transmission", "joint rate"
# Spread of sound ankles about `USUAL`, one standard deviation, chosen by us: 15 % for steel parts, cable and springs,
# so that twice that is ignored and four times that is named. Otherwise: the spring's rest angle a quarter of a radian;
# viscous friction from the 0.004 of the robot's logs to the appendix's 0.01 N m s/rad; rotor and magnets as in a data
# sheet, 5 and 10 %; zeros as in the robot's logs, 0.02 to 0.04 rad; half a slot of the board and its current loop are
# 0.5 to 1 ms; targets arrive every 2 ms, and a log's stamps are 1 ms.
SPREAD = {
    INERTIA: 0.15 * USUAL[INERTIA],
    STIFFNESS: 0.15 * USUAL[STIFFNESS],
    TORQUE: 0.25 * USUAL[STIFFNESS],
    COULOMB: 0.15 * USUAL[COULOMB],
    VISCOUS: 0.003,
    LOAD: 0.15 * USUAL[LOAD],
    CABLE: 0.15 * USUAL[CABLE],
    ROTOR: 0.05 * USUAL[ROTOR],
    ZERO: 0.012,
    LAG: 0.0005,
    LATE: 0.002,
    BALANCE: 0.15 * USUAL[STIFFNESS],
    CONSTANT: 0.1 * USUAL[CONSTANT],
    SIGN_WIDTH: 0.02,
}
# Where only the joint is measured and the model's error is far above the noise, that error affects every value: then
# springs and friction are free, the rest is known to about half of itself, and no value is reported as wrong.
LOOSE = {
    INERTIA: USUAL[INERTIA],
    LOAD: 0.5 * USUAL[LOAD],
    CABLE: 5.0,
    ROTOR: 0.2 * USUAL[ROTOR],
    ZERO: 0.04,
    LAG: SPREAD[LAG],
    LATE: SPREAD[LATE],
    BALANCE: 0.01 * USUAL[STIFFNESS],
    CONSTANT: 0.01 * USUAL[CONSTANT],
    SIGN_WIDTH: 0.02,
}
LOGGED_LATE_S = 0.0001  # where the log has the command itself
# Wrong values, by the parameter whose sensitivity they have: cause, place, coefficient. The coefficient is the
# deviation of the value from its prior.
WRONG = (
    (INERTIA, "inertia", "inner_foot", "inertia_kg_m2", "mechanical", "of the foot about the ankle"),
    (STIFFNESS, "spring_value", "inner_ankle", "stiffness_Nm_per_rad", "mechanical", "of the foot's return spring"),
    (TORQUE, "spring_value", "inner_ankle_rest", "torque_Nm", "mechanical", f"of that spring at {REST_rad:g} rad"),
    (BALANCE, "spring_value", "inner_motor", "stiffness_Nm_per_rad", "mechanical", "of the spring at the motor"),
    (CABLE, "spring_value", "inner_cable", "stiffness_Nm_per_rad", "transmission", "of the cable"),
    (COULOMB, "coulomb_friction", "inner_motor", "friction_Nm", "mechanical", "of motor and gearbox"),
    (VISCOUS, "viscous_friction", "inner_motor", "friction_Nms", "mechanical", "of motor and gearbox"),
    (LOAD, "load_friction", "inner_motor", "share", "mechanical", "part of the motor's torque that friction takes"),
    (ZERO, "sensor_offset", "joint_angle_rad", "offset_rad", "sensor", "what the joint's encoder shows too much"),
)

# Beside a torque of another form over the joint's angle these two are only a part of one spring, and what sound ankles
# have is that of the whole: they have neither prior nor limits of their own then; plausibility.py judges both together
WHOLE_SPRING = (STIFFNESS, TORQUE)

Shape = Mapping[str, float]


@dataclasses.dataclass
class Run:
    """One run of a recording and the motion fitted to it. rows: in the table."""

    rows: slice
    drive: Drive
    motion: Motion
    target_rad: Array  # (m,) at the motion's steps; from the command where no target is logged
    target_rate_rad_per_s: Array

    def shown(self, rate: Array) -> Array:
        """Rates (m,) or (m, k) as the board reports them: behind its law's filter."""
        return behind(rate, self, self.drive.filter_s) if self.drive.filter_s else rate


def behind(values: Array, run: Run, time_constant_s: float) -> Array:
    """(m,) or (m, k) at a motion's steps behind a first-order lag, with straight lines between the steps."""
    x = (run.motion.time_s[1] - run.motion.time_s[0]) / time_constant_s
    keep = math.exp(-x)
    now, was = 1.0 - (1.0 - keep) / x, (1.0 - keep) / x - keep
    start = (1.0 - now) * values[:1]
    return np.asarray(lfilter([now, was], [1.0, -keep], values, axis=0, zi=start)[0])


@dataclasses.dataclass
class AnkleRecording(Recording):
    """A recording with its simulated runs, the simulation's parameter values, and the effects in it."""

    simulated: list[Run] = dataclasses.field(default_factory=list)
    values: dict[str, float] = dataclasses.field(default_factory=dict)
    fit: "_Fit | None" = None
    loose: bool = False  # the model's error is too large to report a value as wrong
    acting: dict[tuple, tuple[float, ...]] = dataclasses.field(default_factory=dict)  # coefficients, keys as in `made`
    made: dict[tuple, Columns] = dataclasses.field(default_factory=dict)  # columns of effects, by effect and shape


# torques (m,) at motor and foot of a run, for one coefficient; or additions to what both encoders show, (m,) each
Pair = tuple[Array, Array]
Make = Callable[[Run, Table, Shape], list[Pair]]
Torque = Callable[[Motion], Array]
# additions to what the encoders show at a coefficient of this size, where they are not proportional to it
Exact = Callable[[Run, float], Pair]
STEP = 1e-5  # step of such a coefficient, for its derivative


@dataclasses.dataclass(frozen=True)
class AnkleEffect(Effect):
    """An effect that the simulation can include. shown: it changes the measurement only and moves nothing."""

    make: Make | None = None
    shown: bool = False
    exact: Exact | None = None

    def key(self, shape: Shape) -> tuple:
        """Key under which a recording keeps this effect's columns."""
        return (self.name, *self.coefficients, *sorted(shape.items()))

    def pairs(self, run: Run, table: Table, shape: Shape, at: float = 0.0) -> list[Pair]:
        """Pairs for a unit of each coefficient, linearised about a simulation with `at` of it."""
        if self.exact is None or at <= 0.0:
            assert self.make is not None
            return self.make(run, table, shape)
        more, less = self.exact(run, at + STEP), self.exact(run, at - STEP)
        return [((more[0] - less[0]) / (2.0 * STEP), (more[1] - less[1]) / (2.0 * STEP))]

    def seen(self, run: Run, table: Table, shape: Shape, coefficients: Sequence[float]) -> Pair:
        """The effect's torques, or what it adds to the encoders, at these coefficients."""
        if self.exact is not None and coefficients[0] > 0.0:
            return self.exact(run, coefficients[0])
        pairs = self.pairs(run, table, shape)
        return (
            np.sum([c * p for c, (p, _) in zip(coefficients, pairs, strict=True)], axis=0),
            np.sum([c * a for c, (_, a) in zip(coefficients, pairs, strict=True)], axis=0),
        )


@dataclasses.dataclass(frozen=True)
class Acting:
    """An effect in the simulation, and the names of its coefficients among the fit's values."""

    effect: AnkleEffect
    shape: Shape
    names: tuple[str, ...]

    def of(self, values: Values) -> tuple[float, ...]:
        return tuple(values[name] for name in self.names)


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
    # Values: of the body `ranger` (plant/bodies/ranger.toml). Limits chosen by us, far beyond any ankle of this size.
    parameters = (
        Known(INERTIA, "kg m^2", USUAL[INERTIA], 1e-4, 0.1, "of the foot about the ankle"),
        Known(STIFFNESS, "N m/rad", USUAL[STIFFNESS], -5.0, 5.0, "of the return spring, at the joint"),
        Known(TORQUE, "N m", USUAL[TORQUE], -5.0, 5.0, f"of the return spring at {REST_rad:g} rad, where it rests"),
        Known(COULOMB, "N m", USUAL[COULOMB], 0.0, 2.0, "of motor and gearbox"),
        Known(VISCOUS, "N m s/rad", USUAL[VISCOUS], -0.5, 1.0, "of motor and gearbox"),
        Known(LOAD, "", USUAL[LOAD], 0.0, 0.9, "part of the motor's torque that friction takes"),
        Known(CABLE, "N m/rad", USUAL[CABLE], 1.0, 1e3, "of the cable"),
        Known(ROTOR, "kg m^2", USUAL[ROTOR], 1e-4, 0.1, "of the rotor behind the gear"),
        Known(ZERO, "rad", USUAL[ZERO], -0.5, 0.5, "what the joint's encoder shows at the motor's zero"),
        Known(LAG, "s", USUAL[LAG], 0.0, 0.02, "of the current behind the law"),
        # below zero by half a row of 50 Hz: a joint's angle that is a mean over its row shows it earlier
        Known(LATE, "s", USUAL[LATE], -0.01, 0.05, "of the target in force behind the logged one"),
        Known(BALANCE, "N m/rad", USUAL[BALANCE], -5.0, 5.0, "of the spring at the motor"),
        Known(CONSTANT, "N m/A", USUAL[CONSTANT], 0.05, 6.0, "of the motor behind the gear"),
        Known(
            SIGN_WIDTH, "rad/s", USUAL[SIGN_WIDTH], NARROWEST_rad_s, 1.0, "rate about which friction changes its sign"
        ),
    )

    def prepare(self, table: Table) -> AnkleRecording:
        """Fit the base to the angles in free simulation, and linearise about it."""
        _check(table)
        table = signals.uniform(table)
        fit = _Fit(table, self.parameters)
        fit.improve()
        if "command_current_A" not in table and float(np.min(table["target_angle_rad"])) < FLOOR_rad:
            other = _Fit(table, self.parameters, of_program=True)
            other.improve()
            if other.cost() < fit.cost():
                fit = other
        made = _recording(fit)
        return made if made.whitened else _recording(fit.loosened())

    def again(
        self, recording: Recording, effects: Sequence[tuple[Effect, Shape, Sequence[float]]], fixed: bool = False
    ) -> Recording:
        """The recording fitted and linearised with these effects in the simulation; fixed: their coefficients stay.

        Where only the joint is measured and the residual stays far above the noise, return the recording unchanged:
        the form in the simulation would be preferred to its ties because of the other errors.
        """
        assert isinstance(recording, AnkleRecording) and recording.fit is not None
        made = _recording(recording.fit.with_effects(effects, fixed))
        return made if made.whitened else recording

    def generic(self, recording: Recording) -> dict[str, dict[str, Array]]:
        """Signals over which the general tests examine each angle, without a cause in mind."""
        s = recording.signals
        about = {name: s[name] for name in ("p", "u", "t")}
        return {name: ({"w": s["w"], "t": s["t"]} if name == RATE else about) for name in recording.equations}

    def effects(self, recordings: Sequence[Recording]) -> list[Effect]:
        """Candidate causes in an ankle, its cable, its encoders and its board's law."""
        top = max(float(np.quantile(np.abs(r.signals["u"]), 0.98)) for r in recordings)
        both = any(MOTOR in r.equations for r in recordings)
        return [
            *_wrong(),
            *_springs(), *_friction(top), *_periodic(), *_cable(),
            *_sensors(both, any(RATE in r.equations for r in recordings)), *_law(recordings),
        ]  # fmt: skip


def _recording(fit: "_Fit") -> AnkleRecording:
    """Equations about the fitted motion."""
    table = fit.table
    every = min(EVERY, max(1, int(1.0 / (KEPT_Hz * table.step_s))))
    recording = AnkleRecording(
        table,
        {},
        {},
        width=0.5 * every,
        every=every,
        left_over=True,
        noise_by_candidates=False,
        simulated=fit.runs,
        fit=fit,
        loose=fit.loose,
    )
    recording.acting = {each.effect.key(each.shape): each.of(fit.values) for each in fit.acting}
    recording.values = dict(fit.values)
    recording.in_part = fit.in_part()
    known = [name for name in fit.base if not (fit.dry and name == SIGN_WIDTH)]  # dry friction has no width
    recording.priors = {name: (fit.usual[name], each) for name, each in fit.spread.items() if name in known}
    if fit.of_program:
        recording.findings.append(_program_found(table))
    if fit.filter_s:
        recording.findings.append(_filter_found(table))
    s = recording.signals = _signals(table, fit.runs)
    # a joint that rests on a count shows one error of rounding at all of its rows
    count = signals.counts_of(table, "joint_angle_rad")
    valid = fit.valid & ~signals.on_one_count(table, table["joint_angle_rad"], ORDER * every, count)
    sensitivity = np.zeros((len(table), ankle_motion.STATES, len(fit.base)))
    for number, run in enumerate(fit.runs):
        slopes = fit.sensitivities(number)
        slopes[:, 3] = run.shown(slopes[:, 3])
        sensitivity[run.rows] = slopes[run.motion.rows]

    bare: dict[str, Array] = {}  # responses without the contribution of the effects in the simulation

    def equation(name: str, letter: str, subsystem: str, missed: Array, slopes: Array) -> None:
        columns = {each: slopes[:, fit.base.index(each)] for each in known}
        response = missed + sum(fit.values[each] * column for each, column in columns.items())
        for acting in fit.acting:  # a cause in the simulation is named again, about a motion that includes it
            made = _made(recording, acting.shape, acting.effect)
            if name in made:
                by_effects = made[name] @ np.array(acting.of(fit.values))
                bare[name] = bare.get(name, response)
                response = response + by_effects
        unit = "rad/s" if name == RATE else "rad"
        recording.equations[name] = Equation(name, letter, subsystem, unit, response, columns, valid)

    shown_p, shown_a = fit.shown_beside()
    missed = table["joint_angle_rad"] - s["a"] - shown_a
    if "motor_angle_rad" in table:
        of_motor = table["motor_angle_rad"] - s["p"] - shown_p
        equation(MOTOR, "M", "mechanical", of_motor, sensitivity[:, 0])
        equation(TRANSMISSION, "T", "transmission", missed - of_motor, sensitivity[:, 2] - sensitivity[:, 0])
    else:
        equation(JOINT, "M", "mechanical", missed, sensitivity[:, 2])
    if "joint_rate_rad_per_s" in table:
        equation(RATE, "S", "sensor", table["joint_rate_rad_per_s"] - s["rate"], sensitivity[:, 3])
    fast = np.abs(s["u"]) > 0.3 * np.max(np.abs(s["u"][valid]))
    recording.regimes = {"upward": s["u"] > 0.0, "downward": s["u"] < 0.0, "near reversals": ~fast}
    # With the joint alone, an error of the model far above the noise is as slow as the foot, and whitening would act as
    # a high-pass on it. Joint against motor also shows faster errors.
    sound = {
        name: dataclasses.replace(e, response=bare.get(name, e.response)) for name, e in recording.equations.items()
    }
    left = Regression([dataclasses.replace(recording, equations=sound)])
    recording.whitened = "motor_angle_rad" in table or all(
        (plausibility.slowness(left, name) or 0.0) < SLOW for name in left.equations
    )
    recording.memory = SLOWEST_NOISE
    # The times of jumps take a part of the fast noise with them: then all of the residual shows the noise
    jumps = len(fit.base) > len(PARAMETERS)
    recording.noise_above = 0.0 if jumps else MOVES_TO_Hz * every * table.step_s
    return recording


@dataclasses.dataclass(frozen=True)
class Prediction:
    """A held-out recording in free simulation with values of another. angle, simulated, law_rad: (n,) of each row that
    counts; law_rad: where the law alone would hold a motor without load. channel: of `angle`."""

    channel: str
    time_s: Array
    angle: Array
    simulated: Array
    law_rad: Array

    @property
    def rms(self) -> float:
        """Root mean square of the simulation's error, rad."""
        return float(np.sqrt(np.mean((self.angle - self.simulated) ** 2)))

    @property
    def nrmse(self) -> float:
        """`rms` over the standard deviation of the part of the angle that the law alone does not explain."""
        return self.rms / float(np.std(self.angle - self.law_rad))


def predicted(
    training: Table, held: Table, extra: Mapping[str, Torque] | None = None, of_program: bool = False
) -> tuple[dict[str, float], list[Prediction]]:
    """Fit base and `extra` to `training` by least squares in free simulation; predict `held` with the values."""
    fit = _Fit(signals.uniform(training), Ankle.parameters, of_program, extra)
    fit.improve()
    if not _recording(fit).whitened:
        fit = fit.loosened()
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


def _filter_found(table: Table) -> Finding:
    return Finding(
        "joint_angle_rad", "law", float(table.time_s[0]), float(table.time_s[-1]), RATE_FILTER_S, "s",
        f"the law that fits sees the motor's rate behind a filter of {1e3 * RATE_FILTER_S:g} ms, as the robot's board",
        "note",
    )  # fmt: skip


def _check(table: Table) -> None:
    """Raise UserError when the channels do not determine the ankle's command."""
    if "joint_angle_rad" not in table:
        raise ModelError(f"{table.name}: ankle needs joint_angle_rad; there are {', '.join(table.columns)}")
    if "command_current_A" not in table and not ("target_angle_rad" in table and "target_rate_rad_per_s" in table):
        raise ModelError(
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
            raise ModelError(
                f"{table.name}: {name} goes from {table[name].min():g} to {table[name].max():g}, it must stay"
            )
        if not value > 0.0:
            raise ModelError(f"{table.name}: {name} is {value:g}, it must be above 0")
        found.append(value)
    return found[0], found[1]


def _pulls(beside: Array, far: float) -> float:
    """Twice the negative log-probability of values at these deviations from their priors: heavy tails beyond `far`, so
    that one wrong value does not pull others with it."""
    return float(np.sum(far**2 * np.log1p((beside / far) ** 2)))


class _Fit:
    """The base fitted to one recording: Gauss-Newton in free simulation, damped (Levenberg and Marquardt)."""

    def __init__(
        self,
        table: Table,
        parameters: Sequence[Known],
        of_program: bool = False,
        extra: Mapping[str, "Torque"] | None = None,
    ) -> None:
        """extra: more torques on the foot, for a unit of each coefficient, by the coefficient's name."""
        self.extra = dict(extra or {})
        self.acting: list[Acting] = []
        self.table, self.both, self.of_program = table, "motor_angle_rad" in table, of_program
        self.limits = {each.name: (each.low, each.high) for each in parameters}
        self.usual = {each.name: each.value for each in parameters if each.name in PARAMETERS}
        self.usual |= {name: 0.0 for name in self.extra}
        self.limits |= {name: (-math.inf, math.inf) for name in self.extra}
        self.loose, self.far, self.memory = False, FAR, MEMORY
        self.known = {LATE: LOGGED_LATE_S} if "command_current_A" in table else {}
        self.spread = SPREAD | self.known
        self.dry, self.filter_s = False, RATE_FILTER_S if of_program else 0.0
        self.base: list[str] = list(PARAMETERS)  # and times of jumps
        K, D = _gains(table)
        self.usual = dict(self.usual)
        self.values = dict(self.usual)
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
            jumps = self._jumps(rows, command)
            bent = not jumps and signals.is_smooth(Table(t, {}, (slice(0, len(t)),)), command)
            drive = Drive(t, command, K, D, self.filter_s, bent, jumps)
            motion = ankle_motion.simulated(drive, self.values, self._start(rows, self.values))
            target, target_rate = self._target(rows, command / K)
            self.runs.append(Run(rows, drive, motion, *(np.interp(motion.time_s, t, x) for x in (target, target_rate))))
        self.all = [*self.base, *self.extra]
        if not self.runs:
            raise ModelError(f"{table.name}: ankle needs a stretch of {SHORTEST_S:g} s without a gap")
        self.missed = self._missed([run.motion for run in self.runs], self.values)

    def _jumps(self, rows: slice, command: Array) -> dict[str, int]:
        """Rows before which a held command jumps, by the names of the jumps' times, which are free within a row's step.

        None where rows follow each other as fast as targets do, or where the command does not stay between jumps.
        """
        step_s = self.table.step_s
        changes = np.flatnonzero(np.diff(command)) + 1
        if step_s <= FRAME_s or not 0 < len(changes) <= MOST_JUMPS or np.min(np.diff(changes), initial=2) < 2:
            return {}
        made = {f"jump@{self.table.time_s[rows][at]:.4f} s": int(at) for at in changes}
        self.base += made
        self.usual |= dict.fromkeys(made, 0.0)
        self.values |= dict.fromkeys(made, 0.0)
        self.limits |= dict.fromkeys(made, (-0.5 * step_s, 0.5 * step_s))
        self.known = self.known | dict.fromkeys(made, step_s / math.sqrt(12.0))  # anywhere between the two rows
        self.spread = self.spread | self.known
        return made

    def sensitivities(self, number: int) -> Array:
        """Derivatives of a run's states (m, 6, n) by the values of `base`; other runs' jumps do not move it."""
        run = self.runs[number]
        slopes = ankle_motion.sensitivities(run.motion)
        out = np.zeros((*slopes.shape[:2], len(self.base)))
        out[:, :, [self.base.index(name) for name in (*PARAMETERS, *run.drive.jumps)]] = slopes
        return out

    def _start(self, rows: slice, values: Values) -> tuple[float, float, float, float]:
        """States at a run's start, with the cable torque that the foot needs: a foot that starts off balance would ring
        on, because the base's cable has no damping."""
        measured = self.table["motor_angle_rad" if self.both else "joint_angle_rad"][rows]
        some = slice(0, FEWEST)
        along = np.polynomial.Polynomial.fit(np.arange(FEWEST) * self.table.step_s, measured[some], 3).convert()
        angle, rate, half = along.coef[:3]
        needs = values[STIFFNESS] * (angle - REST_rad) - values[TORQUE] + values[INERTIA] * 2.0 * half
        twist = needs / values[CABLE] - values[ZERO]
        slower = values[STIFFNESS] * rate / values[CABLE]
        if self.both:
            return angle, rate, angle - twist, rate - slower
        return angle + twist, rate + slower, angle, rate

    def _target(self, rows: slice, by_command: Array) -> tuple[Array, Array]:
        """Target and its rate; from the command where they are not logged."""
        table = self.table
        target = table["target_angle_rad"][rows] if "target_angle_rad" in table else by_command
        if "target_rate_rad_per_s" in table:
            return target, table["target_rate_rad_per_s"][rows]
        return target, np.gradient(target, table.step_s)

    def loosened(self) -> "_Fit":
        """Fit again with `LOOSE`, from the usual values."""
        other = copy.copy(self)
        other.runs = [dataclasses.replace(run) for run in self.runs]
        other.loose, other.far, other.memory = True, FAR_LOOSE, MEMORY_LOOSE
        other.spread = LOOSE | other.known
        other._made_so(False, self.filter_s)
        other.improve()
        return other

    def with_effects(self, effects: Sequence[tuple[Effect, Shape, Sequence[float]]], fixed: bool) -> "_Fit":
        """Fit again with effects in the simulation; fixed: their coefficients stay unchanged."""
        other = copy.copy(self)
        other.runs = [dataclasses.replace(run) for run in self.runs]
        other.acting = []
        acting: dict[str, float] = {}
        for effect, shape, coefficients in effects:
            if isinstance(effect, AnkleEffect):
                names = tuple(f"{effect.name}: {name}" for name in effect.coefficients)
                other.acting.append(Acting(effect, shape, names))
                acting |= dict(zip(names, coefficients, strict=True))
        other.all = [*self.base, *self.extra, *(() if fixed else acting)]
        whole = other.in_part()
        other.spread = {name: each for name, each in self.spread.items() if name not in whole}
        other.limits = self.limits | {name: (-math.inf, math.inf) for name in (*acting, *whole)}
        for values in ({**self.usual, ZERO: self._zero()}, self.values):
            moved = other._moved(values | acting)
            if moved is not None:
                other._take(values | acting, *moved)
                other._settle()
                return other
        return self

    def in_part(self) -> tuple[str, ...]:
        """Parameters that are a part of one spring with an effect in the simulation."""
        return WHOLE_SPRING if any(_by_the_foot(each.effect) for each in self.acting) else ()

    def shown_beside(self) -> Pair:
        """What the acting effects add to the readings of the motor's and the joint's encoder: (n,) each."""
        found = np.zeros(len(self.table)), np.zeros(len(self.table))
        for run in self.runs:
            for each, part in zip(found, self._shown(run, run.motion, self.values), strict=True):
                each[run.rows] = part
        return found

    def _shown(self, run: Run, motion: Motion, values: Values) -> Pair:
        p, a = (np.zeros(len(motion.p[motion.rows])) for _ in range(2))
        for each in self.acting:
            if each.effect.shown:
                seen = each.effect.seen(
                    dataclasses.replace(run, motion=motion), self.table, each.shape, each.of(values)
                )
                p, a = p + seen[0][motion.rows], a + seen[1][motion.rows]
        return p, a

    def _stacked(self, part: Callable[[int], tuple[Array, Array]]) -> Array:
        """Motor, and joint less motor, stacked over all runs."""
        of_motor, of_joint = [], []
        for number, run in enumerate(self.runs):
            good = self.valid[run.rows]
            p, a = part(number)
            of_motor.append(p[good])
            of_joint.append(a[good] - (p[good] if self.both else 0.0))
        return np.concatenate([*of_motor, *of_joint] if self.both else of_joint)

    def _missed(self, motions: Sequence[Motion], values: Values) -> Array:
        def part(number: int) -> tuple[Array, Array]:
            run, motion = self.runs[number], motions[number]
            shown_p, shown_a = self._shown(run, motion, values)
            a = self.table["joint_angle_rad"][run.rows] - motion.a[motion.rows] - shown_a
            return (self.table["motor_angle_rad"][run.rows] - motion.p[motion.rows] - shown_p if self.both else a), a

        return self._stacked(part)

    def _slopes(self) -> Array:
        def part(number: int) -> tuple[Array, Array]:
            motion = self.runs[number].motion
            slopes = self.sensitivities(number)[motion.rows]
            if self.extra:
                pushed = np.column_stack([torque(motion) for torque in self.extra.values()])
                slopes = np.concatenate([slopes, motion.answer(np.zeros_like(pushed), pushed)[motion.rows]], axis=2)
            of_motor, of_joint = [slopes[:, 0]], [slopes[:, 2]]
            for each in self.acting:
                if each.names[0] not in self.all:
                    continue
                pairs = each.effect.pairs(self.runs[number], self.table, each.shape, self.values[each.names[0]])
                p, a = (np.column_stack(side) for side in zip(*pairs, strict=True))
                if not each.effect.shown:
                    answer = motion.answer(p, a)
                    p, a = answer[:, 0], answer[:, 2]
                of_motor.append(p[motion.rows])
                of_joint.append(a[motion.rows])
            return np.column_stack(of_motor), np.column_stack(of_joint)

        return self._stacked(part)

    def improve(self) -> None:
        """Minimise the sum of squares, priors included; keep creeping or sticking friction, whichever fits better."""
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
        self._if_better(dry=True)
        if self.filter_s:
            self._if_better(filter_s=0.0, by=CLEARLY)
        self._settle()

    def _if_better(self, dry: bool | None = None, filter_s: float | None = None, by: float = 0.0) -> None:
        """Keep another friction or law where it lowers the cost by at least `by`, each at its best values."""
        was, old = self._state(), (self.dry, self.filter_s)
        self._made_so(old[0] if dry is None else dry, old[1] if filter_s is None else filter_s)
        moved = self._moved(self.values)
        if moved is not None:
            self._take(self.values, *moved)
            self._settle(ROUGHLY)
        if moved is None or self.cost() > was[0] - by:
            self._made_so(*old)
            self._take(*was[1:])

    def _made_so(self, dry: bool, filter_s: float) -> None:
        """Set whether dry friction holds the motor, and the filter of the rate that the law uses."""
        self.dry, self.filter_s = dry, filter_s
        for run in self.runs:
            run.drive = dataclasses.replace(run.drive, filter_s=filter_s)

    def _state(self) -> tuple[float, dict[str, float], list[Motion], Array]:
        return self.cost(), self.values, [run.motion for run in self.runs], self.missed

    def cost(self) -> float:
        """Twice the negative log-probability of the angles and the values, up to a constant."""
        beside = self._beside(self.values)
        independent = len(self.missed) / self.memory
        return independent * math.log(float(np.mean(self.missed**2))) + _pulls(beside, self.far)

    def _zero(self) -> float:
        """Mean of joint less motor; the usual zero where the motor is not measured."""
        if not self.both:
            return self.usual[ZERO]
        return float(np.mean((self.table["joint_angle_rad"] - self.table["motor_angle_rad"])[self.valid]))

    def _beside(self, values: Values) -> Array:
        """Deviations of values from their priors, in units of the priors' spreads."""
        return np.array([(values[name] - self.usual[name]) / spread for name, spread in self.spread.items()])

    def _settle(self, enough: float = FULLY) -> None:
        damping = 1e-3
        pull = np.zeros((len(self.spread), len(self.all)))
        for number, (name, spread) in enumerate(self.spread.items()):
            pull[number, self.all.index(name)] = 1.0 / spread
        for _ in range(MOST_STEPS):
            level = math.sqrt(self.memory * float(np.mean(self.missed**2)))
            beside = self._beside(self.values)
            slack = level / np.sqrt(1.0 + (beside / self.far) ** 2)
            slopes = np.vstack([self._slopes(), slack[:, None] * pull])
            missed = np.concatenate([self.missed, -slack * beside])
            lengths = np.maximum(np.linalg.norm(slopes, axis=0), 1e-12)
            least = float(self.missed @ self.missed) + level**2 * _pulls(beside, self.far)
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
                    reached = float(moved[1] @ moved[1]) + level**2 * _pulls(self._beside(tried), self.far)
                    if reached < least:
                        won = least - reached
                        self._take(tried, *moved)
                        damping *= 0.1
                        break
                damping *= 10.0
            if won <= enough * least:
                return

    def _moved(self, values: Values) -> tuple[list[Motion], Array] | None:
        """Motions with these values and their residuals; None where the simulation fails."""
        try:
            motions = [
                ankle_motion.simulated(
                    run.drive,
                    values,
                    self._start(run.rows, values),
                    self._torques(run, values),
                    self.dry,
                    run.motion.pushed,
                )
                for run in self.runs
            ]
        except UserError:
            return None
        return motions, self._missed(motions, values)

    def _torques(self, run: Run, values: Values) -> ankle_motion.Torques | None:
        pushing = [each for each in self.acting if not each.effect.shown]
        if not pushing and not any(values[name] for name in self.extra):
            return None

        def torques(m: Motion) -> Pair:
            at_motor, at_foot = _none(m), _none(m)
            for name, torque in self.extra.items():
                at_foot = at_foot + values[name] * torque(m)
            for each in pushing:
                p, a = each.effect.seen(dataclasses.replace(run, motion=m), self.table, each.shape, each.of(values))
                at_motor, at_foot = at_motor + p, at_foot + a
            return at_motor, at_foot

        return torques

    def held_as(self, other: "_Fit") -> None:
        """Take the values of another fit, with its friction and its law."""
        self._made_so(other.dry, other.filter_s)
        values = {name: self.values.get(name, value) if "@" in name else value for name, value in other.values.items()}
        values |= {name: self.values[name] for name in self.base if name not in values}  # times of its own jumps
        moved = self._moved(values)
        if moved is None:
            raise ModelError(f"{self.table.name}: the ankle cannot be simulated with these values")
        self._take(values, *moved)

    def _take(self, values: Mapping[str, float], motions: Sequence[Motion], missed: Array) -> None:
        self.values, self.missed = dict(values), missed
        for run, motion in zip(self.runs, motions, strict=True):
            run.motion = motion


def _signals(table: Table, runs: Sequence[Run]) -> dict[str, Array]:
    """The simulated motion on the table's rows, which shares no noise with any measurement."""
    s = {name: np.zeros(len(table)) for name in ("p", "u", "a", "w", "I", "acceleration")}
    for run in runs:
        m = run.motion
        for name, values in (("p", m.p), ("u", m.u), ("a", m.a), ("w", m.w), ("I", m.I), ("acceleration", m.slopes[3])):
            s[name][run.rows] = values[m.rows]
    s["rate"], s["slope"] = np.zeros(len(table)), np.zeros(len(table))
    for run in runs:  # as the board reports the joint's rate
        s["rate"][run.rows] = run.shown(run.motion.w)[run.motion.rows]
        s["slope"][run.rows] = run.shown(run.motion.slopes[3])[run.motion.rows]
    s["t"] = table.elapsed_s
    return s


# --- effects -----------------------------------------------------------------------------------------------------


def _made(recording: AnkleRecording, shape: Shape, effect: AnkleEffect) -> Columns:
    """Columns of an effect, from its torques or its part in the measurement, for every equation; cached."""
    key = effect.key(shape)
    if key in recording.made:
        return recording.made[key]
    at = recording.acting.get(key, (0.0,))[0]
    out: Columns = {}
    for run in recording.simulated:
        pairs = effect.pairs(run, recording.table, shape, at)
        motion = run.motion
        if effect.shown:
            p, a = (np.column_stack(each)[motion.rows] for each in zip(*pairs, strict=True))
            w = np.zeros_like(a)
        else:
            answer = motion.answer(*(np.column_stack(each) for each in zip(*pairs, strict=True)))
            p, a, w = answer[motion.rows, 0], answer[motion.rows, 2], run.shown(answer[:, 3])[motion.rows]
        for name, part in {JOINT: a, MOTOR: p, TRANSMISSION: a - p, RATE: w}.items():
            out.setdefault(name, np.zeros((len(recording.table), len(pairs))))[run.rows] = part
    recording.made[key] = out
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
    exact: Exact | None = None,
) -> Effect:
    def columns(recording: Recording, shape: Shape, values: Values) -> Columns:
        assert isinstance(recording, AnkleRecording)
        made = _made(recording, shape, effect)
        return {name: part for name, part in made.items() if name in recording.equations}

    effect = AnkleEffect(
        cause,
        at,
        subsystem,
        coefficients,
        shapes,
        columns,
        admissible,
        meaning,
        form,
        make=make,
        shown=shown,
        exact=exact,
    )
    return effect


def _below(limit: float) -> Callable[[Mapping[str, float]], bool]:
    """Amplitude of a cosine and a sine within a limit."""
    return lambda found: math.hypot(*(v for k, v in found.items() if k.startswith(("cosine", "sine")))) < limit


def _none(m: Motion) -> Array:
    return np.zeros_like(m.p)


def _at_motor(torque: Callable[[Motion, Shape], Array]) -> Make:
    return lambda run, table, shape: [(torque(run.motion, shape), _none(run.motion))]


def _at_foot(*torques: Callable[[Motion, Shape], Array]) -> Make:
    return lambda run, table, shape: [(_none(run.motion), each(run.motion, shape)) for each in torques]


def _wrong() -> list[Effect]:
    """A value that differs from that of sound ankles: the parameter's own sensitivity, without its prior."""

    def of(parameter: str) -> Callable[[Recording, Shape, Values], Columns]:
        def columns(recording: Recording, _: Shape, __: Values) -> Columns:
            assert isinstance(recording, AnkleRecording)
            if recording.loose:
                return {}
            return {name: each.columns[parameter][:, None] for name, each in recording.equations.items()}

        return columns

    return [
        Effect(cause, at, subsystem, (coefficient,), [{}], of(parameter), meaning=meaning)
        for parameter, cause, at, coefficient, subsystem, meaning in WRONG
    ]


def _by_the_foot(effect: Effect) -> bool:
    """True for a torque that depends on the joint's angle alone, as the return spring's does."""
    return effect.at == "inner_ankle" and effect.cause in ("return_spring", "once_per_turn")


def _springs() -> list[Effect]:
    M, at = "mechanical", "inner_ankle"
    return [
        _effect("return_spring", at, M, ("square_Nm_per_rad2",), _at_foot(lambda m, _: -m.a**2),
                form="square"),
        _effect("return_spring", at, M, ("cubic_Nm_per_rad3",), _at_foot(lambda m, _: -m.a**3),
                form="cube"),
        # a spring that hardens as none of the two alone, about the angle at which the base's spring is given
        _effect("return_spring", at, M, ("square_Nm_per_rad2", "cubic_Nm_per_rad3"),
                _at_foot(*(lambda m, p, power=n: -((m.a - p["rest_rad"]) ** power) for n in (2, 3))),
                [{"rest_rad": REST_rad}], form="square and cube"),
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
            wave(lambda m: m.values[CONSTANT] * m.I),
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
        _effect("sensor_lag", "joint_angle_rad", S, ("time_constant_s",), joint(lambda m, _: -m.w), shown=True,
                exact=lambda run, size: (_none(run.motion), behind(run.motion.a, run, size) - run.motion.a)),
        _effect("eccentricity", "joint_angle_rad", S, ("cosine_rad", "sine_rad"), joint(*waves), turns, shown=True,
                admissible=_below(LARGEST_ECCENTRICITY_rad)),
        _effect("clock_drift", "joint_angle_rad", S, ("share",),
                joint(lambda m, _: -m.w * (m.time_s - m.time_s[0])), shown=True),
    ]  # fmt: skip
    if both:
        found.append(
            _effect(
                "sensor_lag",
                "motor_angle_rad",
                S,
                ("time_constant_s",),
                motor(lambda m, _: -m.u),
                shown=True,
                exact=lambda run, size: (behind(run.motion.p, run, size) - run.motion.p, _none(run.motion)),
            )
        )
    if rate:
        found += [
            _of_rate("sensor_lag", "time_constant_s", lambda s: -s["slope"]),
            _of_rate("sensor_scale", "change", lambda s: s["rate"]),
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
    """Deviations of the board's law from the assumed one."""
    F = "firmware"
    logged = any("command_current_A" in r.table for r in recordings)

    def driven(current: Callable[[Run, Shape], Array]) -> Make:
        return lambda run, table, p: [(run.motion.values[CONSTANT] * current(run, p), _none(run.motion))]

    def later(run: Run, _: Shape) -> Array:
        m = run.motion
        return -np.gradient(run.drive.command(m.time_s, run.motion.values), m.time_s)

    def floor(run: Run, shape: Shape) -> Array:
        return run.drive.stiffness_A_per_rad * np.maximum(shape["floor_rad"] - run.target_rad, 0.0)

    low = min(float(run.target_rad.min()) for r in recordings if isinstance(r, AnkleRecording) for run in r.simulated)
    floors = [{"floor_rad": round(low + 0.02 * n, 3)} for n in range(1, 11)]
    found = [
        _effect("firmware_parameter", "stiffness", F, ("A_per_rad",),
                driven(lambda run, _: (0.0 if logged else run.target_rad) - run.motion.p)),
        _effect("sensor_lag", "command", F, ("time_constant_s",), driven(later),
                # nothing follows a command before it
                admissible=lambda found: 0.0 < found["time_constant_s"] < LATEST_s),
    ]  # fmt: skip
    if not logged:
        found += [
            _effect("firmware_parameter", "target_floor", F, ("share",),
                    driven(floor), floors),
            _effect("firmware_parameter", "feed_forward", F, ("A_per_rad",), driven(lambda run, _: run.target_rad)),
        ]  # fmt: skip
    return found
