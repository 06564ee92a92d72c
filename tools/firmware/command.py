"""`ranger-sim firmware`: firmware in C, compiled for this computer or for the chip."""

import argparse
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from typing import Any

from ranger_sim.firmware_sim.native import image_build, sanitizers
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes import kernel
from ranger_sim.harness.processes.settings import DEADLINE_S
from ranger_sim.ranger.firmware import native_boards
from ranger_sim.tools.command_line import streams, terminal
from ranger_sim.tools.command_line.options import Option
from ranger_sim.tools.command_line.units import TIMES, quantity, word

LONGEST_DEADLINE_S = 86_400.0

FIRMWARE = Option(
    "--firmware",
    "firmware in C instead of the emulated board: a folder with a firmware.toml; built unless it is up to date",
    word("BOARD=DIR"),
    "BOARD=DIR",
    repeated=True,
)
SANITIZE = Option(
    "--sanitize",
    "compile the firmware with the address and undefined-behaviour sanitizers; findings are printed at the end, with "
    "file and line, and make exit code 1",
    of_run=False,
)
IN_PROCESS = Option(
    "--in-process",
    "run the firmware in the walk's own process instead of a separate one: faster, but a crash ends the walk",
    of_run=False,
)
BOARD_DEADLINE = Option(
    "--board-deadline",
    f"end a firmware's process that does not answer for this time (default {DEADLINE_S:g}s); 0s: never, to debug it",
    quantity(TIMES, "s", least=0.0, most=LONGEST_DEADLINE_S),
    f"{DEADLINE_S:g}s",
    DEADLINE_S,
    of_run=False,
)
COVERAGE = Option(
    "--coverage",
    "count which lines and branches of the firmware run, by gcc's gcov: figures in the summary, sources in the report, "
    "lcov.info in --out",
    of_run=False,
)
REQUIRE_CONFINED = Option(
    "--require-confined",
    "run firmware in C only where its process can be confined in every way (exit code 2 otherwise)",
    of_run=False,
)
OPTIONS = (FIRMWARE, SANITIZE, COVERAGE, REQUIRE_CONFINED)
TARGETS = ("host", "lpc2194")
EXIT_FOUND = 1


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    command = commands.add_parser(
        "firmware",
        description="Firmware in C against the header ranger_sim/firmware.h; walk or up --firmware BOARD=DIR runs it.",
    )
    parts = command.add_subparsers(dest="part", required=True, metavar="build|include")
    build = parts.add_parser("build", help="compile the folder of a firmware.toml into a library")
    build.add_argument("folder", metavar="DIR", help="folder with firmware.toml")
    build.add_argument(
        "--target",
        choices=TARGETS,
        default=TARGETS[0],
        help="host: a library for this computer; lpc2194: an image for the chip, by arm-none-eabi-gcc (default: host)",
    )
    build.add_argument("--sanitize", action="store_true", help="find what is out of bounds or undefined at run time")
    build.add_argument("--coverage", action="store_true", help="count the lines that run")
    build.set_defaults(run=run_build)
    include = parts.add_parser("include", help="print the folders of the headers, as arguments of a compiler")
    include.set_defaults(run=run_include)


def run_build(options: argparse.Namespace) -> int:
    """Build, and print warnings and the library's path."""
    if options.target == "lpc2194":
        return run_build_image(options)
    if options.sanitize and not sanitizers.is_ready():  # a built library is loaded for a check
        return run_sanitized(options, [options.folder])
    firmware = native_boards.build(options.folder, options.sanitize, options.coverage)
    _print(firmware.warnings)
    print(f"{firmware.library}{'' if firmware.was_made else ' is up to date'}")
    return 0


def _print(warnings: Sequence[str]) -> None:
    """Print the compiler's warnings, a line each."""
    console = terminal.console(stderr=True)
    for line in warnings:
        console.print(line, highlight=False, markup=False, soft_wrap=True)


