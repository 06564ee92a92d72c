"""Firmware in C that crashes, hangs or uses up its stack ends its own process only, and it is reported where it was."""

import contextlib
import dataclasses
import json
import os
import pathlib
import platform
import re
import shutil
import signal
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ranger_sim.firmware_sim.native import crash
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes import guard, kernel, places, supervisor
from ranger_sim.harness.processes.block import Block
from ranger_sim.harness.processes.guard import Guard
from ranger_sim.harness.processes.lone_board import LoneBoard
from ranger_sim.harness.processes.settings import Settings
from ranger_sim.harness.processes.supervisor import Supervisor
from ranger_sim.loading import RUNS_COMPILED
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario, StopRule
from tests.firmware_sim.native.support import COMPILER, SCHEDULE, TIMER, folder_with, library_of
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
HOST_MOVED = """extern void *fw_host;
__attribute__((noinline)) static void break_down(void)
{
    fw_host = (char *)fw_host + 16;
    fw_pin_write(3, 1); /* HERE */
    sink++;
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
    """What is reported of the program after it ended its process, and the lines of its remarks."""
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
        return crash.describe(firmware.library, firmware.folder, record), remarks


@needs_compiler
@needs_addr2line
@pytest.mark.parametrize(
    ("function", "what"),
    [
        (NULL_WRITE, "SIGSEGV (Segmentation fault)"),
        (ABORT, "SIGABRT (Aborted)"),
        pytest.param(
            HOST_MOVED,
            "SIGABRT (Aborted)",
            marks=pytest.mark.skipif(not RUNS_COMPILED, reason="the interpreter does not call by an address"),
        ),
        (DIVIDE, "SIGFPE (Floating point exception)"),
    ],
)
def test_a_crash_is_reported_with_signal_function_and_line(tmp_path, function, what):
    reported, remarks = broken(tmp_path / "fw", function)
    assert reported.startswith(f"{what} in break_down() at small.c:{remarks['HERE']}")


@needs_compiler
@needs_addr2line
def test_the_caller_of_the_function_that_crashed_is_reported_too(tmp_path):
    reported, remarks = broken(tmp_path / "fw", NULL_WRITE)
    caller = re.search(r"called from control\(\) at small\.c:(\d+)$", reported)
    assert caller, reported
    assert abs(int(caller[1]) - remarks["CALL"]) <= 1  # the call stands in the line before the remark


@needs_compiler
@needs_addr2line
def test_an_instruction_that_does_not_exist_is_reported_with_its_place(tmp_path):
    reported, remarks = broken(tmp_path / "fw", ILLEGAL)
    assert re.match(r"SIG(ILL|TRAP) \(", reported), reported
    assert f"in break_down() at small.c:{remarks['HERE']}" in reported


@needs_compiler
@needs_addr2line
def test_a_stack_overflow_is_named_and_the_recursion_is_reported_once(tmp_path):
    reported, remarks = broken(tmp_path / "fw", DEEP)
    assert reported.startswith("stack overflow, SIGSEGV (Segmentation fault) in deeper() at small.c:")
    assert reported.count(f"deeper() at small.c:{remarks['CALL OF ITSELF']}") == 1


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
def test_firmware_in_its_own_process_makes_the_same_run_as_within_the_walk(tmp_path):
    folder = folder_with(tmp_path / "fw", program(WELL)[0], MANIFEST)
    up(folder, tmp_path / "up.json")
    with contextlib.closing(Ranger(firmware={"MCH": folder}, in_process=True)) as robot:
        robot.run_for(0.2)
        within = robot.summary()["trace_digest"]
    assert json.loads((tmp_path / "up.json").read_text(encoding="utf-8"))["trace_digest"] == within


def walked(folder, *more):
    """`walk` with the program in the hip board's place for 200 ms; the run, and its summary."""
    done = subprocess.run(
        [sys.executable, "-m", "ranger_sim", "walk", "--time", "200ms", "--firmware", f"MCH={folder}", "--json", "-"]
        + list(more),
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    return done, json.loads(done.stdout) if done.stdout else None


@needs_compiler
@needs_addr2line
def test_a_walk_goes_on_without_a_board_whose_program_crashes_and_says_where(tmp_path):
    source, remarks = program(NULL_WRITE, slots=100)
    done, found = walked(folder_with(tmp_path / "fw", source, MANIFEST), "--log", "none")
    assert (done.returncode, done.stderr) == (1, "")  # --json -: nothing else is printed
    assert found["failed_boards"] == ["MCH"]
    assert found["time_s"] == pytest.approx(0.2)
    lost = found["firmware"]["MCH"]
    # 3 ms of start-up, then the 101st slot of 0.5 ms; the body's next step begins within 0.25 ms
    assert lost["lost_s"] == pytest.approx(0.0515, abs=0.002)
    assert lost["why"].startswith(f"SIGSEGV (Segmentation fault) in break_down() at small.c:{remarks['HERE']}, called")


@needs_compiler
@needs_addr2line
@pytest.mark.parametrize(
    "loop",
    [ENDLESS, ENDLESS.replace("sink++;", "sink += fw_slot_cycles();")],
    ids=["computing", "asking the chip"],
)
def test_a_walk_finds_a_program_that_lets_no_time_pass_and_makes_the_run_of_one_that_crashes_there(tmp_path, loop):
    """Virtual time stands while it is looked for, so how long that took, and on what machine, changes nothing."""
    _, found = walked(folder_with(tmp_path / "endless", program(loop, slots=100)[0], MANIFEST))
    assert re.match(r"its program let no time pass in break_down\(\) at small\.c:\d+", found["firmware"]["MCH"]["why"])
    crashed = folder_with(tmp_path / "crash", program(NULL_WRITE, slots=100)[0], MANIFEST)
    with contextlib.closing(Ranger(firmware={"MCH": crashed})) as robot:
        for slice_s in (0.0313, 0.0191, 0.0496, 0.1):  # however it is sliced
            robot.run_for(slice_s)
        assert [death["board"] for death in robot.deaths] == ["MCH"]
        assert robot.trace_digest() == found["trace_digest"]


@needs_compiler
def test_a_program_in_its_own_process_makes_the_same_bytes_as_in_the_walks_with_the_robots_other_boards(tmp_path):
    folder = folder_with(tmp_path / "fw", program(WELL)[0], MANIFEST)
    found = []
    for in_process in (False, True):
        with contextlib.closing(Ranger(Scenario(seed=5), firmware={"MCH": folder}, in_process=in_process)) as robot:
            robot.run_for(0.1)
            robot.until("error MC_NOT_RUNNING from MCSI", within="100 ms")
            robot.run_for(0.0373)
            counters = robot.counters()["MCH"]
            found.append((robot.trace_digest(), robot.time_s, counters.slots.count, counters.slots.max_cycles))
    assert found[0] == found[1]


@needs_compiler
def test_state_in_the_process_of_a_program_in_c_is_reported_out_of_reach(tmp_path):
    folder = folder_with(tmp_path / "fw", program(WELL)[0], MANIFEST)
    with contextlib.closing(Ranger(firmware={"MCH": folder})) as robot:
        assert robot.board("MCH").name == "MCH"  # before time passes it is here
        with pytest.raises(UserError, match=r"MCH is not emulated in this process.*Ranger\(in_process=True\)"):
            robot.inject("MCH.processor", "extra_cycles", task="control")
        robot.run_for(0.001)
        with pytest.raises(UserError, match=r"MCH runs in a separate process.*Ranger\(in_process=True\)"):
            robot.board("MCH")
        with pytest.raises(UserError, match="its process runs already; replace before time passes"):
            robot.replace("MCH", "control", lambda: None, cost=1)
        with pytest.raises(UserError, match="proof of a fault: every board must run in this process"):
            robot.inject("MCH.absolute_encoder", "stuck", proof=True)
        assert robot.board("MCFI").name == "MCFI"  # the others are here
        children = [robot.processes.guard, *robot.processes.children.values()]
    for process in children:
        with pytest.raises(ProcessLookupError):
            os.kill(process, 0)


@needs_compiler
@needs_addr2line
def test_in_the_walks_own_process_a_crash_ends_the_walk_and_its_last_line_names_the_place(tmp_path):
    source, remarks = program(NULL_WRITE, slots=100)
    done, found = walked(folder_with(tmp_path / "fw", source, MANIFEST), "--in-process")
    assert (done.returncode, found) == (-signal.SIGSEGV, None)
    said = re.search(r"^ranger-sim: MCH: its program has ended this process, where: (addr2line .*)$", done.stderr, re.M)
    assert said, done.stderr
    reported = subprocess.run(said[1].split(), capture_output=True, text=True, check=True).stdout.split()
    assert reported[0] == "break_down"
    assert reported[1].endswith(f"small.c:{remarks['HERE']}")


@needs_compiler
@needs_addr2line
def test_in_the_walks_own_process_an_endless_loop_ends_the_walk_in_the_same_way(tmp_path):
    folder = folder_with(tmp_path / "fw", program(ENDLESS, slots=100)[0], MANIFEST)
    done, found = walked(folder, "--in-process")
    assert (done.returncode, found) == (-signal.SIGXCPU, None)
    assert "MCH: its program has ended this process, where: addr2line " in done.stderr


@needs_compiler
@needs_addr2line
@pytest.mark.parametrize(
    ("start", "reported"),
    [
        ("*(volatile uint32_t *)8 = 1;", r"SIGSEGV \(Segmentation fault\) in firmware_start\(\) at small\.c:\d+"),
        ("while (1) sink++;", r"its program let no time pass in firmware_start\(\) at small\.c:\d+"),
        ("_exit(5);", r"it called exit\(5\) in firmware_start\(\) at small\.c:\d+"),
    ],
)
def test_a_program_that_does_not_get_through_its_start_is_refused_in_one_line(tmp_path, start, reported):
    source = program(WELL)[0].replace("{ fw_can_start", "{ " + start + " fw_can_start").replace("stdlib", "unistd")
    done, found = walked(folder_with(tmp_path / "fw", source, MANIFEST))
    assert (done.returncode, found) == (2, None)
    assert re.fullmatch(rf"ranger-sim: \S+fw: MCH: its program fails in its start: {reported}\n", done.stderr)


EXITS = ("exit(0);", "_exit(0);", "_Exit(0);", "quick_exit(0);")
CONSTRUCTOR = "__attribute__((constructor)) static void early(void)\n{\n    %s\n}\n"
RAW = '__asm__ volatile("syscall" : : "a"(231), "D"(0));'  # exit_group(0) of Linux, by no function

needs_amd64 = pytest.mark.skipif(platform.machine() != "x86_64", reason="the system call is written for x86-64")


def leaving(function):
    """A program that calls what ends a process: quick_exit is of C11."""
    return "#include <unistd.h>\n__attribute__((noreturn)) void quick_exit(int);\n" + function


def refused(folder):
    """The line with which a walk refuses a program."""
    done, found = walked(folder)
    assert (done.returncode, found) == (2, None)
    (line,) = done.stderr.splitlines()
    return line


@needs_compiler
@pytest.mark.parametrize("end", ["_exit(0);", pytest.param(RAW, marks=needs_amd64)])
def test_a_library_that_ends_the_process_that_loads_it_is_refused_and_never_a_success(tmp_path, end):
    """Whatever code it ends with: the trial says how far it came over a pipe."""
    source = program(leaving(WELL + "\n" + CONSTRUCTOR % end))[0]
    line = refused(folder_with(tmp_path / "fw", source, MANIFEST))
    assert "its program fails in its loading (what runs in it before firmware_start" in line
    assert line.endswith("): it ended its process with code 0")


@needs_compiler
def test_a_library_that_is_up_to_date_is_tried_before_a_walk_loads_it(tmp_path):
    """It was built where its constructor did nothing."""
    end = f'if (access("{tmp_path / "now"}", F_OK) == 0) _exit(0);'
    folder = folder_with(tmp_path / "fw", program(leaving(WELL + "\n" + CONSTRUCTOR % end))[0], MANIFEST)
    assert walked(folder)[1]["failed_boards"] == []
    (tmp_path / "now").touch()
    assert "fw: MCH: its program fails in its loading" in refused(folder)


@needs_compiler
@needs_addr2line
def test_a_start_that_calls_exit_is_refused_with_its_place(tmp_path):
    source = program(WELL)[0].replace("{ fw_can_start", "{ exit(0); fw_can_start")
    line = refused(folder_with(tmp_path / "fw", source, MANIFEST))
    assert re.search(r"fails in its start: it called exit\(0\) in firmware_start\(\) at small\.c:\d+$", line)


@needs_compiler
@needs_addr2line
@pytest.mark.parametrize("end", EXITS)
def test_a_board_that_calls_exit_in_a_walk_is_lost_there_and_the_summary_says_where(tmp_path, end):
    function = f"__attribute__((noinline)) static void break_down(void)\n{{\n    {end} /* HERE */\n}}"
    source, remarks = program(leaving(function), slots=100)
    done, found = walked(folder_with(tmp_path / "fw", source, MANIFEST))
    assert done.returncode == 1
    assert found["failed_boards"] == ["MCH"] and found["time_s"] == pytest.approx(0.2)
    lost = found["firmware"]["MCH"]
    assert lost["why"].startswith(
        f"it called exit(0) in break_down() at small.c:{remarks['HERE']}, called from control()"
    )


@needs_compiler
@needs_amd64
def test_a_board_that_ends_its_process_by_the_system_call_is_lost_too(tmp_path):
    source = program(f"static void break_down(void) {{ {RAW} }}", slots=100)[0]
    done, found = walked(folder_with(tmp_path / "fw", source, MANIFEST))
    assert (done.returncode, found["failed_boards"]) == (1, ["MCH"])
    assert found["firmware"]["MCH"]["why"] == "its process ended with code 0"


@needs_compiler
def test_in_the_walks_own_process_exit_is_never_a_success_and_is_named(tmp_path):
    source = program("static void break_down(void) { exit(0); }", slots=100)[0]
    done, found = walked(folder_with(tmp_path / "fw", source, MANIFEST), "--in-process")
    assert (done.returncode, found) == (-signal.SIGABRT, None)
    assert "ranger-sim: MCH: its program has ended this process, where: addr2line " in done.stderr
    assert "ranger-sim: firmware in C ended this process: it called exit(0)" in done.stderr


@needs_compiler
def test_a_board_that_nothing_watches_yet_does_not_end_its_process_with_success(tmp_path):
    """A board of a machine of one's own, whose start leaves only where it was not tried."""
    start = f'void firmware_start(void) {{ if (access("{tmp_path / "now"}", F_OK) == 0) exit(0); }}\n'
    source = "#include <stdlib.h>\n#include <unistd.h>\n" + TIMER + SCHEDULE + start
    library = library_of(folder_with(tmp_path / "fw", source))
    (tmp_path / "now").touch()
    board = f"from ranger_sim.firmware_sim.native.native_board import NativeBoard; NativeBoard('A', {str(library)!r})"
    done = subprocess.run(
        [sys.executable, "-c", board], cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )
    assert done.returncode == -signal.SIGABRT
    assert done.stderr == "ranger-sim: firmware in C ended this process: it called exit(0)\n"


HANGS = {
    "raise(SIGSTOP);": r"its process was stopped (SIGSTOP) for 1 s: its program let no time pass in ",
    "pause();": "no answer for 1 s, waiting in the kernel",
    "sigset_t all; sigfillset(&all); sigprocmask(SIG_BLOCK, &all, 0); for (;;) pause();": "no answer for 1 s",
    "for (int each = 3; each < 1024; each++) close(each);": "its answers no longer arrive (descriptors of its process",
}


@needs_compiler
@needs_addr2line
@pytest.mark.parametrize("end", HANGS, ids=["stops itself", "sleeps", "blocks signals", "closes descriptors"])
def test_a_walk_waits_for_no_board_without_a_sign_of_life_and_says_why_it_was_lost(tmp_path, end):
    head = "#define _POSIX_C_SOURCE 200809L\n#include <signal.h>\n#include <unistd.h>\n"
    function = f"__attribute__((noinline)) static void break_down(void)\n{{\n    {end}\n    sink++;\n}}"
    source = head + program(function, slots=100)[0]
    done, found = walked(folder_with(tmp_path / "fw", source, MANIFEST), "--board-deadline", "1s")
    assert (done.returncode, found["failed_boards"]) == (1, ["MCH"])
    assert found["firmware"]["MCH"]["why"].startswith(HANGS[end])
    if end == "pause();":
        assert ": its program let no time pass in break_down() at small.c:" in found["firmware"]["MCH"]["why"]
    assert found["time_s"] == pytest.approx(0.2)


@needs_compiler
def test_in_up_a_board_that_closes_its_descriptors_is_killed_too(tmp_path):
    function = "static void break_down(void) { for (int each = 3; each < 1024; each++) close(each); }"
    folder = folder_with(tmp_path / "fw", "#include <unistd.h>\n" + program(function, slots=100)[0], MANIFEST)
    done = up(folder, tmp_path / "summary.json")
    assert re.search(r"MCH \(process \d+\) hangs: its answers no longer arrive \(descriptors of its", done.stderr)
    assert done.returncode == 1
    assert "MCH" in json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))["failed_boards"]


