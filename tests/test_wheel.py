"""The wheel, really built, installed into an empty environment, used with a user's code."""

import json
import os
import pathlib
import shutil
import site
import subprocess
import sys
import tarfile
import zipfile

import pytest

from ranger_sim import loading

ROOT = pathlib.Path(__file__).resolve().parent.parent
# folders that a user's project may well have; importing one of them instead of ours would be told
OWN_FOLDERS = (
    "boards",
    "can_bus",
    "datatable",
    "firmware_sim",
    "foundation",
    "harness",
    "plant",
    "profiles",
    "ranger",
    "sysid",
    "tools",
)
COMMANDS = """\
import contextlib, io
from ranger_sim.tools.cli import parser

[commands] = [each for each in parser()._actions if each.dest == "command"]
for name in commands.choices:
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.suppress(SystemExit):
        parser().parse_args([name, "--help"])
    assert "usage: ranger-sim " + name in out.getvalue(), name
print(len(commands.choices))
"""
PROGRAM = """\
import boards, plant, tools  # the project's own
import can
import ranger_sim
from ranger_sim import Quirks, Ranger, Scenario, StopRule, load_profile

robot = Ranger(Scenario(seed=3), quirks=Quirks(), profile=load_profile("hil-1mbit"))
robot.run(StopRule(time_s=0.02), 0.02)
print(robot.board("MCH").scheduler.max_slot_cycles > 0, robot.variable("MCH_ANGLE"))
robot.close()
with can.Bus(interface="ranger_sim", channel="demo", bitrate=500_000, speed="max") as a:
    with can.Bus(interface="ranger_sim", channel="demo", speed="max") as b:
        a.send(can.Message(arbitration_id=0x123, data=b"ranger", is_extended_id=False))
        print(b.recv(10.0).data.decode())
print(ranger_sim.__file__, boards.OWNER, plant.OWNER, tools.OWNER)
"""


