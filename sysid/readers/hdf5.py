"""HDF5 files: every data set of numbers, by its path; also MATLAB's files of version 7.3 and netCDF 4."""

import math
import pathlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ranger_sim.foundation.user_error import DataError
from ranger_sim.sysid.readers.arrays import Arrays

UNITS = ("units", "unit", "Unit", "Units")
MATLABS_OWN = ("#refs#", "#subsystem#")  # groups of MATLAB for its objects
NUMBERS = ("double", "single", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "logical")


def read(arrays: Arrays, library: Any, path: pathlib.Path, most_numbers: int) -> None:
    """Add the arrays of a file. UserError for one that unpacks to more than `most_numbers`."""
    with library.File(path, "r") as file:
        found: list[Any] = []
        # links to other files are not followed
        file.visititems(lambda name, item: found.append(item) if isinstance(item, library.Dataset) else None)
        count = sum(math.prod(each.shape or ()) for each in found)
        if count > most_numbers:
            raise DataError(f"{path}: it unpacks to {count} numbers, allowed are {most_numbers}")
        for item in found:
            name = item.name.strip("/").replace("/", ".")
            if name.startswith(MATLABS_OWN) or _is_of_pandas(item):
                continue
            kind = _text(item.attrs.get("MATLAB_class", b""))
            if item.shape is None or (kind and kind not in NUMBERS) or item.attrs.get("MATLAB_empty"):
                arrays.other.append(name)
            elif item.dtype.names:
                table = item[()]
                for field in item.dtype.names:
                    arrays.add(f"{name}.{field}", table[field])
            elif item.dtype.kind in "fiub":
                value = _unpacked(item)
                unit = next((_text(item.attrs[key]) for key in UNITS if key in item.attrs), "")
                arrays.add(name, value.T if kind and value.ndim == 2 else value, unit)
            else:
                arrays.other.append(name)
        file.visititems(lambda name, item: _of_pandas(arrays, name, item) if isinstance(item, library.Group) else None)


def _unpacked(item: Any) -> NDArray:
    """The values of a data set; those of netCDF with their scale, offset and mark of missing ones."""
    value: NDArray = item[()]
    missing = item.attrs.get("_FillValue", item.attrs.get("missing_value"))
    scale, offset = item.attrs.get("scale_factor"), item.attrs.get("add_offset")
    absent = value == np.ravel(missing)[0] if missing is not None else np.zeros(value.shape, dtype=bool)
    if scale is not None or offset is not None or absent.any():
        value = value * float(np.ravel(1.0 if scale is None else scale)[0])
        value = value + float(np.ravel(0.0 if offset is None else offset)[0])
        value[absent] = np.nan
    return value


def _text(value: Any) -> str:
    value = np.ravel(value)[0] if np.size(value) else ""
    return value.decode("utf-8", errors="replace") if isinstance(value, bytes) else str(value)


def _is_of_pandas(item: Any) -> bool:
    return _text(item.parent.attrs.get("pandas_type", b"")) in ("frame", "series")


def _of_pandas(arrays: Arrays, path: str, group: Any) -> None:
    """A frame as pandas writes it in its fixed format: an index, and blocks of columns of one type."""
    if _text(group.attrs.get("pandas_type", b"")) != "frame":
        return
    name = path.strip("/").replace("/", ".")
    index = group["axis1"]
    stamps = index[()]
    if "datetime64" in (kind := _text(index.attrs.get("kind", b""))):
        unit = kind.partition("[")[2].partition("]")[0].partition(",")[0] or "ns"
        stamps = stamps.astype(f"datetime64[{unit}]")
    called = _text(index.attrs.get("name", b""))
    called = "index" if called in ("", "N.", "None") else called
    arrays.add(f"{name}.{called}", stamps)
    for block in range(int(np.ravel(group.attrs.get("nblocks", 0))[0])):
        items, values = group[f"block{block}_items"][()], group[f"block{block}_values"]
        if values.dtype.kind not in "fiub":
            arrays.other += [f"{name}.{_text(each)}" for each in items]
            continue
        for column, each in enumerate(items):
            arrays.add(f"{name}.{_text(each)}", values[:, column])
