"""The ring of a board's latest slots, held against the log of what its processor did, which is kept elsewhere."""

import contextlib

import numpy as np
import pytest

from ranger_sim import Ranger, Scenario
from ranger_sim.firmware_sim.activity import COLUMN_CYCLES, COLUMN_KIND, COLUMN_START, SLOT_ENDED
from ranger_sim.harness.processes.forked_boards import ForkedBoards
from ranger_sim.harness.processes.places import RING, RING_ROW

SECONDS = 0.3
BOARDS = ("MCH", "MB", "CSR", "UI")


def logged(slow):
    """{board: (time, cycles) of every slot}, of a robot in this process."""
    with contextlib.closing(Ranger(Scenario(seed=4))) as robot:
        rows = {name: [] for name in BOARDS}
        for name in BOARDS:
            log = robot.board(name).activity()
            log.add_sink(lambda _time, data, own=rows[name]: own.append(np.frombuffer(data, np.int64).reshape(-1, 8)))
        if slow:
            make_slow(robot)
        robot.run_for(SECONDS)
        for name in BOARDS:
            robot.board(name).activity().flush()
        found = {}
        for name, blocks in rows.items():
            all_rows = np.concatenate(blocks)
            ended = all_rows[all_rows[:, COLUMN_KIND] == SLOT_ENDED]
            found[name] = ended[:, [COLUMN_START, COLUMN_CYCLES]]
        return found


def make_slow(robot):
    """The hip board takes more than its slot now and then: 30,000 cycles are one."""
    robot.replace("MCH", "motor_encoder_rezero", lambda: None, cost=31_000)


@pytest.mark.parametrize("slow", [False, True])
def test_the_ring_has_every_slot_with_its_time_and_its_cycles(slow):
    expected = logged(slow)
    with contextlib.closing(Ranger(Scenario(seed=4))) as robot:
        if slow:
            make_slow(robot)
        apart = ForkedBoards(robot, BOARDS)
        found, at = {name: [] for name in BOARDS}, dict.fromkeys(BOARDS, 0)
        try:
            for _ in range(round(SECONDS / 0.02)):
                robot.run_for(0.02)
                for name, remote in apart.remotes.items():
                    data, at[name], missed = remote.slots_since(at[name])
                    assert missed == 0
                    found[name].append(np.frombuffer(data, np.int64).reshape(-1, RING_ROW))
        finally:
            apart.close()
    for name in BOARDS:
        slots = np.concatenate(found[name])
        assert len(slots) >= 0.9 * len(expected[name]) > 100
        np.testing.assert_array_equal(slots[:, :2], expected[name][: len(slots)])
        assert (slots[:, 2] == -1).all()  # no pace is kept here


def test_a_reader_that_polls_too_rarely_gets_the_number_of_slots_missed():
    with contextlib.closing(Ranger(Scenario(seed=4))) as robot:
        apart = ForkedBoards(robot, ("MCH",))
        try:
            robot.run_for(0.5)  # a thousand slots of 0.5 ms
            data, following, missed = apart.remotes["MCH"].slots_since(0)
            rows = np.frombuffer(data, np.int64).reshape(-1, RING_ROW)
            assert len(rows) == RING - 2 and missed == following - len(rows) > 400
            assert (np.diff(rows[:, 0]) > 0).all()
            assert apart.remotes["MCH"].slots_since(following) == (b"", following, 0)
        finally:
            apart.close()