def run(command, cwd, **environment):
    """A program with little of this environment; its output. It must succeed."""
    kept = {name: value for name, value in os.environ.items() if name in ("PATH", "HOME", "LANG", "TMPDIR", "CC")}
    done = subprocess.run(
        list(map(str, command)),
        cwd=cwd,
        env={**kept, **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def built_wheel(folder):
    """The wheel that setup.py makes of this tree; objects that were compiled here are used again."""
    folder.mkdir()
    places = ["build", "--build-lib", folder / "lib", "egg_info", "--egg-base", folder]
    run(
        [sys.executable, "setup.py", "-q", *places]
        + ["bdist_wheel", "--dist-dir", folder / "dist", "--bdist-dir", folder / "bdist"],
        ROOT,
    )
    [distribution] = (folder / "dist").iterdir()
    return distribution


def environment_with(wheel, folder):
    """(Python, folder of packages) of an empty environment with `wheel` installed; the rest is lent to it."""
    run([sys.executable, "-m", "venv", "--without-pip", folder], folder.parent)
    python = folder / "bin" / "python"
    here = ["--no-deps", "--no-index", "--no-build-isolation", "--no-compile", "--disable-pip-version-check"]
    run([sys.executable, "-m", "pip", "--python", python, "install", "-q", *here, wheel], folder.parent)
    packages = pathlib.Path(
        run([python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"], folder).strip()
    )
    lent = [*site.getsitepackages(), *(each for each in sys.path if each.endswith("site-packages"))]
    (packages / "lent.pth").write_text("\n".join(dict.fromkeys(lent)) + "\n", encoding="utf-8")
    return python, packages


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    return built_wheel(tmp_path_factory.mktemp("wheel") / "made")


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """(Python with the wheel, folder of a project that has folders of our packages' names)."""
    folder = tmp_path_factory.mktemp("installed")
    project = folder / "project"
    for name in OWN_FOLDERS:
        (project / name).mkdir(parents=True)
        (project / name / "__init__.py").write_text("OWNER = 'project'\n", encoding="utf-8")
    return environment_with(wheel, folder / "venv")[0], project


def test_the_wheel_has_one_top_level_and_the_library_when_there_is_one_here(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.partition("/")[0].partition("-")[0] for name in names} == {"ranger_sim"}
    tops = {name.partition("/")[0] for name in names if ".dist-info/" not in name}
    assert tops == {"ranger_sim"}
    assert "ranger_sim/py.typed" in names and "ranger_sim/datatable/master/variables.csv" in names
    if loading.RUNS_COMPILED:
        built = {name.partition(".")[0] for name in names if name.endswith((".so", ".pyd"))}
        assert built == {name.replace(".", "/") for name in [*loading.declared_modules(), "ranger_sim._shared"]}


@pytest.mark.skipif(not any(map(shutil.which, ("cc", "gcc", "clang"))), reason="no C compiler is installed here")
def test_a_new_project_of_the_installed_package_passes_its_tests(installed, tmp_path):
    python, _ = installed
    run([python.with_name("ranger-sim"), "new", "wheel"], tmp_path)
    assert "3 passed" in run([python, "-m", "pytest", "-q", "-p", "no:cacheprovider"], tmp_path / "wheel")


def test_every_command_runs_from_a_project_with_folders_of_the_same_names(installed, tmp_path):
    python, project = installed
    command = python.with_name("ranger-sim")
    assert run([command, "--version"], project) == run([python, "-m", "ranger_sim", "--version"], project)
    assert int(run([python, "-c", COMMANDS], project)) >= 12
    reported = run([command, "walk", "--time", "200ms", "--out", tmp_path / "out", "--json", "-"], project)
    here = run([sys.executable, "-m", "ranger_sim", "walk", "--time", "200ms", "--json", "-"], ROOT)
    assert json.loads(reported)["trace_digest"] == json.loads(here)["trace_digest"]
    assert (tmp_path / "out" / "report.html").stat().st_size > 100_000
    assert "MCH_ANGLE" in run([command, "table", "show", "MCH_ANGLE"], project)
    run([command, "table", "generate", "--check"], project)
    assert json.loads(run([command, "can-bounds", "--profile", "hil-1mbit", "--json", "-"], project))["met"]
    if loading.RUNS_COMPILED:
        assert "compiled" in run([command, "info"], project)


def test_a_program_of_that_project_uses_the_robot_and_the_can_interface(installed):
    python, project = installed
    program = project / "program.py"
    program.write_text(PROGRAM, encoding="utf-8")
    true, frame, places = run([python, program], project).splitlines()[-3:]
    assert true.startswith("True ") and frame == "ranger"
    assert places.endswith(" project project project")
    assert pathlib.Path(places.split()[0]).is_relative_to(python.parent.parent)


def files_of_the_package(names):
    """The files of the package, without what only a build with a compiler leaves."""
    return {
        name for name in names if name.startswith("ranger_sim/") and not name.endswith((".so", "build_record.json"))
    }


def test_a_source_distribution_installs_the_files_of_the_wheel_and_without_a_compiler_it_runs(wheel, tmp_path):
    tree = tmp_path / "tree"  # as a checkout: what was built here is not looked at
    left = shutil.ignore_patterns(
        ".git", ".venv", "build", "dist", "runs", "*.so", "*.egg-info", "__pycache__", ".*_cache"
    )
    shutil.copytree(ROOT, tree, ignore=left)
    run([sys.executable, "setup.py", "-q", "sdist", "--dist-dir", tmp_path / "dist"], tree)
    [archive] = (tmp_path / "dist").iterdir()
    with tarfile.open(archive) as files:
        files.extractall(tmp_path / "unpacked", filter="data")
    [source] = (tmp_path / "unpacked").iterdir()
    made = [sys.executable, "setup.py", "-q", "bdist_wheel", "--dist-dir", tmp_path / "made"]
    run(made, source, RANGER_SIM_INTERPRETED="1")
    [of_source] = (tmp_path / "made").iterdir()
    python, packages = environment_with(of_source, tmp_path / "venv")
    found = {path.relative_to(packages).as_posix() for path in (packages / "ranger_sim").rglob("*") if path.is_file()}
    assert files_of_the_package(found) == files_of_the_package(zipfile.ZipFile(wheel).namelist())
    assert json.loads(run([python, "-m", "ranger_sim", "info", "--json"], tmp_path))["compiled"] is False
