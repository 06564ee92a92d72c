"""What the boards count reaches summary and report by name, also through a channel between processes."""

import json

import pytest

from ranger_sim.boards.counters import RangerCounters
from ranger_sim.firmware_sim.counters import as_dict, from_dict
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario, StopRule


@pytest.fixture(scope="module")
def counted():
    robot = Ranger(Scenario())
    robot.run(StopRule(time_s=0.02), 1.0)
    return robot.counters()


def test_every_board_says_what_it_counted(counted):
    assert list(counted) == ["MCH", "MCFO", "MCFI", "MCSI", "UI", "CSR", "MB"]
    for board in counted.values():  # powered up within the first 2 ms of 20
        assert 18_000_000 // board.slots.slot_ns <= board.slots.count <= 20_000_000 // board.slots.slot_ns
        assert board.slots.latest_ns > 20_000_000 - board.slots.slot_ns
        assert sum(board.slots.histogram) in (board.slots.count, board.slots.count - 1)
    assert [end.controller for end in counted["CSR"].can] == [1, 2, 3, 4]
    assert [end.controller for name in ("MCH", "MCFI", "UI") for end in counted[name].can] == [1, 2, 2]
    assert counted["CSR"].router.routed > 0
    assert counted["MB"].link.segments_sent > 0


def test_counters_are_the_same_after_their_way_through_json(counted):
    for board in counted.values():
        assert from_dict(RangerCounters, json.loads(json.dumps(as_dict(board)))) == board


@pytest.mark.parametrize("part", ["slots", "link", "router"])
def test_a_counter_that_is_missing_or_has_another_name_is_refused(counted, part):
    found = as_dict(counted["CSR"])
    count = found[part].popitem()
    with pytest.raises(TypeError, match=count[0]):
        from_dict(RangerCounters, found)
    found[part]["renamed"] = count[1]
    with pytest.raises(TypeError, match="renamed"):
        from_dict(RangerCounters, found)
