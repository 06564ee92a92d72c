"""An ankle under its board's law, simulated freely: motor and foot as two inertias with the cable between them.

    I = I_0 - K p - D p'                      the board's law, on the motor's angle p; I_0 is what it was told
    J_A p'' = T(I, p') - k_s (p - a) + m      T of EQUATIONS 2.1; m, f: torques of effects beside the base model
    J_f a'' = k_s (p - a) - k_r a + b + f     EQUATIONS 2.3, 2.7 with b = k_r a_0

The whole motion is one system of equations, one trapezoid for every step: Newton's method finds it, and the factors of
its matrix answer what any small torque beside the base would do to every angle. The law's damping on the
rotor is faster (540 1/s) than a log is dense, so explicit steps would have to be far smaller.
"""

import dataclasses
from collections.abc import Callable, Mapping

import numpy as np
from scipy.linalg import lapack

from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant.motor_parameters import ANKLE_MOTOR
from ranger_sim.plant.parameters import BodyParameters
from ranger_sim.sysid.dataset import Array

GEAR_K = ANKLE_MOTOR.gear * ANKLE_MOTOR.torque_constant_Nm_per_A
J_A = ANKLE_MOTOR.reflected_inertia_kg_m2
MU = ANKLE_MOTOR.load_friction
EPSILON = ANKLE_MOTOR.friction_smoothing_rad_s
K_S = BodyParameters().ankle_spring_Nm_per_rad
STEP_S = 0.002  # longest step: the cable's mode with the foot, 100 1/s, is within 0.4 % of its frequency
BELOW, ABOVE = 7, 3  # the matrix's bands: four states at two instants
MOST_STEPS = 60  # of Newton's method; six to eight are usual
NEAR = 1e-7  # rad, of the last step
SECANT = 0.3  # rad/s; while the rates move by more, friction's slope is that of its secant

INERTIA, STIFFNESS, TORQUE, COULOMB, VISCOUS = (
    "inertia_kg_m2", "return_stiffness_Nm_per_rad", "return_torque_Nm", "coulomb_friction_Nm", "viscous_friction_Nms",
)  # fmt: skip
PARAMETERS = (INERTIA, STIFFNESS, TORQUE, COULOMB, VISCOUS)

Values = Mapping[str, float]


@dataclasses.dataclass(frozen=True)
class Drive:
    """What drives a run: the law's numbers and I_0 at even instants. time_s, command_A: shape (n,)."""

    time_s: Array
    command_A: Array
    stiffness_A_per_rad: float
    dampness_As_per_rad: float


@dataclasses.dataclass
class Motion:
    """A simulated run. p, u, a, w: angle and rate of motor and joint; I: current; sliding: the friction's tanh,
    all of shape (m,) at every step; slopes: rates of the four states; rows: the steps that the log has."""

    time_s: Array
    states: Array  # (4, m)
    slopes: Array  # (4, m)
    I: Array  # noqa: E741  (the paper's letter)
    sliding: Array
    rows: slice
    inertia: float
    factors: tuple

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
    def cable(self) -> Array:
        """Torque in the cable."""
        return K_S * (self.p - self.a)

    def answer(self, at_motor: Array, at_foot: Array) -> Array:
        """What small torques (m, k) do to the states: (m, 4, k)."""
        steps, count = at_motor.shape
        pushed = np.zeros((steps, 4, count))
        pushed[:, 1] = at_motor / J_A
        pushed[:, 3] = at_foot / self.inertia
        right = np.zeros((steps, 4, count))
        right[1:] = 0.5 * (self.time_s[1] - self.time_s[0]) * (pushed[1:] + pushed[:-1])
        return _solved(self.factors, right.reshape(4 * steps, count)).reshape(steps, 4, count)


Torques = Callable[[Motion], tuple[Array, Array]]  # (m,) at the motor and at the foot


def sensitivities(motion: Motion) -> Array:
    """Derivatives of the states by PARAMETERS: (m, 4, 5)."""
    none = np.zeros_like(motion.p)
    at_motor = np.column_stack([none, none, none, -motion.sliding, -motion.u])
    at_foot = np.column_stack([-motion.slopes[3], -motion.a, none + 1.0, none, none])
    return motion.answer(at_motor, at_foot)


