"""Faults that make every counter of the summary, every failed board and every error count: each against its cause.

The robot stands on its stand until it is let go at 1.5 s, so these runs are short; two walk, in order to fall.
"""

import contextlib
import csv
import pathlib

import numpy as np
import pytest

from ranger_sim.foundation.events import FLAG_ERROR
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario, StopRule

MASTER = pathlib.Path(__file__).resolve().parents[2] / "datatable" / "master"
BUSES = ("can1", "can2", "can3", "can4")
BUS_OF = {"MCH": "can1", "UI": "can2", "MCFO": "can3", "MCFI": "can4", "MCSI": "can4"}
BOARDS = (*BUS_OF, "CSR", "MB")
# A function that every slot of the board runs, and the length of its slot.
TASKS = {
    "MCH": "hb_beat", "MCFO": "hb_beat", "MCFI": "hb_beat", "MCSI": "hb_beat",
    "UI": "beat", "CSR": "send_time", "MB": "parse_ssp",
}  # fmt: skip
SLOT_MS = {"MCH": 0.5, "MCFO": 0.5, "MCFI": 0.5, "MCSI": 0.5, "UI": 1.0, "CSR": 1.0, "MB": 2.0}
CYCLES = {name: 70_000 for name in BOARDS} | {"MB": 600_000}  # more than a slot has
HZ = {name: 60e6 for name in BOARDS} | {"MB": 208e6}


