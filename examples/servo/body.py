"""The servo's body: a brushed motor that swings an arm with a weight at its end.

EQUATIONS, for a step in which the bridge's voltage u and the arm's rate w stand:

(1) L di/dt = u - R i - k w, so i runs to (u - k w) / R as exp(-t R / L); its mean over the step is exact
(2) J dw/dt = k i - m g l sin q - s q - c w - F(w)        q from hanging, (s: see `cable_Nm_per_rad`)
(3) F(w) = C sign(w) while it moves; at rest whatever keeps it there, up to C (Coulomb)
(4) at the amplifier of the current: V = 1.65 V + 0.25 V/A i, with white noise

(2) and (3) are integrated by impulses: the others change the rate first, then friction takes up to C h / J of it away,
and what is left decides whether the arm moves (Moreau's time stepping: Acary and Brogliato, Numerical Methods for
Nonsmooth Dynamical Systems, 2008, chapter 10). So it truly stands where it stands.

The numbers are chosen by us, as of a coreless motor of 25 mm and 20 W. They agree with each other: 24 V / 2.32 ohm x
0.0234 N m/A is a stall torque of 0.242 N m, R J / k^2 of the bare rotor a time constant of 4.4 ms.
"""

import dataclasses
import math

from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.plant.bridge import Bridge
from ranger_sim.plant.plant import Plant
from ranger_sim.plant.sensors.incremental_encoder import IncrementalEncoder

STEP_NS = 125_000  # half a slot of the motor board
LINES = 500  # of the encoder
ZERO_CURRENT_V, V_PER_A = 1.65, 0.25  # equation (4)
SAMPLES = {
    "angle_rad": "rad",
    "rate_rad_per_s": "rad/s",
    "current_A": "A",
    "voltage_V": "V",
}


@dataclasses.dataclass(frozen=True)
class Numbers:
    """Of motor and arm, SI units."""

    resistance_ohm: float = 2.32
    inductance_H: float = 0.238e-3
    torque_Nm_per_A: float = 0.0234  # k, and V s of back-EMF
    inertia_kg_m2: float = 4.6e-5  # J: rotor 1.03e-6, weight 50 g at 30 mm
    weight_Nm: float = 0.0147  # m g l
    coulomb_Nm: float = 0.002  # C
    viscous_Nms: float = 2e-5  # c
    supply_V: float = 24.0
    current_noise_V: float = 0.002
    # s: a cable that winds up
    cable_Nm_per_rad: float = 0.0


class Lead(Bridge):
    """The H-bridge and its supply: what the motor board's PWM makes of 24 V. `open`: a lead of the motor is off."""

    def __init__(self, supply_V: float) -> None:
        self.supply_V = supply_V
        self.duty = 0.0
        self.open = False

    def write_pwm(self, time: int, mr2: int, mr6: int, mr0: int) -> None:
        self.duty = (mr2 - mr6) / mr0


class Arm(Plant):
    """Motor and arm, at rest and hanging at `start_ns`."""

    def __init__(self, numbers: Numbers | None = None, seed: int = 0, start_ns: int = 0) -> None:
        Plant.__init__(self, STEP_NS, start_ns, voltages=1, samples=SAMPLES)
        self.numbers = n = numbers if numbers is not None else Numbers()
        self.lead = Lead(n.supply_V)
        self.bridges = [self.lead]
        self.encoder = IncrementalEncoder("arm", LINES, seed=seed)
        self.encoder.reset(0.0)
        self.encoders = [self.encoder]
        self.noise = RandomStream(seed, "current amplifier")
        self.angle_rad = self.rate_rad_per_s = self.current_A = self.voltage_V = 0.0
        self.mean_A = 0.0  # over the latest step
        self.analog_start[0] = self.analog_end[0] = ZERO_CURRENT_V
        self.step_s = STEP_NS * 1e-9
        self.decay = math.exp(-self.step_s * n.resistance_ohm / n.inductance_H)
        self.decayed_s = (1.0 - self.decay) * n.inductance_H / n.resistance_ohm

    def step(self) -> None:
        """Equations (1) to (4)."""
        n, h, rate, angle = self.numbers, self.step_s, self.rate_rad_per_s, self.angle_rad
        emf_V = n.torque_Nm_per_A * rate
        if self.lead.open:
            self.voltage_V, self.current_A, self.mean_A = emf_V, 0.0, 0.0
        else:
            self.voltage_V = self.lead.duty * self.lead.supply_V
            final_A = (self.voltage_V - emf_V) / n.resistance_ohm
            off_A = self.current_A - final_A
            self.mean_A = final_A + off_A * self.decayed_s / h
            self.current_A = final_A + off_A * self.decay
        torque = n.torque_Nm_per_A * self.mean_A - n.weight_Nm * math.sin(angle)
        torque -= n.viscous_Nms * rate + n.cable_Nm_per_rad * angle
        free = rate + h * torque / n.inertia_kg_m2
        held = h * n.coulomb_Nm / n.inertia_kg_m2
        self.rate_rad_per_s = 0.0 if abs(free) <= held else free - math.copysign(held, free)
        self.angle_rad = angle + 0.5 * h * (rate + self.rate_rad_per_s)
        end_ns = self.time_ns + STEP_NS
        self.encoder.update(self.time_ns, end_ns, angle, rate, self.angle_rad, self.rate_rad_per_s)
        self.analog_start[0] = self.analog_end[0]
        self.analog_end[0] = self.amplifier_V() + n.current_noise_V * self.noise.normal()
        self.time_ns = end_ns

    def amplifier_V(self) -> float:
        """What the amplifier shows without noise."""
        return ZERO_CURRENT_V + V_PER_A * self.current_A

    def fill_sample(self, row) -> None:
        row[0], row[1], row[2], row[3] = self.angle_rad, self.rate_rad_per_s, self.current_A, self.voltage_V

    def driven_A(self) -> float:
        """The current to which the bridge's voltage would bring the winding at this rate."""
        n = self.numbers
        return (self.lead.duty * self.lead.supply_V - n.torque_Nm_per_A * self.rate_rad_per_s) / n.resistance_ohm

    # --- for faults -----------------------------------------------------------------------------------------

    def encoder_rad(self, number: int) -> float:
        return self.angle_rad

    def analog_line(self, number: int) -> tuple[float, float, float]:
        return ZERO_CURRENT_V, V_PER_A, self.numbers.current_noise_V

    def analog_value(self, number: int) -> float:
        return self.current_A
