"""What people type wrong gets one clear line and exit code 2; what they break off ends cleanly."""

import json
import os
import pathlib
import signal
import subprocess
import sys

import pytest

from ranger_sim.tools import cli
from ranger_sim.tools.commands import COMMANDS

ROOT = pathlib.Path(__file__).resolve().parents[2]
BROKEN_PARAMETERS = "[parameters]\nCTRL_NO_SUCH_PARAMETER = 1.0\n"


def one_clear_line(done, *words):
    """The process left with code 2 after one line on standard error that holds every word."""
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    lines = done.stderr.strip().splitlines()
    assert len(lines) == 1, done.stderr
    assert lines[0].startswith("ranger-sim")
    for word in words:
        assert word in lines[0], lines[0]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["walk", "--controller", "moonwalk"], ["moonwalk", "robust", "record-2011"]),
        (["walk", "--controller", "no-such-file.toml"], ["no-such-file.toml", "No such file"]),
        (["walk", "--body", "unicorn"], ["unicorn", "appendix", "ranger"]),
        (["walk", "--body", "no-such-file.toml"], ["no-such-file.toml", "No such file"]),
        (["body", "show", "unicorn"], ["unicorn", "appendix", "ranger"]),
        (["walk", "--steps", "-1"], ["--steps", "-1"]),
        (["walk", "--steps", "many"], ["--steps", "many", "whole number"]),
        (["walk", "--time", "0s"], ["--time", "above 0"]),
        (["walk", "--distance", "3 parsec"], ["--distance", "parsec", "km"]),
        (["walk", "--floor-roughness", "-1mm"], ["--floor-roughness", "-1mm", "at least 0 m", "0.1 m"]),
        (["walk", "--slope", "nan"], ["--slope", "nan", "rad"]),
        (["walk", "--seed", "x"], ["--seed", "x"]),
        (["walk", "--time", "-1s"], ["--time", "'-1s'", "above 0 s"]),
        (["walk", "--slope", "-inf"], ["--slope", "'-inf'"]),
        (["walk", "--steps", "9" * 23], ["--steps", "above 1000000000"]),
        (["walk", "--time", "1e300s"], ["--time", "1e300s", "at most"]),
        (["walk", "--floor-roughness", "1e999mm"], ["--floor-roughness", "1e999mm", "at most 0.1 m"]),
        (["walk", "--controller", ""], ["--controller", "empty"]),
        (["walk", "--bode", "ranger"], ["walk: unrecognized", "--bode", "did you mean '--body'"]),
        (["walk", "--fault", "a\033[31m\nb"], [r"a\x1b[31m\nb"]),
        (["up", "--bus", "can1="], ["can1", "no interface", "socketcan:vcan0"]),
        (["walk", "--model", "no-such-model.toml"], ["no-such-model.toml", "No such file"]),
        (["walk", "--out", "/proc/no-such-folder/here"], ["/proc/no-such-folder/here"]),
        (["walk", "--json", "/proc/no-such-folder/here.json"], ["/proc/no-such-folder"]),
        (["walk", "--log", "loud"], ["--log", "loud", "window"]),
        (["bench", "--runs", "0"], ["--runs", "0"]),
        (["table", "show", "NO_SUCH_VARIABLE"], ["NO_SUCH_VARIABLE"]),
        (["table", "list", "--board", "MOTHER"], ["MOTHER"]),
        (["dance"], ["dance", "walk"]),
        ([], ["COMMAND"]),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_a_mistake_gets_one_line(command, arguments, words):
    one_clear_line(command(*arguments), *words)


def test_a_folder_for_the_files_that_is_a_file_gets_one_line(command, tmp_path):
    taken = tmp_path / "taken"
    taken.write_text("mine", encoding="utf-8")
    one_clear_line(command("walk", "--out", taken), str(taken), "this is a file")
    assert taken.read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize("name", ["walk", "bench"])
def test_a_json_file_that_is_a_folder_gets_one_line_before_the_work(command, tmp_path, name):
    one_clear_line(command(name, "--json", tmp_path), str(tmp_path), "folder")


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is unwritable for root; /proc stands in above")
def test_a_folder_without_permission_gets_one_line(command, tmp_path):
    tmp_path.chmod(0o500)
    one_clear_line(command("walk", "--out", tmp_path / "runs"), "Permission denied")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("this is not toml", ["not valid TOML"]),
        (BROKEN_PARAMETERS, ["CTRL_NO_SUCH_PARAMETER"]),
        ('base = "robust"\n[operator]\nstance = "head"\n', ["[operator]"]),
        ('base = "nobody"\n', ["mine.toml", "base 'nobody'", "robust"]),
    ],
)
def test_a_broken_parameter_file_gets_one_line(command, tmp_path, content, words):
    file = tmp_path / "mine.toml"
    file.write_text(content, encoding="utf-8")
    one_clear_line(command("walk", "--controller", file), *words)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("= 1", ["TOML"]),
        ('[[term]]\nform = "magic"\nat = "hip"\n', ["term 1", "magic"]),
        ('[[term]]\nform = "edge_jitter"\nat = "moon"\n', ["term 1", "moon"]),
        ("[extra]\n", ["extra"]),
        ('[[term]]\nform = {}\nat = "hip"\n', ["term 1", "unknown form '{}'"]),
    ],
)
def test_a_broken_model_file_gets_one_line(command, tmp_path, content, words):
    file = tmp_path / "model.toml"
    file.write_text(content, encoding="utf-8")
    one_clear_line(command("walk", "--model", file), "model.toml", *words)


