# cython: boundscheck=False, wraparound=False, cdivision=True
# (indices are written out or those of loops over whole arrays; no integer is divided)
"""Possible states of two feet on the floor: clear of it, sticking, or sliding (EQUATIONS 8, 9).

The same ten linear equations serve a strike, in rates and impulses, and any time between strikes, in accelerations and
forces. The unknowns are the hip along x and y, both legs, both feet, and x and y of the floor's action on each foot. A
foot in one of its four states gives two of the equations; the state is right when its inequalities hold too:

    APART         no impulse                                 the foot does not move into the floor
    STICKS        the foot does not move                     the floor pushes, along itself within mu of that
    SLIDES_ON     the impulse along is -mu times the normal  the floor pushes, the foot moves forwards
    SLIDES_BACK   +mu                                        the floor pushes, the foot moves backwards

That is Coulomb's friction and a plastic impact with complementarity (Glocker and Pfeiffer 1995; Stewart and Trinkle
1996). Two feet have sixteen pairs of states, so the right one is found by trying them.
"""

from typing import Final

import cython
from cython.cimports.libc.math import cos, fabs, sin

from ranger_sim.plant.mechanics.leg import INNER, OUTER, Leg

# Columns of `matrix`, and rows of `solution`: the unknowns, and last the right-hand side.
COLUMN_VX: Final = 0  # of the hip
COLUMN_VY: Final = 1
COLUMN_LEG: Final = 2  # the outer, and next the inner leg
COLUMN_FOOT: Final = 4  # the outer, and next the inner foot
COLUMN_IMPULSE: Final = 6  # x and y of the outer foot, and of the inner
COLUMN_RIGHT: Final = 10
COLUMNS: Final = 11

# states of a foot
APART: Final = 0
STICKS: Final = 1
SLIDES_ON: Final = 2
SLIDES_BACK: Final = 3
STATES: Final = 4

ARMS: Final = 4  # numbers per foot in `arm`


# Order in which pairs of states are tried: of the stance foot, and of the one that touches. When more than one
# pair satisfies everything the first is taken: as many feet stay on the floor as can, as many of them stick as can,
# the foot that touches before the other. Chosen by us, because it is nearest to the appendix's rule, both feet at rest.
PAIRS = (
    (STICKS, STICKS),
    (SLIDES_ON, STICKS),
    (SLIDES_BACK, STICKS),
    (STICKS, SLIDES_ON),
    (STICKS, SLIDES_BACK),
    (SLIDES_ON, SLIDES_ON),
    (SLIDES_BACK, SLIDES_BACK),
    (SLIDES_ON, SLIDES_BACK),
    (SLIDES_BACK, SLIDES_ON),
    (APART, STICKS),
    (STICKS, APART),
    (APART, SLIDES_ON),
    (APART, SLIDES_BACK),
    (SLIDES_ON, APART),
    (SLIDES_BACK, APART),
    (APART, APART),
)


