"""Every number of the motors and their drives, with its source.

Sources in brackets: [A n] appendix section n, [P n] and [N n] paragraph n of those parts
of docs/robot.md, "chosen by us, because ...". Angles and rates of a motor are those of the joint it drives.
"""

import dataclasses
import math

from ranger_sim.foundation.user_error import ModelError, unknown

# Measured winding inductance against frequency [A 3.9]: 94 uH at 1 kHz ... 16 uH at 200 kHz.
FAULHABER_INDUCTANCE = ((1e3, 94e-6), (20e3, 35e-6), (100e3, 20e-6), (200e3, 16e-6))
GATE_SCHEMES = ("switching", "powered")


@dataclasses.dataclass(frozen=True)
class MotorParameters:
    """A brushed motor with gearhead, the inductor in series and the bridge that feeds it. Defaults: hip motor."""

    gear: float = 66.0  # turns of the rotor per turn of the joint [A 1.1.2]
    resistance_ohm: float = 1.3  # winding and brushes at 25 C [P 3; A 8.3.1]
    series_resistance_ohm: float = 0.04  # of the added inductor [A 3.9]
    # Two TPCA8014-H of the bridge in the current's path at about 9 mohm each (data sheet, typical).
    bridge_resistance_ohm: float = 0.018
    contact_drop_V: float = 0.7  # V_c [A 8.3.1]
    torque_constant_Nm_per_A: float = 0.018  # K [A 8.3.2]
    load_friction: float = 0.1  # mu [A table 3]
    constant_friction_Nm: float = 0.1  # C_0 at the joint [P 3: robot]
    viscous_friction_Nms: float = 0.01  # C_1 at the joint [P 3]
    friction_smoothing_rad_s: float = 0.05  # epsilon of tanh(rate / epsilon) [P 5]
    rotor_inertia_kg_m2: float = 1.6e-6  # J_m [P 3]
    inductance_table: tuple[tuple[float, float], ...] = FAULHABER_INDUCTANCE  # (Hz, H), winding alone [A 3.9]
    series_inductance_H: float = 47e-6  # [A 3.9]
    # Frequency whose inductance governs the settling of the current: with 67 uH the time constant is 50 us, the
    # short end of 47-106 us [P 5]. Chosen by us, because duty changes are steps and the first 50 us matter most.
    settling_frequency_hz: float = 100e3
    pwm_frequency_hz: float = 100e3  # [N 4.4]
    # Of a whole board's MOSFET drive at 30 V and 100 kHz; it goes with the voltage and with the frequency. [A 3.7]: a
    # board "uses under 200 mW, not including the motor and MOSFETs; the MOSFET drive uses another 300 mW at 30 V and
    # 100 kHz when active".
    gate_power_W: float = 0.3
    # When it is active: "switching", while a lead toggles with the PWM; "powered", as long as the bridge has power.
    gate_scheme: str = "switching"
    diode_drop_V: float = 0.7  # of a bridge diode [A 3.9]
    watchdog_ns: int = 10_000_000  # [A 3.9; N 4.3]
    # Heat: winding to housing, housing to air. Chosen by us in the size of the catalogue values of a 26 mm motor
    # (a few K/W inside, ten outside; 20 s and 11 min), because no source gives them.
    winding_to_housing_K_per_W: float = 2.0
    housing_to_air_K_per_W: float = 10.0
    winding_capacity_J_per_K: float = 10.0
    housing_capacity_J_per_K: float = 65.0
    air_C: float = 25.0
    # Change per kelvin above 25 C. 0: the measured 1.3 ohm holds at every temperature, as in the appendix.
    # Copper has +0.0039, the magnets' flux about -0.002; a model file switches them on.
    resistance_per_K: float = 0.0
    torque_constant_per_K: float = 0.0
    # Part of the period in which the drop of the freewheeling path acts against the current, both edges together.
    # 0: synchronous bridge without dead time, as in the appendix's power equation.
    dead_time_fraction: float = 0.0

    def __post_init__(self) -> None:
        positive = (
            "gear",
            "resistance_ohm",
            "torque_constant_Nm_per_A",
            "friction_smoothing_rad_s",
            "rotor_inertia_kg_m2",
            "settling_frequency_hz",
            "pwm_frequency_hz",
            "watchdog_ns",
            "winding_to_housing_K_per_W",
            "housing_to_air_K_per_W",
            "winding_capacity_J_per_K",
            "housing_capacity_J_per_K",
        )
        signed = ("air_C", "resistance_per_K", "torque_constant_per_K")
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if field.name in ("inductance_table", "gate_scheme"):
                continue
            if not math.isfinite(value):
                raise ModelError(f"motor: {field.name} is {value!r}, it must be a finite number")
            if field.name in positive and value <= 0.0:
                raise ModelError(f"motor: {field.name} is {value!r}, it must be above 0")
            if field.name not in positive and field.name not in signed and value < 0.0:
                raise ModelError(f"motor: {field.name} is {value!r}, it must not be negative")
        if self.gate_scheme not in GATE_SCHEMES:
            raise ModelError(f"motor: {unknown('gate_scheme', self.gate_scheme, GATE_SCHEMES)}")
        table = self.inductance_table
        if not table or any(f <= 0.0 or inductance < 0.0 for f, inductance in table):
            raise ModelError(f"motor: inductance_table {table!r} needs frequencies above 0 and inductances from 0 up")
        if any(a[0] >= b[0] for a, b in zip(table, table[1:], strict=False)):
            raise ModelError(f"motor: inductance_table {table!r} must rise in frequency")
        if self.inductance_H(self.settling_frequency_hz) <= 0.0 or self.inductance_H(self.pwm_frequency_hz) <= 0.0:
            raise ModelError("motor: the inductance of winding and series inductor together must be above 0")

    @property
    def loop_resistance_ohm(self) -> float:
        """Winding, brushes, inductor and bridge at 25 C."""
        return self.resistance_ohm + self.series_resistance_ohm + self.bridge_resistance_ohm

    def winding_inductance_H(self, frequency_hz: float) -> float:
        """Inductance of the winding: a straight line between table points over log frequency, constant outside."""
        table = self.inductance_table
        if frequency_hz <= table[0][0]:
            return table[0][1]
        for (f0, L0), (f1, L1) in zip(table, table[1:], strict=False):
            if frequency_hz <= f1:
                return L0 + (L1 - L0) * math.log(frequency_hz / f0) / math.log(f1 / f0)
        return table[-1][1]

    def inductance_H(self, frequency_hz: float) -> float:
        """Winding and series inductor together."""
        return self.winding_inductance_H(frequency_hz) + self.series_inductance_H

    @property
    def reflected_inertia_kg_m2(self) -> float:
        """G^2 J_m, the rotor as the joint feels it."""
        return self.gear * self.gear * self.rotor_inertia_kg_m2