def test_a_parameter_file_whose_base_is_itself_gets_one_line(command, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(f'base = "{file}"\n', encoding="utf-8")
    one_clear_line(command("walk", "--controller", file), "mine.toml", "leads back to this set")


@pytest.mark.parametrize("closed", [1, 2])
def test_a_command_whose_output_is_closed_does_its_work(closed, tmp_path):
    words = [sys.executable, "-m", "ranger_sim", "info", "--json", "-"]
    kept = tmp_path / "other"
    with kept.open("w") as file:
        streams = {"stdout": file, "stderr": file}
        done = subprocess.run(words[:4], cwd=ROOT, check=False, preexec_fn=lambda: os.close(closed), **streams)
    assert done.returncode == 0 and "Traceback" not in kept.read_text()


def test_a_letter_that_the_output_has_not_is_written_as_its_escape(command):
    done = command("body", "show", "ranger", PYTHONIOENCODING="ascii")
    assert done.returncode == 0 and done.stdout.isascii()
    assert command("walk", "--controller", "Größe", PYTHONIOENCODING="ascii").stderr.count(r"Gr\xf6\xdfe") == 1


def test_a_run_that_ends_at_once_leaves_whole_files(command, tmp_path):
    done = command("walk", "--time", "1ms", "--out", tmp_path / "short")
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "short" / "summary.json").read_text(encoding="utf-8"))
    assert summary["complete"] and set(summary["files"].values()) == {"complete"}


def test_a_full_disk_behind_the_output_gets_one_line(command):
    with pathlib.Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "ranger_sim", "info"],
            cwd=ROOT,
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert done.returncode == 2
    assert done.stderr.endswith("No space left on device\n") and len(done.stderr.splitlines()) == 1


def test_a_bad_master_table_gives_every_fault_and_exit_code_2(command, tmp_path):
    master = ROOT / "datatable" / "master"
    for file in master.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    variables = tmp_path / "variables.csv"
    lines = variables.read_text(encoding="utf-8").splitlines()
    variables.write_text("\n".join([*lines, lines[1]]) + "\n", encoding="utf-8")  # one id and name twice
    done = command("table", "list", "--master", tmp_path)
    assert done.returncode == 2
    assert "variables.csv" in done.stderr and "Traceback" not in done.stderr


def test_a_master_folder_that_is_not_there_leaves_with_2(command):
    done = command("table", "list", "--master", "/no-such-folder")
    assert done.returncode == 2
    assert "/no-such-folder/variables.csv" in done.stderr and "Traceback" not in done.stderr


def test_a_reader_that_leaves_is_not_an_error():
    """`ranger-sim table list --json | head -c 1`"""
    with subprocess.Popen(
        [sys.executable, "-m", "ranger_sim", "table", "list", "--json"],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as process:
        process.stdout.read(1)
        process.stdout.close()
        complaint = process.stderr.read()
        assert process.wait(60) == 0
    assert complaint == b""


def test_ctrl_c_finishes_the_files_and_leaves_with_130(tmp_path):
    folder = tmp_path / "run"
    with subprocess.Popen(
        [sys.executable, "-m", "ranger_sim", "walk", "--steps", "1000000", "--out", folder, "--json", "-"],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        while not folder.exists():  # from here on Ctrl-C is taken note of
            assert process.poll() is None, process.stderr.read()
        process.send_signal(signal.SIGINT)
        output, complaint = process.communicate(timeout=300)
    assert process.returncode == 130, complaint
    assert complaint == ""
    summary = json.loads(output)
    assert summary["time_s"] > 0.0 and not summary["fell"]
    assert json.loads((folder / "summary.json").read_text(encoding="utf-8"))["trace_digest"] == summary["trace_digest"]
    written = sorted(path.name for path in folder.iterdir())
    assert written == sorted(
        ["can1.log", "can2.log", "can3.log", "can4.log", "report.html", "summary.json", "variables.mf4"]
    )
    assert (folder / "report.html").read_text(encoding="utf-8").rstrip().endswith("</html>")


def test_json_on_standard_output_is_json_only(command):
    done = command("walk", "--time", "100ms", "--json", "-")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["controller"] == "record-2011"
    assert json.loads(done.stdout)["body"] == "ranger"
    assert done.stderr == ""


def test_the_version_is_printed(command):
    from ranger_sim import __version__

    done = command("--version")
    assert (done.returncode, done.stdout) == (0, f"ranger-sim {__version__}\n")


def test_every_command_has_its_own_help(capsys):
    for name in (each.name for each in COMMANDS if each.module is not None):
        with pytest.raises(SystemExit) as left:
            cli.main([name, "--help"])
        assert left.value.code == 0
        assert capsys.readouterr().out.startswith(f"usage: ranger-sim {name} ")
