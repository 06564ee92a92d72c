"""The main brain's program on the bare body: ideal current sources and sensors, no boards, no buses.

What the motor boards do is condensed to the compliant law at 2 kHz with the robot's clips; a foot's
contact voltage rises 11 ms after touchdown, so that the second sample in a row above the threshold comes
14 ms after it (robot.md W4: seen in the sample at 12 or at 14 ms).
"""

import math

from ranger_sim.boards.main_brain import controllers
from ranger_sim.boards.main_brain.estimator import Estimator
from ranger_sim.boards.main_brain.mode_machine import ModeMachine
from ranger_sim.boards.quirks import Quirks
from ranger_sim.datatable.generated import mb as table
from ranger_sim.datatable.generated.all_variables import TABLE_SIZE
from ranger_sim.datatable.store import DataStore
from ranger_sim.plant.mechanics.body import DOUBLE, FALLEN, HELD, SINGLE, Body
from ranger_sim.plant.walking import handling
from ranger_sim.plant.walking.motion import advance

STEP_S = 0.0005
BATTERY_V = 25.9
MOTOR_CONSTANT = 0.018  # V s/rad
RESISTANCE = 1.34  # ohm, with the series inductor
CONTACT_DROP = 0.7  # V
ENCODER_RAD = 2.0 * math.pi / 8192.0
SWING_COUNTS = 350.0
STANCE_COUNTS = 3500.0
CONTACT_DELAY_S = 0.011


class Joint:
    """One motor: compliant law, clips, torque, and the rate filter of its board."""

    def __init__(self, gear, low_A, high_A, duty) -> None:
        self.gear = gear
        self.low_A = low_A
        self.high_A = high_A
        self.volts = duty * BATTERY_V
        self.command = (0.0, 0.0, 0.0)
        self.current_A = 0.0
        self.power_W = 0.0
        self.filtered_rate = 0.0

    def torque(self, position, rate):
        """drive and Coulomb parts of the joint torque, N m."""
        constant, stiffness, dampness = self.command
        current = min(max(constant - stiffness * position - dampness * rate, self.low_A), self.high_A)
        back = MOTOR_CONSTANT * self.gear * rate
        current = min(current, max(0.0, (self.volts - CONTACT_DROP - back) / RESISTANCE))
        current = max(current, min(0.0, (-self.volts + CONTACT_DROP - back) / RESISTANCE))
        drop = CONTACT_DROP if current > 0.0 else -CONTACT_DROP
        self.current_A = current
        self.power_W = max(0.0, (current * RESISTANCE + drop + back) * current)
        drive = MOTOR_CONSTANT * self.gear * current
        return drive, 0.1 + 0.1 * abs(drive)

    def filter_rate(self, rate) -> None:
        self.filtered_rate += (rate - self.filtered_rate) / 16.0


