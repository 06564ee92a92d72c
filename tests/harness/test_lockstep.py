"""The loop's freedom: how it cuts time into windows and when it lets a board run changes nothing."""

import pathlib

import pytest

from ranger_sim.firmware_sim.board import Board
from ranger_sim.foundation.events import NEVER
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness import lockstep
from ranger_sim.harness.outside import profile
from ranger_sim.ranger import wiring
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario, StopRule

RUN_S = 0.06


def trace(prompt=(), errors_on_can1=0, slice_s=1.0):
    """(digest of a short run, frames that the hip board lost by going bus-off).

    Boards of `prompt` run as soon as anything comes in.
    """
    robot = Ranger(Scenario())
    for name in prompt:
        place = wiring.BOARDS.index(name)
        robot.loop.prompt[place] = 1
        robot.boards[name].inbox.wake(robot.loop.due, robot.loop.due, place)
    robot.buses[0].inject_errors(errors_on_can1)
    while robot.time_s < RUN_S - 1e-9:
        robot.run(StopRule(time_s=RUN_S), slice_s)
    hip = next(node for node in robot.buses[0].nodes if node.name == "MCH")
    return robot.trace_digest(), hip.flushed


@pytest.mark.parametrize("window_ns", [1_000, 10_007, 31_250])
def test_the_trace_does_not_depend_on_where_the_windows_lie(monkeypatch, window_ns):
    expected = trace()
    monkeypatch.setattr(lockstep, "WINDOW_NS", window_ns)
    assert trace() == expected


def test_a_busier_robots_trace_does_not_depend_on_where_the_windows_lie_either(monkeypatch):
    """At 1 Mbit/s frames often hold up the start of an exchange on the serial link, so the next pause is short."""
    slow = profile.load(pathlib.Path(__file__).parents[2] / "profiles" / "hil-1mbit.toml")

    def digest():
        robot = Ranger(Scenario(), profile=slow)
        robot.run(StopRule(time_s=0.67), 1.0)
        return robot.trace_digest()

    expected = digest()
    monkeypatch.setattr(lockstep, "WINDOW_NS", 10_007)
    assert digest() == expected


def test_the_trace_does_not_depend_on_how_a_run_is_sliced():
    assert trace(slice_s=0.0007) == trace(slice_s=0.000_033) == trace()


def test_a_board_that_receives_in_its_slots_misses_nothing_by_running_later():
    assert trace(prompt=wiring.RECEIVE_IN_SLOTS) == trace()


def test_between_two_runs_every_board_is_up_to_date():
    """Within a run a board that has only received something is not stepped, over many steps of the plant."""
    robot = Ranger(Scenario())
    for _ in range(40):  # some slices end between a frame and the slot that reads it
        robot.run(StopRule(time_s=RUN_S), 0.000_31)
        waiting = {
            name: board.inbox.head_time
            for name, board in robot.boards.items()
            if min(board.inbox.head_time, board.edge_time, board.next_time) < robot.loop.time
        }
        assert waiting == {}


def test_a_board_whose_controller_went_bus_off_restarts_it_at_once_also_when_it_receives_in_its_slots(monkeypatch):
    """Its error interrupt writes the controller's mode register: the bus's reports of errors are urgent.

    An error shows within a bit (333 ns), so only windows shorter than that leave no freedom at all here.
    """
    monkeypatch.setattr(lockstep, "WINDOW_NS", 300)
    at_leisure = trace(errors_on_can1=80)
    assert at_leisure[1] > 0  # frames were lost with bus-off
    assert trace(prompt=wiring.RECEIVE_IN_SLOTS, errors_on_can1=80) == at_leisure


def chatty(board):
    """Makes the heartbeat of a board send a frame at every call; returns its task."""
    beat = board.scheduler.find("hb_beat")
    ordinary = beat.function

    def talk():
        ordinary()
        board.can.send_int(0x123, 1)

    beat.function = talk
    return beat


@pytest.mark.parametrize("when_ms", [5.0, 5.1, 5.2, 5.3, 5.4])
def test_a_users_function_may_send_from_any_task_and_from_any_moment_on(when_ms):
    robot = Ranger(Scenario())
    robot.run(StopRule(time_s=when_ms * 1e-3), 1.0)
    board = robot.boards["MCH"]
    sent = board.can.queued
    assert chatty(board).transmits
    robot.run(StopRule(time_s=0.01), 1.0)
    assert board.can.queued > sent + 15


def test_a_task_that_sends_though_its_schedule_says_it_does_not_is_named_as_a_mistake():
    """The others have gone on by then: what it sent would come too late for them."""
    robot = Ranger(Scenario())
    beat = chatty(robot.boards["MCH"])
    beat.transmits = False
    robot.boards["MCH"].scheduler.set_duration(beat)
    with pytest.raises(
        UserError, match="MCH: a frame was sent at [0-9]+ ns, but by its schedule's `transmitters` none"
    ):
        robot.run(StopRule(time_s=0.02), 1.0)


def test_a_board_whose_schedule_names_its_transmitters_has_the_trace_of_one_without_names():
    expected = trace()
    robot = Ranger(Scenario())
    for board in robot.boards.values():
        board.scheduler.names_transmitters = False
    robot.run(StopRule(time_s=RUN_S), 1.0)
    assert robot.trace_digest() == expected[0]


class IdleBoard(Board):
    """Takes in what comes, and never has anything to do."""

    def advance(self, until):
        self.inbox.clear()
        self.horizon = until
        self.next_time = NEVER
        return NEVER

    def connect_edges(self, buffer, pin, partner_pin):
        """No test reads them."""


def test_any_kind_of_board_may_take_the_place_of_an_emulated_one():
    robot = Ranger(Scenario())
    idle = IdleBoard("MCSI")
    idle.inbox = robot.boards["MCSI"].inbox
    robot.loop.replace(idle)
    robot.run(StopRule(time_s=0.01), 1.0)
    assert robot.boards["MCSI"].scheduler.slot_count == 0
    assert robot.boards["MCFI"].scheduler.slot_count >= 16


def test_a_board_with_another_inbox_or_of_another_name_takes_no_place():
    robot = Ranger(Scenario())
    with pytest.raises(UserError, match="the inbox of the new MCH is not that of the one whose place it takes"):
        robot.loop.replace(IdleBoard("MCH"))
    with pytest.raises(UserError, match="no board is named NOPE"):
        robot.loop.replace(IdleBoard("NOPE"))
