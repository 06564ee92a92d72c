"""A debugger at a board that runs an image: it looks and nothing changes, also at devices and at loops that wait."""

import contextlib
import socket

import pytest

from ranger_sim.firmware_sim.gdb.server import GdbServer
from tests.firmware_sim.gdb.client import session
from tests.firmware_sim.lpc2194.programs import Run, board_with, words_of

END = 1_400_000  # ns
STEP = 35_000  # shorter than a frame
TIMER0_TC, PINSEL0 = 0xE0004008, 0xE002C000


def ticker():
    return board_with(words_of("ticker"))


def everything(board):
    core = board.core
    counts = board.counters().processor
    return (list(core.r[:15]), core.pc, core.cpsr(), list(core.ram), counts.instructions, counts.cycles)


def readable(board):
    return [
        (block, offset)
        for block in board.map.blocks()
        for offset, (_, access) in sorted(block.REGISTERS.items())
        if "r" in access
    ]


def test_a_register_that_a_read_changes_is_not_inspected_and_all_others_are():
    board = ticker()
    Run(board).to(END, STEP)
    for block, offset in readable(board):
        if offset in block.READ_ACTS:
            with pytest.raises(LookupError, match="does something"):
                board.map.peek(block.base + offset, 4)
        else:
            try:
                board.map.peek(block.base + offset, 4)
            except LookupError as error:
                assert "not modelled" in str(error)  # the device cannot tell in this state
    with pytest.raises(LookupError, match="no device"):
        board.map.peek(0xE01F0000, 4)


# Reads that give another value another time but do nothing: counters that run, and states that are to change by
# themselves. What is neither steady nor here does something when it is read.
RUN_WITH_TIME = {"TC", "PC", "PWMTC", "PLLSTAT", "ADSTAT", "SR", "GSR"}


def test_what_a_read_may_change_is_named():
    board = ticker()
    Run(board).to(END, STEP)
    missing = []
    for block, offset in readable(board):
        name = block.REGISTERS[offset][0]
        block.steady = False
        try:
            block.read(offset)
        except Exception as error:  # noqa: BLE001  (what the register cannot tell in this state)
            assert "not modelled" in str(error), name
            continue
        if not (block.steady or offset in block.READ_ACTS or name in RUN_WITH_TIME):
            missing.append((block.name, name))
    assert missing == []


def test_looking_at_a_board_of_the_chip_leaves_its_run_as_it_is():
    alone = Run(ticker()).to(END, STEP)

    def talk(client):
        symbols = {}
        for kind in (1, 2):
            assert client.ask(f"Z{kind},{0x40000000 if kind == 2 else 0x18:x},4") == "OK"
        for _ in range(10):
            assert client.ask("c").startswith("T05thread:1;")
            symbols[client.register(15)] = client.register(16)
            for _ in range(20):
                client.ask("s")
            assert client.word(TIMER0_TC) >= 0
            assert client.word(PINSEL0) == client.word(PINSEL0)
            assert client.ask("mfffff030,4") == "E0e"  # VICVectAddr: a read is an interrupt's begin
        assert client.ask("z1,18,4") == "OK"
        assert client.ask("z2,40000000,4") == "OK"
        assert " s, " in client.monitor("time")
        client.ask("D")
        return symbols

    board = ticker()
    run = Run(board)
    seen, server = session(board, END, talk, run=lambda until: run.to(until, STEP))
    assert 0x18 in seen
    assert server.halts == 10 * 21
    assert run.out == alone.out
    assert everything(board) == everything(alone.board)
    assert board.skips_idle
    assert board.counters().processor.idle_instructions > 0


def test_a_program_that_waits_for_ever_without_an_interrupt_is_found_by_a_debugger_and_goes_on_as_without():
    """`b .` is skipped at once; the gdb port is polled all the same, and nothing else."""
    alone, board = board_with([0xEAFFFFFE]), board_with([0xEAFFFFFE])
    with contextlib.closing(GdbServer(board, 0, ends=lambda: True)) as server:  # held, it is let go
        server.begin()
        run = Run(board).to(20_000_000)
        assert board.next_time < 40_000_000  # it is due for the door's sake
        with socket.create_connection(("127.0.0.1", server.port)):
            run.to(40_000_000)
            assert server.seen == 1
    Run(board).to(60_000_000)
    Run(alone).to(60_000_000)
    assert everything(board) == everything(alone)
    assert board.counters().processor.idle_cycles > 0.9 * board.core.cycles