@needs_compiler
@pytest.mark.parametrize(
    ("start", "patience_s", "reported"),
    [
        ("raise(SIGSTOP);", 0.3, "no answer for 0.3 s"),
        ("pause();", 0.3, "no answer for 0.3 s: its program let no time pass in firmware_start() at small.c"),
        # it ends by itself, on a busy machine not within 0.3 s
        ("for (int each = 3; each < 1024; each++) close(each);", 60.0, "it ended its process with code 1"),
    ],
)
def test_a_start_without_a_sign_of_life_is_refused(tmp_path, start, patience_s, reported):
    head = "#define _POSIX_C_SOURCE 200809L\n#include <signal.h>\n#include <unistd.h>\n"
    source = head + program(WELL)[0].replace("{ fw_can_start", "{ " + start + " fw_can_start")
    folder = folder_with(tmp_path / "fw", source, MANIFEST)
    with pytest.raises(UserError, match=re.escape(f"MCH: its program fails in its start: {reported}")):
        Ranger(firmware={"MCH": folder}, board_deadline_s=patience_s)


@dataclasses.dataclass
class Owing:
    """A board's process that owes an answer, as the guard sees it: `state` and processor time are what /proc says."""

    guard: Guard
    block: Block
    sent: list
    state: str = "S"
    used_s: float = 0.0
    state_of_the_waiter: str = "S"
    files: tuple = (kernel.EVENTFD,)
    slices: int = 0


