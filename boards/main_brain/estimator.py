"""The estimator: filtered rates, leg angles, heel strike, step length, distance, energy.

Source: robot.md C3.1 (the form of the record walks); runs once per 2 ms slot before the machines.
All angles in rad with the signs of robot.md C1.1: leg angles positive leaning forward, hip angle positive
with the inner legs ahead, foot angle positive rolled towards the toe.

The table holds single-precision words; inside, the estimator computes in double precision.
ROBOT PARITY: the LPC3250 computed in single precision in part; its angle integral is double here.
"""

from typing import Final

import cython
from cython.cimports.libc.math import cos

from ranger_sim.boards.main_brain.command import variables_of
from ranger_sim.boards.main_brain.filters import ButterworthFilter
from ranger_sim.boards.main_brain.geometry import FloorGeometry
from ranger_sim.datatable.generated import errors
from ranger_sim.datatable.generated import mb as table
from ranger_sim.datatable.store import DataStore

# Stages of the strike detector.
SWING_BEHIND: Final = 0
AVERAGING: Final = 1
ARMED: Final = 2
# Of FSM_RESET: the machines run.
WALKING: Final = 2

# C variables when compiled: Cython makes a Python object of every literal above 31 bits.
_MASK: cython.longlong = 4294967295
_NEWEST: cython.longlong = 2147483647
# Counts of a pair's two sensors that mean contact. The robot's of 2016 is 850, where both together have 700 in swing
# (robot.md C3.2); the emulated sensors have 700 each (plant/sensors/foot_sensor.py), so it is twice as much here.
CONTACT_SUM = 1700.0


@cython.cclass
class EnergyMeter:
    """Trapezoidal integral of one published power over its own stamps; `energy_J`, `power_W`."""

    started: cython.bint
    stamp: cython.longlong
    power_W: cython.double
    energy_J: cython.double

    def __init__(self) -> None:
        self.started = False
        self.stamp = 0
        self.power_W = 0.0
        self.energy_J = 0.0

    @cython.ccall
    def update(self, power_W: cython.double, stamp_ms: cython.longlong) -> cython.bint:
        """True when the datum was new. Gaps above 1 s are left out (chosen by us: nothing is known then)."""
        gap: cython.longlong
        if not self.started:
            self.started = True
            self.stamp = stamp_ms
            self.power_W = power_W
            return True
        gap = (stamp_ms - self.stamp) & _MASK
        if gap == 0:
            return False
        if gap <= 1000:
            self.energy_J += 0.0005 * (self.power_W + power_W) * gap
        self.stamp = stamp_ms
        self.power_W = power_W
        return True


@cython.cclass
class HeelSensor:
    """One foot's contact sensor against its own baseline (counts), the running mean at the moment it flipped down."""

    baseline: cython.double
    count: cython.longlong

    def __init__(self) -> None:
        self.baseline = 0.0
        self.count = 0

    @cython.ccall
    def restart(self, raw: cython.double) -> None:
        self.baseline = raw
        self.count = 0

    @cython.ccall
    def average(self, raw: cython.double) -> None:
        self.baseline = 0.9 * self.baseline + 0.1 * raw

    @cython.ccall
    def touches(
        self, raw: cython.double, threshold: cython.double, ticks: cython.double, base_limit: cython.double
    ) -> cython.bint:
        """One tick; True when raised above the baseline for `ticks` ticks and not judged faulty."""
        if raw >= self.baseline + threshold:
            self.count += 1
        else:
            self.count = 0
        return self.count >= ticks and self.baseline < base_limit


