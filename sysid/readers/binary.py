"""Binary files that a library reads: MATLAB's .mat, Parquet, ULog and MCAP. A missing library is one line."""

import importlib
import json
import math
import pathlib
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ranger_sim.foundation.user_error import DataError, UserError
from ranger_sim.sysid import units
from ranger_sim.sysid.dataset import Array, Dataset, Finding
from ranger_sim.sysid.readers import columns, layout

MOST_BYTES = 2_000_000_000  # of a file, and of what it unpacks to
MOST_MESSAGES = 20_000_000
Column = tuple[str, str, Array, Array]  # name, unit, stamps in s, values
KINDS = {
    "MATLAB": ("scipy.io", "scipy"),
    "Parquet": ("pyarrow.parquet", "pyarrow"),
    "ULog": ("pyulog", "pyulog"),
    "MCAP": ("mcap.reader", "ranger-sim[mcap]"),
}


def read(
    path: pathlib.Path, kind: str, mapping: Mapping[str, str] | None = None, time_unit: str | None = None
) -> Dataset:
    """The channels of a file of one of KINDS. UserError for a file that its library cannot read, or without a time."""
    module_name, package = KINDS[kind]
    library = importlib.import_module(module_name)  # ModuleNotFoundError where it is not installed
    if path.stat().st_size > MOST_BYTES:
        raise DataError(f"{path}: {path.stat().st_size} bytes, a {kind} file may have {MOST_BYTES}")
    dataset = Dataset(path.name, {})
    mapping = dict(mapping or {})
    reader = {"MATLAB": _matlab, "Parquet": _parquet, "ULog": _ulog, "MCAP": _mcap}[kind]
    try:
        found = list(reader(dataset, library, path, mapping, time_unit))
    except UserError:
        raise
    except Exception as error:  # a broken file raises many kinds of exceptions in a library
        said = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        raise DataError(f"{path}: not a {kind} file that {package} can read ({said})") from None
    columns.check_mapping(dataset, mapping, [name for name, *_ in found])
    zero: float | None = None
    for name, unit, time_s, value in found:
        if zero is None and len(time_s):
            zero = float(time_s[0] - columns.from_zero(dataset, time_s)[0])
        dataset.rows += len(value)
        columns.add(dataset, name, columns.label(dataset.name, name, unit, mapping), time_s - (zero or 0.0), value)
    if not dataset.channels:
        raise DataError(f"{path}: there is no channel with numbers in it")
    return dataset


def _of_table(
    dataset: Dataset, table: Mapping[str, Any], mapping: Mapping[str, str], time_unit: str | None
) -> Iterator[Column]:
    """The columns of equal length of a table, one of which is the time."""
    numeric = {}
    for name, value in table.items():
        flat = np.asarray(value)
        if flat.dtype.kind == "M":
            numeric[name] = flat.astype("datetime64[ns]").astype(np.int64)
        elif flat.dtype.kind in "fiub":
            numeric[name] = flat
    times = [name for name in numeric if layout.is_time_name(mapping.get(name, name))]
    if not times:
        some = ", ".join(numeric)[:200] or "none with numbers"
        raise DataError(f"{dataset.name}: there is no time column among {some}; --map NAME=t_s says which it is")
    time = times[0]
    stamps = numeric.pop(time)
    unit = units.split(mapping.get(time, time))[1] or (units.unit_of(time_unit) if time_unit else None)
    if np.asarray(table[time]).dtype.kind == "M":
        time_s = (stamps - stamps[0]) * 1e-9
    else:
        if unit is None:
            text = f"{time}: nothing says the unit of the stamps; seconds are assumed"
            dataset.findings.append(Finding("", "unit_assumed", 0.0, 0.0, 1.0, "s", text))
        time_s = stamps.astype(float) * (unit.factor if unit is not None else 1.0)
    dataset.layout |= {"time": time}
    for name, value in numeric.items():
        if len(value) == len(time_s):
            yield name, "", time_s, value.astype(float)


def _matlab(
    dataset: Dataset, library: Any, path: pathlib.Path, mapping: Mapping[str, str], time_unit: str | None
) -> Iterator[Column]:
    with path.open("rb") as file:
        if b"MATLAB 7.3" in file.read(128):
            raise DataError(f"{path}: a .mat file of version 7.3 (HDF5): save it in MATLAB with '-v7'")
    count = sum(math.prod(shape) for _, shape, _ in library.whosmat(path))
    if 8 * count > MOST_BYTES:
        raise DataError(f"{path}: it unpacks to {count} numbers, allowed are {MOST_BYTES // 8}")
    variables = library.loadmat(path, squeeze_me=True, struct_as_record=True)
    table: dict[str, Any] = {}
    for name, value in variables.items():
        if name.startswith("__"):
            continue
        _flatten(table, name, np.asarray(value))
    longest = [each for each in table.values() if len(each) > 1]
    counts = {len(each) for each in longest}
    times = [name for name in table if layout.is_time_name(mapping.get(name, name.rpartition(".")[2]))]
    if times and times[0] not in mapping:
        mapping = {**mapping, times[0]: times[0].rpartition(".")[2]}
        table = {times[0]: table[times[0]], **table}
    for _ in counts:
        yield from _of_table(dataset, table, mapping, time_unit)
        return
    raise DataError(f"{path}: it has no variable with more than one number")


