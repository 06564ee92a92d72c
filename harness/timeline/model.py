"""The event model of a timeline: tracks of slices, counters and instants, and the flows that connect slices.

Every format is written from this, and the picture in docs/timeline.md is drawn from it. Times are whole ns since the
run began.
"""

import dataclasses

import numpy as np


def no_numbers() -> np.ndarray:
    """An empty column."""
    return np.zeros(0, dtype=np.int64)


@dataclasses.dataclass
class Slices:
    """What happens on one track: slice i lasts from start_ns[i] to end_ns[i] and is called names[name[i]].

    path: the names of the groups above it and its own. In order of their starts; none begins before the last one's
    end. `inside`: slices that lie within these, one level down. `notes`: more numbers of each slice, by name with
    unit. `labels`: texts by name, one for each of `names`.
    """

    path: tuple[str, ...]
    names: list[str]
    start_ns: np.ndarray
    end_ns: np.ndarray
    name: np.ndarray
    notes: dict[str, np.ndarray] = dataclasses.field(default_factory=dict)
    labels: dict[str, list[str]] = dataclasses.field(default_factory=dict)
    inside: "Slices | None" = None
    # flow flow_id[j] passes slice flow_at[j], and ends there where flow_ends[j]
    flow_at: np.ndarray = dataclasses.field(default_factory=no_numbers)
    flow_id: np.ndarray = dataclasses.field(default_factory=no_numbers)
    flow_ends: np.ndarray = dataclasses.field(default_factory=no_numbers)

    def __len__(self) -> int:
        return len(self.start_ns)

    def starts_of(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """(indices, starts) of the slices of one name; empty for an unused name."""
        if name not in self.names:
            return no_numbers(), no_numbers()
        at = np.flatnonzero(self.name == self.names.index(name))
        return at, self.start_ns[at]


@dataclasses.dataclass
class Counter:
    """A number over time: it is values[i] from time_ns[i] on. unit: "" without one."""

    path: tuple[str, ...]
    unit: str
    time_ns: np.ndarray
    values: np.ndarray
    description: str = ""


@dataclasses.dataclass
class Instant:
    """An event at one moment; `notes`: more about it, texts and numbers."""

    time_ns: int
    name: str
    notes: dict[str, str | float] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass
class Instants:
    """A track of instants, in order of time."""

    path: tuple[str, ...]
    events: list[Instant]


@dataclasses.dataclass
class Events:
    """A whole timeline. Tracks are in the order in which a reader wants to see them; `name` is the root of them all."""

    begin_ns: int
    end_ns: int
    slices: list[Slices] = dataclasses.field(default_factory=list)
    counters: list[Counter] = dataclasses.field(default_factory=list)
    instants: list[Instants] = dataclasses.field(default_factory=list)
    name: str = "Ranger"
    # {board: {pin: (time_ns, level)}} of the pins that boards drove
    pins: dict[str, dict[str, tuple[np.ndarray, np.ndarray]]] = dataclasses.field(default_factory=dict)

    def track(self, *path: str) -> Slices:
        """The slices of this path. KeyError for an unknown path."""
        for slices in self.slices:
            if slices.path == path:
                return slices
        raise KeyError(path)

    def counter(self, *path: str) -> Counter:
        """The counter of this path. KeyError for an unknown path."""
        for counter in self.counters:
            if counter.path == path:
                return counter
        raise KeyError(path)


def changes(time_ns: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Only the rows in which the value changes: the first one, and each that differs from the one before."""
    if len(values) == 0:
        return time_ns, values
    new = np.empty(len(values), dtype=bool)
    new[0] = True
    np.not_equal(values[1:], values[:-1], out=new[1:])
    return time_ns[new], values[new]


def runs(time_ns: np.ndarray, values: np.ndarray, end_ns: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(start_ns, end_ns, value) of the stretches in which a sampled value stays the same; the last ends at `end_ns`."""
    start, value = changes(time_ns, values)
    end = np.append(start[1:], end_ns) if len(start) else start
    return start, end, value
