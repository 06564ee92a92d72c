"""What is mistyped ends in one line that names it and what was perhaps meant; exit code 2, and nothing runs."""

import pytest

from ranger_sim.foundation.user_error import UserError, did_you_mean
from ranger_sim.harness.faults import text
from ranger_sim.ranger.conditions import condition
from ranger_sim.ranger.scenario import Scenario
from ranger_sim.tools.cli import main


@pytest.mark.parametrize(
    ("command", "wanted"),
    [
        ("wlak", "unknown 'wlak'; did you mean 'walk'?"),
        ("zzz", "unknown 'zzz'; available: help, walk, info, "),
        ("table shw MCH_ANGLE", "unknown 'shw'; did you mean 'show'?"),
        ("table show MCH_ANGEL", "unknown variable 'MCH_ANGEL'; did you mean 'MCH_ANGLE' or"),
        ("walk --log ful", "unknown 'ful'; did you mean 'full'?"),
        ("walk --step 5", "unrecognized arguments: --step 5; did you mean '--steps'?"),
        ("walk --floor 1mm", "unrecognized arguments: --floor 1mm; did you mean '--floor-roughness'?"),
        ("walk --seed -1", "argument --seed: '-1' is below 0"),
        ("walk --slope 10kg", "'10kg' is not a number with one of the units rad, mrad, deg, %"),
        (
            "walk --fault MCH.joint_encoder:stuck@step5..step3",
            "it ends at 'step3', which is not after its start, 'step5'",
        ),
        ("walk --fault MCH.joint_encoder:stuck@5s..300ms", "it ends at '300ms', which is not after its start, '5s'"),
    ],
)
def test_a_mistake_is_one_line_with_a_suggestion(command, wanted, capsys):
    try:
        code = main(command.split())
    except SystemExit as end:  # argparse leaves so
        code = end.code
    (line,) = capsys.readouterr().err.splitlines()
    assert code == 2 and wanted in line


@pytest.mark.parametrize("words", ["help table show", "table show --help"])
def test_help_before_a_command_is_help_behind_it(words, capsys):
    with pytest.raises(SystemExit) as end:
        main(words.split())
    assert end.value.code == 0
    assert capsys.readouterr().out.startswith("usage: ranger-sim table show [-h]")


def test_help_alone_lists_the_commands(capsys):
    with pytest.raises(SystemExit):
        main(["help"])
    assert "let Ranger walk in virtual time" in capsys.readouterr().out


@pytest.mark.parametrize(
    "period", ["step 3..step 5", "1 s..+50 ms", "5 s..+1 s", "step 5..6 s", "6 s..step 1", "300ms..1s"]
)
def test_a_fault_that_ends_after_its_start_or_may_do_so_is_read(period):
    start, _, end = period.partition("..")
    assert text.parse(f"MCH.joint_encoder:stuck@{period}")[3:] == (start, end)


def test_a_step_is_read_with_and_without_a_space_as_the_same_condition():
    assert condition("step12").text == condition("step 12").text == "step 12"


def test_a_name_that_nothing_is_near_gets_no_suggestion():
    assert did_you_mean("xyz", ["walk", "up"]) == ""
    assert did_you_mean("", ["walk", "up"]) == ""


def test_a_seed_below_0_is_refused_from_python_too():
    with pytest.raises(UserError, match="seed is -1, a whole number from 0 on"):
        Scenario(seed=-1)
