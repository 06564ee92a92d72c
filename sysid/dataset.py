"""Measured data: channels with their own unit and time stamps, findings about them, repairs of them.

    Channel   one quantity: stamps and values, each of shape (n,), in SI units
    Finding   something odd at a place in a channel, with its size; nothing is changed by finding it
    Repair    a change that was made to a channel, with its reason; nothing is changed without one
    Loss      samples that were read and are left out, with the reason: what was read is what is kept and all losses
    Dataset   the channels of one recording, by name
    Table     channels on one time base, cut where there is a gap: what fits and balances work on

A channel's name carries its unit as in the project's other boundaries: "hip_angle_rad", "current_A".
"""

import dataclasses
from collections.abc import Collection, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ranger_sim.foundation.user_error import DataError, printable, unknown
from ranger_sim.sysid.lattice import lattice_step

Array = NDArray[np.float64]
# Why samples are left out. Of the second kind nothing is lost: the same was there already, never was, or is not wanted.
LOSSES = {
    "ragged": "rows with too many or too few cells",
    "no_stamp": "rows without a stamp",
    "text": "values that have a text instead of a number (not available, error)",
    "not_finite": "values or stamps that are not numbers",
    "cut_off": "rows or frames that should be there: the file is cut off",
    "not_frames": "lines of frames that the reader passed over",
    "can_fd": "frames of CAN FD",
    "broken_frames": "frames that do not fit their message",
    "reversed_stamps": "stamps that go back and do not fit between the others either",
    "restarted_stamps": "stamps that begin again within the time of those before: several recordings in one file?",
    "duplicate_stamps": "stamps that come twice, with different values",
    "clipped": "values cut off at a limit",
    "bit_flip": "single values with a wrong bit",
}
CLIPPED = "clipped"  # of LOSSES
UNMEASURED = (CLIPPED, "not_finite", "text")  # losses of which the stamp is known: rows without a measurement
LACKING = 1.5  # median steps of a channel; one that is longer lacks a sample
NOTHING_LOST = {
    "repeated": "repeated samples, stamp and value",
    "never_written": "samples of a variable before it was written",
    "cut": "a time that is not wanted",
}


@dataclasses.dataclass(frozen=True)
class Loss:
    """Samples that are left out. reason: one of LOSSES or NOTHING_LOST; where: the first of them."""

    reason: str
    count: int
    where: str = ""

    @property
    def text(self) -> str:
        """In words."""
        meaning = LOSSES.get(self.reason) or NOTHING_LOST[self.reason]
        return f"{self.count} for {meaning}" + (f", the first {self.where}" if self.where else "")


@dataclasses.dataclass(frozen=True)
class Channel:
    """One measured quantity. time_s, value: shape (n,). resolution: of one count in the channel's unit, 0: unknown.

    losses: what was read of it and is left out. masked_s: (m,) stamps of the values that are left out because they are
    cut off at a limit: nothing is interpolated there. limits_are_true: values at a limit are the machine's, not the
    instrument's.
    """

    name: str
    unit: str
    time_s: Array
    value: Array
    resolution: float = 0.0
    source: str = ""
    losses: tuple[Loss, ...] = ()
    masked_s: Array = dataclasses.field(default_factory=lambda: np.empty(0))
    limits_are_true: bool = False

    def __post_init__(self) -> None:
        if self.time_s.shape != self.value.shape or self.time_s.ndim != 1:
            raise DataError(
                f"channel {self.name}: {self.time_s.shape} stamps and {self.value.shape} values, "
                "both must be one row of the same length"
            )

    def shown(self, value: float, digits: int = 6) -> str:
        """A value of it in so many digits, with its unit where it has one."""
        return f"{value:.{digits}g} {self.unit}".rstrip()

    @property
    def read(self) -> int:
        """Samples that were read of it: what is kept and what is left out."""
        return len(self.value) + sum(loss.count for loss in self.losses)

    @property
    def lost_share(self) -> float:
        """The lost part of what it had: 0 to 1."""
        lost = sum(loss.count for loss in self.losses if loss.reason in LOSSES)
        return lost / (len(self.value) + lost) if lost else 0.0

    def without(self, left_out: NDArray[np.bool_], reason: str) -> "Channel":
        """The channel without the samples of the mask (n,), which become a loss."""
        places = np.flatnonzero(left_out)
        if not len(places):
            return self
        first = float(self.time_s[places[0]])
        loss = Loss(reason, len(places), f"at {first:.6g} s" if np.isfinite(first) else "")
        kept = ~left_out
        losses = (*self.losses, loss)
        masked_s = np.concatenate((self.masked_s, self.time_s[places])) if reason == CLIPPED else self.masked_s
        return dataclasses.replace(
            self, time_s=self.time_s[kept], value=self.value[kept], losses=losses, masked_s=masked_s
        )


