"""Controllers small enough to judge the body by, with ideal current sources: no boards, no electronics.

They stand on the body's own coordinates. Currents follow the command at once; motors have the friction of the
appendix (eq. 35, smoothed by eq. 43) and the electric power of eq. 32, per motor not below zero.
"""

import math

from ranger_sim.plant.mechanics.body import DOUBLE, FALLEN, SINGLE, Body
from ranger_sim.plant.ranger import STEP_NS
from ranger_sim.plant.walking import handling
from ranger_sim.plant.walking.motion import advance

K = 0.018  # N m/A, torque constant [appendix table 3]
R = 1.34  # ohm, with the series inductor [robot.md P3]
V_C = 0.7  # V, brush contacts
MU = 0.1
C0 = 0.1  # N m on the robot [robot.md P3]
C1 = 0.01  # N m s/rad
STEP_S = STEP_NS * 1e-9
ZERO = 1.68  # rad, ankle reading with the sweet spot under an upright leg
TICK = 2_000_000 // STEP_NS  # steps of the plant per controller tick of 2 ms
SLOT = 500_000 // STEP_NS  # and per slot of a motor board


def clip(value, low, high):
    return min(max(value, low), high)


class IdealMotor:
    """A current source behind a gear; accumulates electric energy."""

    def __init__(self, gear):
        self.gk = gear * K
        self.current_A = 0.0
        self.energy_J = 0.0

    def laws(self):
        """drive, coulomb, viscous of the joint torque."""
        return self.gk * self.current_A, MU * self.gk * abs(self.current_A) + C0, C1

    def spend(self, rate, seconds):
        i = self.current_A
        power = (i * R + math.copysign(V_C, i)) * i + self.gk * rate * i
        self.energy_J += max(0.0, power) * seconds


class Walker:
    """Runs a controller on the body: `controller.tick(walker)` every 2 ms sets the three currents."""

    def __init__(self, body: Body, controller, delay_s=0.014, limits=True):
        self.body = body
        self.controller = controller
        self.hip = IdealMotor(66.0)
        self.ankles = (IdealMotor(34.0), IdealMotor(34.0))
        self.delay_s = delay_s
        self.limits = limits
        self.count = 0
        self.commands = None  # hip, outer, inner: (I0, K, D) of the boards' law I = I0 - K p - D rate

    def set_currents(self, hip, outer, inner):
        if self.limits:
            hip = clip(hip, -4.0, 4.0)  # the boards' clips [robot.md C4]
            outer = clip(outer, -1.0, 6.0)
            inner = clip(inner, -1.0, 6.0)
        self.hip.current_A = hip
        self.ankles[0].current_A = outer
        self.ankles[1].current_A = inner
        b = self.body
        b.hip.drive, b.hip.coulomb, b.hip.viscous = self.hip.laws()
        b.outer.drive, b.outer.coulomb, b.outer.viscous = self.ankles[0].laws()
        b.inner.drive, b.inner.coulomb, b.inner.viscous = self.ankles[1].laws()

    def obey(self):
        """The motor boards at 2 kHz, with currents that follow at once."""
        b = self.body
        hip, outer, inner = self.commands
        self.set_currents(
            hip[0] - hip[1] * b.hip_angle() - hip[2] * b.hip_rate(),
            outer[0] - outer[1] * (b.outer.motor_angle + ZERO) - outer[2] * b.outer.motor_rate,
            inner[0] - inner[1] * (b.inner.motor_angle + ZERO) - inner[2] * b.inner.motor_rate,
        )

    @property
    def seconds(self):
        return self.count * STEP_S

    @property
    def energy_J(self):
        return self.hip.energy_J + self.ankles[0].energy_J + self.ankles[1].energy_J

    def run(self, steps, seconds=1e9):
        """Walk until so many steps, so many seconds or a fall; True when it did not fall."""
        b = self.body
        while b.mode != FALLEN and b.record.steps < steps and self.seconds < seconds:
            if self.count % TICK == 0:
                self.controller.tick(self)
            if self.commands is not None and self.count % SLOT == 0:
                self.obey()
            self.hip.spend(b.hip_rate(), STEP_S)
            self.ankles[0].spend(b.outer.motor_rate, STEP_S)
            self.ankles[1].spend(b.inner.motor_rate, STEP_S)
            b.step_start_ns = self.count * STEP_NS
            advance(b, STEP_S)
            self.count += 1
        return b.mode != FALLEN


