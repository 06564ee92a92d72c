"""Recordings of any kind as datasets: what `sysid.readers` knows, and recordings of CAN frames with their DBC files."""

from __future__ import annotations

import pathlib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import Any

from ranger_sim.foundation.user_error import DataError
from ranger_sim.sysid import losses, readers
from ranger_sim.sysid.dataset import Dataset, Finding, Loss
from ranger_sim.sysid.readers import columns, frames
from ranger_sim.tools.command_line.units import SHARES, quantity


def add_options(command: Any) -> None:
    """The options that say how recordings are read."""
    command.add_argument(
        "--map",
        action="append",
        default=[],
        metavar="OLD=NEW",
        help="call a column of the data by a channel's name; its unit counts where the column says none (repeatable)",
    )
    command.add_argument(
        "--dbc", action="append", default=[], metavar="FILE", help="messages of a recording of CAN frames (repeatable)"
    )
    command.add_argument(
        "--bus", action="append", default=[], metavar="NAME", help="read the frames of this bus only (repeatable)"
    )
    command.add_argument("--time-unit", metavar="ms", help="of a time column whose name does not say it")
    add_accept_loss(command)


def add_accept_loss(command: Any) -> None:
    """The option that lets a verdict follow from a recording of which much is lost."""
    command.add_argument(
        "--accept-loss",
        type=quantity(SHARES, "1", least=0.0, most=1.0),
        default=losses.ACCEPTED,
        metavar="SHARE",
        help="conclude from a channel that lost up to this share of its samples (1%%)",
    )


def open_recording(
    path: str | pathlib.Path,
    mapping: Mapping[str, str] | None = None,
    databases: Sequence[str | pathlib.Path] = (),
    time_unit: str | None = None,
    each_frame: Callable[[frames.Frame], None] | None = None,
    buses: Collection[str] = (),
) -> Dataset:
    """The channels of a file or folder. `databases`: DBC files, for frames (can_bus.edge.logs), of these `buses`.

    each_frame: is called with every frame that is read, to keep it.
    An MDF file is read as frames when DBC files are given, and as channels otherwise. UserError for all that is wrong.
    """
    path = pathlib.Path(path)
    if path.is_file() and _has_frames(path, bool(databases)):
        if not databases:
            raise DataError(f"{path}: a recording of CAN frames needs a DBC file (--dbc FILE)")
        return _decoded(path, mapping, databases, each_frame, buses)
    if buses:
        raise DataError(f"--bus {' '.join(buses)}: {path} is not a recording of CAN frames, or --dbc is missing")
    return readers.read(path, mapping, time_unit=time_unit, variable_units=robot_units())


def _has_frames(path: pathlib.Path, with_databases: bool) -> bool:
    suffix = path.suffix.lower()
    if suffix == ".csv":
        from ranger_sim.can_bus.edge.logs import is_frame_table

        return is_frame_table(path)
    return suffix in readers.FRAMES or (with_databases and suffix in readers.MEASUREMENTS)


def _decoded(
    path: pathlib.Path,
    mapping: Mapping[str, str] | None,
    databases: Sequence[str | pathlib.Path],
    each_frame: Callable[[frames.Frame], None] | None,
    buses: Collection[str],
) -> Dataset:
    """The channels of recorded frames, with what became of the file's lines."""
    from ranger_sim.can_bus.edge.logs import read_log

    log = read_log(path)

    def passing() -> Iterator[frames.Frame]:
        for frame in log:
            if each_frame is not None:
                each_frame(frame)
            yield frame

    dataset = frames.decode(path.name, passing(), databases, mapping, buses)
    dataset.rows = log.read
    for reason, count, where in log.losses:
        loss = Loss(reason, count, where)
        dataset.losses.append(loss)
        text = f"{log.read} frames should be there, {loss.text}"
        dataset.findings.append(Finding("", "lost_frames", 0.0, 0.0, float(count), "frames", text))
    return dataset


def open_with(options: Any, path: str) -> Dataset:
    """The recording `path` as `add_options` says."""
    return open_recording(path, columns.mapping_of(options.map), options.dbc, options.time_unit, buses=options.bus)


def robot_units() -> dict[str, str]:
    """{variable: unit} of the robot's own table, which its text logs do not carry."""
    from ranger_sim.datatable.generated import all_variables

    return {name: all_variables.UNITS[number] for number, name in all_variables.NAMES.items()}
