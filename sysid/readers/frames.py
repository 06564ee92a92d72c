"""Recorded CAN frames as channels, by the messages of a DBC file.

The caller reads the recording (candump, BLF, ASC ... are read in `can_bus/edge/`): this package knows only the frames'
numbers. A channel is called Message.signal; the robot's own messages have one signal `value`, whose channel has the
message's name. A message on several buses becomes one channel per bus, called can0.Message.signal; `buses` chooses
among them. Stamps are those of the recording; a stamp inside a message (`time_ms`) is a separate channel,
Message.time_s, so that the two clocks can be compared.
"""

import pathlib
from collections.abc import Collection, Iterable, Mapping
from typing import Any

import numpy as np

from ranger_sim.can_bus.fd_frame import LONGEST, fd_data_length
from ranger_sim.can_bus.frame import data_length
from ranger_sim.foundation.events import FLAG_ERROR, FLAG_EXTENDED, FLAG_FD, FLAG_REMOTE
from ranger_sim.foundation.user_error import DataError
from ranger_sim.sysid.dataset import Dataset, Finding, Loss
from ranger_sim.sysid.readers import columns

Frame = tuple[str, int, int, int, int, int]  # bus, time_ns, identifier, flags (length in the low four bits), lo, hi
Key = tuple[str, str, str]  # bus, message, signal
EXTENDED_BIT = 1 << 31  # distinguishes extended identifiers from standard ones


def decode(
    name: str,
    frames: Iterable[Frame],
    databases: Iterable[str | pathlib.Path],
    mapping: Mapping[str, str] | None = None,
    buses: Collection[str] = (),
) -> Dataset:
    """The signals of all frames that the DBC files define. buses: those whose frames are read; all when empty.

    UserError when no frame is defined, a bus has no frame, or a file cannot be read.
    """
    dataset = Dataset(name, {})
    mapping = dict(mapping or {})
    messages = messages_of(loaded(databases))
    samples: dict[Key, tuple[list[int], list[float], str]] = {}
    unknown: dict[int, int] = {}
    broken: dict[tuple[str, str], int] = {}
    first_ns: int | None = None
    seen: set[str] = set()
    lines = {
        "frames": 0,
        "other buses": 0,
        "remote requests": 0,
        "unknown identifiers": 0,
        "left out: broken_frames": 0,
    }
    for bus, time_ns, identifier, flags, lo, hi in frames:
        seen.add(bus)
        if buses and bus not in buses:
            lines["other buses"] += 1
            continue
        if flags & (FLAG_ERROR | FLAG_REMOTE):
            lines["remote requests"] += 1
            continue
        first_ns = time_ns if first_ns is None else first_ns
        message = messages.get(identifier | (EXTENDED_BIT if flags & FLAG_EXTENDED else 0))
        if message is None:
            unknown[identifier] = unknown.get(identifier, 0) + 1
            continue
        data = (lo | hi << 32).to_bytes(LONGEST, "little")[
            : fd_data_length(flags) if flags & FLAG_FD else data_length(flags)
        ]
        try:
            decoded = message.decode(data, decode_choices=False)
        except Exception:  # too short, or a multiplexer's value that has no signals: of many kinds
            broken[bus, message.name] = broken.get((bus, message.name), 0) + 1
            continue
        lines["frames"] += 1
        for signal, value in decoded.items():
            key = (bus, message.name, signal)
            if key not in samples:
                unit = message.get_signal_by_name(signal).unit or ""
                samples[key] = ([], [], unit)
            samples[key][0].append(time_ns)
            samples[key][1].append(float(value))
    for bus in buses:
        if bus not in seen:
            raise DataError(f"{name}: --bus {bus}: unknown bus (available: {', '.join(sorted(seen))})")
    if not samples or first_ns is None:
        misfits = f", {sum(broken.values())} that do not fit their message" if broken else ""
        raise DataError(
            f"{name}: none of its frames is a message of the DBC file ({sum(unknown.values())} others{misfits})"
        )
    lines["unknown identifiers"], lines["left out: broken_frames"] = sum(unknown.values()), sum(broken.values())
    dataset.lines = {what: number for what, number in lines.items() if number}
    of_message: dict[str, list[str]] = {}
    for bus, message, _ in samples:
        of_message.setdefault(message, [])
        if bus not in of_message[message]:
            of_message[message].append(bus)

    def called(bus: str, message: str, signal: str = "value") -> str:
        of_bus = f"{bus}." if len(of_message.get(message, ())) > 1 and bus else ""
        return of_bus + (message if signal == "value" else f"{message}.{signal}")

    _tell(dataset, unknown, {called(*key): count for key, count in broken.items()}, of_message)
    columns.check_mapping(dataset, mapping, [called(*key) for key in samples])
    begin_ns = first_ns if first_ns * 1e-9 > columns.EPOCH_S else 0
    if begin_ns:
        columns.from_zero(dataset, np.array([begin_ns * 1e-9]))  # for its note; whole nanoseconds are subtracted below
    for key, (stamps, values, unit) in samples.items():
        time_s = np.array([(stamp - begin_ns) * 1e-9 for stamp in stamps], dtype=np.float64)
        named = columns.label(dataset.name, called(*key), unit, mapping)
        lost = (Loss("broken_frames", broken[key[:2]]),) if key[:2] in broken else ()
        columns.add(dataset, called(*key), named, time_s, np.array(values), losses=lost)
    return dataset


