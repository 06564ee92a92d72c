"""A motor with gearbox against a brake or under a leg, many runs at once (one lane each), at ten steps a sample.

Set-valued laws, solved in each step: no current inside the brushes' drop, true standstill inside the friction.

    V = R I + drop(I) + L dI/dt + G K w
    J dw/dt = G K I - friction - effects - T_brake - k_h q - m g (c sin q - w cos q)       (the last two: a leg)

Everything is at the gearbox's output but the rotor's angle theta. I and w are means over a sample's interval, as
integrating converters give them; the scheme is of second order away from the corners. What an effect adds is set in
`Lanes.add`: a resisting torque, a drop, a change of R, K or of the friction's level.
"""

import dataclasses

import numpy as np
from scipy.signal import lfilter

from tests.blind.generator.excitation import STEP_S

FINE = 10  # steps a sample
DT_S = STEP_S / FINE
# Heat, chosen by us: a small motor whose winding follows in seconds and whose housing is light.
WINDING_K_PER_W, WINDING_S = 2.5, 6.0
HOUSING_K_PER_W, HOUSING_S = 6.0, 15.0
GEAR_WARM_S = 8.0  # the grease warms with travel: `travel_rad_s` of the base keeps it warm


@dataclasses.dataclass
class Trajectory:
    """What truly happened in one lane, at the sampling rate; arrays of shape (samples,)."""

    base: dict
    time_s: np.ndarray
    V: np.ndarray
    I: np.ndarray  # noqa: E741
    w: np.ndarray
    acceleration: np.ndarray
    theta: np.ndarray  # rotor
    T: np.ndarray
    winding_C: np.ndarray
    housing_C: np.ndarray
    grease: np.ndarray  # 0 cold ... about 1

    def sign(self):
        return np.sign(self.w)

    def ideal_Nm(self):
        """Torque of the current less the friction that goes with it: what one ampere is worth in the torque balance."""
        p = self.base
        return p["G"] * p["K"] * (1.0 - p["mu"] * np.sign(self.w * self.I))


