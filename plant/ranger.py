"""The physical robot in one object: body, motors, battery, sensors, steering, floor; 250 us a step.

A step in order (EQUATIONS 15): currents of the motors at the rates of its middle, in closed form; the body under
their mean torques, events located inside; steering; then all signals to the boards, as straight lines between start and
end of the step, and every encoder edge with its time.

Seen from the boards: `motors` with their drives, `encoders` with their edges, `analog_start` and `analog_end`,
`words`, `imu`. Seen from outside: `body`, `record`, `steering`, and the few fields a harness reads every step.
"""

import cython
import numpy as np

from ranger_sim.plant.electrics.electrics import Electrics
from ranger_sim.plant.electrics.motor_unit import MotorUnit
from ranger_sim.plant.mechanics.body import FALLEN, Body
from ranger_sim.plant.mechanics.floor import Floor
from ranger_sim.plant.mechanics.leg import INNER, OUTER, Leg
from ranger_sim.plant.mechanics.parameters import BodyParameters
from ranger_sim.plant.mechanics.steering import Steering
from ranger_sim.plant.mechanics.walk_record import RING
from ranger_sim.plant.plant import Plant
from ranger_sim.plant.sensors.absolute_encoder import AbsoluteEncoder
from ranger_sim.plant.sensors.imu import Imu
from ranger_sim.plant.sensors.incremental_encoder import IncrementalEncoder
from ranger_sim.plant.walking import handling
from ranger_sim.plant.walking.motion import advance
from ranger_sim.plant.walking.watch import fall
from ranger_sim.plant.wiring_points import HIP_WORD, INNER_ANKLE_WORD, OUTER_ANKLE_WORD

STEP_NS = 250_000  # the plant's step; its error is measured in EQUATIONS 15

# What `fill_sample` writes, in this order: name and unit.
SAMPLES = {
    "hip_x_m": "m",
    "hip_y_m": "m",
    "foot_outer_rad": "rad",
    "leg_outer_rad": "rad",
    "leg_inner_rad": "rad",
    "foot_inner_rad": "rad",
    "leg_outer_rad_s": "rad/s",
    "leg_inner_rad_s": "rad/s",
    "hip_rad": "rad",
    "hip_rad_s": "rad/s",
    "ankle_outer_rad": "rad",
    "motor_outer_rad": "rad",
    "ankle_inner_rad": "rad",
    "motor_inner_rad": "rad",
    "motor_outer_rad_s": "rad/s",
    "motor_inner_rad_s": "rad/s",
    "outer_Fx_N": "N",
    "outer_Fy_N": "N",
    "inner_Fx_N": "N",
    "inner_Fy_N": "N",
    "hip_A": "A",
    "outer_A": "A",
    "inner_A": "A",
    "steering_A": "A",
    "hip_W": "W",
    "outer_W": "W",
    "inner_W": "W",
    "steering_W": "W",
    "battery_V": "V",
    "battery_A": "A",
    "twist_rad": "rad",
    "yaw_rad": "rad",
    "path_x_m": "m",
    "path_y_m": "m",
    "mode": "",
    "steps": "",
}


# Share of the hip joint's edges that bounce: the joint's encoder interpolates 2048 lines from a magnet, and the hip
# board reported glitches of it in 37 to 83 % of the logs' cycles (robot.md T3). The share is chosen by us, for a few a
# second.
HIP_BOUNCE = 0.01


