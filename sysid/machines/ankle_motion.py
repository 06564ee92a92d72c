"""An ankle under its board's law, simulated freely: motor and foot as two inertias with the cable between them.

    I = I_0 - K p - D r, late by a lag        the board's law, on the motor's angle p; I_0 is its command, late
    r = p', or behind the board's filter      robot.md N4.1: a sixteenth every 0.5 ms
    J_A p'' = T(I, p') - k_s x - k_m p + m    T of EQUATIONS 2.1; m, f: torques of effects added to the base model
    J_f a'' = k_s x - k_r (a - a_0) + b + f   EQUATIONS 2.3, 2.7 with a_0 as the body has it
    x = p + z - a                             z: what the joint's encoder shows at the motor's zero

k_m is of the spring at the motor, which balances that of the foot (appendix 2.2); the body has the two as one at the
joint, and none at the motor. The constant part of its torque cannot be separated from z and b.

A larger torque constant of the motor would scale all torques and inertias by the same factor. The rotor's inertia, the
best known, fixes that factor.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping, MutableSequence, Sequence
from typing import cast

import numpy as np
from scipy.interpolate import CubicSpline

from ranger_sim.foundation.user_error import ModelError
from ranger_sim.plant import body_files
from ranger_sim.plant.electrics.motor_parameters import ANKLE_MOTOR
from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.machines import ankle_steps

STEP_S = 0.002  # longest step: the cable's mode with the foot, 100 1/s, is within 0.4 % of its frequency
STATES = 6  # p, u, a, w; the rate r that the law uses, the current I
MOST_ROUNDS = 30  # rounds with torques added to the base: each leaves some per cent of the change of the round before
NEAR = 1e-6  # rad, change in the last round
FARTHEST_rad = 1e2  # beyond it no geared machine moves

(
    INERTIA, STIFFNESS, TORQUE, COULOMB, VISCOUS, LOAD, CABLE, ROTOR, ZERO, LAG, LATE, BALANCE, CONSTANT, SIGN_WIDTH,
) = PARAMETERS = (
    "inertia_kg_m2", "return_stiffness_Nm_per_rad", "return_torque_Nm", "coulomb_friction_Nm", "viscous_friction_Nms",
    "load_friction", "cable_stiffness_Nm_per_rad", "rotor_inertia_kg_m2", "joint_zero_rad",
    "law_lag_s", "target_late_s", "motor_spring_Nm_per_rad", "torque_constant_Nm_per_A",
    "friction_width_rad_s",
)  # fmt: skip
BODY = body_files.load("ranger")
REST_rad = BODY.parameters.ankle_return_rest_rad
# Values of the simulator's body, which was identified from the robot's own logs. The lag is half of the board's slot of
# 0.5 ms, and its current loop: robot.md N4.3.
USUAL = {
    INERTIA: BODY.parameters.foot_inertia_kg_m2,
    STIFFNESS: BODY.parameters.ankle_return_Nm_per_rad,
    TORQUE: 0.0,
    COULOMB: BODY.electrics.inner_ankle.constant_friction_Nm,
    VISCOUS: BODY.electrics.inner_ankle.viscous_friction_Nms,
    LOAD: BODY.electrics.inner_ankle.load_friction,
    CABLE: BODY.parameters.ankle_spring_Nm_per_rad,
    ROTOR: BODY.electrics.inner_ankle.reflected_inertia_kg_m2,
    ZERO: 0.0,
    LAG: 0.00075,
    LATE: 0.0,
    BALANCE: 0.0,
    CONSTANT: BODY.electrics.inner_ankle.gear * BODY.electrics.inner_ankle.torque_constant_Nm_per_A,
    SIGN_WIDTH: ANKLE_MOTOR.friction_smoothing_rad_s,
}
RATE_FILTER_S = 0.00775  # of the board's rate: robot.md N4.1

Values = Mapping[str, float]


@dataclasses.dataclass(frozen=True)
class Drive:
    """Inputs of a run: the law's numbers and I_0 at even times. time_s, command_A: shape (n,).

    Between rows the command goes straight, or along a cubic spline where it is `bent`. `jumps` has the rows before
    which it jumps, by the names of the jumps' times among the values: seconds after the middle between the two rows.
    """

    time_s: Array
    command_A: Array
    stiffness_A_per_rad: float
    dampness_As_per_rad: float
    filter_s: float = 0.0  # time constant of the filter through which the law reads the rate
    bent: bool = False
    jumps: Mapping[str, int] = dataclasses.field(default_factory=dict)

    def command(self, time_s: Array, values: "Values") -> Array:
        """I_0 at even times (m,), late by `LATE`; a jump within a step counts by its part of the step."""
        late_s = np.clip(time_s - values[LATE], self.time_s[0], self.time_s[-1])
        if self.bent:
            return np.asarray(CubicSpline(self.time_s, self.command_A)(late_s))
        sizes = self._sizes()
        level = np.zeros_like(self.command_A)
        for name, row in self.jumps.items():
            level[row:] += sizes[name]
        found = np.interp(late_s, self.time_s, self.command_A - level)
        for name, row in self.jumps.items():
            found += sizes[name] * np.clip(self._passed(name, row, time_s, values), 0.0, 1.0)
        return found

    def by_jumps(self, time_s: Array, values: "Values") -> Array:
        """(m, jumps): change of `command` for a jump later by 1 s."""
        sizes, step_s = self._sizes(), time_s[1] - time_s[0]
        passed = (self._passed(name, row, time_s, values) for name, row in self.jumps.items())
        columns = [-size / step_s * ((0.0 < t) & (t <= 1.0)) for size, t in zip(sizes.values(), passed, strict=True)]
        return np.column_stack(columns) if columns else np.zeros((len(time_s), 0))

    def _sizes(self) -> dict[str, float]:
        return {name: float(self.command_A[row] - self.command_A[row - 1]) for name, row in self.jumps.items()}

    def _passed(self, name: str, row: int, time_s: Array, values: "Values") -> Array:
        """Steps since a jump."""
        middle_s = 0.5 * (self.time_s[row] + self.time_s[row - 1])
        return np.asarray((time_s - values[LATE] - middle_s - values[name]) / (time_s[1] - time_s[0]))


@dataclasses.dataclass
class Motion:
    """A simulated run. p, u, a, w: angle and rate of motor and joint; I: current; sliding: friction over its limit, -1
    to 1; all of shape (m,) at every step; standing: dry friction holds the motor; slopes: rates of p, u, a, w; rows:
    the steps that the log has; later: change of the current for a lag longer by 1 s; behind: for a target later by 1 s.
    """

    time_s: Array
    states: Array  # (6, m)
    slopes: Array  # (4, m)
    later: Array
    behind: Array
    sliding: Array
    standing: np.ndarray
    rows: slice
    values: dict[str, float]
    steps: "_Steps"
    pushed: tuple[Array, Array] | None = None  # torques added to the base at motor and foot

    @property
    def p(self) -> Array:
        """Motor's angle."""
        return self.states[0]

    @property
    def u(self) -> Array:
        """Motor's rate."""
        return self.states[1]

    @property
    def a(self) -> Array:
        """Joint's angle."""
        return self.states[2]

    @property
    def w(self) -> Array:
        """Joint's rate."""
        return self.states[3]

    @property
    def I(self) -> Array:  # noqa: E743  (the paper's letter)
        """Motor's current."""
        return self.states[5]

    @property
    def cable(self) -> Array:
        """Torque in the cable."""
        return self.values[CABLE] * self.twist

    @property
    def twist(self) -> Array:
        """Of the cable, rad."""
        return self.p + self.values[ZERO] - self.a

    def answer(self, at_motor: Array, at_foot: Array, at_current: Array | None = None) -> Array:
        """Response of the states to small torques (m, k), and to small changes of the current itself: (m, 6, k)."""
        steps, count = at_motor.shape
        right = np.zeros((steps, STATES, count))
        half = 0.5 * (self.time_s[1] - self.time_s[0])
        right[1:, 1] = half / self.values[ROTOR] * (at_motor[1:] + at_motor[:-1])
        right[1:, 3] = half / self.values[INERTIA] * (at_foot[1:] + at_foot[:-1])
        if at_current is not None:
            right[1:, 5] = at_current[1:]
        return self.steps.answers(self, right)


