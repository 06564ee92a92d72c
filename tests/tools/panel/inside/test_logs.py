"""A log on disk in small pieces against the same frames in memory."""

import numpy as np
import pytest

from ranger_sim.can_bus.edge.candump import CandumpWriter
from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools.panel.inside import logs
from ranger_sim.tools.panel.inside.candump_rows import rows_of
from ranger_sim.tools.panel.inside.frames import RecentFrames
from ranger_sim.tools.panel.inside.logs import LogFrames

STAMPS_US = np.cumsum(np.arange(1000) % 7 * 10)  # some of them alike


@pytest.fixture
def pair(tmp_path, monkeypatch):
    """(log in pieces of some ten frames, all its frames in memory)."""
    monkeypatch.setattr(logs, "PIECE_BYTES", 1000)
    with CandumpWriter(tmp_path / "can1.log") as writer:
        writer.write("can1", ((1000 * int(us), 5 + k % 3, 8, k, 0) for k, us in enumerate(STAMPS_US)))
    log, memory = LogFrames(tmp_path / "can1.log"), RecentFrames(1000)
    memory.append(rows_of((tmp_path / "can1.log").read_bytes()))
    while (piece := log.read()) is not None:
        log.add(piece)
    yield log, memory
    log.close()


@pytest.mark.parametrize("us", [-1, 0, 5, 30, 210, 29_970, 10**9])
def test_a_log_gives_the_same_as_memory(pair, us):
    log, memory = pair
    np.testing.assert_array_equal(log.until(1000 * us, 40), memory.until(1000 * us, 40))
    assert log.counts(1000 * us, [5, 6, 7, 99]) == memory.counts(1000 * us, [5, 6, 7, 99])
    assert log.within(0, 1000 * us) == np.sum((STAMPS_US > 0) & (STAMPS_US <= us)) if us >= 0 else True


def test_the_newest_of_a_log_and_all_of_it(pair):
    log, memory = pair
    np.testing.assert_array_equal(log.until(None, 2000), memory.until(None, 2000))
    assert log.counts(None, [5, 6, 7]) == [334, 333, 333] and log.frames == 1000
    assert log.within(-1, 10) is None  # nobody knows what was before the log


def test_few_pieces_are_in_memory_however_long_the_log(pair):
    log, _ = pair
    assert len(log.starts) > 40
    for us in range(0, 30_000, 100):
        log.until(1000 * us, 40)
        assert len(log.cached) <= logs.PIECES_KEPT


def test_what_was_not_read_yet_is_not_there(tmp_path, monkeypatch):
    monkeypatch.setattr(logs, "PIECE_BYTES", 1000)
    with CandumpWriter(tmp_path / "can1.log") as writer:
        writer.write("can1", ((1000 * int(us), 5, 8, 0, 0) for us in STAMPS_US))
    log = LogFrames(tmp_path / "can1.log")
    assert len(log.until(None, 5)) == 0 and log.counts(10, [5]) == [None] and log.within(0, 10) is None
    log.add(log.read())
    assert log.frames == 1000 // 46  # whole lines of 46 letters with their ends
    early, late = 1000 * int(STAMPS_US[15]), 1000 * int(STAMPS_US[30])
    assert log.counts(early, [5]) == [16] and log.within(0, early) == 15  # the first is at 0
    assert log.counts(late, [5]) == [None] and log.within(0, late) is None
    log.close()


def test_a_malformed_line_is_reported_with_its_file(tmp_path):
    (tmp_path / "can1.log").write_text("(0000000012.345678) can1 0A1#0102030405060708\nnonsense\n")
    log = LogFrames(tmp_path / "can1.log")
    with pytest.raises(UserError, match=r"can1\.log: not `\(seconds.*'nonsense'"):
        log.read()
    log.close()
