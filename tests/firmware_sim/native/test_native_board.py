"""Firmware in C on the emulated chip: equal to the same program in Python, stamp for stamp; faults reported plainly."""

import contextlib
import io
import pathlib
import re
import shutil

import pytest

from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.firmware_sim.native.hardware import Hardware
from ranger_sim.firmware_sim.native.manifest import load
from ranger_sim.firmware_sim.native.native_board import NativeBoard
from ranger_sim.foundation.events import CAN_RX, PIN_EDGE
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import UserError
from tests.firmware_sim.native.support import COMPILER, EXAMPLE, SCHEDULE, START, TIMER, folder_with, library_of

README = pathlib.Path(__file__).parents[3] / "firmware_sim" / "README.md"
pytestmark = pytest.mark.skipif(not COMPILER, reason="no C compiler here")


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    folder = tmp_path_factory.mktemp("firmware") / "example"
    shutil.copytree(EXAMPLE, folder, ignore=shutil.ignore_patterns("build"))
    return folder


@pytest.fixture(scope="module")
def python_board():
    """The ExampleBoard of the README, which example.c repeats."""
    (source,) = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.S)
    space: dict = {}
    with contextlib.redirect_stdout(io.StringIO()):
        exec(compile(source, str(README), "exec"), space)  # noqa: S102
    return space["ExampleBoard"]


def native(folder, crystal=None, phase_ns=0, hardware=None, **how):
    return NativeBoard("EXAMPLE", library_of(folder, **how), crystal, phase_ns, hardware or load(folder).hardware)


def said(board, until, step):
    """Everything the board puts out before `until`, in steps of any length."""
    found = []
    time = 0
    while time < until:
        time = min(time + step, until)
        board.advance(time)
        while board.outbox.take():
            out = board.outbox
            found.append((out.time, out.order, out.kind, out.a, out.b, out.c, out.d, out.e, out.f))
    return sorted(found)


@pytest.mark.parametrize("seed", range(6))
def test_the_same_program_in_c_puts_out_the_same_at_the_same_times(example, python_board, seed):
    draw = RandomStream(seed, "example in C")
    ppb = (-50_000, 0, 20_000)[draw.integer(3)]
    # without a phase: README's board has its converter and timers begin at 0
    boards = [python_board(Crystal(10_000_000, ppb=ppb)), native(example, Crystal(10_000_000, ppb=ppb))]
    level = 0
    for time in sorted({1_000 + draw.integer(48_999_000) for _ in range(1500)}):
        if draw.uniform() < 0.7:
            level ^= 1
            message = (time, 0, PIN_EDGE, 22, level, 27, draw.integer(2))
        else:
            message = (time, 0, CAN_RX, 1, draw.integer(2048), 8, draw.integer(2**32), draw.integer(2**32))
        for board in boards:
            board.inbox.push(*message)
    for pin in (0, 1):
        ends = [6.0 * draw.uniform() - 3.0 for _ in range(2)]
        for board in boards:
            board.analog.set_pair(pin, 0, ends[0], 50_000_000, ends[1])
    expected = said(boards[0], 50_000_000, 777_777)
    assert said(boards[1], 50_000_000, 123_456) == expected
    assert sum(1 for row in expected if row[2] == 35) >= 99  # it wrote its bridge in every slot
    counted = [board.scheduler.counters() for board in boards]
    assert counted[0] == counted[1]
    sums = [{s.name: (s.served, s.merged, s.total_cycles) for s in board.vic.sources.values()} for board in boards]
    assert sums[0] == sums[1]


def test_a_schedule_in_c_can_be_inspected_and_a_task_swapped(example):
    board = native(example)
    names = [task.name for task in board.scheduler.schedule.row_tasks(0)]
    assert names == ["start_sequence", "receive_all", "wait", "control", "send_count"]
    board.scheduler.replace("control", lambda: None, cost=40_000, limit=1000)
    board.advance(3_000_000)
    assert board.scheduler.overruns > 0
    assert next(task for task in board.scheduler.tasks if task.name == "control").hits > 0


def test_two_boards_from_one_library_share_no_variable(tmp_path):
    source = TIMER + SCHEDULE + START + "int32_t told(void) { return calls; }\n"
    folder = folder_with(tmp_path / "small", source.replace("calls++;", "calls++; fw_pin_write(calls & 7, 1);"))
    path = library_of(folder)
    first, second = NativeBoard("A", path), NativeBoard("B", path)
    first.advance(1_400_000)  # three slots
    second.advance(100_000)  # one
    assert [level for level in first.pins[:4]] == [0, 1, 1, 1]
    assert [level for level in second.pins[:4]] == [0, 1, 0, 0]