Torques = Callable[[Motion], tuple[Array, Array]]  # (m,) at the motor and at the foot


def sensitivities(motion: Motion) -> Array:
    """Derivatives of the states by PARAMETERS and by the times of the drive's jumps: (m, 6, 14 + jumps)."""
    none = np.zeros_like(motion.p)
    GK, k_s = motion.values[CONSTANT], none + motion.values[CABLE]
    load, width = np.abs(motion.I), motion.values[SIGN_WIDTH]
    bound = motion.values[COULOMB] + motion.values[LOAD] * GK * load
    bend = none if motion.steps.dry else bound * (1.0 - motion.sliding**2) * motion.u / width**2
    pushes = {  # at the motor, at the foot
        INERTIA: (none, -motion.slopes[3]),
        STIFFNESS: (none, REST_rad - motion.a),
        TORQUE: (none, none + 1.0),
        COULOMB: (-motion.sliding, none),
        VISCOUS: (-motion.u, none),
        LOAD: (-motion.sliding * GK * load, none),
        CABLE: (-motion.twist, motion.twist),
        ROTOR: (-motion.slopes[1], none),
        ZERO: (-k_s, k_s),
        LAG: (none, none),
        LATE: (none, none),
        BALANCE: (-motion.p, none),
        CONSTANT: (motion.I - motion.values[LOAD] * motion.sliding * load, none),
        SIGN_WIDTH: (bend, none),
    }
    by_jumps = motion.steps.takes * motion.steps.drive.by_jumps(motion.time_s, motion.values)
    count = len(PARAMETERS) + by_jumps.shape[1]
    at_motor, at_foot, at_current = (np.zeros((len(none), count)) for _ in range(3))
    for number, name in enumerate(PARAMETERS):
        at_motor[:, number], at_foot[:, number] = pushes[name]
    at_current[:, PARAMETERS.index(LAG)] = motion.later
    at_current[:, PARAMETERS.index(LATE)] = motion.behind
    at_current[:, len(PARAMETERS) :] = by_jumps
    return motion.answer(at_motor, at_foot, at_current)


