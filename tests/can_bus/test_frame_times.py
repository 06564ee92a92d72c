"""When each frame was asked for, began and ended, as a bus reports it; and that reporting changes nothing."""

import array

import pytest

from ranger_sim.can_bus.frame import FIELD_DATA, frame_bits
from ranger_sim.can_bus.frame_log import SENDER_SHIFT, TIMES_BUFFER_SHIFT, TIMES_COLUMNS, FrameTimes
from ranger_sim.foundation.events import FLAG_ERROR, FLAG_EXTENDED, FLAG_REMOTE, FLAG_SINGLE_SHOT

from .wiring import RATE, Wired, edge


def timed(wired):
    """Attach; returns a function that gives the rows so far."""
    kept = array.array("q")
    wired.bus.log.times = FrameTimes()
    wired.bus.log.times.sink = lambda _time, rows: kept.frombytes(rows)

    def rows():
        wired.bus.log.times.flush()
        return [tuple(kept[at : at + TIMES_COLUMNS]) for at in range(0, len(kept), TIMES_COLUMNS)]

    return rows


def sender(node, buffer, flags):
    return (node + 1) << SENDER_SHIFT | buffer << TIMES_BUFFER_SHIFT | flags


def test_a_frame_that_has_to_wait_shows_since_when():
    """1 Mbit/s, where a bit is 1000 ns, and the first frame is of 47 bits and its stuff bits: by hand."""
    wired = Wired(2, bitrate=1_000_000)
    rows = timed(wired)
    wired.send(0, 0x555, time=10_500, flags=0)  # 101 0101 0101: nothing to stuff in the identifier
    wired.send(1, 0x2AA, time=12_000, buffer=2, lo=0x11, hi=0x22)
    wired.bus.advance(1_000_000)
    first = frame_bits(0x555, 0, 0, 0)
    assert 44 <= first <= 48
    second = frame_bits(0x2AA, 8, 0x11, 0x22)
    begin = 11 + first + 3  # the intermission is three bits
    assert rows() == [
        (11_000, 10_500, (11 + first) * 1000, 0x555, sender(0, 1, 0), 0, 0),
        (begin * 1000, 12_000, (begin + second) * 1000, 0x2AA, sender(1, 2, 8), 0x11, 0x22),
    ]


def test_reports_have_the_receivers_stamps_and_the_senders():
    wired = Wired(3)
    rows = timed(wired)
    for number, flags in enumerate((8, 3, FLAG_EXTENDED | 8, FLAG_REMOTE | 8)):
        wired.send(number % 2, 0x100 + number, time=number * 200_000, flags=flags | FLAG_SINGLE_SHOT * (number == 1))
        wired.bus.advance(number * 200_000 + 100_000)
    received = [(time, identifier, flags) for time, identifier, flags, _, _ in wired.of(2, "rx")]
    found = rows()
    assert [(row[3], row[4] & 255) for row in found] == [(identifier, flags) for _, identifier, flags in received]
    # receivers have a frame at the end of the bit before its last
    assert [row[2] for row in found] == [edge(round(time * RATE / 1e9) + 1) for time, _, _ in received]
    assert [row[1] for row in found] == [0, 200_000, 400_000, 600_000]


def test_an_error_frame_and_the_repeated_frame_are_reported():
    wired = Wired(3)
    rows = timed(wired)
    wired.bus.inject_errors(1)
    wired.send(0, 0x123, time=1000, lo=1, hi=2)
    wired.bus.advance(1_000_000)
    error, good = rows()
    assert error[0] == edge(4) and error[3] == 0x123 and error[4] == sender(0, 0, FLAG_ERROR | 8)
    assert error[2] == wired.log()[0][0]  # the end of the error frame, as the log of frames has it
    assert good[1] == 1000 and good[0] == edge(round(error[2] * RATE / 1e9) + 3)
    assert good[2] - good[0] == pytest.approx(frame_bits(0x123, 8, 1, 2) * 1e9 / RATE, abs=1)
    assert error[5] <= FIELD_DATA + 16 and error[6] > 0


def test_reporting_changes_no_message():
    messages = []
    for wants in (False, True):
        wired = Wired(3, seed=4)
        if wants:
            timed(wired)
        wired.bus.set_bit_error_rate(0.002)
        for number in range(60):
            wired.send(number % 3, 0x100 + number, time=number * 30_000, buffer=1 + number // 3 % 3, lo=number)
        wired.bus.advance(10_000_000)
        messages.append([wired.messages(node) for node in range(3)] + [wired.log(), wired.bus.counters.errors])
    assert messages[0] == messages[1] and messages[0][-1] > 0
