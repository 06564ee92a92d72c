"""A foot that hangs from the ankle and is driven through its cable, many runs at once (one lane each).

    J_m p'' = GK I - friction(I, p') - cable - laws          rotor behind the gear; true standstill inside the friction
    J_f q'' = cable - k_r (q - q_0) - laws                   foot
    cable   = k_s x + d x',  x = p - q - zero
    I       = K (target - p) + D (target' - p'), within -1 A ... 6 A, behind 0.5 ms

The board reads the motor's angle p every 0.5 ms, in counts; targets come every 2 ms and are 2 ms old. Sixteen steps of
0.25 ms a row of the log. What an effect adds is a `Law`.
"""

import dataclasses

import numpy as np

ROW_S = 0.004  # of the robot's own logs
DT_S = 0.25e-3
FINE = round(ROW_S / DT_S)
BOARD = 2  # steps between two looks of the board
TARGET = 8  # steps between two targets
CURRENT_LAG_S = 0.5e-3
LEAST_A, MOST_A = -1.0, 6.0  # the board's limits: robot.md C4
COUNT_RAD = 2.0 * np.pi / (2048.0 * 34.0)
WARM_RAD = 12.0  # of travel: the grease


@dataclasses.dataclass(frozen=True)
class Drive:
    """What one run is asked for: a sine about a centre, and the law's numbers."""

    centre_rad: float
    amplitude_rad: float
    hertz: float
    phase_rad: float
    stiffness_A_per_rad: float
    damping_As_per_rad: float

    def target(self, time_s):
        """Angle and rate."""
        w = 2.0 * np.pi * self.hertz
        x = w * time_s + self.phase_rad
        return self.centre_rad + self.amplitude_rad * np.sin(x), self.amplitude_rad * w * np.cos(x)


@dataclasses.dataclass
class Lane:
    """A run: base parameters, drive, and what acts: {law: (amplitude, shape)}."""

    base: dict
    drive: Drive
    acts: dict


def run(lanes, rows, before_rows, counted=True):
    """{"p", "q", "u", "v", "I"}: arrays (rows, lanes). before_rows: not kept, for the start to die away.

    counted: False lets the board see the angle itself, so that small changes have small effects.
    """
    s = State(lanes)
    base = s.base
    laws = [LAWS[name](s, lanes, name) for name in sorted({name for lane in lanes for name in lane.acts})]
    hooks = {hook: [getattr(law, hook) for law in laws if hasattr(law, hook)] for hook in HOOKS}
    asked = Drive(*(np.array([getattr(lane.drive, each.name) for lane in lanes]) for each in dataclasses.fields(Drive)))
    K, D = asked.stiffness_A_per_rad, asked.damping_As_per_rad
    keep = np.exp(-DT_S / CURRENT_LAG_S)
    m_dt, f_dt = base["J_m"] / DT_S, base["J_f"] / DT_S
    out = {name: np.zeros((rows, len(lanes))) for name in "pquvI"}
    start_s = -before_rows * ROW_S
    command = np.zeros(len(lanes))
    wanted = np.zeros(len(lanes))
    for k in range((before_rows + rows) * FINE):
        s.t = start_s + k * DT_S
        if k % TARGET == 0:
            angle, rate = asked.target(s.t - TARGET * DT_S)
            command = K * angle + D * rate
            s.command = command
            for hook in hooks["order"]:
                hook(s)
            command = s.command
        if k % BOARD == 0:
            s.seen = np.floor(s.p / COUNT_RAD) * COUNT_RAD if counted else s.p.copy()
            for hook in hooks["look"]:
                hook(s)
            wanted = np.clip(command - K * s.seen - D * s.u, LEAST_A, MOST_A)
        s.I = wanted + (s.I - wanted) * keep
        s.stretch = s.p - s.q - base["zero"]
        s.cable = base["k_s"] * s.stretch
        for hook in hooks["cable"]:
            hook(s)
        s.cable = s.cable + base["d"] * (s.u - s.v)
        s.drive = base["GK"] * s.I
        s.bound = base["C0"] + base["mu"] * np.abs(s.drive)
        s.on_motor = s.drive - s.cable
        s.on_joint = s.cable - base["k_r"] * (s.q - base["q_0"])
        for hook in hooks["act"]:
            hook(s)
        push = m_dt * s.u + s.on_motor
        s.u = (push - np.clip(push, -s.bound, s.bound)) / (m_dt + base["C1"])
        s.v = s.v + s.on_joint / f_dt
        s.p = s.p + DT_S * s.u
        s.q = s.q + DT_S * s.v
        row, fine = divmod(k + 1, FINE)
        if fine == 0 and row > before_rows:
            for name, values in out.items():
                values[row - 1 - before_rows] = getattr(s, name)
    return out


HOOKS = ("order", "look", "cable", "act")


class State:
    """What the laws may read and change in a step; arrays of shape (lanes,)."""

    def __init__(self, lanes):
        self.base = {name: np.array([lane.base[name] for lane in lanes]) for name in lanes[0].base}
        self.p = np.array([lane.drive.target(0.0)[0] for lane in lanes])
        self.q = self.p - self.base["zero"]
        self.u, self.v, self.I = (np.zeros(len(lanes)) for _ in range(3))
        self.t = 0.0


