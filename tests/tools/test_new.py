"""`ranger-sim new`: a project whose tests pass at once, written whole or not at all."""

import json
import pathlib
import re
import shutil
import subprocess
import sys

import pytest

from ranger_sim.datatable import generate
from ranger_sim.datatable.loader import load_table
from ranger_sim.tools import cli
from ranger_sim.tools.new import command
from tests.firmware_sim.native.support import COMPILER
from tests.ranger.testing.project import environment, how_to_find_the_plugin


def everything(folder):
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*"))


def test_the_files_written_are_those_of_the_list_with_the_folders_name(tmp_path, capsys):
    assert cli.main(["new", str(tmp_path / "my-wheel")]) == 0
    project = tmp_path / "my-wheel"
    assert capsys.readouterr().out == f"{project}: written. cd {project}; pytest\n"
    files = {path for path in everything(project) if (project / path).is_file()}
    generated = {path for path in files if path.startswith("table/generated/")}
    assert files - generated == {*command.FILES, *command.WRITTEN}
    assert generate.stale(load_table(project / "table"), project / "table" / "generated") == []
    assert (project / "README.md").read_text().startswith("# my-wheel\n")
    assert not [path for path in files if "[%" in (project / path).read_text()]
    assert everything(tmp_path) == sorted(["my-wheel", *(f"my-wheel/{path}" for path in everything(project))])


def test_an_empty_folder_is_taken_also_the_current_one_of_a_shell(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["new", "."]) == 0
    assert (tmp_path / "machine.py").is_file() and not list(tmp_path.glob(".ranger-sim-new-*"))


@pytest.mark.parametrize(
    ("there", "asked", "line"),
    [
        ("dir/a.txt", "dir", "the folder is not empty"),
        ("a.txt", "a.txt", "it exists and is not a folder"),
        ("a.txt", "a.txt/below", "Not a directory|File exists"),
        ("a.txt", "na\tme", "letters, digits, spaces"),
        ("a.txt", "x" * 61, "60 at most"),
    ],
)
def test_what_cannot_be_a_project_is_refused_in_a_line_and_nothing_is_left(tmp_path, capsys, there, asked, line):
    (tmp_path / there).parent.mkdir(exist_ok=True)
    (tmp_path / there).write_text("mine")
    before = everything(tmp_path)
    assert cli.main(["new", str(tmp_path / asked)]) == 2
    said = capsys.readouterr().err
    assert re.search(line, said) and len(said.splitlines()) == 1
    assert everything(tmp_path) == before and (tmp_path / there).read_text() == "mine"


def test_a_write_that_fails_half_way_leaves_nothing(tmp_path, monkeypatch, capsys):
    def fails(table, folder):
        raise OSError(28, "No space left on device", str(folder))

    monkeypatch.setattr(generate, "write", fails)
    assert cli.main(["new", str(tmp_path / "wheel")]) == 2
    assert "No space left on device" in capsys.readouterr().err
    assert everything(tmp_path) == []


@pytest.mark.skipif(not COMPILER, reason="no C compiler is installed here")
def test_its_tests_pass_at_once_and_it_needs_nothing_of_ranger(tmp_path):
    assert cli.main(["new", str(tmp_path / "wheel")]) == 0
    (tmp_path / "wheel" / "test_imports.py").write_text(
        "import sys\n\n\ndef test_nothing_of_ranger_is_needed(machine):\n"
        "    machine.run_for(0.01)\n"
        "    rangers = ('ranger_sim.boards', 'ranger_sim.datatable.generated', 'ranger_sim.ranger.')\n"
        "    plugin = {'ranger_sim.ranger.testing', 'ranger_sim.ranger.testing.plugin'}\n"
        "    assert {name for name in sys.modules if name.startswith(rangers)} <= plugin\n"
    )
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *how_to_find_the_plugin(), "."],
        cwd=tmp_path / "wheel",
        env=environment() | {"PYTHONPATH": str(pathlib.Path(__file__).resolve().parents[2])},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    assert "4 passed" in done.stdout
    libraries = [path for path in everything(tmp_path / "wheel") if path.endswith(".so")]
    assert libraries == ["panel/build/panel.so", "wheel/build/wheel.so"]


GDB = next(filter(None, map(shutil.which, ("gdb", "gdb-multiarch"))), None)


