"""Table 3 of the appendix: R, V_c, K by the power equation, C_1, C_0, mu by the torque equation.

In the paper's steps: stall, then K with R and V_c as found, then friction by the pulley with K as found; each step
takes over earlier values with their covariance. And by one joint fit of all three recordings.

    E    V = R I + V_c sgn I + G K w                        (eq. 32)
    M    T = G K I - (mu G K |I| + C_0) sgn w - C_1 w        (eq. 33, 35, steady)
"""

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.benches.pulley import FRICTION_SCATTER, GRAVITY, MASS_STEP_KG, RADIUS_M
from ranger_sim.sysid.dataset import Dataset
from ranger_sim.sysid.fit import Fit, Parameter
from ranger_sim.sysid.identification.blocks import Block, column, corrected, length, same_rows, solve
from ranger_sim.sysid.instruments import CALLIPER_M, CURRENT_SENSOR, SHAFT_SPEED, TORQUE_CELL, VOLTMETER

Array = NDArray[np.float64]

GEAR = 14.0  # of the bench's gearbox [A 8.2]
# Starts are sizes for a motor of this class, not its values. Limits only exclude meaningless values: chosen by us.
R = Parameter("R", "ohm", 1.0, 1e-3, 1e3, "start: a small motor's winding")
V_C = Parameter("V_c", "V", 0.5, -5.0, 10.0, "start: carbon brushes")
K = Parameter("K", "N m/A", 0.01, 1e-5, 10.0, "start: a 24 V motor of this size")
C_1 = Parameter("C_1", "N m s/rad", 0.001, -1.0, 10.0, "start: little", scale=0.001)
C_0 = Parameter("C_0", "N m", 0.02, -1.0, 10.0, "start: little", scale=0.01)
MU = Parameter("mu", "1", 0.05, -0.5, 1.0, "start: a gearbox of two stages")
TABLE_3 = ("R", "V_c", "K", "C_1", "C_0", "mu")

# Below this the sign of a current or a speed is not sure, or the friction's smoothing shows: five times the noise, and
# five times the plant's epsilon of 0.05 rad/s, where tanh is 1 within 1e-4. Readings below are left out.
SURE_CURRENT_A = 0.03
SURE_SPEED_rad_s = 0.3


@dataclasses.dataclass(frozen=True)
class Turning:
    """Readings of a cantilever recording for which the two equations are valid."""

    voltage_V: Array
    current_A: Array
    speed_rad_s: Array
    torque_Nm: Array
    left_out: int


def stalled_block(data: Dataset) -> Block:
    """E at rest."""
    V, I = column(data, "voltage_V", "stall"), column(data, "current_A", "stall")  # noqa: E741  the paper's letter
    same_rows(data, "stall", V, I)
    sure = np.abs(I) > SURE_CURRENT_A
    V, I = V[sure], I[sure]  # noqa: E741
    if len(V) < 3 or not (np.any(I > 0.0) and np.any(I < 0.0)):
        raise UserError(f"{data.name}: stall needs readings with current in both directions, it has {len(V)} in all")
    sign = np.sign(I)
    voltage, voltage_errors = corrected("stall", V, VOLTMETER)
    current, current_errors = corrected("stall", I, CURRENT_SENSOR)
    rough = np.linalg.lstsq(np.column_stack([I, sign]), V, rcond=None)[0][0]
    sigma = np.hypot(VOLTMETER.sigma, rough * CURRENT_SENSOR.sigma)

    def residual(v: dict[str, float]) -> Array:
        return (voltage(v) - v["R"] * current(v) - v["V_c"] * sign) / sigma

    return Block("stall", (R, V_C), (*voltage_errors, *current_errors), residual, len(V))


def turning(data: Dataset) -> Turning:
    """Readings with a sure sign of current and speed; UserError where too few are left."""
    names = ("voltage_V", "current_A", "speed_rad_per_s", "torque_Nm")
    columns = [column(data, name, "cantilever") for name in names]
    same_rows(data, "cantilever", *columns)
    V, I, w, T = columns  # noqa: E741  the paper's letters
    sure = (np.abs(I) > SURE_CURRENT_A) & (np.abs(w) > SURE_SPEED_rad_s)
    if np.count_nonzero(sure) < 10:
        raise UserError(
            f"{data.name}: cantilever needs 10 readings above {SURE_CURRENT_A} A and {SURE_SPEED_rad_s} rad/s, "
            f"it has {np.count_nonzero(sure)}"
        )
    return Turning(V[sure], I[sure], w[sure], T[sure], int(np.count_nonzero(~sure)))


def power_block(data: Dataset, gear: float = GEAR) -> Block:
    """E while turning, with R and V_c to be taken from the stall."""
    at = turning(data)
    sign = np.sign(at.current_A)
    voltage, voltage_errors = corrected("cantilever", at.voltage_V, VOLTMETER)
    current, current_errors = corrected("cantilever", at.current_A, CURRENT_SENSOR)
    rough = np.linalg.lstsq(np.column_stack([at.current_A, sign, gear * at.speed_rad_s]), at.voltage_V, rcond=None)[0]
    sigma = np.sqrt(
        VOLTMETER.sigma**2 + (rough[0] * CURRENT_SENSOR.sigma) ** 2 + (gear * rough[2] * SHAFT_SPEED.sigma) ** 2
    )

    def residual(v: dict[str, float]) -> Array:
        return (voltage(v) - v["R"] * current(v) - v["V_c"] * sign - gear * v["K"] * at.speed_rad_s) / sigma

    return Block("cantilever, power", (R, V_C, K), (*voltage_errors, *current_errors), residual, len(sign))


