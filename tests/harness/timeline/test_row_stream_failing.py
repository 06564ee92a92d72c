"""A stream of rows whose sink fails, and a store whose file is full."""

import errno
import os

import pytest

from ranger_sim.foundation.row_stream import RowStream
from ranger_sim.harness.timeline.row_store import RowStore


def test_a_sink_that_fails_lets_the_next_rows_begin_at_the_start_of_the_block():
    stream = RowStream("q", 2, False, 4)
    blocks = []

    def sink(_time_ns, block):
        blocks.append(block)
        if len(blocks) == 1:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    stream.sink = sink
    for number in range(3):
        stream.finish_row(number)
    with pytest.raises(OSError, match="No space left"):
        stream.finish_row(3)
    for number in range(4):
        stream.finish_row(number)  # a fifth row without a new beginning would lie behind the block
    assert [len(block) for block in blocks] == [4 * 2 * 8, 4 * 2 * 8]


def test_a_store_on_a_full_disk_goes_on_and_reports_it_when_its_rows_are_asked_for():
    class Full:
        def write(self, _block):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        def close(self):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    store = RowStore(2, None)
    store.spool = Full()
    store.take(1, bytes(16))
    store.take(2, bytes(16))
    with pytest.raises(OSError, match="No space left on device: 'rows of the timeline in"):
        store.rows()
    store.close()
