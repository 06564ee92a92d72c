"""Where the boards of a machine run: in its process, or each in its own. The machine is the servo of the examples."""

import contextlib
import os
import pathlib
import signal
import sys

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes.modes import InProcess, OwnProcesses
from tests.firmware_sim.native.support import COMPILER

SERVO = pathlib.Path(__file__).resolve().parents[3] / "examples" / "servo"
pytestmark = [
    pytest.mark.skipif(not COMPILER, reason="no C compiler is installed here"),
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="processes of boards need Linux"),
]


@pytest.fixture
def servo(monkeypatch):
    """Makes a servo whose boards run in a mode."""
    monkeypatch.syspath_prepend(SERVO)
    from servo import new

    with contextlib.ExitStack() as made:

        def servo(mode):
            machine = made.enter_context(contextlib.closing(new(seed=1)))
            machine.mode = mode
            return machine

        yield servo


@pytest.mark.parametrize("names", [(), ("CONTROL",)])
def test_a_machine_with_boards_in_their_own_processes_has_the_bytes_of_one_process(servo, names):
    found = []
    for mode in (InProcess(), OwnProcesses(names)):
        machine = servo(mode)
        machine.until("angle_rad > 0.2", within="1 s")
        found.append((machine.trace_digest(), machine.time_s, machine.counters()["DRIVE"].slots))
    assert found[0] == found[1]


def test_a_board_in_its_own_process_can_be_changed_until_time_passes(servo):
    machine = servo(OwnProcesses(("CONTROL",)))
    assert machine.board("CONTROL").name == "CONTROL"
    machine.run_for("1 ms")
    assert machine.board("DRIVE").name == "DRIVE"
    with pytest.raises(UserError, match="CONTROL runs in a separate process, its memory is out of reach"):
        machine.board("CONTROL")
    with pytest.raises(UserError, match="replace x of CONTROL: its process runs already; replace before time passes"):
        machine.replace("CONTROL", "x", lambda: None, cost=1)


def test_a_machine_goes_on_without_a_board_whose_process_ends_and_names_it(servo):
    machine = servo(OwnProcesses(("CONTROL",)))
    machine.run_for("20 ms")
    os.kill(machine.mode.forked.children["CONTROL"], signal.SIGKILL)
    machine.run_for("20 ms")
    (death,) = machine.deaths
    assert (death["board"], death["how"]) == ("CONTROL", "was killed by signal 9")
    assert machine.time_s == pytest.approx(0.04)
