"""The walk in numbers."""

import dataclasses
import math
from typing import Any

from ranger_sim import loading
from ranger_sim.boards.counters import RangerCounters
from ranger_sim.datatable.generated import errors as error_table
from ranger_sim.firmware_sim.native import confinement
from ranger_sim.harness.outside.machine import Elsewhere
from ranger_sim.harness.records.vital_signs import alive, can

JOULES_PER_WH = 3600.0
COVERAGE = ("lines", "covered", "branches", "taken")


def of(robot: Any) -> dict:
    """Everything `--json` prints; units are in the names. Means leave out the first 5 steps.

    None for an undefined number: a mean of no step, a deviation of fewer than two, a power of no time.
    """
    plant = robot.plant
    record = plant.record
    speed = record.length_sum / record.time_sum_s if record.time_sum_s > 0.0 else None
    powers = motor_powers(robot)
    electronics_power = plant.electronics_power_W
    motor_power = None if None in powers.values() else sum(powers.values())
    total = None if motor_power is None else motor_power + electronics_power
    weight_N = plant.parameters.total_mass_kg * plant.parameters.gravity_m_per_s2
    counters: dict[str, RangerCounters] = robot.counters()
    failed = [name for name, board in counters.items() if has_failed(robot, name, board)]
    return {
        "steps": plant.steps,
        "fell": bool(plant.fell),
        "fall_cause": plant.fall_cause or None,
        "failed_boards": failed,
        "distance_m": plant.distance_m,
        "time_s": robot.time_s,
        "walked_h": robot.walked_s / 3600.0,
        "mean_step_length_m": record.mean_step_length_m(),
        "std_step_length_m": record.step_length_deviation_m(),
        "mean_step_time_s": record.mean_step_time_s(),
        "std_step_time_s": record.step_time_deviation_s(),
        "double_stance_s": record.mean_double_stance_s(),
        "speed_m_per_s": speed,
        "motor_power_W": motor_power,
        "motor_powers_W": powers,
        "electronics_power_W": electronics_power,
        "total_power_W": total,
        "tcot": total / (weight_N * speed) if total is not None and speed else None,
        "energy_Wh": energy(robot),
        "battery": battery(robot),
        "battery_V": plant.battery_V,
        "heel_strike_delay_ms": robot.loop.strikes.statistics(),
        "oddities": oddities(plant),
        "can": {bus.name: can(robot, bus, counters) for bus in robot.buses},
        "slots": {name: slots(board) for name, board in counters.items()},
        "errors": {name: errors(board) for name, board in counters.items()},
        "realtime_factor": robot.realtime_factor(),
        "cpu_factor": robot.time_s / robot.cpu_s if robot.cpu_s > 0.0 else None,
        "compiled": loading.RUNS_COMPILED,
        "controller": robot.scenario.controller,
        "body": robot.scenario.body,
        "profile": robot.profile.name if robot.profile is not None else None,
        "model_file": robot.scenario.model_file,
        "seed": robot.scenario.seed,
        "slope_rad": robot.scenario.slope_rad,
        "floor_roughness_m": robot.scenario.floor_roughness_m,
        "electronics_off": list(robot.scenario.electronics_off),
        "firmware": {name: firmware(robot, name) for name in robot.firmware},
        "images": {name: image(robot, name) for name in robot.images},
        "faults": [fault.summary() for fault in robot.faults],
        "trace_digest": robot.trace_digest(),
    }


def motor_powers(robot: Any) -> dict:
    """Mean power each motor drew at the battery since the robot was let go, W; what it gave back is not credited.

    None for every motor as long as no time has passed.
    """
    plant = robot.plant
    walked_s = (plant.time_ns - plant.record.begin_ns) * 1e-9
    if walked_s <= 0.0:
        return dict.fromkeys((motor.name for motor in plant.motors), None)
    return {motor.name: (motor.drawn_J - motor.drawn_before_J) / walked_s for motor in plant.motors}


def energy(robot: Any) -> dict:
    """What each consumer took from the battery since the robot was let go, Wh; returned energy is not credited.

    A motor's part includes its losses: winding, brushes, bridge, friction.
    """
    parts = {motor.name: (motor.drawn_J - motor.drawn_before_J) / JOULES_PER_WH for motor in robot.plant.motors}
    parts["electronics"] = robot.plant.electronics_power_W * robot.walked_s / JOULES_PER_WH
    return {**parts, "total": sum(parts.values())}


