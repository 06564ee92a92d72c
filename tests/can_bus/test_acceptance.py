"""Acceptance filters on a bus: what a refused frame costs, from when a filter acts, and who has a frame."""

import array

import pytest

from ranger_sim.can_bus.acceptance import MOST_EXTENDED_RANGES, Acceptance, packed
from ranger_sim.foundation.events import FLAG_EXTENDED, FLAG_REMOTE
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import UserError
from tests.can_bus.wiring import Wired, edge


def filtered(wired, node, time=0, **identifiers):
    wired.bus.set_filter(node, packed("n", **identifiers), time)
    return wired


@pytest.mark.parametrize("seed", range(4))
def test_a_filter_accepts_what_is_in_its_ranges_and_nothing_else(seed):
    draw = RandomStream(seed, "acceptance")
    found = {"standard": [], "extended": []}
    for kind, highest in (("standard", 0x7FF), ("extended", 0x1FFFFFFF)):
        for _ in range(draw.integer(40)):
            first = draw.integer(highest + 1)
            last = min(highest, first + draw.integer(1 + highest // 64))
            found[kind].append(first if draw.integer(3) == 0 else (first, last))
    acceptance = Acceptance(packed("n", **found))
    for kind, flags, highest in (("standard", 8, 0x7FF), ("extended", 8 | FLAG_EXTENDED, 0x1FFFFFFF)):
        pairs = [each if isinstance(each, tuple) else (each, each) for each in found[kind]]
        edges = [end + step for pair in pairs for end in pair for step in (-1, 0, 1)]
        for identifier in [*edges, *(draw.integer(highest + 1) for _ in range(2000)), 0, highest]:
            if 0 <= identifier <= highest:
                expected = any(first <= identifier <= last for first, last in pairs)
                assert acceptance.accepts(identifier, flags) == expected, hex(identifier)
                assert acceptance.accepts(identifier, flags | FLAG_REMOTE) == expected


def test_a_refused_frame_is_acknowledged_counted_and_reaches_no_inbox():
    wired = filtered(Wired(3), 1, standard=[0x10, (0x20, 0x2F)])
    for time, identifier in ((1_000, 0x10), (200_000, 0x11), (400_000, 0x2A), (600_000, 0x30)):
        wired.send(0, identifier, time)
        wired.bus.advance(time + 150_000)
    assert [row[1] for row in wired.of(1, "rx")] == [0x10, 0x2A]
    assert [row[1] for row in wired.of(2, "rx")] == [0x10, 0x11, 0x2A, 0x30]
    assert (wired.bus.nodes[1].received, wired.bus.nodes[1].filtered) == (2, 2)
    assert (wired.bus.counters.frames, wired.bus.counters.lost, wired.bus.counters.errors) == (4, 0, 0)


def test_identifiers_of_11_and_29_bits_are_not_confused():
    wired = filtered(Wired(2), 1, standard=[0x123], extended=[(0x1000, 0x1FFF)])
    for place, (identifier, flags) in enumerate(((0x123, 0), (0x123, FLAG_EXTENDED), (0x1200, FLAG_EXTENDED))):
        wired.send(0, identifier, 1_000 + 200_000 * place, buffer=place + 1, flags=8 | flags)
    wired.bus.advance(1_000_000)
    assert [row[1:3] for row in wired.of(1, "rx")] == [(0x123, 8), (0x1200, 8 | FLAG_EXTENDED)]


def test_a_frame_that_every_filter_refuses_is_not_lost():
    wired = filtered(Wired(2), 1)
    wired.send(0, 0x10, 1_000)
    wired.bus.advance(1_000_000)
    assert wired.of(1, "rx") == []
    assert [row[2] for row in wired.of(0, "done")] == [0]  # sent
    assert wired.bus.counters.lost == 0


def test_a_filter_acts_on_frames_that_start_after_it_and_its_end_on_those_after_that():
    wired = Wired(2)
    wired.send(0, 0x10, 0)  # starts at bit 1
    filtered(wired, 1, time=edge(2), standard=[0x20])
    wired.bus.set_filter(1, None, 500_000)
    wired.send(0, 0x11, 300_000, buffer=2)
    wired.send(0, 0x12, 600_000, buffer=3)
    wired.bus.advance(1_000_000)
    assert [row[1] for row in wired.of(1, "rx")] == [0x10, 0x12]


def test_a_frame_that_is_simulated_bit_by_bit_passes_the_same_filter():
    wired = filtered(Wired(3), 1, standard=[0x20])
    wired.bus.inject_errors(1)
    wired.send(0, 0x10, 1_000)
    wired.send(0, 0x20, 1_000, buffer=2)
    wired.bus.advance(1_000_000)
    assert wired.bus.counters.errors == 1
    assert [row[1] for row in wired.of(1, "rx")] == [0x20]
    assert [row[1] for row in wired.of(2, "rx")] == [0x10, 0x20]
    assert wired.bus.nodes[1].filtered == 1


@pytest.mark.parametrize(
    ("identifiers", "reported"),
    [
        ({"standard": [0x800]}, "B1: 0x800 to 0x800 is not a range of 11-bit identifiers, 0 to 0x7ff"),
        ({"standard": [(5, 4)]}, "B1: 0x5 to 0x4 is not a range of 11-bit identifiers"),
        ({"extended": [-1]}, "B1: -0x1 to -0x1 is not a range of 29-bit identifiers, 0 to 0x1fffffff"),
        ({"extended": range(0, 448, 2)}, "B1: 224 ranges of 29-bit identifiers, at most 223 fit"),
    ],
)
def test_identifiers_that_do_not_exist_are_refused(identifiers, reported):
    with pytest.raises(UserError) as mistake:
        packed("B1", **identifiers)
    assert reported in str(mistake.value)


def test_ranges_that_touch_are_one():
    assert len(packed("B1", extended=range(5000))) == 256 + 8
    assert len(packed("B1", extended=range(0, 2 * MOST_EXTENDED_RANGES, 2))) == 256 + 8 * MOST_EXTENDED_RANGES


@pytest.mark.parametrize("seed", range(20))
def test_bytes_of_any_kind_are_a_filter(seed):
    draw = RandomStream(seed, "bytes of a filter")
    data = bytes(draw.integer(256) for _ in range(draw.integer(2041)))
    acceptance = Acceptance(data)
    for _ in range(500):
        identifier = draw.integer(2**29)
        assert acceptance.accepts(identifier, FLAG_EXTENDED) in (False, True)
        low = identifier & 0x7FF
        assert acceptance.accepts(low, 0) == (low >> 3 < len(data) and data[low >> 3] >> (low & 7) & 1)


def test_words_of_a_filter_are_read_in_this_computers_order():
    data = bytes(256) + array.array("I", [0x100, 0x1FF]).tobytes()
    assert packed("B1", extended=[(0x100, 0x1FF)]) == data
