"""The variables of a walk as one ASAM MDF 4 file.

MDF 4 is the measurement format of the CAN world: asammdf's viewer, CANape, INCA, PlotJuggler (with its
plug-in) and MATLAB open it, and it keeps unit, description and a time base per channel. Each variable
of the data table is one channel at the instants when its value or its stamp changed, so a variable sent
at 45 Hz has 45 samples a second.
"""

import pathlib
import tempfile
import warnings
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

# (group name, time in s, [(channel, unit, description, samples)])
Group = tuple[str, Any, list[tuple[str, str, str, Any]]]


def write(robot: Any, path: pathlib.Path) -> None:
    """Write `path` whole or not at all. `robot`: a `harness.ranger.Ranger` whose log was not "none"."""
    write_groups(groups(robot), path)


def write_groups(groups: Iterable[Group], path: pathlib.Path) -> None:
    """The same with groups of channels from elsewhere."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # asammdf's dependencies announce their own deprecations on import
        from asammdf import MDF, Signal

        with MDF(version="4.10") as file:
            for name, time_s, channels in groups:
                file.append(
                    [
                        Signal(samples=values, timestamps=time_s, name=channel, unit=unit, comment=comment)
                        for channel, unit, comment, values in channels
                    ],
                    comment=name,
                    common_timebase=True,
                )
            with tempfile.TemporaryDirectory(dir=path.parent, prefix=".mdf") as folder:
                saved = file.save(pathlib.Path(folder) / path.name, compression=2)
                pathlib.Path(saved).replace(path)


def groups(robot: Any) -> Iterator[Group]:
    """Everything that was kept."""
    kept = robot.recorded()
    yield (
        "plant",
        kept.samples["time_s"],
        [
            (f"plant.{name}", unit, "true state of the body", np.ascontiguousarray(kept.samples[name]))
            for name, unit in robot.plant.sample_names.items()
        ],
    )
    for series in kept.variables():
        yield series.name, series.time_s, [(series.name, series.unit, series.description, series.values)]
