"""Executed lines and branches of a program in C are reported: counts known by hand, in every kind of process."""

import json
import pathlib
import re
import shutil
import subprocess
import sys

import pytest

from ranger_sim.firmware_sim.native import coverage
from ranger_sim.foundation.user_error import UserError
from tests.firmware_sim.native.support import COMPILER, folder_with

ROOT = pathlib.Path(__file__).resolve().parents[3]
PATIENCE_S = 240.0  # a guard; nothing asserts on it
MANIFEST = "[firmware]\nname = 'small'\ntables = ['{table}']\n"
PROGRAM = """
#include <ranger_sim/firmware.h>
#include "{table}_table.h"
static uint32_t slots;
static int32_t control(void)
{{
    slots++; /* SLOTS */
    if (slots > 20) {{
        slots += 0; /* LATER */
        AT_THE_END
    }}
    if (slots > 4000000)
        slots = 0; /* NEVER */
    return 0;
}}
static const fw_task every[] = {{{{control, "control", 20, 30}}}};
static const fw_schedule schedule = {{
    .slot_ns = 500000, .every = FW_TASKS(every), .tick_cost = 60, .tick_vic_slot = 4}};
void firmware_start(void)
{{
    fw_can_start(1, 0x00254001, 0);
    fw_can_start(2, 0x00254001, 0); /* one board has its bus here, the other there */
}}
const fw_schedule *firmware_schedule(void) {{ return &schedule; }}
uint32_t firmware_table_version(void) {{ return RANGER_TABLE_VERSION; }}
"""
LINES = {
    found[1]: number
    for number, line in enumerate(PROGRAM.splitlines(), 1)
    if (found := re.search(r"/\* ([A-Z]+) \*/", line))
}
needs_gcov = pytest.mark.skipif(not COMPILER or shutil.which("gcov") is None, reason="no gcc with gcov here")


def folder_of(place, end="", table="mch"):
    source = PROGRAM.format(table=table).replace("AT_THE_END", end)
    return folder_with(place, source, MANIFEST.format(table=table))


def run(command, out, *more):
    """A run of 20 ms; its summary, its counts by line, and the run."""
    done = subprocess.run(
        [sys.executable, "-m", "ranger_sim", command, "--time", "20ms", "--coverage", "--out", str(out), *more],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    info = (out / "lcov.info").read_text(encoding="utf-8")
    return summary, {int(line): int(count) for line, count in re.findall(r"^DA:(\d+),(\d+)$", info, re.M)}, done


@needs_gcov
@pytest.mark.parametrize(
    "how",
    [("walk",), ("walk", "--in-process"), ("up", "--speed", "max", "--no-real-time", "--name", "test-coverage")],
    ids=["own process", "in process", "up"],
)
def test_lines_and_branches_are_counted_wherever_the_program_runs(tmp_path, how):
    command, *more = how
    folder = folder_of(tmp_path / "fw")
    summary, counts, done = run(command, tmp_path / "out", "--firmware", f"MCH={folder}", "--log", "none", *more)
    slots = summary["slots"]["MCH"]["count"]
    assert slots > 30
    # the latest slot has begun; whether its task has run already depends on the instant
    assert counts[LINES["SLOTS"]] in (slots - 1, slots)
    assert counts[LINES["LATER"]] == counts[LINES["SLOTS"]] - 20
    assert counts[LINES["NEVER"]] == 0
    ran = summary["firmware"]["MCH"]["coverage"]
    (file,) = ran["files"]
    assert (file["file"], file["missed"]) == ("small.c", str(LINES["NEVER"]))
    assert (ran["lines"] - ran["covered"], ran["branches"], ran["taken"], ran["whole"]) == (1, 4, 3, True)
    assert f"small.c: not run: {LINES['NEVER']}" in done.stderr
    assert sorted(each.name for each in (folder / "build").iterdir()) == [
        "small-coverage.notes",
        "small-coverage.so",
        "small-coverage.stamp",
    ]


@needs_gcov
def test_what_ran_before_a_crash_is_counted(tmp_path):
    folder = folder_of(tmp_path / "fw", end="*(volatile uint32_t *)8 = 1;")
    summary, counts, _ = run("walk", tmp_path / "out", "--firmware", f"MCH={folder}", "--log", "none")
    lost = summary["firmware"]["MCH"]
    assert lost["why"].startswith("SIGSEGV")
    assert lost["coverage"]["whole"] is True
    assert counts[LINES["NEVER"]] in (0, 20)  # of the call that crashed gcov may believe that it came to its end
    assert 20 <= counts[LINES["SLOTS"]] <= 21


@needs_gcov
def test_two_boards_of_one_source_are_counted_separately_and_added_in_the_tracefile(tmp_path):
    folder = folder_of(tmp_path / "fw", table="mcfo")
    more = ["--firmware", f"MCFO={folder}", "--firmware", f"MCFI={folder}", "--log", "none"]
    summary, counts, _ = run("walk", tmp_path / "out", *more)
    slots = [summary["slots"][board]["count"] for board in ("MCFO", "MCFI")]
    # had they one variable, the second would be beyond its 20th slot from the tenth on
    assert counts[LINES["SLOTS"]] in range(sum(slots) - 2, sum(slots) + 1)
    assert counts[LINES["LATER"]] == counts[LINES["SLOTS"]] - 2 * 20


def test_a_tracefile_says_what_ran_by_the_letters_of_geninfo():
    file = coverage.FileCounts(
        pathlib.Path("/a/b.c"), {3: 2, 4: 0, 5: 0, 7: 1}, {3: [2, 0], 4: [0, 0]}, {"f": (2, 2), "g": (6, 0)}
    )
    assert coverage.lcov([file]).splitlines() == [
        "TN:", "SF:/a/b.c", "FN:2,f", "FN:6,g", "FNDA:2,f", "FNDA:0,g", "FNF:2", "FNH:1",
        "BRDA:3,0,0,2", "BRDA:3,0,1,0", "BRDA:4,0,0,-", "BRDA:4,0,1,-", "BRF:4", "BRH:1",
        "DA:3,2", "DA:4,0", "DA:5,0", "DA:7,1", "LF:4", "LH:2", "end_of_record",
    ]  # fmt: skip
    assert coverage.spans(file.missed) == "4-5"
    (sum_,) = coverage.merged([[file], [file]])
    assert (sum_.lines[3], sum_.branches[3], sum_.functions["f"]) == (4, [4, 0], (2, 4))


def test_a_compiler_without_gcov_is_reported(tmp_path, monkeypatch):
    alone = tmp_path / "gcc"
    alone.write_text("#!/bin/sh\n", encoding="utf-8")
    alone.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("CC", "gcc")
    with pytest.raises(UserError, match=r"gcc has no gcov in its folder: --coverage needs gcc with its gcov"):
        coverage.gcov()
