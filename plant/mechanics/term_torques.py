"""The torques of additional terms, evaluated at every stage of the body's integration (EQUATIONS 12).

A term is a row of numbers: form, place, up to four parameters. The forms' formulas are only in this file;
plant/terms.py names them, their parameters and limits, and builds the rows from a model file.

With w the rate and q the angle at the place (joints: as the joint sensor measures; motors: over the gear), s the
stretch of a cable (motor less joint), G the gear, epsilon the friction smoothing:

    STRIBECK      -p0 exp(-(w / p1)^2) tanh(w / epsilon)
    COULOMB       -p0 tanh(w / epsilon)
    VISCOUS       -p0 w
    DIRECTION     -p0 |tanh(w / epsilon)| - p1 |w|          friction that differs between the directions
    DRAG          -p0 w |w|
    SPRING        -(p0 x + p1 x^2 + p2 x^3), x = q - p3
    COGGING       p0 sin(p1 G q + p2)                       periods per turn of the rotor
    TURN          p0 sin(p1 q + p2)                         periods per turn of the joint
    STIFFENING    p0 s^3 on the joint, the opposite on the motor; so the next three
    BACKLASH      -p1 clip(s, -p0, p0)                      p1: stiffness of the cable, taken away inside the gap
    SLACK         -p0 s where s < 0                         a cable that cannot push
    CABLE_DAMPING p0 ds/dt
"""

import array
from typing import TYPE_CHECKING, Final

import cython
from cython.cimports.libc.math import exp, sin

from ranger_sim.plant.mechanics.friction import smoothed_sign

if TYPE_CHECKING:
    from ranger_sim.plant.mechanics.leg import Leg

# forms
STRIBECK: Final = 0
COULOMB: Final = 1
VISCOUS: Final = 2
DIRECTION: Final = 3
DRAG: Final = 4
SPRING: Final = 5
COGGING: Final = 6
TURN: Final = 7
STIFFENING: Final = 8
BACKLASH: Final = 9
SLACK: Final = 10
CABLE_DAMPING: Final = 11
# Places of a torque; the hip's motor and joint share an angle but not the gear of periodic terms.
HIP_JOINT: Final = 0
HIP_MOTOR: Final = 1
ANKLE_JOINT: Final = 2
ANKLE_MOTOR: Final = 3
ANKLE_CABLE: Final = 4


@cython.final
@cython.cclass
class TermTorques:
    """Rows of terms. `zero_rad`: joint angle of an ankle whose relative angle is 0 in the body's coordinates."""

    count: cython.longlong
    zero_rad: cython.double
    hip_gear: cython.double
    ankle_gear: cython.double
    inverse_smoothing: cython.double
    forms: cython.longlong[::1]
    places: cython.longlong[::1]
    sides: cython.longlong[::1]
    parameters: cython.double[::1]

    def __init__(self, zero_rad, hip_gear, ankle_gear, smoothing_rad_s) -> None:
        self.count = 0
        self.zero_rad = zero_rad
        self.hip_gear = hip_gear
        self.ankle_gear = ankle_gear
        self.inverse_smoothing = 1.0 / smoothing_rad_s
        self.forms = array.array("q")
        self.places = array.array("q")
        self.sides = array.array("q")  # OUTER or INNER, of places at an ankle
        self.parameters = array.array("d")

    def add(self, form, place, side, parameters) -> None:
        """Append a row. `side`: the leg of an ankle's place, any number for the hip's; `parameters`: up to four."""
        four = list(parameters) + [0.0] * (4 - len(parameters))
        forms = array.array("q", self.forms)
        places = array.array("q", self.places)
        sides = array.array("q", self.sides)
        numbers = array.array("d", self.parameters)
        forms.append(form)
        places.append(place)
        sides.append(side)
        numbers.extend(four)
        self.forms = forms
        self.places = places
        self.sides = sides
        self.parameters = numbers
        self.count += 1

    @cython.ccall
    def torque(
        self,
        i: cython.longlong,
        q: cython.double,
        w: cython.double,
        gear: cython.double,
    ) -> cython.double:
        """Torque (N m) of row i at an angle (rad) and rate (rad/s); cables: q stretch, w its rate."""
        form: cython.longlong = self.forms[i]
        p0: cython.double = self.parameters[4 * i]
        p1: cython.double = self.parameters[4 * i + 1]
        p2: cython.double = self.parameters[4 * i + 2]
        x: cython.double
        y: cython.double
        if form == STRIBECK:
            x = w / p1
            return -p0 * exp(-x * x) * smoothed_sign(w * self.inverse_smoothing)
        if form == COULOMB:
            return -p0 * smoothed_sign(w * self.inverse_smoothing)
        if form == VISCOUS:
            return -p0 * w
        if form == DIRECTION:
            x = smoothed_sign(w * self.inverse_smoothing)
            y = w
            if x < 0.0:
                x = -x
            if y < 0.0:
                y = -y
            return -p0 * x - p1 * y
        if form == DRAG:
            return -p0 * w * (w if w > 0.0 else -w)
        if form == SPRING:
            x = q - self.parameters[4 * i + 3]
            return -x * (p0 + x * (p1 + x * p2))
        if form == COGGING:
            return p0 * sin(p1 * gear * q + p2)
        if form == TURN:
            return p0 * sin(p1 * q + p2)
        if form == STIFFENING:
            return p0 * q * q * q
        if form == BACKLASH:
            x = q
            if x > p0:
                x = p0
            elif x < -p0:
                x = -p0
            return -p1 * x
        if form == SLACK:
            return -p0 * q if q < 0.0 else 0.0
        return p0 * w

    @cython.ccall
    def torque_on_hip(self, h: cython.double, h_rate: cython.double) -> cython.double:
        """Additional torque on the hip angle h (N m), at h (rad) and its rate (rad/s)."""
        i: cython.longlong
        total: cython.double = 0.0
        for i in range(self.count):
            if self.places[i] == HIP_JOINT:
                total += self.torque(i, h, h_rate, 1.0)
            elif self.places[i] == HIP_MOTOR:
                total += self.torque(i, h, h_rate, self.hip_gear)
        return total

    @cython.ccall
    def act_on_ankle(
        self,
        leg: "Leg",
        angle: cython.double,
        rate: cython.double,
        motor: cython.double,
        motor_rate: cython.double,
    ) -> None:
        """Set the two additional torques of a leg's ankle (N m) for these angles (rad) and rates (rad/s).

        Angles of ankle and ankle motor come relative to the body's zero.
        """
        i: cython.longlong
        place: cython.longlong
        T: cython.double
        joint_T: cython.double = 0.0
        motor_T: cython.double = 0.0
        for i in range(self.count):
            place = self.places[i]
            if self.sides[i] != leg.side:
                continue
            if place == ANKLE_JOINT:
                joint_T += self.torque(i, angle + self.zero_rad, rate, 1.0)
            elif place == ANKLE_MOTOR:
                motor_T += self.torque(i, motor + self.zero_rad, motor_rate, self.ankle_gear)
            elif place == ANKLE_CABLE:
                T = self.torque(i, motor - angle, motor_rate - rate, 1.0)
                joint_T += T
                motor_T -= T
        leg.extra_ankle = joint_T
        leg.extra_motor = motor_T
