"""A debugger's view of a board: registers, memory, points at which to halt.

Names and numbers of registers are those of gdb's feature `org.gnu.gdb.arm.core` (Debugging with GDB, appendix G.5.3).
A second feature has what the other modes keep, and the cycle counter.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol, cast

from ranger_sim.firmware_sim.arm7.core import Core
from ranger_sim.foundation.user_error import UserError

CORE_REGISTERS = (*(f"r{i}" for i in range(13)), "sp", "lr", "pc", "cpsr")
PC, CPSR = 15, 16
MODES = ("usr", "fiq", "irq", "svc", "abt", "und")  # in the order of Core.banked
BANKED = (
    *(f"{name}_{mode}" for mode in MODES for name in ("sp", "lr")),
    *(f"spsr_{mode}" for mode in MODES[1:]),
    *(f"r{i}_fiq" for i in range(8, 13)),
)
CYCLES = "cycles"
NAMES = (*CORE_REGISTERS, *BANKED, CYCLES)
SIZES = (4,) * (len(NAMES) - 1) + (8,)  # bytes
FLASH_BLOCK = 4096  # what gdb erases at a time; chosen by us: the smallest that divides all of the chip's sectors
END = 1 << 32
READ, WRITE = 1, 2  # kinds of Core.watches


class TargetError(Exception):
    """A register or an address that the debugger asked for is not available; the text gives the reason."""


class Debuggable(Protocol):
    """A board that a debugger can hold. Its `time_of` and `skips_idle` are used as well."""

    name: str
    core: Core


class Region(NamedTuple):
    """A part of the address space, as in gdb's memory map: ram or flash."""

    kind: str
    start: int
    length: int


def description() -> str:
    """target.xml: the registers of `NAMES`."""
    kinds = {"sp": "data_ptr", "lr": "int", "pc": "code_ptr"}
    lines = [
        '<?xml version="1.0"?>',
        '<!DOCTYPE target SYSTEM "gdb-target.dtd">',
        '<target version="1.0">',
        "<architecture>arm</architecture>",
        '<feature name="org.gnu.gdb.arm.core">',
        *(f'<reg name="{name}" bitsize="32" type="{kinds.get(name, "uint32")}"/>' for name in CORE_REGISTERS),
        "</feature>",
        '<feature name="ranger-sim.arm7.banked">',
        *(f'<reg name="{name}" bitsize="32" type="uint32" group="system"/>' for name in BANKED),
        # time does not go back: gdb leaves it out when it restores registers after a call
        f'<reg name="{CYCLES}" bitsize="64" type="uint64" group="system" save-restore="no"/>',
        "</feature>",
        "</target>",
    ]
    return "\n".join(lines)