def battery(robot: Any) -> dict:
    """State of the batteries, and what they gave since power-up: at their terminals, and as heat inside.

    Charge is of the capacity, 1 full; what motors gave back has been charged. empty: their protection has opened.
    """
    packs = robot.plant.electrics.battery
    return {
        "capacity_Wh": robot.scenario.battery_capacity_Wh,
        "charge_at_start": packs.parameters.charge,
        "charge": max(0.0, packs.charge),
        "delivered_Wh": packs.delivered_J / JOULES_PER_WH,
        "lost_inside_Wh": packs.lost_J / JOULES_PER_WH,
        "empty": bool(packs.cut_off),
    }


def oddities(plant: Any) -> dict:
    """Events of the model that a textbook gait does not have; each is a count or a worst value of the walk.

    None where nothing was measured: no step, or strikes that last (contact "compliant") and have no impulse.
    """
    record, seen = plant.record, plant.body.seen
    struck = record.steps > 0 and not plant.body.compliant
    return {
        "contact": plant.parameters.contact,
        "touches": record.touches,
        "lift_offs": record.lift_offs,
        "bounces": record.bounces,
        "recontacts": record.recontacts,
        "scuffs": record.scuffs,
        "flights": record.flights,
        "slides": record.slides,
        "jams": record.jams,
        "lead_lifts": record.lead_lifts,
        "tensile_strikes": record.tensile_strikes if struck else None,
        "tensile_impulse_min_Ns": record.tensile_impulse_min_Ns if struck else None,
        "friction_ratio_max": seen.friction_ratio_max or None,
        "slip_s": seen.slip_s,
        "normal_force_min_N": seen.normal_force_min if math.isfinite(seen.normal_force_min) else None,
        "pull_s": seen.pull_s,
        "min_clearance_m": record.min_clearance_m if record.steps > 1 else None,
    }


def slots(counters: RangerCounters) -> dict:
    """Timing of one board's slots; interrupts included."""
    kept = counters.slots
    return {
        "count": kept.count,
        "overruns": kept.overruns,
        "max_execution_us": kept.max_cycles * 1e6 / counters.hz,
        "budget_us": kept.slot_ns / 1000.0,
    }


def errors(counters: RangerCounters) -> dict:
    """Errors that the board itself recorded, by name."""
    return {name: counters.errors[code] for code, name in error_table.NAMES.items() if counters.errors[code]}


def firmware(robot: Any, board: str) -> dict:
    """The end of a board's program in C, the findings in it, and its coverage."""
    made = robot.firmware[board]
    death = next((each for each in robot.deaths if each["board"] == board), None)
    if not robot.loop.board(board).out_of_process:
        robot.loop.board(board).write_counts()
    return {
        "name": made.manifest.name,
        "folder": str(made.folder),
        "own_process": bool(robot.loop.board(board).out_of_process),
        "confined": confinement.describe(robot.programs_in_c.lacks(board)),
        "lost_s": death["time_s"] if death is not None else None,
        "why": cause_of(death) if death is not None else None,
        "findings": [dataclasses.asdict(each) for each in found_in(robot, board)],
        "coverage": ran(made, is_whole=death is None or bool(death["why"])),
    }


def has_failed(robot: Any, name: str, counters: RangerCounters) -> bool:
    """Whether a board that runs here was lost, or no longer does its slots' work."""
    board = robot.loop.board(name)
    is_lost = any(death["board"] == name for death in robot.deaths)
    if isinstance(board, Elsewhere):
        return is_lost
    return (is_lost and getattr(board, "gone", False)) or not alive(robot, counters)


def image(robot: Any, board: str) -> dict:
    """The firmware image of a board, and its end."""
    death = next((each for each in robot.deaths if each["board"] == board), None)
    return {
        "file": str(robot.images[board].path),
        "lost_s": death["time_s"] if death is not None else None,
        "why": cause_of(death) if death is not None else None,
    }


def cause_of(death: dict) -> str | None:
    """The cause of the end of a board's process, as far as known."""
    return death["why"] or (f"its process {death['how']}" if "how" in death else None)


def found_in(robot: Any, board: str) -> list[Any]:
    """The findings in a board's program; of boards with the same source, the first reports them."""
    folder = robot.firmware[board].folder
    first = next(name for name, each in robot.firmware.items() if each.folder == folder)
    return robot.firmware[board].findings() if first == board else []


def ran(made: Any, is_whole: bool) -> dict:
    """How much of a program in C ran; None for all figures where coverage was not counted."""
    files = [each.figures(made.folder) for each in made.ran()]
    sums = {key: sum(each[key] for each in files) if made.coverage else None for key in COVERAGE}
    return {**sums, "whole": is_whole if made.coverage else None, "files": files}