@cython.final
@cython.cclass
class ContactEquations:
    """The equations and their solution. Arrays are by foot, outer first; "rate" may be acceleration, "impulse" force.

    Filled by `begin` and its caller: `mass`, 6 x 6; `right`, momenta or forces of the first six rows; `target`, rates
    of the contact along and normal to the floor when the foot holds; `rolling`, torque on a foot while it is at the
    floor; `follow`, of a massless foot, its motor's rate, which it follows when APART. `moving`: the foot
    slides already, its direction is known.
    """

    matrix: cython.double[110]
    solution: cython.double[10]
    mass: cython.double[36]
    right: cython.double[6]
    arm: cython.double[8]
    target: cython.double[4]
    follow: cython.double[2]
    rolling: cython.double[2]
    motor: cython.double[2]
    brush: cython.double[4]
    place: cython.double[8]
    rate: cython.double[8]
    acceleration: cython.double[8]
    first_place: cython.double[8]
    first_rate: cython.double[8]
    place_sum: cython.double[8]
    rate_sum: cython.double[8]
    massless: cython.bint[2]
    moving: cython.bint[2]
    at_floor: cython.bint[2]
    allowed: cython.bint[8]
    state: cython.longlong[2]
    mu: cython.double
    total_mass: cython.double

    def __init__(self) -> None:
        self.matrix = [0.0] * 110
        self.solution = [0.0] * 10
        self.mass = [0.0] * 36
        self.right = [0.0] * 6
        self.arm = [
            0.0
        ] * 8  # rates of the contact by those of leg and foot: leg along, foot along, leg and foot normal
        self.target = [0.0] * 4
        self.follow = [0.0] * 2
        self.rolling = [0.0] * 2
        # of a step (`sliding.py`), in the order of the columns and then both motors: accelerations of the motors,
        # forces that are known, state of a stage and of the start, sums of accelerations
        self.motor = [0.0] * 2
        self.brush = [0.0] * 4
        self.place = [0.0] * 8
        self.rate = [0.0] * 8
        self.acceleration = [0.0] * 8
        self.first_place = [0.0] * 8
        self.first_rate = [0.0] * 8
        self.place_sum = [0.0] * 8
        self.rate_sum = [0.0] * 8
        self.massless = [False] * 2
        self.at_floor = [False] * 2
        self.moving = [False] * 2
        self.allowed = [False] * 8  # by foot and state
        self.state = [0] * 2  # which `settle` has found
        self.mu = 0.0
        self.total_mass = 1.0

    @cython.ccall
    def begin(
        self,
        outer: "Leg",
        inner: "Leg",
        total_mass: cython.double,
        hip_rotor: cython.double,
        mu: cython.double,
    ) -> None:
        """Masses and contacts of this posture; everything else zero, every state allowed."""
        n: cython.longlong
        on: cython.longlong
        A: cython.double
        B: cython.double
        excess: cython.double
        leg: Leg
        m: cython.p_double = self.mass
        self.mu = mu
        self.total_mass = total_mass
        for n in range(36):
            m[n] = 0.0
        for n in range(6):
            self.right[n] = 0.0
        for n in range(4):
            self.target[n] = 0.0
        m[6 * COLUMN_VX + COLUMN_VX] = total_mass
        m[6 * COLUMN_VY + COLUMN_VY] = total_mass
        for leg in (outer, inner):
            # EQUATIONS 5.1 and 8: minus the leg's first moments; momenta along, normal, about the hip, about the ankle
            A = leg.mc * cos(leg.angle) + leg.mw * sin(leg.angle)
            B = leg.mc * sin(leg.angle) - leg.mw * cos(leg.angle)
            on = COLUMN_LEG + leg.side
            m[6 * COLUMN_VX + on] = -A
            m[6 * COLUMN_VY + on] = B
            m[6 * on + COLUMN_VX] = -A
            m[6 * on + COLUMN_VY] = B
            m[6 * on + COLUMN_LEG] = -hip_rotor
            m[6 * on + COLUMN_LEG + 1] = -hip_rotor
            m[6 * on + on] = leg.J + hip_rotor
            on = COLUMN_FOOT + leg.side
            m[6 * on + on] = leg.Jf
            # EQUATIONS 4: the contact moves with the hip, and against leg and foot
            excess = leg.excess(leg.foot_angle)
            n = ARMS * leg.side
            self.arm[n] = -leg.el * cos(leg.angle)
            self.arm[n + 1] = -(leg.r * cos(excess) - leg.d * cos(leg.foot_angle))
            self.arm[n + 2] = leg.el * sin(leg.angle)
            self.arm[n + 3] = -(leg.d * sin(leg.foot_angle) - leg.r * sin(excess))
            self.massless[leg.side] = leg.Jf == 0.0
            self.follow[leg.side] = 0.0
            self.rolling[leg.side] = 0.0
            self.moving[leg.side] = False
            self.allow_all(leg.side)

    @cython.ccall
    def allow_all(self, side: cython.longlong) -> cython.void:
        """Allow this foot, which is at the floor, every state."""
        n: cython.longlong
        self.at_floor[side] = True
        for n in range(STATES):
            self.allowed[STATES * side + n] = True

    @cython.ccall
    def allow_only(self, side: cython.longlong, state: cython.longlong) -> cython.void:
        """Allow this foot only this state."""
        n: cython.longlong
        for n in range(STATES):
            self.allowed[STATES * side + n] = n == state

    @cython.ccall
    def leave_out(self, side: cython.longlong) -> cython.void:
        """Put this foot in the air, without conditions from the floor."""
        self.allow_only(side, APART)
        self.at_floor[side] = False

    @cython.ccall
    @cython.exceptval(check=False)
    def solve(self, outer: cython.longlong, inner: cython.longlong) -> cython.bint:
        """Solve with these states of the feet, without checking inequalities; False when the equations contradict."""
        row: cython.longlong
        column: cython.longlong
        a: cython.p_double = self.matrix
        for row in range(COLUMN_IMPULSE):
            for column in range(COLUMN_IMPULSE):
                a[COLUMNS * row + column] = self.mass[6 * row + column]
            for column in range(COLUMN_IMPULSE, COLUMN_RIGHT):
                a[COLUMNS * row + column] = 0.0
            a[COLUMNS * row + COLUMN_RIGHT] = self.right[row]
        for row in range(COLUMN_IMPULSE, COLUMN_RIGHT):
            for column in range(COLUMNS):
                a[COLUMNS * row + column] = 0.0
        self.write_contact(OUTER, outer)
        self.write_contact(INNER, inner)
        return eliminate(a, self.solution, COLUMN_RIGHT)

    @cython.cfunc
    def write_contact(self, side: cython.longlong, state: cython.longlong) -> cython.void:
        """Fill two rows and two columns of `matrix`: this foot's conditions, and its impulse's effect on the robot."""
        along: cython.longlong = COLUMN_IMPULSE + 2 * side
        normal: cython.longlong = along + 1
        leg: cython.longlong = COLUMN_LEG + side
        foot: cython.longlong = COLUMN_FOOT + side
        arm: cython.p_double = self.arm
        n: cython.longlong = ARMS * side
        a: cython.p_double = self.matrix
        if self.at_floor[side]:
            # Friction of rolling does not depend on the load. A foot about to leave includes it too, because otherwise
            # none of the states may fit where the load is small.
            a[COLUMNS * foot + COLUMN_RIGHT] += self.rolling[side]
        if state == APART:
            a[COLUMNS * along + along] = 1.0
            a[COLUMNS * normal + normal] = 1.0
            if self.massless[side]:
                # it has no momentum: it follows its motor
                a[COLUMNS * foot + foot] = 1.0
                a[COLUMNS * foot + leg] = -1.0
                a[COLUMNS * foot + COLUMN_RIGHT] = self.follow[side]
            return
        a[COLUMNS * COLUMN_VX + along] = -1.0
        a[COLUMNS * leg + along] = -arm[n]
        a[COLUMNS * foot + along] = -arm[n + 1]
        a[COLUMNS * COLUMN_VY + normal] = -1.0
        a[COLUMNS * leg + normal] = -arm[n + 2]
        a[COLUMNS * foot + normal] = -arm[n + 3]
        a[COLUMNS * normal + COLUMN_VY] = 1.0
        a[COLUMNS * normal + leg] = arm[n + 2]
        a[COLUMNS * normal + foot] = arm[n + 3]
        a[COLUMNS * normal + COLUMN_RIGHT] = self.target[2 * side + 1]
        if state == STICKS:
            a[COLUMNS * along + COLUMN_VX] = 1.0
            a[COLUMNS * along + leg] = arm[n]
            a[COLUMNS * along + foot] = arm[n + 1]
            a[COLUMNS * along + COLUMN_RIGHT] = self.target[2 * side]
        else:
            a[COLUMNS * along + along] = 1.0
            a[COLUMNS * along + normal] = self.mu if state == SLIDES_ON else -self.mu

    @cython.ccall
    @cython.exceptval(check=False)
    def contact_rate(self, side: cython.longlong, along: cython.longlong) -> cython.double:
        """Excess of this foot's contact rate over its target in `solution`: normal (0) or along (1)."""
        x: cython.p_double = self.solution
        n: cython.longlong = ARMS * side + (0 if along else 2)
        rate: cython.double = x[COLUMN_VX] if along else x[COLUMN_VY]
        rate += self.arm[n] * x[COLUMN_LEG + side] + self.arm[n + 1] * x[COLUMN_FOOT + side]
        return rate - self.target[2 * side + (0 if along else 1)]

    @cython.ccall
    @cython.exceptval(check=False)
    def slack(self, side: cython.longlong, state: cython.longlong) -> cython.double:
        """Margin of this state's inequalities in `solution`, m/s; below 0 they are violated.

        Impulses count divided by the mass of the whole robot.
        """
        push: cython.double = self.solution[COLUMN_IMPULSE + 2 * side + 1] / self.total_mass
        along: cython.double = self.solution[COLUMN_IMPULSE + 2 * side] / self.total_mass
        rest: cython.double
        if not self.at_floor[side]:
            return 1e300  # ample: no inequality is about it
        if state == APART:
            return self.contact_rate(side, 0)
        rest = push
        if state == STICKS:
            rest = self.mu * push - fabs(along)
        elif not self.moving[side]:
            rest = self.contact_rate(side, 1)
            if state == SLIDES_BACK:
                rest = -rest
        return rest if rest < push else push

    @cython.ccall
    def settle(self, last: cython.longlong) -> cython.double:
        """Find the feet's states, and solve with them: `state`, `solution`. `last`: side of the foot that touches.

        Returns 0, or the smallest violation (m/s, below 0) of the inequalities, when no pair satisfies all of them: by
        rounding, where a foot is just between two states.
        """
        first: cython.longlong = 1 - last
        a: cython.longlong
        b: cython.longlong
        slack: cython.double
        other: cython.double
        best: cython.double = -1e300
        for a, b in PAIRS:
            if not (self.allowed[STATES * first + a] and self.allowed[STATES * last + b]):
                continue
            if not (self.solve(b, a) if last == OUTER else self.solve(a, b)):
                continue
            slack = self.slack(first, a)
            other = self.slack(last, b)
            slack = other if other < slack else slack
            if slack > best:
                best = slack
                self.state[first] = a
                self.state[last] = b
                if slack >= 0.0:
                    return 0.0
        self.solve(self.state[OUTER], self.state[INNER])
        return best