class PaperGait:
    """The gait of robot.md P4, in the angles of the appendix, for either leg as stance.

    Entries (I0, Kp, Kv): I = I0 + Kp q + Kv qdot. hip on q3, ankles on their motor angle.
    """

    ROBUST = dict(
        swing=(-0.953, 0.764),
        place=(-10.28, 10.33, -21.16, -4.294),
        a=0.0402,
        stance=(-0.866, -2.165, -0.179),
        prepush=(4.350, 2.430, -0.247),
        b=-0.1455,
        push=(8.0, 2.430, -0.247),
        push_angle=0.1,
        push_s=0.0235,
        flipup=(-12.10, -8.20, -0.681),
        flipdown=(3.494, -13.21, -1.097),
        c=-0.0519,
        e=-0.0074,
        w_ref=-0.4652,
    )

    def __init__(self, gait=None):
        self.g = dict(self.ROBUST if gait is None else gait)
        self.stance = 0
        self.seen_strikes = 0
        self.strike_seen_s = 0.0
        self.dw = 0.0
        self.passed = False
        self.hip_state = "SWING"
        self.stance_state = "STANCE"
        self.swing_state = "FLIPUP"

    def tick(self, walker):
        b, g = walker.body, self.g
        now = walker.seconds
        if b.record.steps > self.seen_strikes and now >= b.record.strike_time_ns * 1e-9 + walker.delay_s:
            self.seen_strikes = b.record.steps
            self.stance = 1 - self.stance
            self.strike_seen_s = now
            self.hip_state, self.stance_state, self.swing_state = "SWING", "STANCE", "PUSH"
            self.passed = False
        if self.stance == 0:
            phi, phi_w, phi_rate, phi_w_rate = -b.outer.angle, -b.inner.angle, -b.outer.rate, -b.inner.rate
            ms, ms_rate, mw, mw_rate = b.outer.motor_angle, b.outer.motor_rate, b.inner.motor_angle, b.inner.motor_rate
        else:
            phi, phi_w, phi_rate, phi_w_rate = -b.inner.angle, -b.outer.angle, -b.inner.rate, -b.outer.rate
            ms, ms_rate, mw, mw_rate = b.inner.motor_angle, b.inner.motor_rate, b.outer.motor_angle, b.outer.motor_rate
        q3, q3_rate = phi - phi_w, phi_rate - phi_w_rate
        if not self.passed and phi < 0.0:
            self.passed = True
            self.dw = clip(phi_rate - g["w_ref"], -0.4, 0.4)
        dw = self.dw
        if self.hip_state == "SWING" and phi < g["a"]:
            self.hip_state = "PLACE"
        if self.stance_state == "STANCE" and phi < g["b"]:
            self.stance_state = "PREPUSH"
        if self.swing_state == "PUSH" and (mw > g["push_angle"] or now - self.strike_seen_s > g["push_s"]):
            self.swing_state = "FLIPUP"
        if self.swing_state == "FLIPUP" and phi < g["c"] and q3 < g["e"]:
            self.swing_state = "FLIPDOWN"
        if self.hip_state == "SWING":
            hip = g["swing"][0] + g["swing"][1] * dw
        else:
            i0, gain, kp, kv = g["place"]
            hip = i0 + gain * dw + kp * q3 + kv * q3_rate
        if self.stance_state == "STANCE":
            i0, kp, kv = g["stance"]
            ankle_s = i0 + kp * ms + kv * ms_rate
        else:
            i0, gain, kv = g["prepush"]
            ankle_s = i0 + gain * dw + kv * ms_rate
        if self.swing_state == "PUSH":
            i0, gain, kv = g["push"]
            ankle_w = i0 + gain * dw + kv * mw_rate
        else:
            i0, kp, kv = g["flipup"] if self.swing_state == "FLIPUP" else g["flipdown"]
            ankle_w = i0 + kp * mw + kv * mw_rate
        if self.stance == 0:
            walker.set_currents(-hip, ankle_s, ankle_w)
        else:
            walker.set_currents(hip, ankle_w, ankle_s)