def cantilever_block(data: Dataset, gear: float = GEAR) -> Block:
    """E and M together. The noise of current and speed enters both: the two rows of a reading are made independent."""
    at = turning(data)
    sign, forward = np.sign(at.current_A), np.sign(at.speed_rad_s)
    voltage, voltage_errors = corrected("cantilever", at.voltage_V, VOLTMETER)
    current, current_errors = corrected("cantilever", at.current_A, CURRENT_SENSOR)
    torque, torque_errors = corrected("cantilever", at.torque_Nm, TORQUE_CELL)
    rough_R, _, rough_GK = np.linalg.lstsq(
        np.column_stack([at.current_A, sign, at.speed_rad_s]), at.voltage_V, rcond=None
    )[0]
    # covariance of the two rows, without friction's part: it changes the weight of a row by a few percent
    through_current = np.array([-rough_R, -rough_GK]) * CURRENT_SENSOR.sigma
    through_speed = np.array([-rough_GK, 0.0]) * SHAFT_SPEED.sigma
    own = np.diag([VOLTMETER.sigma**2, TORQUE_CELL.sigma**2])
    spread = own + np.outer(through_current, through_current) + np.outer(through_speed, through_speed)
    whiten = np.linalg.inv(np.linalg.cholesky(spread))

    def residual(v: dict[str, float]) -> Array:
        I = current(v)  # noqa: E741  the paper's letter
        GKI = gear * v["K"] * I
        E = voltage(v) - v["R"] * I - v["V_c"] * sign - gear * v["K"] * at.speed_rad_s
        # friction's share acts on the size of the current: its sign is that of the reading
        M = torque(v) - GKI + (v["mu"] * GKI * sign + v["C_0"]) * forward + v["C_1"] * at.speed_rad_s
        return (whiten @ np.stack([E, M])).T.ravel()

    errors = (*voltage_errors, *current_errors, *torque_errors)
    return Block("cantilever", (R, V_C, K, C_1, C_0, MU), errors, residual, 2 * len(sign))


def pulley_block(data: Dataset, gear: float = GEAR, apart: bool = False) -> Block:
    """M at the onset of motion and in steady fall, of all trials. apart: separate static and dynamic friction."""
    names = ("current_A", "mass_kg", "side", "tapped", "speed_rad_per_s")
    columns = [column(data, name, "pulley") for name in names]
    same_rows(data, "pulley", *columns)
    I, mass, side, tapped, w = columns  # noqa: E741  the paper's letter
    onset = w == 0.0
    driven = np.abs(I) > 5.0 * CURRENT_SENSOR.sigma + CURRENT_SENSOR.offset
    direction = np.sign(I) * driven
    current, current_errors = corrected("pulley", I, CURRENT_SENSOR)
    # the load at which motion began is between the last two masses
    load_kg = mass - np.where(onset, 0.5 * MASS_STEP_KG * side, 0.0)
    planned_GKI = gear * 0.018 * np.abs(I) * driven  # weights only: the friction's scatter grows with the load
    step_Nm = np.where(onset, MASS_STEP_KG * GRAVITY * RADIUS_M / np.sqrt(12.0), 0.0)
    scatter_Nm = FRICTION_SCATTER * (0.01 + 0.1 * planned_GKI)
    current_Nm = np.where(driven, gear * 0.018 * CURRENT_SENSOR.sigma, 0.0)
    speed_Nm = np.where(onset, 0.0, 0.0033 * SHAFT_SPEED.sigma)
    sigma = np.sqrt(step_Nm**2 + scatter_Nm**2 + current_Nm**2 + speed_Nm**2)
    static = (tapped == 0.0) & onset
    C0_names, mu_names = (("C_0d", "C_0s"), ("mu_d", "mu_s")) if apart else (("C_0", "C_0"), ("mu", "mu"))

    def residual(v: dict[str, float]) -> Array:
        GKI = gear * v["K"] * current(v) * direction
        C0 = np.where(static, v[C0_names[1]], v[C0_names[0]])
        mu = np.where(static, v[mu_names[1]], v[mu_names[0]])
        load = load_kg * GRAVITY * v["pulley.radius_m"]
        return (load - GKI - side * (C0 + mu * GKI) - v["C_1"] * w) / sigma

    radius = length("pulley.radius_m", RADIUS_M, CALLIPER_M, "by calliper")
    friction = (
        tuple(
            dataclasses.replace(each, name=name)
            for name, each in zip((*C0_names, *mu_names), (C_0, C_0, MU, MU), strict=True)
        )
        if apart
        else (C_0, MU)
    )
    return Block("pulley", (K, C_1, *friction), (*current_errors, radius), residual, len(w))


@dataclasses.dataclass(frozen=True)
class MotorSteps:
    """The paper's path. power: K, with R and V_c; friction: static and dynamic separately, at the pulley."""

    stall: Fit
    power: Fit
    friction: Fit


def steps(
    stall: Dataset, cantilever: Dataset, pulley: Dataset, gear: float = GEAR, tell: Callable[[str], None] | None = None
) -> MotorSteps:
    """Appendix 8.3.1, 8.3.2, 8.4.1 to 8.4.5, each with the results of the one before."""
    at_rest = solve([stalled_block(stall)], tell=tell)
    power = solve([power_block(cantilever, gear)], earlier=[at_rest], tell=tell)
    friction = solve([pulley_block(pulley, gear, apart=True)], earlier=[power], tell=tell)
    return MotorSteps(at_rest, power, friction)


def joint(
    stall: Dataset, cantilever: Dataset, pulley: Dataset, gear: float = GEAR, tell: Callable[[str], None] | None = None
) -> Fit:
    """All of table 3 from all three recordings at once."""
    return solve([stalled_block(stall), cantilever_block(cantilever, gear), pulley_block(pulley, gear)], tell=tell)