def run_build_image(options: argparse.Namespace) -> int:
    """Build for the chip, and print warnings, sizes and the image's paths."""
    if options.sanitize or options.coverage:
        asked = "--sanitize" if options.sanitize else "--coverage"
        raise UserError(f"{asked}: only on this computer, not with --target {options.target}")
    image = native_boards.build_image(options.folder)
    _print(image.warnings)
    print(f"{image.path}{'' if image.was_made else ' is up to date'}")
    print(
        f"{image.hex_path}: {image.flash_bytes} of {image_build.FLASH_BYTES} bytes of flash, "
        f"{image.ram_bytes} of {image_build.RAM_BYTES} bytes of RAM"
    )
    return 0


def run_include(options: argparse.Namespace) -> int:
    """Print the include folder, for editors and for compilers of the chip."""
    print(" ".join(f"-I{folder}" for folder in native_boards.include_folders()))
    return 0


def wants_another_process(options: argparse.Namespace) -> bool:
    """True when --sanitize is requested in a process that cannot load sanitizers: `run_sanitized` starts one."""
    if not options.sanitize:
        return False
    if not options.firmware:
        raise UserError("--sanitize: there is no firmware in C in this run; --firmware BOARD=DIR gives a board one")
    return not sanitizers.is_ready()


def folders_of(options: argparse.Namespace) -> list[str]:
    """The folders of --firmware."""
    return [native_boards.placed(text)[1] for text in options.firmware]


def programs_in(folders: list[str]) -> list[sanitizers.Program]:
    """Every library built in the folders."""
    return [
        sanitizers.Program(library, pathlib.Path(folder))
        for folder in dict.fromkeys(folders)
        for library in (pathlib.Path(folder) / "build").glob("*-sanitize*.so")
    ]


def confined_lines(summary: dict) -> list[str]:
    """How each program in C was confined, and what that lacks."""
    return [f"{board}: {each['name']}: confined: {each['confined']}" for board, each in summary["firmware"].items()]


def coverage_lines(summary: dict) -> list[str]:
    """The share of each program that ran, and the lines that did not."""
    lines = []
    for board, each in summary["firmware"].items():
        ran = each["coverage"]
        if ran["lines"] is None:
            continue
        lost = "" if ran["whole"] else "; its process ended before it could write"
        lines.append(
            f"{board}: {each['name']}: {ran['covered']} of {ran['lines']} lines ran, "
            f"{ran['taken']} of {ran['branches']} branches{lost}"
        )
        lines += [f"  {file['file']}: not run: {file['missed']}" for file in ran["files"] if file["missed"]]
    return lines


def run_sanitized(options: argparse.Namespace, folders: list[str]) -> int:
    """Run the command in a process that can load sanitizers; report their findings, even if it ended by a signal."""
    with tempfile.TemporaryDirectory(prefix="ranger-sim-findings-") as logs:
        place = pathlib.Path(logs)
        command = [sys.executable, "-m", "ranger_sim", *options.arguments]
        parent = os.getpid()
        # Ctrl-C and the terminal's hang-up also reach the run, which ends itself.
        before = {each: signal.signal(each, signal.SIG_IGN) for each in (signal.SIGINT, signal.SIGHUP)}
        run = subprocess.Popen(
            command,
            stdout=streams.result_descriptor(),
            env=sanitizers.environment(place),
            preexec_fn=lambda: _begin(parent, before),
        )
        before[signal.SIGTERM] = signal.signal(signal.SIGTERM, lambda number, _frame: run.send_signal(number))
        try:
            code = run.wait()
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
        found = sanitizers.findings(place, programs_in(folders))
    for each in found:
        print(f"ranger-sim: firmware: {each.describe()}", file=sys.stderr)
    if code < 0:
        print(f"ranger-sim: the run was ended by {signal.Signals(-code).name}", file=sys.stderr)
        return EXIT_FOUND
    return code or (EXIT_FOUND if found else 0)


def _begin(parent: int, handlers: dict[signal.Signals, Any]) -> None:
    """In the new process: Ctrl-C reaches it, and it does not outlive the waiting parent."""
    for each, handler in handlers.items():
        signal.signal(each, handler)
    kernel.die_with_parent(parent)
    kernel.fix_addresses()
