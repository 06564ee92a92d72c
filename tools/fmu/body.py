"""The body's interface for another simulator: parameters, inputs, steps, outputs. It does not depend on FMI.

Inputs are the outputs of the boards: the match registers of each motor's PWM unit, its low-side enables, and whether
its watchdog line moves. Outputs are the sensors' values at the end of a step, and the body's state. One step of the
plant (250 us) is the grid: inputs written before a step act from its begin, as in the whole robot
(harness/lockstep.py).
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from ranger_sim.boards.main_brain import controllers
from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant import body_files
from ranger_sim.plant.mechanics.parameters import BodyParameters, fault_of
from ranger_sim.plant.ranger import SAMPLES, STEP_NS, RangerPlant
from ranger_sim.plant.sensors.imu import HEADER_ANGLES_AND_RATES, HEADER_RATES, SILENT
from ranger_sim.plant.wiring_points import ANALOG_NAMES, ENCODER_NAMES, MOTOR_NAMES, WORD_NAMES
from ranger_sim.ranger.scenario import Scenario
from ranger_sim.tools.fmu import stepper
from ranger_sim.tools.fmu.stepper import PERIOD_COUNTS, STEP_S

IMU_MODES = (SILENT, HEADER_RATES, HEADER_ANGLES_AND_RATES)
INTEGER_SAMPLES = ("mode", "steps")
STANCES = ("outer", "inner")
LARGEST_SEED = 2**63 - 1

PARAMETER, INPUT, OUTPUT = "parameter", "input", "output"
REAL, INTEGER, TRUTH, TEXT = "real", "integer", "truth", "text"
KINDS = {bool: TRUTH, float: REAL, str: TEXT, int: INTEGER}
NUMBERS = {REAL: stepper.REAL, INTEGER: stepper.INTEGER, TRUTH: stepper.TRUTH}


@dataclasses.dataclass(frozen=True)
class Quantity:
    """One variable of the interface. `start`: of parameters and inputs. `limits`: of numbers, inclusive; None: any."""

    name: str
    causality: str
    kind: str
    unit: str
    description: str
    start: Any = None
    limits: tuple[float, float] | None = None


def quantities(given: dict[str, Any]) -> tuple[Quantity, ...]:
    """The interface of a body; `given`: start values, as `given_of` makes them; JSON can hold them."""
    return (*_parameters(given), *_inputs(), *_outputs())


def _parameters(given: dict[str, Any]) -> list[Quantity]:
    """The values fixed before the first step: every number of the body's table, floor, seed, and the held pose."""
    found = []
    for key in body_files.keys().values():
        value = given["body"][key.name]
        what = f"{key.metadata['source']}; allowed: {key.limits}"
        limits = key.metadata.get("limits")
        unit = "" if key.metadata["unit"] == "1" else key.metadata["unit"]
        found.append(Quantity(f"body.{key.name}", PARAMETER, KINDS[type(value)], unit, what, value, limits))
    texts = {
        "seed": ("", "of every noise and foothold"),
        "floor.slope_rad": ("rad", "positive downhill"),
        "floor.roughness_m": ("m", "standard deviation of the footholds' heights"),
        "battery.charge": ("", "at power-up, 1 is full"),
        "battery.capacity_Wh": ("W h", "of all packs together"),
        "held.stance": ("", "the legs that stand while it is held: outer or inner"),
        "held.lean_rad": ("rad", "theirs, forward of vertical"),
        "held.hip_angle_rad": ("rad", "inner legs ahead"),
        "held.outer_ankle_rad": ("rad", "as the joint measures it"),
        "held.inner_ankle_rad": ("rad", "as the joint measures it"),
        "held.release_rate_rad_s": ("rad/s", "of the legs when it is let go, forward"),
    }
    for name, (unit, what) in texts.items():
        value = given[name]
        limits = (0.0, LARGEST_SEED) if name == "seed" else None
        found.append(Quantity(name, PARAMETER, KINDS[type(value)], unit, what, value, limits))
    return found


