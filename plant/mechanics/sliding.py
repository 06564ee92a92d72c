# cython: boundscheck=False, wraparound=False
# (indices are written out or those of loops over whole arrays)
"""Motion while a foot slides, or any foot's state is needed (EQUATIONS 9): the hip's coordinates are free.

Slides are short and rare: the ten equations are written and solved at every stage. `on_feet` and `in_air`, which run a
thousand times as often, use closed forms. Feet have an inertia here (`Body` sees to it).
"""

from typing import Final

import cython
from cython.cimports.libc.math import cos, sin

from ranger_sim.plant.mechanics.body import DOUBLE, SINGLE, Body
from ranger_sim.plant.mechanics.contact_equations import (
    APART,
    ARMS,
    COLUMN_FOOT,
    COLUMN_IMPULSE,
    COLUMN_LEG,
    COLUMN_VX,
    COLUMN_VY,
    SLIDES_BACK,
    SLIDES_ON,
    STICKS,
    ContactEquations,
)
from ranger_sim.plant.mechanics.friction import smoothed_sign
from ranger_sim.plant.mechanics.leg import INNER, OUTER, Leg
from ranger_sim.plant.mechanics.parts import Ankle, HipJoint
from ranger_sim.plant.mechanics.term_torques import TermTorques

# places in `place`, `rate`, `acceleration` of the equations: as their columns, then both motors
MOTOR: Final = 6
FREEDOMS: Final = 8


@cython.ccall
def slide(body: "Body", h: cython.double, stages: cython.longlong) -> cython.void:
    """One Runge-Kutta-Nystrom step of `h` seconds on feet of which any may slide; stages 4, or 1 to evaluate only.

    As `on_feet`, with k4 as written (EQUATIONS 15): accelerations and forces of its start are left in the legs.
    """
    n: cython.longlong
    x: ContactEquations = body.equations
    a: cython.p_double = x.acceleration
    q: cython.p_double = x.place
    u: cython.p_double = x.rate
    q0: cython.p_double = x.first_place
    u0: cython.p_double = x.first_rate
    sum_q: cython.p_double = x.place_sum
    sum_u: cython.p_double = x.rate_sum
    read_state(body)
    accelerate(body)
    take_forces(body)
    if stages == 1:
        return
    for n in range(FREEDOMS):
        q0[n] = q[n]
        u0[n] = u[n]
        sum_q[n] = a[n]
        sum_u[n] = a[n]
        q[n] = q0[n] + 0.5 * h * (u0[n] + 0.25 * h * a[n])
        u[n] = u0[n] + 0.5 * h * a[n]
    write_state(body, q, u)
    accelerate(body)
    for n in range(FREEDOMS):
        sum_q[n] += a[n]
        sum_u[n] += 2.0 * a[n]
        u[n] = u0[n] + 0.5 * h * a[n]
    write_state(body, q, u)
    accelerate(body)
    for n in range(FREEDOMS):
        sum_q[n] += a[n]
        sum_u[n] += 2.0 * a[n]
        q[n] = q0[n] + h * (u0[n] + 0.5 * h * a[n])
        u[n] = u0[n] + h * a[n]
    write_state(body, q, u)
    accelerate(body)
    for n in range(FREEDOMS):
        q[n] = q0[n] + h * (u0[n] + h / 6.0 * sum_q[n])
        u[n] = u0[n] + h / 6.0 * (sum_u[n] + a[n])
    write_state(body, q, u)
    body.update_pose()
    body.update_hip_rates()


@cython.cfunc
def accelerate(body: "Body") -> cython.void:
    """Accelerations of the present state, with the feet in their present states."""
    n: cython.longlong
    x: ContactEquations = body.equations
    outer: cython.longlong = state_of(body, body.outer)
    inner: cython.longlong = state_of(body, body.inner)
    write_forces(body)
    x.solve(outer, inner)
    for n in range(MOTOR):
        x.acceleration[n] = x.solution[n]
    x.acceleration[MOTOR] = x.motor[OUTER]
    x.acceleration[MOTOR + 1] = x.motor[INNER]


@cython.cfunc
@cython.exceptval(check=False)
def state_of(body: "Body", leg: "Leg") -> cython.longlong:
    """State of this foot: APART, STICKS, SLIDES_ON or SLIDES_BACK."""
    if body.floating or (body.mode != DOUBLE and (body.mode != SINGLE or leg is not body.stance)):
        return APART
    if leg.slide == 0:
        return STICKS
    return SLIDES_ON if leg.slide > 0 else SLIDES_BACK


