"""The load of a bus from its frames: against lengths counted by hand, and against the meter of the bus itself."""

import numpy as np
import pytest

from ranger_sim import Ranger, Scenario
from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.frame import frame_bits
from ranger_sim.foundation.events import FLAG_BRS, FLAG_ERROR, FLAG_EXTENDED, FLAG_FD, FLAG_REMOTE, EventQueue
from ranger_sim.foundation.row_stream import FrameStream
from ranger_sim.tools.panel.inside.load import Load

BIT_PER_S = 1_000_000  # a bit is a microsecond, a window 10,000 bits
NO_STUFF = (0x2AA, 8, 0xAAAAAAAA, 0xAAAAAAAA)  # bits that alternate; its length is 108 and what the CRC is stuffed by
START_NS = 7_000_000_000


def rows_of(*frames):
    """Rows as a bus's record has them, of (first bit, identifier, flags, lo, hi) at 1 Mbit/s."""
    stream = FrameStream(0)
    blocks = []
    stream.sink = lambda _, block: blocks.append(block)
    for first, identifier, flags, lo, hi in frames:
        end = first + frame_bits(identifier, flags, lo, hi) - 1  # a bit before the last
        stream.add(START_NS + 1000 * end, identifier, flags, lo, hi)
    stream.flush()
    return np.frombuffer(b"".join(blocks), np.int64).reshape(-1, 3)


def shares_of(load, *frames):
    times, shares = load.take(rows_of(*frames))
    return dict(zip(np.round(times, 6).tolist(), shares.tolist(), strict=True))


@pytest.fixture
def load():
    return Load(BIT_PER_S, START_NS)


def test_a_frame_takes_its_bits_and_the_pause_behind_it(load):
    bits = frame_bits(*NO_STUFF) + 3
    found = shares_of(load, (9_000, *NO_STUFF), (15_000, *NO_STUFF), (25_000, *NO_STUFF), (45_000, *NO_STUFF))
    expected = {0.02: bits / 10_000, 0.03: bits / 10_000, 0.04: 0.0}
    assert found == pytest.approx(expected, abs=1e-7)  # single precision; a bit is 1e-4


def test_a_frame_across_two_windows_is_parted_between_them(load):
    bits = frame_bits(*NO_STUFF) + 3
    found = shares_of(load, (5_000, *NO_STUFF), (19_990, *NO_STUFF), (35_000, *NO_STUFF))
    assert found[0.02] == pytest.approx(10 / 10_000, abs=1e-7)
    assert found[0.03] == pytest.approx((bits - 10) / 10_000, abs=1e-7)


@pytest.mark.parametrize("flags", [0, 3, 8, FLAG_EXTENDED | 8, FLAG_REMOTE | 8])
def test_frames_of_every_form_are_as_long_as_on_the_bus(load, flags):
    each = (0x123, flags, 0xFF00FF00, 0)
    found = shares_of(load, (0, *each), (15_000, *each), (35_000, *each))
    assert found[0.02] == pytest.approx((frame_bits(*each) + 3) / 10_000, abs=1e-7)


def test_how_the_frames_come_in_pieces_changes_nothing(load):
    frames = [(100 + 977 * k, 0x100 + k % 50, 8, k * 2654435761 % 2**32, k) for k in range(200)]
    whole = shares_of(load, *frames)
    pieces = Load(BIT_PER_S, START_NS)
    found = {}
    for first in range(0, 200, 7):
        found |= shares_of(pieces, *frames[first : first + 7])
    assert found == whole and len(whole) == 18


def test_a_silent_bus_is_an_empty_one_and_not_an_unknown_one(load):
    bits = frame_bits(*NO_STUFF) + 3
    shares_of(load, (9_000, *NO_STUFF), (15_000, *NO_STUFF))
    times, shares = load.passed(START_NS + 45_000_000)
    assert times.tolist() == pytest.approx([0.02, 0.03, 0.04])
    assert shares.tolist() == pytest.approx([bits / 10_000, 0.0, 0.0], abs=1e-7)
    assert len(load.passed(START_NS + 49_000_000)[0]) == 0


def test_windows_in_which_frames_were_missed_are_left_out(load):
    found = shares_of(load, (9_000, *NO_STUFF), (15_000, *NO_STUFF), (25_000, *NO_STUFF))
    load.gap()
    found |= shares_of(load, (55_000, *NO_STUFF), (65_000, *NO_STUFF), (75_000, *NO_STUFF))
    assert sorted(found) == [0.02, 0.07]


def test_an_error_frame_takes_its_flag_its_delimiter_and_what_it_broke(load):
    stream = FrameStream(0)
    blocks = []
    stream.sink = lambda _, block: blocks.append(block)
    stream.add(START_NS + 5_000_000, 0x123, 8, 0, 0)
    stream.add(START_NS + 15_000_000, 0x123, FLAG_ERROR | 8, 10, 39)  # in the 40th bit
    stream.add(START_NS + 35_000_000, 0x123, 8, 0, 0)
    stream.flush()
    times, shares = load.take(np.frombuffer(b"".join(blocks), np.int64).reshape(-1, 3))
    assert times[0] == pytest.approx(0.02) and shares[0] == pytest.approx((40 + 14 + 3) / 10_000, abs=1e-7)


def test_the_load_of_a_robots_buses_is_that_of_their_own_meters():
    """To the bit, in every window of half a second; a bit of a window of 30,000 is 3e-5."""
    robot = Ranger(Scenario(seed=4), log="full")
    robot.run_for(0.52)
    for number, bus in enumerate(robot.buses):
        chosen = np.concatenate(list(robot.logbook.kept(f"can{number + 1}")))
        times, shares = Load(bus.bitrate, robot.start_ns).take(chosen)
        meter = bus.load.windows()
        numbers = np.rint(times / 0.01).astype(int) - 1
        assert len(numbers) >= 49 and max(shares) > 0.05
        np.testing.assert_allclose(shares, np.array(meter)[numbers], atol=1e-7)
    robot.close()


def test_the_load_of_a_can_fd_bus_with_both_kinds_of_frames_is_that_of_its_own_meter():
    bus = Bus("can1", 500_000, data_bitrate=2_000_000)
    stream = FrameStream(0)
    blocks = []
    stream.sink = lambda _, block: blocks.append(block)
    bus.log.stream = stream
    for name in ("a", "b"):
        bus.add_node(name, EventQueue(512), 1, 256)
    for number in range(70):
        time, length = number * 1_300_000, (0, 8, 13, 15)[number % 4]  # codes: 0, 8, 32 and 64 bytes
        flags = FLAG_FD | (FLAG_BRS if number % 3 else 0) | length
        bus.request_fd(0, 1, time, 0x100, flags, bytes(range((0, 8, 32, 64)[number % 4])))
        bus.request(1, 1, time, 0x200, 8, number, number)
        bus.advance(time + 1_200_000)
    bus.advance(100_000_000)
    stream.flush()
    load = Load(500_000, 0, 2_000_000)
    times, shares = load.take(np.frombuffer(b"".join(blocks), np.int64).reshape(-1, 3))
    numbers = np.rint(times / 0.01).astype(int) - 1
    assert len(numbers) >= 8 and 0.3 < max(shares) < 0.9
    meter = np.array(bus.load.windows())[numbers]
    # a frame is on the bus from whole nominal bits after the one before: at most a bit in 5,000 differs at each edge
    np.testing.assert_allclose(shares, meter, atol=2 / 5_000)