def _inputs() -> list[Quantity]:
    """Outputs of the boards, and the person who holds the robot."""
    found = []
    for motor in MOTOR_NAMES:
        for lead in (2, 6):
            what = f"match register {lead} of the board's PWM unit: counts for which lead {lead} is high"
            found.append(Quantity(f"{motor}.match_{lead}", INPUT, INTEGER, "", what, 0, (0, 0x7FFFFFFF)))
        what = "match register 0: counts of a period; (match_2 - match_6) / period is the share of the battery voltage"
        found.append(Quantity(f"{motor}.period", INPUT, INTEGER, "", what, PERIOD_COUNTS, (1, 0x7FFFFFFF)))
        what = "the match registers are written so long after the communication point, where the board's slot goes on"
        found.append(Quantity(f"{motor}.delay_s", INPUT, REAL, "s", what, 0.0, (0.0, (STEP_NS - 1) * 1e-9)))
        for lead in (2, 6):
            what = f"low-side enable of lead {lead}; while one is off the winding only freewheels"
            found.append(Quantity(f"{motor}.low_side_{lead}", INPUT, TRUTH, "", what, True))
        what = "the board's watchdog line moves; 10 ms after it has stopped the bridge has no power"
        found.append(Quantity(f"{motor}.watchdog", INPUT, TRUTH, "", what, False))
        what = "it moves so long after the communication point; below 0: the slot before it moved it"
        limits = ((1 - STEP_NS) * 1e-9, (STEP_NS - 1) * 1e-9)
        found.append(Quantity(f"{motor}.watchdog_delay_s", INPUT, REAL, "s", what, 0.0, limits))
    modes = "0 none, 194 rates, 207 angles and rates, as the robot's user interface asks for"
    found.append(Quantity("imu.mode", INPUT, INTEGER, "", f"packets that the inertial unit is to send: {modes}", 207))
    what = "a person holds the robot in its pose; false lets it go, for good"
    return [*found, Quantity("held.now", INPUT, TRUTH, "", what, True)]


def _outputs() -> list[Quantity]:
    """Sensors at the end of the step, and the body."""
    found = [
        Quantity(f"sensor.{name}_V", OUTPUT, REAL, "V", "at the converter's pin; differential inputs: the difference")
        for name in ANALOG_NAMES
    ]
    what = "word of the 13-bit encoder, as its serial interface has it in the next step"
    found += [Quantity(f"sensor.{name}", OUTPUT, INTEGER, "", what) for name in WORD_NAMES]
    what = "edges of channel A below the present position: what a perfect 2X decoder holds"
    found += [Quantity(f"sensor.{name}_edges", OUTPUT, INTEGER, "", what) for name in ENCODER_NAMES]
    found += [
        Quantity("sensor.imu_roll_rad", OUTPUT, REAL, "rad", "inertial unit, of its last sample"),
        Quantity("sensor.imu_rate_x_rad_s", OUTPUT, REAL, "rad/s", "inertial unit, of its last sample"),
    ]
    for name, unit in SAMPLES.items():
        kind = INTEGER if name in INTEGER_SAMPLES else REAL
        found.append(Quantity(f"state.{name}", OUTPUT, kind, unit, "of the body, as in the files of a walk"))
    found.append(Quantity("state.distance_m", OUTPUT, REAL, "m", "walked since it was let go"))
    return [*found, Quantity("state.fell", OUTPUT, TRUTH, "", "it can go no further")]


def given_of(scenario: Scenario) -> dict[str, Any]:
    """Start values of all parameters: a walk's body, floor, batteries, and the held pose of its controller."""
    held = controllers.load(scenario.controller).operator
    return {
        "body": dict(body_files.load(scenario.body).values),
        "seed": scenario.seed,
        "floor.slope_rad": scenario.slope_rad,
        "floor.roughness_m": scenario.floor_roughness_m,
        "battery.charge": scenario.battery_charge,
        "battery.capacity_Wh": scenario.battery_capacity_Wh,
        "held.stance": held.stance,
        "held.lean_rad": held.lean_rad,
        "held.hip_angle_rad": held.hip_angle_rad,
        "held.outer_ankle_rad": held.outer_ankle_rad,
        "held.inner_ankle_rad": held.inner_ankle_rad,
        "held.release_rate_rad_s": held.release_rate_rad_per_s,
    }


