"""The formats of a timeline's file, by its suffix."""

import importlib
import pathlib
import tempfile
from collections.abc import Callable
from typing import IO

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.timeline import mcap_file, perfetto_file, vcd_file
from ranger_sim.harness.timeline.model import Events

FORMATS: dict[str, Callable[[Events, IO[bytes], str], None]] = {
    ".pftrace": perfetto_file.write,
    ".perfetto-trace": perfetto_file.write,
    ".vcd": vcd_file.write,
    ".mcap": mcap_file.write,
}

# the optional library of each writer
LIBRARIES = {
    ".pftrace": perfetto_file.SCHEMA,
    ".perfetto-trace": perfetto_file.SCHEMA,
    ".vcd": "vcd",
    ".mcap": "mcap.writer",
}


def format_of(path: pathlib.Path) -> Callable[[Events, IO[bytes], str], None]:
    """The writer of such a file. UserError for an unknown suffix."""
    if path.suffix not in FORMATS:
        raise UserError(f"trace {path}: suffix {path.suffix!r} is not a format (available: {', '.join(FORMATS)})")
    return FORMATS[path.suffix]


def check_target(path: pathlib.Path) -> None:
    """Check before a run: the suffix is known, its writer is installed, and a file can be written there."""
    format_of(path)
    importlib.import_module(LIBRARIES[path.suffix])
    if path.exists() and not path.is_file():
        raise UserError(f"trace {path}: that is {'a folder' if path.is_dir() else 'a device or a pipe'}, not a file")
    try:
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        raise UserError(f"trace {path}: cannot be written: {error.strerror}") from None


def write(events: Events, path: pathlib.Path, title: str) -> None:
    """Write the timeline into `path`, whole or not at all."""
    writer = format_of(path)
    check_target(path)
    path = path.resolve()  # of a link its file
    try:
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}-") as folder:
            partial = pathlib.Path(folder) / path.name
            with partial.open("wb") as file:
                writer(events, file, title)
            partial.replace(path)
    except OSError as error:  # above all a full disk
        raise UserError(f"trace {path}: cannot be written: {error.strerror or error}") from None