@pytest.fixture
def owing(monkeypatch):
    block = Block("MCH", 0, 0)
    made = Owing(Guard({"MCH": block}, {"MCH": 2**22}, {}, frozenset({"MCH"}), 10.0), block, [])
    monkeypatch.setattr(guard.os, "kill", lambda process, number: made.sent.append(number))
    monkeypatch.setattr(
        guard.kernel, "state_of", lambda process: made.state if process == 2**22 else made.state_of_the_waiter
    )
    monkeypatch.setattr(guard.kernel, "processor_time_s", lambda process: made.used_s)
    monkeypatch.setattr(guard.kernel, "slices_of", lambda process: made.slices)
    monkeypatch.setattr(guard.kernel, "open_files", lambda process: made.files)
    monkeypatch.setattr(guard.kernel, "waiting_in", lambda process: " (pause)")
    block.words[places.ASKED], block.words[places.ANSWERED] = 5, 4
    block.private[places.AWAITED], block.private[places.WAITS] = 1, 5
    yield made
    block.close()


def looks(owing, count):
    for _ in range(count):
        owing.guard.check("MCH")


def test_a_board_without_an_answer_is_asked_where_it_is_after_the_deadline_and_then_killed(owing):
    looks(owing, guard.CHECKS)
    assert owing.sent == []
    looks(owing, 1)
    assert owing.sent == [crash.ASKED, signal.SIGCONT]
    looks(owing, 1)
    assert owing.sent == [crash.ASKED, signal.SIGCONT, signal.SIGKILL]
    assert owing.block.fault() == "no answer for 10 s, waiting in the kernel (pause)"


