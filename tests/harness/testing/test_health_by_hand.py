"""What a health check makes of counts: a machine made by hand, whose every number the test sets."""

from types import SimpleNamespace as Made

import pytest

from ranger_sim.can_bus.node import BUS_OFF
from ranger_sim.harness import normal_errors
from ranger_sim.harness.names import Names
from ranger_sim.harness.records import vital_signs
from ranger_sim.harness.testing.health import Expected, Health, amount, excused, since

MS = 1_000_000
SPIKE, LATE, OFF, SLOT = 1, 2, 3, 4


class Robot:
    """Boards A and B on can1 and can2; an error is normal on A twice a second, one once after power-up on B."""

    def __init__(self, time_ms=5000):
        self.names = Names.__new__(Names)
        for name, value in {
            "errors": {SPIKE: "SPIKE", LATE: "LATE", OFF: "CAN1_TX_BUSOFF", SLOT: "ASCHED_DNF"},
            "codes": {"SPIKE": SPIKE, "LATE": LATE, "CAN1_TX_BUSOFF": OFF, "ASCHED_DNF": SLOT},
            "normal_per_s": {SPIKE: {"A": 2.0}},
            "normal_at_start": {LATE: {"B": 3.0}},
            "descriptions": {SPIKE: "a spike"},
        }.items():
            object.__setattr__(self.names, name, value)
        self.start_ns = 1000 * MS
        self.deaths = []
        self.loop = Made(time=self.start_ns + time_ms * MS)
        self.totals = {"A": [0] * 5, "B": [0] * 5}
        self.slots = {
            name: Made(overruns=0, finished_ns=self.loop.time, slot_ns=500_000, max_cycles=0) for name in self.totals
        }
        self.ends = {name: self.end(place) for place, name in enumerate(self.totals)}
        self.boards = self.totals
        self.buses = [self.bus("can1"), self.bus("can2")]
        self.wiring = Made(can=[Made(bus=1, board="A", controller=0), Made(bus=2, board="B", controller=1)])
        self.polled, self.faults = [], []
        self.ended, self.end_word, self.end_name, self.time_s = "", "fell", "fall", 5.0

    @staticmethod
    def end(controller):
        return Made(controller=controller, data_overruns=0, receive_lost=0, queue_full=0, skipped=0)

    @staticmethod
    def bus(name):
        counters = Made(frames=7, lost=0, errors=0, single_shot_skipped=0)
        nodes = [Made(name=board, flushed=0, mode=0) for board in "AB"]
        return Made(
            name=name, counters=counters, nodes=nodes, load_mean=lambda now: now * 1e-12, load=Made(largest=lambda: 0.5)
        )

    def whereabouts(self):
        return ", here"

    def counters(self):
        return {
            name: Made(errors=list(totals), slots=Made(**vars(self.slots[name])), can=[self.ends[name]])
            for name, totals in self.totals.items()
        }

    def passes(self, ms):
        self.loop.time += ms * MS
        for each in self.slots.values():
            each.finished_ns = self.loop.time


@pytest.mark.parametrize(
    ("code", "board", "passed_s", "from_power_up", "most"),
    [
        (SPIKE, "A", 3.0, False, 8.0),
        (SPIKE, "A", 0.0, True, 2.0),
        (SPIKE, "B", 3.0, True, 0.0),
        (LATE, "B", 3.0, True, 3.0),
        (LATE, "B", 3.0, False, 0.0),
        (LATE, "A", 3.0, True, 0.0),
    ],
)
def test_normal_errors_allow_for_one_second_more_than_has_passed(code, board, passed_s, from_power_up, most):
    assert normal_errors.most_normal(Robot().names, board, code, passed_s, from_power_up) == most


def test_errors_beyond_the_normal_of_a_whole_walk_are_reported_by_board():
    errors = {"A": {"SPIKE": 8, "LATE": 1}, "B": {"LATE": 3}, "C": {}}
    assert normal_errors.beyond(Robot().names, errors, 3.0) == {"A": {"LATE": 1}}
    assert normal_errors.beyond(Robot().names, {"A": {"SPIKE": 9}, "B": {"LATE": 4}}, 3.0) == {
        "A": {"SPIKE": 9},
        "B": {"LATE": 4},
    }


