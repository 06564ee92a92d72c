"""Firmware in C that crashes, hangs or uses up its stack ends its own process only, and it is told where it was."""

import contextlib
import dataclasses
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys

import pytest

from ranger_sim.firmware_sim.native import crash
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes import places, supervisor
from ranger_sim.harness.processes.lone_board import LoneBoard
from ranger_sim.harness.processes.settings import Settings
from ranger_sim.harness.processes.supervisor import Supervisor
from ranger_sim.harness.ranger import Ranger
from ranger_sim.harness.scenario import StopRule
from tests.firmware_sim.native.support import COMPILER, folder_with
from tests.harness.processes.test_supervisor import Said

ROOT = pathlib.Path(__file__).resolve().parents[3]
MANIFEST = "[firmware]\nname = 'small'\ntables = ['mch']\n"
PATIENCE_S = 240.0  # a guard; nothing asserts on it
PROGRAM = """
#include <ranger_sim/firmware.h>
#include "mch_table.h"
#include <stdlib.h>
static uint32_t slots;
volatile uint32_t sink;
static uint32_t *volatile nowhere;
{function}
static int32_t control(void)
{{
    if (++slots > {slots}) {{
        break_down();
        sink++; /* CALL */
    }}
    return 0;
}}
static const fw_task every[] = {{{{control, "control", 20, 30}}}};
static const fw_schedule schedule = {{
    .slot_ns = 500000, .every = FW_TASKS(every), .tick_cost = 60, .tick_vic_slot = 4}};
void firmware_start(void) {{ fw_can_start(1, 0x00254001, 0); sink += nowhere != NULL; }}
const fw_schedule *firmware_schedule(void) {{ return &schedule; }}
uint32_t firmware_table_version(void) {{ return RANGER_TABLE_VERSION; }}
"""
NULL_WRITE = """__attribute__((noinline)) static void break_down(void)
{
    *nowhere = 1; /* HERE */
    sink++;
}"""
ABORT = """__attribute__((noinline)) static void break_down(void)
{
    abort(); /* HERE */
}"""
ILLEGAL = """__attribute__((noinline)) static void break_down(void)
{
    __builtin_trap(); /* HERE */
}"""
DIVIDE = """__attribute__((noinline)) static void break_down(void)
{
    raise(SIGFPE); /* HERE */
    sink++;
}"""
DEEP = """__attribute__((noinline)) static uint32_t deeper(uint32_t depth)
{
    volatile uint32_t here[100];
    here[depth % 100] = depth;
    if (depth == 0xFFFFFFFFu)
        return 0;
    return deeper(depth + 1) + here[depth % 100]; /* CALL OF ITSELF */
}
static void break_down(void)
{
    sink = deeper(sink);
}"""
ENDLESS = """__attribute__((noinline)) static void break_down(void)
{
    while (1)
        sink++;
}"""
WELL = "static void break_down(void) { sink++; }"

needs_compiler = pytest.mark.skipif(not COMPILER, reason="no C compiler here")
needs_addr2line = pytest.mark.skipif(shutil.which("addr2line") is None, reason="no addr2line here")


def program(function, slots=3):
    """The source, and the line of each of its remarks."""
    source = PROGRAM.format(function=function, slots=slots)
    if "SIGFPE" in source:
        source = "#define _POSIX_C_SOURCE 1\n#include <signal.h>\n" + source
    remarks = {
        found[1]: number
        for number, line in enumerate(source.splitlines(), 1)
        if (found := re.search(r"/\* ([A-Z ]+) \*/", line))
    }
    return source, remarks


def broken(folder, function):
    """What is told of the program after it ended its process, and the lines of its remarks."""
    source, remarks = program(function)
    folder = folder_with(folder, source, MANIFEST)
    with (
        contextlib.closing(Ranger(firmware={"MCH": folder})) as robot,
        contextlib.closing(LoneBoard(robot, "MCH")) as board,
    ):
        with pytest.raises(UserError, match=r"MCH .*was killed by signal"):
            board.turn(robot.start_ns + 20_000_000)  # forty slots
        record = board.words[places.CRASH : places.CRASH + places.CRASH_WORDS].tolist()
        firmware = robot.firmware["MCH"]
        return crash.told(firmware.library, firmware.folder, record), remarks


@needs_compiler
@needs_addr2line
@pytest.mark.parametrize(
    ("function", "what"),
    [
        (NULL_WRITE, "SIGSEGV (Segmentation fault)"),
        (ABORT, "SIGABRT (Aborted)"),
        (DIVIDE, "SIGFPE (Floating point exception)"),
    ],
)
def test_a_crash_is_told_with_signal_function_and_line(tmp_path, function, what):
    told, remarks = broken(tmp_path / "fw", function)
    assert told.startswith(f"{what} in break_down() at small.c:{remarks['HERE']}")


@needs_compiler
@needs_addr2line
def test_who_called_the_function_that_crashed_is_told_too(tmp_path):
    told, remarks = broken(tmp_path / "fw", NULL_WRITE)
    caller = re.search(r"called from control\(\) at small\.c:(\d+)$", told)
    assert caller, told
    assert abs(int(caller[1]) - remarks["CALL"]) <= 1  # the call stands in the line before the remark


@needs_compiler
@needs_addr2line
def test_an_instruction_that_does_not_exist_is_told_with_its_place(tmp_path):
    told, remarks = broken(tmp_path / "fw", ILLEGAL)
    assert re.match(r"SIG(ILL|TRAP) \(", told), told
    assert f"in break_down() at small.c:{remarks['HERE']}" in told