class Lanes:
    """Runs side by side. base: arrays of shape (lanes,) by name; voltage, brake: (samples + 1, lanes)."""

    def __init__(self, base, voltage_V, brake_Nm, ambient_C, prewarmed_K):
        self.base = base
        self.V, self.T = voltage_V, brake_Nm
        self.count = voltage_V.shape[1]
        self.ambient_C, self.prewarmed_K = ambient_C, prewarmed_K
        self.waiting = {}  # name of a law: [(lane, amplitude, shape)]

    def add(self, lane, law, amplitude, shape):
        """Let `law` (a class of this module's LAWS) act in a lane."""
        self.waiting.setdefault(law, []).append((lane, amplitude, shape))

    def run(self, fine=FINE):
        """One Trajectory per lane. fine: steps a sample; fewer than FINE only without laws."""
        p, n, dt_s = self.base, self.count, STEP_S / fine
        samples = len(self.V) - 1
        laws = [LAWS[name](self, entries) for name, entries in self.waiting.items()]
        slow = [law.slow for law in laws if hasattr(law, "slow")]
        before = [law.before for law in laws if hasattr(law, "before")]
        after = [law.after for law in laws if hasattr(law, "after")]
        torque = [law.torque for law in laws if hasattr(law, "torque")]
        s = self.state = State(n)
        s.GK0 = p["G"] * p["K"]
        s.magnet, s.GK = s.GK0.copy(), s.GK0.copy()  # by its warmth; that and by the rotor's place
        s.drop = p["Vc"].copy()
        s.friction0 = p["C0"].copy()
        s.R = p["R"].copy()
        s.winding_C = self.ambient_C + self.prewarmed_K
        s.housing_C = self.ambient_C + 0.4 * self.prewarmed_K
        muGK, L_dt = p["mu"] * s.GK0, p["L"] / dt_s
        J_dt = p["J"] / dt_s
        divisor = J_dt + p["C1"]
        half_turn = p["G"] * 0.5 * dt_s
        hangs = bool(np.any(p["mgc"] > 0.0))
        out = np.zeros((8, samples, n))
        w, current = np.zeros(n), np.zeros(n)
        change = np.zeros(n)
        bound, level = np.zeros(n), np.zeros(n)
        for k in range(samples):
            dV, dT = (self.V[k + 1] - self.V[k]) / fine, (self.T[k + 1] - self.T[k]) / fine
            V, T = self.V[k] + 0.5 * dV, self.T[k] + 0.5 * dT
            for function in slow:
                function(s)
            inverse = 1.0 / (s.R + L_dt)
            sum_I, sum_w, w_start = np.zeros(n), 0.5 * w, w.copy()
            out[4, k] = s.theta
            for _ in range(fine):
                s.w = w + 0.5 * change  # at the middle of the step, extrapolated
                s.V, s.T = V, T
                s.middle = s.theta + half_turn * w
                for function in before:
                    function(s)
                u = V - s.GK * s.w
                u += L_dt * current
                np.negative(s.drop, out=level)
                np.minimum(np.maximum(u, level), s.drop, out=level)
                u -= level
                u *= inverse
                current = s.I = u
                drive = s.GK * u
                drive -= T
                if hangs:
                    q = s.middle / p["G"]
                    drive -= p["kh"] * q + p["mgc"] * np.sin(q) - p["mgw"] * np.cos(q)
                np.abs(u, out=bound)
                bound *= muGK
                bound += s.friction0
                s.bound = bound
                for function in after:
                    function(s)
                for function in torque:
                    function(s, drive)
                drive += J_dt * w
                np.negative(bound, out=level)
                np.minimum(np.maximum(drive, level), bound, out=level)
                drive -= level
                drive /= divisor
                change = drive - w
                s.theta += half_turn * (w + drive)
                w = drive
                sum_I += current
                sum_w += w
                V = V + dV
                T = T + dT
            sum_w -= 0.5 * w
            mean_I = sum_I / fine
            out[0, k], out[5, k] = 0.5 * (self.V[k] + self.V[k + 1]), 0.5 * (self.T[k] + self.T[k + 1])
            out[1, k], out[2, k] = mean_I, sum_w / fine
            out[3, k] = (w - w_start) / STEP_S
            out[4, k] = 0.5 * (out[4, k] + s.theta)
            out[6, k], out[7, k] = s.winding_C, s.housing_C
            heat = p["R"] * mean_I * mean_I
            s.winding_C += STEP_S / WINDING_S * (WINDING_K_PER_W * heat - (s.winding_C - s.housing_C))
            s.housing_C += STEP_S / HOUSING_S * (HOUSING_K_PER_W * heat - (s.housing_C - self.ambient_C))
            s.grease += STEP_S / GEAR_WARM_S * (np.abs(w) / p["travel_rad_s"] - s.grease)
        time_s = (np.arange(samples) + 0.5) * STEP_S
        lanes = []
        for lane in range(n):
            V, current, w, acceleration, theta, T, winding_C, housing_C = (out[i, :, lane].copy() for i in range(8))
            base = {name: float(values[lane]) for name, values in p.items()}
            lanes.append(
                Trajectory(
                    base,
                    time_s,
                    V,
                    current,
                    w,
                    acceleration,
                    theta,
                    T,
                    winding_C,
                    housing_C,
                    warmed(w, base["travel_rad_s"]),
                )
            )
        return lanes


def warmed(w, travel_rad_s):
    """State of the grease from the speed, as the loop above has it (to the difference of a mean and an end value)."""
    rate = STEP_S / GEAR_WARM_S
    return lfilter([0.0, rate], [1.0, rate - 1.0], np.abs(w) / travel_rad_s)


class State:
    """What the laws may read and change in a step; arrays of shape (lanes,)."""

    def __init__(self, count):
        self.theta = np.zeros(count)
        self.grease = np.zeros(count)
        self.I = np.zeros(count)
        self.w = np.zeros(count)


class Law:
    """Lanes in which one effect acts, with amplitudes and the numbers of its shape as arrays."""

    def __init__(self, lanes, entries):
        self.lane = np.array([lane for lane, _, _ in entries])
        self.a = np.array([amplitude for _, amplitude, _ in entries])
        for name in entries[0][2]:
            setattr(self, name, np.array([shape[name] for _, _, shape in entries]))
        self.base = {name: values[self.lane] for name, values in lanes.base.items()}
        self.prepare()

    def prepare(self):
        pass


class BrushDrop(Law):
    """The brushes' film carries a drop that comes with current and saturates."""

    def before(self, s):
        s.drop[self.lane] = self.base["Vc"] + self.a * (1.0 - np.exp(-np.abs(s.I[self.lane]) / self.knee_A))


class HotWinding(Law):
    def slow(self, s):
        s.R[self.lane] = self.base["R"] * (1.0 + self.a * (s.winding_C[self.lane] - 25.0))


class HotMagnet(Law):
    """Magnets weaken when hot."""

    def slow(self, s):
        s.magnet[self.lane] = s.GK0[self.lane] * (1.0 - self.a * (s.housing_C[self.lane] - 25.0))
        s.GK[self.lane] = s.magnet[self.lane]