def _flatten(table: dict[str, Any], name: str, value: np.ndarray) -> None:
    if value.dtype.names:
        record = value.reshape(-1)[0]
        for field in value.dtype.names:
            _flatten(table, f"{name}.{field}", np.asarray(record[field]))
    elif value.ndim == 1 and value.dtype.kind in "fiub":
        table[name] = value
    elif value.ndim == 2 and value.dtype.kind in "fiub":
        for column in range(value.shape[1]):
            table[f"{name}[{column}]"] = value[:, column]


def _parquet(
    dataset: Dataset, library: Any, path: pathlib.Path, mapping: Mapping[str, str], time_unit: str | None
) -> Iterator[Column]:
    file = library.ParquetFile(path)
    size = sum(file.metadata.row_group(k).total_byte_size for k in range(file.metadata.num_row_groups))
    if size > MOST_BYTES:
        raise DataError(f"{path}: it unpacks to {size} bytes, allowed are {MOST_BYTES}")
    table = file.read()
    yield from _of_table(
        dataset, {name: table.column(name).to_numpy() for name in table.column_names}, mapping, time_unit
    )


def _ulog(
    dataset: Dataset, library: Any, path: pathlib.Path, mapping: Mapping[str, str], time_unit: str | None
) -> Iterator[Column]:
    log = library.ULog(str(path))
    for each in log.data_list:
        time_s = np.asarray(np.asarray(each.data["timestamp"], dtype=np.int64) * 1e-6, dtype=np.float64)
        number = f".{each.multi_id}" if each.multi_id else ""
        for name, value in each.data.items():
            if name != "timestamp":
                yield f"{each.name}{number}.{name}", "", time_s, np.asarray(value, dtype=np.float64)
    if log.dropouts:
        count = len(log.dropouts)
        text = (
            f"the logger dropped data {count} times, {sum(each.duration for each in log.dropouts) / 1e3:.3g} s in all"
        )
        dataset.findings.append(Finding("", "dropouts", 0.0, 0.0, float(count), "times", text))


def _mcap(
    dataset: Dataset, library: Any, path: pathlib.Path, mapping: Mapping[str, str], time_unit: str | None
) -> Iterator[Column]:
    """Messages in JSON, or in protobuf with its description in the file: every number of every topic."""
    series: dict[str, tuple[list[int], list[float], str]] = {}
    other: set[str] = set()
    classes: dict[int, Any] = {}
    count = 0
    with path.open("rb") as file:
        for schema, channel, message in library.make_reader(file).iter_messages():
            count += 1
            if count > MOST_MESSAGES:
                raise DataError(f"{path}: more than {MOST_MESSAGES} messages")
            if channel.message_encoding == "json":
                content: Any = json.loads(message.data)
            elif channel.message_encoding == "protobuf" and schema is not None:
                if schema.id not in classes:
                    classes[schema.id] = _message_class(schema)
                content = _fields(classes[schema.id].FromString(message.data))
            else:
                other.add(f"{channel.topic} ({channel.message_encoding})")
                continue
            topic = channel.topic.strip("/").replace("/", ".")
            for name, value in _numbers(topic, content):
                unit = channel.metadata.get(name.rpartition(".")[2], "")
                stamps, values, _ = series.setdefault(name, ([], [], unit))
                stamps.append(message.log_time)
                values.append(value)
    if other:
        text = f"topics in another encoding than JSON or protobuf are left out: {', '.join(sorted(other)[:5])}"
        dataset.findings.append(Finding("", "no_numbers", 0.0, 0.0, float(len(other)), "topics", text, "note"))
    begin = min((stamps[0] for stamps, *_ in series.values()), default=0)
    begin = begin if begin * 1e-9 > columns.EPOCH_S else 0
    for name, (stamps, values, unit) in series.items():
        time_s = np.asarray((np.array(stamps, dtype=np.int64) - begin) * 1e-9, dtype=np.float64)
        yield name, unit, time_s, np.array(values, dtype=np.float64)


def _message_class(schema: Any) -> Any:
    descriptor_pb2 = importlib.import_module("google.protobuf.descriptor_pb2")
    pool = importlib.import_module("google.protobuf.descriptor_pool").DescriptorPool()
    for each in descriptor_pb2.FileDescriptorSet.FromString(schema.data).file:
        pool.Add(each)
    found = pool.FindMessageTypeByName(schema.name)
    return importlib.import_module("google.protobuf.message_factory").GetMessageClass(found)


def _fields(message: Any) -> dict[str, Any]:
    return {field.name: value for field, value in message.ListFields() if isinstance(value, int | float)}


def _numbers(name: str, content: Any) -> Iterator[tuple[str, float]]:
    if isinstance(content, bool | int | float):
        yield name, float(content)
    elif isinstance(content, dict):
        for key, value in content.items():
            yield from _numbers(f"{name}.{key}", value)
    elif isinstance(content, list) and len(content) <= 64:
        for place, value in enumerate(content):
            yield from _numbers(f"{name}[{place}]", value)
