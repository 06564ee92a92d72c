"""Writes docs/reference/registers.md: the registers of the LPC2194 that a firmware image finds.

python docs/registers_table.py
"""

import pathlib

from ranger_sim.firmware_sim.lpc2194.board import ImageBoard
from ranger_sim.firmware_sim.lpc2194.image import Image
from ranger_sim.tools.command_line.files import replace_file

PAGE = pathlib.Path(__file__).parent / "reference/registers.md"
HEAD = """# Registers of the LPC2194

Registers of a board that runs a firmware image (`--image`, [how to](../how-to/firmware-image.md)). Names are the data
sheet's. An access to an address that is not in this table ends the run with a line that names it; so does a function of
a register that is not modelled (the module's docstring lists these). Write-only registers read 0; a write to a
read-only register does nothing. Bytes and half-words reach a register at its first byte, those of fast GPIO at any.

`python docs/registers_table.py` writes this page from the code, and a test compares both.
"""


def page() -> str:
    """The whole page."""
    board = ImageBoard("BOARD", Image(pathlib.Path("none"), ((0, bytes(4)),)))
    lines = [HEAD]
    for block in board.map.blocks():
        module = type(block).__module__.removeprefix("ranger_sim.").replace(".", "/")
        lines += [f"## {block.name}", "", f"`{module}.py`", "", "| address | register | access |", "|---|---|---|"]
        for offset, (name, access) in sorted(block.REGISTERS.items()):
            lines.append(f"| {block.base + offset:#010x} | {name} | {access} |")
        lines.append("")
    return "\n".join(lines).rstrip() + "\n"


if __name__ == "__main__":
    replace_file(PAGE, page().encode())