@cython.ccall
def write_forces(body: "Body") -> cython.void:
    """Write into the equations: forces and torques of the present state, and the constraint of a standing foot."""
    n: cython.longlong
    hip: cython.double
    x: ContactEquations = body.equations
    o: Leg = body.outer
    i: Leg = body.inner
    joint: HipJoint = body.hip
    terms: TermTorques = body.terms
    rate: cython.double = o.rate - i.rate
    x.begin(o, i, body.M, joint.J, body.sole.mu)
    x.right[COLUMN_VX] = body.M * body.gx
    x.right[COLUMN_VY] = body.M * body.gy
    # EQUATIONS 2.1, 2.4: the hip's motor and spring
    hip = joint.torque(1.0, o.angle - i.angle, rate, body.inverse_smoothing)
    if terms is not None:
        hip += terms.torque_on_hip(o.angle - i.angle, rate)
    write_leg(body, o)
    write_leg(body, i)
    for n in range(4):
        x.brush[n] = 0.0
    x.right[COLUMN_LEG] += hip
    x.right[COLUMN_LEG + 1] -= hip
    if body.floating:
        write_press(body, o)
        write_press(body, i)
    elif body.mode == SINGLE and body.brush:
        write_brush(body, body.swing)


@cython.cfunc
def write_leg(body: "Body", leg: "Leg") -> cython.void:
    """Of one leg with its foot and motor (EQUATIONS 2, 5, 9)."""
    x: ContactEquations = body.equations
    ankle: Ankle = body.ankle
    terms: TermTorques = body.terms
    side: cython.longlong = leg.side
    s: cython.double = sin(leg.angle)
    c: cython.double = cos(leg.angle)
    A: cython.double = leg.mc * c + leg.mw * s
    B: cython.double = leg.mc * s - leg.mw * c
    turn: cython.double = leg.rate * leg.rate
    angle: cython.double = leg.foot_angle - leg.angle
    rate: cython.double = leg.foot_rate - leg.rate
    torque: cython.double = ankle.k * leg.stretch()
    motor: cython.double = leg.drive - leg.viscous * leg.motor_rate
    motor -= leg.coulomb * smoothed_sign(leg.motor_rate * body.inverse_smoothing)
    motor -= torque
    torque -= ankle.return_k * (angle - ankle.rest)
    if angle < ankle.low or angle > ankle.high:
        torque += ankle.stop_torque(angle, rate)
    if terms is not None:
        terms.act_on_ankle(leg, angle, rate, leg.motor_angle, leg.motor_rate)
        motor += leg.extra_motor
        torque += leg.extra_ankle
    x.motor[side] = motor * ankle.inverse_J
    x.right[COLUMN_VX] -= B * turn
    x.right[COLUMN_VY] -= A * turn
    x.right[COLUMN_LEG + side] = B * body.gy - A * body.gx - torque
    x.right[COLUMN_FOOT + side] = torque
    x.rolling[side] = -leg.C * leg.foot_rate
    if state_of(body, leg) != APART:
        write_targets(body, leg)
    else:
        x.leave_out(side)


@cython.cfunc
def write_targets(body: "Body", leg: "Leg") -> cython.void:
    """How a standing foot's contact is to accelerate (EQUATIONS 4): not at all, and errors decay as in section 6."""
    x: ContactEquations = body.equations
    n: cython.longlong = ARMS * leg.side
    om: cython.double = body.closing_rate
    turn: cython.double = leg.foot_rate * leg.foot_rate
    leg_turn: cython.double = leg.rate * leg.rate
    excess: cython.double = leg.excess(leg.foot_angle)
    down: cython.double = leg.d * cos(leg.foot_angle)
    v_x: cython.double = body.hip_vx + x.arm[n] * leg.rate + x.arm[n + 1] * leg.foot_rate
    v_y: cython.double = body.hip_vy + x.arm[n + 2] * leg.rate + x.arm[n + 3] * leg.foot_rate
    if excess != 0.0:
        down -= leg.r * cos(excess)
    # bias of section 4: f dF^2 - l sin th dth^2 (f = -arm), and along y
    x.target[2 * leg.side] = -x.arm[n + 3] * turn - x.arm[n + 2] * leg_turn
    x.target[2 * leg.side + 1] = down * turn + x.arm[n] * leg_turn
    x.target[2 * leg.side] -= om * (2.0 * v_x + om * (body.hip_x - leg.chain_x(leg.foot_angle, leg.angle) - leg.anchor))
    x.target[2 * leg.side + 1] -= om * (
        2.0 * v_y + om * (body.hip_y - leg.chain_y(leg.foot_angle, leg.angle) - leg.height)
    )


