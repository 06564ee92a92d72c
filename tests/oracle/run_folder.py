"""Reads what a run left in its folder: CAN logs as text, variables by asammdf. Nothing of ranger_sim is imported here.

Frames are classical data frames with standard identifiers, as all of the robot's are. Their bits are made anew: CRC by
long division and stuffing by counting runs, for all frames of a log at once.
"""

import re
import warnings

import numpy as np

LINE = re.compile(r"\((\d+)\.(\d{6})\) can\d ([0-9A-F]{3}|[0-9A-F]{8})#([0-9A-F]*)\n")
CRC_POLYNOMIAL = 0x4599  # x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1 below x^15
AFTER_CRC = 1 + 1 + 1 + 7 + 3  # CRC delimiter, acknowledge slot and delimiter, end of frame, intermission


class Log:
    """One CAN log: of its data frames `time_s`, `identifier`, `data` (frames, 8) and `length`; `error_frames`."""

    def __init__(self, path):
        rows, self.error_frames = [], 0
        with path.open(encoding="ascii") as file:
            for line in file:
                seconds, micros, identifier, data = LINE.fullmatch(line).groups()
                if len(identifier) == 8:
                    assert identifier == "20000080", f"neither a standard frame nor an error frame: {line}"
                    self.error_frames += 1
                    continue
                rows.append((int(seconds) * 1_000_000 + int(micros), int(identifier, 16), bytes.fromhex(data)))
        self.time_us = np.array([row[0] for row in rows], dtype=np.int64)
        self.time_s = self.time_us * 1e-6
        self.identifier = np.array([row[1] for row in rows])
        self.length = np.array([len(row[2]) for row in rows])
        self.data = np.array([list(row[2].ljust(8, b"\0")) for row in rows], dtype=np.int64)

    def words(self, identifier):
        """(time_s, value word, stamp word) of the frames with this identifier."""
        at = self.identifier == identifier
        weights = 1 << np.arange(0, 32, 8)
        return self.time_s[at], self.data[at, :4] @ weights, self.data[at, 4:] @ weights

    def bits(self):
        """Bits of each frame on the wire, stuff bits and intermission included."""
        count = len(self.identifier)
        total = np.zeros(count, dtype=np.int64)
        for length in np.unique(self.length):
            at = np.flatnonzero(self.length == length)
            total[at] = frame_bits(self.identifier[at], self.data[at, :length])
        return total


def frame_bits(identifier, data):
    """Bits of data frames of one length: `identifier` (frames,), `data` (frames, length)."""
    count, length = data.shape
    columns = [np.zeros(count, dtype=np.int64)]  # start of frame
    columns += [identifier >> (10 - i) & 1 for i in range(11)]
    columns += [np.zeros(count, dtype=np.int64)] * 3  # RTR, IDE, r0
    columns += [np.full(count, length >> (3 - i) & 1) for i in range(4)]
    columns += [data[:, byte] >> (7 - i) & 1 for byte in range(length) for i in range(8)]
    rest = np.zeros(count, dtype=np.int64)
    for column in columns:
        out = rest >> 14 & 1 ^ column
        rest = (rest << 1 & 0x7FFF) ^ out * CRC_POLYNOMIAL
    columns += [rest >> (14 - i) & 1 for i in range(15)]
    stuff, run, last = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64), np.full(count, -1)
    for column in columns:
        run = np.where(column == last, run + 1, 1)
        full = run == 5
        stuff += full
        last, run = np.where(full, 1 - column, column), np.where(full, 1, run)
    return len(columns) + stuff + AFTER_CRC


class Variables:
    """The MDF file: `time_s` and values of a channel by name."""

    def __init__(self, path):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # asammdf's dependencies announce their own deprecations on import
            from asammdf import MDF

            with MDF(path) as file:
                names = [name for name in file.channels_db if name != "time"]
                signals = file.select(names)
        self.channels = {each.name: (each.timestamps, each.samples) for each in signals}

    def __getitem__(self, name):
        """Values of a sample of the body."""
        return self.channels[f"plant.{name}"][1]

    @property
    def time_s(self):
        """Times of the samples of the body."""
        return self.channels["plant.mode"][0]

    def variable(self, name):
        """(time_s, values) of a variable of the robot's table, at its changes."""
        return self.channels[name]
