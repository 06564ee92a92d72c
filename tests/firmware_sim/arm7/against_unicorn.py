"""Random ARM and Thumb instructions in our core and in Unicorn: registers, status and memory must stay the same.

    python -m tests.firmware_sim.arm7.against_unicorn 1000000

Left out, with the reason: loads of the program counter with bit 0 or 1 set, and unaligned words and half-words, where
Unicorn does what later architectures do; what the architecture calls UNPREDICTABLE (the program counter in multiplies,
base = destination with write-back, rd = rm of MUL, user registers in a mode that has no others); exceptions, which
Unicorn hands to its caller instead of entering them: only returns from them are compared. All of these have known
answers by hand (test_exceptions.py).
"""

import array
import random  # noqa: TID251  (tests only: the generator is seeded)
import sys

from ranger_sim.firmware_sim.arm7.core import Core

LENGTH = 40  # instructions of a sequence
CODE, DATA, SIZE = 0x40000000, 0x40008000, 0x10000
BASES = (4, 5)  # hold addresses of data; r6 holds small offsets. Nothing else writes them.
SPSR_OF_MODE = 0x0361F0C0  # msr spsr_c, #0xC0 and a mode
MODES = (0x11, 0x12, 0x13, 0x17, 0x1B)  # system mode has no SPSR, which MRS and MSR of it want