def test_errors_are_counted_since_the_last_check_and_reported_above_the_normal():
    robot = Robot()
    robot.totals["A"][SPIKE] = 1000
    health = Health(robot)
    robot.passes(2000)
    robot.totals["A"][SPIKE] += 6
    assert health.faults() == []
    robot.passes(2000)
    robot.totals["A"][SPIKE] += 7
    robot.totals["B"][LATE] += 1
    assert health.faults() == [
        "A: 7 x SPIKE (a spike) in 2.000 s, normal is up to 2 a second",
        "B: 1 x LATE () in 2.000 s, normal is none",
    ]
    assert health.faults() == []


def test_from_power_up_on_all_counts_and_what_comes_once_is_normal():
    robot = Robot()
    robot.totals["A"][SPIKE], robot.totals["B"][LATE] = 12, 3
    assert Health(robot, from_power_up=True).faults() == []
    robot.totals["A"][SPIKE], robot.totals["B"][LATE] = 13, 4
    assert [each.partition(" (")[0] for each in Health(robot, from_power_up=True).faults()] == [
        "A: 13 x SPIKE",
        "B: 4 x LATE",
    ]
    assert Health(robot).faults() == []
    young = Robot(time_ms=0)
    young.totals["B"][LATE] = 3
    assert Health(young).faults() == []
    young.totals["B"][LATE] = 4
    assert len(Health(young).faults()) == 1


def test_errors_that_a_test_expects_are_wanted_by_name_and_by_board():
    robot = Robot()
    health = Health(robot)
    robot.totals["B"][SPIKE] = 5
    assert health.faults(Expected(errors=("SPIKE",))) == []
    robot.totals["B"][SPIKE] += 5
    assert health.faults(Expected(errors=("B:SPIKE",))) == []
    robot.totals["B"][SPIKE] += 5
    reported = health.faults(Expected(errors=("A:SPIKE", "LATE")))
    assert reported[0].startswith("B: 5 x SPIKE")
    assert reported[1:] == ["expected and not seen: error A:SPIKE", "expected and not seen: error LATE"]


def test_every_count_of_buses_and_boards_is_reported_with_its_place():
    robot = Robot()
    health = Health(robot)
    robot.slots["B"].overruns = 2
    robot.ends["A"].queue_full, robot.ends["A"].data_overruns, robot.ends["A"].receive_lost = 1, 2, 4
    robot.buses[1].counters.lost, robot.buses[0].counters.errors = 8, 3
    robot.buses[0].nodes[1].flushed, robot.buses[1].nodes[1].flushed = 1, 2
    robot.buses[0].nodes[0].mode = BUS_OFF
    robot.slots["A"].finished_ns = robot.loop.time - 20 * 500_000
    assert health.faults() == [
        "slot overruns: B 2",
        "lost frames: can1 7, can2 8",
        "error frames: can1 3",
        "bus-off: A 1, B 3",
        "boards that do not run: A 1",
    ]
    robot.passes(1)
    robot.totals["B"][OFF] = 2
    robot.polled = [
        Made(name="can2", overflow=True, counters=lambda: {"overflow": 4}, errors=5),
        Made(watch=Made(faults=0, lines=lambda: ["never"])),
        Made(watch=Made(faults=1, lines=lambda: ["late", "later"])),
    ]
    assert health.faults(Expected(bus_off=True)) == ["late", "later"]
    robot.buses[0].nodes[0].mode = 0
    robot.totals["B"][OFF] += 2
    robot.polled = []
    assert [each for each in health.faults() if each.startswith("bus-off")] == ["bus-off: B 2"]


def test_a_fall_is_reported_once_and_expected_ones_must_come():
    robot = Robot()
    health = Health(robot)
    assert health.faults(Expected(fall=True)) == ["expected and not seen: fall"]
    robot.ended = "forward"
    assert health.faults() == ["fell (forward) at 5.000 s, here"]
    assert health.faults() == [] and Health(robot).faults() == []
    assert Health(robot, from_power_up=True).faults(Expected(fall=True)) == []


