"""A board that runs an image: boot, interrupts, frames, stamps; slicing changes nothing, nor does skipping loops."""

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.firmware_sim.lpc2194 import image as images
from ranger_sim.foundation.events import CAN_REQUEST, PIN_EDGE, PIN_OUTPUT
from ranger_sim.foundation.user_error import FirmwareError
from tests.firmware_sim.lpc2194.programs import ASSEMBLER, Run, board_with, linked, words_of

TICK_NS = 100_000  # 6,000 counts at 60 MHz
STEP = 35_000  # shorter than a frame


def ticker(**how):
    return board_with(words_of("ticker"), **how)


@pytest.mark.parametrize("name", ["ticker", "poller"])
def test_the_words_are_what_the_assembler_makes_of_the_assembly(tmp_path, name):
    if ASSEMBLER is None:
        pytest.skip("no arm-none-eabi-as here: the words stand for it")
    image = images.read(linked(name, tmp_path))
    assert len(image.segments) == 1
    address, content = image.segments[0]
    words = words_of(name)
    assert address == 0
    assert [int.from_bytes(content[i : i + 4], "little") for i in range(0, len(content), 4)] == words
    assert image.address_of("wait" if name == "ticker" else "loop") > 0


def test_a_program_boots_and_serves_its_timer_every_hundred_microseconds():
    run = Run(ticker()).to(3_000_000, STEP)
    edges = run.of(PIN_OUTPUT)
    assert [row[2:4] for row in edges] == [(10, 0)] + [(10, (i + 1) & 1) for i in range(len(edges) - 1)]
    times = [row[0] for row in edges[1:]]
    assert len(times) > 20
    # from a match to the edge an instruction of the loop may have to end: at most 8 cycles, an LDM of two registers
    # with the program counter from flash whose line has to be fetched
    assert all(abs(b - a - TICK_NS) <= 8 * 17 for a, b in zip(times, times[1:], strict=False))
    # the average is exact: the timer runs on its crystal, not on the program
    assert abs(times[-1] - times[0] - (len(times) - 1) * TICK_NS) <= 8 * 17


def test_frames_carry_the_count_and_the_stamp_of_the_store_that_asked_for_them():
    run = Run(ticker()).to(3_000_000, STEP)
    frames = run.of(CAN_REQUEST)
    assert [row[2:] for row in frames] == [(1, 1, 14, 8, count, count) for count in range(1, len(frames) + 1)]
    edges = [row[0] for row in run.of(PIN_OUTPUT)[1:]]
    # behind the interrupt's end, with the loop's way to the frame
    assert all(500 < frame[0] - edge < 3_000 for edge, frame in zip(edges, frames, strict=False))


@pytest.mark.parametrize("ppb", [-50_000, 0, 30_000])
def test_a_crystal_that_runs_fast_ticks_early(ppb):
    times = [row[0] for row in Run(ticker(crystal=Crystal(10_000_000, ppb))).to(20_000_000, STEP).of(PIN_OUTPUT)[1:]]
    expected = (len(times) - 1) * TICK_NS / (1.0 + ppb * 1e-9)
    assert times[-1] - times[0] == pytest.approx(expected, abs=150)


def test_a_crystal_that_changes_its_rate_changes_the_later_ticks_only():
    board = ticker()
    run = Run(board).to(10_000_000, STEP)
    before = len(run.of(PIN_OUTPUT))
    board.retune(10_000_000, 10_000_000)  # one per cent
    times = [row[0] for row in run.to(20_000_000, STEP).of(PIN_OUTPUT)]
    early, late = times[1:before], times[before + 1 :]
    assert early[-1] - early[0] == pytest.approx((len(early) - 1) * TICK_NS, abs=150)
    assert late[-1] - late[0] == pytest.approx((len(late) - 1) * TICK_NS / 1.01, abs=150)


def everything(board):
    """All that a program can see or has done, and how long it took."""
    core = board.core
    counts = board.counters().processor
    return (list(core.r[:15]), core.pc, core.cpsr(), list(core.ram), counts.instructions, counts.cycles)


@pytest.mark.parametrize("step", [17, 999, 33_333])
def test_steps_of_any_length_give_the_same_run(step):
    one, other = Run(ticker()).to(1_400_000, 39_999), Run(ticker()).to(1_400_000, step)
    assert one.out == other.out
    assert everything(one.board) == everything(other.board)


def test_loops_that_wait_are_skipped_and_nothing_but_the_time_it_takes_shows_it():
    skipping, executing = ticker(), ticker()
    executing.skips_idle = False
    one, other = Run(skipping).to(20_000_000, STEP), Run(executing).to(20_000_000, STEP)
    assert one.out == other.out
    assert everything(skipping) == everything(executing)
    assert executing.counters().processor.idle_instructions == 0
    counts = skipping.counters().processor
    assert counts.idle_cycles > 0.8 * counts.cycles  # a service and a frame take some 130 of 6,000 cycles


@example([1501, 36301, 71601, 106101, 141401], [1, 1, 2799], "poller")  # the pass that is learned from passed the end
@given(
    st.lists(st.integers(1_000, 400_000), min_size=1, max_size=12, unique=True),
    st.lists(st.integers(1, 60_000), min_size=1, max_size=6),
    st.sampled_from(["ticker", "poller"]),
)
def test_whatever_comes_in_and_however_it_is_sliced_skipping_changes_nothing(edges, steps, program):
    found = []
    for skips in (True, False):
        board = board_with(words_of(program))
        board.skips_idle = skips
        for number, time in enumerate(sorted(edges)):
            board.inbox.push(time, 256, PIN_EDGE, 3, 1 - (number & 1), -1, 0)
        run = Run(board)
        for step in steps if skips else [450_000]:
            run.to(min(board.horizon + step, 450_000), STEP)
        run.to(450_000, STEP)
        found.append((run.out, everything(board)))
    assert found[0] == found[1]


def test_a_loop_that_looks_at_a_pin_sees_its_edge_in_the_next_pass():
    board = board_with(words_of("poller"))
    times = [100_000, 200_000, 300_000, 300_500]
    for number, time in enumerate(times):
        board.inbox.push(time, 256, PIN_EDGE, 3, 1 - (number & 1), -1, 0)
    run = Run(board).to(2_000_000)
    toggles = [row for row in run.of(PIN_OUTPUT)[1:]]
    # four instructions of a pass and nine behind it, of at most 12 cycles each at 10 MHz, flash without its accelerator
    assert all(0 < row[0] - time < 13 * 12 * 100 for row, time in zip(toggles, times[:2], strict=False))
    assert len(toggles) in (2, 4)  # the last two edges are closer than a pass: it sees both or none
    processor = board.counters().processor
    assert processor.idle_cycles > 0.5 * processor.cycles


def test_a_board_that_waits_is_not_due_before_its_next_event():
    board = ticker()
    Run(board).to(2_000_000, STEP)
    next_match = board.alarm_time
    assert board.next_time == next_match > 2_000_000


def test_an_access_to_nothing_ends_the_run_with_one_line():
    #      mov r0, #0xE0000000; ldr r1, [r0, #0x100]
    board = board_with([0xE3A0020E, 0xE5901100])
    with pytest.raises(FirmwareError) as caught:
        board.advance(1_000_000)
    assert str(caught.value) == (
        "BOARD: the program reads 0xe0000100 as a word at pc 0x00000004: no device is modelled there"
    )
