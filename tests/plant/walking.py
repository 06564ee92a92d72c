"""Controllers small enough to judge the body by, with ideal current sources: no boards, no electronics.

They stand on the body's own coordinates. Currents follow the command at once; motors have the friction of the
appendix (eq. 35, smoothed by eq. 43) and the electric power of eq. 32, per motor not below zero.
"""

import math

from plant.body import DOUBLE, FALLEN, SINGLE, Body

K = 0.018  # N m/A, torque constant [appendix table 3]
R = 1.34  # ohm, with the series inductor [facts on the plant 3]
V_C = 0.7  # V, brush contacts
MU = 0.1
C0 = 0.1  # N m on the robot [facts on the plant 3]
C1 = 0.01  # N m s/rad
STEP_S = 125e-6
TICK = 16  # steps of the plant per controller tick of 2 ms


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

    def set_currents(self, hip, outer, inner):
        if self.limits:
            hip = clip(hip, -4.0, 4.0)  # the boards' clips [facts on control 4]
            outer = clip(outer, -1.0, 6.0)
            inner = clip(inner, -1.0, 6.0)
        self.hip.current_A = hip
        self.ankles[0].current_A = outer
        self.ankles[1].current_A = inner
        b = self.body
        b.hip_drive, b.hip_coulomb, b.hip_viscous = self.hip.laws()
        b.outer_drive, b.outer_coulomb, b.outer_viscous = self.ankles[0].laws()
        b.inner_drive, b.inner_coulomb, b.inner_viscous = self.ankles[1].laws()

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
            self.hip.spend(b.hip_rate(), STEP_S)
            self.ankles[0].spend(b.motor_outer_rate, STEP_S)
            self.ankles[1].spend(b.motor_inner_rate, STEP_S)
            b.step_start_ns = self.count * 125_000
            b.advance(STEP_S)
            self.count += 1
        return b.mode != FALLEN


class PaperGait:
    """The gait of facts on the plant, section 4, in the angles of the appendix, for either leg as stance.

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
            phi, phi_w, phi_rate, phi_w_rate = -b.leg_outer, -b.leg_inner, -b.leg_outer_rate, -b.leg_inner_rate
            ms, ms_rate, mw, mw_rate = b.motor_outer, b.motor_outer_rate, b.motor_inner, b.motor_inner_rate
        else:
            phi, phi_w, phi_rate, phi_w_rate = -b.leg_inner, -b.leg_outer, -b.leg_inner_rate, -b.leg_outer_rate
            ms, ms_rate, mw, mw_rate = b.motor_inner, b.motor_inner_rate, b.motor_outer, b.motor_outer_rate
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


def mid_stance_start(body, leg_rate=0.62, hip_rate=2.1, stance_foot=0.0, swing_ankle=-1.3):
    """Outer leg upright and going forward, inner leg swinging forward, inner foot flipped up."""
    b = body
    b.leg_outer = 0.0
    b.leg_inner = 0.0
    b.foot_outer = stance_foot
    b.motor_outer = stance_foot
    b.motor_inner = swing_ankle
    b.foot_inner = b.leg_inner + swing_ankle
    b.motor_outer_rate = 0.0
    b.motor_inner_rate = 0.0
    b.foot_inner_rate = leg_rate - hip_rate
    b.release(leg_rate, 0, leg_rate, hip_rate)
    b.foothold_due = False


__all__ = ["DOUBLE", "FALLEN", "SINGLE", "IdealMotor", "PaperGait", "Walker", "clip", "mid_stance_start"]
