"""Old names of methods."""

import pytest

from ranger_sim.boards.modules.can_link import CanLink
from ranger_sim.firmware_sim.board import Board
from ranger_sim.foundation.edge_buffer import EdgeBuffer


class ThreeCalls(Board):
    """A board of a user that has the new names."""

    def __init__(self):
        super().__init__("TEST")
        self.calls = []

    def connect_edges(self, buffer, pin, partner_pin):
        self.calls.append((buffer, pin, partner_pin))

    def note_edges(self):
        return 7

    def earliest_transmit_ns(self):
        return 8


def test_old_names_of_a_board_do_what_the_new_ones_do_and_warn_at_the_caller():
    board, edges = ThreeCalls(), EdgeBuffer()
    with pytest.warns(DeprecationWarning, match=r"^Board.listen_to_edges is now connect_edges; the old name") as warned:
        board.listen_to_edges(edges, 22, 27)
    assert warned[0].filename == __file__
    assert board.calls == [(edges, 22, 27)]
    with pytest.warns(DeprecationWarning, match=r"^Board.edges_came is now note_edges"):
        assert board.edges_came() == 7
    with pytest.warns(DeprecationWarning, match=r"^Board.speaks_from is now earliest_transmit_ns"):
        assert board.speaks_from() == 8


def test_the_old_name_of_subscribe_warns_at_the_caller():
    class Link(CanLink):
        def __init__(self):
            pass

        def subscribe(self, identifier, receiver):
            self.receivers = [identifier, receiver]

    link = Link()
    with pytest.warns(DeprecationWarning, match=r"^CanLink.listen is now subscribe") as warned:
        link.listen(18, None)
    assert warned[0].filename == __file__
    assert link.receivers == [18, None]
