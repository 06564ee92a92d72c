"""docs/reference/registers.md has every register that answers, and no other; each answers as its access says."""

import pathlib
import re

import pytest

from ranger_sim.firmware_sim.lpc2194.block import NotModelledError
from tests.firmware_sim.lpc2194.programs import board_with

PAGE = pathlib.Path(__file__).resolve().parents[3] / "docs/reference/registers.md"
ROW = re.compile(r"^\| (0x[0-9a-f]{8}) \| (\S+) \| (rw|r|w) \|$", re.MULTILINE)
# Their writes need something first: a device at the SPI, a rate of the SSP, a request for what there is.
NEEDS_SETTING_UP = ("SPDR", "SSPDR", "MEMMAP", "EWL", "RFS", "RID", "RDA", "RDB", "AFMR")


def blocks():
    return board_with([0xEAFFFFFE]).map.blocks()


def test_the_page_has_the_registers_of_the_blocks():
    documented = {(int(address, 16), name, access) for address, name, access in ROW.findall(PAGE.read_text("utf-8"))}
    there = {
        (block.base + offset, name, access) for block in blocks() for offset, (name, access) in block.REGISTERS.items()
    }
    assert documented == there
    assert len(there) > 250


@pytest.mark.parametrize("number", range(len(blocks())))
def test_what_the_page_has_answers_and_what_it_has_not_is_refused(number):
    block = blocks()[number]
    for offset in range(0, 0x400, 4):
        if offset in block.REGISTERS:
            name, access = block.REGISTERS[offset]
            if "SPDR" not in name:
                assert block.read(offset) >= 0, name
            if name not in NEEDS_SETTING_UP:
                block.write(offset, 0)
        elif offset < block.MEMORY:
            block.write(offset, offset)
            assert block.read(offset) == offset
        else:
            with pytest.raises(NotModelledError):
                block.read(offset)
            with pytest.raises(NotModelledError):
                block.write(offset, 0)
