"""The swinging leg: the body clamped, one leg hanging from the hip, driven by the hip motor over 66:1."""

import dataclasses

from tests.blind.generator.effects import EFFECTS as ALL
from tests.blind.generator.effects import OTHER_PLACES
from tests.blind.generator.excitation import STEP_S, swing
from tests.blind.generator.experiment import Experiment

G_M_PER_S2 = 9.81


def _pick(name, low, high):
    return lambda rng: {name: float(rng.uniform(low, high))}


class LegSwing(Experiment):
    """Columns as `ranger-sim diagnose --experiment leg-swing` takes them.

    J q'' = G K I - friction - k_h q - m g (c sin q - w cos q), q from the vertical. m c is known, as the leg held level
    gives it; the spring, m w and the rest are not.
    """

    NAME = "leg-swing"
    COLUMNS = {"hip_angle_rad": "q", "current_A": "I", "voltage_V": "V"}
    # Appendix tables 2 and 3, 0.1 N m of constant friction and 0.01 N m s of viscous; J: the leg and the rotor behind
    # the gear (0.55 + 66^2 x 1.6e-6). m g w: 8 mm forward at the leg's mass, as the walk tells.
    NOMINAL = {
        "R": 1.34,
        "Vc": 0.7,
        "K": 0.018,
        "C0": 0.1,
        "C1": 0.01,
        "mu": 0.1,
        "J": 0.557,
        "L": 67e-6,
        "kh": 7.6,
        "mgw": 0.04 * G_M_PER_S2,
    }
    FIXED = {"G": 66.0, "mgc": 0.72 * G_M_PER_S2, "travel_rad_s": 1.0}
    NOISE = {"V": 0.008, "I": 0.020, "q": 3e-4}
    EFFECTS = {
        name: ALL[name]
        for name in (
            "contact_drop_change",
            "resistance_temperature",
            "torque_constant_temperature",
            "current_step_at_zero_duty",
            "sensor_offset",
            "voltage_clip",
            "cogging",
            "commutation_ripple",
            "presliding",
            "friction_warm_up",
            "drag",
            "hip_spring_bend",
            "magnetic_hysteresis",
            "voltage_ripple_torque",
            "iron_saturation",
            "mains_pickup",
        )
    }
    # slower than the bench: shapes over the speeds and angles that a leg reaches
    EFFECTS["stribeck"] = dataclasses.replace(
        ALL["stribeck"], draw=lambda rng: {"speed_rad_s": float(rng.uniform(0.1, 0.4)), "stretch_rad": 2e-4}
    )
    EFFECTS["sensor_lag"] = dataclasses.replace(ALL["sensor_lag"], draw=lambda rng: {"channel": "I"})
    EFFECTS["eddy_brake_saturating"] = dataclasses.replace(
        ALL["eddy_brake_saturating"], draw=_pick("peak_rad_s", 0.3, 0.7)
    )
    EFFECTS["tight_arc_friction"] = dataclasses.replace(
        ALL["tight_arc_friction"],
        draw=lambda rng: {"centre_rad": float(rng.uniform(-0.3, 0.3)), "dead": float(rng.uniform(0.96, 0.99))},
    )
    CAUSES = tuple(name for name, effect in EFFECTS.items() if effect.known)
    OUTSIDE = tuple(name for name, effect in EFFECTS.items() if not effect.known)
    # neither speed nor torque is measured on a leg
    SHADOWS = tuple((cause, show) for (cause, place), show in OTHER_PLACES.items() if place not in "wT")
    CONFUSABLE = ()
    MIX = (("single", 0.50), ("null", 0.22), ("pair", 0.13), ("outside", 0.15))
    ONLY_IN = {
        "E": ("contact_drop_change", "resistance_temperature", "voltage_clip"),
        "M": ("cogging", "stribeck", "friction_warm_up", "drag", "hip_spring_bend"),
    }
    CHECK_AT_4 = 8
    CHECK_KINDS = (("single", 8), ("null", 10), ("pair", 6), ("outside", 10))
    SAMPLES = int(20.0 / STEP_S)
    MOVES_RAD_S = 0.05

    def excite(self, rng, supply_V, poor):
        return swing(rng, self.SAMPLES, supply_V)


LEG_SWING = LegSwing()
