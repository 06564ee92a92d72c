# cython: boundscheck=False, wraparound=False
# (every index below is a field of 4 bits, or a place held against its memory's size)
"""The ARM7TDMI core (ARMv4T): ARM and Thumb state, seven modes with banked registers, exceptions, cycles.

Sources: ARM Architecture Reference Manual (DDI 0100, ARMv4T) for results, ARM7TDMI data sheet (DDI 0029E) for cycles
and for what the architecture leaves open: loads from unaligned addresses rotate, an aborted load leaves its base
updated, STR and STM of the program counter store its address + 12, an empty register list moves the program counter
and steps by 64 bytes. A status register has twelve bits (DDI 0029E, section 3.8): 8 to 27 are not stored, read as zero.

Cycles are the S, N, I and C cycles that chapter 10 of the data sheet sums up by class of instruction; each is one
clock, and memory adds waits. RAM adds none. A device from `bridge_base` up, behind the bridge to the peripheral bus,
adds `device_waits`; below it (fast GPIO) none. Flash adds what its accelerator cannot hide.

The accelerator (MAM) is modelled after chapter 5 of the user manual of the LPC2119/2129/2194/2292/2294: two banks of
lines of 16 bytes, in turn; for each bank a branch trail buffer, which holds the last line that had to be waited for,
and a prefetch buffer, which begins to fetch the next line as a line is entered; one line of data for both. An access
takes `mam_timing` clocks; a datum in a bank that is prefetching makes this begin anew. `mam_mode` 2 has all of it;
in 1 only fetches that follow one another use what was prefetched, branches, fetches after a store and data wait; in 0
everything waits. Chosen by us, because the manual does not say: a prefetch begins in the clock after its line was
entered, and the two fetches by which the pipeline runs ahead of a branch do not count.

Straight code does not wait, a branch to a new place waits `mam_timing - 1` clocks, as does a constant out of another
line. docs/explanation/arm7.md gives the results for compiled code. `cycles_per_instruction`, when not 0, takes the
place of all of this: every instruction then takes that number of cycles, the entry of an interrupt or abort 3 as ever.

A debugger (`firmware_sim/gdb`) takes part by `debugger`: `run` then asks it at breakpoints, watchpoints and steps, and
polls its endpoint periodically. It stops between two instructions, for as long as it likes; no cycle passes meanwhile,
and everything not changed by hand goes on as without it.

An access to an unmapped address raises `BusFault` with address and program counter. With `takes_aborts` the program
gets its data or prefetch abort instead, as on the chip, and `fault_address` keeps the address. With `needs_handlers`
an abort or an undefined instruction raises `BoardFailure` where the vector leads to no handler: to nothing, or to a
branch to itself. `place_of(address)` then names functions.
"""

import array
from typing import Final

import cython

from ranger_sim.firmware_sim.arm7.decoding import (
    ADD,
    ADD_CONSTANT,
    ADDS,
    ADDS_CONSTANT,
    AMOUNT,
    AND,
    AND_CONSTANT,
    ANDS,
    BRANCH,
    BRANCH_EXCHANGE,
    BRANCH_LINK,
    BRANCH_LINK_LOW,
    CLEAR,
    COMPARE,
    COMPARE_CONSTANT,
    CONDITION,
    DATA,
    DESTINATION,
    FIRST,
    IN_THUMB,
    INDEXED,
    KIND,
    LOAD,
    LOAD_BYTE,
    LOAD_CONSTANT,
    LOAD_HALF,
    MOVE,
    MOVE_CONSTANT,
    MOVES,
    MOVES_CONSTANT,
    OR,
    OR_CONSTANT,
    ORS,
    REVERSE,
    REVERSE_CONSTANT,
    SECOND,
    SHIFT_LEFT,
    SHIFT_RIGHT,
    SHIFT_SIGNED,
    SHIFTED,
    SHIFTS,
    STORE,
    STORE_BYTE,
    STORE_HALF,
    SUBS,
    SUBS_CONSTANT,
    SUBTRACT,
    TEST,
    TEST_CONSTANT,
    TEST_EQUAL,
    TEST_TURNED,
    WHOLE,
    XOR,
    XOR_CONSTANT,
    XORS,
    decode_arm,
    decode_thumb,
)
from ranger_sim.foundation.user_error import BoardFailure, FirmwareError, UserError

WRITTEN_BITS: Final = 8
# modes: low five bits of the CPSR
USER: Final = 0x10
FAST: Final = 0x11
INTERRUPT: Final = 0x12
SUPERVISOR: Final = 0x13
ABORT: Final = 0x17
UNDEFINED: Final = 0x1B
SYSTEM: Final = 0x1F
# bits of Core.lines
IRQ_LINE: Final = 1
FIQ_LINE: Final = 2
NO_LINE: Final = -(1 << 30)  # of flash
STATE: Final = 53  # numbers of Core.state_into
POLL_CYCLES: Final = 60_000  # between two polls of a debugger's endpoint; chosen by us: 1 ms of the robot's processors

# C variables when compiled: Cython makes a Python object of every literal above 31 bits.
_MASK: cython.longlong = 4294967295
NOTHING = 0xFFFFFFFF  # what erased flash holds
ENDLESS = 0xEAFFFFFE  # b to itself: what start-up files have in place of a handler
_SIGN: cython.longlong = 2147483648
_NEVER: cython.longlong = 1 << 60
_STATUS: cython.longlong = 4026532095

MODES = (USER, FAST, INTERRUPT, SUPERVISOR, ABORT, UNDEFINED, SYSTEM)
# A store to a port behind the bridge, at the processor's own clock, takes 7 clocks instead of 2: by the data sheet of
# the LPC2194/01 its fast ports, which are next to memory, toggle pins up to 3.5 times as fast as the old ones.
DEVICE_WAITS = 5
BRIDGE_BASE = 0xE0000000  # where the peripheral bus begins (user manual, chapter 2)
MAM_TIMING = 4  # clocks of a flash access at 60 MHz: what all of the robot's boards write to MAMTIM


class ProcessorError(FirmwareError):
    """The program did something that the processor does not define."""


class BusFault(ProcessorError):  # noqa: N818  (what processors call it)
    """The program accessed an unmapped address; `address` and `pc` give the place, both as numbers."""

    def __init__(self, text, address, pc) -> None:
        UserError.__init__(self, text)
        self.address = address
        self.pc = pc


