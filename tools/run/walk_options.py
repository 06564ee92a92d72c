"""Options of a walk: one table, from which its parser and the command that repeats it are made."""

import argparse
import shlex
from collections.abc import Mapping
from typing import Any

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.stop_rule import MOST_DISTANCE_M, MOST_STEPS, MOST_TIME_S, StopRule
from ranger_sim.plant.electrics.electronics import SWITCHES
from ranger_sim.ranger.scenario import LIMITS, Scenario
from ranger_sim.tools import faults
from ranger_sim.tools.command_line.options import Option, add_all, add_verbosity
from ranger_sim.tools.command_line.units import (
    ENERGIES_WH,
    LENGTHS,
    SHARES,
    SLOPES,
    TIMES,
    Quantity,
    Unit,
    quantity,
    whole_number,
    word,
)
from ranger_sim.tools.firmware.command import BOARD_DEADLINE, IN_PROCESS
from ranger_sim.tools.firmware.command import OPTIONS as FIRMWARE
from ranger_sim.tools.firmware.gdb_options import ALLOW_NETWORK, GDB
from ranger_sim.tools.firmware.images import OPTIONS as IMAGES
from ranger_sim.tools.run import serial_options
from ranger_sim.tools.timing import trace

LOGS = ("full", "window", "none")


def of_scenario(field: str, units: Mapping[str, Unit], base: str) -> Quantity:
    """A quantity with the scenario's own limits."""
    low, high, _ = LIMITS[field]
    return quantity(units, base, least=low, most=high)


END = (
    Option("--steps", "end after this many steps", whole_number(1, MOST_STEPS), "N"),
    Option("--time", "end after this virtual time", quantity(TIMES, "s", above=0.0, most=MOST_TIME_S), "60s"),
    Option("--distance", "end after this distance", quantity(LENGTHS, "m", above=0.0, most=MOST_DISTANCE_M), "65km"),
)
SCENARIO = (
    Option(
        "--controller",
        f"parameter set, by name or as a .toml file (default {Scenario.controller})",
        word("a parameter set's name or .toml file"),
        "NAME",
        Scenario.controller,
        always=True,
    ),
    Option(
        "--body",
        f"body that walks, by name or as a .toml file (default {Scenario.body}; `ranger-sim body list`)",
        word("a body's name or .toml file"),
        "NAME",
        Scenario.body,
        always=True,
    ),
    Option(
        "--seed",
        f"of crystals, phases, noise and footholds (default {Scenario.seed})",
        whole_number(0),
        "N",
        Scenario.seed,
        always=True,
    ),
    Option(
        "--floor-roughness",
        "standard deviation of the footholds' heights (default 0)",
        of_scenario("floor_roughness_m", LENGTHS, "m"),
        "1mm",
        Scenario.floor_roughness_m,
    ),
    Option(
        "--slope",
        "slope of the floor, positive downhill (default 0)",
        of_scenario("slope_rad", SLOPES, "rad"),
        "0.01rad",
        Scenario.slope_rad,
    ),
    Option(
        "--battery",
        "charge of the batteries at power-up (default full)",
        of_scenario("battery_charge", SHARES, "(full)"),
        "70%",
        Scenario.battery_charge,
    ),
    Option(
        "--battery-capacity",
        f"of all packs together (default {Scenario.battery_capacity_Wh:g} Wh, seven packs of 67 Wh)",
        of_scenario("battery_capacity_Wh", ENERGIES_WH, "Wh"),
        "493Wh",
        Scenario.battery_capacity_Wh,
    ),
    Option(
        "--off",
        "electronics that draw no power, as the left outer ankle's in the 65 km walk",
        choices=tuple(SWITCHES),
        repeated=True,
    ),
    Option(
        "--model", "model file (.toml) with additional terms of motors, joints, sensors", word("a model file"), "FILE"
    ),
    Option(
        "--profile",
        "boards, bit rates and bus schedules of a profile, by name or as a .toml file",
        word("a profile's name or .toml file"),
        "FILE",
    ),
)
FILES = (
    Option(
        "--log",
        "what the files in --out keep: everything, the last 10 s (default), or no more than the summary",
        choices=LOGS,
        of_run=False,
    ),
    Option(
        "--out",
        "folder of this run: logs, summary and report; made if missing, the files of an older run in it go first",
        word("a folder"),
        "DIR",
        of_run=False,
    ),
    Option(
        "--twins",
        "compare the walk with its twins, emulated walks of sound robots and of robots with one cause each, and draw "
        "what is unusual in the report (about ten seconds)",
        of_run=False,
    ),
    Option("--json", "the summary as JSON; - prints it and nothing else", word("a file or -"), "FILE|-", of_run=False),
)
PROOF = Option(
    "--proof",
    "compare the walk with itself without its faults: what differs first, which error reports it and when, what the "
    "machines do (a second process walks that one; 2 MB a second in both)",
    of_run=False,
)
RUN = (*END, *SCENARIO, *FILES)  # of every command that lets the robot walk
WALK = (
    *RUN,
    *serial_options.OPTIONS,
    faults.FAULT,
    PROOF,
    faults.MODULE,
    *FIRMWARE,
    IN_PROCESS,
    BOARD_DEADLINE,
    *IMAGES,
    GDB,
    ALLOW_NETWORK,
    *trace.OPTIONS,
)


def add_run_options(command: Any) -> None:
    """The options of every command that lets the robot walk: which end, which scenario, which files."""
    add_all(command, RUN)
    add_verbosity(command)
    serial_options.add_options(command)


def add_walk_options(command: Any) -> None:
    """All options of `walk`."""
    add_run_options(command)
    add_all(
        command,
        (faults.FAULT, PROOF, faults.MODULE, *FIRMWARE, IN_PROCESS, BOARD_DEADLINE, *IMAGES, GDB, ALLOW_NETWORK),
    )
    trace.add_options(command)


def stop_of(given: argparse.Namespace) -> StopRule | None:
    """The requested end, if any."""
    if given.steps is None and given.time is None and given.distance is None:
        return None
    return StopRule(given.steps, given.time, given.distance)


def log_of(given: argparse.Namespace) -> str:
    """The contents of the robot's own log, for the report: the last seconds, or nothing without a folder for it.

    The files of `--log full` take all rows at once, so that memory keeps none of them. UserError for a comparison with
    twins that no report would have.
    """
    log = "none" if not given.out or given.log == "none" else "window"
    if given.twins and log == "none":
        raise UserError("--twins: the report has the comparison, and needs --out DIR and --log full or window")
    return log


def scenario_of(given: argparse.Namespace) -> Scenario:
    """The requested scenario."""
    return Scenario(
        controller=given.controller,
        body=given.body,
        seed=given.seed,
        slope_rad=given.slope,
        floor_roughness_m=given.floor_roughness,
        model_file=given.model,
        battery_charge=given.battery,
        battery_capacity_Wh=given.battery_capacity,
        electronics_off=tuple(given.off),
    )


def command_again(given: argparse.Namespace, stop: StopRule) -> str:
    """The command line of the walk with the options `given` that ends by `stop`: the same bytes in the trace."""
    ended = {"steps": stop.steps, "time": stop.time_s, "distance": stop.distance_m}
    asked = argparse.Namespace(**{**vars(given), **ended})
    words = [text for option in WALK if option.of_run for text in option.typed(asked)]
    return shlex.join(["ranger-sim", "walk", *words])