class Generator:
    """Instructions by the classes of the architecture; each is as likely as the next class."""

    def __init__(self, seed):
        self.random = random.Random(seed)

    def register(self):
        """A destination: none of those that hold addresses."""
        return self.random.choice((0, 1, 2, 3, 7, 8, 9, 10, 11, 12, 13, 14))

    def operand(self):
        return self.random.randrange(15)

    def arm(self, room):
        r = self.random
        condition = r.choice((14, 14, r.randrange(15))) << 28
        kind = r.randrange(20)
        bits = r.getrandbits
        here = LENGTH - room
        if kind < 6:
            code = r.randrange(16)
            sets = 1 if 8 <= code < 12 else bits(1)
            first = 0 if code in (13, 15) else self.operand()  # MOV and MVN have none
            op = code << 21 | sets << 20 | first << 16 | (0 if 8 <= code < 12 else self.register()) << 12
            form = r.randrange(3)
            if form == 0:
                op |= 1 << 25 | bits(12)
            elif form == 1:
                op |= bits(5) << 7 | bits(2) << 5 | r.randrange(16) % 15
            else:
                op |= self.operand() << 8 | bits(2) << 5 | 1 << 4 | self.operand()
            return condition | op
        if kind == 6:
            rd, rm = r.sample((0, 1, 2, 3, 7, 8, 9, 10, 11, 12, 13, 14), 2)
            adds = bits(1)
            op = adds << 21 | bits(1) << 20 | rd << 16 | (self.operand() << 12 if adds else 0)
            return condition | op | self.operand() << 8 | 0x90 | rm
        if kind == 7:
            high, low, rm = r.sample((0, 1, 2, 3, 7, 8, 9, 10, 11, 12, 13, 14), 3)
            return condition | 1 << 23 | bits(3) << 20 | high << 16 | low << 12 | self.operand() << 8 | 0x90 | rm
        if kind == 8:
            base = r.choice(BASES)
            form = r.randrange(3)
            size = 1 if form == 2 else bits(1)
            op = 1 << 26 | bits(1) << 23 | size << 22 | bits(1) << 20 | base << 16 | self.register() << 12
            op |= r.choice((0, 1 << 21, 1 << 24, 1 << 24 | 1 << 21))  # the second is LDRT or STRT
            if form == 1:
                return condition | op | 1 << 25 | 6  # r6, as it is
            writes = not op & 1 << 24 or op & 1 << 21
            offset = bits(7) << 2
            return condition | op | (offset + (bits(2) if size and not writes else 0))
        if kind == 9:
            base = r.choice(BASES)
            loads = bits(1)
            which = r.choice((1, 2, 3)) if loads else 1
            op = bits(1) << 23 | loads << 20 | base << 16 | self.register() << 12 | 0x90 | which << 5
            op |= r.choice((0, 1 << 24, 1 << 24 | 1 << 21))
            if bits(1):
                return condition | op | 6
            offset = bits(6) << 2
            return condition | op | 1 << 22 | (offset & 0xF0) << 4 | offset & 15
        if kind == 10:
            chosen = bits(16) & 0x7F8F or 1
            loads = bits(1)
            return condition | 1 << 27 | bits(2) << 23 | bits(1) << 21 | loads << 20 | r.choice(BASES) << 16 | chosen
        if kind == 11:
            return condition | 0x01000090 | bits(1) << 22 | r.choice(BASES) << 16 | self.register() << 12 | bits(2)
        if kind == 12:
            return condition | 0x010F0000 | bits(1) << 22 | self.register() << 12  # MRS
        if kind == 13:
            if bits(1):
                return condition | 0x0328F000 | r.choice((2, 3)) << 8 | bits(8)  # MSR flags or below, at once
            return 0xE321F000 | 0xC0 | r.choice(MODES)  # MSR: another mode
        if kind == 14:
            return condition | 0x0128F000 | bits(1) << 22 | self.operand()  # MSR flags of CPSR or SPSR
        if kind == 15:
            return condition | 5 << 25 | bits(1) << 24 | r.randrange(min(3, room))  # forward, over what is there
        if kind == 16:  # user registers
            chosen = bits(16) & 0x7F8F or 1
            return condition | 1 << 27 | bits(2) << 23 | 1 << 22 | bits(1) << 20 | r.choice(BASES) << 16 | chosen
        if kind == 17:  # a jump by a load: the pool after the code holds the addresses of all instructions
            there = here + 1 + r.randrange(min(3, room))
            return condition | 0x059FF000 | 4 * (LENGTH + there - here - 2)
        if kind == 18:
            return condition | SPSR_OF_MODE | r.choice(MODES)
        # subs pc, pc, #4 or #0: a return from an exception, of the forms of which Unicorn knows this one and movs
        return condition | 0x025FF004 - 4 * r.randrange(min(2, room))

    def thumb(self, room):
        r = self.random
        bits = r.getrandbits
        low = r.choice((0, 1, 2, 3, 7))
        kind = r.randrange(13)
        if kind == 0:
            return r.randrange(3) << 11 | bits(8) << 3 | low
        if kind == 1:
            return 3 << 11 | bits(8) << 3 | low
        if kind == 2:
            return 1 << 13 | bits(2) << 11 | low << 8 | bits(8)
        if kind in (3, 4):
            return 1 << 14 | bits(4) << 6 | bits(3) << 3 | low
        if kind == 5:
            rd = self.register()
            return 0x4400 | r.randrange(3) << 8 | (rd & 8) << 4 | r.randrange(8, 15) << 3 | rd & 7
        if kind == 6:
            return 0x4800 | low << 8 | bits(5)
        if kind == 7:
            code = r.choice((0, 1, 2, 3, 4, 5, 6, 7))
            return 0x5000 | code << 9 | 6 << 6 | r.choice(BASES) << 3 | low
        if kind == 8:
            form = r.choice((3 << 13 | bits(2) << 11, 8 << 12 | bits(1) << 11))
            return form | bits(4) << 7 | r.choice(BASES) << 3 | low
        if kind == 9:
            return 0xA000 | bits(1) << 11 | low << 8 | bits(8)
        if kind == 10:
            base = r.choice(BASES)
            return 0xC000 | bits(1) << 11 | base << 8 | (bits(8) & 0x8F or 1)
        if kind == 11:
            return 0xD000 | r.randrange(14) << 8 | r.randrange(min(3, room))
        return r.choice((0xE000 | r.randrange(min(3, room)), 0xB000 | bits(8)))


