"""The plan of `ranger-sim up`: what its options mean, without a process, a port or a robot."""

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools import cli
from ranger_sim.tools.run.up_execution import exit_code, external
from ranger_sim.tools.run.up_plan import FOREVER, OutsideBus, plan_of

SUMMARY = {"interrupted": False, "faults": [], "fell": False, "failed_boards": []}


def planned(*words):
    return plan_of(cli.parser().parse_args(["up", *words]))


def test_without_options_every_board_runs_at_real_time_until_ctrl_c():
    plan = planned()
    assert plan.stop == FOREVER and plan.settings.speed == 1.0 and len(plan.settings.boards) == 7
    assert plan.outside == () and plan.peers == {} and plan.faults == () and not plan.has_hardware
    assert plan.log == "none"  # there is no folder for it


def test_options_name_the_end_the_scenario_the_pace_and_the_files():
    plan = planned("--steps", "5", "--seed", "3", "--speed", "max", "--out", "runs/x", "--name", "walker")
    assert plan.stop.steps == 5 and plan.scenario.seed == 3
    assert plan.settings.speed is None and plan.settings.name == "walker" and plan.log == "window"


def test_a_bus_outside_has_its_interface_and_the_bit_rate_that_is_given():
    plan = planned("--bus", "can1=virtual:one --bitrate 1000000", "--bus", "can2=virtual:two")
    first, second = plan.outside
    assert (first.name, first.bit_rate, first.keywords["channel"]) == ("can1", 1_000_000, "one")
    assert (second.name, second.bit_rate) == ("can2", None)
    assert external(first, 3_000_000).bit_rate == 1_000_000
    assert external(second, 3_000_000).bit_rate == 3_000_000


def test_a_board_can_have_its_own_place_on_a_bus_outside():
    plan = planned("--bus", "can1=virtual:one", "--bus", "MCH=virtual:one")
    assert plan.outside == (OutsideBus("can1", {"interface": "virtual", "channel": "one"}),)
    assert list(plan.peers) == ["MCH"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--bus", "can9=virtual:a"], r"--bus can9=virtual:a: unknown bus or board 'can9' \(available: can1, can2"),
        (["--bus", "CSR=virtual:a"], "unknown bus or board 'CSR'"),
        (["--bus", "can1=virtual:a", "--bus", "can1=virtual:b"], "can1 is given twice"),
        (["--bus", "MCH=virtual:a"], r"--bus MCH=...: its bus can1 is not outside"),
        (["--processor", "first"], "--processor first: one, all or the number of a processor is expected"),
        (["--image", "MCH=a.axf", "--image", "MCH=b.axf"], "--image MCH=b.axf: MCH has a.axf already"),
        (["--firmware", "MCH=a", "--firmware", "MCH=b"], "--firmware MCH=b: MCH has a already"),
        (["--daq-dropouts"], "--daq-link and --daq-dropouts need --daq-port"),
    ],
)
def test_an_impossible_plan_is_refused_by_one_line(words, message):
    with pytest.raises(UserError, match=message):
        planned(*words)


def test_a_program_for_a_board_that_is_not_here_is_refused(tmp_path):
    path = tmp_path / "bench.toml"
    path.write_text('title = "bench"\ndescription = "one board"\n[boards]\nMCH = "absent"\n', encoding="utf-8")
    plan = planned("--profile", str(path))
    assert plan.has_hardware and plan.not_here() == ["MCH: absent"] and "MCH" not in plan.settings.boards
    with pytest.raises(UserError, match="--image MCH=a.axf: MCH is not emulated in this profile"):
        planned("--profile", str(path), "--image", "MCH=a.axf")
    with pytest.raises(UserError, match="--firmware MCH=folder: MCH is not emulated in this profile"):
        planned("--profile", str(path), "--firmware", "MCH=folder")


@pytest.mark.parametrize(
    ("change", "is_complete", "code"),
    [
        ({}, True, 0),
        ({"fell": True}, True, 1),
        ({"failed_boards": ["CSR"]}, True, 1),
        ({"faults": [{"acted": True}, {"acted": False}], "fell": True}, True, 3),
        ({"interrupted": True, "fell": True}, True, 130),
        ({"interrupted": True}, False, 2),
    ],
)
def test_the_exit_code_is_that_of_a_walk(change, is_complete, code):
    assert exit_code({**SUMMARY, **change}, is_complete) == code
