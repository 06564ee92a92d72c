"""A short run of `python -m dev.fuzz can`, and that its checks can fail."""

import pytest

from dev.fuzz import Finding
from dev.fuzz import can as fuzz_can
from ranger_sim.can_bus.node import RESET
from ranger_sim.firmware_sim.board import Board
from ranger_sim.foundation.events import NEVER


class DeadBoard(Board):
    """Takes in what comes and does nothing."""

    def advance(self, until):
        self.inbox.clear()
        self.next_time, self.horizon = NEVER, until
        return NEVER

    def connect_edges(self, buffer, pin, partner_pin):
        """No test reads them."""


def test_three_thousand_cases_from_outside_move_the_counters_and_stop_nothing():
    result = fuzz_can.run(3000)
    assert result["cases"] == 3000 and result["robots"] == 1
    for name in ("frames_in", "frames_out", "malformed", "refused", "received_by_boards", "answered_at_the_end"):
        assert result[name] > 50, name
    assert result["frames_dropped"] == 0


def test_the_checks_notice():
    fuzz = fuzz_can.Fuzz()
    for _ in range(30):
        fuzz.slice()
    board = fuzz.robot.boards["MCH"]
    board.scheduler.slot_time -= 6_000_000
    dead = DeadBoard("MCH")
    dead.inbox = board.inbox
    fuzz.robot.loop.replace(dead)
    with pytest.raises(Finding, match="board MCH has stopped"):
        fuzz.slice()
    fuzz.robot.buses[0].nodes[0].mode = RESET
    with pytest.raises(Finding, match="board CSR is off can1"):
        fuzz.end()
    fuzz.robot.buses[0].nodes[0].mode = 0
    fuzz.end()
