"""A library that is not installed: one line that names it, the command, and what installs it here; exit code 2."""

import importlib.metadata
import json
import os
import pathlib
import re
import subprocess
import sys

import pytest

from ranger_sim import loading
from ranger_sim.tools.command_line import libraries

ROOT = pathlib.Path(__file__).resolve().parents[3]
HIDING = """
import sys

class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == sys.argv[1]:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Hidden())
from ranger_sim.tools.cli import main
sys.exit(main(sys.argv[2:]))
"""
CAMPAIGN = '[vary]\nseed = [1]\nfault = ["UI.imu:gyro_bias@4s"]\n'
# every library of pyproject.toml, by a command that needs it
NEEDED = {
    "asammdf": ["diagnose run.mf4 --experiment motor-bench"],
    "can": ["check-bus hil-1mbit", "up --bus can1=virtual:x --steps 1"],
    "cantools": ["can-bounds --dbc x.dbc"],
    "cffi": [f"walk --time 50ms --firmware MCH={ROOT / 'examples' / 'hip_in_c'}"],
    "cryptography": ["campaign few.toml --out c --pool dask"],
    "distributed": ["campaign few.toml --out c --pool dask", "campaign few.toml --out c --scheduler tls://x:1"],
    "elftools": ["walk --image MCH=hip.axf"],
    "h11": ["panel"],
    "h5py": ["read t.h5"],
    "jinja2": ["campaign few.toml --out c"],
    "mcap": ["walk --time 50ms --trace t.mcap"],
    "mujoco": ["new m --plant mujoco robot.xml"],
    "nptdms": ["read t.tdms"],
    "numpy": ["walk --time 50ms", "diagnose run.csv --experiment motor-bench"],
    "perfetto": ["walk --time 50ms --trace t.pftrace"],
    "plotly": ["campaign few.toml --out c"],
    "pyarrow": ["read t.parquet"],
    "pyulog": ["read t.ulg"],
    "pythonfmu3": ["fmu b.fmu"],
    "rich": ["info", "walk --time 50ms"],
    "scipy": [
        "diagnose run.csv --experiment motor-bench",
        "identify all --out f",
        "causes --experiment motor-bench --channels angle",
    ],
    "serial": ["up --time 50ms --daq-port /dev/nowhere"],
    "shtab": ["completion bash"],
    "starlette": ["panel"],
    "threadpoolctl": ["diagnose run.csv --experiment motor-bench"],
    "uvicorn": ["panel"],
    "vcd": ["walk --time 50ms --trace t.vcd"],
    "websockets": ["panel --walk"],
}
OF_INTERPRETED_RUNS = {"cython"}  # compiled modules do without, and plain ones do not start without


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "few.toml").write_text(CAMPAIGN)
    (tmp_path / "hip.axf").write_bytes(b"\x7fELF")
    (tmp_path / "t.parquet").write_bytes(b"PAR1")
    (tmp_path / "t.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100))
    (tmp_path / "t.tdms").write_bytes(b"TDSm" + bytes(100))
    (tmp_path / "t.ulg").write_bytes(b"ULog\x01\x12\x35")
    (tmp_path / "robot.xml").write_text("<mujoco/>")
    for name in ("run.csv", "run.mf4", "x.dbc"):
        (tmp_path / name).write_text("t,angle\n0,1\n")
    return tmp_path


def without(library, words, folder):
    """A command run where a library is not installed."""
    return subprocess.run(
        [sys.executable, "-c", HIDING, library, *words],
        cwd=folder,
        env={"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin", "HOME": str(folder)},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


@pytest.mark.parametrize(("library", "command"), [(name, each) for name, several in NEEDED.items() for each in several])
def test_a_missing_library_is_named_in_one_line_with_what_installs_it(library, command, folder):
    done = without(library, command.split(), folder)
    assert done.returncode == 2, done.stderr
    *before, line = done.stderr.splitlines()
    package = libraries.PACKAGES.get(library, library)
    name = command.split()[0]
    assert line.startswith(
        f"ranger-sim: {name} needs the library {package}, which is not installed; this installs it: "
    )
    assert before == []


def test_a_bus_is_hosted_without_python_can(folder):
    done = without("can", ["bus", "--name", f"without-{os.getpid()}", "--seconds", "0.01", "--slcan", "can1"], folder)
    assert (done.returncode, done.stderr) == (0, "") and "can1: 0 frames, 0 error frames" in done.stdout


def test_a_walk_without_the_library_of_its_report_keeps_everything_else_and_says_what_installs_it(folder):
    done = without("plotly", ["walk", "--time", "50ms", "--out", "o"], folder)
    assert done.returncode == 0, done.stderr
    assert "report.html needs the library plotly, which is not installed; this installs it: " in done.stderr
    assert done.stderr.splitlines()[-1] == "summary: o/summary.json"
    summary = json.loads((folder / "o" / "summary.json").read_text())
    assert summary["complete"] and "variables.mf4" in summary["files"] and "report.html" not in summary["files"]


def test_every_library_of_the_package_is_hidden_once():
    listed = importlib.metadata.requires("ranger-sim")
    tools = {"docs", "dev"}
    packages = {
        libraries._name(line)
        for line in listed
        if not (found := re.search(r"extra == ['\"](.+?)['\"]", line)) or found[1] not in tools
    }
    hidden = {libraries._name(libraries.PACKAGES.get(each, each)) for each in NEEDED} | {"ranger-sim"}
    assert packages - OF_INTERPRETED_RUNS <= hidden | {"protobuf"}


def test_a_library_of_the_package_comes_by_pip_as_it_asks_for_it(monkeypatch):
    monkeypatch.setattr(sys, "executable", str(pathlib.Path.cwd() / "env" / "bin" / "python"))
    assert libraries.installs("cantools") == 'env/bin/python -m pip install "cantools>=40"'
    assert libraries.installs("of_a_user") == 'env/bin/python -m pip install "of_a_user"'


def test_an_extra_comes_whole_by_make_where_make_made_the_environment_and_else_by_pip(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "executable", "/elsewhere/bin/python")
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    by_pip = '/elsewhere/bin/python -m pip install "ranger-sim[{}]"'
    assert libraries.installs("mcap") == by_pip.format("mcap")
    assert libraries.installs("scipy", "campaign") == by_pip.format("campaign")
    assert libraries.installs("scipy", "identify") == by_pip.format("diagnose")
    assert libraries.installs("plotly", "campaign") == by_pip.format("campaign")
    assert libraries.installs("plotly", "walk") == by_pip.format("report")
    (tmp_path / "installed-walk.txt").touch()
    monkeypatch.chdir(loading.CHECKOUT)
    assert libraries.installs("mcap") == "make setup"
    monkeypatch.chdir(tmp_path)
    assert libraries.installs("mcap") == f"make -C {loading.CHECKOUT} setup"


@pytest.mark.parametrize("module", ["ranger_sim.nothing", "fcntl", ""])
def test_what_is_not_a_library_stays_a_fault_of_the_program(module):
    assert libraries.missing(ModuleNotFoundError("no", name=module), "walk") is None