class Harmonics(Law):
    """Torque periodic in an angle: three harmonics; `by_V`: in proportion to the voltage."""

    def torque(self, s, drive):
        x = s.middle[self.lane] * self.periods + self.phase1
        f = np.sin(x) + self.second * np.sin(2.0 * x + self.phase2) + self.third * np.sin(3.0 * x + self.phase3)
        drive[self.lane] -= self.a * f * (1.0 + self.by_V * (s.V[self.lane] - 1.0))


class Commutation(Law):
    """Torque and back-EMF of each ampere vary over the commutator's pitch."""

    def before(self, s):
        x = s.middle[self.lane] * self.periods + self.phase1
        s.GK[self.lane] = s.magnet[self.lane] * (
            1.0 + self.a * (np.sin(x) + self.second * np.sin(2.0 * x + self.phase2))
        )


class Bristles(Law):
    """LuGre: friction by bristles; replaces the friction of the base model. a: excess at standstill."""

    def prepare(self):
        self.z = np.zeros(len(self.lane))

    def after(self, s):
        self.coulomb = s.bound[self.lane]
        s.bound[self.lane] = 0.0

    def torque(self, s, drive):
        w = s.w[self.lane]
        g = self.coulomb + self.a * np.exp(-(np.abs(w / self.speed_rad_s) ** 1.5))
        stretch = self.stretch_rad
        old = self.z
        self.z = (old + DT_S * w) / (1.0 + DT_S * np.abs(w) / stretch)
        stiff = g / stretch
        damping = 0.6 * np.sqrt(stiff * self.base["J"]) * np.exp(-np.abs(w) / 0.05)
        drive[self.lane] -= stiff * self.z + damping * (self.z - old) / DT_S


class SoftBristles(Bristles):
    """As above without excess; a: deflection at breakaway, rad."""

    def prepare(self):
        super().prepare()
        self.stretch_rad, self.speed_rad_s = self.a, 1.0
        self.a = 0.0


class LoadSide(Law):
    """Gear teeth lose more when the load drives the motor; the change goes with the power."""

    def torque(self, s, drive):
        w, T = s.w[self.lane], s.T[self.lane]
        back = 1.0 / (1.0 + np.exp(np.clip(T * w / self.soft_W, -40.0, 40.0)))
        drive[self.lane] -= self.a * np.abs(T) * np.tanh(w / 0.05) * back


class Direction(Law):
    """One direction is harder than the other."""

    def torque(self, s, drive):
        w = s.w[self.lane]
        drive[self.lane] -= self.a * (np.tanh(np.abs(w) / 0.1) + self.viscous * np.abs(w))


class Drag(Law):
    def torque(self, s, drive):
        w = s.w[self.lane]
        drive[self.lane] -= self.a * np.sign(w) * np.abs(w) ** self.power


class Warming(Law):
    """Cold grease: friction that is gone when the gear has travelled."""

    def slow(self, s):
        s.friction0[self.lane] = self.base["C0"] + self.a * np.exp(-2.5 * s.grease[self.lane])


class EddyBrake(Law):
    """Eddy currents brake less beyond a speed."""

    def torque(self, s, drive):
        w = s.w[self.lane]
        drive[self.lane] -= self.a * w / (1.0 + (w / self.peak_rad_s) ** 2)


class TightArc(Law):
    """Friction over part of the output's turn only."""

    def after(self, s):
        arc = np.maximum(np.cos(s.middle[self.lane] / self.base["G"] - self.centre_rad) - self.dead, 0.0)
        s.bound[self.lane] += self.a * arc


class Hysteresis(Law):
    """Iron remembers: part of the torque follows the current with play."""

    def prepare(self):
        self.kept = np.zeros(len(self.lane))

    def torque(self, s, drive):
        current = s.I[self.lane]
        self.kept = np.minimum(np.maximum(self.kept, current - self.play_A), current + self.play_A)
        drive[self.lane] -= self.a * (current - self.kept)


class SpringBend(Law):
    """A spring that hardens by an exponential law."""

    def torque(self, s, drive):
        x = s.middle[self.lane] / self.base["G"] / self.knee_rad
        drive[self.lane] -= self.a * np.sign(x) * (np.exp(np.abs(x)) - 1.0 - np.abs(x))


class Saturation(Law):
    """Iron saturates: torque falls behind large currents, the back-EMF does not."""

    def torque(self, s, drive):
        current = s.I[self.lane]
        drive[self.lane] -= self.a * current**3 / (self.knee_A**2 + current**2)


LAWS = {
    law.__name__: law
    for law in (
        BrushDrop,
        HotWinding,
        HotMagnet,
        Harmonics,
        Commutation,
        Bristles,
        SoftBristles,
        LoadSide,
        Direction,
        Drag,
        Warming,
        EddyBrake,
        TightArc,
        Hysteresis,
        Saturation,
        SpringBend,
    )
}
