"""Table 2's inertial numbers of both legs, and whether the legs balance (appendix 7.2, eq. 28-31).

In the paper's steps: c m by the scale, w m by the hanging angle, J by the period of a small swing; and by one joint fit
of all three recordings, with the swing simulated. Both legs at once, because they share the instruments.
"""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.benches.leg import BEARING_SMOOTHING, GRAVITY, BEARING_Nm
from ranger_sim.sysid.dataset import Dataset
from ranger_sim.sysid.fit import Fit, Parameter
from ranger_sim.sysid.identification.blocks import Block, column, corrected, length, solve, start_at
from ranger_sim.sysid.instruments import FISH_SCALE, INCLINOMETER, JOINT_ENCODER, TAPE_M

Array = NDArray[np.float64]

LEGS = ("outer", "inner")
ARM_M = 0.96  # from hip to ankle, where the scale holds the leg [A table 2, figure 23]
SWING_STEP_S = 0.02  # of the simulated swing; a fourth-order step leaves 1e-7 rad in twelve seconds


def moment(leg: str) -> Parameter:
    """c m of a leg."""
    return Parameter(f"{leg}_cm", "kg m", 0.5, 0.0, 100.0, "start: a leg of some kg, its centre near the hip")


def offset(leg: str) -> Parameter:
    """w m of a leg, positive ahead."""
    return Parameter(f"{leg}_wm", "kg m", 0.001, -10.0, 10.0, "start: nearly none", scale=0.01)


def inertia(leg: str, start: float = 0.5) -> Parameter:
    """J about the hip."""
    return Parameter(f"{leg}_J_hip", "kg m^2", start, 1e-4, 1e3, "start: by the period's first estimate")


TABLE_2_LEGS = tuple(f"{leg}_{what}" for leg in LEGS for what in ("cm", "wm", "J_hip"))


def which_leg(data: Dataset, bench: str) -> list[tuple[str, Array]]:
    """(leg, rows) of every leg in the recording; without a column `inner` it is the outer one's."""
    inner = column(data, "inner", bench, 0.0) != 0.0
    return [(leg, rows) for leg, rows in zip(LEGS, (~inner, inner), strict=True) if np.any(rows)]


def level_block(data: Dataset, arm_m: float = ARM_M) -> Block:
    """Balance of moments of a leg held level: F l = m c g (figure 23)."""
    shown = column(data, "force_N", "level")
    force, errors = corrected("level", shown, FISH_SCALE)
    legs = which_leg(data, "level")
    index = np.empty(len(shown), dtype=int)
    for number, (_, rows) in enumerate(legs):
        index[rows] = number

    def residual(v: dict[str, float]) -> Array:
        moments = np.array([v[f"{leg}_cm"] for leg, _ in legs])
        return (force(v) - GRAVITY * moments[index] / v["level.arm_m"]) / FISH_SCALE.sigma

    arm = length("level.arm_m", arm_m, TAPE_M, "by tape measure")
    return Block("level", tuple(moment(leg) for leg, _ in legs), (*errors, arm), residual, len(shown))


def hang_block(data: Dataset) -> Block:
    """tan th = w / c of a hanging leg (figure 24)."""
    shown = column(data, "angle_rad", "hang")
    angle, errors = corrected("hang", shown, INCLINOMETER)
    legs = which_leg(data, "hang")
    # where bearings hold it: uniform, for a leg of the start's size
    sigma = math.hypot(INCLINOMETER.sigma, BEARING_Nm / (GRAVITY * 0.7) / math.sqrt(3.0))

    def residual(v: dict[str, float]) -> Array:
        rest = np.empty(len(shown))
        for leg, rows in legs:
            rest[rows] = math.atan2(v[f"{leg}_wm"], v[f"{leg}_cm"])
        return (angle(v) - rest) / sigma

    asked = tuple(parameter for leg, _ in legs for parameter in (moment(leg), offset(leg)))
    return Block("hang", asked, errors, residual, len(shown))


@dataclasses.dataclass(frozen=True)
class Swing:
    """One leg's swing: seconds since it was let go, angle as the encoder showed it."""

    leg: str
    time_s: Array
    angle_rad: Array

    @property
    def period_s(self) -> float:
        """First estimate: twice the mean distance of the crossings of the middle."""
        middle = float(np.mean(self.angle_rad))
        above = self.angle_rad > middle
        crossings = self.time_s[1:][above[1:] != above[:-1]]
        if len(crossings) < 4:
            raise UserError(f"pendulum: the {self.leg} leg swings less than two periods; is this a free swing?")
        return 2.0 * float(crossings[-1] - crossings[0]) / (len(crossings) - 1)