@pytest.mark.parametrize(
    ("change", "reported"),
    [
        ({"state": "T"}, "its process was stopped (SIGSTOP) for 10 s"),
        ({"used_s": 9.0}, "no answer for 10 s, 9.0 s of them computing"),
        ({"files": ("/dev/null",)}, "its answers no longer arrive (descriptors of its process are closed) for 10 s"),
    ],
)
def test_the_cause_is_what_the_system_lists_about_the_process(owing, change, reported):
    looks(owing, 1)
    for name, value in change.items():
        setattr(owing, name, value)
    looks(owing, guard.CHECKS)
    assert owing.block.fault() == reported


def test_every_answer_is_a_sign_of_life(owing):
    for turn in range(6, 40):
        looks(owing, guard.CHECKS)
        owing.block.private[places.WAITS] = turn
    assert owing.sent == []


@pytest.mark.parametrize(("state", "used_s"), [("t", 0.0), ("R", 4.9)], ids=["in a debugger", "on a busy machine"])
def test_a_board_that_cannot_answer_yet_is_waited_for(owing, state, used_s):
    looks(owing, 1)
    owing.state, owing.used_s = state, used_s
    looks(owing, 10 * guard.CHECKS)
    assert owing.sent == []


def test_a_board_that_is_not_waited_for_is_left_alone(owing):
    owing.block.private[places.AWAITED] = 0
    looks(owing, 10 * guard.CHECKS)
    owing.block.private[places.AWAITED] = 1
    owing.state_of_the_waiter = "R"
    looks(owing, 10 * guard.CHECKS)  # its answer may be there, and is read when the machine has time
    assert owing.sent == []


