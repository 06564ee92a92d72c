"""Reads a Perfetto trace of track events back, through the schema of the `perfetto` package."""

import dataclasses
import importlib
import pathlib
import zlib
from collections.abc import Iterator
from typing import Any

import numpy as np

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.timeline.packing import index_packets
from ranger_sim.harness.timeline.perfetto_file import library

INSTANT_TYPE = b"\x48\x03"  # field 9 of a TrackEvent, its type: an instant
COMPRESSED = b"\x92\x03"  # field 50 of a TracePacket: many packets, deflated
INFLATED_BYTES = 1 << 26  # of one of them; the writer has a megabyte
PACKETS_AT_ONCE = 1 << 22  # length of the packet index, 100 MB; a longer trace is indexed again


@dataclasses.dataclass
class ReadSlice:
    """A slice as the trace has it; `depth` 0 is the outermost. end_ns -1: it never ends."""

    start_ns: int
    end_ns: int
    name: str
    depth: int
    notes: dict[str, str | float]
    flows: list[int]
    flow_ends: list[int]


@dataclasses.dataclass
class ReadTrack:
    """A track with its contents. Counters: time_ns and values; instants are slices without a length."""

    number: int
    name: str
    parent: int
    rank: int
    unit: str | None
    description: str
    slices: list[ReadSlice] = dataclasses.field(default_factory=list)
    instants: list[ReadSlice] = dataclasses.field(default_factory=list)
    time_ns: list[int] = dataclasses.field(default_factory=list)
    values: list[float] = dataclasses.field(default_factory=list)


@dataclasses.dataclass
class ReadTrace:
    """Tracks by number, in the order of the file; begin_ns and end_ns: of everything with a time in the file."""

    tracks: dict[int, ReadTrack]
    begin_ns: int
    end_ns: int

    def path(self, track: ReadTrack) -> tuple[str, ...]:
        """Names from below the root to the track."""
        names: list[str] = []
        while track.parent:
            names.insert(0, track.name)
            track = self.tracks[track.parent]
        return tuple(names)

    def find(self, *path: str) -> ReadTrack:
        """The track of this path. KeyError when it is missing."""
        for track in self.tracks.values():
            if self.path(track) == path:
                return track
        raise KeyError(path)


def read(path: pathlib.Path, begin_ns: int | None = None, end_ns: int | None = None) -> ReadTrace:
    """The trace, or its part from begin_ns to end_ns. UserError for a file that is not such a trace.

    A slice with only one end in that time gets its other end at the edge.
    """
    schema = library()
    data = contents(path)
    index = index_of(path, data)
    timed = index[index[:, 2] >= 0, 2]
    first, last = (int(timed.min()), int(timed.max())) if len(timed) else (0, 0)
    chosen = index[:, 2] < 0
    inside = ~chosen
    if begin_ns is not None:
        inside &= index[:, 2] >= begin_ns
    if end_ns is not None:
        inside &= index[:, 2] <= end_ns
    reader = Reader(schema, begin_ns if begin_ns is not None else first)
    for start, end, _ in index[chosen | inside].tolist():
        take(path, reader, schema, data[start:end])
    reader.close(end_ns if end_ns is not None else last)
    return ReadTrace(reader.tracks, first, last)


def read_instants(path: pathlib.Path) -> tuple[int, int, dict[str, list[ReadSlice]]]:
    """(begin and end of the trace in ns, instants by the path of their track); slices and counters are skipped."""
    schema = library()
    data = contents(path)
    index = index_of(path, data)
    timed = index[index[:, 2] >= 0]
    begin, end = (int(timed[:, 2].min()), int(timed[:, 2].max())) if len(timed) else (0, 0)
    reader = Reader(schema, begin)
    for start, stop, time in index.tolist():
        if time < 0 or INSTANT_TYPE in data[start:stop]:
            take(path, reader, schema, data[start:stop])
    trace = ReadTrace(reader.tracks, begin, end)
    instants = {" ".join(trace.path(track)): track.instants for track in trace.tracks.values() if track.instants}
    return begin, end, instants


def take(path: pathlib.Path, reader: "Reader", schema: Any, packet: bytes) -> None:
    """Pass one packet of the file to the reader. UserError for what `Writer` would not have written."""
    decode_error = importlib.import_module("google.protobuf.message").DecodeError
    try:
        reader.take(schema.TracePacket.FromString(packet))
    except (KeyError, decode_error):
        raise UserError(
            f"trace {path}: is a Perfetto trace, but none that ranger-sim wrote, or it is damaged"
        ) from None