class ExportedBody:
    """The body behind the interface: `set` and `get` by name; `begin` builds it, `advance` moves it.

    `stepper` has the same inputs and outputs as an array, for many at once.
    """

    def __init__(self, given: dict[str, Any]) -> None:
        self.quantities = {each.name: each for each in quantities(given)}
        self.parameters = {each.name: each.start for each in self.quantities.values() if each.causality == PARAMETER}
        moving = [each for each in self.quantities.values() if each.causality != PARAMETER]
        self.places = {each.name: place for place, each in enumerate(moving)}
        limits = [each.limits or (-math.inf, math.inf) for each in moving]
        low, high = zip(*limits, strict=True)
        self.stepper = stepper.Stepper([NUMBERS[each.kind] for each in moving], low, high)
        for each in moving:
            if each.causality == INPUT:
                self.stepper.set_value(self.places[each.name], each.start)
        self.plant: RangerPlant | None = None
        self.changed = False  # parameters, since it was built
        self.begin()  # outputs have values from the start, and an impossible parameter of the file is reported at once

    @property
    def steps(self) -> int:
        """Steps of the plant since it began."""
        return self.stepper.steps

    @property
    def values(self) -> dict[str, Any]:
        """The present values of all variables, by name."""
        return {name: self.get(name) for name in self.quantities}

    def set(self, name: str, value: Any) -> None:
        """Set a parameter before `begin`, or an input. UserError for a number beyond its limits, or anything else."""
        each = self.quantities[name]
        if name == "imu.mode" and value not in IMU_MODES:
            raise UserError(f"imu.mode is {value!r}, allowed are {', '.join(map(str, IMU_MODES))}")
        if each.limits is not None and not each.limits[0] <= value <= each.limits[1]:
            low, high = each.limits
            raise UserError(f"{name} is {value!r}, allowed are {low:g} to {high:g}{each.unit and ' ' + each.unit}")
        if each.kind == INTEGER and value != int(value):
            raise UserError(f"{name} is {value!r}, a whole number is expected")
        if each.causality == INPUT:
            self.stepper.set_value(self.places[name], value)
            return
        if each.causality == OUTPUT:
            raise UserError(f"{name} is an output: it cannot be set")
        if self.steps:
            raise UserError(f"{name} is fixed once the body has moved")
        self.changed = self.changed or value != self.parameters[name]
        self.parameters[name] = value

    def get(self, name: str) -> Any:
        """The value of a variable now. UserError when the parameters do not describe a possible body."""
        self.begin_if_changed()
        return self.parameters[name] if name in self.parameters else self.stepper.value(self.places[name])

    def begin_if_changed(self) -> None:
        """Begin again if a parameter has changed since the body was built."""
        if self.changed:
            self.begin()

    def begin(self) -> None:
        """Put the body in its pose at time 0, by the parameters. UserError for impossible parameters."""
        values = self.parameters
        of_body = {key: values[f"body.{key}"] for key in body_files.keys()}
        faults = [fault for key, value in of_body.items() if (fault := fault_of(body_files.keys()[key], value))]
        if values["held.stance"] not in STANCES:
            faults.append(f"held.stance is {values['held.stance']!r}, allowed are {' and '.join(STANCES)}")
        if faults:
            raise UserError("; ".join(faults))
        names = {field.name for field in dataclasses.fields(BodyParameters)}
        mechanics = BodyParameters(**{key: value for key, value in of_body.items() if key in names})
        whole = dataclasses.replace(
            body_files.load("appendix"), values=of_body, changes={}, sources={}, parameters=mechanics
        )
        scenario = Scenario(
            seed=values["seed"],
            slope_rad=values["floor.slope_rad"],
            floor_roughness_m=values["floor.roughness_m"],
            battery_charge=values["battery.charge"],
            battery_capacity_Wh=values["battery.capacity_Wh"],
        )
        self.plant = RangerPlant(
            seed=scenario.seed,
            slope_rad=scenario.slope_rad,
            floor_roughness_m=scenario.floor_roughness_m,
            parameters=whole.parameters,
            electrics=scenario.electrics(whole.electrics),
        )
        self.plant.hold(
            stance=values["held.stance"],
            lean_rad=values["held.lean_rad"],
            hip_angle_rad=values["held.hip_angle_rad"],
            outer_ankle_rad=values["held.outer_ankle_rad"],
            inner_ankle_rad=values["held.inner_ankle_rad"],
        )
        self.changed = False
        self.stepper.begin(self.plant, values["held.release_rate_rad_s"])

    def steps_in(self, time_s: float, length_s: float, start_s: float) -> int:
        """Steps of the plant from `time_s` on. UserError if not whole, or if the body is at another time."""
        count: int = self.stepper.whole_steps(time_s - start_s, length_s)
        if count < 0:
            here_s = start_s + self.steps * STEP_S
            raise UserError(f"a step from {time_s:.9g} s is asked for, the body is at {here_s:.9g} s")
        if count == 0:
            raise UserError(
                f"a communication step of {length_s * 1e6:.9g} us: the body moves in steps of {STEP_NS // 1000} us, "
                "so whole multiples of that are possible"
            )
        return count

    def advance(self, count: int) -> bool:
        """Advance by `count` steps with the present inputs; False, and no further motion, when the body has fallen."""
        self.begin_if_changed()
        return self.stepper.advance(count)
