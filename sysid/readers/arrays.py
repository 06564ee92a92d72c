"""Named arrays as channels: what MATLAB, Parquet and HDF5 files hold, with one time or several among them."""

import dataclasses
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ranger_sim.foundation.user_error import DataError
from ranger_sim.sysid import units
from ranger_sim.sysid.dataset import Array, Dataset, Finding
from ranger_sim.sysid.readers import columns, layout, time_column

MOST_NAMED = 5
NOTE = "note"


class Column(NamedTuple):
    """One channel of a file. time_s, value: (n,); unit: text, "" where the file has none."""

    name: str
    unit: str
    time_s: Array
    value: Array


@dataclasses.dataclass
class Arrays:
    """The arrays of a file by name, each (n,) or, of several columns, (n, k); `other`: what holds no numbers.

    units: texts, of the names that have one. own_times: stamps in s of arrays that need no time among the others.
    """

    path: str
    by_name: dict[str, NDArray] = dataclasses.field(default_factory=dict)
    units: dict[str, str] = dataclasses.field(default_factory=dict)
    own_times: dict[str, Array] = dataclasses.field(default_factory=dict)
    other: list[str] = dataclasses.field(default_factory=list)

    def add(self, name: str, value: NDArray, unit: str = "") -> None:
        """Keep an array of numbers or dates; the name of anything else."""
        value = np.asarray(value)
        if value.dtype.kind not in "fiubmM" or value.ndim > 2 or not value.size:
            self.other.append(name)
            return
        self.by_name[name] = value.reshape(-1) if 1 in value.shape or value.ndim < 2 else value
        if unit:
            self.units[name] = unit


def channels(
    dataset: Dataset,
    arrays: Arrays,
    mapping: Mapping[str, str],
    time_unit: str | None,
    rate_hz: float | None = None,
) -> Iterator[Column]:
    """Each array at the stamps of the time that it has in its group, or of the only one of its length.

    What has none is a finding. rate_hz: of the samples of all arrays, where no time counts. UserError for a file
    without a time.
    """
    flat = _flattened(arrays)
    columns.check_mapping(dataset, mapping, list(flat))
    for name in [each for each in flat if each in arrays.own_times]:
        yield Column(name, arrays.units.get(name, ""), arrays.own_times[name], flat.pop(name).astype(np.float64))
    if not flat and arrays.own_times:
        _note(dataset, arrays, {}, [])
        return
    times = {name: value for name, value in flat.items() if _is_time(name, value, mapping)}
    if rate_hz is not None:
        single = {name: 1 for name, value in flat.items() if len(value) == 1}
        kept = {name: value for name, value in flat.items() if name not in single and value.dtype.kind in "fiub"}
        time_column.of_rate(dataset, rate_hz, list(times))
        for name, value in kept.items():
            yield Column(name, arrays.units.get(name, ""), np.arange(len(value)) / rate_hz, value.astype(np.float64))
        arrays.other += [name for name in flat if name not in kept and name not in single]
        _note(dataset, arrays, single, [])
        return
    if not times and not arrays.own_times:
        some = ", ".join(flat)[:200] or "none with numbers"
        rising = next((name for name, value in flat.items() if len(value) > 2 and _rises(value)), "")
        raise DataError(
            f"{dataset.name}: there is no time column among {some}; "
            + (f"--map {rising}=time says which it is (it rises all the time)" if rising else "--map NAME=t_s says it")
            + time_column.or_with_rate(arrays.path)
        )
    stamps = _stamps(dataset, arrays, times, mapping, time_unit)
    used: set[str] = set()
    lost: dict[str, int] = {}
    for name, value in flat.items():
        if name in times:
            continue
        time = _time_of(name, len(value), times)
        if not time or value.dtype.kind == "M":
            lost[name] = len(value)
            continue
        used.add(time)
        numbers = value / np.timedelta64(1, "ns") * 1e-9 if value.dtype.kind == "m" else value.astype(np.float64)
        yield Column(name, "s" if value.dtype.kind == "m" else arrays.units.get(name, ""), stamps[time], numbers)
    _note(dataset, arrays, lost, [name for name in times if name not in used])


