"""`python -m dev.kills`: one killed walk, and that its checks can fail."""

import json
import pathlib
import signal
import sys

import pytest

from dev import kills
from dev.kills import Command, Finding, Kills, results_in

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="processes are listed as on Linux")

SUMMARY = json.dumps({"trace_digest": "ab"})
WHOLE = {"summary.json": SUMMARY, "can1.log": "a frame\n", "variables.mf4": "MDF     4.10", "report.html": "</html>\n"}


def checked(folder, files, code=0, text="", digest="ab"):
    """What the check of a run's folder finds; empty for nothing."""
    made = Kills(1, folder)
    made.wanted["walk"] = digest
    out = folder / "out"
    out.mkdir()
    for name, content in files.items():
        (out / name).write_text(content, encoding="utf-8")
    try:
        made.check_run("walk", out, code, text, "case 0")
    except Finding as finding:
        return str(finding)
    return ""


@pytest.mark.parametrize(
    ("files", "code", "found"),
    [
        (WHOLE, 0, ""),
        ({"incomplete.json": "{}", "can1.partial.log": "half a"}, -9, ""),
        ({}, -9, ""),
        ({"incomplete.json": "{}"}, 0, "code 0 without a summary"),
        ({**WHOLE, "incomplete.json": "{}"}, -9, "both summary.json and incomplete.json"),
        ({"can1.log": "a frame\n"}, -9, "neither summary.json nor incomplete.json"),
        ({**WHOLE, "can2.partial.log": ""}, -9, "a summary, and partial files"),
        ({**WHOLE, "variables.mf4": "UnFinMF 4.10"}, 0, "variables.mf4 has its own name, but is not whole"),
        ({**WHOLE, "can1.log": "half a"}, 0, "can1.log has its own name, but ends within a line"),
        ({**WHOLE, "report.html": "<html>"}, 0, "report.html has its own name, but is not whole"),
    ],
)
def test_a_folder_that_says_more_than_it_has_is_a_finding(tmp_path, files, code, found):
    reported = checked(tmp_path, files, code)
    assert (reported == "") == (found == "") and found in reported


def test_a_file_that_was_reported_and_is_not_there_is_a_finding(tmp_path):
    assert "reported, but not there" in checked(tmp_path, WHOLE, text=f"report: {tmp_path}/gone.html\n")


def test_another_digest_than_that_of_an_undisturbed_run_is_a_finding(tmp_path):
    assert "its digest is not that" in checked(tmp_path, WHOLE, digest="cd")


def test_a_result_that_was_being_written_is_not_a_result(tmp_path):
    (tmp_path / "results.jsonl").write_text('{"key": "a", "spent": 1, "x": 2}\n{"key": "b", "x"', encoding="utf-8")
    assert results_in(tmp_path) == {"a": {"key": "a", "x": 2}}
    assert results_in(pathlib.Path(tmp_path / "none")) == {}


def test_a_walk_that_is_killed_leaves_nothing_but_an_incomplete_folder(tmp_path):
    made = Kills(1, tmp_path)
    out = tmp_path / "out"
    command = Command(("walk", "--steps", "1000", "--out", str(out)), "test-kills")
    try:
        while not (out / "incomplete.json").is_file():
            assert command.started.poll() is None, command.text()
        assert command.processes()[0] == command.started.pid
        command.started.send_signal(signal.SIGKILL)
        made.check_run("walk", out, command.end(), command.text(), "case 0")
        while made.left_by(command):  # the kernel takes a moment
            pass
    finally:
        command.close()
    assert command.started.returncode == -signal.SIGKILL
    assert (out / "incomplete.json").is_file() and not (out / "summary.json").exists()


def test_the_command_ends_with_1_at_a_finding(monkeypatch, capsys):
    def found(count, seed, first):
        raise Finding(f"case {count} of {seed}")

    monkeypatch.setattr(kills, "run", found)
    assert kills.main(["--kills", "3", "--seed", "7"]) == 1
    assert capsys.readouterr().err == "python -m dev.kills: seed 7: case 3 of 7\n"
    monkeypatch.setattr(kills, "run", lambda count, seed, first: {"cases": count - first, "before_its_end": seed})
    assert kills.main(["--kills", "3", "--seed", "7", "--first", "2"]) == 0
    assert capsys.readouterr().out == "cases 1, before its end 7\n"