def test_a_board_that_gives_the_processor_away_again_and_again_is_not_waited_for(owing):
    looks(owing, 1)
    owing.state, owing.slices = "R", guard.MOST_SLICES
    looks(owing, guard.CHECKS)
    assert owing.sent == [crash.ASKED, signal.SIGCONT]


def test_a_program_that_writes_answers_into_its_memory_gains_no_time(owing):
    for turn in range(5, 5 + guard.CHECKS + 1):
        owing.block.words[places.ANSWERED] = turn
        os.eventfd_write(owing.block.answer_descriptor, 1)
        looks(owing, 1)
    assert crash.ASKED in owing.sent
    owing.block.words[places.ANSWERED] = 5
    looks(owing, 1)
    assert owing.sent[-1] == signal.SIGKILL


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
    reported = crash.describe(tmp_path / "small.so", tmp_path, record)
    assert reported == f"SIGBUS ({signal.strsignal(signal.SIGBUS)}), outside of the program's code"


@pytest.mark.parametrize(
    "record",
    [
        [200, 1],
        [255, 1],
        [-1, 1],
        [2**63 - 1, 1],
        [-(2**63), 1],
        [signal.SIGSEGV, -1],
        [signal.SIGSEGV, 2**62],
        [1024, 0],
    ],
)
def test_a_record_that_the_program_wrote_over_is_named_so(tmp_path, record):
    reported = crash.describe(tmp_path / "small.so", tmp_path, [*record, 0, 0, 0, 0, 0])
    assert reported == "the record of its end is not readable: its program wrote over it"


