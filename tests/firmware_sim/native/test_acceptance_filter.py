"""The acceptance filter of firmware in C: on this computer, and by the registers of the chip."""

import shutil

import pytest

from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.firmware_sim.lpc2194 import image
from ranger_sim.firmware_sim.lpc2194.board import ImageBoard
from ranger_sim.firmware_sim.native.image_build import build_image
from ranger_sim.firmware_sim.native.manifest import load
from ranger_sim.firmware_sim.native.native_board import NativeBoard
from ranger_sim.foundation.events import CAN_FILTER, CAN_REQUEST, CAN_RX, CAN_TX_DONE, FLAG_EXTENDED, ORDER_BUS
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import UserError
from tests.firmware_sim.native.support import COMPILER, SCHEDULE, folder_with, library_of

CROSS_COMPILER = shutil.which("arm-none-eabi-gcc")
pytestmark = pytest.mark.skipif(not COMPILER, reason="no C compiler here")
# Sends every frame back that it gets.
ECHO = """
#include <ranger_sim/firmware.h>
static int32_t on_frame(void)
{
    fw_can_frame frame;
    fw_can_read(1, &frame);
    fw_can_release(1);
    fw_can_transmit(1, 1, &frame);
    return 0;
}
static const fw_interrupt receive = {FW_CAN_RX, 1, on_frame, "on_frame", 100, 0, 0, FW_USUAL_LATENCY};
static const fw_can_range ranges[] = {RANGES};
static const fw_schedule schedule = {.slot_ns = 500000, .tick_vic_slot = 4};
void firmware_start(void)
{
    fw_can_start(1, 0x00254001, FW_ICR_RI);
    fw_can_accept(ranges, sizeof ranges / sizeof ranges[0]);
    fw_attach(&receive);
}
"""
GAP_NS = 100_000


def echo(folder, ranges):
    rows = ", ".join(f"{{{controller}, {first:#x}u, {last:#x}u}}" for controller, first, last in ranges)
    return folder_with(folder, ECHO.replace("RANGES", rows) + SCHEDULE)


def drawn(seed):
    """Ascending ranges of two controllers, single identifiers among them, as fw_can_range."""
    draw = RandomStream(seed, "ranges")
    rows = []
    for flag, highest, most in ((0, 0x7FF, 24), (0x8000_0000, 0x1FFF_FFFF, 12)):
        for controller in (1, 2):
            ends = sorted({draw.integer(highest + 1) for _ in range(2 * draw.integer(most))})
            for first, last in zip(ends[::2], ends[1::2], strict=False):
                rows.append((controller, flag | first, flag | (first if draw.integer(2) else last)))
    return rows


def frames_near(ranges, seed):
    """(identifier, flags) at the edges of the ranges, and some anywhere."""
    draw = RandomStream(seed, "frames")
    found = []
    for _, first, last in ranges:
        flag = FLAG_EXTENDED if first >> 31 else 0
        for end in {first & 0x1FFF_FFFF, last & 0x1FFF_FFFF}:
            found += [
                (end + step, 8 | flag) for step in (-1, 0, 1) if 0 <= end + step <= (0x1FFF_FFFF if flag else 0x7FF)
            ]
    found += [(draw.integer(0x800), 8) for _ in range(30)] + [
        (draw.integer(2**29), 8 | FLAG_EXTENDED) for _ in range(30)
    ]
    return found


