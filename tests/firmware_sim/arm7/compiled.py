"""C for the ARM7TDMI, built by the compiler that firmware is built with, called function by function in our core.

python -m tests.firmware_sim.arm7.compiled     # cycles per instruction of each, and instructions per second
"""

import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile

from ranger_sim.firmware_sim.arm7.core import Core
from ranger_sim.foundation import wallclock

HERE = pathlib.Path(__file__).parent
TOOLS = "arm-none-eabi-"
RAM, STACK, BACK = 0x40000000, 0x40004000, 0x3FFF0  # BACK is where a function returns to
LINK = """
SECTIONS
{
    .text 0x100 : { *(.text*) *(.rodata*) . = ALIGN(16); }
    .data 0x40000000 : { *(.data*) *(.bss*) *(COMMON) }
    .none : { *(.ARM.exidx*) }
}
"""


def is_there():
    """Is there a cross compiler with its library?"""
    return shutil.which(TOOLS + "gcc") is not None


def run(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=60).stdout


class Program:
    """The functions of programs.c, in flash; `state` is "arm" or "thumb"."""

    def __init__(self, folder, state="arm", level="-O2") -> None:
        folder = pathlib.Path(folder)
        elf = folder / f"programs-{state}.elf"
        script = folder / "link.ld"
        script.write_text(LINK)
        run(
            *(TOOLS + "gcc", f"-m{state}", "-mcpu=arm7tdmi", "-mthumb-interwork", level, "-ffreestanding"),
            *("-nostartfiles", "-Wl,--no-gc-sections", "-T", str(script), "-o", str(elf), str(HERE / "programs.c")),
            *("-lc", "-lgcc"),
        )
        self.elf = elf
        self.places = {}
        for line in run(TOOLS + "nm", str(elf)).splitlines():
            address, _, name = line.split()
            self.places[name] = int(address, 16)
        text, data = folder / "text.bin", folder / "data.bin"
        run(TOOLS + "objcopy", "-O", "binary", "-j", ".text", str(elf), str(text))
        run(TOOLS + "objcopy", "-O", "binary", "-j", ".data", str(elf), str(data))
        self.core = Core()
        self.core.place(0x100, text.read_bytes())
        self.core.place(RAM, data.read_bytes())
        self.core.set_cpsr(0x1F)
        self.thumb = state == "thumb"

    def call(self, name, *arguments):
        """What the function returns, as a word; registers are what the calling convention wants."""
        core = self.core
        for i, value in enumerate(arguments):
            core.r[i] = value & 0xFFFFFFFF
        core.r[13], core.r[14] = STACK, BACK
        core.set_cpsr(0x3F if self.thumb else 0x1F)
        core.pc = self.places[name] & -2
        while core.pc != BACK:
            core.step()
        return core.r[0]

    def measure(self, name, calls):
        """Cycles per instruction over these calls, each a tuple of arguments."""
        core = self.core
        cycles, instructions = core.cycles, core.instructions
        for arguments in calls:
            self.call(name, *arguments)
        return (core.cycles - cycles) / (core.instructions - instructions)


def float_bits(value):
    return struct.unpack("<I", struct.pack("<f", value))[0]


CALLS = {
    "search_table": [(x,) for x in range(-1990, 1990, 131)],
    "control": [(1000 * (i % 7), 900 * (i % 5) - 300) for i in range(40)],
    "scale": [(float_bits(0.37 * i - 3),) for i in range(40)],
    "comply": [(13 * i % 900,) for i in range(40)],
    "copy_and_sum": [(i,) for i in range(5)],
    "dispatch": [(i,) for i in range(40)],
}


def speed(program, rounds=10, cycles=20_000_000):
    """Millions of instructions per second of the processor's time, the best of so many rounds of `forever`."""
    core = program.core
    core.r[13], core.r[14] = STACK, BACK
    core.set_cpsr(0x3F if program.thumb else 0x1F)
    core.pc = program.places["forever"] & -2
    best = 0.0
    for _ in range(rounds):
        begun, before = wallclock.process_cpu_s(), core.instructions
        core.run(core.cycles + cycles)
        best = max(best, (core.instructions - before) / (wallclock.process_cpu_s() - begun) * 1e-6)
    return best


def tell() -> None:
    for state in ("arm", "thumb"):
        with tempfile.TemporaryDirectory() as folder:
            program = Program(folder, state)
            first = program.core.cycles, program.core.instructions
            for name, calls in CALLS.items():
                print(f"{state:6} {name:14} {program.measure(name, calls):.3f} cycles per instruction")
            core = program.core
            print(f"{state:6} {'all':14} {(core.cycles - first[0]) / (core.instructions - first[1]):.3f}")
            print(f"{state:6} {'all':14} {speed(program):.1f} million instructions per second")


if __name__ == "__main__":
    if not is_there():
        sys.exit(f"{TOOLS}gcc is not installed")
    tell()