@dataclasses.dataclass(frozen=True)
class Finding:
    """Something odd. `kind`: one of sanity.KINDS; `size` in `unit`; `severity`: "note", "warning" or "fatal"."""

    channel: str
    kind: str
    start_s: float
    end_s: float
    size: float
    unit: str
    text: str
    severity: str = "warning"


@dataclasses.dataclass(frozen=True)
class Repair:
    """What was changed in a channel, and why.

    residual: how far the repaired samples are from what they should be, in `unit`; None where they are left out.
    option: that carries it out, where it is not carried out without a request.
    """

    channel: str
    kind: str
    count: int
    text: str
    residual: float | None = None
    unit: str = ""
    option: str = ""


@dataclasses.dataclass
class Table:
    """Channels on one time base. time_s, each column: shape (n,); `runs`: stretches without a gap, in order.

    unmeasured: by channel (n,), True where its value is a straight line over samples that it lacks.
    counts: by channel whose rows are on straight lines between its samples, the step of the samples' own values, in its
    unit, 0 where they have none: such rows show it no more.
    begin_s: start of the recording of which this is a part; None where it is the whole of it.
    """

    time_s: Array
    columns: dict[str, Array]
    runs: tuple[slice, ...]
    name: str = ""
    resolution: dict[str, float] = dataclasses.field(default_factory=dict)
    unmeasured: dict[str, NDArray[np.bool_]] = dataclasses.field(default_factory=dict)
    counts: dict[str, float] = dataclasses.field(default_factory=dict)
    begin_s: float | None = None

    def __getitem__(self, name: str) -> Array:
        return self.columns[name]

    def __contains__(self, name: str) -> bool:
        return name in self.columns

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def step_s(self) -> float:
        """Median distance of two samples."""
        return float(np.median(np.diff(self.time_s)))

    @property
    def elapsed_s(self) -> Array:
        """(n,) since the start of the recording, which may lie before the first row."""
        return np.asarray(self.time_s - (self.time_s[0] if self.begin_s is None else self.begin_s))

    def part(self, which: slice) -> "Table":
        """The rows of `which`, with the runs that lie in it."""
        start, stop, _ = which.indices(len(self))
        runs = (slice(max(run.start, start) - start, min(run.stop, stop) - start) for run in self.runs)
        return Table(
            self.time_s[which],
            {name: column[which] for name, column in self.columns.items()},
            tuple(run for run in runs if run.stop > run.start),
            self.name,
            self.resolution,
            {name: rows[which] for name, rows in self.unmeasured.items()},
            self.counts,
            float(self.time_s[0]) if self.begin_s is None else self.begin_s,
        )