def memory(what, size):
    """`size` bytes of zeros as an array of words; UserError unless that is a whole number of words, 4 or more."""
    if not isinstance(size, int) or size < 4 or size % 4:
        raise FirmwareError(f"{what} of {size!r} bytes: must be a whole number of words of 4 bytes, at least one")
    return array.array("q", [0]) * (size // 4)


def put(words, place, content) -> None:
    """Bytes into an array of words, from byte `place` on."""
    for i, byte in enumerate(content, place):
        turn = 8 * (i & 3)
        words[i >> 2] = words[i >> 2] & ~(0xFF << turn) | byte << turn


def passing_flags(condition) -> int:
    """Which of the 16 values of the flags N, Z, C, V (bits 3 ... 0) pass a condition: the bits of a number."""
    passing = 0
    for flags in range(16):
        n, z, c, v = (bool(flags >> bit & 1) for bit in (3, 2, 1, 0))
        even = (z, c, n, v, c and not z, n == v, n == v and not z, True)[condition >> 1]
        passing |= (even != bool(condition & 1)) << flags  # 15 is "never" before ARMv5
    return passing


@cython.cclass
class Device:
    """The part of the address space beyond flash and RAM. Compiled, its calls are calls of C."""

    @cython.ccall
    def read(self, address: cython.longlong, size: cython.longlong) -> cython.longlong:
        """A load of `size` bytes, 1, 2 or 4."""
        raise LookupError(address)

    @cython.ccall
    def write(self, address: cython.longlong, size: cython.longlong, value: cython.longlong) -> cython.int:
        """A store."""
        raise LookupError(address)

    @cython.ccall
    @cython.exceptval(check=True)
    def answers(self, address: cython.longlong) -> cython.bint:
        """Whether an address below the bridge is a device's; an access to another one is aborted."""
        return True


@cython.final
@cython.cclass
class Core:
    """One processor with flash, RAM and a hook for everything else.

    `device`: an object with read(address, size) -> value and write(address, size, value), size in bytes 1, 2 or 4; both
    raise LookupError at an unmapped address. A `Device` is called faster, and ends the run itself at an unmapped
    address. `written`: by part of RAM of 256 bytes, whether it was written since it was last set to 0. `lines` holds
    the two interrupt inputs (IRQ_LINE, FIQ_LINE), levels set by devices. `r` holds the registers of the present mode,
    `pc` the address of the next instruction (`r[15]` is only valid inside an instruction). `cycles` and `instructions`
    count from the start; `began` is the value of `cycles` at the begin of the present instruction: devices take that as
    the time of its accesses. The class has many fields because a processor has much state, and because one object keeps
    what an instruction touches together in memory.
    """

    # Counters lie apart: gcc 12 joins stores to neighbours into one of 16 bytes, and the next load waits for it.
    cycles: cython.longlong
    following: cython.longlong
    began: cython.longlong
    pc: cython.longlong
    instructions: cython.longlong
    n: cython.longlong
    z: cython.longlong
    c: cython.longlong
    v: cython.longlong
    carry: cython.longlong
    control: cython.longlong
    lines: cython.longlong
    faulted: cython.longlong
    stopped: cython.longlong
    flash_base: cython.longlong
    flash_size: cython.longlong
    ram_base: cython.longlong
    ram_size: cython.longlong
    line: cython.longlong
    data_line: cython.longlong
    mam_mode: cython.longlong
    mam_timing: cython.longlong
    device_waits: cython.longlong
    bridge_base: cython.longlong
    cycles_per_instruction: cython.longlong
    passing_flags: cython.longlong[::1]
    trail: cython.longlong[::1]
    ahead: cython.longlong[::1]
    ready: cython.longlong[::1]
    ram_open: cython.longlong
    flash_open: cython.longlong
    takes_aborts: cython.bint
    needs_handlers: cython.bint
    place_of: object
    armed: cython.bint
    debugger: object
    hit: object
    points: set
    watches: tuple
    stepping: cython.longlong
    passing: cython.longlong
    return_pc: cython.longlong
    return_mode: cython.longlong
    next_poll: cython.longlong
    fault_address: cython.longlong
    r: cython.longlong[::1]
    high: cython.longlong[::1]
    banked: cython.longlong[::1]
    saved: cython.longlong[::1]
    flash: cython.longlong[::1]
    decoded: cython.longlong[::1]
    ram: cython.longlong[::1]
    device: object
    bridge: Device
    written: cython.longlong[::1]
    name: str

    def __init__(
        self, flash_size=0x40000, ram_size=0x4000, flash_base=0, ram_base=0x40000000, device=None, name="ARM7TDMI"
    ) -> None:
        self.name = name
        self.flash = memory(f"{name}: flash", flash_size)
        self.ram = memory(f"{name}: RAM", ram_size)
        self.decoded = array.array("q", [0]) * (flash_size >> 1)  # what the instruction at each half-word of flash does
        self.flash_base = flash_base
        self.flash_size = flash_size
        self.ram_base = ram_base
        self.ram_size = ram_size
        self.written = array.array("q", [1]) * ((ram_size >> WRITTEN_BITS) + 1)
        self.connect(device)
        self.passing_flags = array.array("q", map(passing_flags, range(16)))
        self.device_waits = DEVICE_WAITS
        self.bridge_base = BRIDGE_BASE
        self.mam_mode = 2
        self.mam_timing = MAM_TIMING
        self.trail = array.array(
            "q", [NO_LINE, NO_LINE]
        )  # of the even and of the odd bank: line in the branch trail buffer,
        self.ahead = array.array("q", [NO_LINE, NO_LINE])  # line in the prefetch buffer,
        self.ready = array.array("q", [0, 0])  # and the cycle at which that one is there
        self.cycles_per_instruction = 0
        self.takes_aborts = False
        self.needs_handlers = False
        self.place_of: object = None
        self.fault_address = -1
        self.ram_open = ram_size  # as far as loads and stores need no second check: none of it while data are watched
        self.flash_open = flash_size
        self.debugger = None
        self.armed = False
        self.points = set()
        self.watches = ()
        self.hit = None
        self.stepping = 0
        self.passing = self.return_pc = self.return_mode = -1
        self.next_poll = 0
        self.r = array.array("q", [0]) * 16
        self.high = array.array("q", [0]) * 10  # r8 ... r12 of the other modes, then of FIQ
        self.banked = array.array("q", [0]) * 12  # r13, r14 of: user, FIQ, IRQ, supervisor, abort, undefined
        self.saved = array.array("q", [0]) * 6  # SPSR of the same; the first is never used
        self.cycles = 0
        self.began = 0
        self.instructions = 0
        self.lines = 0
        self.carry = 0
        self.reset()

    def reset(self) -> None:
        """As the reset input: supervisor mode, both interrupts off, ARM state, address 0. Memory and counts stay."""
        self.n = self.z = self.c = self.v = 0
        self.control = SUPERVISOR | 0xC0
        self.pc = self.following = 0
        self.faulted = 0
        self.stopped = 0
        self.forget_flash()

    def connect(self, device) -> None:
        """From now on loads and stores beyond flash and RAM go to `device`; None: to nothing."""
        self.device = device
        self.bridge = device if isinstance(device, Device) else None

    def stop(self) -> None:
        """`run` ends after the present instruction; a device calls this."""
        self.stopped = 1

    def set_mam(self, mode, timing) -> None:
        """Mode 0 ... 2 and clocks per access 1 ... 7 of the flash accelerator; its contents are discarded."""
        if mode not in (0, 1, 2) or not 1 <= timing <= 7:
            raise FirmwareError(f"{self.name}: MAM mode {mode} of {timing} clocks: modes are 0 ... 2, clocks 1 ... 7")
        self.mam_mode = mode
        self.mam_timing = timing
        self.forget_flash()

    def forget_flash(self) -> None:
        self.line = self.data_line = NO_LINE
        for bank in range(2):
            self.trail[bank] = self.ahead[bank] = NO_LINE

    # ---- memory from outside: no cycles, no devices

    def place(self, address, content) -> None:
        """Write bytes into flash or RAM, as a programmer does; UserError when they do not fit in one of them."""
        end = address + len(content)
        if self.flash_base <= address and end <= self.flash_base + self.flash_size:
            put(self.flash, address - self.flash_base, content)
            for i in range((address - self.flash_base) >> 2 << 1, (end - self.flash_base + 3) >> 2 << 1):
                self.decoded[i] = 0
            return
        if self.ram_base <= address and end <= self.ram_base + self.ram_size:
            put(self.ram, address - self.ram_base, content)
            for i in range(len(self.written)):
                self.written[i] = 1
            return
        raise FirmwareError(
            f"{self.name}: {len(content)} bytes at {address:#010x} fit neither flash ({self.flash_base:#010x}, "
            f"{self.flash_size} bytes) nor RAM ({self.ram_base:#010x}, {self.ram_size} bytes)"
        )

    def peek(self, address) -> int:
        """The word of flash or RAM that holds this address; UserError elsewhere."""
        if 0 <= address - self.flash_base < self.flash_size:
            return self.flash[(address - self.flash_base) >> 2]
        if 0 <= address - self.ram_base < self.ram_size:
            return self.ram[(address - self.ram_base) >> 2]
        raise FirmwareError(f"{self.name}: {address:#010x} is neither in flash nor in RAM")

    # ---- status registers and modes

    @cython.ccall
    @cython.exceptval(check=False)
    def cpsr(self) -> cython.longlong:
        """The current program status register."""
        return self.n << 31 | self.z << 30 | self.c << 29 | self.v << 28 | self.control

    def spsr(self) -> int:
        """The saved status register of the present mode; of user and system mode, which have none, the CPSR."""
        bank = self.bank(self.control & 0x1F)
        return self.saved[bank] if bank else self.cpsr()

    def set_spsr(self, value) -> None:
        """Write the saved status register; a mode that has none ignores it."""
        if self.bank(self.control & 0x1F):
            self.saved[self.bank(self.control & 0x1F)] = value & _STATUS

    @cython.ccall
    def set_cpsr(self, value: cython.longlong) -> cython.int:
        """Write the whole status register; registers change with the mode. ProcessorError for an invalid mode."""
        self.switch_mode(value & 0x1F)
        self.n = value >> 31 & 1
        self.z = value >> 30 & 1
        self.c = value >> 29 & 1
        self.v = value >> 28 & 1
        self.control = value & 0xFF
        return 0

    @cython.cfunc
    @cython.exceptval(check=False)
    def bank(self, mode: cython.longlong) -> cython.longlong:
        if mode == FAST:
            return 1
        if mode == INTERRUPT:
            return 2
        if mode == SUPERVISOR:
            return 3
        if mode == ABORT:
            return 4
        if mode == UNDEFINED:
            return 5
        return 0

    def bank_now(self) -> int:
        """Which of the six banks runs: 0 user and system, 1 FIQ, 2 IRQ, 3 supervisor, 4 abort, 5 undefined."""
        return self.bank(self.control & 0x1F)

    @cython.cfunc
    @cython.locals(old=cython.longlong, new=cython.longlong, i=cython.longlong)
    def switch_mode(self, mode: cython.longlong) -> cython.int:
        old = self.bank(self.control & 0x1F)
        new = self.bank(mode)
        if new == 0 and mode != USER and mode != SYSTEM:
            raise ProcessorError(f"{self.name}: mode {mode:#04x} set at pc {self.pc:#010x}: there is no such mode")
        if old != new:
            self.banked[2 * old] = self.r[13]
            self.banked[2 * old + 1] = self.r[14]
            self.r[13] = self.banked[2 * new]
            self.r[14] = self.banked[2 * new + 1]
            if old == 1 or new == 1:
                for i in range(5):
                    self.high[(5 if old == 1 else 0) + i] = self.r[8 + i]
                    self.r[8 + i] = self.high[(5 if new == 1 else 0) + i]
        self.control = self.control & 0xE0 | mode
        return 0

    @cython.cfunc
    @cython.locals(before=cython.longlong)
    def enter(self, mode: cython.longlong, vector: cython.longlong, back: cython.longlong) -> cython.int:
        """Take an exception: status and return address saved, ARM state, IRQ off (for FIQ also FIQ)."""
        before = self.cpsr()
        self.switch_mode(mode)
        self.saved[self.bank(mode)] = before
        self.r[14] = back & _MASK
        self.control = (self.control | (0xC0 if mode == FAST else 0x80)) & 0xDF
        self.following = vector
        self.cycles += 2
        return 0

    @cython.cfunc
    def undefined(self) -> cython.int:
        self.cycles += 1
        if self.needs_handlers and not self.has_handler(4):
            self.fail("undefined instruction", 4, self.pc)
        return self.enter(UNDEFINED, 4, self.following)

    def has_handler(self, vector) -> bool:
        """Whether the instruction at a vector leads to more than nothing, or than a branch to itself."""
        op = self.flash[vector >> 2]
        target = vector
        if op >> 24 == 0xEA:  # b
            offset = (op & 0xFFFFFF) - (0x1000000 if op & 0x800000 else 0)
            target = vector + 8 + 4 * offset & _MASK
        elif op & 0xFFFFF000 == 0xE59FF000:  # ldr pc, [pc, #offset]
            place = vector + 8 + (op & 0xFFF)
            target = self.flash[place >> 2] if place < self.flash_size else NOTHING
        if not self.is_memory(target):
            return False
        return self.peek(target & ~3) not in (0, NOTHING, ENDLESS) or bool(target & 3)

    def fail(self, what, vector, address) -> None:
        """End the program: the exception, the function in which it occurred, and that it has no handler."""
        name = self.place_of(address) if self.place_of is not None else ""
        where = f" in {name}" if name else ""
        raise BoardFailure(self.name, f"{what} at pc {self.pc:#010x}{where}, without a handler at {vector:#010x}")

    # ---- memory

    @cython.cfunc
    @cython.exceptval(check=False)
    @cython.locals(begun=cython.longlong, bank=cython.longlong)
    def fetch_line(self, line: cython.longlong, cycles: cython.longlong) -> cython.longlong:
        """`cycles` after the waits of a fetch from another line of flash than the last fetch."""
        if self.mam_mode == 0:
            return cycles + self.mam_timing - 1
        begun = cycles
        bank = line & 1
        if line == self.ahead[bank] and (self.mam_mode == 2 or line == self.line + 1):
            if self.ready[bank] > begun:
                cycles = self.ready[bank]
        elif self.mam_mode == 1 or line != self.trail[bank]:
            cycles += self.mam_timing - 1
            self.trail[bank] = line
        self.line = line
        line += 1
        bank ^= 1
        if line != self.ahead[bank] and line != self.trail[bank]:
            self.ahead[bank] = line
            self.ready[bank] = begun + self.mam_timing
        return cycles

    @cython.cfunc
    @cython.exceptval(check=False)
    def read_flash(self, line: cython.longlong, cycles: cython.longlong) -> cython.longlong:
        """`cycles` after the waits of a datum in flash."""
        if line != self.data_line:
            if self.ready[line & 1] > cycles:
                self.ready[line & 1] = cycles + 2 * self.mam_timing - 1
            cycles += self.mam_timing - 1
            if self.mam_mode == 2:
                self.data_line = line
        return cycles

    @cython.cfunc
    def nothing(self, address: cython.longlong, size: cython.longlong, writing: cython.bint) -> cython.int:
        self.fault_address = address
        if not self.takes_aborts:
            what = "write to" if writing else "read from"
            why = "flash" if 0 <= address - self.flash_base < self.flash_size else "an address where nothing is"
            raise BusFault(
                f"{self.name}: {what} {why}: {address:#010x}, {size} bytes, at pc {self.pc:#010x}", address, self.pc
            )
        self.faulted = 1
        return 0

    @cython.cfunc
    @cython.locals(place=cython.longlong, value=cython.longlong)
    def load(self, address: cython.longlong, size: cython.longlong) -> cython.longlong:
        """A datum at an address that is a multiple of its size."""
        self.cycles += 1
        place = address - self.ram_base
        if 0 <= place < self.ram_open:
            value = self.ram[place >> 2]
        else:
            place = address - self.flash_base
            if not 0 <= place < self.flash_open:
                return self.load_elsewhere(address, size)
            self.cycles = self.read_flash(place >> 4, self.cycles)
            value = self.flash[place >> 2]
        if size == 4:
            return value
        value >>= 8 * (address & 3)
        return value & 0xFF if size == 1 else value & 0xFFFF

    @cython.cfunc
    @cython.locals(value=cython.longlong)
    def load_elsewhere(self, address: cython.longlong, size: cython.longlong) -> cython.longlong:
        """A datum of a device, or of memory that is watched."""
        if self.watches:
            self.check_watchpoints(address, size, 1)
            if self.is_memory(address):
                self.open_memory()
                self.cycles -= 1
                value = self.load(address, size)
                self.close_memory()
                return value
        if self.device is not None:
            if address >= self.bridge_base:
                self.cycles += self.device_waits
            if self.bridge is not None:
                if address >= self.bridge_base or self.bridge.answers(address):
                    return self.bridge.read(address, size)
                return self.nothing(address, size, False)
            try:
                return self.device.read(address, size)
            except LookupError:
                pass
        self.nothing(address, size, False)
        return 0

    @cython.cfunc
    @cython.locals(place=cython.longlong, moved=cython.longlong, mask=cython.longlong)
    def store(self, address: cython.longlong, size: cython.longlong, value: cython.longlong) -> cython.int:
        self.cycles += 1
        if self.mam_mode == 1:
            self.line = NO_LINE  # the fetch after a store is an N cycle
        place = address - self.ram_base
        if 0 <= place < self.ram_open:
            self.written[place >> WRITTEN_BITS] = 1
            if size == 4:
                self.ram[place >> 2] = value
            else:
                moved = 8 * (address & 3)
                mask = (0xFF if size == 1 else 0xFFFF) << moved
                self.ram[place >> 2] = self.ram[place >> 2] & (_MASK ^ mask) | value << moved & mask
            return 0
        return self.store_elsewhere(address, size, value)

    @cython.cfunc
    def store_elsewhere(self, address: cython.longlong, size: cython.longlong, value: cython.longlong) -> cython.int:
        if self.watches:
            self.check_watchpoints(address, size, 2)
            if 0 <= address - self.ram_base < self.ram_size:
                self.open_memory()
                self.cycles -= 1
                self.store(address, size, value)
                self.close_memory()
                return 0
        if self.device is not None and not 0 <= address - self.flash_base < self.flash_size:
            if address >= self.bridge_base:
                self.cycles += self.device_waits
            value = value if size == 4 else value & (0xFF if size == 1 else 0xFFFF)
            if self.bridge is not None:
                if address >= self.bridge_base or self.bridge.answers(address):
                    return self.bridge.write(address, size, value)
                return self.nothing(address, size, True)
            try:
                self.device.write(address, size, value)
                return 0
            except LookupError:
                pass
        return self.nothing(address, size, True)

    @cython.cfunc
    @cython.locals(value=cython.longlong, turn=cython.longlong)
    def load_word(self, address: cython.longlong) -> cython.longlong:
        value = self.load(address & -4, 4)
        turn = 8 * (address & 3)
        return (value >> turn | value << (32 - turn)) & _MASK if turn else value

    @cython.cfunc
    @cython.locals(value=cython.longlong)
    def load_half(self, address: cython.longlong, signed: cython.bint) -> cython.longlong:
        if address & 1 and signed:
            return self.load_byte(address, True)
        value = self.load(address & -2, 2)
        if address & 1:
            return (value >> 8 | value << 24) & _MASK
        return value | (_MASK ^ 0xFFFF) if signed and value & 0x8000 else value

    @cython.cfunc
    @cython.locals(value=cython.longlong)
    def load_byte(self, address: cython.longlong, signed: cython.bint) -> cython.longlong:
        value = self.load(address, 1)
        return value | (_MASK ^ 0xFF) if signed and value & 0x80 else value

    # ---- arithmetic

    @cython.cfunc
    @cython.exceptval(check=False)
    def jump(self, address: cython.longlong) -> cython.int:
        """Branch to an address, in the present state: the pipeline fills anew."""
        self.following = address & (_MASK - 1 if self.control & 0x20 else _MASK - 3)
        self.cycles += 2
        if self.mam_mode == 1:
            self.line = NO_LINE
        return 0

    @cython.cfunc
    @cython.exceptval(check=False)
    @cython.locals(total=cython.longlong, result=cython.longlong)
    def add(self, a: cython.longlong, b: cython.longlong, carry: cython.longlong) -> cython.longlong:
        """a + b + carry with all four flags; a - b is a + not b + 1."""
        total = a + b + carry
        result = total & _MASK
        self.n = result >> 31
        self.z = 1 if result == 0 else 0
        self.c = total >> 32
        self.v = ((a ^ result) & (b ^ result)) >> 31
        return result

    @cython.cfunc
    @cython.exceptval(check=False)
    def mark(self, result: cython.longlong) -> cython.int:
        self.n = result >> 31
        self.z = 1 if result == 0 else 0
        return 0

    @cython.cfunc
    @cython.exceptval(check=False)
    def shift(self, kind: cython.longlong, value: cython.longlong, amount: cython.longlong) -> cython.longlong:
        """By the low byte of a register; the bit shifted out last goes to `carry`."""
        self.carry = self.c
        if amount == 0:
            return value
        if kind == 0:
            if amount > 32:
                self.carry = 0
                return 0
            self.carry = value >> (32 - amount) & 1
            return value << amount & _MASK if amount < 32 else 0
        elif kind == 1:
            if amount > 32:
                self.carry = 0
                return 0
            self.carry = value >> (amount - 1) & 1
            return value >> amount
        elif kind == 2:
            if amount > 31:
                self.carry = value >> 31
                return _MASK if self.carry else 0
            self.carry = value >> (amount - 1) & 1
            return (value >> amount | (_MASK << (32 - amount) & _MASK if value >> 31 else 0)) & _MASK
        amount &= 31
        if amount:
            value = (value >> amount | value << (32 - amount)) & _MASK
        self.carry = value >> 31
        return value

    @cython.cfunc
    @cython.exceptval(check=False)
    def shift_fixed(self, kind: cython.longlong, value: cython.longlong, amount: cython.longlong) -> cython.longlong:
        """By an amount in the instruction, where 0 means 32, or for ROR one place through the carry."""
        if amount == 0 and kind:
            if kind == 3:
                self.carry = value & 1
                return value >> 1 | self.c << 31
            amount = 32
        return self.shift(kind, value, amount)

    @cython.cfunc
    @cython.exceptval(check=False)
    def multiplier_cycles(self, value: cython.longlong, signed: cython.bint) -> cython.int:
        """The multiplier takes 8 bits at a time and ends when the rest is all zeros, or (signed) all ones."""
        if signed and value & _SIGN:
            value ^= _MASK
        self.cycles += 1 if value < 0x100 else 2 if value < 0x10000 else 3 if value < 0x1000000 else 4
        return 0

    # ---- running

    @cython.ccall
    def run(self, until: cython.longlong) -> cython.int:
        """Execute until `cycles` has reached `until` (the last instruction is completed) or `stop` was called."""
        self.stopped = 0
        if self.debugger is not None:
            return self.run_debugged(until)
        while self.cycles < until and not self.stopped:
            if self.lines and self.interrupt():
                continue  # the entry's cycles may have reached `until`
            self.execute(until)
        return 0

    @cython.ccall
    @cython.locals(count=cython.longlong)
    def step(self) -> cython.int:
        """One instruction; an interrupt that waits is taken first."""
        if self.armed:
            count = self.instructions
            while self.instructions == count:
                self.debugged()
            return 0
        if self.lines:
            self.interrupt()
        return self.one()

    # ---- with a debugger

    @cython.cfunc
    def run_debugged(self, until: cython.longlong) -> cython.int:
        """As `run`."""
        try:
            while self.cycles < until and not self.stopped:
                if self.cycles >= self.next_poll:
                    self.next_poll = self.cycles + POLL_CYCLES
                    self.debugger.poll()
                if self.armed:
                    self.debugged()
                    continue
                if self.lines and self.interrupt():
                    continue
                self.one()
        except UserError as error:
            self.halt(error)
            raise
        return 0

    @cython.cfunc
    @cython.locals(pc=cython.longlong, mode=cython.longlong)
    def debugged(self) -> cython.int:
        """An instruction, an interrupt's entry, or a halt.

        A step passes over interrupts that occur during it: it ends when one of the program's own instructions is done.
        """
        if self.return_pc == self.pc and self.return_mode == self.control & 0x1F:
            self.return_pc = -1
        if self.return_pc < 0 and self.stepping == 2 or self.pc != self.passing and self.pc in self.points:
            self.halt(None)
            return 0
        pc = self.pc
        mode = self.control & 0x1F
        if self.lines and self.interrupt():
            if self.stepping and self.return_pc < 0:
                self.return_pc = pc
                self.return_mode = mode
            return 0
        if pc == self.passing:
            self.passing = -1
        if self.stepping and self.return_pc < 0:
            self.stepping = 2
        self.one()
        if self.hit is not None:
            self.halt(None)
        return 0

    def halt(self, error) -> None:
        """Give control to the debugger. `error`: the program's error, which ends the run after that."""
        self.stepping = 0
        self.return_pc = -1
        self.debugger.halted(error)
        self.hit = None
        self.rearm()

    @cython.cfunc
    @cython.exceptval(check=False)
    def is_memory(self, address: cython.longlong) -> cython.bint:
        return 0 <= address - self.ram_base < self.ram_size or 0 <= address - self.flash_base < self.flash_size

    @cython.cfunc
    @cython.exceptval(check=False)
    def open_memory(self) -> cython.int:
        self.ram_open = self.ram_size
        self.flash_open = self.flash_size
        return 0

    @cython.cfunc
    @cython.exceptval(check=False)
    def close_memory(self) -> cython.int:
        self.ram_open = self.flash_open = 0
        return 0

    @cython.cfunc
    def check_watchpoints(self, address: cython.longlong, size: cython.longlong, kind: cython.longlong) -> cython.int:
        """`hit` is the first watchpoint that this access meets: (address, its kinds)."""
        if self.hit is None:
            for start, end, kinds in self.watches:
                if address < end and start < address + size and kinds & kind:
                    self.hit = (max(start, address), kinds)
                    break
        return 0

    def set_points(self, points, watches) -> None:
        """Halt before instructions at these addresses, and after accesses to what is watched.

        watches: (first address, the one after the last, kinds), kinds 1 for loads, 2 for stores, 3 for both.
        """
        self.points = set(points)
        self.watches = tuple(watches)
        if self.watches:
            self.close_memory()
        else:
            self.open_memory()
        self.rearm()

    def go_on(self, step) -> None:
        """Go on after a halt: from here, over a point that may be here, or for one instruction."""
        self.passing = self.pc
        self.stepping = 1 if step else 0
        self.rearm()

    def rearm(self) -> None:
        self.armed = bool(self.points or self.watches or self.stepping)

    @cython.ccall
    def state_into(self, into: cython.longlong[::1]) -> cython.int:
        """Write all state that the next instruction can depend on, except memory, inputs and time, as STATE numbers;
        returns STATE.

        Flash accesses under way count from now: the same numbers at another cycle are the same state.
        """
        i: cython.longlong
        place: cython.longlong
        for i in range(15):
            into[i] = self.r[i]
        for i in range(10):
            into[15 + i] = self.high[i]
        for i in range(12):
            into[25 + i] = self.banked[i]
        for i in range(6):
            into[37 + i] = self.saved[i]
        into[43] = self.pc
        into[44] = self.cpsr()
        into[45] = self.line
        into[46] = self.data_line
        for place in range(2):
            into[47 + place] = self.trail[place]
            into[49 + place] = self.ahead[place]
            into[51 + place] = self.ready[place] - self.cycles if self.ready[place] > self.cycles else 0
        return STATE

    @cython.cfunc
    def interrupt(self) -> cython.int:
        """Enter the exception that a line asks for and the status allows; 1 when it did."""
        if self.lines & FIQ_LINE and not self.control & 0x40:
            self.enter(FAST, 0x1C, self.pc + 4)
        elif self.lines & IRQ_LINE and not self.control & 0x80:
            self.enter(INTERRUPT, 0x18, self.pc + 4)
        else:
            return 0
        self.cycles += 1
        self.pc = self.following
        return 1

    @cython.cfunc
    def one(self) -> cython.int:
        return self.execute(self.cycles + 1)  # each takes one at least

    @cython.cfunc
    @cython.locals(
        pc=cython.longlong,
        cycles=cython.longlong,
        began=cython.longlong,
        count=cython.longlong,
        place=cython.longlong,
        entry=cython.longlong,
        size=cython.longlong,
        usual=cython.longlong,
        condition=cython.longlong,
        amount=cython.longlong,
        kind=cython.longlong,
        rd=cython.longlong,
        word=cython.longlong,
        a=cython.longlong,
        b=cython.longlong,
    )
    def execute(self, until: cython.longlong) -> cython.int:
        """Instructions until `cycles` has reached `until`; ends earlier after one that stopped the run, and after one
        that may have changed whether an interrupt is to be entered.

        Program counter and cycles are local as long as no instruction needs more than registers, flags and memory:
        those that do are `execute_whole`. The function is long because all kinds are cases of one switch around these
        locals. Beyond the present line of flash nothing has been checked: not that there is memory, nor that the
        program counter has not passed the end of the address space.
        """
        pc = self.pc
        cycles = self.cycles
        began = self.began
        count = self.instructions
        size = 2 if self.control & 0x20 else 4
        usual = 28 | self.control >> 5 & 1  # condition and state of most entries
        while cycles < until:
            count += 1
            began = cycles
            cycles += 1
            place = pc - self.flash_base
            if place >> 4 == self.line:
                entry = self.decoded[place >> 1]
            else:
                pc &= _MASK
                place = pc - self.flash_base
                if 0 <= place < self.flash_size:
                    cycles = self.fetch_line(place >> 4, cycles)
                    entry = self.decoded[place >> 1]
                else:
                    place = pc - self.ram_base
                    self.line = NO_LINE
                    if not 0 <= place < self.ram_size:
                        self.pc = pc
                        self.cycles = cycles
                        self.began = began
                        self.instructions = count
                        return self.abort_fetch()
                    entry = self.decode(self.ram[place >> 2], pc)
            condition = entry >> IN_THUMB & 31
            if condition != usual:
                if entry == 0 or (condition ^ usual) & 1:
                    entry = self.decoded[place >> 1] = self.decode(self.flash[place >> 2], pc)
                condition = entry >> CONDITION & 15
                if not self.passing_flags[condition] >> (self.n << 3 | self.z << 2 | self.c << 1 | self.v) & 1:
                    pc += size
                    if self.cycles_per_instruction:
                        cycles = began + self.cycles_per_instruction
                    continue
            pc += size
            kind = entry >> KIND
            word = entry & _MASK
            rd = entry >> DESTINATION & 15
            a = self.r[entry >> FIRST & 15]
            b = self.r[entry >> SECOND & 15]
            if kind >= LOAD_CONSTANT:
                amount = entry >> AMOUNT & 31
                if kind >= SHIFTED:
                    kind -= SHIFTED - MOVE
                    if entry >> (AMOUNT + 5) & 3 == 0:
                        b = b << amount & _MASK
                    elif entry >> (AMOUNT + 5) & 3 == 1:
                        b >>= amount
                    else:
                        b = (b ^ _SIGN) - _SIGN >> amount & _MASK
                elif kind == LOAD_CONSTANT:
                    place = word - self.flash_base
                    if not 0 <= place < self.flash_open:
                        kind = INDEXED + LOAD  # by way of `execute_whole`
                else:
                    if kind >= INDEXED:
                        kind -= INDEXED - LOAD
                        word = b << amount
                    word = a + word & _MASK
                    place = word - self.ram_base
                    if not 0 <= place < self.ram_open or word & (3 if kind <= STORE else 1) and kind <= STORE_HALF:
                        kind += INDEXED
            if kind == BRANCH:
                pc = word
                cycles += 2
                if self.mam_mode == 1:
                    self.line = NO_LINE
            elif kind == BRANCH_LINK:
                self.r[14] = pc & _MASK
                pc = word
                cycles += 2
                if self.mam_mode == 1:
                    self.line = NO_LINE
            elif kind == BRANCH_LINK_LOW:
                word = self.r[14] + word & _MASK - 1
                self.r[14] = pc & _MASK | 1
                pc = word
                cycles += 2
                if self.mam_mode == 1:
                    self.line = NO_LINE
            elif kind == BRANCH_EXCHANGE:
                self.control = self.control & 0xDF | (b & 1) << 5
                size = 2 if b & 1 else 4
                usual = 28 | b & 1
                pc = b & -size
                cycles += 2
                if self.mam_mode == 1:
                    self.line = NO_LINE
            elif kind == MOVE_CONSTANT:
                self.r[rd] = word
            elif kind == ADD_CONSTANT:
                self.r[rd] = a + word & _MASK
            elif kind == REVERSE_CONSTANT:
                self.r[rd] = word - a & _MASK
            elif kind == AND_CONSTANT:
                self.r[rd] = a & word
            elif kind == OR_CONSTANT:
                self.r[rd] = a | word
            elif kind == XOR_CONSTANT:
                self.r[rd] = a ^ word
            elif kind == COMPARE_CONSTANT:
                self.add(a, word, 1)
            elif kind == ADDS_CONSTANT:
                self.r[rd] = self.add(a, word, 0)
            elif kind == SUBS_CONSTANT:
                self.r[rd] = self.add(a, word, 1)
            elif kind == MOVES_CONSTANT:
                self.r[rd] = word
                self.mark(word)
            elif kind == TEST_CONSTANT:
                self.mark(a & word)
            elif kind == TEST_TURNED:
                self.mark(a & word)
                self.c = word >> 31
            elif kind == MOVE:
                self.r[rd] = b
            elif kind == ADD:
                self.r[rd] = a + b & _MASK
            elif kind == SUBTRACT:
                self.r[rd] = a - b & _MASK
            elif kind == REVERSE:
                self.r[rd] = b - a & _MASK
            elif kind == AND:
                self.r[rd] = a & b
            elif kind == OR:
                self.r[rd] = a | b
            elif kind == XOR:
                self.r[rd] = a ^ b
            elif kind == CLEAR:
                self.r[rd] = a & (_MASK ^ b)
            elif kind == COMPARE:
                self.add(a, _MASK ^ b, 1)
            elif kind == ADDS:
                self.r[rd] = self.add(a, b, 0)
            elif kind == SUBS:
                self.r[rd] = self.add(a, _MASK ^ b, 1)
            elif kind == MOVES:
                self.r[rd] = b
                self.mark(b)
            elif kind == ANDS:
                self.r[rd] = a & b
                self.mark(a & b)
            elif kind == ORS:
                self.r[rd] = a | b
                self.mark(a | b)
            elif kind == XORS:
                self.r[rd] = a ^ b
                self.mark(a ^ b)
            elif kind == TEST:
                self.mark(a & b)
            elif kind == TEST_EQUAL:
                self.mark(a ^ b)
            elif kind == SHIFT_LEFT:
                self.r[rd] = b << (entry >> AMOUNT & 31) & _MASK
            elif kind == SHIFT_RIGHT:
                self.r[rd] = b >> (entry >> AMOUNT & 31)
            elif kind == SHIFT_SIGNED:
                self.r[rd] = (b ^ _SIGN) - _SIGN >> (entry >> AMOUNT & 31) & _MASK
            elif kind == SHIFTS:
                b = self.shift_fixed(entry >> (AMOUNT + 5) & 3, b, entry >> AMOUNT & 31)
                self.r[rd] = b
                self.mark(b)
                self.c = self.carry
            elif kind == DATA:
                self.r[15] = pc + size & _MASK
                self.data(word)
            elif kind == LOAD_CONSTANT:
                cycles = self.read_flash(place >> 4, cycles + 1) + 1
                self.r[rd] = self.flash[place >> 2]
            elif kind == LOAD:
                self.r[rd] = self.ram[place >> 2]
                cycles += 2
            elif kind == LOAD_HALF:
                self.r[rd] = self.ram[place >> 2] >> 8 * (word & 2) & 0xFFFF
                cycles += 2
            elif kind == LOAD_BYTE:
                self.r[rd] = self.ram[place >> 2] >> 8 * (word & 3) & 0xFF
                cycles += 2
            elif kind == STORE:
                self.written[place >> WRITTEN_BITS] = 1
                self.ram[place >> 2] = self.r[rd]
                cycles += 1
                if self.mam_mode == 1:
                    self.line = NO_LINE
            elif kind == STORE_HALF or kind == STORE_BYTE:
                self.store(word, 2 if kind == STORE_HALF else 1, self.r[rd])
                cycles += 1
            else:
                self.pc = pc - size
                self.following = pc & _MASK
                self.r[15] = pc + size & _MASK
                self.cycles = cycles
                self.began = began
                self.instructions = count
                self.execute_whole(kind, rd, word)
                if self.cycles_per_instruction:
                    self.cycles = began + self.cycles_per_instruction
                if self.faulted:
                    self.abort_data()
                pc = self.pc = self.following
                cycles = self.cycles
                if self.stopped or self.lines:
                    return 0
                size = 2 if self.control & 0x20 else 4
                usual = 28 | self.control >> 5 & 1
                continue
            if self.cycles_per_instruction:
                cycles = began + self.cycles_per_instruction
        self.pc = pc & _MASK
        self.cycles = cycles
        self.began = began
        self.instructions = count
        return 0

    @cython.cfunc
    def execute_whole(self, kind: cython.longlong, rd: cython.longlong, word: cython.longlong) -> cython.int:
        """An instruction that may end in an exception, another state or mode, or with a device; INDEXED in `kind`:
        loads and stores at the address `word`."""
        if kind == WHOLE:
            return self.arm(word)
        elif kind == INDEXED + LOAD:
            return self.finish_load(rd, self.load_word(word))
        elif kind == INDEXED + STORE:
            return self.store(word & -4, 4, self.r[rd])
        elif kind == INDEXED + LOAD_HALF:
            return self.finish_load(rd, self.load_half(word, False))
        elif kind == INDEXED + STORE_HALF:
            return self.store(word & -2, 2, self.r[rd])
        elif kind == INDEXED + LOAD_BYTE:
            return self.finish_load(rd, self.load(word, 1))
        return self.store(word, 1, self.r[rd])

    @cython.cfunc
    def abort_fetch(self) -> cython.int:
        """No memory at the program counter: the instruction is not executed."""
        self.nothing(self.pc, 2 if self.control & 0x20 else 4, False)
        self.faulted = 0
        if self.needs_handlers and not self.has_handler(0x0C):
            self.fail("prefetch abort: no memory", 0x0C, self.r[14])
        self.enter(ABORT, 0x0C, self.pc + 4)
        self.pc = self.following
        return 0

    @cython.cfunc
    def abort_data(self) -> cython.int:
        """A load or store met no memory."""
        self.faulted = 0
        self.cycles += 1
        if self.needs_handlers and not self.has_handler(0x10):
            self.fail(f"data abort: no memory for an access to {self.fault_address:#010x}", 0x10, self.pc)
        return self.enter(ABORT, 0x10, self.pc + 8)

    @cython.cfunc
    @cython.exceptval(check=False)
    def decode(self, word: cython.longlong, pc: cython.longlong) -> cython.longlong:
        """The instruction at `pc` in the present state, in the memory's word `word`."""
        if self.control & 0x20:
            return decode_thumb(word >> 16 if pc & 2 else word & 0xFFFF, pc)
        return decode_arm(word, pc)

    # ---- ARM state

    @cython.cfunc
    @cython.locals(group=cython.longlong)
    def arm(self, op: cython.longlong) -> cython.int:
        group = op >> 25 & 7
        if group == 0:
            if op & 0x90 == 0x90:
                if op & 0x60:
                    return self.transfer(op)
                if op & 0x01000000:
                    return self.swap(op)
                return self.multiply(op)
            if op & 0x01900000 == 0x01000000:
                return self.status(op)
            return self.data(op)
        elif group == 1:
            return self.status(op) if op & 0x01900000 == 0x01000000 else self.data(op)
        elif group == 2:
            return self.transfer(op)
        elif group == 3:
            return self.undefined() if op & 0x10 else self.transfer(op)
        elif group == 4:
            return self.block(op)
        elif group == 7:
            if op & 0x01000000:
                return self.enter(SUPERVISOR, 8, self.following)
        return self.undefined()  # no coprocessor answers

    @cython.cfunc
    @cython.locals(
        a=cython.longlong,
        b=cython.longlong,
        result=cython.longlong,
        rd=cython.longlong,
        code=cython.longlong,
        turn=cython.longlong,
        writes=cython.bint,
    )
    def data(self, op: cython.longlong) -> cython.int:
        if op & 0x02000000:
            b = op & 0xFF
            turn = op >> 7 & 30
            self.carry = self.c
            if turn:
                b = (b >> turn | b << (32 - turn)) & _MASK
                self.carry = b >> 31
        elif op & 0x10:
            self.cycles += 1
            self.r[15] = self.r[15] + 4 & _MASK
            b = self.shift(op >> 5 & 3, self.r[op & 15], self.r[op >> 8 & 15] & 0xFF)
        else:
            b = self.shift_fixed(op >> 5 & 3, self.r[op & 15], op >> 7 & 31)
        a = self.r[op >> 16 & 15]
        rd = op >> 12 & 15
        code = op >> 21 & 15
        writes = code < 8 or code > 11
        if not op & 0x00100000:
            # no flags: what they would be is not computed
            if code == 0:
                result = a & b
            elif code == 1:
                result = a ^ b
            elif code == 2:
                result = a - b
            elif code == 3:
                result = b - a
            elif code == 4:
                result = a + b
            elif code == 5:
                result = a + b + self.c
            elif code == 6:
                result = a - b - 1 + self.c
            elif code == 7:
                result = b - a - 1 + self.c
            elif code == 12:
                result = a | b
            elif code == 13:
                result = b
            elif code == 14:
                result = a & (_MASK ^ b)
            else:
                result = _MASK ^ b
            result &= _MASK
            if rd == 15:
                return self.jump(result)
            self.r[rd] = result
            return 0
        if rd == 15 and writes:
            # the form that returns from an exception: flags come from the saved status
            self.carry = self.c
        if code == 2 or code == 10:
            result = self.add(a, _MASK ^ b, 1)
        elif code == 3:
            result = self.add(b, _MASK ^ a, 1)
        elif code == 4 or code == 11:
            result = self.add(a, b, 0)
        elif code == 5:
            result = self.add(a, b, self.c)
        elif code == 6:
            result = self.add(a, _MASK ^ b, self.c)
        elif code == 7:
            result = self.add(b, _MASK ^ a, self.c)
        else:
            if code == 0 or code == 8:
                result = a & b
            elif code == 1 or code == 9:
                result = a ^ b
            elif code == 12:
                result = a | b
            elif code == 13:
                result = b
            elif code == 14:
                result = a & (_MASK ^ b)
            else:
                result = _MASK ^ b
            self.mark(result)
            self.c = self.carry
        if writes:
            if rd == 15:
                if self.bank(self.control & 0x1F):
                    self.set_cpsr(self.saved[self.bank(self.control & 0x1F)])
                return self.jump(result)
            self.r[rd] = result
        return 0

    @cython.cfunc
    @cython.locals(value=cython.longlong, mask=cython.longlong, turn=cython.longlong)
    def status(self, op: cython.longlong) -> cython.int:
        """MRS, MSR, and BX to the program counter; what else has this form belongs to later architectures."""
        if op & 0x0FFFFFF0 == 0x012FFF10:
            self.control = self.control & 0xDF | (self.r[op & 15] & 1) << 5
            return self.jump(self.r[op & 15])
        if op & 0x0FBF0FFF == 0x010F0000:
            self.r[op >> 12 & 15] = self.spsr() if op & 0x400000 else self.cpsr()
            return 0
        if op & 0x0FB0F000 == 0x0320F000:
            turn = op >> 7 & 30
            value = op & 0xFF
            value = (value >> turn | value << (32 - turn)) & _MASK
        elif op & 0x0FB0FFF0 == 0x0120F000:
            value = self.r[op & 15]
        else:
            return self.undefined()
        mask = 0xFF if op & 0x10000 else 0
        if op & 0x80000:
            mask |= _MASK ^ 0xFFFFFF
        if op & 0x400000:
            if self.bank(self.control & 0x1F):
                self.set_spsr(self.spsr() & (_MASK ^ mask) | value & mask)
            return 0
        if self.control & 0x1F == USER:
            mask &= _MASK ^ 0xFF
        mask &= _MASK ^ 0x20  # the state changes by BX only
        return self.set_cpsr(self.cpsr() & (_MASK ^ mask) | value & mask)

    @cython.cfunc
    @cython.locals(
        a=cython.longlong,
        b=cython.longlong,
        low=cython.longlong,
        top=cython.longlong,
        product=cython.longlong,
        rd=cython.longlong,
        rn=cython.longlong,
        kind=cython.longlong,
    )
    def multiply(self, op: cython.longlong) -> cython.int:
        kind = op >> 21 & 7
        rd = op >> 16 & 15
        rn = op >> 12 & 15
        a = self.r[op & 15]
        b = self.r[op >> 8 & 15]
        if kind < 2:
            self.multiplier_cycles(b, True)
            low = (a & 0xFFFF) * b + (((a >> 16) * (b & 0xFFFF)) << 16)
            if kind == 1:
                self.cycles += 1
                low += self.r[rn]
            low &= _MASK
            self.r[rd] = low
            if op & 0x100000:
                self.mark(low)
            return 0
        if kind < 4:
            return self.undefined()
        # the signed product; the unsigned one has more in its upper word for each factor with bit 31
        self.cycles += 1
        product = (a - (a >> 31 << 32)) * (b - (b >> 31 << 32))
        low = product & _MASK
        top = product >> 32 & _MASK
        if kind < 6:
            self.multiplier_cycles(b, False)
            top += (b if a >> 31 else 0) + (a if b >> 31 else 0)
        else:
            self.multiplier_cycles(b, True)
        if kind & 1:
            self.cycles += 1
            low += self.r[rn]
            top += self.r[rd] + (low >> 32)
            low &= _MASK
        top &= _MASK
        self.r[rn] = low
        self.r[rd] = top
        if op & 0x100000:
            self.n = top >> 31
            self.z = 1 if top == 0 and low == 0 else 0
        return 0

    @cython.cfunc
    @cython.locals(address=cython.longlong, value=cython.longlong)
    def swap(self, op: cython.longlong) -> cython.int:
        if op & 0x0FB00FF0 != 0x01000090:
            return self.undefined()
        address = self.r[op >> 16 & 15]
        self.cycles += 1
        if op & 0x400000:
            value = self.load(address, 1)
            if not self.faulted:
                self.store(address, 1, self.r[op & 15])
        else:
            value = self.load_word(address)
            if not self.faulted:
                self.store(address & -4, 4, self.r[op & 15])
        if not self.faulted:
            self.r[op >> 12 & 15] = value
        return 0

    @cython.cfunc
    @cython.locals(
        base=cython.longlong,
        offset=cython.longlong,
        address=cython.longlong,
        moved=cython.longlong,
        value=cython.longlong,
        rd=cython.longlong,
        rn=cython.longlong,
        kind=cython.longlong,
    )
    def transfer(self, op: cython.longlong) -> cython.int:
        """Load or store of one register: words and bytes, and in group 0 half-words and signed ones."""
        kind = 0  # 1 ... 3: half-word, signed byte, signed half-word
        rn = op >> 16 & 15
        rd = op >> 12 & 15
        if op >> 25 & 7 == 0:
            kind = op >> 5 & 3
            if kind > 1 and not op & 0x100000:
                return self.undefined()
            offset = op >> 4 & 0xF0 | op & 15 if op & 0x400000 else self.r[op & 15]
        elif op & 0x02000000:
            offset = self.shift_fixed(op >> 5 & 3, self.r[op & 15], op >> 7 & 31)
        else:
            offset = op & 0xFFF
        base = self.r[rn]
        moved = (base + offset if op & 0x800000 else base - offset) & _MASK
        address = moved if op & 0x01000000 else base
        if not op & 0x100000:
            value = self.r[rd] if rd != 15 else self.r[15] + 4 & _MASK
            if kind == 1:
                self.store(address & -2, 2, value)
            elif op & 0x400000 and kind == 0:
                self.store(address, 1, value)
            else:
                self.store(address & -4, 4, value)
            if op & 0x200000 or not op & 0x01000000:
                self.r[rn] = moved
            return 0
        if kind:
            value = self.load_byte(address, True) if kind == 2 else self.load_half(address, kind == 3)
        elif op & 0x400000:
            value = self.load(address, 1)
        else:
            value = self.load_word(address)
        if op & 0x200000 or not op & 0x01000000:
            self.r[rn] = moved
        return self.finish_load(rd, value)

    @cython.cfunc
    def finish_load(self, rd: cython.longlong, value: cython.longlong) -> cython.int:
        self.cycles += 1
        if not self.faulted:
            if rd == 15:
                return self.jump(value)
            self.r[rd] = value
        return 0

    @cython.cfunc
    @cython.exceptval(check=False)
    def get_user(self, i: cython.longlong) -> cython.longlong:
        """A register of user mode, seen from any mode."""
        if self.bank(self.control & 0x1F) and i < 15:
            if i > 12:
                return self.banked[i - 13]
            if i > 7 and self.control & 0x1F == FAST:
                return self.high[i - 8]
        return self.r[i]

    @cython.cfunc
    @cython.exceptval(check=False)
    def set_user(self, i: cython.longlong, value: cython.longlong) -> cython.int:
        if self.bank(self.control & 0x1F) and i > 12:
            self.banked[i - 13] = value
        elif i > 7 and self.control & 0x1F == FAST:
            self.high[i - 8] = value
        else:
            self.r[i] = value
        return 0

    @cython.cfunc
    @cython.locals(
        base=cython.longlong,
        address=cython.longlong,
        last=cython.longlong,
        value=cython.longlong,
        rn=cython.longlong,
        i=cython.longlong,
        count=cython.longlong,
        chosen=cython.longlong,
        rest=cython.longlong,
        place=cython.longlong,
        inside=cython.bint,
        first=cython.bint,
        user=cython.bint,
    )
    def block(self, op: cython.longlong) -> cython.int:
        """LDM and STM, with the forms that reach user registers or return from an exception."""
        rn = op >> 16 & 15
        chosen = op & 0xFFFF
        count = 0
        rest = chosen
        while rest:
            rest &= rest - 1
            count += 1
        if chosen == 0:
            chosen = 0x8000
            count = 16
        base = self.r[rn]
        if op & 0x800000:
            last = base + 4 * count & _MASK
            address = base + 4 if op & 0x01000000 else base
        else:
            last = base - 4 * count & _MASK
            address = last if op & 0x01000000 else last + 4
        user = op & 0x400000 != 0 and not (op & 0x100000 and chosen & 0x8000)
        address = address & _MASK & -4
        place = address - self.ram_base
        # all of a list in RAM: nothing is left to do but to move words
        inside = op & 0xFFFF != 0 and 0 <= place and place + 4 * count <= self.ram_open
        if not op & 0x100000:
            first = True
            for i in range(16):
                if chosen >> i & 1:
                    value = self.get_user(i) if user else self.r[i]
                    if i == 15:  # one fetch further on
                        value = value + (2 if self.control & 0x20 else 4) & _MASK
                    if inside:
                        self.written[place >> WRITTEN_BITS] = 1
                        self.ram[place >> 2] = value
                        place += 4
                    else:
                        self.store(address & _MASK, 4, value)
                        address += 4
                    # the base changes after the first transfer: lowest in the list it is stored as it was
                    if first and op & 0x200000:
                        self.r[rn] = last
                    first = False
            if inside:
                self.cycles += count
                if self.mam_mode == 1:
                    self.line = NO_LINE
            return 0
        self.cycles += count + 1 if inside else 1
        if op & 0x200000:
            self.r[rn] = last
        else:
            last = base
        for i in range(16):
            if chosen >> i & 1:
                if inside:
                    value = self.ram[place >> 2]
                    place += 4
                else:
                    value = self.load(address & _MASK, 4)
                    address += 4
                    if self.faulted:
                        self.r[rn] = last
                        return 0
                if user:
                    self.set_user(i, value)
                elif i == 15:
                    if op & 0x400000 and self.bank(self.control & 0x1F):
                        self.set_cpsr(self.saved[self.bank(self.control & 0x1F)])
                    self.jump(value)
                else:
                    self.r[i] = value
        return 0
