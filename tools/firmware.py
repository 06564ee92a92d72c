"""`ranger-sim firmware`: firmware in C, compiled for this computer."""

import argparse
from typing import Any

from ranger_sim.harness import native_boards
from ranger_sim.tools import terminal
from ranger_sim.tools.options import Option
from ranger_sim.tools.units import word

FIRMWARE = Option(
    "--firmware",
    "firmware in C instead of the emulated board: a folder with a firmware.toml; built unless it is up to date",
    word("BOARD=DIR"),
    "BOARD=DIR",
    repeated=True,
)


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    command = commands.add_parser(
        "firmware",
        help="compile a board's firmware from C for this computer",
        description="Firmware in C against the header ranger_sim/firmware.h; walk or up --firmware BOARD=DIR runs it.",
    )
    parts = command.add_subparsers(dest="part", required=True, metavar="build|include")
    build = parts.add_parser("build", help="compile the folder of a firmware.toml into a library")
    build.add_argument("folder", metavar="DIR", help="folder with firmware.toml")
    build.add_argument("--sanitize", action="store_true", help="find what is out of bounds or undefined at run time")
    build.add_argument("--coverage", action="store_true", help="count the lines that run")
    build.set_defaults(run=run_build)
    include = parts.add_parser("include", help="print the folders of the headers, as arguments of a compiler")
    include.set_defaults(run=run_include)


def run_build(options: argparse.Namespace) -> int:
    """Build, and print warnings and the library's place."""
    firmware = native_boards.build(options.folder, options.sanitize, options.coverage)
    console = terminal.console(stderr=True)
    for line in firmware.warnings:
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    print(f"{firmware.library}{'' if firmware.was_made else ' is up to date'}")
    return 0


def run_include(options: argparse.Namespace) -> int:
    """For editors, and for compilers of the chip."""
    print(" ".join(f"-I{folder}" for folder in native_boards.include_folders()))
    return 0