def contents(path: pathlib.Path) -> bytes:
    """The file's packets, inflated. UserError for a file that is not such a trace."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UserError(f"trace {path}: cannot be read: {error.strerror}") from None
    schema, parts = library(), []
    index, text = index_of(path, data), np.frombuffer(data, dtype=np.uint8)
    first, second = (text[np.minimum(index[:, 0] + place, len(text) - 1)] for place in (0, 1))
    plain = 0  # byte from which packets are taken as they are
    for row in np.flatnonzero((first == COMPRESSED[0]) & (second == COMPRESSED[1])).tolist():
        begin, end = index[row, :2].tolist()
        parts.append(data[plain : index[row - 1, 1] if row else 0])
        plain = end
        inflate = zlib.decompressobj()
        try:
            packets = schema.TracePacket.FromString(data[begin:end]).compressed_packets
            parts.append(inflate.decompress(packets, INFLATED_BYTES))
        except zlib.error as error:
            raise UserError(f"trace {path}: damaged at byte {begin}: {error}") from None
        if not inflate.eof:
            raise UserError(f"trace {path}: damaged at byte {begin}: packets end early or exceed 64 MiB")
    return b"".join([*parts, data[plain:]])


def index_of(path: pathlib.Path, data: Any) -> np.ndarray:
    """(begin, end, time stamp or -1) of every packet."""
    room = min(PACKETS_AT_ONCE, len(data) // 2 + 1)
    index: Any = np.empty(3 * room, dtype=np.int64)
    count = index_packets(data, index)
    if count > room:
        index = np.empty(3 * count, dtype=np.int64)
        count = index_packets(data, index)
    if count <= 0:
        raise UserError(f"trace {path}: not a Perfetto trace")
    return index[: 3 * count].reshape(-1, 3)


class Reader:
    """Sorts packets, one after another, into tracks."""

    def __init__(self, schema: Any, begin_ns: int) -> None:
        self.event = schema.TrackEvent
        self.begin_ns = begin_ns
        self.tracks: dict[int, ReadTrack] = {}
        self.open: dict[int, list[ReadSlice]] = {}
        self.names: dict[int, str] = {}
        self.note_names: dict[int, str] = {}

    def take(self, packet: Any) -> None:
        """Take one packet."""
        for each in packet.interned_data.event_names:
            self.names[each.iid] = each.name
        for each in packet.interned_data.debug_annotation_names:
            self.note_names[each.iid] = each.name
        if packet.HasField("track_descriptor"):
            track = packet.track_descriptor
            unit = track.counter.unit_name if track.HasField("counter") else None
            self.tracks[track.uuid] = ReadTrack(
                track.uuid, track.name, track.parent_uuid, track.sibling_order_rank, unit, track.description
            )
        elif packet.HasField("track_event"):
            self._event(packet.timestamp, packet.track_event)

    def _event(self, time_ns: int, event: Any) -> None:
        track = self.tracks[event.track_uuid]
        if event.type == self.event.TYPE_COUNTER:
            track.time_ns.append(time_ns)
            track.values.append(event.double_counter_value)
            return
        stack = self.open.setdefault(event.track_uuid, [])
        if event.type == self.event.TYPE_SLICE_END:
            if stack:
                stack.pop().end_ns = time_ns
            else:  # it began before the time that is read
                track.slices.append(ReadSlice(self.begin_ns, time_ns, "...", 0, {}, [], []))
            return
        name = self.names[event.name_iid] if event.name_iid else event.name
        notes = dict(self._notes(event))
        found = ReadSlice(time_ns, -1, name, len(stack), notes, list(event.flow_ids), list(event.terminating_flow_ids))
        if event.type == self.event.TYPE_INSTANT:
            found.end_ns = time_ns
            track.instants.append(found)
        else:
            track.slices.append(found)
            stack.append(found)

    def _notes(self, event: Any) -> Iterator[tuple[str, str | float]]:
        for note in event.debug_annotations:
            name = self.note_names[note.name_iid] if note.name_iid else note.name
            yield name, note.string_value if note.HasField("string_value") else note.double_value

    def close(self, end_ns: int) -> None:
        """End what is still open at `end_ns`."""
        for stack in self.open.values():
            for each in stack:
                each.end_ns = end_ns
