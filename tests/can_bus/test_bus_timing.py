"""When frames start and end, who goes first, and what the load comes to."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.frame import frame_bits
from ranger_sim.foundation.events import (
    FLAG_EXTENDED,
    FLAG_REMOTE,
    FLAG_SINGLE_SHOT,
    NEVER,
    TX_ABORTED,
    TX_LOST,
    TX_SENT,
)

from .wiring import RATE, Wired, edge

SECOND = 10**9


def test_a_frame_on_an_idle_bus_starts_at_the_next_bit_edge_and_ends_after_its_bits():
    wired = Wired(2)
    assert wired.send(0, 0x123, time=1000, lo=1, hi=2)
    bits = frame_bits(0x123, 8, 1, 2)
    # 1000 ns is the edge of bit 3 exactly: the frame starts with bit 4
    assert wired.bus.next_time == edge(4) == 1334
    assert wired.bus.advance(1333) == 1334
    assert wired.bus.counters.frames == 0
    assert wired.bus.advance(1334) == NEVER
    assert wired.of(1, "rx") == [(edge(4 + bits - 1), 0x123, 8, 1, 2)]
    assert wired.of(0, "done") == [(edge(4 + bits), 1, TX_SENT)]


def test_frames_back_to_back_leave_exactly_the_intermission_between_them():
    wired = Wired(2)
    for buffer in (1, 2, 3):
        wired.send(0, buffer, buffer=buffer)
    wired.bus.advance(SECOND)
    bit = 1
    for identifier, (time, *_) in zip((1, 2, 3), wired.of(1, "rx"), strict=True):
        bit += frame_bits(identifier, 8, 0, 0)
        assert time == edge(bit - 1)
        bit += 3


def test_three_megabit_does_not_drift_in_a_day():
    wired = Wired(2)
    day = 86_400 * SECOND
    wired.send(0, 0x55, time=day)
    wired.bus.advance(day + 50_000)
    assert wired.of(0, "done") == [(edge(86_400 * RATE + 1 + frame_bits(0x55, 8, 0, 0)), 1, TX_SENT)]


@given(st.sampled_from([10_000, 33_333, 125_000, 1_000_000, 3_000_000, 6_000_000]), st.integers(0, 2**52))
def test_times_and_bits_convert_as_whole_number_arithmetic_says(bitrate, number):
    bus = Bus("can1", bitrate)
    assert bus.bit_of(number) == number * bitrate // SECOND
    bit = number % (2**40)
    assert bus.edge_ns(bit) == edge(bit, bitrate)
    assert bus.bit_of(bus.edge_ns(bit)) == bit
    if bit:
        assert bus.bit_of(bus.edge_ns(bit) - 1) == bit - 1


def test_the_lower_identifier_wins_and_the_loser_goes_next():
    wired = Wired(3)
    wired.send(0, 0x200, lo=20)
    wired.send(1, 0x100, lo=10)
    wired.bus.advance(SECOND)
    assert [frame[1] for frame in wired.of(2, "rx")] == [0x100, 0x200]
    assert wired.bus.counters.arbitrations_lost == 1
    assert wired.bus.nodes[0].arbitrations_lost == 1


def test_a_frame_under_way_is_not_pre_empted():
    wired = Wired(3)
    wired.send(0, 0x700)
    wired.send(1, 0x001, time=400)  # the bus was taken at 334 ns
    wired.bus.advance(SECOND)
    assert [frame[1] for frame in wired.of(2, "rx")] == [0x700, 0x001]


def test_a_request_at_the_very_time_of_a_start_comes_too_late():
    for late, order in ((0, [0x001, 0x700]), (1, [0x700, 0x001])):
        wired = Wired(3)
        wired.send(0, 0x700, time=1000)  # starts at 1334
        wired.send(1, 0x001, time=1333 + late)
        wired.bus.advance(SECOND)
        assert [frame[1] for frame in wired.of(2, "rx")] == order


def test_a_node_offers_its_lowest_identifier_first_and_equal_ones_by_buffer():
    wired = Wired(2)
    wired.send(0, 0x30, buffer=1, lo=1)
    wired.send(0, 0x10, buffer=3, lo=3)
    wired.send(0, 0x10, buffer=2, lo=2)
    wired.bus.advance(SECOND)
    assert [(frame[1], frame[3]) for frame in wired.of(1, "rx")] == [(0x10, 2), (0x10, 3), (0x30, 1)]
    assert wired.bus.counters.arbitrations_lost == 0  # within one controller nothing is lost on the bus


def test_standard_beats_extended_and_data_beats_remote():
    wired = Wired(5)
    wired.send(0, 0x100 << 18, flags=8 | FLAG_EXTENDED)
    wired.send(1, 0x100, flags=8 | FLAG_REMOTE)
    wired.send(2, 0x100, flags=8)
    wired.send(3, (0x100 << 18) - 1, flags=FLAG_EXTENDED)
    wired.bus.advance(SECOND)
    kinds = [(frame[1], frame[2]) for frame in wired.of(4, "rx")]
    assert kinds == [
        ((0x100 << 18) - 1, FLAG_EXTENDED),
        (0x100, 8),
        (0x100, 8 | FLAG_REMOTE),
        (0x100 << 18, 8 | FLAG_EXTENDED),
    ]


def test_bytes_that_are_not_sent_do_not_arrive():
    wired = Wired(2)
    wired.send(0, 1, flags=5, lo=0x11223344, hi=0x55667788, buffer=1)
    wired.send(0, 2, flags=2, lo=0x11223344, hi=0x55667788, buffer=2)
    wired.send(0, 3, flags=4 | FLAG_REMOTE, lo=0x11223344, buffer=3)
    wired.bus.advance(SECOND)
    assert [frame[2:] for frame in wired.of(1, "rx")] == [
        (5, 0x11223344, 0x88),
        (2, 0x3344, 0),
        (4 | FLAG_REMOTE, 0, 0),
    ]


# ---- buffers, aborts, single shot ------------------------------------------------------------------------


def test_a_request_into_an_occupied_buffer_is_refused_counted_and_harmless():
    wired = Wired(2)
    assert wired.send(0, 0x10, lo=1)
    assert not wired.send(0, 0x11, lo=2)
    wired.bus.advance(10_000)  # under way
    assert not wired.send(0, 0x12, time=20_000)
    done = wired.of(0, "done")[0][0]
    assert not wired.send(0, 0x13, time=done - 1)
    assert wired.send(0, 0x14, time=done)
    wired.bus.advance(SECOND)
    assert [frame[1] for frame in wired.of(1, "rx")] == [0x10, 0x14]
    assert wired.bus.counters.refused == wired.bus.nodes[0].refused == 3
    assert wired.bus.accepted == 2


def test_misuse_is_refused_with_the_thing_and_the_limit():
    wired = Wired(2)
    with pytest.raises(ValueError, match="node 2 does not exist"):
        wired.send(2, 1)
    with pytest.raises(ValueError, match="buffer 4"):
        wired.send(0, 1, buffer=4)
    with pytest.raises(ValueError, match="2048 does not fit in 11 bits"):
        wired.send(0, 2048)
    with pytest.raises(ValueError, match="does not fit in 29 bits"):
        wired.send(0, 1 << 29, flags=FLAG_EXTENDED)
    with pytest.raises(ValueError, match="0x88"):
        wired.send(0, 1, flags=0x88)
    with pytest.raises(ValueError, match="mode 7"):
        wired.bus.set_mode(0, 7, 0)
    with pytest.raises(ValueError, match="bit rate 5"):
        Bus("can1", 5)
    with pytest.raises(ValueError, match="node -1"):
        wired.bus.abort(-1, 1, 0)
    assert wired.bus.accepted == 0


def test_an_abort_takes_back_what_waits_but_not_what_is_under_way():
    wired = Wired(3)
    wired.send(0, 0x10)
    wired.send(1, 0x20)
    wired.bus.advance(1000)
    wired.bus.abort(0, 1, 2000)
    wired.bus.abort(1, 1, 2000)
    wired.bus.advance(SECOND)
    assert [frame[1] for frame in wired.of(2, "rx")] == [0x10]
    assert wired.of(0, "done")[0][2] == TX_SENT
    assert wired.of(1, "done") == [(2000, 1, TX_ABORTED)]
    assert wired.bus.counters.aborted == 1 and wired.bus.counters.lost == 0


@pytest.mark.parametrize("buffer", [1, 2, 3])
def test_each_of_the_three_buffers_can_be_taken_back_and_no_other_number_is_one(buffer):
    wired = Wired(2)
    wired.send(0, 0x10)
    wired.send(1, 0x20, buffer=buffer)
    wired.bus.advance(1000)
    for taken_back in (0, 4, buffer):
        wired.bus.abort(1, taken_back, 2000)
    wired.bus.advance(SECOND)
    assert wired.of(1, "done") == [(2000, buffer, TX_ABORTED)] and wired.bus.counters.aborted == 1


def test_an_abort_in_the_future_lets_a_frame_go_that_starts_before_it():
    wired = Wired(3)
    wired.send(0, 0x10)
    wired.send(1, 0x20)
    wired.send(2, 0x30)
    wired.bus.abort(1, 1, 30_000)  # 0x20 could start at about 38 us
    wired.bus.abort(2, 1, 60_000)  # 0x30 starts at about 38 us then
    wired.bus.advance(SECOND)
    assert [status for *_, status in wired.of(1, "done")] == [TX_ABORTED]
    assert [status for *_, status in wired.of(2, "done")] == [TX_SENT]


def test_a_single_shot_waits_for_the_bus_but_is_gone_when_it_loses():
    wired = Wired(3)
    wired.send(0, 0x50)
    wired.send(1, 0x40, time=1000, flags=8 | FLAG_SINGLE_SHOT)  # wins the second arbitration
    wired.send(2, 0x41, time=1000, flags=8 | FLAG_SINGLE_SHOT)  # loses it
    wired.bus.advance(SECOND)
    assert [frame[1:3] for frame in wired.of(0, "rx")] == [(0x40, 8)]
    assert wired.of(1, "done")[0][2] == TX_SENT
    start = 1 + frame_bits(0x50, 8, 0, 0) + 3
    # they differ in the last identifier bit; 00000 s 1 00000 s 0|1: 12 bits and two stuff bits
    assert wired.of(2, "done") == [(edge(start + 14), 1, TX_LOST)]
    assert wired.bus.counters.single_shot_skipped == wired.bus.nodes[2].single_shot_skipped == 1
    assert wired.bus.counters.lost == 0


def test_a_single_shot_behind_a_lower_frame_of_its_own_node_has_not_been_tried():
    wired = Wired(2)
    wired.send(0, 0x10, buffer=1)
    wired.send(0, 0x20, buffer=3, flags=8 | FLAG_SINGLE_SHOT)
    wired.bus.advance(SECOND)
    assert [frame[1] for frame in wired.of(1, "rx")] == [0x10, 0x20]
    assert wired.bus.counters.single_shot_skipped == 0


def test_a_single_shot_into_an_occupied_buffer_counts_as_skipped():
    wired = Wired(2)
    wired.send(0, 0, buffer=3, flags=8 | FLAG_SINGLE_SHOT)
    assert not wired.send(0, 0, buffer=3, flags=8 | FLAG_SINGLE_SHOT)
    assert wired.bus.counters.single_shot_skipped == 1


# ---- statistics ------------------------------------------------------------------------------------------


def test_load_counts_stuff_bits_and_intermission_as_mean_and_over_10_ms_windows():
    wired = Wired(2)
    bits = frame_bits(0, 8, 0, 0) + 3
    for ms in range(1, 11):  # one frame per ms in the first window only
        wired.send(0, 0, time=ms * 990_000)
        wired.bus.advance(ms * 990_000 + 500_000)
    wired.bus.advance(20_000_000)
    assert wired.bus.load.bits == 10 * bits
    assert wired.bus.load_mean(20_000_000) == 10 * bits / 60_000
    assert wired.bus.load.largest() == 10 * bits / 30_000
    assert wired.bus.counters.frames == 10 and wired.bus.counters.lost == 0
    assert wired.bus.counters.frames_by_identifier[0] == 10


def test_a_frame_across_the_border_of_a_window_is_split_and_idle_windows_are_empty():
    wired = Wired(2)
    wired.send(0, 0, time=9_990_000)
    wired.bus.advance(9_999_000)
    wired.send(0, 0, time=45_000_000)
    wired.bus.advance(50_000_000)
    bits = frame_bits(0, 8, 0, 0) + 3
    first = 30_000 - (9_990_000 * 3 // 1000 + 1)
    assert wired.bus.load.windows() == [first / 30_000, (bits - first) / 30_000, 0.0, 0.0]
    assert wired.bus.load.largest() == max(first, bits - first, bits) / 30_000


def test_a_day_without_frames_leaves_a_ring_of_idle_windows():
    wired = Wired(2)
    day = 86_400 * SECOND
    wired.send(0, 0, time=0)
    wired.bus.advance(1000)
    wired.send(0, 0, time=day + 20_000_000)
    wired.bus.advance(day + 21_000_000)
    bits = frame_bits(0, 8, 0, 0) + 3
    assert wired.bus.load.count == 86_400 * 100 + 2
    assert wired.bus.load.windows() == [0.0] * 1024
    assert wired.bus.load.window_busy == bits and wired.bus.load.largest() == bits / 30_000


def test_a_full_bus_has_load_one():
    wired = Wired(2)
    time = 0
    wired.send(0, 5, time=0, buffer=1)
    for _ in range(1000):
        for buffer in (1, 2, 3):
            wired.send(0, 5 + buffer, time=time, buffer=buffer)
        time += 25_000
        wired.bus.advance(time)
    assert wired.bus.load_mean(time) == pytest.approx(1.0, abs=1e-4)  # the first bit is idle
    assert wired.bus.load.largest() == 1.0


def test_frames_without_a_receiver_are_lost_but_acknowledged():
    wired = Wired(2)
    wired.bus.nodes[1].listening = False
    wired.send(0, 7)
    wired.bus.advance(SECOND)
    assert wired.of(0, "done")[0][2] == TX_SENT
    assert wired.messages(1) == []
    assert wired.bus.counters.lost == 1 and wired.bus.counters.errors == 0


def test_statistics_may_start_at_any_uptime():
    wired = Wired(2)
    start = 31 * 3600 * SECOND
    wired.bus.reset_statistics(start)
    wired.send(0, 7, time=start)
    wired.bus.advance(start + 10_000_000)
    assert wired.bus.load_mean(start + 10_000_000) == (frame_bits(7, 8, 0, 0) + 3) / 30_000
    assert wired.bus.load_mean(start) == 0.0


def test_the_longest_response_is_from_request_to_end_of_frame():
    wired = Wired(2)
    wired.send(0, 1, buffer=1)
    wired.send(0, 2, buffer=2)
    wired.bus.advance(SECOND)
    end = 1 + frame_bits(1, 8, 0, 0) + 3 + frame_bits(2, 8, 0, 0)
    assert wired.bus.counters.response_max_ns[2] == edge(end)


def test_two_nodes_that_send_the_very_same_frame_both_succeed():
    wired = Wired(3)
    wired.send(0, 9, lo=4)
    wired.send(1, 9, lo=4)
    wired.bus.advance(SECOND)
    assert [status for *_, status in wired.of(0, "done")] == [TX_SENT]
    assert wired.messages(1)[0][0] == "done"
    assert len(wired.of(2, "rx")) == 1
    assert wired.bus.counters.frames == 1 and wired.bus.counters.merged == 1


# ---- log -------------------------------------------------------------------------------------------------


def test_the_log_holds_every_frame_in_order_with_its_sender():
    wired = Wired(3)
    wired.send(1, 0x20, lo=5, hi=6)
    wired.send(2, 0x10, flags=3, lo=0xAABBCCDD)
    wired.bus.advance(SECOND)
    first = edge(1 + frame_bits(0x10, 3, 0xBBCCDD, 0) - 1)
    log = wired.log()
    assert log[0] == (first, 0x10, 3, 0xBBCCDD, 0, 2)
    assert log[1][1:] == (0x20, 8, 5, 6, 1)
    assert wired.log() == []


def test_a_full_log_counts_what_it_drops():
    inbox = Wired(1).inboxes[0]
    bus = Bus("can1", RATE, 0, 2)
    bus.add_node("a", inbox, 1, 0)
    bus.add_node("b", inbox, 1, 0)
    for buffer in (1, 2, 3):
        bus.request(0, buffer, 0, buffer, 8, 0, 0)
    bus.advance(SECOND)
    assert ([frame[1] for frame in bus.log.take()], bus.log.dropped) == ([1, 2], 1)
    bus.request(0, 1, SECOND, 7, 8, 0, 0)
    bus.advance(2 * SECOND)
    assert ([frame[1] for frame in bus.log.take()], bus.log.dropped) == ([7], 1)