def table(name):
    with (MASTER / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


PUBLISHER = {int(row["id"]): row["publisher"] for row in table("variables.csv")}


class Run:
    """A run with faults [(place, mode, at, until, parameters)]: its summary, and the frames of each bus."""

    def __init__(self, faults, time_s, **options):
        with contextlib.closing(Ranger(Scenario(**options), log="full")) as robot:
            for place, mode, at, until, parameters in faults:
                robot.inject(place, mode, at, until, **parameters)
            robot.run(StopRule(time_s=time_s), time_s)
            self.summary = robot.summary()
            self.frames = robot.logbook.frames()

    def count(self, bus, since_s=0.0, by=None, error=False):
        """Frames, or error frames, on a bus since a time; `by`: what its publisher must fulfil."""
        kept = self.frames
        at = (kept["bus"] == BUSES.index(bus)) & (kept["time_ns"] >= since_s * 1e9)
        at &= ((kept["flags"] & FLAG_ERROR) != 0) == error
        if by is None:
            return int(np.count_nonzero(at))
        return sum(by(PUBLISHER[number]) for number in kept["identifier"][at].tolist())


# --- boards ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module", params=BOARDS)
def hung(request):
    """A board whose program hangs in one function from 40 ms on, for 160 ms: in its place no slot is finished."""
    faults = [(f"{request.param}.processor", "stall", "40 ms", None, {"task": TASKS[request.param], "ms": 1000.0})]
    return request.param, Run(faults, 0.2)


def test_each_board_that_hangs_is_named_and_no_other(hung):
    board, run = hung
    assert run.summary["failed_boards"] == [board]


def test_frames_that_a_board_never_got_are_lost_once_each(hung):
    """A full ring of 63 is not read any more; later frames are lost, but for one in each buffer."""
    board, run = hung
    lost = {bus: run.summary["can"][bus]["lost"] for bus in BUSES}
    if board == "MB":  # behind its link
        assert lost == dict.fromkeys(BUSES, 0)
    elif board == "CSR":
        sent = sum(run.count(bus, 0.041, lambda publisher: publisher in BUS_OF) for bus in BUSES)
        assert sent - 63 - 8 <= sum(lost.values()) <= sent
        assert all(lost.values())
    else:
        bus = BUS_OF[board]
        sent = run.count(bus, 0.041, lambda publisher: publisher != board)
        assert max(0, sent - 63 - 8) <= lost[bus] <= sent
        assert all(lost[other] == 0 for other in BUSES if other != bus)


def test_each_board_that_takes_too_long_overruns_its_slots(late):
    for board in BOARDS:
        kept = late.summary["slots"][board]
        assert kept["overruns"] == pytest.approx(20.0 / SLOT_MS[board], abs=1), board
        # each of these slots lasted as long as the function, in the board's own cycles, and its interrupts
        assert CYCLES[board] / HZ[board] * 1e6 < kept["max_execution_us"] < 3.0 * CYCLES[board] / HZ[board] * 1e6
    assert late.summary["failed_boards"] == []


@pytest.fixture(scope="module")
def late():
    """All boards take more than a slot for one function, for 20 ms."""
    slow = [
        (f"{board}.processor", "extra_cycles", "40 ms", "60 ms", {"task": TASKS[board], "cycles": CYCLES[board]})
        for board in BOARDS
    ]
    return Run(slow, 0.1)


def test_errors_of_every_board_are_reported(late):
    for board in BOARDS:  # an unfinished schedule is an error of the board itself, and told once for each
        assert late.summary["errors"][board]["ASCHED_DNF"] == late.summary["slots"][board]["overruns"]


def test_every_error_of_the_table_is_reported_by_its_name():
    rows = [(int(row["id"]), row["name"], row["boards"].split(";")) for row in table("errors.csv")]
    with contextlib.closing(Ranger()) as robot:
        for number, _, boards in rows:
            for place, board in enumerate(boards, start=1):
                for _ in range(place):
                    robot.board(board).errors.report(number)
        reported = robot.summary()["errors"]
    for board in BOARDS:
        assert reported[board] == {name: boards.index(board) + 1 for _, name, boards in rows if board in boards}


def test_every_fault_is_reported_with_its_times(late):
    reported = late.summary["faults"]
    assert [fault["fault"].partition(":")[0] for fault in reported] == [f"{board}.processor" for board in BOARDS]
    for fault in reported:
        assert fault["armed_s"] == 0.0
        assert fault["activated_s"] == pytest.approx(0.040, abs=0.00025)
        assert fault["ended_s"] == pytest.approx(0.060, abs=0.00025)
        # it acts when its board comes to the function, in one of the next slots, and is clear when one was finished
        assert fault["activated_s"] <= fault["acted_s"] < 0.044 and 0.060 < fault["cleared_s"] < 0.075
        assert fault["acted"] is True and fault["acted_count"] > 0
        assert (fault["proof"], fault["permanent"]) == (None, None)


# --- buses ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module", params=BUSES)
def cut(request):
    """A bus of which every board but the router was cut off from 40 ms on, each for itself, for 160 ms."""
    boards = [board for board, bus in BUS_OF.items() if bus == request.param]
    return request.param, Run([(f"{board}.{request.param}", "cut", "40 ms", None, {}) for board in boards], 0.2)


def test_frames_that_no_queue_took_are_counted(cut):
    """No node acknowledges: two buffers and a ring of seven fill, then every frame is one too many."""
    bus, run = cut
    asked = {"CSR": {"can1": 3, "can2": 0, "can3": 3, "can4": 3}[bus] * 160 // 2}  # in each slot of the main brain
    for board in [board for board, name in BUS_OF.items() if name == bus]:  # as often as in the 30 ms before
        asked[board] = 160 / 30 * (run.count(bus, 0.010, lambda by, board=board: by == board))
    counted = {board: run.summary["errors"][board].get("CAN_TX_QUEUE_FULL", 0) for board in asked}
    for board, frames in asked.items():
        assert counted[board] == pytest.approx(max(0, frames - 9), rel=0.08, abs=3), board
    reported = {name: run.summary["can"][name]["queue_full"] for name in BUSES}
    assert reported == dict.fromkeys(BUSES, 0) | {bus: sum(counted.values())}


def test_time_stamps_that_could_not_go_out_are_counted(cut):
    bus, run = cut
    reported = {name: run.summary["can"][name]["single_shot_skipped"] for name in BUSES}
    # one a millisecond, and the one that is on its way when the cable is cut
    assert reported == dict.fromkeys(BUSES, 0) | {bus: pytest.approx(160, abs=1)}


def test_error_frames_are_those_in_the_log(cut):
    bus, run = cut
    reported = {name: run.summary["can"][name]["errors"] for name in BUSES}
    assert reported == {name: run.count(name, error=True) for name in BUSES}
    assert reported[bus] > 1000 and sum(reported.values()) == reported[bus]
    frames = {name: run.summary["can"][name]["frames"] for name in BUSES}
    assert frames == {name: run.count(name) for name in BUSES}


def test_a_frame_whose_sender_falls_off_the_bus_is_lost():
    run = Run([("MCH.can1", "bus_off", "40 ms", None, {})], 0.1)
    reported = {name: run.summary["can"][name]["lost"] for name in BUSES}
    # the frame that drove it off, and one more where the second buffer was filled
    assert reported["can1"] in (1, 2) and sum(reported.values()) == reported["can1"]


# --- the body -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("force", "cause"), [(300.0, "fell forward"), (-300.0, "fell backward")])
def test_a_fall_is_reported_with_its_cause(force, cause):
    run = Run([("world.robot", "push", "2 s", None, {"force": force, "length_ms": 300.0})], 10.0)
    assert run.summary["fell"] is True and run.summary["fall_cause"] == cause
    assert 2.0 < run.summary["time_s"] < 5.0
    assert run.summary["failed_boards"] == []
