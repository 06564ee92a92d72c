"""A selection as a file: the samples of some channels in a window, as received."""

from __future__ import annotations

import csv
import io
import pathlib
import tempfile
from collections.abc import Callable, Iterable

import numpy as np

from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools.panel.source import Source


def as_csv(source: Source, channels: list[int], begin: float, end: float) -> bytes:
    """A row for each sample: time (s), channel, unit, value. Each channel has its own time stamps."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(("time_s", "channel", "unit", "value"))
    for number in channels:
        channel = source.channels[number]
        times, values = source.samples(number, begin, end)
        for time, value in zip(times.tolist(), values.tolist(), strict=True):
            table.writerow((f"{time:.6f}", channel.name, channel.unit, f"{value:.9g}"))
    return text.getvalue().encode()


def as_mf4(source: Source, channels: list[int], begin: float, end: float) -> bytes:
    """ASAM MDF 4: a group for each channel, with unit and meaning. UserError without samples."""
    with tempfile.TemporaryDirectory(prefix="ranger-sim-") as folder:
        path = pathlib.Path(folder) / "selection.mf4"
        write_mf4(path, source, [(channel, begin) for channel in channels], end)
        return path.read_bytes()


def write_mf4(path: pathlib.Path, source: Source, begins: Iterable[tuple[int, float]], end: float) -> None:
    """The same into a file; each channel has a separate begin."""
    from asammdf import MDF, Signal

    signals = []
    for number, begin in begins:
        channel = source.channels[number]
        times, values = source.samples(number, begin, end)
        if len(times):
            comment = channel.description
            signals.append(
                Signal(np.array(values), np.array(times), name=channel.name, unit=channel.unit, comment=comment)
            )
    if not signals:
        raise UserError("export: there are no samples of these channels in this window")
    with MDF(version="4.10") as file:
        for signal in signals:
            file.append([signal])
        file.save(path)


KINDS: dict[str, Callable[[Source, list[int], float, float], bytes]] = {"csv": as_csv, "mf4": as_mf4}
