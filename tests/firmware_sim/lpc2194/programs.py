"""Small programs for the chip: their assembly, and the words that it comes to where no assembler is at hand."""

import array
import pathlib
import shutil
import subprocess

from ranger_sim.firmware_sim.lpc2194.board import ImageBoard
from ranger_sim.firmware_sim.lpc2194.hardware import BoardHardware
from ranger_sim.firmware_sim.lpc2194.image import Image
from ranger_sim.foundation.events import CAN_REQUEST, CAN_TX_DONE

HERE = pathlib.Path(__file__).parent
TOOLS = "arm-none-eabi-"
ASSEMBLER = shutil.which(TOOLS + "as")
FRAME_NS = 40_000


def words_of(name):
    """The words next to the assembly."""
    return [int(word, 16) for word in (HERE / f"{name}.words").read_text(encoding="utf-8").split()]


def linked(name, folder):
    """The assembly of a program, assembled and linked: an ELF file in `folder`."""
    made, elf = folder / f"{name}.o", folder / f"{name}.elf"
    subprocess.run([TOOLS + "as", "-mcpu=arm7tdmi", "-o", made, HERE / f"{name}.s"], check=True)
    subprocess.run([TOOLS + "ld", "-Ttext=0", "-e", "0", "-o", elf, made], check=True)
    return elf


def content(words):
    """Words as they are in memory."""
    return array.array("I", words).tobytes()


def image_of(words):
    """An image of these words from address 0 on."""
    return Image(pathlib.Path("words"), ((0, content(words)),))


def board_with(words, hardware=None, phase_ns=0, crystal=None):
    """A board that runs them."""
    return ImageBoard("BOARD", image_of(words), crystal, phase_ns, hardware or BoardHardware())


class Run:
    """A board on a bus that takes each frame in 40 us; what it puts out, with its stamps."""

    def __init__(self, board, controller=1):
        self.board = board
        self.controller = controller
        self.out = []  # (time, kind, a, b, c, d, e, f)

    def to(self, until, step=1_000_000):
        """Advance in steps; True time is the board's."""
        now = self.board.horizon
        while now < until:
            now = min(now + step, until)
            self.board.advance(now)
            self.take()
        return self

    def take(self):
        queue = self.board.outbox
        while queue.take():
            self.out.append((queue.time, queue.kind, queue.a, queue.b, queue.c, queue.d, queue.e, queue.f))
            if queue.kind == CAN_REQUEST:
                end = queue.time + FRAME_NS
                assert end >= self.board.horizon, "the step is longer than a frame"
                self.board.inbox.push(end, 512, CAN_TX_DONE, queue.a, queue.b, 0)

    def of(self, kind):
        return [row for row in self.out if row[1] == kind]