def _flattened(arrays: Arrays) -> dict[str, NDArray]:
    """Arrays of one dimension; columns of a table are called NAME[0], NAME[1] ..."""
    lengths = {len(value) for value in arrays.by_name.values() if value.ndim == 1}
    found: dict[str, NDArray] = {}
    for name, value in arrays.by_name.items():
        if value.ndim == 1:
            found[name] = value
            continue
        rows, wide = value.shape  # samples lie along the time, or along the longer side
        if wide in lengths and rows not in lengths or (wide > rows and rows not in lengths):
            value = value.T
        for column in range(value.shape[1]):
            found[f"{name}[{column}]"] = value[:, column]
            if name in arrays.units:
                arrays.units[f"{name}[{column}]"] = arrays.units[name]
    return found


def _is_time(name: str, value: NDArray, mapping: Mapping[str, str]) -> bool:
    if len(value) < 2:
        return False
    called = mapping.get(name, _last(name))
    if value.dtype.kind == "M" or called.endswith(("_timestamps", "_timestamp")):  # DGM0_timestamps
        return _rises(value) or layout.is_time_name(called)
    return layout.is_time_name(called)


def _last(name: str) -> str:
    """The name within its group."""
    return name.rpartition(".")[2].rpartition("/")[2]


def _group(name: str) -> str:
    return name.removesuffix(_last(name))


def _rises(value: NDArray) -> bool:
    return bool((np.diff(value) > np.zeros(1, dtype=np.diff(value[:2]).dtype)).all())


def _time_of(name: str, count: int, times: Mapping[str, NDArray]) -> str:
    """The time of an array of `count` values: the nearest one above it, else the only one of its length; or ""."""
    alike = [each for each in times if len(times[each]) == count]
    nearest = sorted((each for each in alike if name.startswith(_group(each))), key=lambda each: -len(_group(each)))
    if nearest and (len(alike) == 1 or _group(nearest[0])):
        return nearest[0]
    same = all(np.array_equal(times[each], times[alike[0]]) for each in alike[1:])
    return alike[0] if alike and same else ""


def _stamps(
    dataset: Dataset,
    arrays: Arrays,
    times: Mapping[str, NDArray],
    mapping: Mapping[str, str],
    time_unit: str | None,
) -> dict[str, Array]:
    """{time: its stamps in s}. All dates of a file count from the first of them."""
    found: dict[str, Array] = {}
    begins: dict[str, int] = {}
    dates = {name: value.astype("datetime64[ns]") for name, value in times.items() if value.dtype.kind == "M"}
    first = min((value[~np.isnat(value)].min() for value in dates.values() if not np.isnat(value).all()), default=None)
    for name, value in times.items():
        dataset.layout |= {"time": name} if not found else {}
        if name in dates:
            away = (dates[name] - first).astype(np.int64) * 1e-9
            dataset.clock_is_given = True
            found[name] = np.where(np.isnat(dates[name]), np.nan, away)
            continue
        if value.dtype.kind == "m":
            found[name] = value / np.timedelta64(1, "ns") * 1e-9
            continue
        called = mapping.get(name, name)
        unit = units.unit_of(arrays.units[name].partition(" since ")[0]) if name in arrays.units else None
        unit = unit or units.split(called)[1] or (units.unit_of(time_unit) if time_unit else None)
        whole = value.astype(np.int64) if value.dtype.kind in "iu" else None
        found[name], begins[name] = time_column.seconds(
            dataset, arrays.path, name, value.astype(np.float64), whole, unit
        )
    first_ns = next((begin for begin in begins.values() if begin), 0)
    for name, begin in begins.items():  # times of one calendar keep their distance
        if begin:
            found[name] = found[name] + (begin - first_ns) * 1e-9
    return found


def _note(dataset: Dataset, arrays: Arrays, lost: Mapping[str, int], without: list[str]) -> None:
    """Findings for what did not become a channel."""
    single = [name for name, count in lost.items() if count == 1]
    others = [f"{name} ({count})" for name, count in lost.items() if count > 1]
    for names, what, severity in (
        (others, "arrays have no time of their length and are left out", "warning"),
        (single, "single numbers are left out", NOTE),
        (arrays.other, "variables hold no plain numbers and are left out", NOTE),
        (without, "times have no channel of their length", NOTE),
    ):
        if names:
            more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
            text = f"{len(names)} {what}: {', '.join(names[:MOST_NAMED])}{more}"
            dataset.findings.append(Finding("", "no_numbers", 0.0, 0.0, float(len(names)), "arrays", text, severity))