class BareRobot:
    """`step()` is one slot of the main brain (2 ms). `store`, `estimator`, `modes`, `body` are open to tests."""

    def __init__(self, controller="robust", body_parameters=None, floor=None, gyro_bias=-0.004, quirks=None) -> None:
        loaded = isinstance(controller, controllers.Controller)
        self.controller = controller if loaded else controllers.load(controller)
        # the feet of the body that stands here unless another is given
        quirks = quirks if quirks is not None else Quirks(estimator_feet="appendix")
        self.store = DataStore(TABLE_SIZE)
        self.controller.apply(self.store)
        self.errors = []
        self.estimator = Estimator(self.store, quirks, self.errors.append)
        self.modes = ModeMachine(self.store, quirks, self.estimator, self.controller.program)
        self.body = Body(body_parameters, floor)
        self.gyro_bias = gyro_bias
        self.hip = Joint(66.0, -4.0, 4.0, 0.417)
        self.outer = Joint(34.0, -1.0, 6.0, 0.5)
        self.inner = Joint(34.0, -1.0, 6.0, 0.5)
        self.time_s = 0.0
        self.slots = 0
        self.touchdown_s = [None, None]
        self.motor_energy_J = 0.0
        operator = self.controller.operator
        body = self.body
        handling.place(body, operator.lean_rad, operator.hip_angle_rad)
        body.outer.motor_angle = operator.outer_ankle_rad - 1.68
        body.inner.motor_angle = operator.inner_ankle_rad - 1.68
        body.outer.foot_angle = body.outer.angle + body.outer.motor_angle
        body.inner.foot_angle = body.inner.angle + body.inner.motor_angle
        body.update_pose()
        handling.hold_standing(body, operator.lean_rad, operator.hip_angle_rad)

    def set_ids(self, **values) -> None:
        for name, value in values.items():
            self.store.set_float(getattr(table, name), value)

    def contact(self, leg):
        """Counts of both sensors of a leg pair."""
        body = self.body
        standing = body.mode == DOUBLE or (body.mode == SINGLE and body.stance.side == leg)
        if not standing:
            self.touchdown_s[leg] = None
            return SWING_COUNTS
        if self.touchdown_s[leg] is None:
            self.touchdown_s[leg] = self.time_s
        return STANCE_COUNTS if self.time_s - self.touchdown_s[leg] >= CONTACT_DELAY_S - 1e-9 else SWING_COUNTS

    def sense(self) -> None:
        body = self.body
        ms = round(self.time_s * 1000.0) + 1
        self.store.set_word(table.TIMESTAMP, ms, ms)
        outer_counts = self.contact(0)
        inner_counts = self.contact(1)
        self.set_ids(
            MCH_ANGLE=round(body.hip_angle() / ENCODER_RAD) * ENCODER_RAD,
            MCH_ANG_RATE=self.hip.filtered_rate,
            MCH_MOTOR_VELOCITY=self.hip.filtered_rate,
            MCFO_RIGHT_ANKLE_ANGLE=round((1.68 + body.outer.foot_angle - body.outer.angle) / ENCODER_RAD) * ENCODER_RAD,
            MCFI_MID_ANKLE_ANGLE=round((1.68 + body.inner.foot_angle - body.inner.angle) / ENCODER_RAD) * ENCODER_RAD,
            MCFO_RIGHT_ANKLE_RATE=self.outer.filtered_rate,
            MCFI_ANKLE_RATE=self.inner.filtered_rate,
            MCFO_MOTOR_POSITION=1.68 + body.outer.motor_angle,
            MCFI_MOTOR_POSITION=1.68 + body.inner.motor_angle,
            MCFO_LEFT_HEEL_SENSE=outer_counts,
            MCFO_RIGHT_HEEL_SENSE=outer_counts,
            MCFI_LEFT_HEEL_SENSE=inner_counts,
            MCFI_RIGHT_HEEL_SENSE=inner_counts,
            UI_ANG_RATE_X=self.gyro_bias - body.outer.rate,
            MCH_BATT_POWER=self.hip.power_W,
            MCFO_BATT_POWER=self.outer.power_W,
            MCFI_BATT_POWER=self.inner.power_W,
        )

    def step(self) -> None:
        body = self.body
        store = self.store
        self.sense()
        self.estimator.update()
        self.modes.update()
        for joint, prefix in ((self.hip, "MCH"), (self.outer, "MCFO"), (self.inner, "MCFI")):
            joint.command = tuple(
                store.get_float(getattr(table, f"{prefix}_{word}"))
                for word in ("COMMAND_CURRENT", "STIFFNESS", "DAMPNESS")
            )
        for part in range(4):
            body.step_start_ns = self.slots * 2_000_000 + part * 500_000
            body.hip.drive, body.hip.coulomb = self.hip.torque(body.hip_angle(), body.hip_rate())
            for joint, leg in ((self.outer, body.outer), (self.inner, body.inner)):
                leg.drive, leg.coulomb = joint.torque(1.68 + leg.motor_angle, leg.motor_rate)
            body.hip.viscous = body.outer.viscous = body.inner.viscous = 0.01
            advance(body, STEP_S)
            self.hip.filter_rate(body.hip_rate())
            self.outer.filter_rate(body.outer.foot_rate - body.outer.rate)
            self.inner.filter_rate(body.inner.foot_rate - body.inner.rate)
            if body.mode not in (HELD, FALLEN):
                self.motor_energy_J += STEP_S * (self.hip.power_W + self.outer.power_W + self.inner.power_W)
        self.slots += 1
        self.time_s = self.slots * 0.002

    def start(self) -> None:
        """The operator's script: hold, keys, release."""
        operator = self.controller.operator
        while self.time_s < operator.release_time_s - 1e-9:
            self.store.set_int(
                table.UI_BUTTONS,
                sum(1 << k.key for k in operator.keys if k.time_s <= self.time_s < k.time_s + k.hold_s),
            )
            self.step()
        handling.release(self.body, operator.release_rate_rad_per_s)

    def walk(self, steps, limit_s) -> bool:
        """Walk until so many steps; False when the robot fell or the time was up."""
        end = self.time_s + limit_s
        while self.body.record.steps < steps and self.time_s < end and self.body.mode != FALLEN:
            self.step()
        return self.body.record.steps >= steps
