"""Writes a timeline as a Perfetto trace, for https://ui.perfetto.dev and trace_processor.

Every packet is made by the `perfetto` package's own classes: rare kinds directly, frequent kinds as a template whose
numbers `packing.py` fills in. A track's packets are in the order of their
effect; tracks follow one another, and readers sort them by time. The same timeline gives the same bytes.
"""

import importlib
import itertools
import struct
import zlib
from typing import IO, Any

import numpy as np

from ranger_sim.harness.timeline.model import Counter, Events, Instants, Slices
from ranger_sim.harness.timeline.packing import INNER_BEGINS, INNER_ENDS, OUTER_BEGINS, OUTER_ENDS, PacketPacker, nested

SCHEMA = "perfetto.protos.perfetto.trace.perfetto_trace_pb2"
SEQUENCE = 1  # all packets are of one sequence, so all use one table of names
CHUNK_ROWS = 200_000  # slices that are laid out at once: some 50 MB of arrays
LEVEL = 1  # of zlib: a sixth of the size; the next levels cost two times as much processor for 3 % less


def library() -> Any:
    """The schema's classes."""
    return importlib.import_module(SCHEMA)


def write(events: Events, file: IO[bytes], title: str) -> None:
    """Write the whole timeline into `file`; `title` describes the run and is the root of the tracks."""
    Writer(library(), file).write(events, title)


