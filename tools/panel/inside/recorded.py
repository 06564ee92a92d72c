"""The inside of a robot in recordings: the logs of a run's folder, and the frames of a recording with DBC files."""

from __future__ import annotations

import array
import asyncio
import pathlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from ranger_sim.foundation import json_text
from ranger_sim.foundation.events import FLAG_ERROR, FLAG_EXTENDED, FLAG_REMOTE
from ranger_sim.foundation.user_error import UserError
from ranger_sim.ranger.assembly import BUS_BIT_RATE
from ranger_sim.sysid.dataset import Dataset
from ranger_sim.sysid.readers import columns, frames
from ranger_sim.sysid.readers.run_folder import SUMMARY
from ranger_sim.tools.panel.inside.buses import Bus
from ranger_sim.tools.panel.inside.errors import ERRORS, ON_NO_BUS, ErrorList, changes
from ranger_sim.tools.panel.inside.frames import ROW_WORDS, RecentFrames, of_the_robot, rows_of_frame
from ranger_sim.tools.panel.inside.logs import LogFrames
from ranger_sim.tools.run.folder import BUS_LOGS

NO_SLOTS = "A recording keeps no slots one by one."
REPORTED_SLOTS = (
    "The boards report their own in the channels …_EXECUTION_TIME and …_MAX_EXECUTION_TIME; "
    "a running robot shows every one (ranger-sim panel --name)."
)
NO_FRAMES = (
    "This recording keeps no frames; a walk's folder does (ranger-sim walk --log full --out), or frames with --dbc."
)
NO_RATE = "Frames alone do not show the bit rate, so the load is not known; error frames are left out."
RATE_OF_FILE = "The loads are by the bit rates of the DBC file (Baudrate, BaudrateCANFD); error frames are left out."
TOO_LONG = "The recording is longer than a day, so the load is not shown; error frames are left out."
LONGEST_S = 86_400.0  # of a load in windows of 10 ms: 140 MB, chosen by us
NO_RATE_OF_PROFILE = "The walk had a profile, whose bit rates its log does not have: loads are not known."


class RunLogs:
    """Frames and errors of a walk's folder, or only the errors of a recording of variables.

    group: appended to the names of buses; shift_s: added to all times; end_s: latest time shown.
    `run` reads the logs step by step, so that a folder of an hour opens at once.
    """

    def __init__(self, folder: pathlib.Path, dataset: Dataset, group: str, shift_s: float, end_s: float) -> None:
        self.group = group
        self.start_ns = -round(shift_s * 1e9)
        self.end_s = end_s
        self.errors = ErrorList()
        rate = BUS_BIT_RATE if profile_of(folder) is None else None
        self.logs = [LogFrames(folder / name) for name in BUS_LOGS if (folder / name).is_file()]
        self.buses = [
            Bus(log.path.stem + group, self.start_ns, rate, log, of_the_robot, kept_s=end_s + 1.0) for log in self.logs
        ]
        self.missing = NO_FRAMES if not self.logs else NO_RATE_OF_PROFILE if rate is None else ""
        self.trouble = ""
        self.is_read = not self.logs
        for board in ERRORS.values():  # without logs of the buses, all errors as far as the table has them
            channel = dataset.channels.get(f"ERROR_{board}")
            if channel is not None and (board in ON_NO_BUS or not self.logs):
                for word, time_s in changes(channel.value.astype(np.int64), channel.time_s, 0):
                    self.errors.note(word, float(time_s) + shift_s)

    async def run(self) -> None:
        """Read the logs, all of them at the same pace."""
        try:
            waiting = list(zip(self.logs, self.buses, strict=True))
            while waiting:
                log, bus = min(waiting, key=lambda each: each[0].newest_ns or 0)
                piece = await asyncio.to_thread(log.read)
                if piece is None:
                    waiting.remove((log, bus))
                    bus.passed(self.start_ns + round(self.end_s * 1e9))
                    continue
                log.add(piece)
                bus.take(piece[2])
                self.errors.note_frames(piece[2], self.start_ns)
        except UserError as error:
            self.trouble = str(error)
        self.is_read = True

    def close(self) -> None:
        """Close the logs."""
        for log in self.logs:
            log.close()

    def note(self) -> str:
        """What is missing (so far), as text."""
        if self.trouble:
            return self.trouble
        if not self.is_read:
            newest = min(log.newest_ns or self.start_ns for log in self.logs)
            return f"The logs are being read: up to {(newest - self.start_ns) * 1e-9:.0f} s so far."
        return self.missing


