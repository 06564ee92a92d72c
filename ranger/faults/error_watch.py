# cython: boundscheck=False, wraparound=False
# (every index below is a board, a code of the error module, or a column of the stream)
"""Each board's errors and their times: the boards' own counts, checked between two steps of the plant."""

import cython

from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.foundation.numbers import integers
from ranger_sim.foundation.row_stream import RowStream
from ranger_sim.harness.step_watch import StepWatch


@cython.final
@cython.cclass
class ErrorWatch(StepWatch):
    """Fills `rows`: time (ns), place of the board in `boards`, code, how often since the last check.

    boards: the list that the loop runs, so that a board that replaces another one is seen; entries after the
    boards with errors, such as a calibration probe, are not checked. codes: 0 ... codes - 1
    are checked. Times are those of the 250 us step before which the error was recorded.
    """

    boards: list
    codes: cython.longlong
    count: cython.longlong
    before: cython.longlong[::1]
    rows: RowStream

    def __init__(self, boards, codes) -> None:
        StepWatch.__init__(self)
        self.boards = boards
        self.codes = codes
        self.count = sum(hasattr(board, "errors") for board in boards)
        self.before = integers(self.count * codes)
        self.rows = RowStream("q", 4, False)
        for place, board in enumerate(boards[: self.count]):
            for code in range(codes):
                self.before[place * codes + code] = board.errors.totals[code]

    def before_step(self, now_ns: cython.longlong) -> object:
        """Record the errors since the last step."""
        place: cython.longlong
        code: cython.longlong
        at: cython.longlong
        more: cython.longlong
        errors: ErrorModule
        boards: list = self.boards
        stream: RowStream = self.rows
        for place in range(self.count):
            errors = boards[place].errors
            for code in range(self.codes):
                at = place * self.codes + code
                more = errors.totals[code] - self.before[at]
                if more == 0:
                    continue
                self.before[at] = errors.totals[code]
                if more < 0:  # a board counts from 0 after its reset
                    more = errors.totals[code]
                    if more == 0:
                        continue
                at = stream.used
                stream.integers[at] = now_ns
                stream.integers[at + 1] = place
                stream.integers[at + 2] = code
                stream.integers[at + 3] = more
                stream.finish_row(now_ns)
        return None