HIP_MOTOR = MotorParameters()
ANKLE_MOTOR = MotorParameters(gear=34.0)  # 43:1 gearhead times the pulleys [P 3]

# Steering: "a small 1-watt-nominal Maxon gearmotor" [A 2.7] with 0.3 A as its limit [N 4.2]; no source names the
# type. Chosen by us in the range of 16 mm, 12 V windings of that class: 12 V gives 10 000 rpm free and 0.3 A
# stalled. 84:1 turns the feet 5 degrees within a swing. No inductor is mentioned for it; precious-metal brushes
# have next to no drop; three-stage planetary gearheads of that size have about 75 % efficiency.
STEERING_MOTOR = MotorParameters(
    gear=84.0,
    resistance_ohm=40.0,
    series_resistance_ohm=0.0,
    contact_drop_V=0.05,
    torque_constant_Nm_per_A=0.0115,
    load_friction=0.25,
    constant_friction_Nm=0.02,
    viscous_friction_Nms=0.001,
    rotor_inertia_kg_m2=1e-7,
    inductance_table=((1e3, 1e-3), (100e3, 0.6e-3)),
    series_inductance_H=0.0,
    winding_to_housing_K_per_W=10.0,
    housing_to_air_K_per_W=30.0,
    winding_capacity_J_per_K=0.5,
    housing_capacity_J_per_K=10.0,
)
