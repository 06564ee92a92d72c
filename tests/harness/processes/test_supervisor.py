"""The supervisor alone: what it does with news, without the processes of a robot."""

import contextlib
import dataclasses
import json
import os

import pytest

from ranger_sim.harness.processes import supervisor
from ranger_sim.harness.processes.settings import Settings
from ranger_sim.harness.processes.supervisor import Supervisor, View
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import StopRule
from tests.harness.processes.child import Child, fork


class Said(View):
    """Everything that was reported."""

    def __init__(self):
        self.lines = []

    def say(self, text):
        self.lines.append(text)


@pytest.fixture
def alone():
    """A supervisor that has started nothing."""
    with contextlib.closing(Ranger()) as robot:
        settings = Settings(None, name=f"test-{os.getpid()}", real_time=False)
        with contextlib.closing(Supervisor(robot, settings, StopRule(time_s=1.0), lambda *_: 0, Said())) as made:
            yield made


def test_orders_to_a_plant_that_does_not_listen_are_not_waited_for(alone):
    """A process that waited would notice neither that it hangs nor Ctrl-C."""

    def order():
        for number in range(5000):
            alone.order({"do": "pause", "number": number})
        return 0

    with Child(alone.blocks["MCH"], order) as child:
        assert child.ended().si_status == 0


def test_a_board_that_ended_by_order_is_not_reported_even_when_it_is_found_first(alone):
    """The plant's process has reported that it collects, and no process has read since."""

    def find():
        process = fork(lambda: 0)
        os.waitid(os.P_PID, process, os.WEXITED | os.WNOWAIT)
        alone.children["MCH"] = supervisor.Child("MCH", process)
        alone.plant_link.send(json.dumps({"collecting": True}).encode())
        alone.reap()
        return len(alone.view.lines) + (alone.children["MCH"].state != supervisor.GONE)

    with Child(alone.blocks["MCH"], find) as child:  # which has no children but its own
        assert child.ended().si_status == 0


def test_a_board_that_ends_again_and_again_is_restarted_five_times(alone, monkeypatch):
    alone.settings = dataclasses.replace(alone.settings, restart=supervisor.ON_FAILURE)
    made_room = []
    monkeypatch.setattr(alone, "make_room", made_room.append)
    child = supervisor.Child("MCH", 0)
    for _ in range(7):
        child.state = supervisor.RUNNING
        alone.ended(child, 1)
    assert made_room == [child] * 5
    assert [line for line in alone.view.lines if "ended 6 times: not restarted any more" in line]
