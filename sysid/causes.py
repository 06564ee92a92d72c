"""The catalogue: 42 ways in which a machine differs from its model, by identifier, with the balances that show them.

An identifier is stable. Where `plant/terms.py` has a form for the cause, the form's name is the identifier, or `form`
names it; a model file can put such a cause into the simulator. One identifier may have several places (`sensor_offset`
at the current, the gyro, an angle): `at` names the place, and `key` distinguishes them.
"""

import dataclasses
from typing import Any

from ranger_sim.foundation.user_error import UserError, unknown

BALANCES = {
    "E": "electrics of a motor: voltage against resistance, drops and speed",
    "M": "mechanics of a joint: torques against inertia",
    "T": "transmission: motor angle against joint angle and cable",
    "S": "sensors that show the same quantity",
    "P": "power: battery against motors and electronics",
    "t": "time: stamps of one clock against another",
    "C": "command: what a board drives against the law and the numbers that it was given",
}


@dataclasses.dataclass(frozen=True)
class Cause:
    """One cause. number: in the catalogue; confusable: numbers of causes with a similar signature; shift: it is a
    wrong value of a number of the base model, which a fit of that number absorbs.
    """

    number: int
    identifier: str
    meaning: str
    balances: tuple[str, ...]
    signature: str
    confusable: tuple[int, ...] = ()
    at: str = ""
    form: str = ""
    shift: bool = False

    @property
    def key(self) -> str:
        """The identifier, with the place where it needs one: "sensor_offset@current"."""
        return f"{self.identifier}@{self.at}" if self.at else self.identifier


