"""Findings of the compiler's sanitizers are reported with file and line, and the run is otherwise the same."""

import contextlib
import json
import pathlib
import re
import shutil
import subprocess
import sys

import pytest

from ranger_sim.firmware_sim.native import sanitizers
from ranger_sim.foundation.user_error import UserError
from ranger_sim.ranger.robot import Ranger
from tests.firmware_sim.native.support import COMPILER, folder_with

ROOT = pathlib.Path(__file__).resolve().parents[3]
PATIENCE_S = 240.0  # a guard; nothing asserts on it
MANIFEST = "[firmware]\nname = 'small'\ntables = ['mch']\n"
PROGRAM = """
#include <ranger_sim/firmware.h>
#include "mch_table.h"
static int32_t table[10];
static int32_t behind[10];
static int32_t total = 2147483600;
static uint32_t slots;
static int32_t *volatile any = table;
static int32_t control(void)
{
    slots++;
    any[slots % COUNT] = 5; /* WRITE */
    total += STEP;          /* SUM */
    return behind[0] - behind[0];
}
static const fw_task every[] = {{control, "control", 20, 30}};
static const fw_schedule schedule = {
    .slot_ns = 500000, .every = FW_TASKS(every), .tick_cost = 60, .tick_vic_slot = 4};
void firmware_start(void) { fw_can_start(1, 0x00254001, 0); }
const fw_schedule *firmware_schedule(void) { return &schedule; }
uint32_t firmware_table_version(void) { return RANGER_TABLE_VERSION; }
"""
LINES = {
    found[1]: number
    for number, line in enumerate(PROGRAM.splitlines(), 1)
    if (found := re.search(r"/\* ([A-Z]+) +\*/", line))
}


def has_sanitizers():
    """The compiler has its runtime."""
    with contextlib.suppress(UserError):
        return bool(sanitizers.environment(ROOT))
    return False


needs_sanitizers = pytest.mark.skipif(
    not COMPILER or not has_sanitizers() or shutil.which("addr2line") is None,
    reason="no C compiler with sanitizers and addr2line here",
)


def walked(folder, count, step, command="walk", *more):
    """A run of the program with sanitizers."""
    source = PROGRAM.replace("COUNT", str(count)).replace("STEP", str(step))
    folder_with(folder, source, MANIFEST)
    return subprocess.run(
        [sys.executable, "-m", "ranger_sim", command, "--time", "100ms", "--firmware", f"MCH={folder}", "--sanitize"]
        + ["--json", "-", *more],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )


def found_in(done):
    return [line for line in done.stderr.splitlines() if line.startswith("ranger-sim: firmware:")]


@needs_sanitizers
@pytest.mark.parametrize("how", [("walk",), ("up", "--speed", "max", "--no-real-time", "--name", "test-sanitizers")])
def test_a_planted_write_out_of_bounds_and_an_overflow_are_found(tmp_path, how):
    done = walked(tmp_path / "fw", 11, 10, *how)
    found = found_in(done)
    place = "ranger-sim: firmware: small.c:"
    assert f"{place}{LINES['WRITE']}: global-buffer-overflow: write of 4 bytes in control()" in found
    overflow = "signed integer overflow: 2147483640 + 10 cannot be represented in type 'int'"
    assert f"{place}{LINES['SUM']}: {overflow} in control()" in found
    # the undefined-behaviour sanitizer may tell the write as well, where it knows the object's size
    assert all(line.startswith((f"{place}{LINES['WRITE']}:", f"{place}{LINES['SUM']}:")) for line in found)
    assert done.returncode == 1
    assert "AddressSanitizer" not in done.stderr
    summary = json.loads(done.stdout)["firmware"]["MCH"]
    assert {"file": "small.c", "line": LINES["SUM"], "function": "control", "text": overflow, "count": 1} in (
        summary["findings"]
    )
    assert sorted(each["line"] for each in summary["findings"])[0] == LINES["WRITE"]
    assert len(summary["findings"]) == len(found)


@needs_sanitizers
def test_a_clean_program_has_no_findings_and_the_digest_of_a_run_without_sanitizers(tmp_path):
    done = walked(tmp_path / "fw", 10, 0)
    assert done.stderr == ""
    assert done.returncode == 0
    with contextlib.closing(Ranger(firmware={"MCH": tmp_path / "fw"})) as robot:
        robot.run_for(0.1)
        assert json.loads(done.stdout)["trace_digest"] == robot.summary()["trace_digest"]


@needs_sanitizers
def test_building_with_sanitizers_checks_the_library(tmp_path):
    folder = folder_with(tmp_path / "fw", PROGRAM.replace("COUNT", "10").replace("STEP", "0"), MANIFEST)
    done = subprocess.run(
        [sys.executable, "-m", "ranger_sim", "firmware", "build", "--sanitize", str(folder)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"{folder / 'build' / 'small-sanitize.so'}\n"


def test_sanitizers_without_firmware_are_refused_in_one_line():
    done = subprocess.run(
        [sys.executable, "-m", "ranger_sim", "walk", "--sanitize"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr == (
        "ranger-sim: --sanitize: there is no firmware in C in this run; --firmware BOARD=DIR gives a board one\n"
    )


def test_a_compiler_without_the_runtime_is_reported(tmp_path, monkeypatch):
    compiler = tmp_path / "plaincc"
    compiler.write_text("#!/bin/sh\necho libasan.so\n", encoding="utf-8")
    compiler.chmod(0o755)
    monkeypatch.setenv("CC", str(compiler))
    with pytest.raises(UserError, match=r"plaincc has no runtime of the address sanitizer \(libasan\.so\)"):
        sanitizers.environment(tmp_path)


def test_a_repeated_finding_is_reported_once_without_its_address(tmp_path):
    (tmp_path / "findings.7").write_text(
        f"{tmp_path}/fw/a.c:3:9: runtime error: load of null pointer\n"
        f"{tmp_path}/fw/b.c:4:1: runtime error: store to address 0x7f00aa with insufficient space\n"
    )
    (tmp_path / "findings-undefined.8").write_text(
        f"{tmp_path}/fw/b.c:4:1: runtime error: store to address 0x7f00bb with insufficient space\n"
        "/elsewhere/c.c:5:1: runtime error: shift exponent 33 is too large\n"
        "==8==ERROR: AddressSanitizer: stack-buffer-overflow on address 0x7f\nREAD of size 8 at 0x7f\n"
        "    #0 0x1 in memcpy (/lib/libc.so.6+0x1)\n"
    )
    found = sanitizers.findings(tmp_path, [sanitizers.Program(tmp_path / "fw" / "build" / "a.so", tmp_path / "fw")])
    assert [(each.describe(), each.count) for each in found] == [
        ("stack-buffer-overflow: read of 8 bytes, outside of the program's code", 1),
        ("a.c:3: load of null pointer", 1),
        ("b.c:4: store to an address with insufficient space", 2),
        ("c.c:5: shift exponent 33 is too large", 1),
    ]