@given(st.lists(st.integers(-(2**63), 2**63 - 1), min_size=crash.RECORD, max_size=crash.RECORD))
def test_no_record_ends_in_a_traceback(record):
    assert crash.describe(pathlib.Path("small.so"), pathlib.Path("sources"), record) or record[0] == 0


@given(st.integers(-(2**63), 2**63 - 1), st.binary(max_size=64))
def test_no_notebook_ends_in_a_traceback(length, scribbled):
    notebook = crash.Notebook()
    record = notebook.new_record("MCH", pathlib.Path("small.so"), pathlib.Path("sources"))
    record[0] = signal.SIGSEGV
    assert notebook.describe().startswith("MCH: SIGSEGV (")
    notebook.words[crash.RECORD] = length
    notebook.words.cast("B")[8 * (crash.RECORD + 1) :][: len(scribbled)] = scribbled
    assert "SIGSEGV" in notebook.describe() or crash.UNREADABLE in notebook.describe()


def test_no_record_says_nothing(tmp_path):
    assert crash.describe(tmp_path / "small.so", tmp_path, [0] * crash.RECORD) == ""


def test_without_addr2line_places_are_offsets_in_the_library(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda _name: None)
    record = [signal.SIGSEGV + crash.OVERFLOW, 0x1234, 0x5678, 0x1234, 0, 0, 0]
    reported = crash.describe(tmp_path / "small.so", tmp_path, record)
    assert reported.startswith("stack overflow, SIGSEGV (")
    assert reported.endswith(" in small.so+0x1234, called from small.so+0x5678")