class Butterworth:
    """10 Hz at 1 kHz, second order, iterated twice per tick of 2 ms [robot.md C3.1]."""

    def __init__(self):
        self.x = [0.0, 0.0]
        self.y = [0.0, 0.0]

    def once(self, x):
        b0, a1, a2 = 0.00094469184384, -1.911197067426073, 0.914975834801434
        y = b0 * (x + 2 * self.x[0] + self.x[1]) - a1 * self.y[0] - a2 * self.y[1]
        self.x = [x, self.x[0]]
        self.y = [y, self.y[0]]
        return y

    def tick(self, x):
        self.once(self.x[0])
        return self.once(x)


class RecordGait:
    """The May 2011 machines [robot.md C1.3-C1.5] with ideal angles: leg, hip, two feet, no boards.

    Side 0 outer, 1 inner. `flag` is the swing leg flag: 0 outer legs swing, 1 inner legs swing.
    """

    RECORD = dict(outer_stiffness=2.0, trigger=0.012, flip_down=0.10)
    ROBUST = dict(outer_stiffness=0.0, trigger=0.022, flip_down=0.13)  # robot.md W2

    def __init__(self, parameters=None):
        self.p = dict(self.RECORD if parameters is None else parameters)
        self.flag = 1
        self.seen = 0
        self.strike_s = 0.0
        self.filter = Butterworth()
        self.leg = ["aftermid", 0]  # state, stance side
        self.hip = "starthold"
        self.hip_side = 1  # side that swings
        self.feet = ["startstance", "startflipdown"]
        self.foot_time = [0.0, 0.0]
        self.push = [(0.0, 0.0, 0.0), (0.0, 0.0, 0.0)]  # gain, extra angle, angle at entry
        self.v_leg = [0.5, 0.5]
        self.hip_mid = [0.0, 0.0]
        self.omega_leg = [1.66, 1.66]
        self.v, self.alpha, self.omega = 0.5, 0.0, 1.66
        self.A0 = self.t0 = self.hip_start = self.after_ms = 0.0
        self.dI = (0.0, 0.0)

    def tick(self, walker):
        b = walker.body
        now = walker.seconds
        # a robot put down starts its clock of strikes anew
        if b.record.steps > self.seen and now >= b.record.strike_time_ns * 1e-9 + walker.delay_s:
            self.seen = b.record.steps
            self.flag = 1 - self.flag
            self.strike_s = now
        self.t_hs = (now - self.strike_s) * 1e3
        self.lean = (b.outer.angle, b.inner.angle)
        self.h = b.hip_angle()
        self.h_rate = self.filter.tick(b.hip_rate())
        self.a = (b.outer.foot_angle - b.outer.angle + ZERO, b.inner.foot_angle - b.inner.angle + ZERO)
        self.a_rate = (b.outer.foot_rate - b.outer.rate, b.inner.foot_rate - b.inner.rate)
        self.m = (b.outer.motor_angle + ZERO, b.inner.motor_angle + ZERO)
        self.published = (b.outer.foot_angle + 1.75, b.inner.foot_angle + 1.75)
        self.leg_machine()
        hip = self.hip_machine()
        inner = self.foot_machine(1)
        outer = self.foot_machine(0)
        walker.commands = (hip, outer, inner)

    def ahead(self, stance):
        """Hip angle, positive with the swing leg ahead."""
        return self.h if stance == 0 else -self.h

    def leg_machine(self):
        state, side = self.leg
        A = -self.lean[side]
        if state == "preswing" and self.a_rate[1 - side] < -5.0:
            self.leg[0] = "premid"
            self.A0, self.t0, self.hip_start = A, self.t_hs, self.ahead(side)
        elif state == "premid" and A < 0.0:
            self.leg[0] = "aftermid"
            lasted = max(self.t_hs - self.t0, 2.0)
            self.v_leg[side] = 1000.0 * self.A0 / lasted
            self.omega_leg[side] = (self.hip_mid[side] - self.hip_start) * 1000.0 / lasted
            self.hip_mid[side] = self.ahead(side)
            v = sum(self.v_leg) / 2
            self.v = 1.5 if v >= 1.5 else 0.01 if v <= 0.0 else v
            self.alpha = sum(self.hip_mid) / 2
            self.omega = sum(self.omega_leg) / 2
        elif state == "aftermid" and self.flag == side:
            self.leg = ["preswing", 1 - side]

    def hip_machine(self):
        swing = self.hip_side
        sign = 1.0 if swing == 1 else -1.0
        stance = 1 - swing
        struck = self.flag != swing
        ahead = sign * self.h
        held = (ahead > 0.2 and self.v < 0.4) or (0.0 < ahead < 0.3 and sign * self.h_rate < 0.0)
        if self.hip in ("starthold", "aftermid", "ehold") and struck:
            self.hip, self.hip_side = "preswing", 1 - swing
        elif self.hip == "preswing" and self.a_rate[swing] < -5.0:
            self.hip = "premid"
        elif self.hip == "premid" and self.lean[stance] > 0.0 and self.leg == ["aftermid", stance]:
            self.hip = "aftermid"
            self.after_ms = 0.0
            if self.v >= 0.65:
                self.dI = (-2.0 * self.alpha, -1.0 * self.alpha)
            else:
                self.dI = (
                    1.0 * self.alpha + 0.3 * (self.omega - 1.66),
                    0.5 * self.alpha + 0.2 * (self.omega - 1.66),
                )
        elif self.hip in ("premid", "aftermid") and held:
            self.hip = "ehold"
        swing = self.hip_side
        sign = 1.0 if swing == 1 else -1.0
        if self.hip == "starthold":
            return 30 * 0.35, 30.0, 3.0
        if self.hip == "ehold":
            return sign * 30 * 0.35, 30.0, 4.0
        if self.hip == "preswing":
            return 0.0, 0.0, 0.0
        current = max(0.0, 3.0 * (2.0 - sign * self.h_rate)) if self.t_hs - self.t0 < 300.0 else 0.0
        if self.hip == "aftermid":
            current += self.dI[0] if self.after_ms < 150 else self.dI[1] if self.after_ms < 300 else 0.0
            self.after_ms += 2.0
        return sign * current, self.p["outer_stiffness"] if swing == 0 else 0.0, 0.0

    def foot_machine(self, side):
        other = 1 - side
        sign = 1.0 if side == 1 else -1.0
        ahead = sign * self.h  # positive with this foot ahead
        swings = self.flag == side
        state = self.feet[side]
        height = 0.96 * (math.cos(self.lean[side]) - math.cos(self.lean[other]))
        turned = self.published[side] - self.push[side][2]
        new = state
        if state == "stance":
            near = height < self.p["trigger"] and self.published[other] > 1.7
            if ahead < -0.05 and (near or swings):
                new = "prepush"
        elif state == "prepush":
            if swings and turned > 0.5 * (0.2 + self.push[side][1]):
                new = "afterpush"
        elif state == "afterpush":
            if self.m[side] - self.a[side] <= 0.07 or self.foot_time[side] >= 30.0:
                new = "flipup"
        elif state == "flipup":
            if ahead > self.p["flip_down"]:
                new = "flipdown"
        elif state in ("flipdown", "startflipdown"):
            if not swings and self.flag == other:
                new = "stance"
        elif state == "startstance" and self.flag == side:
            new = "flipup"
        if new != state:
            self.feet[side] = new
            self.foot_time[side] = 0.0
            if new == "prepush":
                slow = self.v < 0.65
                gain = -5.0 * (self.v - 0.72) if slow else 0.0
                extra = -0.5 * (self.v - 0.72) if slow else 0.0
                self.push[side] = (gain, extra, self.published[side])
        self.foot_time[side] += 2.0
        state = self.feet[side]

        def absolute(target, stiffness, damping):
            return stiffness * (target + self.m[side] - self.published[side]), stiffness, damping

        if state == "stance":
            return absolute(2.0, 4.0, 0.2)
        if state == "prepush":
            gain, extra, _ = self.push[side]
            return absolute(2.0 + 0.2 + extra, 10.0 + gain, 0.0)
        if state == "afterpush":
            return 0.0, 0.0, 0.0
        if state == "flipup":
            return 1.5 * 0.2, 1.5, 0.1
        if state == "flipdown":
            return absolute(2.0, 1.5, 0.1)
        if state == "startflipdown":
            return 1.5 * (2.0 + 0.5 * self.h), 1.5, 0.1
        return 30.0 * (2.0 - 0.5 * self.h), 30.0, 0.3


