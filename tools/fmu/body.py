"""The body's interface for another simulator: parameters, inputs, steps, outputs. It does not depend on FMI.

Inputs are the outputs of the boards: the match registers of each motor's PWM unit, its low-side enables, and whether
its watchdog line moves. Outputs are the sensors' values at the end of a step, and the body's state. One step of the
plant (250 us) is the grid: inputs written before a step act from its begin, as in the whole robot
(harness/lockstep.py).
"""

from __future__ import annotations

import array
import dataclasses
import math
from typing import Any

from ranger_sim.boards.main_brain import controllers
from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant import body_files
from ranger_sim.plant.mechanics.parameters import BodyParameters, fault_of
from ranger_sim.plant.ranger import SAMPLES, STEP_NS, RangerPlant
from ranger_sim.plant.sensors.imu import (
    HEADER_ANGLES_AND_RATES,
    HEADER_RATES,
    SET_MODE,
    SET_MODE_SECOND,
    SET_MODE_THIRD,
    SILENT,
)
from ranger_sim.plant.wiring_points import ANALOG_NAMES, ENCODER_NAMES, MOTOR_NAMES, WORD_NAMES
from ranger_sim.ranger.scenario import Scenario

STEP_S = STEP_NS * 1e-9
# How far a time may lie from the grid: far above the rounding of a day's seconds, far below a step. Chosen by us.
NEAR_S = 1e-7
PERIOD_COUNTS = 600  # of the PWM: 100 kHz at 60 MHz (robot.md N4.4)
IMU_MODES = (SILENT, HEADER_RATES, HEADER_ANGLES_AND_RATES)
INTEGER_SAMPLES = ("mode", "steps")
STANCES = ("outer", "inner")
LARGEST_SEED = 2**63 - 1

PARAMETER, INPUT, OUTPUT = "parameter", "input", "output"
REAL, INTEGER, TRUTH, TEXT = "real", "integer", "truth", "text"
KINDS = {bool: TRUTH, float: REAL, str: TEXT, int: INTEGER}


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
    """The body behind the interface: `values` by name; `begin` builds it, `advance` moves it."""

    def __init__(self, given: dict[str, Any]) -> None:
        self.quantities = {each.name: each for each in quantities(given)}
        self.values: dict[str, Any] = {each.name: each.start for each in self.quantities.values()}
        self.plant: RangerPlant | None = None
        self.changed = False  # parameters, since it was built
        self.steps = 0  # of the plant, since it began
        self.holding = True
        self.imu_mode = SILENT
        self.written: list[tuple[int, ...]] = []
        self.samples = array.array("d", [0.0]) * len(SAMPLES)
        self.begin()  # outputs have values from the start, and an impossible parameter of the file is reported at once

    def set(self, name: str, value: Any) -> None:
        """Set a parameter before `begin`, or an input. UserError for a number beyond its limits, or anything else."""
        each = self.quantities[name]
        if name == "imu.mode" and value not in IMU_MODES:
            raise UserError(f"imu.mode is {value!r}, allowed are {', '.join(map(str, IMU_MODES))}")
        if each.limits is not None and not each.limits[0] <= value <= each.limits[1]:
            low, high = each.limits
            raise UserError(f"{name} is {value!r}, allowed are {low:g} to {high:g}{each.unit and ' ' + each.unit}")
        if each.causality == PARAMETER:
            if self.steps:
                raise UserError(f"{name} is fixed once the body has moved")
            self.changed = self.changed or value != self.values[name]
        self.values[name] = value

    def get(self, name: str) -> Any:
        """The value of a variable now. UserError when the parameters do not describe a possible body."""
        if self.changed:
            self.begin()
        return self.values[name]

    def begin(self) -> None:
        """Put the body in its pose at time 0, by the parameters. UserError for impossible parameters."""
        values = self.values
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
        self.steps = 0
        self.holding = True
        self.imu_mode = SILENT
        self.written = [(0, 0, PERIOD_COUNTS, True, True)] * len(MOTOR_NAMES)  # as a bridge is at power-up
        self._observe()

    def steps_in(self, time_s: float, length_s: float, start_s: float) -> int:
        """Steps of the plant from `time_s` on. UserError if not whole, or if the body is at another time."""
        here = start_s + self.steps * STEP_S
        if not abs(time_s - here) <= NEAR_S:  # also true of NaN
            raise UserError(f"a step from {time_s:.9g} s is asked for, the body is at {here:.9g} s")
        count = round(length_s / STEP_S) if math.isfinite(length_s) else 0
        if count < 1 or abs(length_s - count * STEP_S) > NEAR_S:
            raise UserError(
                f"a communication step of {length_s * 1e6:.9g} us: the body moves in steps of {STEP_NS // 1000} us, "
                "so whole multiples of that are possible"
            )
        return count

    def advance(self, count: int) -> bool:
        """Advance by `count` steps with the present inputs; False, and no further motion, when the body has fallen."""
        if self.changed:
            self.begin()
        plant = self.plant
        assert plant is not None
        for _ in range(count):
            if plant.fell:
                break
            self._act(plant)
            plant.step()
            self.steps += 1
        self._observe()
        return not plant.fell

    def _act(self, plant: RangerPlant) -> None:
        """Apply the inputs at the begin of a step."""
        values, now = self.values, plant.time_ns
        if self.holding and not values["held.now"]:
            self.holding = False
            plant.release(values["held.release_rate_rad_s"])
        for place, motor in enumerate(MOTOR_NAMES):
            bridge = plant.bridges[place]
            wanted = tuple(values[f"{motor}.{name}"] for name in ("match_2", "match_6", "period"))
            sides = (values[f"{motor}.low_side_2"], values[f"{motor}.low_side_6"])
            before = self.written[place]
            if wanted != before[:3]:
                bridge.write_pwm(now + round(1e9 * values[f"{motor}.delay_s"]), *wanted)
            if sides != before[3:]:
                bridge.low_side(now, *sides)
            self.written[place] = wanted + sides
            if values[f"{motor}.watchdog"]:
                bridge.watchdog_edge(now + round(1e9 * values[f"{motor}.watchdog_delay_s"]))
        if values["imu.mode"] != self.imu_mode:
            self.imu_mode = values["imu.mode"]
            for byte in (SET_MODE, SET_MODE_SECOND, SET_MODE_THIRD, self.imu_mode):
                plant.imu.receive_byte(now, byte)

    def _observe(self) -> None:
        """Read the sensors and the body's state."""
        plant, values = self.plant, self.values
        assert plant is not None
        for name, volts in zip(ANALOG_NAMES, plant.analog_end, strict=True):
            values[f"sensor.{name}_V"] = volts
        for name, word in zip(WORD_NAMES, plant.words, strict=True):
            values[f"sensor.{name}"] = word
        for name, encoder in zip(ENCODER_NAMES, plant.encoders, strict=True):
            values[f"sensor.{name}_edges"] = encoder.cell
        values["sensor.imu_roll_rad"], values["sensor.imu_rate_x_rad_s"] = plant.imu.roll, plant.imu.rate_x
        plant.fill_sample(self.samples)
        for name, number in zip(SAMPLES, self.samples, strict=True):
            values[f"state.{name}"] = int(number) if name in INTEGER_SAMPLES else number
        values["state.distance_m"], values["state.fell"] = plant.distance_m, plant.fell
