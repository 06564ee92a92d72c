"""Binary files that a library reads: MATLAB, Parquet, ULog, MCAP, HDF5 and TDMS. A missing library is one line."""

import importlib
import math
import pathlib
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ranger_sim.foundation import json_text
from ranger_sim.foundation.user_error import DataError, UserError
from ranger_sim.sysid.dataset import Dataset, Finding, Loss
from ranger_sim.sysid.readers import arrays, columns, hdf5, tdms
from ranger_sim.sysid.readers.arrays import Arrays, Column

MOST_BYTES = 2_000_000_000  # of a file, and of what it unpacks to
MOST_MESSAGES = 20_000_000
KINDS = {  # and the module that reads them
    "MATLAB": "scipy.io",
    "Parquet": "pyarrow.parquet",
    "ULog": "pyulog",
    "MCAP": "mcap.reader",
    "HDF5": "h5py",
    "TDMS": "nptdms",
}
OF_ARRAYS = ("MATLAB", "Parquet", "HDF5", "TDMS")  # which may have no time among them
HDF5_INSIDE = b"MATLAB 7.3"  # a .mat file of this version is an HDF5 file
ULOG_HEADER, ULOG_HEAD = 16, 3  # bytes of the file's header, and of a message's: its length, two bytes, and its type
MOST_CELLS = 1000  # of an array of MATLAB's cells


def read(
    path: pathlib.Path,
    kind: str,
    mapping: Mapping[str, str] | None = None,
    time_unit: str | None = None,
    rate_hz: float | None = None,
) -> Dataset:
    """The channels of a file of one of KINDS. UserError for a file that its library cannot read, or without a time."""
    with path.open("rb") as file:
        kind = "HDF5" if file.read(len(HDF5_INSIDE)) == HDF5_INSIDE else kind
    library = importlib.import_module(KINDS[kind])  # ModuleNotFoundError where it is not installed
    if path.stat().st_size > MOST_BYTES:
        raise DataError(f"{path}: {path.stat().st_size} bytes, a {kind} file may have {MOST_BYTES}")
    dataset = Dataset(path.name, {})
    mapping = dict(mapping or {})
    try:
        found = list(_columns(dataset, library, path, kind, mapping, time_unit, rate_hz))
    except UserError:
        raise
    except Exception as error:  # a broken file raises many kinds of exceptions in a library
        said = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        program = KINDS[kind].partition(".")[0]
        raise DataError(f"{path}: not a {kind} file that {program} can read ({said})") from None
    if kind in ("ULog", "MCAP"):
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


def _columns(
    dataset: Dataset,
    library: Any,
    path: pathlib.Path,
    kind: str,
    mapping: Mapping[str, str],
    time_unit: str | None,
    rate_hz: float | None,
) -> Iterator[Column]:
    if kind == "ULog":
        return _ulog(dataset, library, path)
    if kind == "MCAP":
        return _mcap(dataset, library, path)
    found = Arrays(str(path))
    if kind == "MATLAB":
        _matlab(found, library, path)
    elif kind == "Parquet":
        _parquet(found, library, path)
    elif kind == "HDF5":
        hdf5.read(found, library, path, MOST_BYTES // 8)
    else:
        tdms.read(dataset, found, library, path, MOST_BYTES // 8)
    return arrays.channels(dataset, found, mapping, time_unit, rate_hz)


def _matlab(found: Arrays, library: Any, path: pathlib.Path) -> None:
    contents = library.whosmat(path)
    count = sum(math.prod(shape) for _, shape, _ in contents)
    if 8 * count > MOST_BYTES:
        raise DataError(f"{path}: it unpacks to {count} numbers, allowed are {MOST_BYTES // 8}")
    variables = library.loadmat(path, squeeze_me=True, struct_as_record=True)
    found.other += [name for name, _, kind in contents if name not in variables or kind == "opaque"]
    for name, value in variables.items():
        if not name.startswith("__") and name not in found.other:
            _flatten(found, name, np.asarray(value))


def _flatten(found: Arrays, name: str, value: np.ndarray) -> None:
    """The fields of a structure, of each of its elements where there are several, and the elements of a cell array."""
    if value.dtype.names:
        for place, record in enumerate(value.reshape(-1)):
            element = name if value.size == 1 else f"{name}({place + 1})"
            for field in value.dtype.names:
                _flatten(found, f"{element}.{field}", np.asarray(record[field]))
    elif value.dtype.kind == "O" and value.size < MOST_CELLS:
        for place, cell in enumerate(value.reshape(-1)):
            _flatten(found, name if value.size == 1 else f"{name}{{{place + 1}}}", np.asarray(cell))
    else:
        found.add(name, value)


def _parquet(found: Arrays, library: Any, path: pathlib.Path) -> None:
    file = library.ParquetFile(path)
    size = sum(file.metadata.row_group(k).total_byte_size for k in range(file.metadata.num_row_groups))
    if size > MOST_BYTES:
        raise DataError(f"{path}: it unpacks to {size} bytes, allowed are {MOST_BYTES}")
    table = file.read()
    for field in table.schema:
        column = table.column(field.name)
        if str(field.type).startswith("decimal"):
            column = column.cast("float64")
        unit = (field.metadata or {}).get(b"unit", b"").decode("utf-8", errors="replace")
        found.add(field.name, column.to_numpy(), unit)


def _ulog(dataset: Dataset, library: Any, path: pathlib.Path) -> Iterator[Column]:
    log = library.ULog(str(path))
    for each in log.data_list:
        time_s = np.asarray(np.asarray(each.data["timestamp"], dtype=np.int64) * 1e-6, dtype=np.float64)
        number = f".{each.multi_id}" if each.multi_id else ""
        for name, value in each.data.items():
            if name != "timestamp":
                yield Column(f"{each.name}{number}.{name}", "", time_s, np.asarray(value, dtype=np.float64))
    if (where := _ends_within(path)) is not None:
        dataset.losses.append(Loss("cut_off", 1, f"behind byte {where}"))
        dataset.rows += 1
        text = f"the file is cut off within a message that begins at byte {where}; nothing says how much is missing"
        dataset.findings.append(Finding("", "cut_off", 0.0, 0.0, 1.0, "messages", text))
    if log.dropouts:
        count = len(log.dropouts)
        text = (
            f"the logger dropped data {count} times, {sum(each.duration for each in log.dropouts) / 1e3:.3g} s in all"
        )
        dataset.findings.append(Finding("", "dropouts", 0.0, 0.0, float(count), "times", text))


def _ends_within(path: pathlib.Path) -> int | None:
    """The byte at which a message begins that ends behind the file; None when the last one is whole."""
    size = path.stat().st_size
    place = ULOG_HEADER
    with path.open("rb") as file:
        while place < size:
            file.seek(place)
            end = place + ULOG_HEAD + int.from_bytes(file.read(2), "little")
            if end > size:
                return place
            place = end
    return None


def _mcap(dataset: Dataset, library: Any, path: pathlib.Path) -> Iterator[Column]:
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
                content: Any = json_text.loads(message.data, f"{path}: message {count}")
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
        yield Column(name, unit, time_s, np.array(values, dtype=np.float64))


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