def swings(data: Dataset) -> list[Swing]:
    """Every leg's swing; UserError for one without as many samples as a swing needs."""
    shown = column(data, "angle_rad", "pendulum")
    time_s = data["angle_rad"].time_s
    found = [Swing(leg, time_s[rows] - time_s[rows][0], shown[rows]) for leg, rows in which_leg(data, "pendulum")]
    for swing in found:
        if len(swing.time_s) < 50 or np.any(np.diff(swing.time_s) <= 0.0):
            raise UserError(f"{data.name}: pendulum needs 50 samples with rising stamps of each leg")
    return found


def zero_of_encoder() -> Parameter:
    """The encoder's zero at a leg straight down."""
    name, source = "pendulum.joint_encoder_zero", JOINT_ENCODER.source
    return Parameter(name, "rad", 0.0, source=source, uncertainty=JOINT_ENCODER.offset)


def period_block(swing: Swing) -> Block:
    """A small swing as a damped cosine. Its period gives J by eq. 29, longer by (1 + A^2 / 16) at amplitude A."""
    leg, t = swing.leg, swing.time_s
    middle = float(np.mean(swing.angle_rad))
    start = float(swing.angle_rad[0]) - middle
    moment_guess = 0.7 * GRAVITY
    guess = inertia(leg, (swing.period_s / (2.0 * math.pi)) ** 2 * moment_guess)
    shape = (
        dataclasses.replace(moment(leg), value=0.7),
        offset(leg),
        guess,
        Parameter(f"{leg}_swing.amplitude_rad", "rad", start, -2.0, 2.0, "its first sample"),
        Parameter(f"{leg}_swing.decay_per_s", "1/s", 0.02, -1.0, 10.0, "start: little"),
        Parameter(f"{leg}_swing.phase_rad", "rad", 0.0, -3.0, 3.0, "let go at its end", scale=0.1),
        Parameter(f"{leg}_swing.middle_rad", "rad", middle, -1.0, 1.0, "its mean", scale=0.01),
    )

    def residual(v: dict[str, float]) -> Array:
        amplitude, decay = v[f"{leg}_swing.amplitude_rad"], v[f"{leg}_swing.decay_per_s"]
        sm = math.hypot(v[f"{leg}_cm"], v[f"{leg}_wm"])
        rate = math.sqrt(GRAVITY * sm / v[f"{leg}_J_hip"])
        envelope = np.exp(-decay * t)
        # integral of rate (1 - A(s)^2 / 16) from 0 to t
        longer = amplitude**2 / 16.0 * (-np.expm1(-2.0 * decay * t) / (2.0 * decay) if decay else t)
        cosine = np.cos(rate * (t - longer) + v[f"{leg}_swing.phase_rad"])
        return (swing.angle_rad - v[f"{leg}_swing.middle_rad"] - amplitude * envelope * cosine) / JOINT_ENCODER.sigma

    return Block(f"pendulum, {leg}", shape, (), residual, len(t), series=True)


def simulated(moment_Nm: float, lean: float, J: float, b: float, coulomb: float, start: float, times: Array) -> Array:
    """Angle from where the leg hangs, let go at rest at `start` from there: fourth-order steps of SWING_STEP_S."""
    steps = round(math.ceil(float(times[-1]) / SWING_STEP_S)) + 1
    h, x, w = SWING_STEP_S, start, 0.0
    angles, rates = [x], [w]

    def push(angle: float, rate: float) -> float:
        return -(moment_Nm * math.sin(angle) + b * rate + coulomb * math.tanh(rate / BEARING_SMOOTHING)) / J

    for _ in range(steps):
        a1 = push(x, w)
        a2 = push(x + 0.5 * h * w, w + 0.5 * h * a1)
        a3 = push(x + 0.5 * h * (w + 0.5 * h * a1), w + 0.5 * h * a2)
        a4 = push(x + h * (w + 0.5 * h * a2), w + h * a3)
        x += h * w + h * h / 6.0 * (a1 + a2 + a3)
        w += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        angles.append(x)
        rates.append(w)
    return lean + _hermite(np.array(angles), np.array(rates), h, times)


