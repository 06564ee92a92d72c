"""Firmware images in the places of the robot's boards: wired, run, and each mistake reported in one line."""

import contextlib
import dataclasses

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.ranger.firmware import image_boards
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario
from ranger_sim.ranger.timeline.timeline import Timeline
from tests.firmware_sim.lpc2194.programs import image_of, words_of


def robot_with(board, words):
    return contextlib.closing(Ranger(Scenario(seed=2), images={board: image_of(words)}))


def test_a_board_with_an_image_sends_its_frames_on_its_bus_with_the_others():
    with robot_with("MCH", words_of("ticker")) as robot:
        wire = robot.wire("can1")
        robot.run_for(0.05)
        counters = robot.counters()["MCH"]
        received = wire.frames(14)
        # the ticker sends its count as id 14 every 100 us, from half a millisecond after its power-up (up to 2 ms)
        assert 470 <= len(received) <= 500
        assert abs(counters.can[0].sent - len(received)) <= 1
        assert counters.slots.count == pytest.approx(len(received), abs=2)
        assert robot.summary()["failed_boards"] == []
        assert counters.processor.idle_cycles > 0.5 * counters.processor.cycles


def test_the_same_bytes_however_a_run_is_sliced():
    digests = []
    for pieces in (1, 7):
        with robot_with("MCH", words_of("ticker")) as robot:
            for piece in range(pieces):
                robot.run_for(0.03 * (piece + 1) / pieces - robot.time_s)
            counters = robot.counters()["MCH"]
            processor = dataclasses.replace(counters.processor, idle_instructions=0, idle_cycles=0)
            digests.append((robot.trace_digest(), dataclasses.replace(counters, processor=processor)))
    assert digests[0] == digests[1]


def test_a_program_that_reaches_for_nothing_ends_the_run_with_its_place():
    #                              mov r0, #0xE0000000; str r0, [r0, #8]
    with robot_with("MCSI", [0xE3A0020E, 0xE5800008]) as robot:
        with pytest.raises(UserError, match="MCSI: the program writes 0xe0000000 to 0xe0000008 as a word at pc 0x0000"):
            robot.run_for(0.05)


VECTORS = [0xEA000006, *[0xEAFFFFFE] * 7]  # b 0x20, then branches to themselves
TO_NOWHERE = {
    #                    mov r1, #0x60000000; ldr r2, [r1]
    "a load": ([0xE3A01206, 0xE5912000], "data abort: no memory for an access to 0x60000000 at pc 0x00000024", 0x10),
    #                    mov r1, #0x60000000; bx r1
    "a jump": ([0xE3A01206, 0xE12FFF11], "prefetch abort: no memory at pc 0x60000000", 0x0C),
    "an instruction": ([0xE7F000F0], "undefined instruction at pc 0x00000020", 0x04),
}


@pytest.mark.parametrize("name", TO_NOWHERE)
def test_an_image_without_a_handler_loses_its_power_and_the_robot_goes_on(name):
    words, reported, vector = TO_NOWHERE[name]
    with robot_with("MCH", VECTORS + words) as robot:
        robot.run_for(0.05)
        summary = robot.summary()
        assert summary["images"]["MCH"]["why"] == f"{reported}, without a handler at {vector:#010x}"
        assert summary["images"]["MCH"]["lost_s"] < 0.01
        assert summary["failed_boards"] == ["MCH"]
        assert summary["time_s"] == pytest.approx(0.05)
        digest = robot.trace_digest()
    with robot_with("MCH", VECTORS + words) as robot:
        for piece in (0.0003, 0.0204, 0.0293):
            robot.run_for(piece)
        assert robot.trace_digest() == digest


@pytest.mark.parametrize(
    ("vector", "words", "back", "mode"),
    [
        (4, [0xE7F000F0], 0x24, 0x1B),
        (3, [0xE3A01206, 0xE12FFF11], 0x60000004, 0x17),
        (2, [0xE3A01206, 0xE5912000], 0x2C, 0x17),
    ],
    ids=["undefined", "prefetch abort", "data abort"],
)
def test_a_handler_of_the_image_gets_the_exception_as_on_the_chip(vector, words, back, mode):
    """LR is pc + 4 of the one that failed (data abort: pc + 8), SPSR the status of before: ARM7TDMI data sheet, 3.9."""
    vectors = [*VECTORS]
    place = {4: 1, 3: 3, 2: 4}[vector]
    vectors[place] = 0xEA000000 | (0x40 - 4 * place - 8) // 4
    padding = [0xE1A00000] * (8 - len(words))
    with robot_with("MCH", [*vectors, *words, *padding, 0xE3A05001, 0xEAFFFFFE]) as robot:  # mov r5, #1; b .
        robot.run_for(0.01)
        core = robot.boards["MCH"].core
        assert robot.deaths == []
        assert (core.r[5], core.r[14], core.cpsr() & 0x1F, core.spsr() & 0x1F) == (1, back, mode, 0x13)
        assert core.cpsr() & 0x80  # interrupts are off


def test_a_reset_begins_the_program_anew():
    with robot_with("MCH", words_of("ticker")) as robot:
        wire = robot.wire("can1")
        fault = robot.inject("MCH.processor", "reset", at="10 ms")
        robot.run_for(0.03)
        assert fault.acted
        counts = [frame.lo for frame in wire.frames(14)]
        again = counts.index(1, 1)
        assert counts[: again + 2] == [*range(1, again + 1), 1, 2]


def test_a_timeline_of_a_robot_with_images_can_be_written(tmp_path):
    with robot_with("MCH", words_of("ticker")) as robot:
        timeline = Timeline(robot)
        robot.run_for(0.01)
        timeline.write(tmp_path / "trace.vcd")
    assert (tmp_path / "trace.vcd").stat().st_size > 1_000


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("MCH", "image 'MCH': BOARD=FILE is expected"),
        ("MCH=", "image 'MCH=': BOARD=FILE is expected"),
        ("MB=a.axf", "image for board 'MB': boards that can run a firmware image are MCH, MCFO, MCFI, MCSI, UI, CSR"),
        ("=a.axf", "image for board '': "),
    ],
)
def test_a_place_that_takes_no_image_is_named(text, message):
    with pytest.raises(UserError, match=message):
        image_boards.placed(text)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(UserError, match=r"gone\.axf: No such file"):
        image_boards.loaded({"MCH": tmp_path / "gone.axf"})


@pytest.mark.parametrize("board", image_boards.BOARDS)
def test_every_board_has_its_hardware(board):
    hardware = image_boards.hardware_of(board)
    assert (hardware.external is not None) == (board in image_boards.SEQUENCES)
    assert (hardware.segment_interval_ns > 0) == (board == "CSR")