def held_start(walker, lean=0.09, rate=0.7, seconds=1.5):
    """The operator's start [robot.md W3]: standing, legs held 0.35 rad apart, then let go."""
    handling.place(walker.body, lean, 0.35)
    handling.hold_standing(walker.body, lean, 0.35)
    walker.run(1, seconds)
    walker.body.step_start_ns = walker.count * STEP_NS
    handling.release(walker.body, rate)


class ElectricWalker(Walker):
    """The same controllers on the whole plant: bridges, windings, battery; current loops as on the motor boards.

    Integral-only loop at 2 kHz with 20 counts of 600 per A and sample, duty clips 250 and 300 counts
    [robot.md C4], on the true current.
    """

    def __init__(self, plant, controller, delay_s=0.014):
        super().__init__(plant.body, controller, delay_s)
        self.plant = plant
        self.counts = [0.0, 0.0, 0.0]

    def obey(self):
        b, plant = self.body, self.plant
        rates = (b.hip_rate(), b.outer.motor_rate, b.inner.motor_rate)
        places = (b.hip_angle(), b.outer.motor_angle + ZERO, b.inner.motor_angle + ZERO)
        for k, (low, high, ceiling) in enumerate(((-4.0, 4.0, 250), (-1.0, 6.0, 300), (-1.0, 6.0, 300))):
            i0, stiffness, damping = self.commands[k]
            target = clip(i0 - stiffness * places[k] - damping * rates[k], low, high)
            motor = plant.motors[k]
            self.counts[k] = clip(self.counts[k] + 20.0 * (target - motor.current_A), -ceiling, ceiling)
            counts = round(self.counts[k]) * int(motor.mounting)
            motor.drive.write_pwm(plant.time_ns, max(counts, 0), max(-counts, 0), 600)
            motor.drive.watchdog_edge(plant.time_ns)

    def run(self, steps, seconds=1e9):
        plant = self.plant
        while not plant.fell and plant.steps < steps and self.seconds < seconds:
            if self.count % TICK == 0:
                self.controller.tick(self)
            if self.count % SLOT == 0:
                self.obey()
            plant.step()
            self.count += 1
        return not plant.fell

    @property
    def energy_J(self):
        return sum(motor.drawn_J for motor in self.plant.motors)


