"""Packets laid out by hand: against protobuf's own encoding, and the order of nested slices."""

import struct

import numpy as np
import pytest

from ranger_sim.harness.timeline.packing import (
    INNER_BEGINS,
    INNER_ENDS,
    OUTER_BEGINS,
    OUTER_ENDS,
    PacketPacker,
    index_packets,
    nested,
    varint,
)

perfetto_trace_pb2 = pytest.importorskip("perfetto.protos.perfetto.trace.perfetto_trace_pb2")


def column(*values):
    return np.array(values, dtype=np.int64)


def packed(time, value, flow):
    """A counter's packet with one flow, laid out by a PacketPacker and parsed by the schema."""
    packet = perfetto_trace_pb2.TracePacket(trusted_packet_sequence_id=1)
    packet.track_event.track_uuid = 300
    packet.track_event.double_counter_value = 1.25
    packet.track_event.flow_ids.append(77)
    text = packet.SerializeToString()
    out = bytearray()
    packer = PacketPacker(out.extend)
    holes = [text.index(struct.pack("<d", 1.25)), text.index(struct.pack("<q", 77))]
    kind = packer.template(text, holes)
    bits = struct.unpack("<q", struct.pack("<d", value))[0]
    packer.put(column(time), column(kind), column(0, bits, flow), column(1))
    packer.flush()
    return bytes(out), perfetto_trace_pb2.Trace.FromString(bytes(out)).packet


@pytest.mark.parametrize("time", [0, 1, 127, 128, 16_383, 16_384, 2**31, 2**32 * 1_000_000])
@pytest.mark.parametrize("value", [0.0, -1.5, 1e300])
def test_a_template_with_its_numbers_filled_in_is_the_packet_that_protobuf_would_have_made(time, value):
    [packet] = packed(time, value, 2**62 + 5)[1]
    assert packet.timestamp == time and packet.trusted_packet_sequence_id == 1
    assert packet.track_event.track_uuid == 300 and packet.track_event.double_counter_value == value
    assert list(packet.track_event.flow_ids) == [2**62 + 5]


def test_a_negative_number_keeps_its_sign_in_eight_bytes():
    [packet] = packed(5, -0.0, 1)[1]
    assert struct.pack("<d", packet.track_event.double_counter_value) == struct.pack("<d", -0.0)


def test_more_packets_than_the_buffer_holds_come_out_in_order():
    out = bytearray()
    packer = PacketPacker(out.extend, flush_bytes=64)
    kind = packer.template(perfetto_trace_pb2.TracePacket(trusted_packet_sequence_id=9).SerializeToString(), [])
    times = np.arange(1000, dtype=np.int64) * 12_345
    packer.put(times, np.full(1000, kind), column(), np.zeros(1000, dtype=np.int64))
    packer.flush()
    assert [packet.timestamp for packet in perfetto_trace_pb2.Trace.FromString(bytes(out)).packet] == times.tolist()


def test_a_template_longer_than_127_bytes_has_a_length_of_two():
    packet = perfetto_trace_pb2.TracePacket()
    packet.track_event.name = "x" * 200
    out = bytearray()
    packer = PacketPacker(out.extend)
    packer.put(column(3), column(packer.template(packet.SerializeToString(), [])), column(), column(0))
    packer.flush()
    [read] = perfetto_trace_pb2.Trace.FromString(bytes(out)).packet
    assert read.track_event.name == "x" * 200 and read.timestamp == 3


@pytest.mark.parametrize(
    ("number", "expected"), [(0, b"\0"), (1, b"\1"), (127, b"\x7f"), (128, b"\x80\1"), (300, b"\xac\2")]
)
def test_a_number_of_variable_length_is_as_protobufs_documentation_has_it(number, expected):
    assert varint(number) == expected


def order_of(outer, inner):
    order = np.zeros(2 * (len(outer) + len(inner)), dtype=np.int64)
    columns = [column(*(pair[end] for pair in pairs)) for pairs in (outer, inner) for end in (0, 1)]
    count = nested(*columns, order)
    assert count == len(order)
    letters = {OUTER_BEGINS: "(", OUTER_ENDS: ")", INNER_BEGINS: "[", INNER_ENDS: "]"}
    return " ".join(f"{letters[code & 3]}{code >> 2}" for code in order.tolist())


def test_inner_slices_are_within_their_outer_ones():
    outer, inner = [(0, 10), (10, 20)], [(1, 3), (3, 10), (10, 10), (12, 13)]
    # the inner one without a length, at the instant at which both outer ones meet, belongs to the first
    assert order_of(outer, inner) == "(0 [0 ]0 [1 ]1 [2 ]2 )0 (1 [3 ]3 )1"


def test_inner_slices_without_an_outer_one_are_on_their_own():
    assert order_of([(5, 6)], [(0, 1), (7, 8)]) == "[0 ]0 (0 )0 [1 ]1"
    assert order_of([], [(0, 1)]) == "[0 ]0"
    assert order_of([(0, 1)], []) == "(0 )0"


def test_packets_are_found_without_parsing_them():
    trace = perfetto_trace_pb2.Trace()
    trace.packet.add(timestamp=7).track_event.name = "a"
    trace.packet.add().track_descriptor.name = "b" * 300
    trace.packet.add(timestamp=2**40, trusted_packet_sequence_id=3)
    data = trace.SerializeToString()
    rows = np.zeros(15, dtype=np.int64)
    assert index_packets(data, rows) == 3
    rows = rows.reshape(5, 3)
    assert rows[:3, 2].tolist() == [7, -1, 2**40]
    parts = [perfetto_trace_pb2.TracePacket.FromString(data[begin:end]) for begin, end, _ in rows[:3]]
    assert parts == list(trace.packet)
    assert index_packets(data, np.zeros(3, dtype=np.int64)) == 3  # more than there is room for


@pytest.mark.parametrize(
    "data", [b"\x0b\x01\x00", b"\x0a\x05\x40", b"\x0a\x02\x40\x80", b"not a trace at all", b"\x0a"]
)
def test_a_file_that_is_not_a_row_of_packets_is_reported(data):
    assert index_packets(data, np.zeros(15, dtype=np.int64)) == -1