@cython.cfunc
@cython.exceptval(check=False)
def eliminate(a: cython.p_double, x: cython.p_double, n: cython.longlong) -> cython.bint:
    """Solve n equations (rows of 11, right-hand side last) by Gauss with pivots; False when they are singular."""
    i: cython.longlong
    j: cython.longlong
    k: cython.longlong
    best: cython.longlong
    factor: cython.double
    held: cython.double
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if fabs(a[COLUMNS * i + k]) > fabs(a[COLUMNS * best + k]):
                best = i
        if fabs(a[COLUMNS * best + k]) < 1e-12:
            return False  # too small for a pivot: masses are 1e-3 to 10 kg and directions about 1
        if best != k:
            for j in range(COLUMNS):
                held = a[COLUMNS * k + j]
                a[COLUMNS * k + j] = a[COLUMNS * best + j]
                a[COLUMNS * best + j] = held
        for i in range(k + 1, n):
            factor = a[COLUMNS * i + k] / a[COLUMNS * k + k]
            if factor != 0.0:
                for j in range(k, n):
                    a[COLUMNS * i + j] -= factor * a[COLUMNS * k + j]
                a[COLUMNS * i + COLUMN_RIGHT] -= factor * a[COLUMNS * k + COLUMN_RIGHT]
    for k in range(n - 1, -1, -1):
        factor = a[COLUMNS * k + COLUMN_RIGHT]
        for j in range(k + 1, n):
            factor -= a[COLUMNS * k + j] * x[j]
        x[k] = factor / a[COLUMNS * k + k]
    return True
