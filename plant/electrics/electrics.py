# cython: boundscheck=False, wraparound=False
# (indices are those of the 19 wiring points, the four motors and `NoiseSource.block`)
"""Battery, four motors, electronics and every voltage that a board's converters see.

A step of the plant in order: `step_motors` with the joint rates at its start (currents, torques for the body),
then the body moves, then `sense` with the state of the feet and the steering at its end. The voltages are in
`analog_start` and `analog_end` (V, by plant/wiring_points.py), to be read as straight lines over the step.

Sensor constants are those with which each board's firmware converts counts (robot.md N5), so a
nominal sensor is inverted exactly: -g (raw - off) is the motor's current in A, g (raw - off) the battery's, both by
the 14-bit converter with 2.5 V reference and the board's gain; battery voltage V = g x raw of the 10-bit one
with 3.3 V.

The motor's current sensor AD8210 does not read the same zero when its lead carries the PWM (appendix 3.8):
`pwm_offset_A` is added while lead 2 switches. Chosen by us, 0.05 A: over its 5 mohm shunt (full scale 12.6 A at
the gain of 20 and the converter's 2) that is 0.25 mV, a tenth of what its data sheet's 80 dB of common-mode
rejection at 100 kHz leaves of 26 V.
"""

import dataclasses
import math
from operator import add, mul

import cython
from cython.cimports.libc.math import exp

from ranger_sim.foundation.numbers import reals
from ranger_sim.foundation.user_error import ModelError
from ranger_sim.plant.electrics.battery import Battery, BatteryParameters
from ranger_sim.plant.electrics.electronics import power_W
from ranger_sim.plant.electrics.motor_parameters import ANKLE_MOTOR, HIP_MOTOR, STEERING_MOTOR, MotorParameters
from ranger_sim.plant.electrics.motor_unit import MotorUnit
from ranger_sim.plant.sensors.foot_sensor import FootSensors
from ranger_sim.plant.sensors.noise import NoiseSource
from ranger_sim.plant.wiring_points import (
    ANALOG_COUNT,
    BATTERY_CURRENT,
    BATTERY_VOLTAGE,
    INNER_FOOT_LEFT,
    INNER_FOOT_RIGHT,
    MOTOR_COUNT,
    MOTOR_CURRENT,
    MOTOR_NAMES,
    OUTER_FOOT_LEFT,
    OUTER_FOOT_RIGHT,
    PER_MOTOR,
    ROUTER_CURRENT,
    ROUTER_VOLTAGE,
    STEERING,
    STEERING_ANGLE,
)

ADS7871_REFERENCE_V = 2.5  # robot.md N4.5 (external reference; 2.5 V as the internal one)
INTERNAL_REFERENCE_V = 3.3

# robot.md N4.5 and N5, by motor: g, off, converter gain of the motor current; the same of the
# battery current; g of the battery voltage.
BOARD_CONSTANTS = (
    (0.00154, -9.0, 2.0, 0.000506, -4.0, 2.0, 0.0323),
    (-0.00152, 0.0, 2.0, 0.000502, -9.0, 2.0, 0.0327),
    (0.001525, -1.0, 2.0, 0.000502, -3.0, 2.0, 0.0324),
    (0.0001535, 25.0, 2.0, 0.0000505, -75.0, 20.0, 0.0327),
)
ROUTER_CURRENT_A_PER_COUNT = 0.000501  # A = 0.000501 (raw + 6), robot.md N5
ROUTER_CURRENT_OFFSET = 6.0
ROUTER_VOLT_PER_COUNT = 0.03046  # V = 0.03046 (raw + 5)
ROUTER_VOLT_OFFSET = 5.0

# Steering angle: EM-3242, 1024 steps over one turn as a voltage from 10 to 90 % of its supply. Chosen by us: 3.3 V
# supply; its magnet sits so that straight feet read 4803 counts at gain 2, the middle of the firmware's check
# (robot.md N4.8); +/- 200 counts are then +/- 4.2 degrees.
STEERING_CENTRE_V = 4803.0 * 2.5 / (8192.0 * 2.0)
STEERING_V_PER_RAD = 0.8 * 3.3 / (2.0 * math.pi)
STEERING_STEP_V = 0.8 * 3.3 / 1024.0


