"""What a run keeps, read by a reader that knows only what a row is: nothing, the last seconds, or everything."""

import hashlib
import struct

import numpy as np
import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.records.logbook import Logbook, decoded
from ranger_sim.harness.records.recorder import Recorder

MS = 1_000_000
FRAMES = [  # time in ms, bus from 0, identifier, flags, words
    (n, n % 3, 0x100 + 7 * n % 0x700, 8, 0xFFFFFFFF - n, n * 0x01010101 & 0xFFFFFFFF) for n in range(0, 2600, 2)
] + [(2600, 1, 0x1FFFFFFF, 0x28, 0, 0xFFFFFFFF)]
SAMPLES = [(2 * n, (0.5 * n, -n)) for n in range(1301)]
WORDS = [(2 * n, (n, n * n, 1 << 40)) for n in range(1301)]


@pytest.fixture
def book():
    """A function that opens a logbook and its recorder; the logbook is closed at the end."""
    opened = []

    def open_book(mode, window_s=10.0):
        recorder = Recorder(3, 2, 3)
        opened.append(Logbook(recorder, mode, window_s))
        return opened[-1], recorder

    yield open_book
    for each in opened:
        each.close()


@pytest.fixture
def recorded(book):
    """The same after FRAMES, SAMPLES and WORDS."""
    return lambda mode, window_s=1.0: fill(*book(mode, window_s))


def fill(logbook, recorder):
    for time, bus, identifier, flags, lo, hi in FRAMES:
        recorder.frames[bus].add(time * MS, identifier, flags, lo, hi)
    for time, values in SAMPLES:
        stream = recorder.samples
        stream.reals[stream.used] = time * 1e-3
        for place, value in enumerate(values, start=1):
            stream.reals[stream.used + place] = value
        stream.finish_row(time * MS)
    for time, values in WORDS:
        stream = recorder.words
        stream.integers[stream.used] = time * MS
        for place, value in enumerate(values, start=1):
            stream.integers[stream.used + place] = value
        stream.finish_row(time * MS)
    return logbook, recorder


def frames_of(logbook):
    found = logbook.frames()
    names = ("time_ns", "bus", "identifier", "flags", "word0", "word1")
    return [tuple(int(each) for each in row) for row in zip(*(found[name] for name in names), strict=True)]


def expected(since_ms=0):
    wanted = [(t * MS, b, i, f, lo, hi) for t, b, i, f, lo, hi in FRAMES if t >= since_ms]
    return sorted(wanted, key=lambda each: each[:2])


def test_everything_is_kept_in_full(recorded):
    logbook, _ = recorded("full")
    assert frames_of(logbook) == expected()
    assert [tuple(row) for row in logbook.samples()] == [(t * 1e-3, *values) for t, values in SAMPLES]
    times, words = logbook.words()
    assert list(times) == [t * MS for t, _ in WORDS] and [tuple(row) for row in words] == [each for _, each in WORDS]
    # and once more: reading moves nothing, and what comes afterwards is kept behind it
    logbook.streams["can1"].add(9999 * MS, 5, 8, 1, 2)
    assert frames_of(logbook)[-1] == (9999 * MS, 0, 5, 8, 1, 2)
    assert len(frames_of(logbook)) == len(FRAMES) + 1
    logbook.close()
    assert all(spool.closed for spool in logbook.spools.values())


def test_a_window_ends_with_the_last_row_and_has_its_length(recorded):
    logbook, _ = recorded("window", window_s=1.0)
    assert frames_of(logbook) == expected(since_ms=1600)
    samples = logbook.samples()
    assert (samples[0, 0], samples[-1, 0], len(samples)) == (pytest.approx(1.6), pytest.approx(2.6), 501)
    times, words = logbook.words()
    assert (times[0], times[-1], len(words)) == (1600 * MS, 2600 * MS, 501)


def test_a_window_forgets_blocks_that_have_left_it(recorded):
    logbook, _ = recorded("window", window_s=0.1)
    for blocks in logbook.blocks.values():
        assert len(blocks) <= 2  # a block of 512 rows is longer than the window here
    assert frames_of(logbook) == expected(since_ms=2500)


@pytest.mark.parametrize("mode", ["full", "window"])
def test_rows_come_some_thousand_at_a_time_as_they_were_kept(mode, recorded):
    logbook, _ = recorded(mode, window_s=1.0)
    since = 0 if mode == "full" else 1600
    for number in range(3):
        rows = np.concatenate(list(logbook.kept(f"can{number + 1}")))
        found = decoded(rows)
        wanted = [each for each in expected(since) if each[1] == number]
        assert [(int(t), int(i)) for t, i in zip(found["time_ns"], found["identifier"], strict=True)] == [
            (each[0], each[2]) for each in wanted
        ]
    assert len(np.concatenate(list(logbook.kept("samples")))) == len([t for t, _ in SAMPLES if t >= since])
    logbook.streams["can2"].add(3000 * MS, 5, 8, 1, 2)  # behind what was read
    assert int(np.concatenate(list(logbook.kept("can2")))[-1, 0]) == 3000 * MS


def test_nothing_is_kept_where_nothing_was_asked_for(recorded, book):
    logbook, recorder = recorded("none")
    assert not logbook.records_words and all(stream.sink is None for stream in recorder.streams().values())
    assert frames_of(logbook) == []
    assert book("full")[0].records_words and book("window")[0].records_words


def test_an_unknown_mode_is_refused_with_those_there_are():
    with pytest.raises(UserError, match="log mode is 'some', allowed are full, window, none"):
        Logbook(Recorder(1, 1, 1), "some")


@pytest.mark.parametrize("mode", ["none", "window", "full"])
def test_a_subscriber_gets_every_row_and_removes_none(mode, recorded):
    logbook, recorder = recorded(mode)
    logbook.flush()
    before = len(frames_of(logbook))
    received = []
    logbook.listen("can1", lambda rows: received.extend(map(tuple, rows.tolist())))
    recorder.frames[0].add(2700 * MS, 3, 8, 4, 5)
    logbook.flush()
    assert received == [(2700 * MS, 4 << 12 | 8 << 4, 5 << 29 | 3)]
    assert len(frames_of(logbook)) == (0 if mode == "none" else before + 1 - (mode == "window") * 50)


def test_the_digest_is_that_of_the_bytes_of_buses_and_body_in_order(recorded):
    """harness/records/recorder.py: BLAKE2b-256 over a line and the digests of each bus's rows and of the samples."""
    _, recorder = recorded("none")
    parts = []
    for number in range(3):
        rows = [
            struct.pack("<qqq", t * MS, lo << 12 | f << 4 | b, hi << 29 | i)
            for t, b, i, f, lo, hi in FRAMES
            if b == number
        ]
        parts.append(hashlib.blake2b(b"".join(rows), digest_size=32).digest())
    rows = [struct.pack("<ddd", t * 1e-3, *values) for t, values in SAMPLES]
    parts.append(hashlib.blake2b(b"".join(rows), digest_size=32).digest())
    total = hashlib.blake2b(b"ranger-sim trace 3\n" + b"".join(parts), digest_size=32)
    assert recorder.trace_digest() == total.hexdigest()
    assert recorder.trace_digest() == total.hexdigest()  # telling it changes nothing
    assert list(recorder.streams()) == ["can1", "can2", "can3", "samples", "words"]
