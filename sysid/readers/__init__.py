"""Files as datasets: one module per format, and `read`, which knows a format by its ending and its first lines."""

import pathlib
from collections.abc import Mapping

from ranger_sim.foundation.user_error import DataError
from ranger_sim.sysid.dataset import Dataset
from ranger_sim.sysid.readers import csv_file, measurement, robodaq, run_folder

MEASUREMENTS = (".mf4", ".mdf", ".dat")
FRAMES = (".log", ".blf", ".asc", ".trc", ".db")  # read at the CAN room's edge, then `frames.decode`


def read(
    path: str | pathlib.Path,
    mapping: Mapping[str, str] | None = None,
    *,
    time_unit: str | None = None,
    variable_units: Mapping[str, str] | None = None,
) -> Dataset:
    """The channels of a text table, a robot's log, a measurement file, or a walk's folder.

    mapping: {column: channel}; time_unit: of stamps whose column does not say it; variable_units: of a robot's log.
    UserError for what is none of these.
    """
    path = pathlib.Path(path)
    if not path.exists():
        raise DataError(f"{path}: there is no such file")
    if path.is_dir():
        return run_folder.read(path, mapping)
    suffix = path.suffix.lower()
    if suffix in MEASUREMENTS:
        return measurement.read(path, mapping)
    if suffix in FRAMES:
        raise DataError(f"{path}: a recording of CAN frames needs a DBC file (--dbc FILE)")
    if robodaq.is_one(path):
        return robodaq.read(path, mapping, variable_units)
    return csv_file.read(path, mapping, time_unit)
