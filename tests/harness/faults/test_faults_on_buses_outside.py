"""Faults that are frames act on buses outside as well; the others are refused there by name."""

import contextlib
import uuid

import can
import pytest

from ranger_sim.can_bus.edge.external_bus import ExternalBus, opener
from ranger_sim.datatable.generated import all_variables
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes.outside import move_bus
from ranger_sim.ranger import wiring
from ranger_sim.ranger.robot import Ranger

FREE = 2040  # an identifier that nobody of the robot sends
BIT = 1 << 22  # in which the duplicate differs, by default


class Outside:
    """A robot whose can1 is python-can's `virtual`, and who listens there."""

    def __init__(self):
        channel = uuid.uuid4().hex
        self.robot = Ranger()
        self.bus = ExternalBus("can1", 3_000_000, opener("can1", {"interface": "virtual", "channel": channel}))
        move_bus(self.robot, self.bus, {}, wiring.BOARDS)
        self.listener = can.Bus(interface="virtual", channel=channel)

    def received(self, identifier):
        """Data of the frames of this identifier since the last question."""
        found = []
        while (message := self.listener.recv(0)) is not None:
            if message.arbitration_id == identifier:
                found.append(bytes(message.data))
        return found

    def close(self):
        self.listener.shutdown()
        self.bus.close()
        self.robot.close()


@pytest.fixture
def outside():
    with contextlib.closing(Outside()) as made:
        yield made


@pytest.mark.parametrize(("period_us", "least", "most"), [(0.0, 200, 280), (500.0, 20, 21)])
def test_a_babbling_node_outside_sends_at_its_period_or_as_fast_as_the_wire_carries(outside, period_us, least, most):
    robot = outside.robot
    fault = robot.inject("can1", "babbling", at="0.02 s", until="0.03 s", frame=str(FREE), period_us=period_us)
    robot.run_for(0.019)
    assert outside.received(FREE) == []
    robot.run_for(0.012)
    sent = outside.received(FREE)
    # 10 ms of frames of eight bytes of zeros at 3 Mbit/s: some 130 bits with their stuff bits, 43 us
    assert least <= len(sent) <= most and set(sent) == {bytes(8)}
    assert fault.acted_count == len(sent)
    peers = len(outside.bus.peers)
    robot.run_for(0.01)
    assert outside.received(FREE) == [] and len(outside.bus.peers) == peers == 2  # those of MCH and of the router
    assert fault.cleared_ns > fault.ended_ns > 0


def test_a_duplicate_identifier_outside_follows_each_frame_with_another_value_and_not_itself(outside):
    robot = outside.robot
    fault = robot.inject("can1", "duplicate", at="0.02 s", until="0.04 s", frame="MCH_ANGLE")
    identifier = all_variables.ID_OF["MCH_ANGLE"]
    robot.run_for(0.02)
    outside.received(identifier)
    robot.run_for(0.02)
    words = [int.from_bytes(data[:4], "little") for data in outside.received(identifier)]
    assert 18 <= len(words) <= 21 and fault.acted_count in (len(words) // 2, len(words) // 2 + 1)  # each 2 ms, doubled
    assert all(other == own ^ BIT for own, other in zip(words[::2], words[1::2], strict=False))
    robot.run_for(0.01)
    assert fault.cleared_ns > 0 and outside.bus.sinks and len(outside.bus.peers) == 2
    after = outside.received(identifier)
    assert 4 <= len(after) <= 6


@pytest.mark.parametrize(
    ("place", "mode"), [("can1", "noise"), ("MCH.can1", "BIT"), ("MCH.can1", "loss"), ("MCH.can1", "cut")]
)
def test_what_would_have_to_reach_into_bits_or_cables_outside_is_refused_by_name(outside, place, mode):
    with pytest.raises(UserError, match=f"fault {place}:{mode}: can1 is a real bus outside here"):
        outside.robot.inject(place, mode)
