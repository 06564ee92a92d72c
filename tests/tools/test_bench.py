"""`ranger-sim bench` in small: its parts, what it compares, and that its loads check what they carry."""

import json

import pytest

from ranger_sim.can_bus.edge import benchmark
from ranger_sim.foundation.events import EventQueue
from ranger_sim.ranger.scenario import Scenario
from ranger_sim.tools import cli
from ranger_sim.tools.bench import cases, command, interfaces, processes, traffic, twelve_boards, walks
from tests.firmware_sim.native.support import COMPILER


def reported(capsys, *arguments):
    code = cli.main(["bench", *arguments])
    return code, capsys.readouterr()


def test_help_names_every_part_with_a_line(capsys):
    with pytest.raises(SystemExit):
        cli.main(["bench", "--help"])
    text = " ".join(capsys.readouterr().out.split())
    for name, part in command.PARTS.items():
        assert f" {name} {part.line}" in text


def test_a_part_that_there_is_not_gets_one_line(capsys):
    with pytest.raises(SystemExit) as left:
        cli.main(["bench", "robots"])
    complaint = capsys.readouterr().err
    assert left.value.code == 2 and len(complaint.splitlines()) == 1
    assert "'robots' is not a part (available: robot, robot-with-log" in complaint


def test_what_is_timed_is_compared_with_python_cans_virtual_turn_by_turn(capsys, monkeypatch):
    speeds = {
        "robot": iter([50.0, 20.0, 40.0]),
        "robot-longer": iter([1.0, 1.0, 1.0]),
        "virtual": iter([1e5, 4e4, 4e4]),
    }
    order = []

    def measured(name, seconds):
        order.append(name)
        assert seconds == 7
        return {"figure": next(speeds[name])}

    monkeypatch.setattr(command, "measured", measured)
    code, out = reported(capsys, "robot", "--seconds", "7", "--json", "-")
    assert code == 0
    result = json.loads(out.out)
    assert order == ["robot", "robot-longer", "virtual"] * 3
    robot = result["figures"]["robot"]
    assert (robot["median"], robot["min"], robot["max"]) == (40.0, 20.0, 50.0)
    assert robot["ratio_to_virtual"] == 5e-4  # of 5e-4, 5e-4 and 1e-3
    assert result["machine"]["processor"] and result["machine"]["load_average_before"] >= 0.0
    (row,) = [line for line in command.lines_of(result["figures"], 3) if line.startswith("  whole robot, trace")]
    assert row.endswith("x real time  1 s costs 2,000 of its frames")


def test_a_case_is_timed_in_its_own_process(monkeypatch):
    assert cases.measured("plant", 0.02)["figure"] > 1.0
    monkeypatch.setitem(cases.CASES, "nowhere", cases.CASES["plant"])  # here, but not in the other process
    with pytest.raises(RuntimeError, match="bench: case nowhere: KeyError: 'nowhere'"):
        cases.measured("nowhere", 0.02)


@pytest.mark.parametrize("name", [name for name, case in cases.CASES.items() if not case.interpreted])
def test_every_case_does_something(name):
    if name.startswith("fmu"):
        pytest.importorskip("pythonfmu3")
    if name.startswith("rebuild"):
        pytest.skip("it removes a library of this checkout, which other tests load: by command only")
    # a campaign's machine is imported by name: of others in this process there may be one of the same name
    done = cases.measured(name, 0.05) if name.startswith("campaign") else cases.CASES[name].measure(0.05)
    assert done["figure"] > 0.0
    assert done.get("lost", 0) == done.get("out_of_order", 0) == 0


def test_every_case_belongs_to_a_part():
    named = {case for part in command.PARTS.values() for case in part.cases}
    assert {*named, cases.YARDSTICK} == set(cases.CASES)


def test_a_users_control_law_replaces_the_firmwares(monkeypatch):
    calls = []
    law = cases.users_law

    def counted(board):
        control = law(board)
        return lambda: calls.append(board.name) or control()

    monkeypatch.setattr(cases, "users_law", counted)
    cases.robot(0.05, swap=True)
    assert len(calls) > 2000 and set(calls) == {"MCH"}  # every slot of 0.5 ms, from power-up on


