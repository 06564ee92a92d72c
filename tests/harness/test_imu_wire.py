"""The inertial unit's serial wire: which bytes travel together to the board."""

import types

import pytest

from ranger_sim.foundation.events import UART_BYTE
from ranger_sim.harness.wiring.imu_wire import ImuWire
from ranger_sim.ranger.robot import Ranger


@pytest.fixture
def sent():
    """What the board's inbox holds of bytes that left the unit at these times (ns): (time, count, bytes)."""
    robot = Ranger()
    unit, board = robot.plant.imu, robot.board("UI")

    def of(*bytes_at):
        while board.inbox.head_time < 10**15:
            board.inbox.take()
        line = unit.bytes
        line.count = 0
        for time, value in bytes_at:
            line.times[line.count], line.values[line.count] = time, value
            line.count += 1
        ImuWire(unit, board, 1).deliver()
        found = []
        while board.inbox.head_time < 10**15:
            event = board.inbox
            event.take()
            assert event.kind == UART_BYTE
            found.append(
                types.SimpleNamespace(time=event.time, first=event.b, count=event.c, low=event.d, high=event.e)
            )
        return found

    yield of
    robot.close()


def test_bytes_less_than_a_pause_apart_travel_as_one_message_and_others_separately(sent):
    together = sent((1_000_000, 0x11), (1_024_999, 0x22))
    assert [(each.time, each.count, each.low) for each in together] == [(1_024_999, 2, 0x2211)]
    apart = sent((1_000_000, 0x11), (1_025_000, 0x22))
    assert [(each.time, each.count, each.low) for each in apart] == [(1_000_000, 1, 0x11), (1_025_000, 1, 0x22)]


def test_a_message_holds_eight_bytes_the_first_one_lowest(sent):
    nine = sent(*((1_000_000 + 21_700 * i, 0x10 + i) for i in range(9)))
    assert [(each.count, each.low, each.high) for each in nine] == [(8, 0x13121110, 0x17161514), (1, 0x18, 0)]
    assert [each.time for each in nine] == [1_000_000 + 21_700 * 7, 1_000_000 + 21_700 * 8]
