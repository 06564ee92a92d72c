"""All files generated from a master table, as {path below its folder `generated`: text}.

The files carry no date, so the same table gives the same bytes on every machine.
"""

from __future__ import annotations

import pathlib

from ranger_sim.datatable.generate_a2l import a2l_text
from ranger_sim.datatable.generate_c import c_files
from ranger_sim.datatable.generate_catalogue import catalogue_text
from ranger_sim.datatable.generate_dbc import dbc_text
from ranger_sim.datatable.generate_python import python_files
from ranger_sim.datatable.model import MAIN_BRAIN, Table
from ranger_sim.foundation.user_error import TableError
from ranger_sim.loading import OWN_TABLE

GENERATED_FOLDER = (OWN_TABLE or pathlib.Path(__file__).parent) / "generated"
GENERATED_SUFFIXES = (".py", ".c", ".h", ".dbc", ".json", ".a2l")


def generated_files(table: Table) -> dict[str, str]:
    """Path and text of every generated file.

    Python modules and the A2L file describe a machine with a main brain: its boards are our Python, and the calibration
    slave serves its store. A machine without one has its firmware in C, and its harness reads the table itself.
    """
    files = {f"c/{name}": text for name, text in c_files(table).items()}
    for bus in table.channels:
        if bus != "SSP":
            files[f"{bus.lower()}.dbc"] = dbc_text(table, bus)
    files["catalogue.json"] = catalogue_text(table)
    if table.with_role(MAIN_BRAIN):
        files.update(python_files(table))
        files["ranger.a2l"] = a2l_text(table)
    return dict(sorted(files.items()))


def on_disk(folder: pathlib.Path) -> set[str]:
    """Generated files found below `folder`, as relative paths with forward slashes."""
    return {
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.suffix in GENERATED_SUFFIXES and path.is_file() and "__pycache__" not in path.parts
    }


def write(table: Table, folder: pathlib.Path = GENERATED_FOLDER) -> list[str]:
    """Write missing or stale files, delete those that the table no longer produces; returns the changed paths, sorted.

    UserError when the folder cannot be written.
    """
    changed = stale(table, folder)
    files = generated_files(table)
    try:
        for name in changed:
            path = folder / name
            if name in files:
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(files[name].encode())
            else:
                path.unlink()
    except OSError as error:
        raise TableError(f"{error.filename or folder}: cannot be written: {error.strerror}") from error
    return changed


def stale(table: Table, folder: pathlib.Path = GENERATED_FOLDER) -> list[str]:
    """Paths that differ from the table's output, are missing, or no longer belong there; sorted."""
    files = generated_files(table)
    try:
        found = on_disk(folder) if folder.is_dir() else set()
        different = {name for name in found & set(files) if (folder / name).read_bytes() != files[name].encode()}
    except OSError as error:
        raise TableError(f"{error.filename or folder}: cannot be read: {error.strerror}") from error
    return sorted(different | (found ^ set(files)))
