"""The serial link between router and main brain: packing, checksum, rings and their errors."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ranger_sim.boards.modules.ssp_link import (
    MainBrainSspLink,
    RouterSspLink,
    checksum,
    corrupted_copy,
    empty_segment,
    finish,
)
from ranger_sim.datatable.generated import errors
from ranger_sim.firmware_sim.peripherals.ssp import SspSegment
from ranger_sim.foundation.events import FLAG_REMOTE
from ranger_sim.foundation.numbers import word_of_float

TICK = 200_000


@pytest.fixture
def said():
    return []


@pytest.fixture
def router(said):
    return RouterSspLink(said.append)


@pytest.fixture
def brain(said):
    return MainBrainSspLink(said.append, 2031, False)


def frames_of(brain):
    assert len(brain.parsed()) == brain.frames
    return brain.parsed()


def exchange(router, brain, now):
    """One whole exchange begun at `now`: what the wires carry both ways."""
    down = brain.next_segment()
    up = router.tick(now)
    router.receive(down)
    brain.receive(up)


def test_an_empty_segment_is_thirty_zeros_and_the_checksum_one():
    segment = empty_segment()
    assert list(segment.words) == [0] * 30 + [1]
    assert segment.used == 0


def test_a_frame_is_header_value_and_time_high_half_first(router):
    # identifier 14 (MCH_ANGLE), value 1.0 as a single is 0x3F800000, time 0x00010002
    router.push(14, 8, word_of_float(1.0), 0x00010002, 0)
    segment = router.next_segment(TICK)
    # 1 + 0x780E + 0x3F80 + 0 + 1 + 2 = 0xB792
    assert list(segment.words) == [0x780E, 0x3F80, 0x0000, 0x0001, 0x0002] + [0] * 25 + [0xB792]


def test_the_checksum_is_one_plus_the_sum_modulo_65536():
    segment = SspSegment()
    segment.words = [0xFFFF] * 30 + [0]
    finish(segment, 0)
    segment.used = 30
    segment.words = [0xFFFF] * 30 + [segment.words[30]]
    # 30 * 0xFFFF + 1 = 0x1DFFE3
    assert checksum(segment) == 0xFFE3


def test_six_frames_fill_a_segment_and_the_seventh_waits(router, brain):
    for i in range(7):
        router.push(10 + i, 8, i, 100 + i, 0)
    brain.receive(router.next_segment(TICK))
    brain.receive(router.next_segment(2 * TICK))
    assert brain.parse() == 2
    assert frames_of(brain) == [(10 + i, i, 100 + i) for i in range(7)]


def test_the_transmit_ring_holds_ninety_nine_frames_and_the_next_is_lost_whole(router, said):
    taken = [router.push(1, 8, i, i, 0) for i in range(101)]
    assert taken == [True] * 99 + [False] * 2
    assert router.half_words_waiting() == 495
    assert said == [errors.SSP_TX_BUF_OF] * 2
    assert router.transmit_lost == 2


def test_the_ring_wraps_without_loss(router, brain):
    sent = []
    got = []
    for i in range(400):
        frame = (i % 314, (i * 2654435761) & 0xFFFFFFFF, i)
        router.push(frame[0], 8, frame[1], frame[2], i * TICK)
        sent.append(frame)
        if i % 3 == 0:
            brain.receive(router.next_segment((i + 1) * TICK))
            brain.parse()
            got += frames_of(brain)
    brain.receive(router.next_segment(401 * TICK))
    brain.parse()
    got += frames_of(brain)
    while router.half_words_waiting():
        brain.receive(router.next_segment(500 * TICK))
        brain.parse()
        got += frames_of(brain)
    assert got == sent


def test_a_remote_header_ends_the_segment_for_the_main_brain(router, brain):
    router.push(20, 8, 1, 1, 0)
    router.push(21, 8 | FLAG_REMOTE, 2, 2, 0)
    router.push(22, 8, 3, 3, 0)
    brain.receive(router.next_segment(TICK))
    brain.parse()
    assert frames_of(brain) == [(20, 1, 1)]


def test_a_flipped_bit_fails_the_checksum_and_drops_the_segment(router, brain, said):
    router.push(14, 8, 5, 5, 0)
    brain.receive(corrupted_copy(router.next_segment(TICK), 2, 0x0100))
    brain.parse()
    assert brain.frames == 0
    assert said == [errors.MB_SSP_CHKSUM]


def test_also_an_empty_segment_is_checked_by_the_main_brain(brain, said):
    brain.receive(corrupted_copy(empty_segment(), 30, 0x0002))
    brain.receive(corrupted_copy(empty_segment(), 17, 0x0002))
    brain.parse()
    assert said == [errors.MB_SSP_CHKSUM] * 2


def test_an_identifier_above_the_last_is_out_of_range_and_only_its_frame_is_dropped(router, said):
    brain = MainBrainSspLink(said.append, 313, False)
    router.push(313, 8, 1, 1, 0)
    router.push(314, 8, 2, 2, 0)
    router.push(12, 8, 3, 3, 0)
    brain.receive(router.next_segment(TICK))
    brain.parse()
    assert frames_of(brain) == [(313, 1, 1), (12, 3, 3)]
    assert said == [errors.MB_SSP_ID_OOR]


def test_the_seventeenth_segment_unread_is_dropped_with_an_error(router, brain, said):
    for i in range(17):
        router.push(30, 8, i, i, i * TICK)
        brain.receive(router.next_segment((i + 1) * TICK))
    assert said == [errors.MB_SSP_RX_FULL]
    assert brain.parse() == 16
    assert [f[1] for f in frames_of(brain)] == list(range(16))


def test_segments_that_wait_at_the_main_brain_are_not_written_to(router, brain):
    for i in range(96):
        router.push(30, 8, i, i, 0)
        if i % 6 == 5:
            brain.receive(router.next_segment(TICK))
    for _ in range(2):  # one segment more in an exchange, then the ring full again
        while router.push(31, 8, 77, 77, 0):
            pass
        router.next_segment(TICK)
    while router.push(31, 8, 77, 77, 0):
        pass
    assert brain.parse() == 16
    assert frames_of(brain) == [(30, i, i) for i in range(96)]


def test_segments_that_wait_at_the_router_are_not_written_to(brain, router):
    for i in range(7):
        brain.send(5, i, 0)
        brain.flush()
        exchange(router, brain, i * TICK)
    router.tick(7 * TICK)
    for _ in range(2):  # one segment more in an exchange, then the queue full again
        while brain.send(6, 77, 0):
            pass
        brain.next_segment()
    while brain.send(6, 77, 0):
        pass
    got = []
    while router.take():
        got.append((router.rx_id, router.rx_word0))
    assert got == [(5, i) for i in range(7)]


def test_the_first_segment_after_the_start_is_junk(router, said):
    brain = MainBrainSspLink(said.append, 2031)
    for i in range(2):
        router.push(14, 8, i, i, i * TICK)
        brain.receive(router.next_segment((i + 1) * TICK))
    brain.parse()
    assert frames_of(brain) == [(14, 1, 1)]
    assert said == [errors.MB_SSP_CHKSUM]


def test_the_main_brain_packs_six_per_segment_and_pads_the_last(brain, router):
    for i in range(15):
        assert brain.send(200 + i, i, 1000 + i)
    assert brain.flush() == 3
    used = [brain.next_segment().used for _ in range(4)]
    assert used == [30, 30, 15, 0]


def test_the_main_brains_queue_takes_sixteen_segments(brain, said):
    taken = [brain.send(10, i, 0) for i in range(97)]
    assert taken == [True] * 96 + [False]
    assert said == [errors.MB_SSP_TX_FULL]
    assert brain.transmit_full == 1
    first = brain.next_segment()
    assert brain.send(10, 96, 0)
    brain.flush()
    # the queue took a new segment without touching the one that is being exchanged
    assert first.words[2] == 0 and first.words[27] == 5


def test_commands_arrive_at_the_router_in_order_one_per_call(brain, router):
    for i in range(8):
        brain.send(100 + i, 0x10000 + i, 7)
    brain.flush()
    now = 0
    got = []
    for _ in range(4):
        exchange(router, brain, now)
        now += TICK
        while router.take():
            got.append((router.rx_id, router.rx_flags, router.rx_word0, router.rx_word1))
    assert got == [(100 + i, 8, 0x10000 + i, 7) for i in range(8)]


def test_a_received_segment_can_be_read_only_after_the_next_tick(brain, router):
    brain.send(5, 1, 1)
    brain.flush()
    exchange(router, brain, 0)
    assert not router.has_segments()
    exchange(router, brain, TICK)
    assert router.has_segments()
    assert router.take() and router.rx_id == 5


def test_the_router_passes_over_a_segment_that_starts_with_zero_unchecked(router, brain, said):
    router.tick(0)
    router.receive(corrupted_copy(empty_segment(), 30, 0x0FF0))
    router.tick(TICK)
    assert not router.take()
    assert said == [errors.SSP_LOW_RATE]  # of the first tick


def test_the_router_drops_a_segment_with_a_bad_checksum(router, brain, said):
    brain.send(5, 1, 1)
    brain.flush()
    router.tick(0)
    router.receive(corrupted_copy(brain.next_segment(), 3, 1))
    router.tick(TICK)
    assert not router.take()
    assert said == [errors.SSP_LOW_RATE, errors.SSP_BAD_CHKSM]


def test_the_first_tick_finds_no_half_words_which_is_a_low_rate(router, said):
    router.tick(0)
    assert said == [errors.SSP_LOW_RATE] and router.low_rate == 1


def test_an_exchange_that_did_not_finish_in_its_period_is_a_low_rate(router, said):
    router.tick(0)
    router.tick(TICK)
    assert said == [errors.SSP_LOW_RATE] * 2


def test_eight_unread_segments_overwrite_the_newest(router, brain, said):
    for i in range(10):
        brain.send(5, i, 0)
        brain.flush()
        exchange(router, brain, i * TICK)
    router.tick(10 * TICK)
    assert said == [errors.SSP_LOW_RATE] + [errors.SSP_RX_BUF_OF] * 3
    got = []
    while router.take():
        got.append(router.rx_word0)
    assert got == [0, 1, 2, 3, 4, 5, 6]


def test_a_frame_half_pushed_at_the_tick_waits_for_the_next_segment(router, brain):
    router.push(14, 8, 1, 1, 0)
    router.push(15, 8, 2, 2, TICK - 500)  # two of its five half-words are in the ring at the tick
    brain.receive(router.next_segment(TICK))
    brain.parse()
    assert frames_of(brain) == [(14, 1, 1)]
    brain.receive(router.next_segment(2 * TICK))
    brain.parse()
    assert frames_of(brain) == [(15, 2, 2)]


def test_with_the_quirk_a_half_pushed_frame_is_cut_and_misaligns_what_follows(said):
    router = RouterSspLink(said.append, True)
    brain = MainBrainSspLink(said.append, 2031, False)
    router.push(14, 8, 1, 1, 0)
    router.push(15, 8, 0x20003, 4, TICK - 500)
    segment = router.next_segment(TICK)
    assert segment.used == 7
    assert list(segment.words[5:8]) == [0x7800 | 15, 2, 0]
    router.push(16, 8, 5, 5, TICK + 1000)
    brain.receive(segment)
    brain.receive(router.next_segment(2 * TICK))
    brain.parse()
    # the cut frame lost its lower half, the next segment does not begin with a header and is lost
    assert frames_of(brain) == [(14, 1, 1), (15, 0x20000, 0)]
    # the ring ran empty, so the following frame is aligned again
    router.push(17, 8, 6, 6, 2 * TICK + 1000)
    brain.receive(router.next_segment(3 * TICK))
    brain.parse()
    assert frames_of(brain) == [(17, 6, 6)]


frame = st.tuples(st.integers(0, 2031), st.integers(0, 2**32 - 1), st.integers(0, 2**32 - 1))


@given(st.lists(frame, max_size=90))
def test_every_frame_pushed_comes_out_once_in_order(frames):
    said = []
    router = RouterSspLink(said.append)
    brain = MainBrainSspLink(said.append, 2031, False)
    got = []
    for f in frames:
        router.push(f[0], 8, f[1], f[2], 0)
    now = TICK
    while router.half_words_waiting():
        brain.receive(router.next_segment(now))
        brain.parse()
        got += frames_of(brain)
        now += TICK
    assert got == frames
    assert said == []


@given(st.lists(st.integers(0, 0xFFFF), min_size=31, max_size=31), st.integers(0, 31))
def test_no_segment_whatever_it_holds_upsets_either_parser(words, used):
    segment = SspSegment()
    segment.words = words
    segment.used = min(used, 30)
    finish(segment, segment.used)  # half of them with a right checksum
    said = []
    brain = MainBrainSspLink(said.append, 313, False)
    brain.receive(segment)
    brain.parse()
    assert 0 <= brain.frames <= 6
    router = RouterSspLink(said.append)
    router.tick(0)
    router.receive(segment)
    router.tick(TICK)
    n = 0
    while router.take():
        n += 1
    assert n <= 6
    # both resynchronise: the next good segment is read whole
    router.push(77, 8, 1, 2, TICK)
    brain.receive(router.next_segment(2 * TICK))
    brain.parse()
    assert frames_of(brain) == [(77, 1, 2)]
