"""Old names of methods and arguments."""

import pytest

from ranger_sim.firmware_sim.board import Board
from ranger_sim.firmware_sim.scheduler import Schedule, Task
from ranger_sim.foundation.edge_buffer import EdgeBuffer
from ranger_sim.foundation.events import NEVER


def test_old_names_of_a_board_do_what_the_new_ones_do_and_warn_at_the_caller():
    board = Board("TEST")
    board.next_time = 8
    with pytest.warns(DeprecationWarning, match=r"^Board.edges_came is now note_edges; the old name ends") as warned:
        assert board.edges_came() == NEVER
    assert warned[0].filename == __file__
    with pytest.warns(DeprecationWarning, match=r"^Board.speaks_from is now earliest_transmit_ns"):
        assert board.speaks_from() == 8
    with (
        pytest.warns(DeprecationWarning, match=r"^Board.listen_to_edges is now connect_edges"),
        pytest.raises(NotImplementedError, match="no pins for an encoder"),
    ):
        board.listen_to_edges(EdgeBuffer(), 22, 27)


def test_the_old_name_of_an_argument_does_what_the_new_one_does_and_warns_at_the_caller():
    first, second = Task(int, cost=1, name="first"), Task(int, cost=1, name="second")
    with pytest.warns(DeprecationWarning, match=r"^Schedule.speakers is now transmitters") as warned:
        schedule = Schedule(every=(first, second), speakers=("second",))
    assert warned[0].filename == __file__
    assert schedule.names_transmitters and (first.transmits, second.transmits) == (False, True)
