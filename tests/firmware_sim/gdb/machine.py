"""A tiny machine to debug: a core with a program, one device, and an interrupt every 700 cycles.

python -m tests.firmware_sim.gdb.machine PORT     # runs on a port until it is interrupted
"""

import pathlib
import shutil
import subprocess

from ranger_sim.firmware_sim.arm7.core import IRQ_LINE, Core

HERE = pathlib.Path(__file__).parent
TOOLS = "arm-none-eabi-"
TICK = 700  # cycles
LINK = """
ENTRY(start)
MEMORY { flash (rx) : ORIGIN = 0, LENGTH = 256K  ram (rwx) : ORIGIN = 0x40000000, LENGTH = 16K }
SECTIONS { .text : { *(.vectors) *(.text*) *(.rodata*) } > flash  .bss : { *(.data*) *(.bss*) *(COMMON) } > ram }
"""


def compiler_is_there():
    return shutil.which(TOOLS + "gcc") is not None


def build(folder):
    """(the ELF file, the bytes of its flash)."""
    folder = pathlib.Path(folder)
    script, elf, flash = folder / "link.ld", folder / "program.elf", folder / "flash.bin"
    script.write_text(LINK)
    command = (TOOLS + "gcc", "-marm", "-mcpu=arm7tdmi", "-g", "-O1", "-ffreestanding", "-nostdlib", "-T", script)
    subprocess.run((*command, "-o", elf, HERE / "program.c"), check=True, timeout=60)
    subprocess.run((TOOLS + "objcopy", "-O", "binary", "-j", ".text", elf, flash), check=True, timeout=60)
    return elf, flash.read_bytes()


class Device:
    """SAMPLE at 0xE0000000 counts its reads; LEVEL at 0xE0000004 is the interrupt line."""

    def __init__(self, core):
        self.core = core
        self.reads = 0

    def read(self, address, size):
        if address != 0xE0000000:
            raise LookupError
        self.reads += 1
        return self.reads & 0xFF

    def peek(self, address, size):
        if address == 0xE0000000:
            return self.reads + 1 & 0xFF
        if address == 0xE0000004:
            return self.core.lines
        raise LookupError

    def write(self, address, size, value):
        if address != 0xE0000004:
            raise LookupError
        self.core.lines = IRQ_LINE if value else 0


class Machine:
    """The board: `run` passes time."""

    name = "TINY"

    def __init__(self, flash=b""):
        self.core = Core(name=self.name)
        self.core.device = Device(self.core)
        self.core.place(0, flash)
        self.next_tick = TICK

    def run(self, until):
        core = self.core
        while core.cycles < until:
            core.run(min(until, self.next_tick))
            if core.cycles >= self.next_tick:
                self.next_tick += TICK
                core.lines = IRQ_LINE

    def digest(self):
        core = self.core
        return (core.cycles, core.instructions, core.pc, core.cpsr(), tuple(core.r)[:15], tuple(core.ram))


if __name__ == "__main__":
    import sys
    import tempfile

    from ranger_sim.firmware_sim.gdb.server import GdbServer

    with tempfile.TemporaryDirectory() as folder:
        elf, flash = build(folder)
        machine = Machine(flash)
        server = GdbServer(machine, int(sys.argv[1]))
        print(f"{elf} at {server.host}:{server.port}", flush=True)
        server.wait_for_debugger()
        machine.run(10**12)