class Decoded:
    """The frames of a recording that is read with DBC files, in memory with 24 bytes each (CAN FD: up to 192).

    Pass each frame to `take`; call `done` after the last one. Loads are known where the DBC files have one bit rate.
    """

    def __init__(self, path: pathlib.Path, databases: Sequence[str]) -> None:
        self.path = path
        loaded = frames.loaded(databases)
        self.messages = frames.messages_of(loaded)
        self.bit_per_s, self.data_bit_per_s = rates_of([database for _, database in loaded])
        self.missing = NO_RATE if self.bit_per_s is None else RATE_OF_FILE
        self.words: dict[str, array.array[int]] = {}
        self.first_ns: int | None = None  # of the frames that may be messages
        self.buses: list[Bus] = []
        self.errors = ErrorList()

    def take(self, frame: frames.Frame) -> None:
        """Keep the next frame of the recording."""
        bus, time_ns, identifier, flags, low, high = frame
        if self.first_ns is None and not flags & (FLAG_ERROR | FLAG_REMOTE):
            self.first_ns = time_ns
        words = self.words.setdefault(bus or self.path.stem, array.array("q"))
        for row in rows_of_frame(time_ns, identifier, flags, low, high):
            words.extend(row)

    def done(self, group: str, shift_s: float) -> None:
        """All frames have been taken. Their time 0 is that of the channels."""
        first_ns = self.first_ns or 0
        start_ns = (first_ns if first_ns * 1e-9 > columns.EPOCH_S else 0) - round(shift_s * 1e9)
        for name, words in self.words.items():
            rows = np.frombuffer(words, np.int64).reshape(-1, ROW_WORDS)
            rows = rows[np.argsort(rows[:, 0], kind="stable")]
            kept = RecentFrames(len(rows))
            kept.append(rows)
            span_s = (int(rows[-1, 0]) - min(int(rows[0, 0]), start_ns)) * 1e-9 + 1.0
            rates = (self.bit_per_s, self.data_bit_per_s)
            if span_s > LONGEST_S:
                rates, span_s, self.missing = (None, 0), 1.0, TOO_LONG if self.bit_per_s else self.missing
            found = Bus(name + group, start_ns, rates[0], kept, self.read, span_s, rates[1])
            found.more_errors = None
            found.take(rows)
            self.buses.append(found)
        self.words.clear()

    def read(self, number: int, flags: int, data: bytes) -> tuple[str, float | str | None]:
        """Decode a frame by the DBC files."""
        message = self.messages.get(number | (frames.EXTENDED_BIT if flags & FLAG_EXTENDED else 0))
        if message is None:
            return "", None
        try:
            signals = message.decode(data, decode_choices=False)
        except Exception:  # too short, or a multiplexer value without signals: many exception types
            return message.name, None
        if len(signals) == 1:
            return message.name, float(next(iter(signals.values())))
        return message.name, ", ".join(f"{name} {float(value):g}" for name, value in signals.items())

    async def run(self) -> None:
        """Return at once: all frames are available from the beginning."""

    def close(self) -> None:
        """Nothing to close."""

    def note(self) -> str:
        """What is missing, as text."""
        return self.missing


def rates_of(databases: Sequence[Any]) -> tuple[int | None, int]:
    """Bit rate and data bit rate (0: none) of DBC files, bit/s; None and 0 where they have none, or several."""
    from ranger_sim.can_bus.edge.dbc import bit_rate_of

    found = {(bit_rate_of(database), bit_rate_of(database, "BaudrateCANFD") or 0) for database in databases}
    (nominal, data), *more = found
    return (None, 0) if more or not nominal or (data and data < nominal) else (nominal, data)


def profile_of(folder: pathlib.Path) -> str | None:
    """The profile of buses and boards of a walk, from its summary; None: the usual ones."""
    try:
        summary = json_text.loads((folder / SUMMARY).read_bytes(), SUMMARY)
    except (OSError, json_text.JsonError):
        return None
    found = summary.get("profile") if isinstance(summary, dict) else None
    return None if found is None else str(found)
