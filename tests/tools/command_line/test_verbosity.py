"""-q and -v: how much a command prints while it works."""

import argparse
import io
import json

import pytest

from ranger_sim.tools import cli
from ranger_sim.tools.command_line import terminal
from ranger_sim.tools.commands import COMMANDS

WITH_PROGRESS = ["walk", "up", "campaign", "diagnose"]


@pytest.mark.parametrize("name", WITH_PROGRESS)
def test_commands_with_progress_take_quiet_or_verbose_and_not_both(name, capsys):
    [words] = [each.examples[0].split()[1:] for each in COMMANDS if each.name == name]
    parser = cli.parser(name)
    assert parser.parse_args([*words, "-q"]).quiet and parser.parse_args([*words, "--verbose"]).verbose
    with pytest.raises(SystemExit) as end:
        parser.parse_args([*words, "-q", "-v"])
    assert end.value.code == 2 and "not allowed with argument" in capsys.readouterr().err


def test_a_quiet_walk_prints_nothing_and_its_file_has_the_result(tmp_path, capsys):
    assert cli.main(["walk", "--time", "20ms", "--quiet", "--json", str(tmp_path / "walk.json")]) == 0
    assert capsys.readouterr() == ("", "")
    assert json.loads((tmp_path / "walk.json").read_text(encoding="utf-8"))["time_s"] == pytest.approx(0.02)


def test_a_mistake_is_printed_by_a_quiet_command_as_well(capsys):
    assert cli.main(["walk", "--quiet", "--body", "nobody.toml"]) == 2
    assert "nobody.toml" in capsys.readouterr().err


@pytest.mark.parametrize(("verbose", "printed"), [(True, ["0", "3", "6"]), (False, [])])
def test_verbose_progress_is_a_line_each_second_where_there_is_no_terminal(verbose, printed, monkeypatch):
    file = io.StringIO()
    options = argparse.Namespace(verbose=verbose)
    lines = terminal.ProgressLines(terminal.console(file=file), options)
    for count in range(8):
        monkeypatch.setattr(terminal.wallclock, "monotonic_s", lambda count=count: 100.0 + 0.4 * count)
        lines.show(str(count))
    assert file.getvalue().split() == printed
