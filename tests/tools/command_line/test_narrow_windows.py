"""Tables in a window of 80 columns keep their lines whole; what has no room is left out and named."""

import contextlib
import io

import pytest
from rich.console import Console
from rich.table import Table

from ranger_sim.tools import cli
from ranger_sim.tools.command_line import terminal


@pytest.mark.parametrize(
    ("words", "whole", "reported"),
    [
        (["can-bounds"], "14  MCH_ANGLE", ""),
        (["slots", "MCH", "--static"], "qdc_cap01_rate", "too narrow for robot's image"),
        (["table", "list", "--board", "MCH"], "MCH_ANGLE", "too narrow for descriptions"),
        (["body", "show", "ranger"], "total_mass_kg", ""),
    ],
)
def test_a_table_in_80_columns_has_one_line_for_each_row(capsys, monkeypatch, words, whole, reported):
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    assert cli.main(words) == 0
    printed = capsys.readouterr().out
    assert whole in printed and reported in printed and "…" not in printed


@pytest.mark.parametrize("words", [["bench", "--help"], ["can-bounds"], ["table", "list"], ["up", "--help"]])
def test_in_80_columns_no_line_is_longer_in_a_pipe_either(capsys, monkeypatch, words):
    monkeypatch.setenv("COLUMNS", "80")
    with contextlib.suppress(SystemExit):
        cli.main(words)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) > 5 and max(map(len, lines)) <= 80


def test_columns_are_left_out_in_their_order_and_only_for_want_of_space():
    def printed(width):
        table = Table("name", "one\n(ms)", "two", box=None, pad_edge=False)
        table.add_row("a" * 20, "b" * 20, "c" * 20)
        text = io.StringIO()
        terminal.print_table(Console(file=text, width=width), table, spare=("two", "one\n(ms)"))
        return [line.split() for line in text.getvalue().splitlines()]

    assert printed(64)[-1] == ["a" * 20, "b" * 20, "c" * 20]
    assert printed(63)[-2:] == [["a" * 20, "b" * 20], "too narrow for two: widen the window or use --json".split()]
    assert printed(25)[-1] == "too narrow for two, one: widen the window or use --json".split()


def test_bounds_have_units(capsys):
    assert cli.main(["can-bounds"]) == 0
    assert capsys.readouterr().out.count("(ms)") == 4 * 4