@cython.cfunc
def write_brush(body: "Body", leg: "Leg") -> cython.void:
    """The swing foot brushes the floor with its sole, as in `on_feet` (EQUATIONS 9)."""
    x: ContactEquations = body.equations
    n: cython.longlong = ARMS * leg.side
    along: cython.double
    v_x: cython.double = body.hip_vx + x.arm[n] * leg.rate + x.arm[n + 1] * leg.foot_rate
    v_y: cython.double = body.hip_vy + x.arm[n + 2] * leg.rate + x.arm[n + 3] * leg.foot_rate
    gap: cython.double = body.hip_y - leg.chain_y(leg.foot_angle, leg.angle) - leg.height
    normal: cython.double = -body.sole.k * gap - body.sole.c * v_y
    if gap >= 0.0 or normal <= 0.0:
        return
    along = -body.sole.mu * normal * smoothed_sign(v_x * body.sole.per_m_s)
    push(body, leg, along, normal)


@cython.cfunc
def write_press(body: "Body", leg: "Leg") -> cython.void:
    """A foot presses into a floor that gives: Hunt and Crossley's spring and damper, friction (EQUATIONS 9)."""
    x: ContactEquations = body.equations
    n: cython.longlong = ARMS * leg.side
    along: cython.double
    v_x: cython.double = body.hip_vx + x.arm[n] * leg.rate + x.arm[n + 1] * leg.foot_rate
    v_y: cython.double = body.hip_vy + x.arm[n + 2] * leg.rate + x.arm[n + 3] * leg.foot_rate
    deep: cython.double = leg.chain_y(leg.foot_angle, leg.angle) + leg.height - body.hip_y
    normal: cython.double = body.sole.floor_k * deep * (1.0 - body.sole.floor_a * v_y)
    if deep <= 0.0 or normal <= 0.0:
        return
    along = -body.sole.mu * normal * smoothed_sign(v_x * body.sole.floor_per_m_s)
    push(body, leg, along, normal)
    x.right[COLUMN_FOOT + leg.side] += x.rolling[leg.side]


@cython.cfunc
def push(body: "Body", leg: "Leg", along: cython.double, normal: cython.double) -> cython.void:
    """A force on a foot that is known, into the equations."""
    x: ContactEquations = body.equations
    n: cython.longlong = ARMS * leg.side
    x.brush[2 * leg.side] = along
    x.brush[2 * leg.side + 1] = normal
    x.right[COLUMN_VX] += along
    x.right[COLUMN_VY] += normal
    x.right[COLUMN_LEG + leg.side] += x.arm[n] * along + x.arm[n + 2] * normal
    x.right[COLUMN_FOOT + leg.side] += x.arm[n + 1] * along + x.arm[n + 3] * normal


@cython.cfunc
def take_forces(body: "Body") -> cython.void:
    """Accelerations and forces of the present state out of the equations into the legs, as `on_feet` leaves them."""
    leg: Leg
    x: ContactEquations = body.equations
    for leg in (body.outer, body.inner):
        leg.acc = x.acceleration[COLUMN_LEG + leg.side]
        leg.foot_acc = x.acceleration[COLUMN_FOOT + leg.side]
        leg.motor_acc = x.acceleration[MOTOR + leg.side]
        leg.Fx = x.solution[COLUMN_IMPULSE + 2 * leg.side] + x.brush[2 * leg.side]
        leg.Fy = x.solution[COLUMN_IMPULSE + 2 * leg.side + 1] + x.brush[2 * leg.side + 1]


@cython.cfunc
def read_state(body: "Body") -> cython.void:
    """Hip, legs, feet and motors into `place` and `rate` of the equations."""
    leg: Leg
    q: cython.p_double = body.equations.place
    u: cython.p_double = body.equations.rate
    q[COLUMN_VX] = body.hip_x
    q[COLUMN_VY] = body.hip_y
    u[COLUMN_VX] = body.hip_vx
    u[COLUMN_VY] = body.hip_vy
    for leg in (body.outer, body.inner):
        q[COLUMN_LEG + leg.side] = leg.angle
        q[COLUMN_FOOT + leg.side] = leg.foot_angle
        q[MOTOR + leg.side] = leg.motor_angle
        u[COLUMN_LEG + leg.side] = leg.rate
        u[COLUMN_FOOT + leg.side] = leg.foot_rate
        u[MOTOR + leg.side] = leg.motor_rate


@cython.cfunc
def write_state(body: "Body", q: cython.p_double, u: cython.p_double) -> cython.void:
    """And back from places and rates given."""
    leg: Leg
    body.hip_x = q[COLUMN_VX]
    body.hip_y = q[COLUMN_VY]
    body.hip_vx = u[COLUMN_VX]
    body.hip_vy = u[COLUMN_VY]
    for leg in (body.outer, body.inner):
        leg.angle = q[COLUMN_LEG + leg.side]
        leg.foot_angle = q[COLUMN_FOOT + leg.side]
        leg.motor_angle = q[MOTOR + leg.side]
        leg.rate = u[COLUMN_LEG + leg.side]
        leg.foot_rate = u[COLUMN_FOOT + leg.side]
        leg.motor_rate = u[MOTOR + leg.side]