@pytest.mark.skipif(GDB is None, reason="no gdb (apt-get install gdb)")
def test_the_editors_configuration_does_not_stop_where_a_reader_has_left(tmp_path):
    """Python ignores SIGPIPE and gets an error; gdb stops at it all the same, unless it is set up otherwise."""
    assert cli.main(["new", str(tmp_path / "wheel")]) == 0
    both = json.loads((tmp_path / "wheel" / ".vscode" / "launch.json").read_text())["configurations"]
    (chosen,) = (each for each in both if each["type"] == "cppdbg")
    commands = [*(each["text"] for each in chosen["setupCommands"]), "run"]
    program = (
        "import socket; one, other = socket.socketpair(); other.close()\n"
        "try:\n one.send(b'x')\nexcept BrokenPipeError:\n print('goes on')"
    )
    done = subprocess.run(
        [GDB, "-nx", "-batch", *(part for each in commands for part in ("-ex", each))]
        + ["--args", sys.executable, "-c", program],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert "goes on" in done.stdout and "SIGPIPE" not in done.stdout, done.stdout + done.stderr


@pytest.mark.skipif(not COMPILER, reason="no C compiler is installed here")
@pytest.mark.skipif(GDB is None, reason="no gdb (apt-get install gdb)")
def test_the_editors_configuration_debugs_a_boards_c_while_the_tests_run(tmp_path):
    """gdb is called as cppdbg calls it with this configuration: what it sets up, the program, its arguments."""
    project = tmp_path / "wheel"
    assert cli.main(["new", str(project)]) == 0
    both = json.loads((project / ".vscode" / "launch.json").read_text())["configurations"]
    (chosen,) = (each for each in both if each["type"] == "cppdbg")
    assert chosen["program"] == "${command:python.interpreterPath}" and chosen["cwd"] == "${workspaceFolder}"
    commands = [each["text"] for each in chosen["setupCommands"]]
    commands += ["break observe if ms == 6", "run", "print ms", "next", "next", "print ms", "delete", "continue"]
    done = subprocess.run(
        [GDB, "-nx", "-batch", *(part for each in commands for part in ("-ex", each))]
        + ["--args", sys.executable, *chosen["args"], "-p", "no:cacheprovider", *how_to_find_the_plugin(), "."],
        cwd=project,
        env=environment() | {"PYTHONPATH": str(pathlib.Path(__file__).resolve().parents[2])},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert "hit Breakpoint 1" in done.stdout and "wheel.c" in done.stdout, done.stdout + done.stderr
    assert "$1 = 6" in done.stdout and "$2 = 7" in done.stdout, done.stdout
    assert "3 passed" in done.stdout, done.stdout


@pytest.mark.skipif(not COMPILER, reason="no C compiler is installed here")
def test_a_project_on_a_can_fd_bus_passes_at_once_and_its_dbc_file_decodes_its_frames(tmp_path):
    """cantools decodes a frame of 64 bytes that the C program of the wheel packed."""
    import cantools

    assert cli.main(["new", "--fd", str(tmp_path / "wheel")]) == 0
    project = tmp_path / "wheel"
    assert not [path for path in everything(project) if (project / path).is_file() and "[%" in read(project / path)]
    database = cantools.database.load_file(project / "table" / "generated" / "can1.dbc")
    assert {(each.name, each.is_fd, each.length) for each in database.messages} == {
        ("ERROR_WHEEL", True, 8),
        ("ERROR_PANEL", True, 8),
        ("PANEL_TARGET_RATE", True, 8),
        ("WHEEL_STATE", True, 64),
    }
    (project / "test_cantools.py").write_text(
        "import cantools\n\n\ndef test_cantools_reads_what_the_wheel_sends(machine):\n"
        "    state = cantools.database.load_file('table/generated/can1.dbc').get_message_by_name('WHEEL_STATE')\n"
        "    machine.run_for(0.8)\n"
        "    frame = machine.wire().frames('WHEEL_STATE')[-1]\n"
        "    decoded = state.decode(frame.data)\n"
        "    assert decoded['time_ms'] == frame.stamp_ms\n"
        "    assert [decoded[f'value_{place}'] for place in range(12)] == list(frame.values)\n"
        "    assert abs(decoded['value_0'] - 10.0) < 0.5 and decoded['value_4'] == decoded['value_0']\n"
    )
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *how_to_find_the_plugin(), "."],
        cwd=project,
        env=environment() | {"PYTHONPATH": str(pathlib.Path(__file__).resolve().parents[2])},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0 and "5 passed" in done.stdout, done.stdout + done.stderr


def read(path):
    return path.read_text(encoding="utf-8")


@pytest.mark.parametrize("option", [["--from", "net.dbc"], ["--plant", "fmu", "unit.fmu"], ["--drive", "odrive"]])
def test_can_fd_is_refused_with_what_makes_classic_boards(tmp_path, capsys, option):
    assert cli.main(["new", str(tmp_path / "wheel"), "--fd", *option]) == 2
    assert "--fd excludes --from, --drive and --plant fmu" in capsys.readouterr().err and everything(tmp_path) == []
