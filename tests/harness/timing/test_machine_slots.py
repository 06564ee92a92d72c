"""Slots of the whole robot: recorded without a trace of it in the run, selected by what the robot did."""

import contextlib
import types

import numpy as np
import pytest

from ranger_sim.firmware_sim.board import Board
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.timing.machine_slots import Held
from ranger_sim.ranger.board_programs import BOARD_CLASSES
from ranger_sim.ranger.conditions import condition
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.timeline import Timeline


def test_recording_every_board_leaves_the_run_byte_for_byte_as_it_is():
    digests = []
    for recorded in (False, True):
        with contextlib.closing(Ranger()) as robot:
            views = [robot.slots(name) for name in BOARD_CLASSES] if recorded else []
            robot.run_for(0.25)
            digests.append(robot.trace_digest())
            assert all(len(view) > 100 for view in views)
    assert digests[0] == digests[1]


def test_what_is_recorded_is_what_the_board_counted_and_what_it_publishes():
    with contextlib.closing(Ranger()) as robot:
        view = robot.slots("MCFI")
        assert robot.slots("MCFI") is view
        robot.run_for(0.3)
        board = robot.board("MCFI")
        counted = board.counters().slots
        assert len(view) in (counted.count, counted.count - 1)  # the latest may not be through
        assert view.worst().cycles == counted.max_cycles and view.overruns == counted.overruns == 0
        # MAX_EXECUTION_TIME reads the timer in the row's last task, which then takes 44 cycles itself
        read_s = board.execution.longest_seconds()
        assert view.worst().taken_ns - 44 * 1000 / 60 == pytest.approx(read_s * 1e9, abs=40)


@pytest.mark.parametrize("name", BOARD_CLASSES)
def test_no_interrupt_is_served_before_it_is_asked_for(name):
    with contextlib.closing(Ranger()) as robot:
        view = robot.slots(name)
        robot.run_for(0.1)
        latencies = [ran.latency_ns for slot in view for ran in slot.interrupts]
        assert len(latencies) > 50 and min(latencies) >= 0


def test_slots_are_selected_by_what_held_at_their_start():
    with contextlib.closing(Ranger()) as robot:
        late = robot.slots("MCH").where(lambda robot: 0.01 <= robot.time_s < 0.02)
        second = robot.slots("MCH").of_row(2).where("12 ms").between("10 ms", "20 ms")
        robot.run_for(0.03)
        assert {slot.row for slot in second} == {2} and len(second) == 4
        assert min(slot.start_ns for slot in second) >= 12_000_000
        starts = [slot.start_ns for slot in late]
        assert len(starts) == 20 and min(starts) >= 10_000_000 and max(starts) < 20_250_000


def test_before_it_was_checked_a_condition_did_not_hold():
    answers = iter((False, True, True, False))
    held = Held(types.SimpleNamespace(start_ns=1000), condition(lambda robot: next(answers)))
    for now_ns in (1100, 1200, 1300, 1400):
        held.before_step(now_ns)
    assert held.at(np.array([0, 100, 199, 200, 399, 400, 900])).tolist() == [False] * 3 + [True] * 2 + [False] * 2


def test_a_board_that_shows_no_activity_is_refused_by_name():
    with contextlib.closing(Ranger()) as robot:
        robot.loop = types.SimpleNamespace(board=lambda name: Board(name), time=robot.loop.time)
        with pytest.raises(UserError, match="slots of MCH: this board is external and reports"):
            robot.slots("MCH")
        with pytest.raises(UserError, match="board 'MCX'"):
            robot.slots("MCX")


def test_a_board_that_lost_its_supply_is_recorded_on_when_it_comes_back():
    with contextlib.closing(Ranger()) as robot:
        view = robot.slots("MCH")
        timeline = Timeline(robot)
        robot.inject("MCH.supply", "brown_out", at="0.1 s", off_ms=20.0)
        robot.run_for(0.11)
        off = list(view)  # also while it has no power there is an answer
        robot.run_for(0.09)
        slots = list(view)
        drawn = timeline.events().track("Boards", "MCH", "slots")
    assert [slot.start_ns for slot in slots[: len(off)]] == [slot.start_ns for slot in off]
    before = [slot for slot in slots if slot.start_ns < 100e6]
    after = [slot for slot in slots if slot.start_ns > 121e6]  # 20 ms off, and a millisecond until it begins
    assert len(before) + len(after) == len(slots)
    # boards begin within 2.5 ms of power, one slot each 0.5 ms
    assert 195 <= len(before) <= 200 and 150 <= len(after) <= 158
    assert [slot.row for slot in after[:5]] == [0, 1, 2, 3, 0] and after[0].number == 1
    # the cut one is drawn too, though it is no whole slot; nothing lies in the dark
    assert len(drawn) - len(slots) in (0, 1, 2)
    assert not any((drawn.start_ns > 100_250_000) & (drawn.start_ns < 121_000_000))
    assert not any((drawn.inside.end_ns > 100_250_000) & (drawn.inside.start_ns < 121_000_000))


def test_every_interrupt_of_every_board_has_its_own_name():
    with contextlib.closing(Ranger()) as robot:
        for name in BOARD_CLASSES:
            names = [source.name for source in robot.boards[name].legend().interrupts]
            assert len(set(names)) == len(names) and not any("/" in each for each in names), names
        names = [source.name for source in robot.boards["MCH"].legend().interrupts]
        assert "can1 transmit" in names  # to which nothing listens: the firmware looks at the buffer instead


def test_the_routers_main_loop_is_in_its_slots_and_no_function_of_theirs():
    with contextlib.closing(Ranger()) as robot:
        view, hip = robot.slots("CSR"), robot.slots("MCH")
        robot.run_for(0.1)
        slots = list(view)
        turns = [turn for slot in slots for turn in slot.turns]
        assert view.main_loop.calls == len(turns) > 500 and {turn.name for turn in turns} == {"main loop"}
        assert not any(each.main_loop for slot in slots for each in slot.functions + slot.interrupts)
        assert "main loop" not in view.functions
        assert hip.main_loop is None
