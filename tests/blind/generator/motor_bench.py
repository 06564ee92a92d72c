"""The motor bench: a motor with a 14:1 gearbox against a brake motor."""

from tests.blind.generator.effects import EFFECTS, OTHER_PLACES
from tests.blind.generator.excitation import STEP_S, one_sided, rich
from tests.blind.generator.experiment import Experiment

BRAKE_NM = 0.7  # most of what the brake motor is driven with: 2.8 A at standstill


class MotorBench(Experiment):
    """Columns as `ranger-sim diagnose --experiment motor-bench` takes them; the torque is what the brake takes."""

    NAME = "motor-bench"
    COLUMNS = {
        "voltage_V": "V",
        "current_A": "I",
        "speed_rad_per_s": "w",
        "torque_Nm": "T",
        "temperature_C": "temperature",
        "motor_angle_rad": "theta",
    }
    # Appendix table 3 (R with 0.04 ohm of leads), 8.4.3 for C1, 3 for L (20 + 47 uH); J: rotor 1.6e-6 times gear
    # squared, and twice that for couplings and brake, chosen by us.
    NOMINAL = {"R": 1.34, "Vc": 0.7, "K": 0.018, "C0": 0.01, "C1": 0.0033, "mu": 0.1, "J": 9.4e-4, "L": 67e-6}
    FIXED = {"G": 14.0, "kh": 0.0, "mgc": 0.0, "mgw": 0.0, "travel_rad_s": 10.0}
    NOISE = {"V": 0.008, "I": 0.020, "w": 0.040, "T": 0.008}
    EFFECTS = {name: effect for name, effect in EFFECTS.items() if name != "hip_spring_bend"}
    CAUSES = tuple(name for name, effect in EFFECTS.items() if effect.known)
    OUTSIDE = tuple(name for name, effect in EFFECTS.items() if not effect.known)
    SHADOWS = tuple((cause, show) for (cause, _), show in OTHER_PLACES.items())
    # With a supply of one sign these two are one: the sensor's step at zero duty is never crossed.
    CONFUSABLE = ("current_step_at_zero_duty", "sensor_offset")
    MIX = (("single", 0.46), ("null", 0.20), ("pair", 0.12), ("outside", 0.14), ("confusable", 0.08))
    ONLY_IN = {
        "E": ("contact_drop_change", "resistance_temperature", "voltage_clip"),
        "M": ("cogging", "once_per_turn", "stribeck", "direction_friction", "friction_warm_up", "drag"),
        "T": ("eccentricity", "lost_counts"),
    }
    CHECK_AT_4 = 8
    # Singles at 2. Ten outside the catalogue: fewer would bound nothing at a risk of a millionth (0.15^9 = 4e-8).
    CHECK_KINDS = (("single", 8), ("null", 10), ("outside", 10))
    SAMPLES = int(20.0 / STEP_S)
    MOVES_RAD_S = 0.15

    def excite(self, rng, supply_V, poor):
        return (one_sided if poor else rich)(rng, self.SAMPLES, supply_V, BRAKE_NM)


MOTOR_BENCH = MotorBench()