@dataclasses.dataclass(frozen=True)
class ElectricsParameters:
    """Motors, battery and sensors of the robot. Noise figures are standard deviations, chosen by us: about three
    steps of the converter for motor currents, two for battery currents, one for voltages, ten for the feet."""

    hip: MotorParameters = HIP_MOTOR
    outer_ankle: MotorParameters = ANKLE_MOTOR
    inner_ankle: MotorParameters = ANKLE_MOTOR
    steering: MotorParameters = STEERING_MOTOR
    battery: BatteryParameters = dataclasses.field(default_factory=BatteryParameters)
    electronics_off: tuple[str, ...] = ()  # ("left-outer-ankle",): the 65 km walk, 4.7 W instead of 5.15 W [A 3.8]
    pwm_offset_A: float = 0.05
    motor_current_noise_A: float = 0.005
    battery_current_noise_A: float = 0.001
    steering_current_noise_A: float = 0.0005
    voltage_noise_V: float = 0.03  # of battery volts
    foot_noise_counts: float = 10.0
    steering_noise_V: float = 0.0005
    # Smoothing of the battery current by the bridge's capacitors and the converter's filter [A 3.6 names both].
    # Chosen by us: two steps of the plant, one slot of a motor board.
    battery_current_lag_s: float = 0.0005
    # The AD623's range "was not really sufficient" [A 3.8]: highest battery voltage that it passes on. Chosen by
    # us: out of reach by default, so that the firmware's constants hold; 27 V shows the effect.
    voltage_clip_V: float = 60.0
    foot_rise_time_constant_s: float = 0.012
    foot_share: float = 0.4
    foot_full_load_N: float = 50.0

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if isinstance(value, float) and not (math.isfinite(value) and value >= 0.0):
                raise ModelError(f"electrics: {field.name} is {value!r}, it must be a finite number from 0 up")


