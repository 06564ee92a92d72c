"""An engineer's first ten minutes: an empty project, a ten-line test, a broken function, the other backend."""

import re

import pytest

from tests.ranger.testing.project import ROOT, pytest_in, write

LAW = """\
def compliant_control(robot):
    law = robot.board("MCH").scheduler.find("mc_compliant_control").function

    def run():
        law()
        return None

    return run
"""
SLOW = LAW.replace("        law()\n", "        law()\n        robot.board('MCH').spend(22_000)\n")
WRONG = LAW.replace("        law()\n", "        law() / 0\n")

TEST = """\
import pytest
from boards.hip_law import compliant_control


@pytest.mark.ranger(seed=3)
def test_my_law_leaves_the_slots_their_time(ranger):
    ranger.replace("MCH", "mc_compliant_control", compliant_control(ranger), cost=1500, limit=2100)
    ranger.until("0.2 s")
    ranger.wire("can1").assert_period("MCH_ANGLE", "2 ms", jitter="100 us")
    ranger.wire("can1").assert_execution_time("MCH", at_most="450 us")
"""
NAME = "test_my_law_leaves_the_slots_their_time"


@pytest.fixture
def project(tmp_path):
    """Folders called as ours are, so that they are not mixed up."""
    write(tmp_path, tests__test_hip=TEST, boards__hip_law=LAW, tools__mine="print('mine')\n")
    return tmp_path


def test_a_ten_line_test_passes_and_says_what_was_measured(project):
    assert len(TEST.splitlines()) == 10
    done = pytest_in(project)
    assert done.code == 0, done.text
    properties = done.properties(NAME)
    assert properties["ranger_sim_seed"] == "3" and properties["ranger_sim_backend"] == "sim"
    assert len(properties["ranger_sim_table"]) == 64 and properties["ranger_sim_version"]
    assert properties["period of MCH_ANGLE on can1"].endswith("(limit 2 ms +- 100 us)")
    assert properties["execution time of MCH"].endswith("us (limit 450 us)")


def test_a_function_made_too_slow_fails_with_a_readable_reason(project):
    write(project, boards__hip_law=SLOW)
    done = pytest_in(project)
    assert done.code == 1
    reason = done.text
    # 22,000 cycles of 60 MHz are 367 us: slots that do more than usual overrun, and the row that publishes the angle is
    # dropped now and then, so its period says so
    assert "MCH_ANGLE on can1: " in reason
    assert "once more: pytest" in reason and "--ranger-seed 3 --ranger-backend sim" in reason
    assert "ERROR_MCH ASCHED_DNF x " in reason and "slot overruns: MCH " in reason
    assert "last frames:" in reason
    assert "harness/testing/wire.py" not in reason  # no traceback through our rooms


def test_the_same_test_on_processes_passes_and_fails_alike(project):
    done = pytest_in(project, "--ranger-backend", "processes")
    assert done.code == 0, done.text
    assert done.properties(NAME)["ranger_sim_backend"] == "processes"
    write(project, boards__hip_law=WRONG)
    done = pytest_in(project, RANGER_SIM_BACKEND="processes")
    assert done.code == 1
    assert "MCH: its process ended with code 4 before" in done.reason(NAME)
    assert "TypeError: unsupported operand" in done.reason(NAME) and "hip_law.py" in done.reason(NAME)


def test_without_the_plugin_the_fixture_does_not_exist(project):
    done = pytest_in(project, "-p", "no:ranger_sim", plugin=False)
    assert done.code == 1
    assert "fixture 'ranger' not found" in done.text


def test_the_plugin_imports_nothing_of_the_robot_before_a_fixture_does(tmp_path):
    write(
        tmp_path,
        test_imports="""
import sys

def test_what_is_imported():
    heavy = {"numpy", "scipy", "can", "rich", "asammdf", "plotly", "cython", "ranger_sim.ranger.robot"}
    assert heavy & set(sys.modules) == set()
    inside = [name for name in sys.modules if name.startswith("ranger_sim.")]
    assert "ranger_sim.ranger.testing.plugin" in inside
    assert {name.split(".")[1] for name in inside} <= {"loading", "harness", "ranger"}
""",
    )
    done = pytest_in(tmp_path)
    assert done.code == 0, done.text


def test_what_the_documents_show_runs(tmp_path):
    blocks = []
    for document in ("docs/testing.md", "README.md"):
        blocks += re.findall(r"^```python\n(.*?)^```", (ROOT / document).read_text(encoding="utf-8"), re.M | re.S)
    tests = [block for block in blocks if "def test_" in block]
    [law] = [block for block in blocks if block.startswith("def compliant_control")]
    [calls] = [block for block in blocks if "with contextlib.closing(new_robot(" in block]
    assert len(tests) == 3 and TEST in tests and law == LAW.replace("law()\n", "law()  # or your own\n", 1)
    for number, text in enumerate(tests):
        write(tmp_path, **{f"tests__test_shown_{number}": "import pytest\n\n" + text})
    write(tmp_path, boards__hip_law=law, tests__test_calls="def test_calls():\n    exec(" + repr(calls) + ", {})\n")
    done = pytest_in(tmp_path)
    assert done.code == 0 and len(done.cases) == 5, done.text
