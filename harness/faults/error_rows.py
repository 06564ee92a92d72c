"""Each board's errors and their times, for any machine; and the place of a state machine's state."""

from typing import NamedTuple

import cython

from ranger_sim.foundation.row_stream import RowStream
from ranger_sim.harness.step_watch import StepWatch


class StateWord(NamedTuple):
    """A state machine: the word of the logged memory that has its state, and the names of its states."""

    word: int
    states: dict[int, str]


@cython.final
@cython.cclass
class ErrorRows(StepWatch):
    """Fills `rows`: time (ns), place of the board in `boards`, code, how often since the last check.

    boards: the list that the loop runs, each with `error_totals`. codes: 0 ... codes - 1 are checked. Times are those
    of the plant's step before which the error was recorded. Ranger's, compiled for its error modules: error_watch.py.
    """

    boards: list
    codes: cython.longlong
    rows: RowStream
    before: list
    images: list

    def __init__(self, boards, codes) -> None:
        StepWatch.__init__(self)
        self.boards = boards
        self.codes = codes
        self.rows = RowStream("q", 4, False)
        self.before = [list(board.error_totals(codes)) for board in boards]
        self.images = [None] * len(boards)

    def before_step(self, now_ns: cython.longlong) -> object:
        """Record the errors since the last step."""
        for place, board in enumerate(self.boards):
            if hasattr(board, "error_image"):  # of a program in C: cheaper to compare than the numbers
                image = board.error_image(self.codes)
                if image == self.images[place]:
                    continue
                self.images[place] = image
            totals = list(board.error_totals(self.codes))
            if totals == self.before[place]:
                continue
            for code, (now, before) in enumerate(zip(totals, self.before[place], strict=True)):
                more = now - before if now >= before else now  # a board counts from 0 after its reset
                if more:
                    at = self.rows.used
                    for column, value in enumerate((now_ns, place, code, more)):
                        self.rows.integers[at + column] = value
                    self.rows.finish_row(now_ns)
            self.before[place] = totals
        return None