@cython.cclass
class Estimator:
    """update() once per slot. report(code): callable that receives each error noticed.

    More than 40 fields, because half are the numbers of its variables in the data table, which compiled code then finds
    without a dictionary access.
    """

    store: DataStore
    report: object
    code_time_violation: cython.longlong
    code_stutter: cython.longlong
    code_fall: cython.longlong
    # variables of the data table
    TIMESTAMP: cython.longlong
    MCH_ANGLE: cython.longlong
    MCH_ANG_RATE: cython.longlong
    MCH_MOTOR_VELOCITY: cython.longlong
    MCFO_RIGHT_ANKLE_ANGLE: cython.longlong
    MCFI_MID_ANKLE_ANGLE: cython.longlong
    MCFO_LEFT_HEEL_SENSE: cython.longlong
    MCFO_RIGHT_HEEL_SENSE: cython.longlong
    MCFI_LEFT_HEEL_SENSE: cython.longlong
    MCFI_RIGHT_HEEL_SENSE: cython.longlong
    UI_ANG_RATE_X: cython.longlong
    UI_ROLL: cython.longlong
    MCH_BATT_POWER: cython.longlong
    MCFO_BATT_POWER: cython.longlong
    MCFI_BATT_POWER: cython.longlong
    MCSI_BATT_POWER: cython.longlong
    CSR_MCU_POWER: cython.longlong
    FSM_RESET: cython.longlong
    P_E_GYRO_BIAS: cython.longlong
    P_E_ROLL_BIAS: cython.longlong
    P_E_RESET: cython.longlong
    P_E_HS_THRESHOLD: cython.longlong
    P_E_HS_BASE_LIMIT: cython.longlong
    P_E_HS_TICKS: cython.longlong
    P_E_HS_H_ANG: cython.longlong
    P_E_HS_F_ANG: cython.longlong
    P_E_MIN_STEP_TIME: cython.longlong
    P_E_FALL_ANG: cython.longlong
    E_MCH_ANG_RATE: cython.longlong
    E_H_MOTOR_RATE: cython.longlong
    E_LO_ANGLE: cython.longlong
    E_LI_ANGLE: cython.longlong
    E_LO_RATE: cython.longlong
    E_LI_RATE: cython.longlong
    E_FO_ABSANG: cython.longlong
    E_FI_ABSANG: cython.longlong
    E_SWING_LEG: cython.longlong
    E_T_AFTER_HS: cython.longlong
    E_HS_TIME: cython.longlong
    E_STEP_COUNT: cython.longlong
    E_DISTANCE: cython.longlong
    E_ANKLE_HEIGHT: cython.longlong
    E_SWING_HEIGHT: cython.longlong
    E_LO_ERROR: cython.longlong
    E_HEEL_BASE_LEFT: cython.longlong
    E_HEEL_BASE_RIGHT: cython.longlong
    E_HEEL_STAGE: cython.longlong
    EST_CONTACT_OUTER: cython.longlong
    EST_CONTACT_INNER: cython.longlong
    EST_LAST_STEP_LENGTH: cython.longlong
    EST_LAST_STEP_ANGLE: cython.longlong
    EST_LAST_STEP_DURATION: cython.longlong
    EST_TOTAL_BATT_POWER: cython.longlong
    EST_ENERGY_MCH: cython.longlong
    EST_ENERGY_MCFO: cython.longlong
    EST_ENERGY_MCFI: cython.longlong
    EST_ENERGY_MCSI: cython.longlong
    EST_ENERGY_OVERHEAD: cython.longlong
    per_tick_filter: cython.bint
    use_filtered_sum: cython.bint
    use_imu_roll: cython.bint
    first_reset_is_full: cython.bint
    hip_rate: ButterworthFilter
    hip_motor_rate: ButterworthFilter
    gyro_rate: ButterworthFilter
    roll: ButterworthFilter
    outer_left_sense: ButterworthFilter
    outer_right_sense: ButterworthFilter
    inner_left_sense: ButterworthFilter
    inner_right_sense: ButterworthFilter
    floor: FloorGeometry
    sweet_spot_m: cython.double
    ankle_zero: cython.double
    foot_offset: cython.double
    left: HeelSensor
    right: HeelSensor
    stage: cython.longlong
    swing_leg: cython.longlong
    last_reset: cython.longlong
    gyro_stamp: cython.longlong
    strike_time: cython.longlong
    steps: cython.longlong
    violations: cython.longlong
    outer_angle: cython.double
    outer_raw_rate: cython.double
    distance_m: cython.double
    front_foot: cython.double
    gyro_started: cython.bint
    first_step: cython.bint
    fallen: cython.bint
    meters: list
    hip_energy: EnergyMeter
    outer_energy: EnergyMeter
    inner_energy: EnergyMeter
    steer_energy: EnergyMeter
    mcu_energy: EnergyMeter

    def __init__(self, store, quirks, report) -> None:
        self.store = store
        self.report = report
        self.code_time_violation = errors.EST_FILTER_TIME_VIOLATION
        self.code_stutter = errors.EST_STUTTER_STEP
        self.code_fall = errors.EST_ROBOT_FALL
        self.TIMESTAMP = table.TIMESTAMP
        self.MCH_ANGLE = table.MCH_ANGLE
        self.MCH_ANG_RATE = table.MCH_ANG_RATE
        self.MCH_MOTOR_VELOCITY = table.MCH_MOTOR_VELOCITY
        self.MCFO_RIGHT_ANKLE_ANGLE = table.MCFO_RIGHT_ANKLE_ANGLE
        self.MCFI_MID_ANKLE_ANGLE = table.MCFI_MID_ANKLE_ANGLE
        self.MCFO_LEFT_HEEL_SENSE = table.MCFO_LEFT_HEEL_SENSE
        self.MCFO_RIGHT_HEEL_SENSE = table.MCFO_RIGHT_HEEL_SENSE
        self.MCFI_LEFT_HEEL_SENSE = table.MCFI_LEFT_HEEL_SENSE
        self.MCFI_RIGHT_HEEL_SENSE = table.MCFI_RIGHT_HEEL_SENSE
        self.UI_ANG_RATE_X = table.UI_ANG_RATE_X
        self.UI_ROLL = table.UI_ROLL
        self.MCH_BATT_POWER = table.MCH_BATT_POWER
        self.MCFO_BATT_POWER = table.MCFO_BATT_POWER
        self.MCFI_BATT_POWER = table.MCFI_BATT_POWER
        self.MCSI_BATT_POWER = table.MCSI_BATT_POWER
        self.CSR_MCU_POWER = table.CSR_MCU_POWER
        self.FSM_RESET = table.FSM_RESET
        self.P_E_GYRO_BIAS = table.P_E_GYRO_BIAS
        self.P_E_ROLL_BIAS = table.P_E_ROLL_BIAS
        self.P_E_RESET = table.P_E_RESET
        self.P_E_HS_THRESHOLD = table.P_E_HS_THRESHOLD
        self.P_E_HS_BASE_LIMIT = table.P_E_HS_BASE_LIMIT
        self.P_E_HS_TICKS = table.P_E_HS_TICKS
        self.P_E_HS_H_ANG = table.P_E_HS_H_ANG
        self.P_E_HS_F_ANG = table.P_E_HS_F_ANG
        self.P_E_MIN_STEP_TIME = table.P_E_MIN_STEP_TIME
        self.P_E_FALL_ANG = table.P_E_FALL_ANG
        self.E_MCH_ANG_RATE = table.E_MCH_ANG_RATE
        self.E_H_MOTOR_RATE = table.E_H_MOTOR_RATE
        self.E_LO_ANGLE = table.E_LO_ANGLE
        self.E_LI_ANGLE = table.E_LI_ANGLE
        self.E_LO_RATE = table.E_LO_RATE
        self.E_LI_RATE = table.E_LI_RATE
        self.E_FO_ABSANG = table.E_FO_ABSANG
        self.E_FI_ABSANG = table.E_FI_ABSANG
        self.E_SWING_LEG = table.E_SWING_LEG
        self.E_T_AFTER_HS = table.E_T_AFTER_HS
        self.E_HS_TIME = table.E_HS_TIME
        self.E_STEP_COUNT = table.E_STEP_COUNT
        self.E_DISTANCE = table.E_DISTANCE
        self.E_ANKLE_HEIGHT = table.E_ANKLE_HEIGHT
        self.E_SWING_HEIGHT = table.E_SWING_HEIGHT
        self.E_LO_ERROR = table.E_LO_ERROR
        self.E_HEEL_BASE_LEFT = table.E_HEEL_BASE_LEFT
        self.E_HEEL_BASE_RIGHT = table.E_HEEL_BASE_RIGHT
        self.E_HEEL_STAGE = table.E_HEEL_STAGE
        self.EST_CONTACT_OUTER = table.EST_CONTACT_OUTER
        self.EST_CONTACT_INNER = table.EST_CONTACT_INNER
        self.EST_LAST_STEP_LENGTH = table.EST_LAST_STEP_LENGTH
        self.EST_LAST_STEP_ANGLE = table.EST_LAST_STEP_ANGLE
        self.EST_LAST_STEP_DURATION = table.EST_LAST_STEP_DURATION
        self.EST_TOTAL_BATT_POWER = table.EST_TOTAL_BATT_POWER
        self.EST_ENERGY_MCH = table.EST_ENERGY_MCH
        self.EST_ENERGY_MCFO = table.EST_ENERGY_MCFO
        self.EST_ENERGY_MCFI = table.EST_ENERGY_MCFI
        self.EST_ENERGY_MCSI = table.EST_ENERGY_MCSI
        self.EST_ENERGY_OVERHEAD = table.EST_ENERGY_OVERHEAD
        self.per_tick_filter = quirks.rate_filter == "20_hz"
        self.use_filtered_sum = quirks.heel_strike == "filtered_sum"
        self.use_imu_roll = quirks.leg_angle == "imu_roll"
        self.first_reset_is_full = quirks.first_step_full_reset
        cutoff: float = 20.0 if self.per_tick_filter else 10.0
        rate: float = 500.0 if self.per_tick_filter else 1000.0
        self.hip_rate = ButterworthFilter(cutoff, rate)
        self.hip_motor_rate = ButterworthFilter(cutoff, rate)
        self.gyro_rate = ButterworthFilter(cutoff, rate)
        self.roll = ButterworthFilter(20.0, 500.0)
        self.outer_left_sense = ButterworthFilter(10.0, 500.0)
        self.outer_right_sense = ButterworthFilter(10.0, 500.0)
        self.inner_left_sense = ButterworthFilter(10.0, 500.0)
        self.inner_right_sense = ButterworthFilter(10.0, 500.0)
        self.floor = FloorGeometry()
        self.sweet_spot_m = 0.054  # radius less ankle-to-centre distance: robot.md C3.1, both feet
        if quirks.estimator_feet != "robot":
            self.floor.inner_radius_m = self.floor.outer_radius_m = 0.2  # appendix table of the plant
            self.floor.inner_ankle_m = self.floor.outer_ankle_m = 0.146
        if quirks.estimator_feet == "appendix":
            self.floor.inner_ankle_m = self.floor.outer_ankle_m = 0.11
            self.sweet_spot_m = 0.09
        self.ankle_zero = 1.68  # ankle angle with the sweet spot under a vertical leg, rad (robot.md C1.1)
        self.foot_offset = 1.75  # published foot angle less geometric one, rad (robot.md C1.1)
        self.left = HeelSensor()
        self.right = HeelSensor()
        self.stage = SWING_BEHIND
        self.swing_leg = 1
        self.last_reset = 0
        self.outer_angle = 0.0
        self.outer_raw_rate = 0.0
        self.gyro_started = False
        self.gyro_stamp = 0
        self.strike_time = 0
        self.first_step = True
        self.steps = 0
        self.distance_m = 0.0
        self.front_foot = 0.0
        self.fallen = False
        self.violations = 0
        self.meters = [EnergyMeter() for _ in range(5)]
        self.hip_energy, self.outer_energy, self.inner_energy, self.steer_energy, self.mcu_energy = self.meters
        store.set_int(self.E_SWING_LEG, 1)

    @cython.ccall
    def restart(self) -> None:
        """The beginning of a walk: inner legs swing, angle 0, steps and distance from zero.

        ROBOT PARITY: the time after heel strike begins here, where the robot's goes on from the last strike of the
        walk before, or from power-up; nothing of the walk depends on it.
        """
        self.stage = SWING_BEHIND
        self.swing_leg = 1
        self.outer_angle = 0.0
        self.front_foot = 0.0
        self.first_step = True
        self.fallen = False
        self.strike_time = self.store.stamp(self.TIMESTAMP)
        self.store.set_int(self.E_SWING_LEG, 1)
        self.zero_way()

    @cython.ccall
    def zero_way(self) -> None:
        """Steps and distance from zero."""
        self.steps = 0
        self.distance_m = 0.0
        self.store.set_int(self.E_STEP_COUNT, 0)
        self.store.set_float(self.E_DISTANCE, 0.0)

    @cython.ccall
    def zero_counters(self) -> None:
        """Steps, distance and energies from zero."""
        meter: EnergyMeter
        i: cython.longlong
        for i in range(5):
            meter = self.meters[i]
            meter.energy_J = 0.0
        self.zero_way()

    @cython.ccall
    @cython.exceptval(check=True)
    def update(self) -> cython.void:
        """One slot."""
        store: DataStore = self.store
        reset: cython.longlong = store.get_int(self.FSM_RESET)
        hip: float = store.get_float(self.MCH_ANGLE)
        outer_ankle: float = store.get_float(self.MCFO_RIGHT_ANKLE_ANGLE) - self.ankle_zero
        inner_ankle: float = store.get_float(self.MCFI_MID_ANKLE_ANGLE) - self.ankle_zero
        rate: float
        if reset == WALKING and self.last_reset != WALKING:
            self.restart()
        self.last_reset = reset
        self.update_rates()
        self.update_outer_angle()
        self.detect_strike(hip, outer_ankle, inner_ankle)
        rate = -(self.gyro_rate.output - store.get_float(self.P_E_GYRO_BIAS))
        store.set_float(self.E_LO_RATE, rate)
        store.set_float(self.E_LI_RATE, rate - self.hip_rate.output)
        store.set_float(self.E_LO_ANGLE, self.outer_angle)
        store.set_float(self.E_LI_ANGLE, self.outer_angle - hip)
        store.set_float(self.E_FO_ABSANG, self.outer_angle + outer_ankle + self.foot_offset)
        store.set_float(self.E_FI_ABSANG, self.outer_angle - hip + inner_ankle + self.foot_offset)
        store.set_int(self.E_T_AFTER_HS, (store.stamp(self.TIMESTAMP) - self.strike_time) & _MASK)
        self.update_heights(hip, outer_ankle, inner_ankle)
        self.update_energy()
        if reset == WALKING:
            self.judge_fall(hip)

    @cython.ccall
    def update_rates(self) -> None:
        store: DataStore = self.store
        bad: cython.longlong
        if self.per_tick_filter:
            self.hip_rate.push(store.get_float(self.MCH_ANG_RATE))
            self.hip_motor_rate.push(store.get_float(self.MCH_MOTOR_VELOCITY))
            self.gyro_rate.push(store.get_float(self.UI_ANG_RATE_X))
        else:
            self.hip_rate.push_stamped(store.get_float(self.MCH_ANG_RATE), store.stamp(self.MCH_ANG_RATE))
            self.hip_motor_rate.push_stamped(
                store.get_float(self.MCH_MOTOR_VELOCITY), store.stamp(self.MCH_MOTOR_VELOCITY)
            )
            self.gyro_rate.push_stamped(store.get_float(self.UI_ANG_RATE_X), store.stamp(self.UI_ANG_RATE_X))
            bad = self.hip_rate.violations + self.hip_motor_rate.violations + self.gyro_rate.violations
            if bad != self.violations:
                self.violations = bad
                self.report(self.code_time_violation)
        store.set_float(self.E_MCH_ANG_RATE, self.hip_rate.output)
        store.set_float(self.E_H_MOTOR_RATE, self.hip_motor_rate.output)

    @cython.ccall
    @cython.exceptval(check=True)
    def update_outer_angle(self) -> cython.void:
        """Trapezoid over the unfiltered gyro and its own ms stamps (or the IMU's roll, by quirk)."""
        store: DataStore = self.store
        stamp: cython.longlong = store.stamp(self.UI_ANG_RATE_X)
        rate: float
        gap: cython.longlong
        if self.use_imu_roll:
            # roll is positive with the foot ahead of the hip, so the lean is its opposite (robot.md C1.1, C3.2)
            self.outer_angle = -(self.roll.push(store.get_float(self.UI_ROLL)) - store.get_float(self.P_E_ROLL_BIAS))
            return
        gap = (stamp - self.gyro_stamp) & _MASK
        if gap == 0:
            return
        rate = -(store.get_float(self.UI_ANG_RATE_X) - store.get_float(self.P_E_GYRO_BIAS))
        if self.gyro_started and gap <= _NEWEST:
            self.outer_angle += 0.0005 * (self.outer_raw_rate + rate) * gap
        self.gyro_started = True
        self.gyro_stamp = stamp
        self.outer_raw_rate = rate

    @cython.ccall
    @cython.exceptval(check=True)
    def detect_strike(self, hip: cython.double, outer_ankle: cython.double, inner_ankle: cython.double) -> cython.void:
        """Watch the swing feet; on contact flip the swing flag and reset the angle from the pose.

        A slot takes one stage at most. The inner legs' means begin a little ahead of the outer ones, the outer legs'
        where the legs pass each other (robot.md C3.1).
        """
        store: DataStore = self.store
        ahead: cython.bint
        ankle: float
        left: float
        right: float
        left_touches: cython.bint
        right_touches: cython.bint
        if self.swing_leg == 1:
            ahead = hip > store.get_float(self.P_E_HS_H_ANG)
            ankle = inner_ankle
            left = store.get_float(self.MCFI_LEFT_HEEL_SENSE)
            right = store.get_float(self.MCFI_RIGHT_HEEL_SENSE)
        else:
            ahead = hip < 0.0
            ankle = outer_ankle
            left = store.get_float(self.MCFO_LEFT_HEEL_SENSE)
            right = store.get_float(self.MCFO_RIGHT_HEEL_SENSE)
        if self.use_filtered_sum:
            self.update_contact_sums()
        if self.stage == SWING_BEHIND:
            if ahead:
                self.left.restart(left)
                self.right.restart(right)
                self.set_stage(AVERAGING)
            return
        if self.stage == AVERAGING:
            self.left.average(left)
            self.right.average(right)
            if ankle + self.ankle_zero > store.get_float(self.P_E_HS_F_ANG):
                store.set_float(self.E_HEEL_BASE_LEFT, self.left.baseline)
                store.set_float(self.E_HEEL_BASE_RIGHT, self.right.baseline)
                self.set_stage(ARMED)
            return
        if self.use_filtered_sum:
            if self.contact_sum(self.swing_leg == 1) > CONTACT_SUM:
                self.strike(hip, outer_ankle, inner_ankle)
            return
        left_touches = self.left.touches(
            left,
            store.get_float(self.P_E_HS_THRESHOLD),
            store.get_float(self.P_E_HS_TICKS),
            store.get_float(self.P_E_HS_BASE_LIMIT),
        )
        right_touches = self.right.touches(
            right,
            store.get_float(self.P_E_HS_THRESHOLD),
            store.get_float(self.P_E_HS_TICKS),
            store.get_float(self.P_E_HS_BASE_LIMIT),
        )
        if left_touches or right_touches:
            self.strike(hip, outer_ankle, inner_ankle)

    @cython.ccall
    def set_stage(self, stage: cython.longlong) -> None:
        self.stage = stage
        self.store.set_int(self.E_HEEL_STAGE, stage)

    @cython.ccall
    def update_contact_sums(self) -> None:
        """The four heel sensors through 10 Hz filters, once per slot (robot.md N4.17)."""
        store: DataStore = self.store
        self.outer_left_sense.push(store.get_float(self.MCFO_LEFT_HEEL_SENSE))
        self.outer_right_sense.push(store.get_float(self.MCFO_RIGHT_HEEL_SENSE))
        self.inner_left_sense.push(store.get_float(self.MCFI_LEFT_HEEL_SENSE))
        self.inner_right_sense.push(store.get_float(self.MCFI_RIGHT_HEEL_SENSE))
        store.set_float(self.EST_CONTACT_OUTER, self.contact_sum(False))
        store.set_float(self.EST_CONTACT_INNER, self.contact_sum(True))

    @cython.ccall
    def contact_sum(self, inner: cython.bint) -> cython.double:
        if inner:
            return self.inner_left_sense.output + self.inner_right_sense.output
        return self.outer_left_sense.output + self.outer_right_sense.output

    @cython.ccall
    def strike(self, hip: cython.double, outer_ankle: cython.double, inner_ankle: cython.double) -> None:
        """A heel strike: exchange the legs, correct the angle, count the step."""
        store: DataStore = self.store
        now: cython.longlong = store.stamp(self.TIMESTAMP)
        lasted: cython.longlong = (now - self.strike_time) & _MASK
        error: float
        geometric: float
        length: float
        if self.floor.solve(hip, outer_ankle, inner_ankle):
            geometric = self.floor.front_leg if hip < 0.0 else self.floor.rear_leg
            error = self.outer_angle - geometric
            if self.first_step and self.first_reset_is_full:
                self.outer_angle -= error
            else:
                self.outer_angle -= store.get_float(self.P_E_RESET) * error
            store.set_float(self.E_LO_ERROR, error)
            length = self.floor.ankle_distance_m + self.sweet_spot_m * (self.floor.rear_foot - self.front_foot)
            self.front_foot = self.floor.front_foot
            self.distance_m += length
            store.set_float(self.EST_LAST_STEP_LENGTH, length)
            store.set_float(self.EST_LAST_STEP_ANGLE, hip)
            store.set_float(self.E_DISTANCE, self.distance_m)
        self.steps += 1
        store.set_int(self.E_STEP_COUNT, self.steps)
        store.set_float(self.EST_LAST_STEP_DURATION, 0.001 * lasted)
        if not self.first_step and lasted < store.get_float(self.P_E_MIN_STEP_TIME):
            self.report(self.code_stutter)
        self.first_step = False
        self.strike_time = now
        store.set_u32(self.E_HS_TIME, now)
        self.swing_leg = 1 - self.swing_leg
        store.set_int(self.E_SWING_LEG, self.swing_leg)
        self.set_stage(SWING_BEHIND)

    @cython.ccall
    def update_heights(self, hip: cython.double, outer_ankle: cython.double, inner_ankle: cython.double) -> None:
        """Height of the swing ankle over the stance ankle, and of the swing foot over the floor."""
        store: DataStore = self.store
        lo: float = self.outer_angle
        li: float = lo - hip
        rise: float = self.floor.leg_m * (cos(lo) - cos(li))
        outer_sole: float
        inner_sole: float
        outer_sole = self.floor.outer_radius_m - self.floor.outer_ankle_m * cos(lo + outer_ankle)
        inner_sole = self.floor.inner_radius_m - self.floor.inner_ankle_m * cos(li + inner_ankle)
        if self.swing_leg == 1:
            store.set_float(self.E_ANKLE_HEIGHT, rise)
            store.set_float(self.E_SWING_HEIGHT, rise + outer_sole - inner_sole)
        else:
            store.set_float(self.E_ANKLE_HEIGHT, -rise)
            store.set_float(self.E_SWING_HEIGHT, -rise + inner_sole - outer_sole)

    @cython.ccall
    def update_energy(self) -> None:
        """Battery energy of each motor stage and of the electronics, from their published powers."""
        store: DataStore = self.store
        new: cython.bint = False
        if self.hip_energy.update(store.get_float(self.MCH_BATT_POWER), store.stamp(self.MCH_BATT_POWER)):
            store.set_float(self.EST_ENERGY_MCH, self.hip_energy.energy_J)
            new = True
        if self.outer_energy.update(store.get_float(self.MCFO_BATT_POWER), store.stamp(self.MCFO_BATT_POWER)):
            store.set_float(self.EST_ENERGY_MCFO, self.outer_energy.energy_J)
            new = True
        if self.inner_energy.update(store.get_float(self.MCFI_BATT_POWER), store.stamp(self.MCFI_BATT_POWER)):
            store.set_float(self.EST_ENERGY_MCFI, self.inner_energy.energy_J)
            new = True
        if self.steer_energy.update(store.get_float(self.MCSI_BATT_POWER), store.stamp(self.MCSI_BATT_POWER)):
            store.set_float(self.EST_ENERGY_MCSI, self.steer_energy.energy_J)
            new = True
        if self.mcu_energy.update(store.get_float(self.CSR_MCU_POWER), store.stamp(self.CSR_MCU_POWER)):
            store.set_float(self.EST_ENERGY_OVERHEAD, self.mcu_energy.energy_J)
            new = True
        if new:
            store.set_float(
                self.EST_TOTAL_BATT_POWER,
                self.hip_energy.power_W
                + self.outer_energy.power_W
                + self.inner_energy.power_W
                + self.steer_energy.power_W
                + self.mcu_energy.power_W,
            )

    @cython.ccall
    @cython.exceptval(check=True)
    def judge_fall(self, hip: cython.double) -> cython.void:
        """A leg beyond 45 degrees is a fall (robot.md N4.17); reported once per walk."""
        limit: float = self.store.get_float(self.P_E_FALL_ANG)
        lo: float = self.outer_angle
        li: float = lo - hip
        if self.fallen or self.first_step:
            return
        if lo > limit or lo < -limit or li > limit or li < -limit:
            self.fallen = True
            self.report(self.code_fall)


READS = variables_of(Estimator)