def loaded(databases: Iterable[str | pathlib.Path]) -> list[tuple[str | pathlib.Path, Any]]:
    """(path, cantools database) of each DBC file. UserError for one that cannot be read."""
    import cantools  # only here: half a second

    found = []
    for path in databases:
        try:
            found.append((path, cantools.database.load_file(str(path), database_format="dbc", strict=False)))
        except OSError as error:
            raise DataError(f"{path}: cannot be read ({error.strerror or error})") from None
        except Exception as error:  # a broken file raises many kinds of exceptions in cantools
            reason = " ".join(f"{type(error).__name__}: {error}".split())[:200]
            raise DataError(f"{path}: not a DBC file that cantools can read ({reason})") from None
    return found


def messages_of(databases: Iterable[tuple[str | pathlib.Path, Any]]) -> dict:
    """Messages by identifier, of all files together (`loaded`)."""
    found: dict = {}
    for path, database in databases:
        for message in database.messages:
            key = message.frame_id | (EXTENDED_BIT if message.is_extended_frame else 0)
            if key in found and found[key].name != message.name:
                raise DataError(
                    f"{path}: the identifier {message.frame_id:#x} is {message.name} here and {found[key].name} in "
                    "another DBC file; read one bus at a time (--bus) with its own file"
                )
            found[key] = message
    if not found:
        raise DataError("a recording of CAN frames needs a DBC file with messages (--dbc FILE)")
    return found


def _tell(
    dataset: Dataset, unknown: dict[int, int], broken: dict[str, int], of_message: Mapping[str, list[str]]
) -> None:
    """Findings about frames that were left out, and about messages on several buses."""
    several = {message: buses for message, buses in of_message.items() if len(buses) > 1}
    if several:
        message, buses = next(iter(several.items()))
        text = (
            f"{len(several)} messages were on several buses ({message} on {', '.join(buses)}) and are as many channels "
            f"({buses[0]}.{message} ...); --bus chooses one"
        )
        dataset.findings.append(Finding("", "several_buses", 0.0, 0.0, float(len(several)), "messages", text, "note"))
    if unknown:
        some = ", ".join(f"{each:#x}" for each in sorted(unknown)[:5])
        text = f"{sum(unknown.values())} frames have identifiers that the DBC file does not know ({some})"
        size = float(sum(unknown.values()))
        dataset.findings.append(Finding("", "unknown_frames", 0.0, 0.0, size, "frames", text, "note"))
    for message, count in broken.items():
        text = f"{count} frames do not fit their message and are left out"
        dataset.findings.append(Finding(message, "broken_frames", 0.0, 0.0, float(count), "frames", text))
