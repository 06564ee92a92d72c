"""A run folder belongs to one run; what an older one left goes first, and nothing of anybody else's goes at all."""

import errno
import json
import os
import pathlib

import pytest

from ranger_sim.foundation import systems
from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools.run import folder as run_folder
from ranger_sim.tools.run.folder import RunFolder

SUMMARY = {"trace_digest": "ab" * 32, "steps": 3}


@pytest.fixture
def lines():
    return []


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def record(folder, name="incomplete.json"):
    return json.loads((folder / name).read_text())


def test_the_summary_comes_last_and_says_what_is_complete(tmp_path, lines):
    with RunFolder(tmp_path / "a", "ranger-sim walk", lines.append) as folder:
        assert names(folder.path) == ["incomplete.json"]
        with folder.file("report.html") as path:
            path.write_text("half")
            assert names(folder.path) == ["incomplete.json", "report.partial.html"]
            assert record(folder.path)["complete"] is False and record(folder.path)["command"] == "ranger-sim walk"
        folder.finish(SUMMARY)
    assert names(folder.path) == ["report.html", "summary.json"]
    assert record(folder.path, "summary.json") == {**SUMMARY, "complete": True, "files": {"report.html": "complete"}}
    assert lines == []


def test_what_an_older_run_left_goes_first_and_a_users_own_file_stays(tmp_path, lines):
    with RunFolder(tmp_path, "first", lines.append) as folder:
        for name in run_folder.FILES:
            with folder.file(name) as path:
                path.write_text("of the first run")
        folder.finish(SUMMARY)
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "can1.log.old").write_text("mine")
    with RunFolder(tmp_path, "second", lines.append) as folder:
        assert names(tmp_path) == ["can1.log.old", "incomplete.json", "notes.txt"]
        folder.finish(SUMMARY)
    assert names(tmp_path) == ["can1.log.old", "notes.txt", "summary.json"]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="a killed process needs one")
def test_what_a_run_left_that_was_killed_while_it_removed_an_older_one_goes_too(tmp_path, lines, monkeypatch):
    with RunFolder(tmp_path, "first", lines.append) as folder:
        for name in run_folder.FILES:
            with folder.file(name) as path:
                path.write_text("of the first run")
        folder.finish(SUMMARY)
    if (killed := os.fork()) == 0:
        removed = []
        remove = pathlib.Path.unlink
        monkeypatch.setattr(
            pathlib.Path, "unlink", lambda path: os._exit(9) if removed else removed.append(remove(path))
        )
        RunFolder(tmp_path, "killed", lines.append)
        os._exit(1)
    assert os.waitstatus_to_exitcode(os.waitpid(killed, 0)[1]) == 9
    assert names(tmp_path) == sorted(["incomplete.json", *run_folder.FILES])
    with RunFolder(tmp_path, "second", lines.append):
        assert names(tmp_path) == ["incomplete.json"]


def test_what_a_killed_run_left_goes_too(tmp_path, lines):
    folder = RunFolder(tmp_path, "killed", lines.append)
    folder.begin("can1.log").write_text("(1.0) can1 1#\n")
    os.close(folder.lock)  # as the kernel does
    assert names(tmp_path) == ["can1.partial.log", "incomplete.json"] and record(tmp_path)["complete"] is False
    with RunFolder(tmp_path, "next", lines.append) as folder:
        folder.finish(SUMMARY)
    assert names(tmp_path) == ["summary.json"]


@pytest.mark.parametrize("name", ["report.html", "can1.log", "summary.json", "variables.partial.mf4"])
def test_a_users_file_of_one_of_our_names_is_not_touched(tmp_path, lines, name):
    (tmp_path / name).write_text("mine")
    with pytest.raises(UserError, match=f"{name}: exists and belongs to no run"):
        RunFolder(tmp_path, "", lines.append)
    assert names(tmp_path) == [name] and (tmp_path / name).read_text() == "mine"


def test_a_link_of_one_of_our_names_is_not_followed(tmp_path, lines):
    (tmp_path / "mine").write_text("mine")
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "incomplete.json").symlink_to(tmp_path / "mine")
    with pytest.raises(UserError, match="incomplete.json"):
        RunFolder(tmp_path / "a", "", lines.append)
    assert (tmp_path / "mine").read_text() == "mine"


def test_two_runs_do_not_write_into_one_folder(tmp_path, lines):
    with RunFolder(tmp_path, "one", lines.append) as folder:
        with pytest.raises(UserError, match="another run is writing there"):
            RunFolder(tmp_path, "two", lines.append)
        assert record(tmp_path)["command"] == "one"
        folder.finish(SUMMARY)
    assert names(tmp_path) == ["summary.json"]


@pytest.mark.parametrize(
    ("error", "cause"),
    [(OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), "No space left on device"), (MemoryError(), "out of memory")],
)
def test_a_file_that_the_machine_could_not_finish_is_named_with_its_cause(tmp_path, lines, error, cause):
    with RunFolder(tmp_path, "", lines.append) as folder:
        with folder.file("variables.mf4") as path:
            path.write_text("some")
            raise error
        with folder.file("report.html") as path:
            path.write_text("all")
        folder.finish(SUMMARY)
    assert names(tmp_path) == ["report.html", "summary.json", "variables.partial.mf4"]
    reported = record(tmp_path, "summary.json")
    assert reported["complete"] is False and reported["files"]["variables.mf4"] == f"incomplete: {cause}"
    assert len(lines) == 1 and "variables.partial.mf4" in lines[0] and cause in lines[0]


def test_a_run_that_breaks_off_gives_the_reason(tmp_path, lines):
    with pytest.raises(KeyboardInterrupt), RunFolder(tmp_path, "", lines.append) as folder:
        folder.begin("can1.log").write_text("")
        raise KeyboardInterrupt
    reported = record(tmp_path)
    assert reported["complete"] is False and reported["ended"].startswith("KeyboardInterrupt")
    assert reported["files"] == {"can1.log": "incomplete"}


def test_a_summary_finds_space_on_a_disk_that_is_full(tmp_path, lines, monkeypatch):
    """Nothing but the bytes that were reserved at the start may be written at the end."""
    with RunFolder(tmp_path, "", lines.append) as folder:
        reserved, real = (tmp_path / "incomplete.json").stat().st_size, systems.write_at

        def pwrite(file, data, at):
            if at + len(data) > reserved:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return real(file, data, at)

        monkeypatch.setattr(systems, "write_at", pwrite)
        folder.finish({**SUMMARY, "text": "x" * 30_000})  # a summary of a walk with its faults has some 20 kB
    assert record(tmp_path, "summary.json")["steps"] == 3