class Target:
    """`board` as a debugger sees it, halted between two instructions."""

    def __init__(self, board: Debuggable) -> None:
        self.board = board
        self.core = board.core
        self.points: dict[str, set[int]] = {"0": set(), "1": set()}
        self.watches: dict[str, set[tuple[int, int]]] = {"2": set(), "3": set(), "4": set()}

    # ---- registers

    def register(self, number: int) -> int:
        """The value of register `number` of `NAMES`. TargetError: unknown number."""
        core = self.core
        if number < PC:
            return core.r[number]
        if number == PC:
            return core.pc
        if number == CPSR:
            return core.cpsr()
        if number >= len(NAMES):
            raise TargetError(f"there is no register {number}")
        if NAMES[number] == CYCLES:
            return core.cycles
        words, place = self._bank(NAMES[number])
        return words[place]

    def set_register(self, number: int, value: int) -> None:
        """Write it. TargetError: unknown number, or a value that the register does not take."""
        core = self.core
        if not 0 <= value <= 0xFFFFFFFF:
            raise TargetError(f"{value:#x} has more than the 32 bits of a register")
        if number < PC:
            core.r[number] = value
        elif number == PC:
            core.pc = value & (-2 if core.cpsr() & 0x20 else -4)
        elif number == CPSR:
            try:
                core.set_cpsr(value)
            except UserError as error:
                raise TargetError(str(error)) from None
        elif number >= len(NAMES) or NAMES[number] == CYCLES:
            raise TargetError(f"register {NAMES[number] if number < len(NAMES) else number} cannot be written")
        else:
            words, place = self._bank(NAMES[number])
            words[place] = value

    def _bank(self, name: str) -> tuple[Any, int]:
        """Where a mode's own register is kept: among the present ones when that mode runs."""
        core = self.core
        what, _, mode = name.partition("_")
        bank = MODES.index(mode)
        running = core.bank_now()
        if what == "spsr":
            return core.saved, bank
        if what in ("sp", "lr"):
            place = 13 if what == "sp" else 14
            return (core.r, place) if bank == running else (core.banked, 2 * bank + place - 13)
        place = int(what[1:])
        return (core.r, place) if running == bank else (core.high, 5 + place - 8)

    # ---- memory

    def regions(self) -> list[Region]:
        """Flash, RAM, and all else, where devices may be."""
        core = self.core
        found = [Region("flash", core.flash_base, core.flash_size), Region("ram", core.ram_base, core.ram_size)]
        if core.device is not None:
            start = 0
            for each in sorted(found, key=lambda region: region.start):
                if start < each.start:
                    found.append(Region("ram", start, each.start - start))
                start = each.start + each.length
            if start < END:
                found.append(Region("ram", start, END - start))
        return sorted(found, key=lambda region: region.start)

    def memory_map(self) -> str:
        """The regions as gdb's XML."""
        lines = ['<?xml version="1.0"?>', "<memory-map>"]
        for kind, start, length in self.regions():
            where = f'type="{kind}" start="{start:#x}" length="{length:#x}"'
            if kind == "flash":
                lines.append(f'<memory {where}><property name="blocksize">{FLASH_BLOCK:#x}</property></memory>')
            else:
                lines.append(f"<memory {where}/>")
        lines.append("</memory-map>")
        return "\n".join(lines)

    def _memory(self, address: int, length: int) -> tuple[Any, int] | None:
        """(words, place of the first byte) of what lies in flash or RAM as a whole."""
        core = self.core
        for words, base, size in (
            (core.flash, core.flash_base, core.flash_size),
            (core.ram, core.ram_base, core.ram_size),
        ):
            if base <= address and address + length <= base + size:
                return words, address - base
        return None

    def read(self, address: int, length: int) -> bytes:
        """Bytes of memory, or of device registers as far as they can be read without side effects.

        TargetError: an unmapped address, or reading would change the device (`monitor read` does that).
        """
        found = self._memory(address, length)
        if found is not None:
            words, place = found
            first, last = place >> 2, (place + length + 3) >> 2
            whole = b"".join(int(words[i]).to_bytes(4, "little") for i in range(first, last))
            return whole[place & 3 : (place & 3) + length]
        device = self.core.device
        peek = getattr(device, "peek", None)
        if device is None or peek is None:
            raise TargetError(f"nothing at {address:#010x} can be read without a side effect")
        out = bytearray()
        try:
            for place in range(address & -4, address + length, 4):
                out += (cast("int", peek(place, 4)) & 0xFFFFFFFF).to_bytes(4, "little")
        except (LookupError, UserError) as error:
            raise TargetError(str(error) or f"nothing is at {address:#010x}") from None
        return bytes(out[address & 3 : (address & 3) + length])

    def read_device(self, address: int) -> int:
        """Load a word as the program does, with all that this does to the device. TargetError: nothing is there."""
        if self.core.device is None or self._memory(address & -4, 4) is not None:
            raise TargetError(f"there is no device at {address:#010x}")
        try:
            return int(self.core.device.read(address & -4, 4))
        except (LookupError, UserError) as error:
            raise TargetError(str(error) or f"nothing is at {address:#010x}") from None

    def write(self, address: int, data: bytes) -> None:
        """Into RAM, into flash as a programmer does, or to a device as the program does."""
        if self._memory(address, len(data)) is not None:
            self.core.place(address, data)
            return
        device = self.core.device
        size = len(data)
        if device is None or size not in (1, 2, 4) or address % size:
            raise TargetError(f"{size} bytes at {address:#010x} can be written to no memory and no device")
        try:
            device.write(address, size, int.from_bytes(data, "little"))
        except (LookupError, UserError) as error:
            raise TargetError(str(error) or f"nothing is at {address:#010x}") from None

    def erase(self, address: int, length: int) -> None:
        """Flash to ones, as a programmer leaves it. TargetError: it is not flash."""
        core = self.core
        if not (core.flash_base <= address and address + length <= core.flash_base + core.flash_size):
            raise TargetError(f"{length} bytes at {address:#010x} are not flash")
        core.place(address, b"\xff" * length)

    # ---- halting

    def set_point(self, kind: str, address: int, length: int) -> None:
        """A breakpoint ("0" software, "1" hardware: the same here, memory is not changed) or a watchpoint
        ("2" on writes, "3" on reads, "4" on both)."""
        if kind in self.points:
            self.points[kind].add(address)
        else:
            self.watches[kind].add((address, length))
        self._set()

    def clear_point(self, kind: str, address: int, length: int) -> None:
        """Remove it; nothing happens when it is not set."""
        if kind in self.points:
            self.points[kind].discard(address)
        else:
            self.watches[kind].discard((address, length))
        self._set()

    def clear_points(self) -> None:
        """All of them."""
        for points in self.points.values():
            points.clear()
        for watches in self.watches.values():
            watches.clear()
        self._set()

    def count(self) -> int:
        """The number of points."""
        return sum(map(len, self.points.values())) + sum(map(len, self.watches.values()))

    def _set(self) -> None:
        watches = []
        for kind, kinds in (("2", WRITE), ("3", READ), ("4", READ | WRITE)):
            watches += [(address, address + length, kinds) for address, length in sorted(self.watches[kind])]
        self.core.set_points(self.points["0"] | self.points["1"], watches)

    def time_text(self) -> str:
        """The board's time, in a line."""
        core = self.core
        time_of = getattr(self.board, "time_of", None)
        at = f"{time_of(core.cycles) * 1e-9:.9f} s, " if time_of is not None else ""
        return f"{self.board.name}: {at}{core.cycles} cycles, {core.instructions} instructions"
