"""Motor stages whose truth is known: a motor of the plant, held and moved, sampled as slowly as the robot does."""

import dataclasses
import math

import numpy as np

from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.plant.electrics.motor_parameters import ANKLE_MOTOR, GATE_SCHEMES, MotorParameters
from ranger_sim.plant.electrics.motor_unit import MotorUnit
from ranger_sim.sysid.dataset import Channel, Dataset

STEP_NS = 250_000
SLOT_NS = 500_000
COUNTS = 600
COUNT_A = 0.000502  # of the battery's current


def between(random: RandomStream, low: float, high: float) -> float:
    """A number drawn evenly."""
    return low + (high - low) * random.uniform()


@dataclasses.dataclass
class Drive:
    """One stage; `truth` as `motor_stage.simulated_of` has it. `brushes_V`: scatter of V_c from hold to hold."""

    motor: MotorParameters
    seed: int
    brushes_V: float = 0.04
    meter_scale: float = 1.0
    lag_s: float = 0.004

    def __post_init__(self) -> None:
        self.random = RandomStream(self.seed, "motor drive")
        self.now_ns = 0
        self.unit = MotorUnit("m", self.motor)
        self.channels: dict[str, list[tuple[float, float]]] = {
            name: [] for name in ("BATT_POWER", "MOTOR_CURRENT", "MOTOR_VELOCITY", "MOTOR_POSITION", "BATT_VOLTAGE")
        }

    def steady(self, amps: float, rate: float, volts: float) -> tuple[float, float]:
        """(power, current) over four slots at the duty for this current; the leads take turns."""
        m = self.motor
        wanted = (
            m.loop_resistance_ohm * amps
            + math.copysign(self.unit.contact_drop_V, amps)
            + m.gear * m.torque_constant_Nm_per_A * rate
        )
        counts = round(COUNTS * wanted / volts) if amps else 0
        joule = flown = 0.0
        unit, taken = self.unit, 0
        for slot in range(6):
            first, second = (counts, 0) if counts >= 0 else (0, -counts)
            if slot % 2:
                first, second = COUNTS - second, COUNTS - first
                if not counts:
                    second = COUNTS - 1  # the current loop leaves no current
            unit.drive.watchdog_edge(self.now_ns)
            unit.drive.write_pwm(self.now_ns, first, second, COUNTS)
            for _ in range(2):
                before = unit.battery_J()
                unit.step_electrical(self.now_ns, self.now_ns + STEP_NS, rate, volts)
                self.now_ns += STEP_NS
                if slot >= 2:
                    joule += unit.battery_J() - before
                    flown += unit.mean_current_A
                    taken += 1
        return joule / (taken * STEP_NS * 1e-9), flown / taken

    def put(self, name: str, time_s: float, value: float) -> None:
        """Add a sample of a channel."""
        self.channels[name].append((time_s, value))

    def meter(self, power: float, volts: float) -> float:
        """The power as the board's meter shows it, W."""
        amps = self.meter_scale * power / volts + COUNT_A * self.random.normal()
        return volts * COUNT_A * round(amps / COUNT_A)

    def record(self, holds: int = 24, moving_s: float = 40.0) -> Dataset:
        """A dataset of `holds` holds, each with a rest after it, and a motion of 0.5 Hz sampled every 30 ms."""
        random, time_s, angle = self.random, 0.0, 0.0
        for _ in range(holds):
            angle += 0.3
            amps = math.copysign(between(random, 0.15, 4.0), random.uniform() - 0.5)
            for size in (amps, 0.0):
                self.unit.contact_drop_V = self.motor.contact_drop_V + self.brushes_V * random.normal()
                volts = between(random, 22.0, 28.0)
                for _ in range(3):
                    power, flows = self.steady(size, 0.0, volts)
                    self.put("MOTOR_VELOCITY", time_s, 0.0)
                    self.put("MOTOR_CURRENT", time_s + 0.005, flows + 0.003 * random.normal())
                    self.put("MOTOR_POSITION", time_s + 0.01, angle)
                    self.put("BATT_POWER", time_s + 0.06, self.meter(power, volts))
                    self.put("BATT_VOLTAGE", time_s + 0.08, volts)
                    time_s += 2.0
        self.unit.contact_drop_V = self.motor.contact_drop_V
        begin = time_s
        while time_s < begin + moving_s:
            phase = math.pi * (time_s - begin)
            rate, amps = 4.0 * math.cos(phase), 1.2 * math.sin(phase + 0.6)
            power, flows = self.steady(amps, rate, 25.0)
            self.put("MOTOR_VELOCITY", time_s, rate)
            self.put("MOTOR_POSITION", time_s, angle + 4.0 / math.pi * math.sin(phase))
            self.put("MOTOR_CURRENT", time_s + self.lag_s, flows + 0.003 * random.normal())
            self.put("BATT_POWER", time_s, self.meter(power, 25.0))
            self.put("BATT_VOLTAGE", time_s, 25.0)
            time_s += 0.03
        made = {}
        for name, pairs in self.channels.items():
            stamps, values = np.array(pairs).T
            made[f"MCFO_{name}"] = Channel(f"MCFO_{name}", "", stamps, values)
        return Dataset(f"drive {self.seed}", made)


def drawn(seed: int) -> MotorParameters:
    """A motor with everything that the law has drawn anew."""
    random = RandomStream(seed, "drawn motor")
    return dataclasses.replace(
        ANKLE_MOTOR,
        resistance_ohm=between(random, 0.7, 1.9),
        contact_drop_V=between(random, 0.25, 1.0),
        gate_power_W=between(random, 0.08, 0.4),
        gate_scheme=GATE_SCHEMES[random.uniform() < 0.5],
    )