class Writer:
    """Writes one trace into a file. Tracks and names are numbered in order of appearance."""

    def __init__(self, schema: Any, file: IO[bytes]) -> None:
        self.schema = schema
        self.file = file
        self.packer = PacketPacker(self._write_compressed)
        self.names: dict[str, int] = {}
        self.note_names: dict[str, int] = {}
        self.groups: dict[tuple[str, ...], int] = {}
        self.last_track = 0
        self.ranks = itertools.count(1)

    def write(self, events: Events, title: str) -> None:
        """Write descriptors and names first, then slices, counters and instants."""
        self._number_names(events)
        self._write_names()
        self.groups[()] = self._describe((events.name,), 0, description=title)
        for instants in events.instants:
            self._write_instants(instants)
        for slices in events.slices:
            self._write_slices(slices)
        for counter in events.counters:
            self._write_counter(counter)
        self.packer.flush()

    # --- names and tracks -----------------------------------------------------------------------------------

    def _number_names(self, events: Events) -> None:
        for track in events.slices:
            level: Slices | None = track
            while level is not None:
                for name in level.names:
                    self.names.setdefault(name, len(self.names) + 1)
                for note in (*level.notes, *level.labels):
                    self.note_names.setdefault(note, len(self.note_names) + 1)
                level = level.inside

    def _packet(self) -> Any:
        packet = self.schema.TracePacket()
        packet.trusted_packet_sequence_id = SEQUENCE
        packet.sequence_flags = self.schema.TracePacket.SEQ_NEEDS_INCREMENTAL_STATE
        return packet

    def _write_packet(self, packet: Any) -> None:
        trace = self.schema.Trace()
        trace.packet.append(packet)
        self.file.write(trace.SerializeToString())

    def _write_compressed(self, packets: bytes) -> None:
        """Write many packets as one, which readers of this format inflate."""
        packet = self.schema.TracePacket()
        packet.compressed_packets = zlib.compress(packets, LEVEL)
        self._write_packet(packet)

    def _write_names(self) -> None:
        packet = self._packet()
        packet.sequence_flags = self.schema.TracePacket.SEQ_INCREMENTAL_STATE_CLEARED
        for name, number in self.names.items():
            packet.interned_data.event_names.add(iid=number, name=name)
        for name, number in self.note_names.items():
            packet.interned_data.debug_annotation_names.add(iid=number, name=name)
        self._write_packet(packet)

    def _describe(self, path: tuple[str, ...], parent: int, unit: str | None = None, description: str = "") -> int:
        """Write a track's descriptor; unit: of a counter. Returns its number."""
        self.last_track += 1
        packet = self._packet()
        track = packet.track_descriptor
        track.uuid = self.last_track
        track.name = path[-1]
        if parent:
            track.parent_uuid = parent
            track.sibling_order_rank = next(self.ranks)
        track.child_ordering = self.schema.TrackDescriptor.EXPLICIT
        if description:
            track.description = description
        if unit is not None:
            track.counter.unit_name = unit
        self._write_packet(packet)
        return self.last_track

    def _track(self, path: tuple[str, ...], unit: str | None = None, description: str = "") -> int:
        """Number of a new track; the groups above it are described before."""
        for length in range(1, len(path)):
            group = path[:length]
            if group not in self.groups:
                self.groups[group] = self._describe(group, self.groups[group[:-1]])
        return self._describe(path, self.groups[path[:-1]], unit, description)

    # --- templates ------------------------------------------------------------------------------------------

    def _template(self, packet: Any, hole_count: int) -> int:
        """Make a template of a packet in which the numbers to fill in are `mark(0)`, `mark(1)` ..."""
        text = packet.SerializeToString()
        return self.packer.template(text, [text.index(mark(hole)) for hole in range(hole_count)])

    def _begin(self, track: int, slices: Slices, name: int, flows: int, flow_ends: int) -> int:
        """Template of a slice's begin: its notes, then `flows` flows that continue, then `flow_ends` that end."""
        packet = self._packet()
        event = packet.track_event
        event.type = self.schema.TrackEvent.TYPE_SLICE_BEGIN
        event.track_uuid = track
        event.name_iid = self.names[slices.names[name]]
        marks = itertools.count()
        for note in slices.notes:
            event.debug_annotations.add(name_iid=self.note_names[note], double_value=as_double(mark(next(marks))))
        for label, texts in slices.labels.items():
            if texts[name]:
                event.debug_annotations.add(name_iid=self.note_names[label], string_value=texts[name])
        for _ in range(flows):
            event.flow_ids.append(as_number(mark(next(marks))))
        for _ in range(flow_ends):
            event.terminating_flow_ids.append(as_number(mark(next(marks))))
        return self._template(packet, next(marks))

    def _end(self, track: int) -> int:
        packet = self._packet()
        packet.track_event.type = self.schema.TrackEvent.TYPE_SLICE_END
        packet.track_event.track_uuid = track
        return self._template(packet, 0)

    # --- slices ---------------------------------------------------------------------------------------------

    def _write_slices(self, slices: Slices) -> None:
        track = self._track(slices.path)
        ends = self._end(track)
        kinds, firsts, values = self._begins(track, slices)
        inside = slices.inside
        if inside is None:
            time = np.stack([slices.start_ns, slices.end_ns], axis=1).reshape(-1)
            kind = np.stack([kinds, np.full_like(kinds, ends)], axis=1).reshape(-1)
            first = np.stack([firsts, np.zeros_like(firsts)], axis=1).reshape(-1)
            self._put(time, kind, values, first)
            return
        inner_kinds, inner_firsts, inner_values = self._begins(track, inside)
        order = np.empty(2 * (len(slices) + len(inside)), dtype=np.int64)
        outer, inner = (
            (column(slices.start_ns), column(slices.end_ns)),
            (column(inside.start_ns), column(inside.end_ns)),
        )
        count = nested(*outer, *inner, column(order))
        assert count == len(order)
        row, what = order >> 2, order & 3
        all_values = np.concatenate([values, inner_values])
        for begin in range(0, count, CHUNK_ROWS):
            part = slice(begin, begin + CHUNK_ROWS)
            time = np.empty(len(row[part]), dtype=np.int64)
            kind = np.full(len(time), ends, dtype=np.int64)
            first = np.zeros(len(time), dtype=np.int64)
            for code, source in (
                (OUTER_BEGINS, slices.start_ns),
                (OUTER_ENDS, slices.end_ns),
                (INNER_BEGINS, inside.start_ns),
                (INNER_ENDS, inside.end_ns),
            ):
                chosen = what[part] == code
                time[chosen] = source[row[part][chosen]]
            chosen = what[part] == OUTER_BEGINS
            kind[chosen], first[chosen] = kinds[row[part][chosen]], firsts[row[part][chosen]]
            chosen = what[part] == INNER_BEGINS
            kind[chosen] = inner_kinds[row[part][chosen]]
            first[chosen] = inner_firsts[row[part][chosen]] + len(values)
            self._put(time, kind, all_values, first)

    def _begins(self, track: int, slices: Slices) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(template, first of its numbers, all numbers) of each slice's begin."""
        count, notes = len(slices), len(slices.notes)
        plain = np.array([self._begin(track, slices, name, 0, 0) for name in range(len(slices.names))], dtype=np.int64)
        kinds = plain[slices.name] if count else slices.name
        going = np.bincount(slices.flow_at[slices.flow_ends == 0], minlength=count)
        ending = np.bincount(slices.flow_at[slices.flow_ends != 0], minlength=count)
        sizes = notes + going + ending
        firsts = np.cumsum(sizes) - sizes
        values = np.zeros(int(sizes.sum()), dtype=np.int64)
        for place, note in enumerate(slices.notes.values()):
            values[firsts + place] = np.ascontiguousarray(note, dtype=np.float64).view(np.int64)
        order = np.lexsort((slices.flow_id, slices.flow_ends, slices.flow_at))
        at = slices.flow_at[order]
        place = firsts[at] + notes + (np.arange(len(at)) - np.searchsorted(at, at))
        values[place] = slices.flow_id[order]
        rows = np.flatnonzero(going + ending)
        _, first, kind = np.unique(
            slices.name[rows] << 40 | going[rows] << 20 | ending[rows], return_index=True, return_inverse=True
        )
        with_flows = [
            self._begin(track, slices, int(slices.name[row]), int(going[row]), int(ending[row])) for row in rows[first]
        ]
        kinds[rows] = np.array(with_flows, dtype=np.int64)[kind.reshape(-1)]
        return kinds, firsts, values

    def _put(self, time: np.ndarray, kind: np.ndarray, values: np.ndarray, first: np.ndarray) -> None:
        self.packer.put(column(time), column(kind), column(values), column(first))

    # --- counters and instants ------------------------------------------------------------------------------

    def _write_counter(self, counter: Counter) -> None:
        track = self._track(counter.path, counter.unit, counter.description)
        packet = self._packet()
        packet.track_event.type = self.schema.TrackEvent.TYPE_COUNTER
        packet.track_event.track_uuid = track
        packet.track_event.double_counter_value = as_double(mark(0))
        kind = self._template(packet, 1)
        values = np.ascontiguousarray(counter.values, dtype=np.float64).view(np.int64)
        rows = np.arange(len(values), dtype=np.int64)
        self._put(counter.time_ns, np.full_like(rows, kind), values, rows)

    def _write_instants(self, instants: Instants) -> None:
        track = self._track(instants.path)
        for instant in instants.events:
            packet = self._packet()
            packet.timestamp = instant.time_ns
            event = packet.track_event
            event.type = self.schema.TrackEvent.TYPE_INSTANT
            event.track_uuid = track
            event.name = instant.name
            for name, value in instant.notes.items():
                note = event.debug_annotations.add(name=name)
                if isinstance(value, str):
                    note.string_value = value
                else:
                    note.double_value = value
            self._write_packet(packet)


def mark(hole: int) -> bytes:
    """Eight bytes that mark number `hole` in a template; a finite double that occurs nowhere else."""
    return struct.pack("<HHHH", 0xA51F, hole, 0xC3E7, 0x2B5D)


def as_double(eight_bytes: bytes) -> float:
    """Eight bytes as a double."""
    [value] = struct.unpack("<d", eight_bytes)
    return float(value)


def as_number(eight_bytes: bytes) -> int:
    """Eight bytes as a whole number."""
    return int.from_bytes(eight_bytes, "little")


def column(values: np.ndarray) -> Any:
    """As compiled loops take it: contiguous 64-bit integers; the array itself where it already is."""
    return np.ascontiguousarray(values, dtype=np.int64)