def test_every_frame_of_four_full_buses_arrives_in_order():
    figures = traffic.million_frames(3_000)
    assert figures["frames"] == figures["sent"] == 3_000
    assert figures["delivered"] == 6_000
    assert figures["lost"] == 0 and figures["out_of_order"] == 0
    assert figures["load_mean"] > 0.9


def test_the_load_of_the_buses_is_the_one_aimed_at():
    assert traffic.million_frames(2_000, 0.5)["load_mean"] == pytest.approx(0.5, rel=0.1)


def test_pythons_can_interfaces_carry_the_same_frames():
    for interface in ("ranger_sim", "virtual"):
        figures = benchmark.interface_frames(interface, 300)
        assert (figures["delivered"], figures["lost"], figures["reordered"]) == (600, 0, 0)


def test_a_frame_lost_doubled_or_out_of_order_is_noticed():
    for numbers, reordered in (((0, 1, 2), 0), ((0, 2, 1), 1), ((0, 1, 1), 1)):
        tally = benchmark.Tally()
        for number in numbers:
            tally.take(benchmark.numbered(0, benchmark.IDENTIFIERS * number))
        assert (tally.received, tally.reordered) == (3, reordered)


def test_interfaces_are_compared_with_a_line_each(monkeypatch):
    monkeypatch.setattr(interfaces.importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(benchmark, "two_processes", benchmark.interface_frames)
    said = []
    rows = interfaces.run(30, said.append)
    assert [row["interface"] for row in rows] == ["ranger_sim", "virtual", "ranger_sim"]
    assert said[0].startswith("ranger_sim, 3 nodes in 1 thread: ") and said[0].endswith("of 30 0 lost, 0 reordered")
    assert "udp_multicast: left out, it needs the package msgpack" in said


def test_a_walk_that_is_kept_records_how_it_went():
    row = walks.walked(Scenario(), 2)
    assert row["steps"] == 2 and not row["fell"] and row["lost"] == row["overruns"] == 0
    assert set(walks.KEPT) <= set(row)


def test_the_robot_as_processes_is_measured_by_its_own_report():
    said = []
    rows = processes.run(0.02, said.append)
    assert [row["speed"] for row in rows] == [1.0, "max"]
    assert rows[0]["trace_digest"] == rows[1]["trace_digest"]
    assert said[0].startswith("up --speed 1.0: ") and "99 % of a board's slots late by at most" in said[0]


def test_an_answer_later_than_its_bound_is_exit_code_1(capsys, monkeypatch):
    from ranger_sim.can_bus import bound_check

    assert reported(capsys, "bounds", "--sets", "3")[0] == 0
    monkeypatch.setattr(bound_check, "random_sets", lambda count, fd: {"sets": count, "exceeded": 1, "fd": fd})
    assert reported(capsys, "bounds", "--sets", "3")[0] == 1


def test_a_queue_of_wrong_frames_is_counted_by_the_load():
    load = traffic.Load(1, 2, 1.0)
    assert isinstance(load.inboxes[0][1], EventQueue)
    load.expected[5] = 1  # node 1 hears frame 0 of node 0's third identifier, which it takes for heard already
    load.run(30)
    assert load.out_of_order + load.wrong > 0


@pytest.mark.skipif(not COMPILER, reason="no C compiler here")
def test_twelve_boards_in_c_and_in_python_put_the_same_on_their_bus_ahead_or_not():
    found = {
        (in_c, ahead): twelve_boards.measure(0.05, in_c, ahead)["digest"]
        for in_c in (True, False)
        for ahead in (True, False)
    }
    assert len(set(found.values())) == 1


@pytest.mark.skipif(not COMPILER, reason="no C compiler here")
def test_twelve_boards_with_acceptance_filters_put_the_same_on_their_bus_in_c_in_python_and_as_processes():
    ways = ({}, {"ahead": True}, {"in_c": False}, {"ahead": True, "processes": True})
    found = {twelve_boards.measure(0.05, filtered=True, **how)["digest"] for how in ways}
    assert len(found) == 1
