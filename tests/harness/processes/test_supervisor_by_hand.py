"""What the supervisor says and does, piece by piece, with clocks, kernels and children made by hand."""

import contextlib
import json
import os
import signal
import sys
from types import SimpleNamespace as Made

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes import guard, kernel, places, supervisor
from ranger_sim.harness.processes.guard import MOST_SLICES
from ranger_sim.harness.processes.settings import Settings
from ranger_sim.harness.processes.supervisor import GONE, HANG_S, PLANT, RESTARTING, RUNNING, STOPPED, Child, Supervisor
from ranger_sim.harness.stop_rule import StopRule
from ranger_sim.ranger.requests import Request
from ranger_sim.ranger.robot import Ranger


class Said(supervisor.View):
    """Everything that was reported and shown."""

    def __init__(self):
        self.lines, self.shown = [], []

    def say(self, text):
        self.lines.append(text)

    def show(self, state):
        self.shown.append(state)

    def received(self):
        """What was reported since the last call."""
        lines, self.lines = self.lines, []
        return lines


@pytest.fixture(scope="module")
def robot():
    with contextlib.closing(Ranger()) as made:
        yield made


@pytest.fixture
def alone(robot, monkeypatch):
    """A supervisor that has started nothing. `clock`, `kernel`: what they return for time and processes; `killed`."""
    settings = Settings(None, name=f"by-hand-{os.getpid()}", real_time=False)
    with contextlib.closing(Supervisor(robot, settings, StopRule(time_s=1.0), lambda *_: 0, Said())) as made:
        made.clock = Made(now=100.0)
        made.states, made.used, made.slices, made.killed, made.answers = {}, {}, {}, [], []
        monkeypatch.setattr(supervisor, "wallclock", Made(monotonic_s=lambda: made.clock.now))
        listed = Made(
            EVENTFD=kernel.EVENTFD,
            state_of=lambda process: made.states.get(process, "S"),
            processor_time_s=lambda process: made.used.get(process, 0.0),
            slices_of=lambda process: made.slices.get(process, 0),
            open_files=lambda process: [kernel.EVENTFD],
            waiting_in=lambda process: " (pause)",
        )
        for module in (supervisor, guard):
            monkeypatch.setattr(module, "kernel", listed)
        monkeypatch.setattr(supervisor.os, "kill", lambda *what: made.killed.append(what))
        monkeypatch.setattr(made.control, "answer", lambda *what: made.answers.append(what))
        yield made


def awaits(alone, name="MCH"):
    """The plant's process waits for an answer of the board."""
    block = alone.blocks[name]
    block.words[places.ASKED], block.words[places.ANSWERED] = 7, 6
    block.private[places.AWAITED], block.private[places.WAITS] = 1, 7
    return block


def plants(alone):
    """Orders that the plant's process has been given."""
    found = []
    with contextlib.suppress(BlockingIOError):
        while True:
            found.append(json.loads(alone.plant_link.recv(1 << 16, 0x40)))
    return found


def tells(alone, **news):
    alone.plant_link.send(json.dumps(news).encode())
    alone.receive_from_plant()


# ---- boards that hang


def test_a_board_that_keeps_its_turn_too_long_is_killed_and_reported(alone):
    alone.children["MCH"] = Child("MCH", 41)
    awaits(alone)
    alone.used[41] = 3.0
    alone.check()
    alone.clock.now += HANG_S - 0.001
    alone.check()
    assert alone.killed == [] and alone.view.received() == []
    alone.clock.now += 0.001
    alone.used[41] = 4.25
    alone.check()
    assert alone.killed == [(41, signal.SIGKILL)]
    assert alone.view.received() == [
        f"MCH (process 41) hangs: no answer for {HANG_S:g} s, 1.2 s of them computing; it is killed"
    ]
    alone.clock.now += HANG_S / 2
    alone.check()
    assert len(alone.killed) == 1  # it is given its time anew
    assert alone.children["MCH"].was_asked


def stopped(alone, name="MCH", process=41):
    """A child that is stopped while its reply is awaited."""
    child = alone.children[name] = Child(name, process, state=STOPPED)
    if name != PLANT:
        awaits(alone, name)
    return child


def pass_time(alone, seconds):
    """Let time pass, with a poll every fifth of a second; the first one has nothing to count."""
    alone.check()
    for _ in range(round(seconds / 0.2)):
        alone.clock.now += 0.2
        alone.check()