def returned(board, frames):
    """What the board sends back of frames that arrive one by one; each transmission takes half of the gap."""
    found = []
    for place, (identifier, flags) in enumerate(frames):
        time = 3_000_000 + GAP_NS * place
        board.advance(time)
        board.inbox.push(time, ORDER_BUS, CAN_RX, 1, identifier, flags, place, 0)
        board.advance(time + GAP_NS // 2)
        while board.outbox.take():
            out = board.outbox
            if out.kind == CAN_REQUEST:
                found.append((out.c, out.d))
                board.inbox.push(time + GAP_NS // 2, ORDER_BUS, CAN_TX_DONE, 1, out.b, 0)
    return found


def expected(frames, ranges):
    def accepted(identifier, flags):
        value = identifier | (0x8000_0000 if flags & FLAG_EXTENDED else 0)
        return any(controller == 1 and first <= value <= last for controller, first, last in ranges)

    return [frame for frame in frames if accepted(*frame)]


@pytest.mark.parametrize("seed", range(3))
def test_only_frames_in_the_ranges_of_the_controller_reach_the_program(tmp_path, seed):
    ranges = drawn(seed)
    frames = frames_near(ranges, seed)
    board = NativeBoard("ECHO", library_of(echo(tmp_path / "echo", ranges)))
    assert 5 < len(expected(frames, ranges)) < len(frames) - 5
    assert returned(board, frames) == expected(frames, ranges)


@pytest.mark.skipif(not CROSS_COMPILER, reason="no arm-none-eabi-gcc here")
@pytest.mark.parametrize("seed", range(3))
def test_the_same_program_as_an_image_filters_by_the_registers_and_the_table(tmp_path, seed):
    ranges = drawn(seed)
    frames = frames_near(ranges, seed)
    built = build_image(load(echo(tmp_path / "echo", ranges)))
    board = ImageBoard("ECHO", image.read(built.path), Crystal(10_000_000))
    assert returned(board, frames) == expected(frames, ranges)
    assert board.acceptance.mode == 0


def test_the_bus_gets_the_filter_from_the_start_of_the_program(tmp_path):
    board = NativeBoard("ECHO", library_of(echo(tmp_path / "echo", [(1, 0x10, 0x10), (2, 0x20, 0x20)])))
    sent = []
    while board.outbox.take():
        sent.append((board.outbox.kind, board.outbox.a, board.outbox.b, board.outbox.ref))
    assert [row[:3] for row in sent] == [(CAN_FILTER, 1, 1)]
    assert sent[0][3] == board.filter_of(1) and board.filter_of(2) is None


@pytest.mark.parametrize(
    ("ranges", "reported"),
    [
        ([(1, 5, 5), (1, 5, 6)], "range 1: 0x5 of controller 1 does not follow the range before it"),
        ([(1, 0, 9), (1, 9, 12)], "range 1: 0x9 of controller 1 does not follow the range before it"),
        ([(2, 1, 1), (1, 2, 2)], "range 1: 0x2 of controller 1 does not follow the range before it"),
        ([(0, 1, 1)], "range 0: CAN controller 0 is not 1 ... 4"),
        ([(1, 0x700, 0x800)], "range 0: 0x700 to 0x800 is not a range of 11-bit identifiers"),
        ([(1, 2, 1)], "range 0: 0x2 to 0x1 is not a range of 11-bit identifiers"),
        ([(1, 1, 0x8000_0002)], "range 0: 0x1 to 0x80000002: FW_CAN_EXTENDED is set in one of the two"),
        ([(1, n, n) for n in range(0, 2046)][:1025], "1025 ranges, at most 1024 fit into the filter's table"),
        (
            [(1, 2 * n, 2 * n + 1) for n in range(513)],
            "the ranges take 2052 bytes of the filter's table, which has 2048",
        ),
    ],
)
def test_ranges_that_the_chip_cannot_hold_end_the_run_with_the_calls_name(tmp_path, ranges, reported):
    with pytest.raises(UserError) as mistake:
        NativeBoard("ECHO", library_of(echo(tmp_path / "echo", ranges)))
    assert f"ECHO: fw_can_accept: {reported}" in str(mistake.value)


@pytest.mark.skipif(not CROSS_COMPILER, reason="no arm-none-eabi-gcc here")
def test_on_the_chip_such_ranges_change_nothing(tmp_path):
    built = build_image(load(echo(tmp_path / "echo", [(1, 5, 5), (1, 5, 6)])))
    board = ImageBoard("ECHO", image.read(built.path), Crystal(10_000_000))
    frames = [(4, 8), (5, 8), (7, 8)]
    assert returned(board, frames) == frames
    assert board.acceptance.mode == 2  # bypass