@dataclasses.dataclass
class Dataset:
    """The channels of one recording, by name; what was found, and what was mended.

    rows, losses: lines or frames of the file, and those left out of which nothing says whose samples they were.
    lines: what became of every line of a text file: {"rows", "names", "comments" ...: number}.
    layout: how the file was read: its format, and what `--assume` takes. clock_is_given: the user says the unit of the
    stamps, or they are dates, so that their size shows no other one.
    """

    name: str
    channels: dict[str, Channel]
    findings: list[Finding] = dataclasses.field(default_factory=list)
    repairs: list[Repair] = dataclasses.field(default_factory=list)
    rows: int = 0
    losses: list[Loss] = dataclasses.field(default_factory=list)
    lines: dict[str, int] = dataclasses.field(default_factory=dict)
    layout: dict[str, Any] = dataclasses.field(default_factory=dict)
    clock_is_given: bool = False

    def __post_init__(self) -> None:
        self.name = printable(self.name)  # a file's name may have bytes that are not UTF-8

    def __getitem__(self, name: str) -> Channel:
        try:
            return self.channels[name]
        except KeyError:
            raise DataError(f"{self.name}: {unknown('channel', name, self.channels)}") from None

    def __contains__(self, name: str) -> bool:
        return name in self.channels

    def ledger(self) -> dict[str, dict[str, object]]:
        """What became of every sample: {channel: {"read", "kept", "left_out"}}; "" for lines of no channel."""
        accounts: dict[str, dict[str, object]] = {}
        if self.losses:
            kept = self.rows - sum(loss.count for loss in self.losses)
            accounts[""] = {
                "read": self.rows,
                "kept": kept,
                "left_out": [dataclasses.asdict(each) for each in self.losses],
            }
        for name, channel in self.channels.items():
            left_out = [dataclasses.asdict(each) for each in channel.losses]
            accounts[name] = {"read": channel.read, "kept": len(channel.value), "left_out": left_out}
        return accounts

    def table(self, names: Iterable[str], longest_gap: float = 5.0, outputs: Collection[str] = ()) -> Table:
        """These channels on the stamps of the densest of them, by straight lines, cut at gaps and at masked values.

        longest_gap: in median steps of a channel; what is farther apart is not bridged. outputs: channels that a
        simulator runs through: at samples that they lack the table goes on, with these rows in `unmeasured`.
        """
        chosen = [self[name] for name in names]
        if not chosen:
            raise DataError(f"{self.name}: no channel asked for")
        base = max(chosen, key=lambda channel: len(channel.time_s))
        if len(base.time_s) < 2:
            raise DataError(f"{self.name}: {base.name} has {len(base.time_s)} samples, at least 2 are needed")
        time_s = base.time_s
        inside = np.ones(len(time_s), dtype=bool)
        cuts = np.zeros(len(time_s), dtype=bool)  # a run ends before these
        columns, unmeasured, counts = {}, {}, {}
        for channel in chosen:
            columns[channel.name] = np.interp(time_s, channel.time_s, channel.value)
            if not np.array_equal(channel.time_s, time_s):
                counts[channel.name] = lattice_step(channel.value)
            steps = np.diff(channel.time_s)
            goes_on = channel.name in outputs and channel is not base
            limit = (LACKING if goes_on else longest_gap) * float(np.median(steps)) if len(steps) else 0.0
            lacking = np.zeros(len(time_s), dtype=bool)
            inside &= (time_s >= channel.time_s[0]) & (time_s <= channel.time_s[-1])
            bridged = steps <= limit
            masked = np.searchsorted(channel.time_s, channel.masked_s) - 1  # the true values are beyond the limit
            bridged[masked[(masked >= 0) & (masked < len(bridged))]] = False
            for number in np.flatnonzero(~bridged):
                low, high = channel.time_s[number], channel.time_s[number + 1]
                lacking |= (time_s > low) & (time_s < high)
                if not goes_on:
                    cuts[min(np.searchsorted(time_s, high), len(time_s) - 1)] = True
            if not goes_on:
                inside &= ~lacking
            elif np.any(lacking):
                unmeasured[channel.name] = lacking
        kept = np.flatnonzero(inside)
        if len(kept) < 2:
            raise DataError(f"{self.name}: {', '.join(columns)} have no time in common")
        begins = cuts[kept] | (np.diff(kept, prepend=-2) != 1)
        begins[0] = True
        starts = [int(number) for number in np.flatnonzero(begins)]
        ends = [*starts[1:], len(kept)]
        return Table(
            time_s[kept],
            {name: column[kept] for name, column in columns.items()},
            tuple(slice(start, end) for start, end in zip(starts, ends, strict=True)),
            self.name,
            {channel.name: channel.resolution for channel in chosen},
            {name: rows[kept] for name, rows in unmeasured.items()},
            counts,
        )
