"""What a chip's main loop does in addition to the scheduler."""

from ranger_sim.firmware_sim.activity import MAIN_LOOP_RAN
from ranger_sim.foundation.events import CAN_RX
from tests.firmware_sim.board import TICK_NS, Log, kept, rows_of


class Worker:
    """Works off a pile of jobs in the background, 30 us each; every frame adds one."""

    def __init__(self, jobs=0, **table):
        self.log = Log()
        self.chip = self.log.chip
        self.jobs = jobs
        self.turns = []
        self.chip.vic.attach(CAN_RX, 1, self.add, cost=60, slot=0, latency=0)
        self.chip.background = self.turn
        if table:
            self.log.start(**table)

    def add(self, queue):
        self.jobs += 1

    def turn(self):
        if self.jobs == 0:
            return self.chip.now
        self.jobs -= 1
        self.turns.append(self.chip.now)
        return self.chip.now + 30_000


def test_background_work_goes_on_until_none_is_left():
    worker = Worker(jobs=3)
    worker.chip.advance(1_000_000)
    assert worker.turns == [0, 30_000, 60_000]


def test_an_input_wakes_the_background_when_its_interrupt_is_over():
    worker = Worker()
    worker.chip.inbox.push(200_000, 0, CAN_RX, 1, 7)
    worker.chip.advance(1_000_000)
    assert worker.turns == [201_000]


def test_an_interrupt_lengthens_a_turn_of_the_background():
    worker = Worker(jobs=2)
    worker.chip.inbox.push(10_000, 0, CAN_RX, 1, 7)
    worker.chip.advance(1_000_000)
    assert worker.turns == [0, 31_000, 61_000]


def test_slots_go_first_but_wait_for_the_turn_in_progress():
    worker = Worker(jobs=3)
    worker.log.start(phase_ns=40_000, every=(worker.log.task("slot", 6_000),))
    worker.chip.advance(400_000)
    assert worker.turns == [0, 30_000, 60_000 + TICK_NS + 100_000]
    assert worker.log.times("slot") == [60_000 + TICK_NS]


def test_background_work_does_not_depend_on_the_steps_of_time():
    whole = Worker(jobs=5, every=(), phase_ns=25_000)
    whole.chip.advance(3_000_000)
    pieces = Worker(jobs=5, every=(), phase_ns=25_000)
    for until in range(7_000, 3_000_000, 7_000):
        pieces.chip.advance(until)
    assert pieces.turns == whole.turns
    assert len(whole.turns) == 5


def test_turns_that_follow_each_other_are_one_row_of_the_activity_in_whatever_steps_time_passes():
    def rows(step_ns):
        worker = Worker(jobs=3)
        activity = kept(worker.chip)
        worker.chip.inbox.push(100_000, 0, CAN_RX, 1, 7)  # behind the three turns: a gap
        for end in range(step_ns, 400_001, step_ns):
            worker.chip.advance(end)
        worker.chip.break_off(400_000)
        return [(row.start, row.end, row.cycles) for row in rows_of(activity) if row.kind == MAIN_LOOP_RAN]

    # 30 us of 60 cycles each; the frame's interrupt takes 1 us
    assert rows(400_000) == rows(10_000) == [(0, 90_000, 5400), (101_000, 131_000, 1800)]
