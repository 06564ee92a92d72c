# cython: boundscheck=False, wraparound=False
# (all indices in `saved` are literal)
"""Ranger's body: four links, two elastic ankle drives, two feet on the floor. Equations: plant/EQUATIONS.md.

Coordinates never swap names: every angle belongs to a leg, outer or inner (EQUATIONS 1; `leg.py`). The roles swap: one
leg stands, the other swings, exchanged when a foot meets the floor or leaves it.

Modes: held by the operator, single stance, double stance, flight, fallen. Forces are those of the floor on the
robot, along the (sloped) floor and normal to it.

The body's fields and geometry are defined here. Its motion and events, in the order in which one file imports the next:

    leg_motion           a leg during a step: chain, torques, stages
    stance_equations     the equations of motion on one or two feet
    stance, air          one step: on one or two feet; in flight or in the operator's hands
    sliding              one step while a foot slides
    walking/impact       a foot meets the floor
    walking/lift_off     a foot leaves it
    walking/watch        what is noticed once per step: footholds, extremes, falls
    walking/grip         which foot sticks, slides or leaves
    walking/compliant    a step on a floor that gives
    walking/motion       `advance`: a step with the events inside it
    walking/handling     what the operator does: place, hold, release
"""

from typing import TYPE_CHECKING, Final

import cython
from cython.cimports.libc.math import cos, sin

from ranger_sim.plant.mechanics.contact_equations import ContactEquations
from ranger_sim.plant.mechanics.floor import Floor
from ranger_sim.plant.mechanics.leg import INNER, LEG_NAMES, OUTER, Leg
from ranger_sim.plant.mechanics.leg_motion import LegMotion
from ranger_sim.plant.mechanics.observed import Observed
from ranger_sim.plant.mechanics.parameters import BodyParameters
from ranger_sim.plant.mechanics.parts import Ankle, HipJoint, Sole
from ranger_sim.plant.mechanics.stance_equations import StanceEquations
from ranger_sim.plant.mechanics.walk_record import WalkRecord

if TYPE_CHECKING:
    from ranger_sim.plant.mechanics.term_torques import TermTorques

HELD: Final = 0
SINGLE: Final = 1
DOUBLE: Final = 2
FLIGHT: Final = 3
FALLEN: Final = 4

MODE_NAMES = ("held", "single stance", "double stance", "flight", "fallen")