class Pair:
    """The two processors; `compare` runs one sequence in both."""

    def __init__(self, seed):
        import unicorn
        from unicorn import arm_const as names

        self.names = names
        self.random = random.Random(seed + 1)
        self.generator = Generator(seed)
        self.other = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_ARM)
        self.other.ctl_set_cpu_model(names.UC_CPU_ARM_TI925T)  # its ARMv4T part
        self.other.mem_map(CODE, SIZE)
        self.ours = Core(ram_size=SIZE, ram_base=CODE)
        self.numbers = [getattr(names, f"UC_ARM_REG_R{i}") for i in range(15)]
        # a valid saved status in every mode, so that a return may come anywhere
        start = [op for mode in MODES for op in (0xE321F0C0 | mode, 0xE << 28 | SPSR_OF_MODE | mode)]
        code = b"".join(op.to_bytes(4, "little") for op in start)
        self.other.mem_write(CODE, code)
        self.other.reg_write(names.UC_ARM_REG_CPSR, 0xD3)
        self.other.emu_start(CODE, CODE + len(code))
        self.ours.place(CODE, code)
        self.ours.pc = CODE
        for _ in start:
            self.ours.step()

    def compare(self, thumb):
        """None, or what is different after a sequence of random instructions."""
        r, width = self.random, 2 if thumb else 4
        make = self.generator.thumb if thumb else self.generator.arm
        values = [r.choice((r.getrandbits(32), r.getrandbits(8), 0, 0x80000000, 0xFFFFFFFF)) for _ in range(15)]
        values[4] = values[5] = DATA
        values[5] += 0x1000
        values[6] = r.randrange(32) * 4
        operations = [make(LENGTH - i) for i in range(LENGTH)]
        # the pool that Thumb loads data from, and ARM addresses
        pool = r.randbytes(256 * 4)
        if not thumb:
            pool = b"".join((CODE + 4 * i).to_bytes(4, "little") for i in range(LENGTH + 1)) + pool
        code = b"".join(op.to_bytes(width, "little") for op in operations) + pool
        content = r.randbytes(0x3000)
        names, other, ours = self.names, self.other, self.ours
        for number, value in zip(self.numbers, values, strict=True):
            other.reg_write(number, value)
        for i, value in enumerate(values):
            ours.r[i] = value
        for address, what in ((CODE, code), (DATA - 0x1000, content)):
            other.mem_write(address, what)
            words = memoryview(what).cast("I")
            start = (address - CODE) // 4
            for i in range(len(words)):
                ours.ram[start + i] = words[i]
        other.ctl_remove_cache(CODE, CODE + len(code))
        end = CODE + LENGTH * width
        status = other.reg_read(names.UC_ARM_REG_CPSR) & 0xF00000DF
        ours.set_cpsr(status | (0x20 if thumb else 0))
        ours.pc = CODE
        # the same number of instructions: counted by ours, which ends at the end of the sequence
        before = ours.instructions
        while CODE <= ours.pc < end:
            ours.step()
        count = ours.instructions - before
        other.emu_start(CODE | thumb, ours.pc, count=0)
        theirs = [other.reg_read(n) for n in self.numbers]
        told = []
        for i in range(15):
            if ours.r[i] != theirs[i]:
                told.append(f"r{i}: ours {ours.r[i]:#010x}, Unicorn {theirs[i]:#010x}")
        if ours.cpsr() & 0xF00000DF != other.reg_read(names.UC_ARM_REG_CPSR) & 0xF00000DF:
            told.append(f"cpsr: ours {ours.cpsr():#010x}, Unicorn {other.reg_read(names.UC_ARM_REG_CPSR):#010x}")
        if array.array("I", list(ours.ram)).tobytes() != bytes(other.mem_read(CODE, SIZE)):
            told.append("memory")
        if told:
            listing = " ".join(f"{op:0{2 * width}x}" for op in operations)
            return count, f"{'; '.join(told)} after: {listing}; registers {[hex(v) for v in values]}"
        return count, None


def check(instructions, seed=1):
    """(instructions compared, first difference or None)."""
    pair = Pair(seed)
    done, turn = 0, 0
    while done < instructions:
        count, difference = pair.compare(turn & 1)
        done += count
        turn += 1
        if difference:
            return done, difference
    return done, None


if __name__ == "__main__":
    done, difference = check(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 1)
    print(f"{done} instructions: {difference or 'no difference'}")
    sys.exit(bool(difference))
