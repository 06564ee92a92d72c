"""The command line starts without what the requested command does not need."""

import subprocess
import sys

LARGE = "cantools cffi h11 perfetto plotly elftools vcd scipy shtab starlette uvicorn websockets".split()
OF_A_WALK = "can numpy rich ranger_sim.harness ranger_sim.plant ranger_sim.boards ranger_sim.datatable".split()

PARSER = """
import sys
from ranger_sim.tools.cli import parser
parser()
print(sorted({name.partition(".")[0] for name in sys.modules} & set(sys.argv[1:])))
"""
LINE = """
import contextlib, io, sys
from ranger_sim.tools import cli
names, words = sys.argv[1].split(), sys.argv[2:]
nowhere = io.StringIO()
with contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere), contextlib.suppress(SystemExit):
    cli.main(words)
sys.__stderr__.write(" ".join(name for name in names if name in sys.modules))
"""


def loaded(names, *words):
    """Which of these modules a command line loads."""
    done = subprocess.run([sys.executable, "-c", LINE, " ".join(names), *words], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stderr


def test_the_options_are_known_before_any_large_library_is_loaded():
    done = subprocess.run([sys.executable, "-c", PARSER, *LARGE], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_version_help_and_a_mistyped_command_load_nothing_of_a_robot():
    for words in (["--version"], ["--help"], ["help"], ["wlak"]):
        assert loaded(OF_A_WALK, *words) == "", words


def test_the_options_of_a_command_load_no_other_command():
    others = ["ranger_sim.tools.diagnose.command", "ranger_sim.tools.panel.command", "ranger_sim.tools.run.up"]
    assert loaded([*others, "ranger_sim.tools.run.walk"], "walk", "--help") == "ranger_sim.tools.run.walk"


def test_the_options_of_a_diagnosis_load_no_can_library_and_no_reader_of_another_format():
    assert loaded(["can", "asammdf", "pandas", "scipy"], "diagnose", "--help") == ""


def test_a_bus_a_robot_without_adapters_and_the_versions_need_no_library_of_can_adapters_for_their_options():
    for name in ("bus", "info", "up"):
        assert loaded(["can", "asammdf", "pandas"], name, "--help") == "", name


def test_a_campaign_of_a_users_machine_loads_nothing_of_the_robot(tmp_path):
    (tmp_path / "servo.py").write_text("def new():\n    raise ValueError\n", encoding="utf-8")
    plan = tmp_path / "plan.toml"
    plan.write_text('title = "none"\n[machine]\nmake = "servo.py:new"\n[vary]\nseed = [1]\n', encoding="utf-8")
    names = "ranger_sim.ranger ranger_sim.boards ranger_sim.plant.ranger scipy ranger_sim.harness.campaigns.plan"
    done = subprocess.run(
        [sys.executable, "-c", LINE, names, "campaign", str(plan), "--replay", "x"],
        capture_output=True, text=True, cwd=tmp_path,
    )  # fmt: skip
    assert done.stderr == "ranger_sim.harness.campaigns.plan"