@cython.final
@cython.cclass
class Body:
    """State and motion of the mechanical robot. `parameters`: BodyParameters; `floor`: Floor.

    `outer`, `inner`: the legs; `stance`, `swing`: the same two by role. `stance` carries in single stance and is the
    reference leg in double stance. More than 40 fields, because a step reads most of them.
    """

    # fields read at every step come first, next to each other
    outer: Leg
    inner: Leg
    stance: Leg
    swing: Leg
    outer_motion: LegMotion
    inner_motion: LegMotion
    stance_equations: StanceEquations
    mode: cython.longlong
    step_start_ns: cython.longlong
    changes: cython.longlong
    hip_x: cython.double
    hip_y: cython.double
    hip_vx: cython.double
    hip_vy: cython.double
    hip: HipJoint
    ankle: Ankle
    brush: cython.bint
    standing: cython.bint
    lock_hip: cython.bint
    terms: "TermTorques"
    M: cython.double
    gx: cython.double
    gy: cython.double
    inverse_smoothing: cython.double
    elapsed: cython.double
    time_s: cython.double
    strike_ahead: cython.double
    seen: Observed
    last_strike: Leg
    saved: cython.double[4]
    # the rest serves double stance, the sole, events and additional terms
    closing_rate: cython.double
    hip_ay: cython.double
    hip_ddx: cython.double[4]
    hip_ddy: cython.double[4]
    sole: Sole
    event: cython.longlong
    event_leg: Leg
    coulomb: cython.bint
    compliant: cython.bint
    floating: cython.bint
    sliding: cython.bint
    watched: cython.bint
    unilateral: cython.bint
    lift_leading: cython.bint
    equations: ContactEquations
    parameters: object
    floor: object
    record: object
    cause: str

    def __init__(self, parameters=None, floor=None) -> None:
        p = parameters if parameters is not None else BodyParameters()
        self.parameters = p
        self.floor = floor if floor is not None else Floor(p.slope_rad)
        self.record = WalkRecord()
        self.seen = Observed()
        self.terms = None  # additional joint torques of a model file, see EQUATIONS 12

        self.outer = Leg(OUTER, p)
        self.inner = Leg(INNER, p)
        self.stance = self.outer
        self.swing = self.inner
        self.hip = HipJoint(p)
        self.ankle = Ankle(p)  # parts of both ankles
        self.sole = Sole(p)

        # state of the hip, m and m/s, along the floor and normal to it; its legs keep their own
        self.hip_x = 0.0
        self.hip_y = 0.0
        self.hip_vx = 0.0
        self.hip_vy = 0.0
        self.hip_ay = 0.0  # at the start of the last step, in the air only
        self.hip_ddx = [0.0] * 4  # accelerations at the stages of a step in the air
        self.hip_ddy = [0.0] * 4
        self.saved = [0.0] * 4

        # contact
        self.mode = HELD
        self.last_strike = None  # the leg that struck last
        self.brush = False  # the swing foot is near the floor and not ahead: its sole may touch
        self.strike_ahead = p.strike_ahead_m
        self.coulomb = p.contact == "coulomb"  # no foot pulls nor holds beyond friction (EQUATIONS 8, 9)
        self.compliant = p.contact == "compliant"  # feet press into the floor, nothing is rigid (EQUATIONS 9)
        self.floating = False  # on such a floor, not held: the hip hangs on no foot
        self.sliding = False  # a foot slides, or the hip floats: the steps are those of plant/mechanics/sliding.py
        self.watched = False  # a foot is near the bounds of its grip in this step
        self.unilateral = p.contact == "unilateral"  # the trailing foot may leave at a heel-strike (EQUATIONS 8)
        self.lift_leading = True  # the leading foot may leave in double stance
        # the operator's hands, while he holds the robot
        self.lock_hip = False  # they keep both legs
        self.standing = False  # the stance foot has the floor under it

        # parameters in the letters of EQUATIONS
        self.M = p.total_mass_kg
        self.gx = 0.0
        self.gy = 0.0
        self.set_slope(self.floor.slope_rad)
        self.inverse_smoothing = 1.0 / p.friction_smoothing_rad_s
        # Errors of the closed linkage in double stance decay at this rate (1/s). Chosen by us: it changes
        # accelerations only by rate^2 x error, 1e-8 m/s^2 at an error of 1e-12 m, and keeps an endless stand closed.
        self.closing_rate = 100.0

        self.time_s = 0.0  # since the body was made; only for durations
        self.elapsed = 0.0  # s since the start of the running step
        self.step_start_ns = 0
        self.event = 0  # next or present event, and its leg: plant/walking/motion.py
        self.event_leg = self.outer
        self.changes = 0  # touches, lift-offs and falls so far
        self.cause = ""  # of a fall
        # filled anew in every step
        self.equations = ContactEquations()
        self.outer_motion = LegMotion(self.outer)
        self.inner_motion = LegMotion(self.inner)
        self.stance_equations = StanceEquations(
            self.hip, self.ankle, self.sole, self.M, self.inverse_smoothing, self.closing_rate
        )
        # in the operator's hands, upright, the inner legs ahead
        self.inner.angle = -0.3
        self.inner.foot_angle = -0.3
        self.lift()
        self.update_pose()

    # ---- legs and where things are --------------------------------------------------------------------------

    @cython.ccall
    def set_slope(self, slope_rad: cython.double) -> cython.void:
        """Turn gravity: the floor falls in the walking direction by `slope_rad` (EQUATIONS 3)."""
        g: cython.double = self.parameters.gravity_m_per_s2
        self.gx = g * sin(slope_rad)
        self.gy = -g * cos(slope_rad)

    @cython.ccall
    def stand_on(self, leg: Leg) -> cython.void:
        """Exchange roles, if need be: this leg stands, the other one swings."""
        self.swing = self.other(leg)
        self.stance = leg

    @cython.ccall
    def other(self, leg: Leg) -> Leg:
        """The leg that is not this one."""
        return self.inner if leg is self.outer else self.outer

    @cython.ccall
    def leg(self, side: cython.longlong) -> Leg:
        """The leg of this side, OUTER or INNER."""
        return self.outer if side == OUTER else self.inner

    @cython.cfunc
    def know_angles(self) -> cython.void:
        """Sines and cosines of all present angles into the legs' fields."""
        self.outer.know_foot()
        self.outer.know_leg()
        self.inner.know_leg()
        self.inner.know_foot()

    @cython.ccall
    @cython.exceptval(check=False)
    def ahead(self) -> cython.double:
        """Distance of the swing foot's lowest point ahead of the stance foot's, m."""
        return self.stance.behind() - self.swing.behind()

    @cython.ccall
    def anchor_foot(self, leg: Leg) -> cython.void:
        """Anchor the foot at its place from here on."""
        leg.anchor = self.hip_x - leg.chain_x(leg.foot_angle, leg.angle)

    @cython.ccall
    @cython.exceptval(check=False)
    def contact_x(self, leg: Leg) -> cython.double:
        """Position of a foot's lowest point along the floor, m."""
        return self.hip_x - leg.behind()

    @cython.ccall
    def update_pose(self) -> cython.void:
        """Hip position and the two gaps from the angles (in flight and held: the gaps only; sliding: not along x)."""
        outer: Leg = self.outer
        inner: Leg = self.inner
        s: Leg = self.stance
        foot: cython.double = s.foot_angle
        outer_reach: cython.double
        inner_reach: cython.double
        self.know_angles()
        # the hip above its anchors, and ahead of that of the reference leg: EQUATIONS 4
        outer_reach = outer.reach()
        inner_reach = inner.reach()
        if (self.mode == SINGLE or self.mode == DOUBLE or self.standing) and not self.floating:
            self.hip_y = s.height + (outer_reach if s is outer else inner_reach)
            if s.slide == 0:
                self.hip_x = s.anchor + s.el * s.sin_leg - s.d * s.sin_foot + s.r * foot
                if foot < s.heel or foot > s.toe:
                    self.hip_x += s.r * (sin(s.excess(foot)) - s.excess(foot))
        outer.gap = self.hip_y - outer_reach - outer.height
        inner.gap = self.hip_y - inner_reach - inner.height

    @cython.ccall
    def update_hip_rates(self) -> cython.void:
        """Hip velocity from the standing foot, of one that slides only normal to the floor (EQUATIONS 4)."""
        s: Leg = self.stance
        excess: cython.double
        if (self.mode != SINGLE and self.mode != DOUBLE) or self.floating:
            return
        self.know_angles()
        excess = s.excess(s.foot_angle)
        if s.slide == 0:
            self.hip_vx = (s.r * cos(excess) - s.d * s.cos_foot) * s.foot_rate + s.el * s.cos_leg * s.rate
        self.hip_vy = (s.d * s.sin_foot - s.r * sin(excess)) * s.foot_rate - s.el * s.sin_leg * s.rate

    @cython.ccall
    @cython.exceptval(check=False)
    def slip_m_per_s(self, leg: Leg) -> cython.double:
        """Speed of a foot's lowest point along the floor, m/s (EQUATIONS 8)."""
        leg.know_leg()
        leg.know_foot()
        along: cython.double = leg.r * cos(leg.excess(leg.foot_angle)) - leg.d * leg.cos_foot
        return self.hip_vx - leg.el * leg.cos_leg * leg.rate - along * leg.foot_rate

    @cython.ccall
    @cython.exceptval(check=False)
    def hip_angle(self) -> cython.double:
        """h of the firmware: inner legs ahead of the outer ones, rad."""
        return self.outer.angle - self.inner.angle

    @cython.ccall
    @cython.exceptval(check=False)
    def hip_rate(self) -> cython.double:
        """Rate of h, rad/s."""
        return self.outer.rate - self.inner.rate

    @cython.ccall
    @cython.exceptval(check=False)
    def stands(self, leg: Leg) -> cython.bint:
        """True while this foot has the floor under it."""
        if self.mode == DOUBLE:
            return True
        if self.mode == SINGLE or self.standing:
            return leg is self.stance or leg.Fy > 0.0
        return False

    @cython.ccall
    def snapshot(self) -> dict:
        """Points in the plane of the floor for a drawing, m: hip, ankles, foot centres; angles in rad."""
        joints = {"hip": (self.hip_x, self.hip_y), "mode": MODE_NAMES[self.mode], "stance": int(self.stance.side)}
        for leg in (self.outer, self.inner):
            ankle = (self.hip_x - leg.el * sin(leg.angle), self.hip_y - leg.el * cos(leg.angle))
            joints[LEG_NAMES[leg.side]] = {
                "ankle": ankle,
                "foot_centre": (ankle[0] + leg.d * sin(leg.foot_angle), ankle[1] + leg.d * cos(leg.foot_angle)),
                "leg_rad": leg.angle,
                "foot_rad": leg.foot_angle,
            }
        return joints

    # ---- the whole state ------------------------------------------------------------------------------------

    @cython.ccall
    def lift(self) -> cython.void:
        """Raise the hip 50 mm higher than standing (chosen by us: feet turn free of the floor)."""
        self.hip_y = self.outer.el + self.outer.r - self.outer.d + 0.05

    @cython.ccall
    def energy_J(self) -> cython.double:
        """Kinetic and potential energy with springs and rotors, potential measured from the floor's frame."""
        o: Leg = self.outer
        i: Leg = self.inner
        Ao: cython.double = o.mc * cos(o.angle) + o.mw * sin(o.angle)
        Bo: cython.double = o.mc * sin(o.angle) - o.mw * cos(o.angle)
        Ai: cython.double = i.mc * cos(i.angle) + i.mw * sin(i.angle)
        Bi: cython.double = i.mc * sin(i.angle) - i.mw * cos(i.angle)
        uo: cython.double = o.rate
        ui: cython.double = i.rate
        JA: cython.double = self.ankle.J
        # stretch of the two cables
        so: cython.double = o.motor_angle - (o.foot_angle - o.angle)
        si: cython.double = i.motor_angle - (i.foot_angle - i.angle)
        # of their return springs, from rest
        ro: cython.double = o.foot_angle - o.angle - self.ankle.rest
        ri: cython.double = i.foot_angle - i.angle - self.ankle.rest
        self.update_pose()
        self.update_hip_rates()
        return (
            0.5 * self.M * (self.hip_vx * self.hip_vx + self.hip_vy * self.hip_vy)
            - self.hip_vx * (Ao * uo + Ai * ui)
            + self.hip_vy * (Bo * uo + Bi * ui)
            + 0.5 * (o.J * uo * uo + i.J * ui * ui)
            + 0.5 * o.Jf * o.foot_rate * o.foot_rate
            + 0.5 * i.Jf * i.foot_rate * i.foot_rate
            + 0.5 * self.hip.J * (uo - ui) * (uo - ui)
            + 0.5 * JA * o.motor_rate * o.motor_rate
            + 0.5 * JA * i.motor_rate * i.motor_rate
            + 0.5 * self.ankle.k * (so * so + si * si)
            + 0.5 * self.ankle.return_k * (ro * ro + ri * ri)
            + self.hip.spring_energy(o.angle - i.angle)
            - self.gx * (self.M * self.hip_x - Bo - Bi)
            - self.gy * (self.M * self.hip_y - Ao - Ai)
        )

    @cython.ccall
    @cython.exceptval(check=False)
    def event_time_ns(self) -> cython.longlong:
        """Time of the present event, ns."""
        return self.step_start_ns + int(self.elapsed * 1e9 + 0.5)

    @cython.cfunc
    def save(self) -> cython.void:
        """Keep angles, rates and the hip's state for `restore`."""
        s: cython.p_double = self.saved
        self.outer.save()
        self.inner.save()
        s[0] = self.hip_x
        s[1] = self.hip_y
        s[2] = self.hip_vx
        s[3] = self.hip_vy

    @cython.cfunc
    def restore(self) -> cython.void:
        """Back to the state that `save` has kept."""
        s: cython.p_double = self.saved
        self.outer.restore()
        self.inner.restore()
        self.hip_x = s[0]
        self.hip_y = s[1]
        self.hip_vx = s[2]
        self.hip_vy = s[3]