def _hermite(values: Array, slopes: Array, h: float, times: Array) -> Array:
    """Cubic between points h apart by values and slopes."""
    k = np.minimum((times / h).astype(int), len(values) - 2)
    s = times / h - k
    return (
        values[k] * (1.0 + 2.0 * s) * (1.0 - s) ** 2
        + h * slopes[k] * s * (1.0 - s) ** 2
        + values[k + 1] * s**2 * (3.0 - 2.0 * s)
        + h * slopes[k + 1] * s**2 * (s - 1.0)
    )


def swing_block(swing: Swing) -> Block:
    """The swing simulated at its full amplitude with the bearings' friction, released at rest."""
    leg = swing.leg
    middle = float(np.mean(swing.angle_rad))
    asked = (
        moment(leg),
        offset(leg),
        inertia(leg),
        Parameter(f"{leg}_swing.release_rad", "rad", float(swing.angle_rad[0]) - middle, -3.0, 3.0, "its first sample"),
        Parameter(f"{leg}_swing.bearing_Nms", "N m s/rad", 0.005, -1.0, 10.0, "start: little"),
        Parameter(f"{leg}_swing.bearing_Nm", "N m", 0.002, -1.0, 10.0, "start: little"),
    )
    names = [parameter.name for parameter in asked]
    known: dict[tuple[float, ...], Array] = {}  # derivatives by other blocks' parameters ask for the same swing again

    def residual(v: dict[str, float]) -> Array:
        key = tuple(v[name] for name in names)
        if key not in known:
            cm, wm, J, release, b, coulomb = key
            if len(known) > 64:
                known.clear()
            moment_Nm, lean = GRAVITY * math.hypot(cm, wm), math.atan2(wm, cm)
            known[key] = simulated(moment_Nm, lean, J, b, coulomb, release, swing.time_s)
        return (swing.angle_rad - v["pendulum.joint_encoder_zero"] - known[key]) / JOINT_ENCODER.sigma

    return Block(f"pendulum, {leg}", asked, (zero_of_encoder(),), residual, len(swing.time_s), series=True)


@dataclasses.dataclass(frozen=True)
class LegSteps:
    """The paper's path: c m; w m with it; J of each leg with both."""

    level: Fit
    hang: Fit
    periods: dict[str, Fit]


def steps(
    level: Dataset, hang: Dataset, pendulum: Dataset, arm_m: float = ARM_M, tell: Callable[[str], None] | None = None
) -> LegSteps:
    """Experiments 2 to 7 of appendix 7.2, each with what the ones before found."""
    first = solve([level_block(level, arm_m)], tell=tell)
    second = solve([hang_block(hang)], earlier=[first], tell=tell)
    periods = {swing.leg: solve([period_block(swing)], earlier=[second], tell=tell) for swing in swings(pendulum)}
    return LegSteps(first, second, periods)


def joint(
    level: Dataset, hang: Dataset, pendulum: Dataset, arm_m: float = ARM_M, tell: Callable[[str], None] | None = None
) -> Fit:
    """All three recordings of both legs at once, started where the steps end."""
    found = steps(level, hang, pendulum, arm_m)
    blocks = [level_block(level, arm_m), hang_block(hang), *(swing_block(swing) for swing in swings(pendulum))]
    asked = [parameter for block in blocks for parameter in block.parameters]
    for earlier in (found.hang, *found.periods.values()):
        asked = start_at(earlier, asked)
    return solve(blocks, asked, tell=tell)


@dataclasses.dataclass(frozen=True)
class Balance:
    """One of eq. 31: outer less inner, its standard error, and whether it is zero within measurement (95 %)."""

    name: str
    unit: str
    outer: float
    inner: float
    difference: float
    standard_error: float

    @property
    def balanced(self) -> bool:
        """Whether the 95 % interval of the difference holds zero."""
        return abs(self.difference) <= 1.96 * self.standard_error


def balance(found: Fit) -> list[Balance]:
    """Eq. 31 from a joint fit of both legs: errors that the legs share cancel in the difference."""
    told = []
    for what in ("J_hip", "cm", "wm"):
        outer, inner = f"outer_{what}", f"inner_{what}"
        a, b = found.names.index(outer), found.names.index(inner)
        C = found.covariance
        error = math.sqrt(max(C[a, a] + C[b, b] - 2.0 * C[a, b], 0.0))
        told.append(Balance(what, found.units[outer], found[outer], found[inner], found[outer] - found[inner], error))
    return told
