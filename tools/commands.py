"""The commands of `ranger-sim`: name, module, one line of help and examples of each. A module is imported on use."""

from __future__ import annotations

import dataclasses
import importlib
from typing import Any


@dataclasses.dataclass(frozen=True)
class Command:
    """One command. module: has `register(commands)`; None for `help`, which the command line has itself.

    is_for_developers: a tool of this project's developers, which the list of commands names only at its end.
    """

    name: str
    module: str | None
    help: str
    examples: tuple[str, ...] = ()
    is_for_developers: bool = False

    def register(self, commands: Any) -> None:
        """Add its parser to the command line."""
        if self.module is None:
            commands.add_parser(self.name)
        else:
            importlib.import_module(f"ranger_sim.{self.module}").register(commands)


COMMANDS = (
    Command("help", None, "what a command does and takes: ranger-sim help COMMAND"),
    Command(
        "walk",
        "tools.run.walk",
        "let Ranger walk in virtual time, as fast as it goes",
        (
            "ranger-sim walk --steps 20 --out runs/first",
            "ranger-sim walk --time 60s --seed 3 --floor-roughness 1mm --json -",
            'ranger-sim walk --fault "MCH.joint_encoder:stuck@step 12..step 14" --proof',
        ),
    ),
    Command(
        "info",
        "tools.info",
        "version, whether compiled, CAN interfaces, hash of the data table",
        ("ranger-sim info", "ranger-sim info --json"),
    ),
    Command(
        "table",
        "datatable.cli",
        "the master table of variables: generate code, look things up",
        ("ranger-sim table show MCH_ANGLE", "ranger-sim table list --board MCH"),
    ),
    Command(
        "bench",
        "tools.bench.command",
        "how fast the whole robot and its parts are, how far it walks",
        ("ranger-sim bench robot --runs 3",),
        is_for_developers=True,
    ),
    Command(
        "trace",
        "tools.timing.trace",
        "look at a timeline that `walk --trace FILE` has written",
        ("ranger-sim walk --steps 5 --trace walk.pftrace", "ranger-sim trace open walk.pftrace --at 2.5s"),
    ),
    Command(
        "up",
        "tools.run.up",
        "let Ranger walk in real time, each board in a separate process",
        (
            "ranger-sim up --steps 20",
            "ranger-sim up --bus can1=socketcan:vcan0",
            "ranger-sim up --speed max --time 10s --json -",
        ),
    ),
    Command(
        "ctl",
        "tools.run.ctl",
        "look at, pause, resume or change a robot that `up` runs",
        ("ranger-sim ctl status", "ranger-sim ctl key 1", "ranger-sim ctl restart MCH"),
    ),
    Command(
        "body",
        "tools.body",
        "list the bodies, or show every number of one",
        ("ranger-sim body list", "ranger-sim body show ranger --changes"),
    ),
    Command(
        "bus",
        "tools.buses.bus",
        "emulated CAN buses for programs of your own, without a robot",
        ("ranger-sim bus can1 can2 --bitrate 500000", "ranger-sim bus can1 --acknowledge --slcan can1"),
    ),
    Command(
        "can-bounds",
        "tools.buses.can_bounds",
        "how late every CAN frame can be: worst-case response times",
        ("ranger-sim can-bounds", "ranger-sim can-bounds --dbc machine.dbc --bit-rate 500000"),
    ),
    Command(
        "check-bus",
        "tools.buses.check_bus",
        "whether the CAN interfaces of a profile are ready",
        ("ranger-sim check-bus hil-1mbit", "ranger-sim check-bus ours.toml --listen 2s"),
    ),
    Command(
        "daq",
        "tools.robodaq.command",
        "log a robot over its serial line, read and write its parameters",
        (
            "ranger-sim daq --port /dev/ttyUSB0 --fast MCH_ANGLE --log walk.mf4 --time 60s",
            "ranger-sim daq --port /dev/ttyUSB0 --write P_H_PM_H_TRATE=2.1",
        ),
    ),
    Command(
        "panel",
        "tools.panel.command",
        "RoboDAQ and the robot's front panel in a browser: a running robot, a data link, recordings",
        ("ranger-sim panel --walk", "ranger-sim panel runs/before runs/after"),
    ),
    Command(
        "faults",
        "tools.faults",
        "list what can be made to fail, where, with which parameters",
        ("ranger-sim faults", "ranger-sim faults MCH.joint_encoder"),
    ),
    Command(
        "firmware",
        "tools.firmware.command",
        "compile a board's firmware from C for this computer or for the chip",
        ("ranger-sim firmware build examples/hip_in_c", "ranger-sim firmware include"),
    ),
    Command(
        "new",
        "tools.new.command",
        "write a project for a machine of your own to start from",
        ("ranger-sim new my_machine",),
    ),
    Command(
        "slots",
        "tools.timing.slots",
        "slot timing of the boards: costs, limits, worst seen and worst possible",
        ("ranger-sim slots", "ranger-sim slots MCH --time 5s"),
    ),
    Command(
        "summary-schema",
        "tools.run.summary_schema",
        "JSON Schema of summary.json: type, unit and meaning of every figure",
        ("ranger-sim summary-schema",),
    ),
    Command(
        "campaign",
        "tools.campaign.command",
        "run every fault of a plan, a grid or sample of settings, or a search for the worst case",
        (
            "ranger-sim campaign campaigns/sensors.toml --jobs 2",
            "ranger-sim campaign campaigns/floor-sample.toml --seed 7 --out runs/floor --json -",
        ),
    ),
    Command(
        "causes",
        "tools.diagnose.causes",
        "list what can make a simulation differ from a machine, and what given channels can show of it",
        (
            "ranger-sim causes",
            "ranger-sim causes --experiment motor-bench --channels voltage_V current_A speed_rad_per_s",
        ),
    ),
    Command(
        "diagnose",
        "tools.diagnose.command",
        "what the simulation gets wrong about measured data",
        ("ranger-sim diagnose run1.csv --holdout run2.csv --experiment motor-bench --out found",),
    ),
    Command(
        "twins",
        "tools.twins.command",
        "make the emulated walks that a walk's diagnosis compares with",
        ("ranger-sim twins record-2011 --jobs 2",),
        is_for_developers=True,
    ),
    Command(
        "fmu",
        "tools.fmu.command",
        "write the body as a unit for co-simulation (FMI 3.0)",
        ("ranger-sim fmu body.fmu --seed 3 --floor-roughness 1mm",),
    ),
    Command(
        "read",
        "tools.read.command",
        "what a recording holds: channels, what became of every line, what is odd, which repairs are possible",
        ("ranger-sim read run1.csv", "ranger-sim read log.blf --dbc net.dbc --plot run1.html"),
    ),
    Command(
        "identify",
        "tools.identify.command",
        "a bench's recording: motor and body parameters with confidence intervals",
        ("ranger-sim identify all --out found", "ranger-sim identify motor --data motor.csv --json -"),
    ),
    Command(
        "completion",
        "tools.command_line.completion",
        "a script by which bash, zsh or fish finish commands, options and file names",
        ("ranger-sim completion bash > ~/.local/share/bash-completion/completions/ranger-sim",),
    ),
)
NAMED = {each.name: each for each in COMMANDS}
