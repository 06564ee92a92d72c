"""`ranger-sim fmu`: mistakes are one line, and no file is left."""

import os

import pytest

from ranger_sim.tools import cli


def reported(capsys, *arguments):
    try:
        code = cli.main(["fmu", *arguments])
    except SystemExit as ended:
        code = ended.code
    out, err = capsys.readouterr()
    assert code == 2 and out == "" and err.count("\n") == 1, err
    return err


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["body.zip"], ".fmu is expected"),
        (["body.fmu", "--body", "nobody"], "nobody"),
        (["body.fmu", "--slope", "2rad"], "slope"),
        (["folder.fmu"], "this is a folder"),
        (["none/at/../all.fmu/x.fmu"], "all.fmu"),
    ],
)
def test_a_mistake_is_one_line(arguments, expected, tmp_path, monkeypatch, capsys):
    pytest.importorskip("pythonfmu3")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.fmu").mkdir()
    (tmp_path / "none").mkdir()
    (tmp_path / "none" / "all.fmu").write_bytes(b"")
    (tmp_path / "none" / "at").mkdir()
    assert expected in reported(capsys, *arguments)
    assert [each for each in os.listdir(tmp_path) if each.startswith("body")] == []