def test_hooks_limits_and_spent_cycles_are_as_for_boards_in_python(tmp_path):
    source = """
#include <ranger_sim/firmware.h>
static uint32_t overruns, limits, ticks;
static int32_t task(void) { fw_spend(ticks == 3 ? 31000 : 400); return 5; }
static void on_overrun(void) { overruns++; fw_pin_write(1, 1); }
static void on_limit(void) { limits++; fw_pin_write(2, limits & 1); }
static void on_tick(void) { ticks++; }
static const fw_task every[] = {{task, "task", 100, 600, 10, "item"}, {task, "second", 1}};
static const fw_schedule schedule = {.slot_ns = 500000, .every = FW_TASKS(every), .tick_vic_slot = 4,
    .on_tick = on_tick, .on_overrun = on_overrun, .on_limit = on_limit};
"""
    board = NativeBoard("SMALL", library_of(folder_with(tmp_path / "small", source + SCHEDULE + START)))
    board.advance(1_000_000)
    task = board.scheduler.tasks[0]
    assert (task.calls, task.last_cycles, task.hits, task.item) == (2, 100 + 5 * 10 + 400, 0, "item")
    board.advance(2_000_000)
    assert (board.scheduler.overruns, task.hits) == (1, 1)
    assert board.pins[1] == board.pins[2] == 1


def test_a_timers_registers_are_the_same_where_the_program_reaches_them_by_itself_and_by_a_call(tmp_path):
    source = """
#include <ranger_sim/firmware.h>
static int32_t task(void)
{
    static const uint32_t timers[] = {1, 9}; /* the chip's second, and a number that the chip does not have */
    for (uint32_t i = 0; i < 2; i++) {
        const uint32_t timer = timers[i];
        fw_spend(fw_timer_CCR(timer)), fw_spend(fw_timer_IR(timer)), fw_spend(fw_timer_CR(timer, 6));
        fw_timer_clear_IR(timer, FW_IR_MR0);
        fw_spend(fw_timer_IR(timer));
        fw_timer_write_CCR(timer, 0xFFFFF1FFu);
    }
    return 0;
}
static const fw_task every[] = {{task, "task", 100}};
static const fw_schedule schedule = {.slot_ns = 500000, .every = FW_TASKS(every), .tick_vic_slot = 4};
void firmware_start(void)
{
    fw_timer_start(1, 6000, 1), fw_capture_connect(1, 2, FW_P0(17));
    fw_timer_start(9, 6000, 1), fw_capture_connect(9, 2, FW_P0(18));
}
"""
    board = NativeBoard("SMALL", library_of(folder_with(tmp_path / "small", source + SCHEDULE)))
    task = board.scheduler.tasks[0]
    for slot in range(1, 5):
        for pin in (17, 18):
            board.inbox.push(slot * 500_000 - 10_020, 0, PIN_EDGE, pin, slot % 2)
        board.advance(slot * 500_000 + 400_000)
        near, far = (board.devices.timers.at(timer) for timer in (1, 9))
        assert (near.CCR, near.IR, near.CR2) == (far.CCR, far.IR, far.CR2)
        # every edge is 10.02 us before a timer begins anew, at count 5398.8; the first is never cleared
        assert (near.CCR, near.IR, near.CR2) == (0x1FF, 0x41, 5398)
        assert task.last_cycles - 100 == 2 * (0x1FF + 0x41 + 5398 + 0x40)


@pytest.mark.parametrize(
    ("call", "reported"),
    [
        ("fw_timer_CR(1, 0)", "fw_timer_CR: timer 1 is not started (started: none)"),
        ("fw_pin_write(64, 1)", "fw_pin_write: pin 64 is not 0 ... 63"),
        ("fw_pwm_start(600)", "fw_pwm_start: PWM 0 is started twice"),
        ("fw_spi_start(3)", "fw_spi_start: nothing hangs on SPI 3 of this board"),
        ("fw_idle()", "fw_idle: only a board's own main loop can sleep, not a task or a handler"),
        ("fw_can_buffer_free(2, 4)", "fw_can_buffer_free: CAN: transmit buffer 4 is not 1 ... 3"),
        ("fw_uart_start(0, 0, 0, 1, 8)", "fw_uart_start: EXAMPLE: UART 0: divisor 0, fraction 0/1 is impossible"),
    ],
)
def test_what_a_chip_would_not_survive_ends_the_run_with_the_calls_name(tmp_path, call, reported):
    folder = folder_with(tmp_path / "small", TIMER.replace("TASK;", f"(void){call};") + SCHEDULE)
    source = (folder / "small.c").read_text(encoding="utf-8")
    (folder / "small.c").write_text(
        source + "void firmware_start(void) { fw_pwm_start(600); fw_can_start(2, 0x00254001, 1); }\n", encoding="utf-8"
    )
    board = NativeBoard("EXAMPLE", library_of(folder), hardware=Hardware())
    with pytest.raises(UserError) as mistake:
        board.advance(10_000_000)
    assert str(mistake.value) == f"EXAMPLE: {reported}"
    assert board.scheduler.slot_count == 1


def test_a_program_that_starts_wrongly_is_reported_at_once(tmp_path):
    source = TIMER + SCHEDULE + "void firmware_start(void) { fw_can_start(7, 0, 0); }\n"
    with pytest.raises(UserError, match=r"^X: fw_can_start: X: CAN controller 7 is not 1 \.\.\. 4$"):
        NativeBoard("X", library_of(folder_with(tmp_path / "small", source)))
