"""The table of wires between another simulator's model and the boards: which of its names is which drive or sensor.

Places in the lists are the numbers that a `Wiring` names: bridge 0 is `drives[0]`, encoder 0 is `encoders[0]`.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import ModelError
from ranger_sim.plant.bridge import Bridge
from ranger_sim.plant.plant import Plant
from ranger_sim.plant.sensors.incremental_encoder import IncrementalEncoder


@dataclasses.dataclass(frozen=True)
class Drive:
    """A bridge, a motor's winding, and MuJoCo's actuator of this name; or its joint, where no actuator acts on it.

    The current i runs to (duty supply_V - emf_Vs v) / resistance_ohm with the time constant L / R, v being the
    actuator's velocity; the actuator's force is `most_force` i / `most_A`, within `most_force`. lag_s: the force
    follows that with a first-order lag. most_force: N or N m before the actuator's gear; None: the limit in the model.

    The defaults are chosen by us: a full duty at standstill gives twice the largest current, after 0.5 ms.
    """

    actuator: str
    most_A: float = 10.0
    most_force: float | None = None
    supply_V: float = 24.0
    resistance_ohm: float = 1.2
    inductance_H: float = 0.6e-3
    emf_Vs: float = 0.0  # MuJoCo's own actuators have none
    lag_s: float = 0.0


@dataclasses.dataclass(frozen=True)
class Input:
    """A bridge that sets an input of an FMI unit to `per_duty` times its duty, within `low` and `high`."""

    variable: str
    per_duty: float = 1.0
    low: float = -math.inf
    high: float = math.inf


@dataclasses.dataclass(frozen=True)
class Encoder:
    """An incremental encoder with `lines` lines at a joint; `gear`: its turns for one of the joint (2 pi m of a slide).

    For an FMI unit `joint` is the output that is the angle, and `rate` the one that is its derivative.
    """

    joint: str
    lines: int = 1000
    gear: float = 1.0
    rate: str = ""


@dataclasses.dataclass(frozen=True)
class Voltage:
    """An analog sensor: zero_V + V_per_unit x value + noise, within 0 and 3.3 V.

    source: a drive's actuator (its current, A), a sensor of the MuJoCo model, or an output of the FMI unit; component:
    of a sensor with several, as 0, 1, 2 of a gyro.
    """

    source: str
    component: int = 0
    zero_V: float = 1.65
    V_per_unit: float = 1.0
    noise_V: float = 0.0


@dataclasses.dataclass(frozen=True)
class Word:
    """A digital sensor: a signed word of `bits` bits, value x per_unit, saturated. source, component: as of Voltage."""

    source: str
    component: int = 0
    per_unit: float = 1.0
    bits: int = 16


@dataclasses.dataclass(frozen=True)
class Mapping:
    """All wires of a body. Names are those of the model file."""

    drives: Sequence[Drive | Input] = ()
    encoders: Sequence[Encoder] = ()
    voltages: Sequence[Voltage] = ()
    words: Sequence[Word] = ()


class Duty(Bridge):
    """What a board's PWM unit does: a share of full voltage, -1 to 1."""

    def __init__(self) -> None:
        self.duty = 0.0

    def write_pwm(self, time: int, mr2: int, mr6: int, mr0: int) -> None:
        self.duty = (mr2 - mr6) / mr0


class MappedBody(Plant):
    """A body whose sensors follow a Mapping. Subclasses implement `advance`, `angles` and `readings`.

    step_ns: of the boards' view; within it the other simulator has its own steps. Same model, mapping and seed, same
    bytes. The whole state is in this process: a forked branch continues from it.
    """

    def __init__(self, where: str, step_ns: int, mapping: Mapping, samples: dict[str, str], seed: int) -> None:
        super().__init__(step_ns, 0, len(mapping.voltages), len(mapping.words), samples)
        self.mapping = mapping
        self.bridges = [Duty() for _ in mapping.drives]
        self.encoders = []
        for each in mapping.encoders:
            if each.lines < 1 or not each.gear > 0.0:
                raise ModelError(f"{where}: encoder {each.joint}: {each.lines} lines, gear {each.gear} are impossible")
            self.encoders.append(IncrementalEncoder(each.joint, each.lines, each.gear, seed=seed))
        for word in mapping.words:
            if not 2 <= word.bits <= 32:
                raise ModelError(f"{where}: word {word.source}: {word.bits} bits; allowed are 2 to 32")
        self.noise = [RandomStream(seed, f"voltage {number}") for number in range(len(mapping.voltages))]
        self.shown: list[tuple[float, float]] = []  # angle and rate at each encoder

    def begin(self) -> None:
        """Show the initial state: call it at the end of the subclass's `__init__`."""
        self.shown = self.angles()
        for encoder, (angle, _) in zip(self.encoders, self.shown, strict=True):
            encoder.reset(angle)
        self._show_readings()
        self.analog_start[:] = self.analog_end

    def advance(self) -> None:
        """Pass one step, with the bridges' duties."""
        raise NotImplementedError

    def angles(self) -> list[tuple[float, float]]:
        """(rad, rad/s) at each encoder."""
        raise NotImplementedError

    def readings(self) -> list[float]:
        """What is behind each voltage, then behind each word, in the unit of the model."""
        raise NotImplementedError

    def step(self) -> None:
        """Pass one step, then show it."""
        self.advance()
        before, self.shown = self.shown, self.angles()
        end_ns = self.time_ns + self.step_ns
        for encoder, old, new in zip(self.encoders, before, self.shown, strict=True):
            encoder.update(self.time_ns, end_ns, old[0], old[1], new[0], new[1])
        self._show_readings()
        self.time_ns = end_ns

    def _show_readings(self) -> None:
        values = self.readings()
        for number, wire in enumerate(self.mapping.voltages):
            volts = wire.zero_V + wire.V_per_unit * values[number]
            if wire.noise_V:
                volts += wire.noise_V * self.noise[number].normal()
            self.analog_start[number] = self.analog_end[number]
            self.analog_end[number] = min(3.3, max(0.0, volts))
        for number, (word, value) in enumerate(
            zip(self.mapping.words, values[len(self.mapping.voltages) :], strict=True)
        ):
            most = (1 << word.bits - 1) - 1
            self.words[number] = int(min(most, max(-most - 1, round(word.per_unit * value)))) & (1 << word.bits) - 1

    # --- for faults ------------------------------------------------------------------------------------------

    def encoder_rad(self, number: int) -> float:
        return self.shown[number][0]

    def analog_line(self, number: int) -> tuple[float, float, float]:
        wire = self.mapping.voltages[number]
        return wire.zero_V, wire.V_per_unit, wire.noise_V

    def analog_value(self, number: int) -> float:
        return self.readings()[number]


def substeps(step_ns: int, longest_s: float) -> int:
    """How many equal steps of at most `longest_s` make up `step_ns`."""
    return max(1, math.ceil(step_ns * 1e-9 / longest_s - 1e-9))


def component_of(where: str, wire: Any, size: int) -> int:
    """The component that a wire names. ModelError where its source has fewer."""
    if not 0 <= wire.component < size:
        raise ModelError(f"{where}: {wire.source} component {wire.component}: it has {size}, counted from 0")
    number: int = wire.component
    return number