def test_a_board_that_stays_stopped_ends_the_run_after_ten_seconds(alone):
    alone.check()
    stopped(alone)
    pass_time(alone, 9.8)
    assert alone.killed == [] and plants(alone) == []
    pass_time(alone, 0.4)
    assert alone.killed == [(41, signal.SIGKILL)]
    assert plants(alone) == [{"do": "stop", "lost": "MCH"}]
    assert alone.view.received() == [
        "MCH (process 41) is stopped and has not replied for 10 s: it is killed, and the run ends"
    ]
    assert alone.blocks["MCH"].fault() == "its process was stopped (SIGSTOP) for 10 s"
    alone.settings = Settings(None, restart="on-failure")
    alone.ended(alone.children["MCH"], -9)
    assert plants(alone) == []  # it is not restarted: the run ends


def test_the_body_that_stays_stopped_ends_the_run_as_well(alone):
    alone.check()
    stopped(alone, PLANT, 42)
    pass_time(alone, 10.2)
    assert alone.killed == [(42, signal.SIGKILL)]
    alone.ended(alone.children[PLANT], -9)
    assert alone.exit_code == 2


def test_a_suspended_machine_counts_as_one_second_of_a_stop(alone):
    alone.check()
    stopped(alone)
    alone.clock.now += 3600.0
    alone.check()
    pass_time(alone, 8.8)
    assert alone.killed == []


def test_a_stopped_board_that_owes_no_reply_or_goes_on_does_not_end_the_run(alone):
    alone.check()
    child = stopped(alone)
    pass_time(alone, 9.0)
    child.state = RUNNING
    alone.check()
    child.state = STOPPED
    pass_time(alone, 9.0)
    alone.blocks["MCH"].private[places.AWAITED] = 0  # the robot is paused
    pass_time(alone, 60.0)
    assert alone.killed == []


@pytest.mark.parametrize(
    ("change", "killed"),
    [
        ({}, True),
        ({"answered": 7}, True),  # its memory: the program may have written it
        ({"awaited": 0}, False),
        ({"waits": 8}, False),
        ({"state": STOPPED}, False),
        ({"kernel": "T"}, False),
        ({"kernel": "t"}, False),
        ({"kernel": "Z"}, False),
        ({"kernel": ""}, False),
        ({"kernel": "R"}, False),  # it would like to run, and has not had the processor
        ({"kernel": "R", "used": HANG_S / 2}, True),
        ({"kernel": "R", "used": HANG_S / 2 - 0.01}, False),
        ({"kernel": "R", "slices": MOST_SLICES - 1}, False),
        ({"kernel": "R", "slices": MOST_SLICES}, True),  # it has, again and again, and gave it away
        ({"plant": "R"}, False),  # the one that waits has not had the processor
        ({"held": 1}, False),
    ],
)
def test_a_board_hangs_only_when_it_has_its_turn_and_could_run(alone, change, killed):
    child = alone.children["MCH"] = Child("MCH", 41)
    alone.children[PLANT] = Child(PLANT, 50)
    block = awaits(alone)
    words = block.words
    alone.check()
    block.private[places.AWAITED], block.private[places.WAITS] = change.get("awaited", 1), change.get("waits", 7)
    words[places.ANSWERED] = change.get("answered", 6)
    words[places.HELD] = change.get("held", 0)
    alone.states[50] = change.get("plant", "S")
    alone.slices[41] = change.get("slices", 0)
    child.state = change.get("state", RUNNING)
    alone.states[41], alone.used[41] = change.get("kernel", "S"), change.get("used", 0.0)
    alone.clock.now += HANG_S
    alone.check()
    assert bool(alone.killed) is killed


def test_a_board_that_a_debugger_holds_is_reported_once_each_time(alone):
    words = alone.blocks["MCH"].words
    words[places.HELD] = 1
    assert alone.is_held("MCH", words) and alone.is_held("MCH", words)
    assert alone.view.received() == ["MCH is held by its debugger, or waits for it: all wait"]
    words[places.HELD] = 0
    assert not alone.is_held("MCH", words)
    words[places.HELD] = 1
    assert alone.is_held("MCH", words) and len(alone.view.received()) == 1