def simulated(drive: Drive, values: Values, start: Array, torques: Torques | None = None) -> Motion:
    """The motion under `drive`. start: (4, n) a guess at the drive's instants, whose first column is where it begins.

    UserError when there is no motion that a machine could make with these values.
    """
    n = len(drive.time_s)
    step_s = (drive.time_s[-1] - drive.time_s[0]) / (n - 1)
    parts = max(1, round(step_s / STEP_S))
    time_s = drive.time_s[0] + step_s / parts * np.arange((n - 1) * parts + 1)
    command = np.interp(time_s, drive.time_s, drive.command_A)
    states = np.array([np.interp(time_s, drive.time_s, each) for each in start])
    h, moved = step_s / parts, np.inf
    motion = Motion(time_s, states, states, command, command, slice(None, None, parts), values[INERTIA], ())
    for _ in range(MOST_STEPS):
        slopes, jacobian = _slopes(drive, values, motion, command, moved > SECANT, torques)
        missed = np.zeros_like(motion.states)
        missed[:, 1:] = np.diff(motion.states) - 0.5 * h * (slopes[:, 1:] + slopes[:, :-1])
        step = _solved(_factors(jacobian, h), missed.T.reshape(-1, 1)).reshape(-1, 4).T
        motion.states = motion.states - step
        moved = float(np.max(np.abs(step[1])))
        if not np.isfinite(moved):
            break
        if np.max(np.abs(step[0])) < NEAR:
            motion.slopes, jacobian = _slopes(drive, values, motion, command, False, torques)
            motion.factors = _factors(jacobian, h)
            return motion
    raise UserError(
        "the ankle's motion cannot be simulated with " + ", ".join(f"{k} {v:.3g}" for k, v in values.items())
    )


def _slopes(
    drive: Drive, values: Values, motion: Motion, command: Array, secant: bool, torques: Torques | None
) -> tuple[Array, Array]:
    """Rates of the states (4, m) and their derivatives by the states (4, 4, m); the motion's current is kept."""
    p, u, a, w = motion.states
    K, D = drive.stiffness_A_per_rad, drive.dampness_As_per_rad
    motion.I = command - K * p - D * u
    motion.sliding = sliding = np.tanh(u / EPSILON)
    friction = values[COULOMB] + MU * GEAR_K * np.abs(motion.I)
    steepness = (1.0 - sliding * sliding) / EPSILON
    if secant:
        steepness = np.where(np.abs(u) < 1e-9, 1.0 / EPSILON, sliding / np.where(u == 0.0, 1.0, u))
    loaded = GEAR_K * (1.0 - MU * np.sign(motion.I) * sliding)
    cable = K_S * (p - a)
    at_motor, at_foot = torques(motion) if torques else (0.0, 0.0)
    inertia, k_r = values[INERTIA], values[STIFFNESS]
    drives = GEAR_K * motion.I - friction * sliding - values[VISCOUS] * u - cable + at_motor
    slopes = np.array([u, drives / J_A, w, (cable - k_r * a + values[TORQUE] + at_foot) / inertia])
    jacobian = np.zeros((4, 4, len(p)))
    jacobian[0, 1] = jacobian[2, 3] = 1.0
    jacobian[1, 0] = (-K * loaded - K_S) / J_A
    jacobian[1, 1] = (-D * loaded - friction * steepness - values[VISCOUS]) / J_A
    jacobian[1, 2] = K_S / J_A
    jacobian[3, 0] = K_S / inertia
    jacobian[3, 2] = (-K_S - k_r) / inertia
    return slopes, jacobian


def _factors(jacobian: Array, h: float) -> tuple:
    """LU factors of the trapezoids' matrix: instants one below the other, the first one fixed."""
    steps = jacobian.shape[2]
    bands = np.zeros((2 * BELOW + ABOVE + 1, 4 * steps))
    diagonal = BELOW + ABOVE
    for row in range(4):
        for column in range(4):
            same = float(row == column)
            part = -0.5 * h * jacobian[row, column]
            here = part + same
            here[0] = same
            at = 4 * np.arange(steps) + column
            bands[diagonal + row - column, at] = here
            bands[diagonal + row - column + 4, at[:-1]] = part[:-1] - same
    factors, pivots, failed = lapack.dgbtrf(bands, BELOW, ABOVE)
    if failed:
        raise UserError("the ankle's motion cannot be simulated: its equations have no answer")
    return factors, pivots


def _solved(factors: tuple, right: Array) -> Array:
    found, _ = lapack.dgbtrs(factors[0], BELOW, ABOVE, right, factors[1])
    return np.asarray(found)
