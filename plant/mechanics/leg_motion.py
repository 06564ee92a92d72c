"""A leg during a step: its chain and first moments, the torques at its ankle, and the stages (EQUATIONS 2, 4, 5.1, 15).

The letters are those of EQUATIONS: F, th and p are the angles of foot, leg and ankle motor, dF, dth and dp their rates.
"""

import cython
from cython.cimports.libc.math import cos, sin

from ranger_sim.plant.mechanics.friction import smoothed_sign
from ranger_sim.plant.mechanics.leg import Leg
from ranger_sim.plant.mechanics.parts import Ankle
from ranger_sim.plant.mechanics.term_torques import TermTorques


@cython.final
@cython.cclass
class LegMotion:
    """One leg at one stage of a step (rad, rad/s, N m). `leg`: the leg whose state it starts from and moves on.

    `a`: the ankle's angle. `e`, `f`: horizontal and vertical arm of the chain (EQUATIONS 4), `df_dF` the slope of f;
    `sigma`: the foot's angle beyond its arc. `A`, `B`: minus the first moments about the hip (EQUATIONS 5.1).
    `T`: torque of the ankle on the foot, opposite on the leg; `T_foot`: that with the rolling friction; `T_motor`: on
    the motor. `ddF`, `ddth`, `ddp`: accelerations at the four stages (rad/s^2). More than 40 fields, because these are
    the numbers of the equations.
    """

    leg: Leg
    massless: cython.bint
    F: cython.double
    th: cython.double
    p: cython.double
    dF: cython.double
    dth: cython.double
    dp: cython.double
    sin_foot: cython.double
    cos_foot: cython.double
    sin_leg: cython.double
    cos_leg: cython.double
    l_sin: cython.double
    l_cos: cython.double
    sigma: cython.double
    e: cython.double
    f: cython.double
    df_dF: cython.double
    A: cython.double
    B: cython.double
    a: cython.double
    rolling: cython.double
    T: cython.double
    T_foot: cython.double
    T_motor: cython.double
    ddF: cython.double[4]
    ddth: cython.double[4]
    ddp: cython.double[4]
    # the start of the step
    F0: cython.double
    th0: cython.double
    p0: cython.double
    dF0: cython.double
    dth0: cython.double
    dp0: cython.double

    def __init__(self, leg) -> None:
        self.leg = leg
        self.ddF = [0.0] * 4
        self.ddth = [0.0] * 4
        self.ddp = [0.0] * 4
        self.e = self.f = self.df_dF = self.sigma = 0.0
        self.A = self.B = 0.0
        self.begin(False, 0.0)

    @cython.cfunc
    def begin(self, massless: cython.bint, rolling: cython.double) -> cython.void:
        """Start at the state of the leg, whose sines are up to date.

        massless: its foot is without inertia and in the air; rolling: friction of its rolling foot (N m s/rad).
        """
        leg: Leg = self.leg
        self.massless = massless
        self.rolling = rolling
        self.F = self.F0 = leg.foot_angle
        self.th = self.th0 = leg.angle
        self.p = self.p0 = leg.motor_angle
        self.dF = self.dF0 = leg.foot_rate
        self.dth = self.dth0 = leg.rate
        self.dp = self.dp0 = leg.motor_rate
        self.a = self.F - self.th
        self.sin_foot = leg.sin_foot
        self.cos_foot = leg.cos_foot
        self.sin_leg = leg.sin_leg
        self.cos_leg = leg.cos_leg

    # ---- terms that depend on angles alone ------------------------------------------------------------------

    @cython.cfunc
    def set_leg_sines(self) -> cython.void:
        """Sine and cosine of th."""
        self.sin_leg = sin(self.th)
        self.cos_leg = cos(self.th)

    @cython.cfunc
    def set_foot_sines(self) -> cython.void:
        """Sine and cosine of F."""
        self.sin_foot = sin(self.F)
        self.cos_foot = cos(self.F)

    @cython.cfunc
    def set_chain(self) -> cython.void:
        """EQUATIONS 4: from the foot's contact to the hip."""
        leg: Leg = self.leg
        self.l_sin = leg.el * self.sin_leg
        self.l_cos = leg.el * self.cos_leg
        self.sigma = 0.0
        self.df_dF = leg.d * self.cos_foot
        self.f = leg.d * self.sin_foot
        self.e = leg.r - self.df_dF
        if self.F < leg.heel or self.F > leg.toe:
            self.sigma = leg.excess(self.F)
            self.e = leg.r * cos(self.sigma) - self.df_dF
            self.f -= leg.r * sin(self.sigma)
            self.df_dF = -self.e

    @cython.cfunc
    def set_first_moments(self) -> cython.void:
        """EQUATIONS 5.1: A and B."""
        leg: Leg = self.leg
        self.A = leg.mc * self.cos_leg + leg.mw * self.sin_leg
        self.B = leg.mc * self.sin_leg - leg.mw * self.cos_leg

    # ---- torques --------------------------------------------------------------------------------------------

    @cython.cfunc
    def set_torques(self, ankle: Ankle, terms: TermTorques, per_rad_s: cython.double) -> cython.void:
        """Torques of motor, cable, return springs and stops, rolling and terms.

        per_rad_s: one over epsilon, the rate of smoothing. `terms`: None without additional ones.
        """
        leg: Leg = self.leg
        a: cython.double = self.a
        da: cython.double = self.dF - self.dth
        # EQUATIONS 2.1, 2.3: motor and cable
        motor: cython.double = leg.drive - leg.coulomb * smoothed_sign(self.dp * per_rad_s) - leg.viscous * self.dp
        cable: cython.double = 0.0 if self.massless else ankle.k * (self.p - a)
        motor -= cable
        # EQUATIONS 2.8: torques between leg and foot load the motor where a massless foot is in the air
        T: cython.double = motor if self.massless else cable
        if ankle.return_k != 0.0:
            T -= ankle.return_k * (a - ankle.rest)  # EQUATIONS 2.7
        if a < ankle.low or a > ankle.high:
            T += ankle.stop_torque(a, da)  # EQUATIONS 2.5
        T_foot: cython.double = T - self.rolling * self.dF  # EQUATIONS 2.6
        if terms is not None:
            # EQUATIONS 12
            terms.act_on_ankle(leg, a, da, self.p, self.dp)
            motor += leg.extra_motor
            if self.massless:
                T += leg.extra_motor
            T += leg.extra_ankle
            T_foot += leg.extra_ankle
        if self.massless:
            motor = T
            T = 0.0
            T_foot = 0.0
        self.T = T
        self.T_foot = T_foot
        self.T_motor = motor

    @cython.cfunc
    def set_free_foot(self, stage: cython.longlong) -> cython.void:
        """Acceleration of a foot in the air at this stage, after those of leg and motor (EQUATIONS 5.3, 5.4)."""
        if self.massless:
            self.ddF[stage] = self.ddth[stage] + self.ddp[stage]
        else:
            self.ddF[stage] = self.T_foot * self.leg.inverse_Jf

    # ---- from stage to stage (EQUATIONS 15) -----------------------------------------------------------------

    @cython.cfunc
    def set_rates(self, stage: cython.longlong, seconds: cython.double) -> cython.void:
        """Rates of the next stage: `seconds` after the start by the accelerations of this one."""
        self.dF = self.dF0 + seconds * self.ddF[stage]
        self.dth = self.dth0 + seconds * self.ddth[stage]
        self.dp = self.dp0 + seconds * self.ddp[stage]

    @cython.cfunc
    def go_to_middle(self, h: cython.double) -> cython.void:
        """Angles of the second and third stage, and the rates of the second."""
        half: cython.double = 0.5 * h
        quarter: cython.double = 0.25 * h
        self.F = self.F0 + half * (self.dF0 + quarter * self.ddF[0])
        self.th = self.th0 + half * (self.dth0 + quarter * self.ddth[0])
        self.p = self.p0 + half * (self.dp0 + quarter * self.ddp[0])
        self.a = self.F - self.th
        self.set_rates(0, half)

    @cython.cfunc
    def go_to_end(self, h: cython.double) -> cython.void:
        """Angles and rates of the fourth stage."""
        half: cython.double = 0.5 * h
        self.F = self.F0 + h * (self.dF0 + half * self.ddF[2])
        self.th = self.th0 + h * (self.dth0 + half * self.ddth[2])
        self.p = self.p0 + h * (self.dp0 + half * self.ddp[2])
        self.a = self.F - self.th
        self.set_rates(2, h)

    @cython.cfunc
    def take_angles_of_next_step(self, h: cython.double) -> cython.void:
        """F and th of the next step's start, for the geometry; `a` and `p`, for the springs, stay."""
        self.F = next_angle(self.F0, self.dF0, self.ddF, h)
        self.th = next_angle(self.th0, self.dth0, self.ddth, h)

    @cython.cfunc
    def keep_accelerations(self) -> cython.void:
        """Write the accelerations of the first stage into the leg."""
        self.leg.foot_acc = self.ddF[0]
        self.leg.acc = self.ddth[0]
        self.leg.motor_acc = self.ddp[0]

    @cython.cfunc
    def keep_sines(self) -> cython.void:
        """Write the sines of the present F and th into the leg."""
        leg: Leg = self.leg
        leg.known_foot = self.F
        leg.sin_foot = self.sin_foot
        leg.cos_foot = self.cos_foot
        leg.known_angle = self.th
        leg.sin_leg = self.sin_leg
        leg.cos_leg = self.cos_leg

    @cython.cfunc
    def finish(self, h: cython.double, on_feet: cython.bint) -> cython.void:
        """Write angles and rates of the next step's start into the leg. on_feet: as of `weighted_sum`."""
        sixth: cython.double = h / 6.0
        leg: Leg = self.leg
        leg.foot_angle = next_angle(self.F0, self.dF0, self.ddF, h)
        leg.angle = next_angle(self.th0, self.dth0, self.ddth, h)
        leg.motor_angle = next_angle(self.p0, self.dp0, self.ddp, h)
        leg.foot_rate = self.dF0 + sixth * weighted_sum(self.ddF, on_feet)
        leg.rate = self.dth0 + sixth * weighted_sum(self.ddth, on_feet)
        leg.motor_rate = self.dp0 + sixth * weighted_sum(self.ddp, on_feet)


@cython.cfunc
@cython.exceptval(check=False)
def next_angle(q: cython.double, u: cython.double, k: cython.p_double, h: cython.double) -> cython.double:
    """q' of EQUATIONS 15, from angle and rate of the start and the accelerations k."""
    return q + h * (u + h / 6.0 * (k[0] + k[1] + k[2]))


@cython.cfunc
@cython.exceptval(check=False)
def weighted_sum(k: cython.p_double, on_feet: cython.bint) -> cython.double:
    """k1 + 2 k2 + 2 k3 + k4 (EQUATIONS 15), rounded in the order that recorded runs have on the feet and in the air."""
    if on_feet:
        return 2.0 * (k[0] + k[1] + k[2]) - k[0] + k[3]
    return k[0] + 2.0 * k[1] + 2.0 * k[2] + k[3]
