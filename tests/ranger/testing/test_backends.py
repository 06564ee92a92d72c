"""The backends: the same robot by the same methods, and what one has not is reported by name."""

import contextlib
import os
import signal
from dataclasses import replace

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.testing.backends import BACKENDS, OFFERS, MissingError, missing
from ranger_sim.harness.testing.process_per_board import BoardLostError
from ranger_sim.ranger.testing.outside_robot import vcan_buses
from ranger_sim.ranger.testing.robots import assert_healthy, new_robot
from tests.ranger.testing.project import pytest_in, write

ON_VIRTUAL = """\
title = "can1 on python-can's own virtual interface"

[buses.can1]
interface = "virtual"
channel = "ranger-sim-test"
bit_rate = 1_000_000
schedule = "1mbit"
"""


def without_sent(counters):
    """A controller learns of the end of a transmission when it is asked: inside later than in a process."""
    return {name: replace(board, can=[replace(end, sent=0) for end in board.can]) for name, board in counters.items()}


def test_a_robot_of_processes_has_the_bytes_of_one_in_this_process_however_it_is_inspected():
    found = []
    for backend in ("sim", "processes"):
        with contextlib.closing(new_robot(seed=3, backend=backend)) as robot:
            robot.run_for(0.05)
            counters = robot.counters()
            robot.until("MCH_ANGLE > 0.2", within="10 ms")
            robot.until("error MC_NOT_RUNNING from MCSI", within="10 ms")
            robot.run_for(0.0731)
            robot.wire("can1").assert_period("MCH_ANGLE", "2 ms", jitter="100 us")
            assert_healthy(robot)
            digest, angle = robot.trace_digest(), robot.variable("MCH_ANGLE")
            found.append((digest, without_sent(counters), without_sent(robot.counters()), angle, robot.time_s))
    assert found[0] == found[1]


def test_state_in_another_process_is_reported_out_of_reach():
    with contextlib.closing(new_robot(backend="processes")) as robot:
        assert robot.board("MCH").name == "MCH"  # before time passes it is here
        robot.run_for(0.001)
        with pytest.raises(MissingError, match="backend processes has no board memory: MCH runs in a separate process"):
            robot.board("MCH")
        with pytest.raises(UserError, match="its process runs already; replace before time passes"):
            robot.replace("MCH", "mc_compliant_control", lambda: None, cost=1)


def test_a_fault_inside_a_board_is_refused_and_one_at_its_sensor_acts():
    with contextlib.closing(new_robot(seed=3, backend="processes")) as robot:
        with pytest.raises(UserError, match="MCH runs in a separate process; its converter is there"):
            robot.inject("MCH.adc_external", "gain", factor=1.1)
        fault = robot.inject("MCH.absolute_encoder", "offset", at="0.02 s")
        robot.run_for(0.06)
        assert fault.acted


def test_a_board_whose_process_dies_is_named_and_no_process_remains():
    with contextlib.closing(new_robot(backend="processes")) as robot:
        robot.run_for(0.005)
        processes = robot.processes
        mine = [processes.guard, *processes.children.values()]
        os.kill(processes.children["MCFI"], signal.SIGKILL)
        with pytest.raises(BoardLostError, match="^MCFI: its process was killed by signal 9 before 0.0"):
            robot.run_for(0.05)
        assert robot.lost
    for process in mine:
        with pytest.raises(ProcessLookupError):
            os.kill(process, 0)


def test_a_replaced_function_that_raises_says_what_and_where():
    with contextlib.closing(new_robot(backend="processes")) as robot:
        robot.replace("MCSI", "dn_update_pwm", lambda: 1 // 0, cost=100)
        with pytest.raises(BoardLostError, match=r"MCSI: .*code 4 .*ZeroDivisionError: .* \(test_backends.py:"):
            robot.run_for(0.01)


def test_time_on_interfaces_outside_is_released_by_the_wall_clock(tmp_path):
    from ranger_sim.foundation import wallclock

    profile = tmp_path / "virtual.toml"
    profile.write_text(ON_VIRTUAL, encoding="utf-8")
    # a tenth of real time: any machine on which the tests end at all keeps that pace, so 20 ms take 0.2 s
    with contextlib.closing(new_robot(seed=3, backend="hardware", profile=str(profile), speed=0.1)) as robot:
        begun = wallclock.monotonic_s()
        robot.until("0.02 s")
        assert wallclock.monotonic_s() - begun >= 0.19
        robot.wire("can1").period("MCH_ANGLE")
        assert robot.wire("can1").frames("TIMESTAMP")
        assert_healthy(robot)


def test_a_machine_without_vcan_names_what_it_lacks(monkeypatch):
    monkeypatch.setattr("ranger_sim.ranger.testing.outside_robot.Path.exists", lambda path: path.name == "vcan1")
    with pytest.raises(MissingError, match="backend vcan: this machine has no vcan0, vcan2, vcan3 .`python -m dev.vm"):
        vcan_buses()


def test_hardware_needs_a_profile_with_a_bus_outside(tmp_path):
    inside = tmp_path / "inside.toml"
    inside.write_text('title = "nothing outside"\n[buses.can1]\nbit_rate = 1_000_000\n', encoding="utf-8")
    with pytest.raises(UserError, match="backend hardware: it needs a profile: --ranger-profile my.toml"):
        new_robot(backend="hardware")
    with pytest.raises(UserError, match="backend hardware: the profile .* puts no bus on an interface"):
        new_robot(backend="hardware", profile=str(inside))
    with pytest.raises(UserError, match="backend is 'cloud', allowed are sim, processes, vcan, hardware"):
        new_robot(backend="cloud")


def test_what_is_required_is_what_some_backend_offers():
    assert missing("sim", ("board memory", "virtual time")) == ""
    assert missing("processes", ("board memory", "vcan")) == "backend processes has no board memory, vcan"
    assert all(backend in OFFERS[backend] for backend in BACKENDS)
    with pytest.raises(UserError, match="requires 'moon': what can be required is board memory, emulated bus,"):
        missing("sim", ("moon",))


def test_a_test_is_skipped_where_its_backend_lacks_what_it_needs(tmp_path):
    write(
        tmp_path,
        test_needs="""
import pytest

@pytest.mark.requires("vcan")
def test_of_vcan(ranger):
    pass

@pytest.mark.requires("board memory")
def test_looks_inside(ranger):
    ranger.run_for(0.001)
    assert ranger.board("MCH").scheduler.slot_count >= 0

def test_looks_inside_without_saying_so(ranger):
    ranger.run_for(0.001)
    assert ranger.board("MCH").scheduler.slot_count >= 0

@pytest.mark.requires("moon")
def test_of_the_moon(ranger):
    pass
""",
    )
    names = ("of_vcan", "looks_inside", "looks_inside_without_saying_so", "of_the_moon")
    done = pytest_in(tmp_path)
    assert [done.outcome(f"test_{name}") for name in names] == ["skipped", "passed", "passed", "error"]
    assert "backend sim has no vcan" in done.reason("test_of_vcan")
    done = pytest_in(tmp_path, RANGER_SIM_BACKEND="processes")
    assert [done.outcome(f"test_{name}") for name in names] == ["skipped", "skipped", "skipped", "error"]
    assert "backend processes has no board memory" in done.reason("test_looks_inside")
    assert "MCH runs in a separate process" in done.reason("test_looks_inside_without_saying_so")
