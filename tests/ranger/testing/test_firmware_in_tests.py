"""Tests of firmware in C: a crash fails its test and no other, as does what a sanitizer finds; lines are counted."""

import re
import shutil

import pytest

from tests.firmware_sim.native.support import COMPILER, folder_with
from tests.firmware_sim.native.test_sanitizers import LINES, MANIFEST, PROGRAM, has_sanitizers
from tests.ranger.testing.project import pytest_in, write

pytestmark = pytest.mark.skipif(
    not COMPILER or shutil.which("addr2line") is None, reason="no C compiler and addr2line here"
)
CRASH = "if (slots > 20) *(volatile int32_t *)8 = 1; "
ENDLESS = "while (slots > 20) behind[0]++; "
TESTS = """
import pytest

@pytest.mark.board("MCH", firmware="{first}")
def test_a(board):
    board.run_for("20 ms")
    assert board.chip.scheduler.slot_count > 20

@pytest.mark.ranger(firmware={{"MCH": "{second}"}})
@pytest.mark.expects(lost_frames=True)
def test_b(ranger):
    ranger.run_for(0.03)
    assert ranger.counters()["MCH"].slots.count > 20

@pytest.mark.board("MCH", firmware="{third}")
def test_c(board):
    board.run_for("20 ms")
"""


def folder(place, count=10, step=0, more=""):
    source = PROGRAM.replace("COUNT", str(count)).replace("STEP", str(step)).replace("slots++;", f"slots++; {more}")
    return folder_with(place, source, MANIFEST)


def project(place, **folders):
    write(place, test_firmware=TESTS.format(**folders))
    return place


def outcomes(done):
    return {name: done.outcome(name) for name in done.cases}


def test_a_crash_and_an_endless_loop_fail_their_test_with_function_and_line_and_no_other(tmp_path):
    made = project(
        tmp_path,
        first=folder(tmp_path / "crash", more=CRASH),
        second=folder(tmp_path / "endless", more=ENDLESS),
        third=folder(tmp_path / "well"),
    )
    done = pytest_in(made)
    assert outcomes(done) == {"test_a": "failure", "test_b": "failure", "test_c": "passed"}
    line = next(i for i, text in enumerate(PROGRAM.splitlines(), 1) if "slots++;" in text)
    assert f"MCH: SIGSEGV (Segmentation fault) in control() at small.c:{line}" in done.text
    assert f"MCH: its program let no time pass in control() at small.c:{line}" in done.text


def test_in_its_own_process_a_crash_is_reported_by_the_health_of_the_robot(tmp_path):
    crash = folder(tmp_path / "crash", more=CRASH)
    write(
        tmp_path,
        test_own=f"""
import pytest

@pytest.mark.ranger(firmware={{"MCH": "{crash}"}}, in_process=False)
@pytest.mark.expects(dead="MCH", lost_frames=True, bus_errors=True)
@pytest.mark.expects_errors("CSR:CAN_TX_QUEUE_FULL")
def test_the_robot_goes_on(ranger):
    ranger.run_for(0.03)
    (death,) = ranger.deaths
    assert death["board"] == "MCH" and "control() at small.c" in death["why"]
""",
    )
    done = pytest_in(tmp_path)
    assert done.outcome("test_the_robot_goes_on") == "passed", done.text


@pytest.mark.skipif(not has_sanitizers(), reason="no compiler with sanitizers here")
def test_what_a_sanitizer_finds_fails_the_test_that_meets_it(tmp_path):
    made = project(
        tmp_path,
        first=folder(tmp_path / "bounds", count=11),
        second=folder(tmp_path / "overflow", step=10),
        third=folder(tmp_path / "well"),
    )
    assert set(outcomes(pytest_in(made)).values()) == {"passed"}
    done = pytest_in(made, "--ranger-sanitize", "yes")
    assert outcomes(done) == {"test_a": "failure", "test_b": "failure", "test_c": "passed"}
    write_ = f"firmware: small.c:{LINES['WRITE']}: global-buffer-overflow: write of 4 bytes in control()"
    assert write_ in done.text
    assert f"firmware: small.c:{LINES['SUM']}: signed integer overflow: 2147483640 + 10 cannot be" in done.text


@pytest.mark.skipif(shutil.which("gcov") is None, reason="no gcov here")
def test_the_lines_of_all_tests_together_are_counted_into_one_tracefile(tmp_path):
    well = folder(tmp_path / "well")
    made = project(tmp_path, first=well, second=well, third=well)
    done = pytest_in(made, "--ranger-coverage", str(tmp_path / "lcov.info"))
    assert set(outcomes(done).values()) == {"passed"}
    counts = dict(re.findall(r"^DA:(\d+),(\d+)$", (tmp_path / "lcov.info").read_text(encoding="utf-8"), re.M))
    # 20, 30 and 20 ms, of which some three are start-up in each; a slot is 0.5 ms
    assert 115 <= int(counts[str(LINES["WRITE"])]) <= 140
    assert "small.c: " in done.text
