"""Every Python example of the documents is run as written there."""

import importlib
import pathlib
import re
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parent.parent
# What each document's examples, run one after the other in one process, must print among other things.
PRINTED = {
    "README.md": (r"^[1-9]\d* -?0\.\d+ \d{4,5}$",),
    "docs/how-to/calibration.md": (
        r"^a master finds it on port \d+$",
        r"^ff 05 80 08 08 00 01 01$",
        r"^ff 72 61 6e 67 65 72$",
    ),
    "docs/how-to/co-simulation.md": (r"^fell at \d\.\d{3} s, -?\d\.\d\d A$",),
    "docs/how-to/read.md": (
        r"^\[0.1 0.3 0.2 0.4 0.5\] \{'names': 1, 'rows': 5, 'left out: ragged': 1\}$",
        r"^\['ragged', 'reversed_stamps'\] \['sorted'\]$",
        r"^\[0.1 0.2 0.3 0.4 0.5\]$",
    ),
    "docs/how-to/can-tools.md": (r"ID: +123 .*'ranger'", r"^BusState\.ERROR$"),
    "docs/explanation/can-fd.md": (r"^Timestamp: .* ID: +123 +S Rx +F BS +DL: 64 ",),
    "docs/slot-timing.md": (r"^3 7460 53% left$",),
    "docs/faults.md": (r"^True 100 counts True$",),
    # the longest wait of a frame on CAN1, µs
    "docs/timeline.md": (r"^\d{1,3}\.\d+$",),
    "firmware_sim/README.md": (r"^5 1 0$",),
    "sysid/README.md": (r"^400 1\.0$",),
}


# Read from top to bottom, files, commands and all: tests/pages/test_pages.py.
WALKED = {
    "docs/tutorial.md",
    "docs/how-to/firmware-image.md",
    "docs/how-to/variable.md",
    "docs/how-to/c-firmware.md",
    "docs/how-to/machine.md",
    "docs/how-to/diagnose-in-python.md",
    "docs/how-to/canopen.md",
    "docs/how-to/j1939.md",
    "docs/how-to/uds.md",
}
# Its examples, tests and a law beside them, are run in a project of their own: harness/testing/test_in_a_project.py.
IN_A_PROJECT = "docs/testing.md"
# Its machine diagnoses hidden effects: sysid/test_machines_of_a_user.py.
A_MACHINE = "docs/diagnose-your-machine.md"
# Their commands are run in a folder of their own: tests/pages.
PAGES = {"docs/how-to/canopen-drive.md", "docs/how-to/mujoco.md", "docs/how-to/fmu-body.md"}


def examples(name):
    """The Python blocks of a document, in order; without tests, which are run in their own project as well."""
    blocks = re.findall(r"^```python\n(.*?)^```", (ROOT / name).read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    return [block for block in blocks if "def test_" not in block]


def test_every_document_with_python_examples_is_run():
    documents = [path.relative_to(ROOT) for path in ROOT.rglob("*.md")]
    found = {
        path.as_posix()
        for path in documents
        if not {".venv", "build", "tests", ".pytest_cache"} & set(path.parts) and examples(path)
    }
    assert found == {*PRINTED, IN_A_PROJECT, A_MACHINE, *PAGES, *WALKED}


@pytest.mark.parametrize("name", PRINTED)
def test_the_examples_run_without_a_warning_and_print_what_they_promise(name):
    program = "\n".join(examples(name))
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", program],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert (done.returncode, done.stderr) == (0, "")
    for pattern in PRINTED[name]:
        assert re.search(pattern, done.stdout, re.MULTILINE), f"no {pattern!r} in:\n{done.stdout}"


def test_recordings_to_try_a_diagnosis_on_are_written_with_the_fault_that_is_chosen(tmp_path, monkeypatch, capsys):
    monkeypatch.syspath_prepend(str(ROOT / "examples"))
    bench_recording = importlib.import_module("bench_recording")
    (tmp_path / "mine.toml").write_text(
        '[[term]]\nform = "spring"\nat = "hip_joint"\ncubic_Nm_per_rad3 = 1.0\n', encoding="utf-8"
    )
    tables = []
    for arguments in ([], [str(tmp_path / "mine.toml")]):
        assert bench_recording.main(arguments, tmp_path, 0.5) == 0
        lines = (tmp_path / "run1.csv").read_text(encoding="utf-8").splitlines()
        assert lines[0] == "t_s,voltage_V,current_A,speed_rad_per_s,torque_Nm,motor_angle_rad" and len(lines) == 251
        tables.append(lines)
    assert tables[0] != tables[1] and (tmp_path / "run2.csv").is_file()
    assert capsys.readouterr().err == "spring at hip_joint has no part in this bench\n"
    assert bench_recording.main([str(tmp_path / "none.toml")], tmp_path, 0.5) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_the_example_of_co_simulation_lets_the_robot_fall_six_times(tmp_path):
    pytest.importorskip("pythonfmu3")
    pytest.importorskip("fmpy")
    unit = tmp_path / "body.fmu"
    for command in (["-m", "ranger_sim", "fmu", unit], ["-W", "error", ROOT / "examples" / "co_simulation.py", unit]):
        done = subprocess.run([sys.executable, *command], cwd=ROOT, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    assert len(re.findall(r"^ ?\d+\.91 kg, duty \d+%: fell after [01]\.\d{3} s, motor at most", done.stdout, re.M)) == 6