def test_a_place_without_a_file_is_an_offset(tmp_path):
    (tmp_path / "small.so").write_bytes(b"no library")
    reported = crash.describe(tmp_path / "small.so", tmp_path, [signal.SIGILL, 0x10, 0, 0, 0, 0, 0])
    assert reported.endswith(" in small.so+0x10")


@dataclasses.dataclass
class Hung:
    """A board in the midst of its turn for ever, as the supervisor sees it."""

    robot: Ranger
    sent: list
    clock_s: float = 0.0

    def check(self, watched):
        self.clock_s += 2 * supervisor.HANG_S
        watched.check()


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
            watched.blocks["MCH"].private[places.AWAITED] = 1
            yield made, watched
            del watched.children["MCH"]


def test_firmware_in_c_that_hangs_is_asked_for_its_place_and_killed_without_an_answer(hung):
    made, watched = hung
    made.robot.firmware["MCH"] = object()
    for _ in range(3):
        made.check(watched)
    assert made.sent == [crash.ASKED, signal.SIGKILL]
    del made.robot.firmware["MCH"]


def test_a_python_board_that_hangs_is_killed_at_once(hung):
    made, watched = hung
    for _ in range(2):
        made.check(watched)
    assert made.sent == [signal.SIGKILL]


@needs_compiler
@pytest.mark.parametrize(
    ("old", "new", "reported"),
    [
        ("return RANGER_TABLE_VERSION;", "return 5;", "compiled with version 0x00000005 of the master table"),
        ("{ fw_can_start(1, 0x00254001, 0); sink", "{ sink", "firmware_start() does not start CAN controller 1"),
        ("return &schedule;", "return NULL;", "firmware_schedule() returned NULL"),
    ],
    ids=["another table", "no CAN controller", "no schedule"],
)
def test_what_a_program_offers_wrongly_is_refused_in_one_line_and_no_folder_is_touched(tmp_path, old, new, reported):
    source, _ = program(WELL)
    assert old in source
    folder = folder_with(tmp_path / "fw", source.replace(old, new), MANIFEST)
    done, found = walked(folder, "--out", str(tmp_path / "out"))
    assert (done.returncode, found) == (2, None)
    (line,) = done.stderr.splitlines()
    assert line.startswith("ranger-sim: ") and reported in line
    assert not list((tmp_path / "out").glob("*"))