def test_a_fault_that_did_not_act_is_reported_unless_it_was_called_off():
    robot = Robot()

    def fault(**more):
        whole = {"acted": False, "stop_wanted": False, "activated_ns": 5, "place": Made(name="A.x"), "mode": "cut"}
        return Made(**{**whole, **more})

    robot.faults = [fault()]
    health = Health(robot)
    robot.faults += [fault(), fault(), fault(acted=True), fault(stop_wanted=True, activated_ns=-1)]
    robot.faults += [fault(stop_wanted=True, activated_ns=0, mode="short"), fault(activated_ns=-1, mode="open")]
    assert health.faults() == ["injected faults that did not act: A.x:cut 2, A.x:short 1, A.x:open 1"]
    assert health.faults() == []
    assert len(Health(robot, from_power_up=True).faults(Expected(idle_faults=5))) == 0


@pytest.mark.parametrize(
    ("expected", "board", "name", "whether"),
    [
        (Expected(), "A", "ASCHED_DNF", False),
        (Expected(overruns=True), "A", "ASCHED_DNF", True),
        (Expected(overruns=3), "A", "SCHED_TASK_LIMIT", True),
        (Expected(overruns="A"), "A", "SCHED_SLOT_NEAR_LIMIT", True),
        (Expected(overruns="B"), "A", "ASCHED_DNF", False),
        (Expected(overruns=True), "A", "SPIKE", False),
        (Expected(bus_off=True), "A", "CAN1_ANYTHING", True),
        (Expected(bus_off=True), "A", "SPIKE", False),
        (Expected(bus_errors=True), "A", "CAN2_ERR_PASS", True),
        (Expected(bus_errors=True), "A", "CAN2_ANYTHING", False),
        (Expected(lost_frames=True), "A", "CAN2_ERR_PASS", False),
    ],
)
def test_errors_that_follow_from_what_is_expected_are_excused(expected, board, name, whether):
    assert excused(expected, board, name) is whether


def test_amounts_are_reported_with_those_expected():
    assert amount("x", 2, {"a": 1}) == ["x: a 1, expected are 2"] and amount("x", 2, {}) == ["x: none, expected are 2"]
    assert amount("x", "a", {"b": 1}) == ["expected and not seen: x of a", "x: b 1, expected only of a"]
    assert amount("x", "a", {"a": 0}) == ["expected and not seen: x of a"]
    assert amount("x", 0, {"a": 0}) == [] and amount("x", True, {}) == ["expected and not seen: x"]
    assert since({"a": 5, "b": 2}, {"a": 3, "c": 9}) == {"a": 2, "b": 2}


def test_the_traffic_of_a_bus_is_that_of_its_own_ends():
    robot = Robot()
    robot.ends["A"].data_overruns, robot.ends["A"].receive_lost, robot.ends["A"].queue_full = 1, 2, 4
    robot.ends["A"].skipped, robot.ends["B"].queue_full = 8, 16
    counters = robot.buses[0].counters
    counters.lost, counters.single_shot_skipped, counters.errors = 32, 64, 128
    assert vital_signs.can(robot, robot.buses[0], robot.counters()) == {
        "frames": 7,
        "load_mean": robot.loop.time * 1e-12,
        "load_max": 0.5,
        "lost": 32 + 1 + 2,
        "queue_full": 4,
        "single_shot_skipped": 64 + 8,
        "errors": 128,
    }


@pytest.mark.parametrize(
    ("time_ms", "silent_ns", "alive"),
    [
        (19.999999, 19_999_999, True),
        (20, 9_999_999, True),
        (20, 10_000_000, False),
        (500, 10_000_000, False),
        (500, 0, True),
    ],
)
def test_a_board_hangs_when_it_finished_no_slot_for_twenty(time_ms, silent_ns, alive):
    start = 1000 * MS
    machine = Made(loop=Made(time=start + round(time_ms * MS)), start_ns=start)
    board = Made(slots=Made(finished_ns=machine.loop.time - silent_ns, slot_ns=500_000))
    assert vital_signs.alive(machine, board) is alive
