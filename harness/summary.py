"""The walk in numbers."""

from typing import Any

from ranger_sim import loading
from ranger_sim.datatable.generated import errors as error_table
from ranger_sim.harness import wiring

MASS_KG, GRAVITY = 9.91, 9.81  # total cost of transport: appendix 1, table of the walk
SKIPPED_STEPS = 5  # the start is left out of means


def of(robot: Any) -> dict:
    """Everything `--json` prints; units are in the names. Means leave out the first 5 steps."""
    plant = robot.plant
    record = plant.record
    speed = record.length_sum / record.time_sum_s if record.time_sum_s > 0.0 else 0.0
    powers = motor_powers(robot)
    motor_power = sum(powers.values())
    electronics_power = plant.electronics_power_W
    total = motor_power + electronics_power
    failed = [name for name, board in robot.boards.items() if not alive(robot, name, board)]
    return {
        "steps": plant.steps,
        "fell": bool(plant.fell),
        "fall_cause": plant.fall_cause or None,
        "failed_boards": failed,
        "distance_m": plant.distance_m,
        "time_s": robot.time_s,
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
        "tcot": total / (MASS_KG * GRAVITY * speed) if speed > 0.0 else None,
        "battery_V": plant.battery_V,
        "heel_strike_delay_ms": robot.loop.strikes.statistics(),
        "oddities": oddities(plant),
        "can": {bus.name: can(robot, bus) for bus in robot.buses},
        "slots": {name: slots(board) for name, board in robot.boards.items()},
        "errors": {name: errors(board) for name, board in robot.boards.items()},
        "realtime_factor": robot.realtime_factor(),
        "cpu_factor": robot.time_s / robot.cpu_s if robot.cpu_s > 0.0 else None,
        "compiled": loading.RUNS_COMPILED,
        "controller": robot.scenario.controller,
        "profile": robot.profile.name if robot.profile is not None else None,
        "model_file": robot.scenario.model_file,
        "seed": robot.scenario.seed,
        "slope_rad": robot.scenario.slope_rad,
        "floor_roughness_m": robot.scenario.floor_roughness_m,
        "trace_digest": robot.trace_digest(),
    }


def motor_powers(robot: Any) -> dict:
    """Mean power each motor drew at the battery since the robot was let go, W; what it gave back is not credited."""
    plant = robot.plant
    walked_s = (plant.time_ns - plant.record.begin_ns) * 1e-9
    if walked_s <= 0.0:
        return dict.fromkeys((motor.name for motor in plant.motors), 0.0)
    return {motor.name: (motor.drawn_J - motor.drawn_before_J) / walked_s for motor in plant.motors}


def oddities(plant: Any) -> dict:
    """What the model met that a textbook gait has not; each is a count or a worst value of the walk."""
    record, body = plant.record, plant.body
    return {
        "bounces": record.bounces,
        "recontacts": record.recontacts,
        "scuffs": record.scuffs,
        "flights": record.flights,
        "lead_lifts": record.lead_lifts,
        "tensile_strikes": record.tensile_strikes,
        "tensile_impulse_min_Ns": record.tensile_impulse_min_Ns,
        "friction_ratio_max": body.seen.friction_ratio_max,
        "slip_s": body.seen.slip_s,
        "normal_force_min_N": body.seen.normal_force_min,
        "min_clearance_m": record.min_clearance_m,
    }


def can(robot: Any, bus: Any) -> dict:
    """Traffic of one bus; loads as fractions 0-1 with stuff bits and intermission.

    lost: frames accepted for sending that a listening node did not get, on the wire or in its receive buffers.
    queue_full: frames that a full transmit ring of a board or of the router did not accept.
    """
    now = robot.loop.time
    lost, queue_full, skipped = bus.counters.lost, 0, bus.counters.single_shot_skipped
    for wire in wiring.CAN:
        if f"can{wire.bus}" != bus.name:
            continue
        board = robot.boards[wire.board]
        if wire.board == "CSR":
            lost += board.controllers[wire.controller - 1].data_overruns
            lost += board.router.receive_lost_from[wire.controller]
            queue_full += board.router.transmit_lost[wire.controller]
            skipped += board.clock.skipped[wire.controller]
        else:
            lost += board.can.controller.data_overruns + board.can.receive_lost
            queue_full += board.can.send_lost
    return {
        "frames": bus.counters.frames,
        "load_mean": bus.load_mean(now),
        "load_max": bus.load.largest(),
        "lost": lost,
        "queue_full": queue_full,
        "single_shot_skipped": skipped,
        "errors": bus.counters.errors,
    }


def slots(board: Any) -> dict:
    """How one board kept its slots; interrupts included."""
    scheduler = board.scheduler
    return {
        "count": scheduler.slot_count,
        "overruns": scheduler.overruns,
        "max_execution_us": scheduler.max_slot_cycles * 1e6 / board.hz,
        "budget_us": scheduler.schedule.slot_ns / 1000.0,
    }


def errors(board: Any) -> dict:
    """Errors the board itself noted, by name."""
    totals = board.errors.totals
    return {name: totals[code] for code, name in error_table.NAMES.items() if totals[code]}


def alive(robot: Any, name: str, board: Any) -> bool:
    """True when the board's slots are as recent as they should be."""
    silent_ns = robot.loop.time - board.scheduler.slot_time
    return robot.loop.time - robot.start_ns < 20_000_000 or silent_ns < 20 * board.scheduler.schedule.slot_ns