E, M, T, S, P, CLOCK, COMMAND = (("E",), ("M",), ("T",), ("S",), ("P",), ("t",), ("C",))
_ALL = (
    Cause(1, "contact_drop_change", "the brushes drop another voltage than the model's", E,
          "a step with the current's sign", (2, 6), form="contact_drop_change", shift=True),
    Cause(2, "resistance_temperature", "the winding's resistance grows as it heats", E,
          "current times heat state, slow", (10,), form="resistance_temperature"),
    Cause(3, "torque_constant_temperature", "the magnets weaken as they heat", E + M,
          "speed, and current, times heat state, slow", (2,), form="torque_constant_temperature"),
    Cause(4, "inductance_frequency", "the winding's inductance falls with frequency", E,
          "in proportion to the current's derivative", (5,)),
    Cause(5, "pwm_ripple", "ripple current of the PWM heats and takes power without torque", E + P,
          "duty (1 - duty): battery power and heat without torque", (4,)),
    Cause(6, "dead_time", "for a part of the period no transistor conducts: a diode's drop acts", E,
          "the current's sign times the battery's voltage", (1,), form="dead_time"),
    Cause(7, "battery_sag", "the battery's voltage falls under load", E + P,
          "the supply falls with the sum of all currents", (2,)),
    Cause(8, "charge_drift", "the battery's voltage falls as it is emptied", E + P,
          "the supply falls with the integral of the current", ()),
    Cause(9, "current_step_at_zero_duty", "the current's sensor jumps where the duty changes its sign", E + M,
          "a step of the measured current at duty zero, moving with speed", (11,)),
    Cause(10, "sensor_scale", "the current's sensor shows a multiple of the current", E + M,
          "resistance and torque constant change together", (2, 3, 19), "current", "sensor_scale"),
    Cause(11, "sensor_offset", "the current's sensor shows a constant too much", E + M,
          "a constant in both balances", (9,), "current", "sensor_offset"),
    Cause(12, "voltage_clip", "the voltage that was commanded was not available", E + P,
          "a shortfall only near full voltage", (7,)),
    Cause(13, "cogging", "the rotor's teeth pull towards preferred angles", M,
          "sine and cosine of multiples of the motor's angle, without current", (14, 15), form="cogging"),
    Cause(14, "commutation_ripple", "torque varies as the brushes pass from bar to bar", M,
          "periodic in the motor's angle, in proportion to the current", (13,), form="commutation_ripple"),
    Cause(15, "once_per_turn", "a gear or pulley is out of centre", M,
          "periodic once per turn of the joint", (13, 28), form="once_per_turn"),
    Cause(16, "coulomb_friction", "constant friction is not what the model says", M,
          "a step with the rate's sign", (17, 20), form="coulomb_friction", shift=True),
    Cause(16, "viscous_friction", "friction in proportion to the rate is not what the model says", M,
          "in proportion to the rate", (37,), form="viscous_friction", shift=True),
    Cause(17, "stribeck", "friction is larger at low speed", M,
          "excess friction that falls off with speed", (18, 37), form="stribeck"),
    Cause(18, "presliding", "before it slides, friction is a stiff spring with memory", M,
          "hysteresis within a short way behind each reversal", (17, 22)),
    Cause(19, "load_friction", "friction grows with the transmitted torque, otherwise when the load drives", M,
          "the rate's sign times the torque: driving and being driven differ", (10, 14)),
    Cause(20, "direction_friction", "friction differs between the directions", M,
          "a constant, and the rate's magnitude", (11, 37), form="direction_friction"),
    Cause(21, "friction_warm_up", "friction falls as grease and gearbox warm up", M,
          "friction that decays over minutes", (16,)),
    Cause(22, "cable_backlash", "the cable or gear has a gap between its flanks", T,
          "a step of the twist where the torque changes its sign", (23, 18), form="cable_backlash"),
    Cause(23, "cable_stiffening", "the cable gets stiffer the further it is stretched", T,
          "the cube of the twist", (22, 30), form="cable_stiffening"),
    Cause(24, "cable_creep", "the cable goes on stretching under load, over seconds", T,
          "a twist that follows the torque by 1 to 100 s", (23,)),
    Cause(25, "pulley_slip", "the cable slips on its pulley", T,
          "a lasting step between motor and joint", (41,)),
    Cause(26, "hip_spring_bend", "the hip's spring is not linear", M,
          "the cube of the hip's angle", (40,), form="spring"),
    Cause(27, "return_spring", "a spring returns the ankle, more than linearly", M,
          "the square of the ankle's angle", (40,), form="spring"),
    Cause(28, "eccentricity", "an encoder's disc or magnet is out of centre", S,
          "sine of the angle and of twice the angle", (15,), form="eccentricity"),
    Cause(29, "lost_counts", "an incremental encoder loses counts above a speed", S,
          "a ramp while the speed is high, which stays", (25,)),
    Cause(30, "sensor_lag", "a sensor or its filter delays", S + CLOCK,
          "in proportion to the derivative of what it shows", (23, 32), form="sensor_lag"),
    Cause(31, "bit_flip", "words from an absolute encoder have single wrong bits", S,
          "isolated jumps by powers of two", (), form="bit_flip"),
    Cause(32, "clock_drift", "stamps drift against each other, or the bus delays them", CLOCK,
          "in proportion to the derivative times time", (30,)),
    Cause(33, "gyro_misalignment", "the gyro's axis is turned: it sees other rotations", S,
          "a part of the yaw rate", (), form="gyro_misalignment"),
    Cause(33, "sensor_scale", "the gyro shows a multiple of the rate", S,
          "in proportion to the rate", (), "gyro", "sensor_scale"),
    Cause(33, "sensor_offset", "the gyro shows a rate at rest", S,
          "a constant rate, a ramp of the angle", (), "gyro", "sensor_offset"),
    Cause(34, "leg_asymmetry", "the legs differ, or a centre of mass lies beside its leg", M,
          "alternates from step to step", (39, 41)),
    Cause(35, "floor", "the floor slopes or is rough", M + S,
          "gravity along the floor; heights at strikes", (41,)),
    Cause(36, "contact_loss", "the feet roll with resistance, slip, or lose more at the strike", M,
          "only in stance, or at strikes", (16,)),
    Cause(37, "drag", "air or oil resists with the square of the rate", M,
          "the rate times its magnitude", (16, 17), form="drag"),
    Cause(38, "geometry", "a length is not what the model says: foot height, leg, arc", M + S,
          "heights and closures are off by a function of the angles", (39, 41), shift=True),
    Cause(39, "inertia", "a mass, a moment of inertia or a centre of mass is not what the model says", M,
          "in proportion to acceleration, or to gravity's lever", (38, 40), shift=True),
    Cause(40, "spring_value", "a spring's stiffness or rest angle is not what the model says", M,
          "in proportion to the angle", (26, 27, 39), shift=True),
    Cause(41, "sensor_offset", "an angle's zero is wrong", S + M,
          "a constant angle", (25, 34, 35), "angle", "sensor_offset"),
    Cause(42, "firmware_parameter", "a gain or target in the firmware is not what was thought", COMMAND,
          "the command differs by a multiple of angle, rate or target", (30,), shift=True),
)  # fmt: skip
CAUSES = {cause.key: cause for cause in _ALL}
NUMBERS = 42


def find(name: str) -> Cause:
    """The cause of this key, or of this identifier when it has one place only. UserError with the nearest."""
    if name in CAUSES:
        return CAUSES[name]
    same = [cause.key for cause in _ALL if cause.identifier == name]
    if same:
        raise UserError(f"{name}: this cause has several places: {', '.join(same)}")
    raise UserError(unknown("cause", name, CAUSES))


def rivals(cause: Cause) -> list[str]:
    """Keys of the causes that are known to look similar."""
    return [each.key for each in _ALL if each.number in cause.confusable and each.key != cause.key]


def as_json(cause: Cause) -> dict[str, Any]:
    """Everything about a cause, for programs."""
    return {
        "identifier": cause.identifier,
        "number": cause.number,
        "meaning": cause.meaning,
        "at": cause.at or None,
        "key": cause.key,
        "balances": list(cause.balances),
        "signature": cause.signature,
        "confusable_with": rivals(cause),
        "form": cause.form or None,
        "parameter_shift": cause.shift,
    }