@cython.final
@cython.cclass
class Electrics:
    """Everything electrical of the robot. `seed`: for the sensors' noise."""

    # fields read at every step come first, next to each other
    hip: MotorUnit
    outer_ankle: MotorUnit
    inner_ankle: MotorUnit
    steering: MotorUnit
    battery: Battery
    hip_rate: cython.double
    outer_rate: cython.double
    inner_rate: cython.double
    steering_rate: cython.double
    electronics_W: cython.double
    electronics_J: cython.double
    motor_current_A: cython.double
    outer_feet: FootSensors
    inner_feet: FootSensors
    motors: list
    noise: NoiseSource
    lag_h: cython.double
    lag_factor: cython.double
    pwm_offset_A: cython.double
    voltage_clip_V: cython.double
    steering_rad: cython.double
    steering_shown_rad: cython.double
    has_terms: cython.bint
    has_ripple: cython.bint
    # as long as there are motors and analog wiring points
    battery_A: cython.double[4]
    values: cython.double[19]
    zero_V: cython.double[19]
    slope_V: cython.double[19]
    noise_V: cython.double[19]
    analog_end: cython.double[::1]
    analog_start: cython.double[::1]
    battery_current_lag_s: cython.double
    scale: cython.double[19]
    offset: cython.double[19]
    lag_s: cython.double[19]
    state: cython.double[19]
    parameters: object

    def __init__(self, parameters=None, seed=0) -> None:
        p = parameters if parameters is not None else ElectricsParameters()
        self.parameters = p
        self.battery = Battery(p.battery)
        self.electronics_W = power_W(p.electronics_off)
        # The outer ankle's motor sits mirrored: robot.md N4.1 and N4.2, the signs of MCFO.
        self.hip = MotorUnit("hip", p.hip, 1)
        self.outer_ankle = MotorUnit("outer_ankle", p.outer_ankle, -1)
        self.inner_ankle = MotorUnit("inner_ankle", p.inner_ankle, 1)
        self.steering = MotorUnit("steering", p.steering, 1)
        self.motors = [self.hip, self.outer_ankle, self.inner_ankle, self.steering]
        self.outer_feet = FootSensors("outer", p.foot_rise_time_constant_s, p.foot_share, p.foot_full_load_N)
        self.inner_feet = FootSensors("inner", p.foot_rise_time_constant_s, p.foot_share, p.foot_full_load_N)
        self.noise = NoiseSource(seed, "analog sensors")
        self.analog_start = reals([0.0] * ANALOG_COUNT)
        self.analog_end = reals([0.0] * ANALOG_COUNT)
        # C arrays of ANALOG_COUNT and of MOTOR_COUNT numbers: their length is a literal
        self.values = [0.0] * 19  # measured quantities: A, V, rad
        self.zero_V = [0.0] * 19
        self.slope_V = [0.0] * 19  # volts per ampere, volt or rad
        self.noise_V = [0.0] * 19
        self.has_ripple = False  # of a model file, in a motor's torque constant
        # additional terms of a model file, in the unit of the quantity
        self.has_terms = False
        self.scale = [1.0] * 19
        self.offset = [0.0] * 19
        self.lag_s = [0.0] * 19
        self.state = [0.0] * 19
        self.battery_A = [0.0] * 4  # smoothed, per motor
        self.steering_rad = 0.0  # twist of the feet, and its sensor's reading
        self.steering_shown_rad = 0.0
        self.pwm_offset_A = p.pwm_offset_A
        self.voltage_clip_V = p.voltage_clip_V
        self.battery_current_lag_s = p.battery_current_lag_s
        self.lag_h = 0.0
        self.lag_factor = 1.0
        self.electronics_J = 0.0
        self.motor_current_A = 0.0  # of all motors together, mean of the step
        self.hip_rate = 0.0  # rad/s at the start of the last step; so the next three
        self.outer_rate = 0.0
        self.inner_rate = 0.0
        self.steering_rate = 0.0
        for motor in range(len(MOTOR_NAMES)):
            g, off, gain, battery_g, battery_off, battery_gain, volt_g = BOARD_CONSTANTS[motor]
            volts = ADS7871_REFERENCE_V / 8192.0
            i = PER_MOTOR * motor
            self.zero_V[i + MOTOR_CURRENT] = off * volts / gain
            self.slope_V[i + MOTOR_CURRENT] = -volts / gain / g
            self.zero_V[i + BATTERY_CURRENT] = battery_off * volts / battery_gain
            self.slope_V[i + BATTERY_CURRENT] = volts / battery_gain / battery_g
            self.slope_V[i + BATTERY_VOLTAGE] = INTERNAL_REFERENCE_V / 1024.0 / volt_g
            amps = p.steering_current_noise_A if motor == STEERING else p.motor_current_noise_A
            self.noise_V[i + MOTOR_CURRENT] = amps * abs(self.slope_V[i + MOTOR_CURRENT])
            amps = p.steering_current_noise_A if motor == STEERING else p.battery_current_noise_A
            self.noise_V[i + BATTERY_CURRENT] = amps * self.slope_V[i + BATTERY_CURRENT]
            self.noise_V[i + BATTERY_VOLTAGE] = p.voltage_noise_V * self.slope_V[i + BATTERY_VOLTAGE]
        for foot in (OUTER_FOOT_LEFT, OUTER_FOOT_RIGHT, INNER_FOOT_LEFT, INNER_FOOT_RIGHT):
            self.slope_V[foot] = 1.0
            self.noise_V[foot] = p.foot_noise_counts * ADS7871_REFERENCE_V / 8192.0
        self.zero_V[STEERING_ANGLE] = STEERING_CENTRE_V
        self.slope_V[STEERING_ANGLE] = STEERING_V_PER_RAD
        self.noise_V[STEERING_ANGLE] = p.steering_noise_V
        count_V = INTERNAL_REFERENCE_V / 1024.0
        self.zero_V[ROUTER_CURRENT] = -ROUTER_CURRENT_OFFSET * count_V
        self.slope_V[ROUTER_CURRENT] = count_V / ROUTER_CURRENT_A_PER_COUNT
        self.zero_V[ROUTER_VOLTAGE] = -ROUTER_VOLT_OFFSET * count_V
        self.slope_V[ROUTER_VOLTAGE] = count_V / ROUTER_VOLT_PER_COUNT
        self.noise_V[ROUTER_VOLTAGE] = p.voltage_noise_V * self.slope_V[ROUTER_VOLTAGE]
        self.settle(False, 0.0, False, 0.0, 0.0)

    @cython.ccall
    def step_motors(
        self,
        t0: cython.longlong,
        t1: cython.longlong,
        hip_rate: cython.double,
        outer_rate: cython.double,
        inner_rate: cython.double,
        steering_rate: cython.double,
        jumped: cython.bint = True,
    ) -> cython.void:
        """Currents, torques and battery over [t0, t1) ns; joint (motor over gear) rates at its start, rad/s.

        Unless they have `jumped` since the step before, the windings see them in the step's middle, as they
        have changed over the step before (EQUATIONS 10.2).
        """
        V: cython.double = self.battery.voltage_V
        total: cython.double
        h: cython.double = (t1 - t0) * 1e-9
        half: cython.double = 0.0 if jumped else 0.5
        self.hip.step_electrical(t0, t1, hip_rate + half * (hip_rate - self.hip_rate), V)
        self.outer_ankle.step_electrical(t0, t1, outer_rate + half * (outer_rate - self.outer_rate), V)
        self.inner_ankle.step_electrical(t0, t1, inner_rate + half * (inner_rate - self.inner_rate), V)
        self.steering.step_electrical(t0, t1, steering_rate + half * (steering_rate - self.steering_rate), V)
        self.hip_rate = hip_rate
        self.outer_rate = outer_rate
        self.inner_rate = inner_rate
        self.steering_rate = steering_rate
        total = self.hip.battery_current_A + self.outer_ankle.battery_current_A
        total += self.inner_ankle.battery_current_A + self.steering.battery_current_A
        self.motor_current_A = total
        self.electronics_J += self.electronics_W * h
        self.battery.step(h, total, self.electronics_W)

    @cython.ccall
    def turn_motors(
        self,
        t0: cython.longlong,
        t1: cython.longlong,
        hip_rad: cython.double,
        outer_rad: cython.double,
        inner_rad: cython.double,
        hip_rate: cython.double,
        outer_rate: cython.double,
        inner_rate: cython.double,
    ) -> cython.void:
        """Before `step_motors`, where a torque constant ripples: joint (motor over gear) angles and rates at t0."""
        h: cython.double = (t1 - t0) * 1e-9
        self.hip.turn(hip_rad, hip_rate, h)
        self.outer_ankle.turn(outer_rad, outer_rate, h)
        self.inner_ankle.turn(inner_rad, inner_rate, h)

    @cython.ccall
    def sense(
        self,
        t0: cython.longlong,
        t1: cython.longlong,
        outer_contact: cython.bint,
        outer_load_N: cython.double,
        inner_contact: cython.bint,
        inner_load_N: cython.double,
        steering_rad: cython.double,
    ) -> cython.void:
        """The voltages at the end of the step: contact and load of each foot pair, steering angle (rad)."""
        h: cython.double = (t1 - t0) * 1e-9
        self.outer_feet.step(h, outer_contact, outer_load_N)
        self.inner_feet.step(h, inner_contact, inner_load_N)
        if h != self.lag_h:
            self.lag_h = h
            self.lag_factor = 1.0
            if self.battery_current_lag_s > 0.0:
                self.lag_factor = 1.0 - exp(-h / self.battery_current_lag_s)
        self._read(h, steering_rad)

    @cython.ccall
    def settle(
        self,
        outer_contact: cython.bint,
        outer_load_N: cython.double,
        inner_contact: cython.bint,
        inner_load_N: cython.double,
        steering_rad: cython.double,
    ) -> cython.void:
        """Settle all sensors, as if the state had lasted for a long time."""
        i: cython.longlong
        self.outer_feet.settle(outer_contact, outer_load_N)
        self.inner_feet.settle(inner_contact, inner_load_N)
        self.lag_h = 0.0
        self.lag_factor = 1.0
        self._read(0.0, steering_rad)
        for i in range(ANALOG_COUNT):
            self.analog_start[i] = self.analog_end[i]

    @cython.cfunc
    def _read(self, h: cython.double, steering_rad: cython.double) -> cython.void:
        """Fill `analog_end`; its previous content becomes `analog_start`."""
        V: cython.double = self.battery.voltage_V
        seen: cython.double = V if V < self.voltage_clip_V else self.voltage_clip_V
        lag: cython.double = self.lag_factor
        amps: cython.double
        steps: cython.double
        nearest: cython.longlong
        value: cython.double
        place: cython.longlong
        motor: cython.longlong
        i: cython.longlong = 0
        unit: MotorUnit
        motors: list = self.motors
        values: cython.p_double = self.values
        battery_A: cython.p_double = self.battery_A
        for motor in range(MOTOR_COUNT):
            # quantities measured by the three sensors of a motor board
            unit = motors[motor]
            amps = unit.current_A
            if unit.drive.sensed_lead_switches:
                amps += unit.mounting * self.pwm_offset_A
            value = battery_A[motor]
            value += (unit.battery_current_A - value) * lag
            battery_A[motor] = value
            values[i + MOTOR_CURRENT] = amps
            values[i + BATTERY_CURRENT] = value
            values[i + BATTERY_VOLTAGE] = seen
            i += PER_MOTOR
        feet: FootSensors = self.outer_feet
        values[OUTER_FOOT_LEFT] = feet.left_V
        values[OUTER_FOOT_RIGHT] = feet.right_V
        feet = self.inner_feet
        values[INNER_FOOT_LEFT] = feet.left_V
        values[INNER_FOOT_RIGHT] = feet.right_V
        if steering_rad != self.steering_rad:
            # the sensor's own 1024 steps of a turn: the nearest one
            self.steering_rad = steering_rad
            steps = steering_rad * (1024.0 / 6.283185307179586)
            nearest = int(steps + 0.5) if steps >= 0.0 else -int(0.5 - steps)
            self.steering_shown_rad = nearest * (6.283185307179586 / 1024.0)
        values[STEERING_ANGLE] = self.steering_shown_rad
        values[ROUTER_CURRENT] = self.electronics_W / V if V > 0.0 else 0.0
        values[ROUTER_VOLTAGE] = V
        if self.has_terms:
            self._apply_terms(h)
        noise: NoiseSource = self.noise
        place = noise.block()
        if cython.compiled:
            for i in range(ANALOG_COUNT):
                value = self.zero_V[i] + self.slope_V[i] * values[i] + self.noise_V[i] * noise.table[place + i]
                self.analog_start[i] = self.analog_end[i]
                self.analog_end[i] = value
        else:  # the same in a fraction of the time: a fifth of a step of the plant went into this loop
            self.analog_start[:] = self.analog_end
            volts = map(add, self.zero_V, map(mul, self.slope_V, values))
            self.analog_end[:] = map(add, volts, map(mul, self.noise_V, noise.table[place : place + ANALOG_COUNT]))

    @cython.cfunc
    def _apply_terms(self, h: cython.double) -> cython.void:
        """Apply scale, offset and lag of a model file to the measured quantities."""
        i: cython.longlong
        value: cython.double
        for i in range(ANALOG_COUNT):
            value = self.scale[i] * self.values[i] + self.offset[i]
            if self.lag_s[i] > 0.0:
                if h > 0.0:
                    value = self.state[i] + (value - self.state[i]) * (1.0 - exp(-h / self.lag_s[i]))
                self.state[i] = value
            self.values[i] = value
