"""Buffers of edges and bytes that a sensor fills and a chip empties."""

from ranger_sim.foundation.edge_buffer import ByteBuffer, EdgeBuffer


def test_a_new_buffer_has_no_edge_of_which_none_is_taken():
    buffer = EdgeBuffer(2)
    assert (buffer.count, buffer.read) == (0, 0)


def test_edges_keep_their_time_and_both_levels_while_the_buffer_grows():
    buffer = EdgeBuffer(2)
    edges = [(10, 1, 0), (11, 0, 0), (1 << 60, 1, 1), (3, 0, 1), (5, 1, 0)]
    for edge in edges:
        buffer.push(*edge)
    assert [buffer.edge(place) for place in range(buffer.count)] == edges
    buffer.read = 4
    buffer.clear()
    assert (buffer.count, buffer.read) == (0, 0)


def test_bytes_keep_their_times_and_values_while_the_buffer_grows():
    buffer = ByteBuffer(2)
    for time, value in ((70, 0), (80, 255), (90, 7), (1 << 61, 128), (100, 1)):
        buffer.push(time, value)
    assert list(buffer.times[: buffer.count]) == [70, 80, 90, 1 << 61, 100]
    assert list(buffer.values[: buffer.count]) == [0, 255, 7, 128, 1]
    buffer.clear()
    buffer.push(110, 3)
    assert (buffer.count, buffer.times[0], buffer.values[0]) == (1, 110, 3)