def electric_start(plant, walker, lean=0.09, rate=0.8, seconds=1.5):
    """The record set's operator script: stand, settle, let go."""
    plant.hold("outer", lean, 0.35, 1.825, 2.175)
    walker.run(1, seconds)
    plant.release(rate)


def mid_stance_start(body, leg_rate=0.62, hip_rate=2.1, stance_foot=0.0, swing_ankle=-1.3):
    """Outer leg upright and going forward, inner leg swinging forward, inner foot flipped up."""
    b = body
    b.outer.angle = 0.0
    b.inner.angle = 0.0
    b.outer.foot_angle = stance_foot
    b.outer.motor_angle = stance_foot
    b.inner.motor_angle = swing_ankle
    b.inner.foot_angle = b.inner.angle + swing_ankle
    b.outer.motor_rate = 0.0
    b.inner.motor_rate = 0.0
    b.inner.foot_rate = leg_rate - hip_rate
    handling.release(b, leg_rate, 0, leg_rate, hip_rate)
    b.seen.foothold_due = False


__all__ = [
    "DOUBLE",
    "ElectricWalker",
    "FALLEN",
    "SINGLE",
    "IdealMotor",
    "PaperGait",
    "RecordGait",
    "Walker",
    "clip",
    "electric_start",
    "held_start",
    "mid_stance_start",
]