@cython.final
@cython.cclass
class RangerPlant(Plant):
    """The robot's physics. `seed`: of every noise and foothold; `model_file`: additional named terms (plant/terms.py).

    `parameters`: BodyParameters, `electrics`: ElectricsParameters, `floor`: Floor (built from slope and roughness
    when None). `start_ns`: virtual time at power-up.
    """

    # fields read at every step come first, next to each other
    changes: cython.longlong
    step_s: cython.double
    zero: cython.double
    body: Body
    electrics: Electrics
    steering: Steering
    hip: MotorUnit
    outer_ankle: MotorUnit
    inner_ankle: MotorUnit
    steering_motor: MotorUnit
    hip_joint: IncrementalEncoder
    hip_motor: IncrementalEncoder
    outer_motor: IncrementalEncoder
    outer_joint: IncrementalEncoder
    inner_motor: IncrementalEncoder
    inner_joint: IncrementalEncoder
    hip_word: AbsoluteEncoder
    outer_word: AbsoluteEncoder
    inner_word: AbsoluteEncoder
    imu: Imu
    jumped: cython.bint
    strike_time_ns: cython.longlong
    lift_off_time_ns: cython.longlong
    step_length_m: cython.double
    motors: list
    parameters: object
    floor: object
    record: object
    model_file: object

    def __init__(
        self,
        seed=0,
        slope_rad=0.0,
        floor_roughness_m=0.0,
        model_file=None,
        start_ns=0,
        parameters=None,
        electrics=None,
        floor=None,
    ) -> None:
        Plant.__init__(self, STEP_NS, start_ns, words=3, samples=SAMPLES)
        self.parameters = parameters if parameters is not None else BodyParameters()
        self.floor = floor if floor is not None else Floor(slope_rad, floor_roughness_m, seed)
        self.body = Body(self.parameters, self.floor)
        self.electrics = Electrics(electrics, seed)
        self.hip = self.electrics.hip
        self.outer_ankle = self.electrics.outer_ankle
        self.inner_ankle = self.electrics.inner_ankle
        self.steering_motor = self.electrics.steering
        self.motors = [self.hip, self.outer_ankle, self.inner_ankle, self.steering_motor]
        self.bridges = [motor.drive for motor in self.motors]
        self.steering = Steering(self.steering_motor.parameters.reflected_inertia_kg_m2)
        self.record = self.body.record
        self.step_s = STEP_NS * 1e-9
        self.zero = self.parameters.ankle_zero_rad

        # Lines, gears and senses of the encoders: robot.md N4.1; the outer feet's are mirrored.
        self.hip_joint = IncrementalEncoder("hip_joint", 2048, bounce=HIP_BOUNCE, seed=seed)
        self.hip_motor = IncrementalEncoder("hip_motor", 192, self.parameters.hip_gear, seed=seed)
        self.outer_motor = IncrementalEncoder("outer_motor", 512, self.parameters.ankle_gear, -1, seed=seed)
        self.outer_joint = IncrementalEncoder("outer_ankle", 2048, 1.0, -1, seed=seed)
        self.inner_motor = IncrementalEncoder("inner_motor", 512, self.parameters.ankle_gear, seed=seed)
        self.inner_joint = IncrementalEncoder("inner_ankle", 2048, seed=seed)
        self.encoders = [
            self.hip_joint,
            self.hip_motor,
            self.outer_motor,
            self.outer_joint,
            self.inner_motor,
            self.inner_joint,
        ]
        # Zeros: robot.md N4.7.
        self.hip_word = AbsoluteEncoder("hip", 4590, 1, seed=seed)
        self.outer_word = AbsoluteEncoder("outer_ankle", 6562, -1, seed=seed)
        self.inner_word = AbsoluteEncoder("inner_ankle", 1572, 1, seed=seed)
        self.imu = Imu(seed, phase_ns=start_ns)
        self.analog_start = self.electrics.analog_start
        self.analog_end = self.electrics.analog_end

        # the walk, as a harness reads it every step
        self.strike_time_ns = start_ns
        self.lift_off_time_ns = -1
        self.step_length_m = 0.0
        self.changes = 0
        self.jumped = True  # rates at the start of the next step do not continue those of the last one
        self.model_file = model_file
        if model_file is not None:
            from ranger_sim.plant import terms

            terms.load(model_file).apply(self)
        self._settle()

    # ---- actions of the operator ------------------------------------------------------------------------------

    @cython.ccall
    @cython.exceptval(check=True)
    def hold(
        self,
        stance: object = "outer",
        lean_rad: cython.double = 0.0,
        hip_angle_rad: cython.double = 0.3,
        outer_ankle_rad: cython.double = 1.68,
        inner_ankle_rad: cython.double = 1.68,
        lifted: cython.bint = False,
    ) -> cython.void:
        """Put the robot in this pose and keep its legs there; feet and motors are free.

        stance: "outer" or "inner", the legs that carry the robot's weight, or hang when `lifted`; lean_rad:
        theirs, forward; hip_angle_rad: inner legs ahead; ankle angles as the joints measure them, motors alike.
        """
        b: Body = self.body
        outer: cython.double = lean_rad if stance == "outer" else lean_rad + hip_angle_rad
        handling.place(b, outer, hip_angle_rad)
        b.outer.motor_angle = outer_ankle_rad - self.zero
        b.inner.motor_angle = inner_ankle_rad - self.zero
        b.outer.foot_angle = outer + b.outer.motor_angle
        b.inner.foot_angle = outer - hip_angle_rad + b.inner.motor_angle
        if lifted:
            handling.hold_both(b, outer, hip_angle_rad)
        else:
            handling.hold_standing(b, outer, hip_angle_rad, OUTER if stance == "outer" else INNER)
        self._settle()

    @cython.ccall
    @cython.exceptval(check=True)
    def release(self, rate_rad_s: cython.double, hip_rate_rad_s: cython.double = 0.0) -> cython.void:
        """Let go at this rate of the legs, forward; the standing foot rolls along with its ankle at rest."""
        b: Body = self.body
        b.step_start_ns = self.time_ns
        b.elapsed = 0.0
        handling.release(b, rate_rad_s, b.stance.side, rate_rad_s, hip_rate_rad_s)
        self.begin()

    @cython.ccall
    @cython.exceptval(check=True)
    def begin(self) -> cython.void:
        """Reset everything that counts from the robot's release."""
        for motor in self.motors:
            motor.drawn_before_J = motor.drawn_J
        self.steering.begin(self.body.hip_x)
        self._note()

    @cython.ccall
    @cython.exceptval(check=True)
    def _settle(self) -> cython.void:
        """Settle the sensors, as if the robot had been in this state for a long time."""
        b: Body = self.body
        o: Leg = b.outer
        i: Leg = b.inner
        self.jumped = True
        h: cython.double = o.angle - i.angle
        outer: cython.double = o.foot_angle - o.angle + self.zero
        inner: cython.double = i.foot_angle - i.angle + self.zero
        self.hip_joint.reset(h)
        self.hip_motor.reset(h)
        self.outer_motor.reset(o.motor_angle + self.zero)
        self.outer_joint.reset(outer)
        self.inner_motor.reset(i.motor_angle + self.zero)
        self.inner_joint.reset(inner)
        self.words[HIP_WORD] = self.hip_word.word(h)
        self.words[OUTER_ANKLE_WORD] = self.outer_word.word(outer)
        self.words[INNER_ANKLE_WORD] = self.inner_word.word(inner)
        self.electrics.settle(o.Fy > 0.0, o.Fy, i.Fy > 0.0, i.Fy, self.steering.twist)

    # ---- passing time -----------------------------------------------------------------------------------------

    def step(self) -> None:
        """Integrate over [time_ns, time_ns + step_ns]; sensors then show this step."""
        b: Body = self.body
        o: Leg = b.outer
        i: Leg = b.inner
        e: Electrics = self.electrics
        s: Steering = self.steering
        motor: MotorUnit
        h: cython.double = self.step_s
        zero: cython.double = self.zero
        t0: cython.longlong = self.time_ns
        t1: cython.longlong = t0 + self.step_ns
        lean0: cython.double = o.angle
        lean0_rate: cython.double = o.rate
        h0: cython.double = lean0 - i.angle
        h0_rate: cython.double = lean0_rate - i.rate
        p0: cython.double = o.motor_angle + zero
        p0_rate: cython.double = o.motor_rate
        n0: cython.double = i.motor_angle + zero
        n0_rate: cython.double = i.motor_rate
        o0: cython.double = o.foot_angle - lean0 + zero
        o0_rate: cython.double = o.foot_rate - lean0_rate
        i0: cython.double = i.foot_angle - i.angle + zero
        i0_rate: cython.double = i.foot_rate - i.rate
        lean1: cython.double
        lean1_rate: cython.double
        h1: cython.double
        h1_rate: cython.double
        o1: cython.double
        i1: cython.double
        outer_stands: cython.bint
        inner_stands: cython.bint
        yaw0: cython.double = s.yaw

        if e.has_ripple:
            e.turn_motors(t0, t1, h0, p0, n0, h0_rate, p0_rate, n0_rate)
        e.step_motors(t0, t1, h0_rate, p0_rate, n0_rate, s.rate, self.jumped)
        if e.battery.cut_off and b.mode != FALLEN:
            # neither motors nor computers have power: the walk ends here, before the robot falls because of it
            b.step_start_ns = t0
            b.elapsed = 0.0
            fall(b, "battery empty" if e.battery.charge <= 0.0 else "battery protection opened")
        self.jumped = False
        motor = self.hip
        b.hip.drive = motor.drive_Nm
        b.hip.coulomb = motor.coulomb_Nm
        b.hip.viscous = motor.viscous_Nms
        motor = self.outer_ankle
        o.drive = motor.drive_Nm
        o.coulomb = motor.coulomb_Nm
        o.viscous = motor.viscous_Nms
        motor = self.inner_ankle
        i.drive = motor.drive_Nm
        i.coulomb = motor.coulomb_Nm
        i.viscous = motor.viscous_Nms

        b.step_start_ns = t0
        advance(b, h)

        outer_stands = b.stands(o)
        inner_stands = b.stands(i)
        motor = self.steering_motor
        s.advance(
            h,
            motor.drive_Nm,
            motor.coulomb_Nm,
            motor.viscous_Nms,
            motor.inverse_smoothing,
            outer_stands,
            inner_stands,
            b.hip_x,
        )

        self.time_ns = t1
        lean1 = o.angle
        lean1_rate = o.rate
        h1 = lean1 - i.angle
        h1_rate = lean1_rate - i.rate
        o1 = o.foot_angle - lean1 + zero
        i1 = i.foot_angle - i.angle + zero
        self.hip_joint.update(t0, t1, h0, h0_rate, h1, h1_rate)
        if self.hip_joint.edges.count > 0:
            self.hip_joint.add_bounces(t1)
        self.hip_motor.update(t0, t1, h0, h0_rate, h1, h1_rate)
        self.outer_motor.update(t0, t1, p0, p0_rate, o.motor_angle + zero, o.motor_rate)
        self.outer_joint.update(t0, t1, o0, o0_rate, o1, o.foot_rate - lean1_rate)
        self.inner_motor.update(t0, t1, n0, n0_rate, i.motor_angle + zero, i.motor_rate)
        self.inner_joint.update(t0, t1, i0, i0_rate, i1, i.foot_rate - i.rate)
        self.words[HIP_WORD] = self.hip_word.word(h1, h)
        self.words[OUTER_ANKLE_WORD] = self.outer_word.word(o1, h)
        self.words[INNER_ANKLE_WORD] = self.inner_word.word(i1, h)
        if self.imu.is_due(t1):
            self.imu.update(t0, t1, lean0, lean0_rate, lean1, lean1_rate, s.yaw, (s.yaw - yaw0) / h)
        e.sense(t0, t1, outer_stands, o.Fy, inner_stands, i.Fy, s.twist)
        if b.changes != self.changes:
            self._note()

    @cython.ccall
    def _note(self) -> None:
        """Copy the fields that a harness reads every step from the record; only after an event."""
        r = self.record
        self.changes = self.body.changes
        self.jumped = True
        self.steps = r.steps
        self.strike_time_ns = r.strike_time_ns
        self.lift_off_time_ns = r.lift_off_time_ns
        self.step_length_m = r.step_length_m
        self.distance_m = r.distance_m
        self.fell = r.fell
        self.fall_cause = r.fall_cause

    # ---- looking from outside ---------------------------------------------------------------------------------

    def encoder_rad(self, number) -> float:
        """Angle of a joint, or as seen from its motor's shaft."""
        body = self.body
        if self.encoders[number] in (self.hip_joint, self.hip_motor):
            return body.outer.angle - body.inner.angle
        leg = body.outer if self.encoders[number] in (self.outer_motor, self.outer_joint) else body.inner
        if self.encoders[number] in (self.outer_motor, self.inner_motor):
            return leg.motor_angle + self.zero
        return leg.foot_angle - leg.angle + self.zero

    def word_rad(self, number) -> float:
        """The angle (rad) that absolute encoder `number` measures now."""
        if number == HIP_WORD:
            return self.body.outer.angle - self.body.inner.angle
        leg = self.body.outer if number == OUTER_ANKLE_WORD else self.body.inner
        return leg.foot_angle - leg.angle + self.zero

    def analog_line(self, number) -> tuple[float, float, float]:
        electrics = self.electrics
        return electrics.zero_V[number], electrics.slope_V[number], electrics.noise_V[number]

    def analog_value(self, number) -> float:
        return self.electrics.values[number]

    def fill_sample(self, row: cython.double[::1]) -> object:
        """Write the values named in SAMPLES."""
        b: Body = self.body
        o: Leg = b.outer
        i: Leg = b.inner
        s: Steering = self.steering
        V: cython.double = self.electrics.battery.voltage_V
        place: cython.longlong
        values: cython.double[36] = [
            b.hip_x,
            b.hip_y,
            o.foot_angle,
            o.angle,
            i.angle,
            i.foot_angle,
            o.rate,
            i.rate,
            o.angle - i.angle,
            o.rate - i.rate,
            o.foot_angle - o.angle + self.zero,
            o.motor_angle + self.zero,
            i.foot_angle - i.angle + self.zero,
            i.motor_angle + self.zero,
            o.motor_rate,
            i.motor_rate,
            o.Fx,
            o.Fy,
            i.Fx,
            i.Fy,
            self.hip.current_A,
            self.outer_ankle.current_A,
            self.inner_ankle.current_A,
            self.steering_motor.current_A,
            V * self.hip.battery_current_A,
            V * self.outer_ankle.battery_current_A,
            V * self.inner_ankle.battery_current_A,
            V * self.steering_motor.battery_current_A,
            V,
            self.electrics.battery.current_A,
            s.twist,
            s.yaw,
            s.path_x,
            s.path_y,
            b.mode,
            self.steps,
        ]
        for place in range(36):
            row[place] = values[place]
        return None

    @property
    def electronics_power_W(self):
        """Power of computers and sensors at the battery."""
        return self.electrics.electronics_W

    @property
    def battery_V(self):
        """Terminal voltage now."""
        return self.electrics.battery.voltage_V

    def geometry(self):
        """Data for a drawing: lengths in m, angles in rad."""
        p = self.parameters
        return {
            "leg": p.leg_length_m,
            "radius": {"outer": p.outer_foot_radius_m, "inner": p.inner_foot_radius_m},
            "eccentricity": {"outer": p.outer_ankle_offset_m, "inner": p.inner_ankle_offset_m},
            "heel": p.arc_heel_rad,
            "toe": p.arc_toe_rad,
            "slope": self.floor.slope_rad,
        }

    def recent_steps(self):
        """(number from 1, length m, time s, onto the outer feet) of the last steps, numpy arrays, oldest first."""
        r = self.record
        kept = min(r.steps, RING)
        number = np.arange(r.steps - kept + 1, r.steps + 1)
        at = (number - 1) % RING
        length = np.asarray(r.strike_lengths_m, dtype=float)[at]
        seconds = np.asarray(r.strike_durations_ns, dtype=np.int64)[at] * 1e-9
        outer = np.asarray(r.strike_legs, dtype=np.int64)[at] == OUTER
        return number, length, seconds, outer

    def recent_footholds(self):
        """[{x, height}] of the last footholds in m, oldest first."""
        r = self.record
        kept = min(r.steps, RING)
        return [
            {"x": r.strike_xs_m[n % RING], "height": r.strike_heights_m[n % RING]}
            for n in range(r.steps - kept, r.steps)
        ]
