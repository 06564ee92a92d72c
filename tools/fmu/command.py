"""`ranger-sim fmu`: write the body as a functional mock-up unit."""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import pathlib
import tempfile
import zipfile
from typing import Any

from ranger_sim.foundation.user_error import UserError
from ranger_sim.ranger.scenario import Scenario
from ranger_sim.tools.command_line.files import writable_folder
from ranger_sim.tools.command_line.options import add_all
from ranger_sim.tools.fmu.body import ExportedBody, given_of
from ranger_sim.tools.run import walk_options

SCENARIO = ("--controller", "--body", "--seed", "--floor-roughness", "--slope", "--battery", "--battery-capacity")
OPTIONS = tuple(option for option in walk_options.SCENARIO if option.name in SCENARIO)
# Of the platforms for which pythonfmu3 brings a binary, those on which ranger_sim runs.
PLATFORMS = ("x86_64-linux",)
STAMP = (1980, 1, 1, 0, 0, 0)  # of every file in the archive, the earliest that it can hold: same body, same bytes


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    command = commands.add_parser(
        "fmu",
        description="The body with motors, drives, battery and sensors as a functional mock-up unit: its inputs are "
        "what the boards put out, its outputs what the sensors see. The options give its parameters' start values.",
    )
    command.add_argument("file", metavar="FILE.fmu", help="where to write it")
    add_all(command, OPTIONS)
    command.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Write the file and print its contents."""
    path = pathlib.Path(options.file)
    if path.suffix != ".fmu":
        raise UserError(f"fmu {options.file!r}: a file that ends in .fmu is expected")
    if path.exists() and not path.is_file():
        raise UserError(f"fmu {options.file!r}: this is {'a folder' if path.is_dir() else 'a device or a pipe'}")
    importlib.import_module("pythonfmu3")  # before anything is made
    writable_folder(path.parent)
    scenario = Scenario(
        controller=options.controller,
        body=options.body,
        seed=options.seed,
        slope_rad=options.slope,
        floor_roughness_m=options.floor_roughness,
        battery_charge=options.battery,
        battery_capacity_Wh=options.battery_capacity,
    )
    quantities = export(path.resolve(), given_of(scenario))
    counts = [sum(each.causality == what for each in quantities) for what in ("parameter", "input", "output")]
    print(f"{path}: body {options.body}, {counts[0]} parameters, {counts[1]} inputs, {counts[2]} outputs; FMI 3.0")
    return 0


def export(path: pathlib.Path, given: dict[str, Any]) -> list:
    """Write the unit; returns its interface. UserError for an impossible body."""
    from pythonfmu3 import FmuBuilder

    from ranger_sim.tools.fmu import interface, ranger_body

    quantities = list(ExportedBody(given).quantities.values())
    with tempfile.TemporaryDirectory(prefix="ranger-fmu-") as made:
        folder = pathlib.Path(made)
        start_values = folder / ranger_body.GIVEN
        made_by = {interface.MADE_BY: interface.signature(given)}
        start_values.write_text(json.dumps({**made_by, **given}, indent=1), encoding="utf-8")
        licences = folder / "documentation" / "licenses"
        licences.mkdir(parents=True)
        for name, distribution in (("ranger-sim.txt", "ranger-sim"), ("pythonfmu3.txt", "pythonfmu3")):
            (licences / name).write_text(licence_of(distribution), encoding="utf-8")
        built = FmuBuilder.build_FMU(
            ranger_body.__file__,
            folder,
            [start_values],
            documentation_folder=folder / "documentation",
            canHandleVariableCommunicationStepSize=True,  # pythonfmu3 0.3.4 writes another option's value there
        )
        with zipfile.ZipFile(built) as source, tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as target:
            temporary = pathlib.Path(target.name)
            try:
                repack(source, target)
                temporary.chmod(0o644)
                temporary.replace(path)
            except BaseException:
                temporary.unlink(missing_ok=True)
                raise
    return quantities


def repack(source: zipfile.ZipFile, target: Any) -> None:
    """The same files in the order of their names, without binaries for other platforms and without C++ sources."""
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(source.namelist()):
            first, *rest = name.split("/")
            if first == "sources" or first == "binaries" and rest[0] not in PLATFORMS:
                continue
            archive.writestr(zipfile.ZipInfo(name, STAMP), source.read(name), zipfile.ZIP_DEFLATED)


def licence_of(distribution: str) -> str:
    """The licence text of an installed distribution, else what its metadata says."""
    try:
        found = importlib.metadata.distribution(distribution)
    except importlib.metadata.PackageNotFoundError:  # run from its sources
        return "MIT\n"
    for file in found.files or []:
        if "license" in file.name.lower():
            return file.read_text()
    return "MIT, as its page says\n"
