"""The torques of additional terms, evaluated at every stage of the body's integration (EQUATIONS 12).

A term is a row of numbers: form, place, up to four parameters. The forms' formulas stand here and nowhere else;
plant/terms.py names them, their parameters and limits, and builds the rows from a model file.

With w the rate and q the angle at the place (joints: as the joint sensor measures; motors: over the gear), s the
stretch of a cable (motor less joint), I K G the drive torque, G the gear, epsilon the friction smoothing:

    STRIBECK      -p0 exp(-(w / p1)^2) tanh(w / epsilon)
    COULOMB       -p0 tanh(w / epsilon)
    VISCOUS       -p0 w
    DIRECTION     -p0 |tanh(w / epsilon)| - p1 |w|          friction that differs between the directions
    DRAG          -p0 w |w|
    SPRING        -(p0 x + p1 x^2 + p2 x^3), x = q - p3
    COGGING       p0 sin(p1 G q + p2)                       periods per turn of the rotor
    COMMUTATION   p0 (G K I) sin(p1 G q + p2)
    TURN          p0 sin(p1 q + p2)                         periods per turn of the joint
    STIFFENING    p0 s^3 on the joint, the opposite on the motor; so the next three
    BACKLASH      -p1 clip(s, -p0, p0)                      p1: stiffness of the cable, taken away inside the gap
    SLACK         -p0 s where s < 0                         a cable that cannot push
    CABLE_DAMPING p0 ds/dt
"""

import array

import cython

if not cython.compiled:
    from math import exp, sin

    from ranger_sim.plant.friction import smoothed_sign

STRIBECK = 0
COULOMB = 1
VISCOUS = 2
DIRECTION = 3
DRAG = 4
SPRING = 5
COGGING = 6
COMMUTATION = 7
TURN = 8
STIFFENING = 9
BACKLASH = 10
SLACK = 11
CABLE_DAMPING = 12

# Places of a torque; the hip's motor and joint share an angle but not the gear of periodic terms.
HIP_JOINT = 0
HIP_MOTOR = 1
OUTER_ANKLE = 2
OUTER_MOTOR = 3
INNER_ANKLE = 4
INNER_MOTOR = 5
OUTER_CABLE = 6
INNER_CABLE = 7


class TermTorques:
    """Rows of terms. `zero_rad`: joint angle of an ankle whose relative angle is 0 in the body's coordinates."""

    def __init__(self, zero_rad, hip_gear, ankle_gear, smoothing_rad_s) -> None:
        self.count = 0
        self.zero_rad = zero_rad
        self.hip_gear = hip_gear
        self.ankle_gear = ankle_gear
        self.inverse_smoothing = 1.0 / smoothing_rad_s
        self.forms = array.array("q")
        self.places = array.array("q")
        self.parameters = array.array("d")

    def add(self, form, place, parameters) -> None:
        """Append a row; `parameters`: up to four numbers."""
        four = list(parameters) + [0.0] * (4 - len(parameters))
        forms = array.array("q", self.forms)
        places = array.array("q", self.places)
        numbers = array.array("d", self.parameters)
        forms.append(form)
        places.append(place)
        numbers.extend(four)
        self.forms = forms
        self.places = places
        self.parameters = numbers
        self.count += 1

    def torque(
        self,
        i: cython.longlong,
        q: cython.double,
        w: cython.double,
        gear: cython.double,
        drive: cython.double,
    ) -> cython.double:
        """Torque (N m) of row i at an angle (rad), rate (rad/s) and drive torque; cables: q stretch, w its rate."""
        form: cython.longlong = self.forms[i]
        p0: cython.double = self.parameters[4 * i]
        p1: cython.double = self.parameters[4 * i + 1]
        p2: cython.double = self.parameters[4 * i + 2]
        x: cython.double
        y: cython.double
        if form == 0:
            x = w / p1
            return -p0 * exp(-x * x) * smoothed_sign(w * self.inverse_smoothing)
        if form == 1:
            return -p0 * smoothed_sign(w * self.inverse_smoothing)
        if form == 2:
            return -p0 * w
        if form == 3:
            x = smoothed_sign(w * self.inverse_smoothing)
            y = w
            if x < 0.0:
                x = -x
            if y < 0.0:
                y = -y
            return -p0 * x - p1 * y
        if form == 4:
            return -p0 * w * (w if w > 0.0 else -w)
        if form == 5:
            x = q - self.parameters[4 * i + 3]
            return -x * (p0 + x * (p1 + x * p2))
        if form == 6:
            return p0 * sin(p1 * gear * q + p2)
        if form == 7:
            return p0 * drive * sin(p1 * gear * q + p2)
        if form == 8:
            return p0 * sin(p1 * q + p2)
        if form == 9:
            return p0 * q * q * q
        if form == 10:
            x = q
            if x > p0:
                x = p0
            elif x < -p0:
                x = -p0
            return -p1 * x
        if form == 11:
            return -p0 * q if q < 0.0 else 0.0
        return p0 * w

    def joint_torques(
        self,
        body: object,
        h: cython.double,
        h_rate: cython.double,
        outer: cython.double,
        outer_rate: cython.double,
        inner: cython.double,
        inner_rate: cython.double,
        outer_motor: cython.double,
        outer_motor_rate: cython.double,
        inner_motor: cython.double,
        inner_motor_rate: cython.double,
    ) -> cython.void:
        """Set the body's five additional torques (N m) for these angles (rad) and rates (rad/s).

        Angles of ankles and ankle motors come relative to the body's zero.
        """
        i: cython.longlong
        place: cython.longlong
        T: cython.double
        zero: cython.double = self.zero_rad
        hip: cython.double = 0.0
        outer_T: cython.double = 0.0
        inner_T: cython.double = 0.0
        outer_motor_T: cython.double = 0.0
        inner_motor_T: cython.double = 0.0
        hip_drive: cython.double = body.hip_drive
        outer_drive: cython.double = body.outer_drive
        inner_drive: cython.double = body.inner_drive
        for i in range(self.count):
            place = self.places[i]
            if place == 0:
                hip += self.torque(i, h, h_rate, 1.0, hip_drive)
            elif place == 1:
                hip += self.torque(i, h, h_rate, self.hip_gear, hip_drive)
            elif place == 2:
                outer_T += self.torque(i, outer + zero, outer_rate, 1.0, outer_drive)
            elif place == 3:
                outer_motor_T += self.torque(i, outer_motor + zero, outer_motor_rate, self.ankle_gear, outer_drive)
            elif place == 4:
                inner_T += self.torque(i, inner + zero, inner_rate, 1.0, inner_drive)
            elif place == 5:
                inner_motor_T += self.torque(i, inner_motor + zero, inner_motor_rate, self.ankle_gear, inner_drive)
            elif place == 6:
                T = self.torque(i, outer_motor - outer, outer_motor_rate - outer_rate, 1.0, outer_drive)
                outer_T += T
                outer_motor_T -= T
            else:
                T = self.torque(i, inner_motor - inner, inner_motor_rate - inner_rate, 1.0, inner_drive)
                inner_T += T
                inner_motor_T -= T
        body.extra_hip = hip
        body.extra_outer = outer_T
        body.extra_inner = inner_T
        body.extra_outer_motor = outer_motor_T
        body.extra_inner_motor = inner_motor_T