def simulated(
    drive: Drive,
    values: Values,
    start: Sequence[float],
    torques: Torques | None = None,
    dry: bool = False,
    before: tuple[Array, Array] | None = None,
) -> Motion:
    """The motion under `drive` from p, u, a, w = `start`. dry: the motor is held by its friction, whose sign has no
    width. before: the torques of a motion near this one.

    Raise UserError when these values give a motion that no machine could make.
    """
    n = len(drive.time_s)
    step_s = (drive.time_s[-1] - drive.time_s[0]) / (n - 1)
    parts = max(1, round(step_s / STEP_S))
    time_s = drive.time_s[0] + step_s / parts * np.arange((n - 1) * parts + 1)
    none = np.zeros_like(time_s)
    values = {**USUAL, **values}
    command = drive.command(time_s, values)
    steps = _Steps(drive, values, step_s / parts, command, dry)
    pushed: tuple[Array, Array] = before if torques and before is not None else (none, none)
    states, sliding = steps.walked(*pushed, start)
    nowhere = np.zeros(len(none), dtype=bool)
    rows = slice(None, None, parts)
    motion = Motion(time_s, states, none, none, none, sliding, nowhere, rows, steps.values, steps)
    for _ in range(MOST_ROUNDS if torques else 0):
        assert torques is not None
        steps.complete(motion, *pushed)
        pushed, was = torques(motion), motion.states
        motion.states, motion.sliding = steps.walked(*pushed, start)
        if not np.max(np.abs(motion.states[[0, 2]] - was[[0, 2]])) > NEAR:  # or the motion has diverged
            break
    motion.pushed = pushed
    steps.complete(motion, *pushed)
    if not np.all(np.isfinite(motion.slopes)) or np.max(np.abs(motion.p)) > FARTHEST_rad:
        raise ModelError(
            "the ankle's motion cannot be simulated with " + ", ".join(f"{k} {v:.3g}" for k, v in values.items())
        )
    return motion


