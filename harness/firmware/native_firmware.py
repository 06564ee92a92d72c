"""Firmware in C for a board of any machine: compiled with the generated C of its master table."""

import dataclasses
import pathlib
import re

from ranger_sim.firmware_sim.native import build as compiling
from ranger_sim.firmware_sim.native import coverage as counting
from ranger_sim.firmware_sim.native import image_build, sanitizers
from ranger_sim.firmware_sim.native import manifest as manifests
from ranger_sim.foundation.user_error import FirmwareError

GENERATED_C = pathlib.Path("generated") / "c"  # below a folder of master files
VERSION_FILE = "ranger_table.h"


@dataclasses.dataclass(frozen=True)
class Firmware:
    """A folder of firmware, built. `warnings` of the compiler; `sanitize`, `coverage`: how it was built.

    table: folder of the generated C that it was compiled with. counts: folder for what ran, with `coverage`.
    """

    folder: pathlib.Path
    library: pathlib.Path
    manifest: manifests.Manifest
    table: pathlib.Path
    warnings: tuple[str, ...] = ()
    was_made: bool = True
    sanitize: bool = False
    coverage: bool = False
    counts: pathlib.Path | None = None

    def findings(self) -> list[sanitizers.Finding]:
        """What the sanitizers have found in it so far, in this process and those that it has forked."""
        logs = sanitizers.place_of_findings() if self.sanitize else None
        return sanitizers.findings(logs, [self.program]) if logs is not None else []

    @property
    def program(self) -> sanitizers.Program:
        """The program whose findings are searched."""
        return sanitizers.Program(self.library, self.folder)

    def ran(self) -> list[counting.FileCounts]:
        """The lines of it that ran, as far as boards have written them."""
        if not self.coverage or self.counts is None:
            return []
        return counting.read(self.library, self.folder, self.counts)


def build(
    folder: str | pathlib.Path, table: pathlib.Path | None = None, sanitize: bool = False, coverage: bool = False
) -> Firmware:
    """Compile a folder of firmware, with the generated C of the tables that it names, unless it is up to date.

    The manifest's `master` gives the place of that C; without it, it is in `table`. UserError when it was not made from
    the present master files.
    """
    manifest = manifests.load(folder)
    place = place_of_tables(manifest, table)
    built = compiling.build(manifest, sanitize, coverage, table_sources(manifest, place))
    return Firmware(manifest.folder, built.path, manifest, place, built.warnings, built.was_made, sanitize, coverage)


def build_image(folder: str | pathlib.Path, table: pathlib.Path | None = None) -> image_build.Image:
    """The same for the chip: an image for an LPC2194."""
    manifest = manifests.load(folder)
    return image_build.build_image(manifest, table_sources(manifest, place_of_tables(manifest, table)))


def place_of_tables(manifest: manifests.Manifest, table: pathlib.Path | None) -> pathlib.Path:
    """The folder of the generated C."""
    place = table if manifest.master is None else fresh_c(manifest.master)
    if place is None:
        raise FirmwareError(f"{manifest.folder}: firmware.master is missing: the folder of the master table")
    return place


def table_sources(manifest: manifests.Manifest, place: pathlib.Path) -> compiling.Addition:
    """The generated C of the tables that a manifest names."""
    sources = []
    for name in manifest.tables:
        source = place / f"{name.lower()}_table.c"
        if not source.is_file():
            there = ", ".join(sorted(each.name.removesuffix("_table.c") for each in place.glob("*_table.c")))
            raise FirmwareError(f"{manifest.folder}: firmware.tables: no board {name!r}; there are {there}")
        sources.append(source)
    return compiling.Addition((place,), tuple(sources))


def fresh_c(master: pathlib.Path) -> pathlib.Path:
    """The generated C below a folder of master files. UserError when it was made from another version of them."""
    from ranger_sim.datatable import generate
    from ranger_sim.datatable.loader import load_table

    stale = generate.stale(load_table(master), master / "generated")
    if stale:
        raise FirmwareError(
            f"{master}: what was generated is not of the table as it is now ({stale[0]}): "
            f"ranger-sim table generate --master {master}"
        )
    return master / GENERATED_C


def table_version(table: pathlib.Path) -> int:
    """RANGER_TABLE_VERSION of a folder of generated C."""
    path = table / VERSION_FILE
    found = re.search(r"#define RANGER_TABLE_VERSION 0x([0-9A-F]{8})u", path.read_text(encoding="utf-8"))
    if found is None:
        raise FirmwareError(f"{path}: no version; `ranger-sim table generate` writes it")
    return int(found[1], 16)