class Law:
    """Lanes in which one effect acts, with amplitudes `a` and the numbers of its shape as arrays."""

    def __init__(self, s, lanes, name):
        self.lane = np.array([i for i, lane in enumerate(lanes) if name in lane.acts])
        found = [lanes[i].acts[name] for i in self.lane]
        self.a = np.array([amplitude for amplitude, _ in found])
        for key in found[0][1]:
            setattr(self, key, np.array([shape[key] for _, shape in found]))
        self.base = {key: values[self.lane] for key, values in s.base.items()}
        self.state = np.zeros(len(self.lane))
        self.prepare()

    def prepare(self):
        pass

    def take_bound(self, s):
        """The base model's friction of these lanes, which then is the law's to give."""
        bound = s.bound[self.lane]
        s.bound[self.lane] = 0.0
        return bound


class Bend(Law):
    """A return spring that hardens beyond an angle, exponentially."""

    def act(self, s):
        over = np.maximum(s.q[self.lane] - self.knee_rad, 0.0) / 0.45
        s.on_joint[self.lane] -= self.a * (np.expm1(over) - over)


class Bristles(Law):
    """LuGre; a: excess at standstill, over a way of 0.2 mrad."""

    def prepare(self):
        self.way = np.full(len(self.lane), 2e-4)
        self.excess = self.a

    def act(self, s):
        u = s.u[self.lane]
        level = self.take_bound(s) + self.excess * np.exp(-(np.abs(u / self.speed_rad_s) ** 1.5))
        old = self.state
        self.state = (old + DT_S * u) / (1.0 + DT_S * np.abs(u) / self.way)
        stiff = level / self.way
        damping = 0.6 * np.sqrt(stiff * self.base["J_m"]) * np.exp(-np.abs(u) / 0.05)
        s.on_motor[self.lane] -= stiff * self.state + damping * (self.state - old) / DT_S


class SoftBristles(Bristles):
    """As above without excess; a: the way, rad."""

    def prepare(self):
        self.way, self.excess = np.maximum(np.abs(self.a), 1e-5), 0.0


class Warming(Law):
    """Cold grease: friction that is gone after some travel."""

    def act(self, s):
        self.state += DT_S * np.abs(s.u[self.lane]) * (s.t >= 0.0)
        s.bound[self.lane] += self.a * np.exp(-self.state / WARM_RAD)


class Drag(Law):
    def act(self, s):
        u = s.u[self.lane]
        s.on_motor[self.lane] -= self.a * np.sign(u) * np.abs(u) ** self.power


class Cogging(Law):
    """Three harmonics over the rotor's turn."""

    def act(self, s):
        x = 34.0 * self.periods * s.p[self.lane] + self.phase1
        s.on_motor[self.lane] -= self.a * (
            np.sin(x) + 0.45 * np.sin(2.0 * x + self.phase2) + 0.2 * np.sin(3.0 * x + self.phase3)
        )


class Play(Law):
    """A gap in the cable with a spring on either side; a: half of it."""

    def cable(self, s):
        x = s.stretch[self.lane]
        gap = np.maximum(self.a, 1e-9)
        s.cable[self.lane] = self.base["k_s"] * (x - gap * np.tanh(x / gap))


class Slip(Law):
    """The cable slips once, within some hundredths of a second."""

    def cable(self, s):
        gone = 0.5 * (1.0 + np.tanh((s.t - self.at_s) / 0.03))
        s.cable[self.lane] = self.base["k_s"] * (s.stretch[self.lane] - self.a * gone)


class LostCounts(Law):
    """The motor's encoder loses counts above a speed; the board believes it."""

    def look(self, s):
        u = s.u[self.lane]
        over = np.logaddexp(0.0, (np.abs(u) - self.limit_rad_s) / 0.3) * 0.3
        self.state += BOARD * DT_S * self.a * np.sign(u) * over * (s.t >= 0.0)
        s.seen[self.lane] -= self.state
        s.lost = {int(lane): float(lost) for lane, lost in zip(self.lane, self.state, strict=True)}


class WrongTarget(Law):
    """The board takes a multiple of the current that it is sent."""

    def order(self, s):
        s.command[self.lane] *= 1.0 + self.a


class TightArc(Law):
    """Friction over a part of the way only."""

    def act(self, s):
        s.bound[self.lane] += self.a * np.exp(-(((s.p[self.lane] - self.centre_rad) / 0.2) ** 4))


class EddyBrake(Law):
    """Eddy currents brake less beyond a speed."""

    def act(self, s):
        u = s.u[self.lane]
        s.on_motor[self.lane] -= self.a * u / (1.0 + (u / self.peak_rad_s) ** 2)


class LooseMass(Law):
    """Something on the foot that swings on its own soft spring."""

    def prepare(self):
        self.rate = np.zeros(len(self.lane))

    def act(self, s):
        w = 2.0 * np.pi * self.hertz
        apart = s.q[self.lane] - self.state
        pull = w * w * apart + 0.2 * w * (s.v[self.lane] - self.rate)
        self.rate = self.rate + DT_S * pull
        self.state = self.state + DT_S * self.rate
        s.on_joint[self.lane] -= self.a * pull


class Sway(Law):
    """The robot sways on its rope, and the foot with it."""

    def act(self, s):
        s.on_joint[self.lane] -= self.a * np.sin(2.0 * np.pi * self.hertz * s.t + self.phase1)


LAWS = {
    "return_spring": Bend,
    "stribeck": Bristles,
    "presliding": SoftBristles,
    "friction_warm_up": Warming,
    "drag": Drag,
    "cogging": Cogging,
    "cable_backlash": Play,
    "pulley_slip": Slip,
    "lost_counts": LostCounts,
    "firmware_parameter": WrongTarget,
    "tight_arc_friction": TightArc,
    "eddy_brake_saturating": EddyBrake,
    "loose_mass": LooseMass,
    "sway": Sway,
}