class _Steps:
    """The equations of one step of h seconds: ends x_1 = starts x_0 + pushed - friction, six states."""

    def __init__(self, drive: Drive, values: dict[str, float], h: float, command: Array, dry: bool) -> None:
        self.drive, self.values, self.h, self.command, self.dry = drive, values, h, command, dry
        k_s, k_r, rotor, inertia = values[CABLE], values[STIFFNESS], values[ROTOR], values[INERTIA]
        rates = np.zeros((4, STATES))  # of p, u, a, w by the states, without friction
        rates[0, 1] = rates[2, 3] = 1.0
        rates[1] = np.array([-k_s - values[BALANCE], -values[VISCOUS], k_s, 0.0, 0.0, values[CONSTANT]]) / rotor
        rates[3] = np.array([k_s, 0.0, -k_s - k_r, 0.0, 0.0, 0.0]) / inertia
        self.rates = rates
        self.ends, self.starts = np.eye(STATES), np.zeros((STATES, STATES))
        self.ends[:4] -= 0.5 * h * rates
        self.starts[:4] = np.eye(4, STATES) + 0.5 * h * rates
        # A filter slower than a step uses the trapezoidal rule; a faster one, and the current, only the step's end,
        # which gives a delay of the time constant as well.
        k = 0.5 * h / max(drive.filter_s, h)
        keep, was, now = (1.0 - k) / (1.0 + k), k / (1.0 + k), k / (1.0 + k)
        if drive.filter_s < h:
            keep, was, now = drive.filter_s / (drive.filter_s + h), 0.0, h / (drive.filter_s + h)
        self.ends[4, 1], self.starts[4, 1], self.starts[4, 4] = -now, was, keep
        self.takes = h / (values[LAG] + h)
        self.ends[5, 0] = self.takes * drive.stiffness_A_per_rad
        self.ends[5, 4] = self.takes * drive.dampness_As_per_rad
        self.starts[5, 5] = 1.0 - self.takes

    def pushed(self, at_motor: Array, at_foot: Array) -> Array:
        """The part of the rates of p, u, a, w (4, m) that does not depend on the states."""
        values, none = self.values, np.zeros_like(self.command)
        zero = values[CABLE] * values[ZERO]
        bias = values[TORQUE] + values[STIFFNESS] * REST_rad
        return np.array([none, (at_motor - zero) / values[ROTOR], none, (zero + bias + at_foot) / values[INERTIA]])

    def walked(self, at_motor: Array, at_foot: Array, start: Sequence[float]) -> tuple[Array, Array]:
        """States (6, m), and the friction over its limit (m,), step by step."""
        values, drive, count = self.values, self.drive, len(self.command)
        p, u, a, w = start
        I = float(self.command[0]) - drive.stiffness_A_per_rad * p - drive.dampness_As_per_rad * u  # noqa: E741
        rates = self.pushed(at_motor, at_foot)
        right = np.zeros((STATES, count - 1))
        right[:4] = 0.5 * self.h * (rates[:, 1:] + rates[:, :-1])
        right[5] = self.takes * self.command[1:]
        inverse = np.linalg.inv(self.ends)
        loads, width = values[LOAD] * values[CONSTANT], 0.0 if self.dry else values[SIGN_WIDTH]
        states, braking = np.full((count, STATES), math.nan), np.zeros(count)
        states[0] = p, u, a, w, u, I
        ankle_steps.walk(
            _flat(inverse @ self.starts),
            _flat(np.ascontiguousarray((inverse @ right).T)),
            _flat(np.asarray(self.h / values[ROTOR] * inverse[:, 1], dtype=float)),  # of a torque there
            _flat(np.array([values[COULOMB], loads, width])),
            _flat(states),
            _flat(braking),
        )
        braking[0] = math.nan
        sliding = braking / np.maximum(values[COULOMB] + loads * np.abs(states[:, 5]), 1e-300)
        sliding[0] = np.sign(u) if self.dry else math.tanh(u / width)
        return states.T, sliding

    def complete(self, motion: Motion, at_motor: Array, at_foot: Array) -> None:
        """The motion's friction and rates from its states."""
        values, drive = self.values, self.drive
        motion.standing = self.dry & (motion.u == 0.0)
        bound = values[COULOMB] + values[LOAD] * values[CONSTANT] * np.abs(motion.I)
        motion.slopes = self.rates @ motion.states + self.pushed(at_motor, at_foot)
        motion.slopes[1] -= bound * motion.sliding / values[ROTOR]
        motion.slopes[1][motion.standing] = 0.0  # also where it came to stand within the step
        asked = self.command - drive.stiffness_A_per_rad * motion.p - drive.dampness_As_per_rad * motion.states[4]
        before = np.concatenate([motion.I[:1], motion.I[:-1]])
        motion.later = self.takes**2 / self.h * (before - asked)
        motion.behind = -self.takes * np.gradient(self.command, self.h)

    def answers(self, motion: Motion, right: Array) -> Array:
        """Small changes (m, 6, k) of the states by what changes in each step's equations, (m, 6, k)."""
        values, count = self.values, right.shape[2]
        loads = values[LOAD] * values[CONSTANT]
        bound = values[COULOMB] + loads * np.abs(motion.I)
        width = math.inf if self.dry else values[SIGN_WIDTH]
        steep = np.where(motion.standing, -1.0, bound * np.maximum(1.0 - motion.sliding**2, 0.0) / width)
        bends = np.column_stack((steep, loads * np.sign(motion.I) * motion.sliding))
        inverse = np.linalg.inv(self.ends)
        changes = np.ascontiguousarray(inverse @ right)
        ankle_steps.respond(
            _flat(inverse @ self.starts),
            _flat(np.asarray(self.h / values[ROTOR] * inverse[:, 1], dtype=float)),
            _flat(bends),
            count,
            _flat(changes),
        )
        return changes


def _flat(numbers: Array) -> MutableSequence[float]:
    """The memory of an array without gaps, row by row, for the loops over time: what they write is in the array."""
    return cast(MutableSequence[float], numbers.ravel().data)