def test_a_plant_without_progress_is_named_once_until_it_goes_on(alone):
    plant = alone.children[PLANT] = Child(PLANT, 50, turn=0)
    alone.stage.written[0][places.HEARTBEAT_NS] = 5
    alone.check()
    alone.clock.now += HANG_S
    alone.check()
    assert alone.view.received() == []
    alone.clock.now += 0.5
    alone.states[50] = "T"
    alone.check()
    assert alone.view.received() == []
    alone.states[50] = "S"
    alone.check()
    alone.clock.now += 5
    alone.check()
    assert alone.view.received() == [f"{PLANT} (process 50) hangs: no progress for {HANG_S + 0.5:.1f} s"]
    alone.stage.written[0][places.HEARTBEAT_NS] = 6
    alone.check()
    assert plant.turn == 0
    alone.clock.now += HANG_S + 0.1
    alone.blocks["MCH"].private[places.AWAITED] = 1  # a board keeps it waiting
    alone.check()
    assert alone.view.received() == []
    alone.blocks["MCH"].private[places.AWAITED] = 0
    alone.clock.now += HANG_S + 0.1
    alone.check()
    assert len(alone.view.received()) == 1
    assert alone.view.shown[-1]["plant"] == 50
    alone.ending = True
    shown = len(alone.view.shown)
    alone.clock.now += 99
    alone.check()
    assert alone.view.received() == [] and len(alone.view.shown) == shown


# ---- children that end


@pytest.mark.parametrize(
    ("code", "reported"),
    [(-9, "MCH (process 41) was killed by signal 9"), (3, "MCH (process 41) ended with code 3: broken")],
)
def test_a_board_that_ended_is_reported_with_its_reason_and_waited_for_no_longer(alone, code, reported):
    child = alone.children["MCH"] = Child("MCH", 41)
    if code > 0:
        alone.blocks["MCH"].leave_fault("broken")
    alone.ended(child, code)
    assert alone.view.received() == [reported] and child.state == GONE
    assert alone.blocks["MCH"].private[places.FATE] == places.GONE and plants(alone) == []
    assert os.eventfd_read(alone.blocks["MCH"].answer_descriptor) == 1


def test_a_board_to_be_restarted_gets_its_place_and_then_its_process(alone, monkeypatch):
    child = alone.children["MCH"] = Child("MCH", 41, state=RESTARTING)
    alone.ended(child, -9)
    assert child.state == RESTARTING and alone.view.received() == []
    assert plants(alone) == [{"do": "make_room", "board": "MCH", "number": "restart MCH"}]
    started = []
    monkeypatch.setattr(alone, "start_board", lambda name, fresh: started.append((name, fresh)))
    tells(alone, answer="restart MCH", time_s=1.25)
    assert started == [("MCH", True)] and plants(alone) == [{"do": "revive", "board": "MCH"}]
    assert alone.view.received() == ["MCH restarted at 1.250 s of the robot's time"]


def test_a_board_that_ends_while_the_run_does_is_not_restarted(alone):
    for change in ({"ending": True}, {"interrupts": 1}):
        for name, value in {"ending": False, "interrupts": 0, **change}.items():
            setattr(alone, name, value)
        alone.ended(Child("MCH", 41, state=RESTARTING), 1)
        assert plants(alone) == []
    alone.ending = True
    alone.view.received()
    alone.ended(Child("MCH", 41), 0)
    assert alone.view.received() == []
    alone.ended(Child("MCH", 41), 2)
    assert alone.view.received() == ["MCH (process 41) ended with code 2"]


@pytest.mark.parametrize(
    ("ending", "code", "exit_code", "reported"),
    [
        (True, 0, 0, ""),
        (True, 3, 3, ""),
        (True, -9, 2, "was killed by signal 9"),
        (False, 0, 2, "ended with code 0"),
        (False, 2, 2, "ended with code 2"),
    ],
)
def test_the_end_of_the_plant_is_that_of_the_run(alone, ending, code, exit_code, reported):
    alone.ending = ending
    alone.ended(Child(PLANT, 50), code)
    assert alone.exit_code == exit_code
    lines = [f"{PLANT} (process 50) {reported}: the run is lost, no files are finished"] if reported else []
    assert alone.view.received() == lines


# ---- news, orders and requests


def test_news_of_the_plant_are_kept_printed_and_answered(alone):
    tells(alone, status={"time_s": 3.0, "damaged": {"MCH": 2}})
    assert alone.status == {"time_s": 3.0, "damaged": {"MCH": 2}}
    tells(alone, gone="MCH", time_s=2.5)
    assert alone.view.received() == ["MCH is off its bus since 2.500 s of the robot's time"]
    tells(alone, answer=7, time_s=2.0)
    tells(alone, answer=0, time_s=2.5)
    tells(alone, answer=8, error="no")
    assert alone.answers == [(7, {"time_s": 2.0}), (0, {"time_s": 2.5}), (8, {"error": "no"})]
    assert not alone.ending
    tells(alone, collecting=True)
    assert alone.ending and alone.failure == ""
    alone.ending = False
    tells(alone, failed="the port")
    assert alone.ending and alone.failure == "the port"
    alone.ending = False
    tells(alone, over=True)
    assert plants(alone) == [{"do": "finish"}]


