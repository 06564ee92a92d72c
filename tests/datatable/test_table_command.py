"""`ranger-sim table`: generate, check, show, list; exit codes and output as text and JSON."""

import argparse
import json

import pytest

from ranger_sim.datatable import cli
from ranger_sim.foundation.user_error import UserError

from . import small_table


def run(*arguments):
    """The exit code of `ranger-sim table ARGUMENTS`."""
    parser = argparse.ArgumentParser()
    cli.register(parser.add_subparsers(required=True))
    options = parser.parse_args(["table", *map(str, arguments)])
    return options.run(options)


@pytest.fixture
def master(tmp_path):
    folder = tmp_path / "master"
    folder.mkdir()
    return small_table.write(folder)


def test_check_passes_on_the_files_checked_in(capsys):
    assert run("generate", "--check") == 0
    assert "up to date" in capsys.readouterr().out


def test_check_fails_with_code_1_and_names_the_stale_files(master, tmp_path, capsys):
    out = tmp_path / "out"
    assert run("generate", "--master", master, "--out", out) == 0
    assert run("generate", "--master", master, "--out", out, "--check") == 0
    (out / "leg.py").write_text("")
    capsys.readouterr()
    assert run("generate", "--master", master, "--out", out, "--check") == 1
    told = capsys.readouterr()
    assert told.out == "" and f"stale: {out / 'leg.py'}" in told.err and "ranger-sim table generate" in told.err
    assert (out / "leg.py").read_text() == "", "--check writes nothing"
    assert run("generate", "--master", master, "--out", out, "--check", "--json") == 1
    assert json.loads(capsys.readouterr().out) == {"folder": str(out), "checked": True, "changed": ["leg.py"]}


def test_generate_tells_how_much_it_wrote(master, tmp_path, capsys):
    run("generate", "--master", master, "--out", tmp_path / "out")
    assert "files written to" in capsys.readouterr().out
    run("generate", "--master", master, "--out", tmp_path / "out")
    assert "nothing to do" in capsys.readouterr().out


@pytest.mark.parametrize("wanted", ["MCH_ANGLE", "mch_angle", "14"])
def test_show_finds_a_variable_by_name_in_any_case_or_by_id(wanted, capsys):
    assert run("show", wanted) == 0
    shown = dict(line.split(None, 1) for line in capsys.readouterr().out.splitlines())
    assert shown["name"] == "MCH_ANGLE" and shown["unit"] == "rad" and shown["buses"] == "CAN1, SSP"


def test_show_as_json_is_json_only(capsys):
    assert run("show", "ERROR_MCH", "--json") == 0
    shown = json.loads(capsys.readouterr().out)
    assert (shown["id"], shown["type"], shown["subscribers"], shown["period_ms"]) == (3, "u32", ["MB"], 22.0)


@pytest.mark.parametrize("wanted", ["MCH_ANGEL", "99999", ""])
def test_show_of_an_unknown_variable_is_one_clear_line(wanted):
    with pytest.raises(UserError, match="unknown variable") as caught:
        run("show", wanted)
    assert "\n" not in str(caught.value)


def test_list_of_a_board_has_what_it_publishes_and_what_it_hears(capsys):
    assert run("list", "--board", "mch", "--json") == 0
    listed = json.loads(capsys.readouterr().out)
    assert all("MCH" in (row["publisher"], *row["subscribers"]) for row in listed)
    assert {"TIMESTAMP", "MCH_ANGLE", "MCH_STIFFNESS"} <= {row["name"] for row in listed}


def test_list_without_a_board_has_every_variable_once(capsys):
    assert run("list", "--json") == 0
    numbers = [row["id"] for row in json.loads(capsys.readouterr().out)]
    assert numbers[:313] == list(range(313)) and len(set(numbers)) == len(numbers)


def test_list_is_readable_text_with_whole_names(capsys):
    assert run("list", "--board", "UI") == 0
    text = capsys.readouterr().out
    assert "UI_MAX_EXECUTION_TIME" in text and "description" in text


def test_list_of_an_unknown_board_names_the_boards():
    with pytest.raises(UserError, match="unknown board 'ARM' .available: PC, MB"):
        run("list", "--board", "arm")


@pytest.mark.parametrize("action", [["generate"], ["generate", "--check"], ["show", "1"], ["list"]])
def test_a_bad_table_is_refused_by_every_action_and_nothing_is_written(master, tmp_path, action):
    small_table.write(master, variables=small_table.VARIABLES.replace("5,GAIN", "4,GAIN"))
    where = ["--out", tmp_path / "out"] if action[0] == "generate" else []
    with pytest.raises(UserError) as caught:
        run(*action, "--master", master, *where)
    assert str(caught.value) == "variables.csv:7 GAIN id: 4 is also the id in line 6"
    assert not (tmp_path / "out").exists()
