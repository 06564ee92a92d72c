"""The console that commands print on."""

import io

from ranger_sim.tools.command_line import terminal


def test_a_line_in_a_file_is_long_unless_a_width_is_given(monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    assert terminal.console(file=io.StringIO()).width == terminal.FILE_COLUMNS
    monkeypatch.setenv("COLUMNS", "70")
    assert terminal.console(file=io.StringIO()).width == 70


def test_a_window_keeps_its_width(monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    assert terminal.console(file=io.StringIO(), force_terminal=True, width=60).width == 60