def test_one_interrupt_stops_and_lets_go_and_two_break_off(alone):
    alone.children = {"MCH": Child("MCH", 41), "MB": Child("MB", 42, state=STOPPED)}
    alone.interrupt()
    assert plants(alone) == [{"do": "stop"}] and alone.exit_code is None
    assert all(block.words[places.LET_GO] == 1 for block in alone.blocks.values())
    assert alone.killed == [(42, signal.SIGCONT)]
    alone.interrupt()
    assert alone.exit_code == 130 and alone.view.received() == ["broken off: no files are finished"]
    assert plants(alone) == []


def test_a_request_is_answered_or_passed_on(alone):
    alone.obey(1, Request("status"))
    assert alone.answers.pop() == (1, alone.state())
    alone.obey(2, Request("pause"))
    [order] = plants(alone)
    assert (order["do"], order["number"]) == ("pause", 2) and alone.answers == []
    alone.children = {"MCH": Child("MCH", 41, state=STOPPED), "MB": Child("MB", 42, state=STOPPED)}
    alone.obey(3, Request("pause"))
    assert alone.answers.pop() == (3, {"error": "MCH, MB is stopped: all wait for it"}) and plants(alone) == []
    alone.children = {}
    alone.plant_link.close()
    alone.obey(4, Request("pause"))
    assert alone.answers.pop() == (4, {"error": "pause: the body's process takes no orders now"})


def test_a_restart_ends_what_runs_and_is_refused_where_nothing_is(alone):
    alone.restart(1, "MCH")
    assert alone.answers.pop() == (1, {"error": "restart: MCH has no process here"})
    child = alone.children["MCH"] = Child("MCH", 41)
    alone.obey(2, Request("restart", board="MCH"))
    assert alone.killed == [(41, signal.SIGKILL)] and child.state == RESTARTING
    assert alone.answers.pop() == (2, {"restarting": "MCH"})
    alone.restart(3, "MCH")
    assert alone.answers.pop() == (3, {"error": "restart: MCH is being restarted already"}) and len(alone.killed) == 1
    child.state = GONE
    alone.restart(4, "MCH")
    assert plants(alone)[0]["do"] == "make_room" and len(alone.killed) == 1 and child.state == RESTARTING


def test_a_client_that_is_sent_away_is_reported_once_for_each_endpoint_and_reason(alone):
    reason, other = list(supervisor.REASONS)[:2]
    alone.status = {"sent_away": {"feed": {reason: 1}}}
    alone.report_disconnected()
    alone.status = {"sent_away": {"feed": {reason: 5, other: 1}}}
    alone.control.sent_away[reason] += 1
    alone.report_disconnected()
    alone.report_disconnected()
    assert alone.view.received() == [
        f"{door}: a client {supervisor.REASONS[why]}, and was sent away; others of this kind are counted"
        for door, why in (("feed", reason), ("feed", other), ("control", reason))
    ]


def test_the_state_has_every_board_with_its_counts(alone):
    words = alone.blocks["MCH"].words
    words[places.SLOT_COUNT], words[places.OVERRUNS], words[places.ERRORS], words[places.DAMAGED] = 10, 2, 3, 4
    words[places.MAX_SLOT_CYCLES] = 30_000
    alone.status = {"damaged": {"MCH": 5}, "time_s": 1.5}
    alone.children = {"MCH": Child("MCH", 41, state=STOPPED), PLANT: Child(PLANT, 50)}
    state = alone.state()
    found = dict(state["boards"]["MCH"])
    found.pop("lateness")
    assert found == {
        "state": STOPPED,
        "process": 41,
        "slots": 10,
        "overruns": 2,
        "max_slot_us": 30_000 * 1e6 / alone.robot.boards["MCH"].hz,
        "errors": 3,
        "damaged": 9,
    }
    assert (state["boards"]["MB"]["state"], state["boards"]["MB"]["process"]) == (supervisor.ELSEWHERE, 0)
    assert (state["plant"], state["time_s"], state["speed"]) == (50, 1.5, None)
    alone.children.clear()
    assert alone.state()["plant"] == 0
    assert alone.describe() == "as fast as it goes; ordinary scheduling, memory not locked (as asked for)"


def test_words_are_shown_as_many_as_a_board_has_and_elsewhere_than_linux_nothing_runs(monkeypatch):
    assert supervisor.words_shown(Made(memory=None)) == 0 and supervisor.words_shown(Made(memory=[1, 2])) == 2
    supervisor.check_platform()
    monkeypatch.setattr(sys, "platform", "darwin")
    with pytest.raises(UserError, match="need Linux"):
        supervisor.check_platform()