@needs_compiler
@needs_addr2line
def test_a_stack_overflow_is_called_so_and_the_recursion_is_told_once(tmp_path):
    told, remarks = broken(tmp_path / "fw", DEEP)
    assert told.startswith("stack overflow, SIGSEGV (Segmentation fault) in deeper() at small.c:")
    assert told.count(f"deeper() at small.c:{remarks['CALL OF ITSELF']}") == 1


@needs_compiler
@needs_addr2line
def test_firmware_that_never_returns_is_ended_and_the_robot_goes_on(tmp_path):
    """By command: the line says where it hung, the summary keeps it, and the run reaches its end."""
    source, _ = program(ENDLESS, slots=100)
    folder = folder_with(tmp_path / "fw", source, MANIFEST)
    done = up(folder, tmp_path / "summary.json")
    found = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert re.search(r"MCH \(process \d+\) hangs: no answer for", done.stderr)
    place = r"its program let no time pass in break_down\(\) at small\.c:\d+"
    assert re.search(rf"MCH \(process \d+\) was killed by signal {signal.SIGXCPU}: {place}", done.stderr)
    assert "Traceback" not in done.stderr
    (death,) = found["processes"]["deaths"]
    assert death["board"] == "MCH"
    assert re.match(place, death["why"])
    assert found["time_s"] == pytest.approx(0.2)
    assert "MCH" in found["failed_boards"]
    assert done.returncode == 1


@needs_compiler
def test_firmware_in_a_process_of_its_own_makes_the_same_run_as_within_the_walk(tmp_path):
    folder = folder_with(tmp_path / "fw", program(WELL)[0], MANIFEST)
    up(folder, tmp_path / "up.json")
    with contextlib.closing(Ranger(firmware={"MCH": folder})) as robot:
        robot.run_for(0.2)
        within = robot.summary()["trace_digest"]
    assert json.loads((tmp_path / "up.json").read_text(encoding="utf-8"))["trace_digest"] == within


def up(folder, summary):
    command = [sys.executable, "-m", "ranger_sim", "up", "--name", f"test-{os.getpid()}", "--no-real-time"]
    return subprocess.run(
        [*command, "--speed", "max", "--time", "200ms", "--firmware", f"MCH={folder}", "--json", str(summary)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )


def test_a_record_without_places_says_that_it_was_outside_of_the_program(tmp_path):
    record = [signal.SIGBUS, 0, 0, 0, 0, 0, 0]
    told = crash.told(tmp_path / "small.so", tmp_path, record)
    assert told == f"SIGBUS ({signal.strsignal(signal.SIGBUS)}), outside of the program's code"


def test_no_record_says_nothing(tmp_path):
    assert crash.told(tmp_path / "small.so", tmp_path, [0] * crash.RECORD) == ""


def test_without_addr2line_places_are_told_as_offsets_in_the_library(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda _name: None)
    record = [signal.SIGSEGV + crash.OVERFLOW, 0x1234, 0x5678, 0x1234, 0, 0, 0]
    told = crash.told(tmp_path / "small.so", tmp_path, record)
    assert told.startswith("stack overflow, SIGSEGV (")
    assert told.endswith(" in small.so+0x1234, called from small.so+0x5678")


def test_a_file_without_the_place_is_told_as_an_offset(tmp_path):
    (tmp_path / "small.so").write_bytes(b"no library")
    told = crash.told(tmp_path / "small.so", tmp_path, [signal.SIGILL, 0x10, 0, 0, 0, 0, 0])
    assert told.endswith(" in small.so+0x10")


@dataclasses.dataclass
class Hung:
    """A board in the midst of its turn for ever, as the supervisor sees it."""

    robot: Ranger
    sent: list
    clock_s: float = 0.0

    def look(self, watched):
        self.clock_s += 2 * supervisor.HANG_S
        watched.look()


@pytest.fixture
def hung(monkeypatch):
    with contextlib.closing(Ranger()) as robot:
        made = Hung(robot, [])
        monkeypatch.setattr(supervisor.wallclock, "monotonic_s", lambda: made.clock_s)
        monkeypatch.setattr(supervisor.os, "kill", lambda process, number: made.sent.append(number))
        monkeypatch.setattr(supervisor.kernel, "processor_time_s", lambda _process: made.clock_s)
        monkeypatch.setattr(supervisor.kernel, "state_of", lambda _process: "R")
        settings = Settings(None, name=f"test-{os.getpid()}", real_time=False)
        with contextlib.closing(Supervisor(robot, settings, StopRule(time_s=1.0), lambda *_: 0, Said())) as watched:
            watched.children["MCH"] = supervisor.Child("MCH", 2**22)
            watched.blocks["MCH"].words[places.ASKED] = 5
            yield made, watched
            del watched.children["MCH"]


def test_firmware_in_c_that_hangs_is_asked_where_first_and_killed_when_it_does_not_say(hung):
    made, watched = hung
    made.robot.firmware["MCH"] = object()
    for _ in range(3):
        made.look(watched)
    assert made.sent == [crash.ASKED, signal.SIGKILL]
    del made.robot.firmware["MCH"]


def test_a_python_board_that_hangs_is_killed_at_once(hung):
    made, watched = hung
    for _ in range(2):
        made.look(watched)
    assert made.sent == [signal.SIGKILL]
