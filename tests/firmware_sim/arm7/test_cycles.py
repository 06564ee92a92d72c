"""Cycles by known answers: the data sheet's classes out of RAM, and the flash accelerator clock by clock.

The classes are those of the ARM7TDMI data sheet (DDI 0029E), section 10.23 (Instruction Speed Summary), and for Thumb
the "instruction cycle times" of its chapter 5; sections 4.7 and 4.8 say how far the multiplier looks (m). Each test
writes the class down as the sheet does, in S, N and I cycles; out of RAM each is one clock.
"""

import array

import pytest

from ranger_sim.firmware_sim.arm7.core import FIQ_LINE, IRQ_LINE, Core
from ranger_sim.foundation.user_error import UserError

RAM = 0x40000000
DATA = RAM + 0x100


def core(*operations, at=RAM, width=4, **options):
    made = Core(**options)
    made.place(at, b"".join(op.to_bytes(width, "little") for op in operations))
    made.pc = at
    if width == 2:
        made.set_cpsr(made.cpsr() | 0x20)
    return made


def clocks(sequence):
    """ "(n-1)S" is written out: "2S 1N 1I" is four clocks."""
    return sum(int(part[:-1]) for part in sequence.split())


# r0 0, r1 1, r2 4, r3 7 (m = 1), r4 0x12345678 (m = 4), r5 an address of data, r6 0xFFFFFF00 (m = 1 signed,
# 4 unsigned), r7 0x1234 (m = 2), r8 0x123456 (m = 3), r9 an address of code
ARM = {
    "data processing": (0xE0800001, "1S"),
    "data processing, shift in the instruction": (0xE0800201, "1S"),
    "data processing, shift by a register": (0xE0800211, "1S 1I"),
    "compare": (0xE1500001, "1S"),
    "compare, shift by a register": (0xE1500211, "1S 1I"),
    "mov pc": (0xE1A0F009, "2S 1N"),
    "add pc, shift by a register": (0xE08FF210, "2S 1N 1I"),
    "movs pc": (0xE1B0F009, "2S 1N"),
    "mrs": (0xE10F0000, "1S"),
    "msr of a register": (0xE128F000, "1S"),
    "msr of a number": (0xE328F20F, "1S"),
    "ldr": (0xE5950000, "1S 1N 1I"),
    "ldr with write-back": (0xE5B50004, "1S 1N 1I"),
    "ldr, shifted offset": (0xE7950100, "1S 1N 1I"),
    "ldrb": (0xE5D50000, "1S 1N 1I"),
    "ldrh": (0xE1D500B0, "1S 1N 1I"),
    "ldrsb": (0xE1D500D0, "1S 1N 1I"),
    "ldrsh": (0xE1D500F0, "1S 1N 1I"),
    "ldr pc": (0xE595F000, "2S 2N 1I"),
    "str": (0xE5850000, "2N"),
    "strb": (0xE5C50000, "2N"),
    "strh": (0xE1C500B0, "2N"),
    "ldm of one": (0xE8950001, "1S 1N 1I"),
    "ldm of three": (0xE8950007, "3S 1N 1I"),
    "ldm of the program counter": (0xE8958000, "2S 2N 1I"),
    "ldm of three and the program counter": (0xE8958007, "5S 2N 1I"),
    "ldm of nothing, which is the program counter": (0xE8950000, "2S 2N 1I"),
    "stm of one": (0xE8850001, "2N"),
    "stm of three": (0xE8850007, "2S 2N"),
    "stm of nothing, which is the program counter": (0xE8850000, "2N"),
    "swp": (0xE1050090, "1S 2N 1I"),
    "swpb": (0xE1450090, "1S 2N 1I"),
    "b": (0xEA000000, "2S 1N"),
    "bl": (0xEB000000, "2S 1N"),
    "bx": (0xE12FFF19, "2S 1N"),
    "bx of the program counter": (0xE12FFF1F, "2S 1N"),
    "swi": (0xEF000000, "2S 1N"),
    "undefined": (0xE7F000F0, "2S 1I 1N"),
    "coprocessor that is absent": (0xEE010F10, "2S 1I 1N"),
    "condition not met": (0x00800001, "1S"),
    "branch, condition not met": (0x0A000000, "1S"),
    "ldm, condition not met": (0x08958007, "1S"),
    "mul, m = 1": (0xE0000391, "1S 1I"),
    "mul, m = 2": (0xE0000791, "1S 2I"),
    "mul, m = 3": (0xE0000891, "1S 3I"),
    "mul, m = 4": (0xE0000491, "1S 4I"),
    "mul, m = 1, negative": (0xE0000691, "1S 1I"),
    "mla, m = 1": (0xE0204391, "1S 2I"),
    "mla, m = 4": (0xE0204491, "1S 5I"),
    "umull, m = 1": (0xE0810392, "1S 2I"),
    "umull, m = 4": (0xE0810492, "1S 5I"),
    "umull, m = 4, all ones above do not end it": (0xE0810692, "1S 5I"),
    "smull, m = 1, all ones above end it": (0xE0C10692, "1S 2I"),
    "umlal, m = 2": (0xE0A10792, "1S 4I"),
    "smlal, m = 1": (0xE0E10392, "1S 3I"),
    "smlal, m = 3": (0xE0E10892, "1S 5I"),
}

# low registers: r0 0, r1 1, r2 4, r3 7, r4 0x12345678, r5 an address of data, r6 0xFFFFFF00
THUMB = {
    "lsl by a number": (0x0048, "1S"),
    "add": (0x1840, "1S"),
    "mov of a number": (0x2001, "1S"),
    "cmp of a number": (0x2801, "1S"),
    "and": (0x4008, "1S"),
    "lsl by a register": (0x4088, "1S 1I"),
    "ror by a register": (0x41C8, "1S 1I"),
    "neg": (0x4248, "1S"),
    "mul: the destination as it was is what m looks at": (0x434C, "1S 4I"),
    "mul, m = 1": (0x434B, "1S 1I"),
    "add of high registers": (0x4440, "1S"),
    "mov pc": (0x46CF, "2S 1N"),
    "bx": (0x4748, "2S 1N"),
    "ldr of the pool": (0x4801, "1S 1N 1I"),
    "ldr": (0x6828, "1S 1N 1I"),
    "ldr, register offset": (0x5828, "1S 1N 1I"),
    "ldrsh": (0x5E28, "1S 1N 1I"),
    "ldrb": (0x7828, "1S 1N 1I"),
    "ldrh": (0x8828, "1S 1N 1I"),
    "ldr of the stack": (0x9800, "1S 1N 1I"),
    "str": (0x6028, "2N"),
    "strb": (0x7028, "2N"),
    "strh": (0x8028, "2N"),
    "str to the stack": (0x9000, "2N"),
    "address": (0xA001, "1S"),
    "add to the stack pointer": (0xB001, "1S"),
    "push of three": (0xB407, "2S 2N"),
    "push of three and lr": (0xB507, "3S 2N"),
    "pop of three": (0xBC07, "3S 1N 1I"),
    "pop of three and pc": (0xBD07, "5S 2N 1I"),
    "ldmia of two": (0xCD03, "2S 1N 1I"),
    "stmia of two": (0xC503, "1S 2N"),
    "branch taken": (0xD100, "2S 1N"),
    "branch not taken": (0xD000, "1S"),
    "b": (0xE000, "2S 1N"),
    "bl, first half": (0xF000, "1S"),
    "bl, second half": (0xF800, "2S 1N"),
    "swi": (0xDF00, "2S 1N"),
    "undefined": (0xDE00, "2S 1I 1N"),
}


def prepare(made):
    made.z = 0
    for i, value in enumerate((0, 1, 4, 7, 0x12345678, DATA, 0xFFFFFF00, 0x1234, 0x123456, RAM + 0x40)):
        made.r[i] = value
    made.r[13], made.r[14] = DATA + 0x80, RAM + 0x40
    made.set_spsr(0xD3)


@pytest.mark.parametrize("what", ARM)
def test_an_arm_instruction_takes_what_the_data_sheet_sums_up(what):
    operation, sequence = ARM[what]
    made = core(operation)
    prepare(made)
    made.step()
    assert made.cycles == clocks(sequence)


@pytest.mark.parametrize("what", THUMB)
def test_a_thumb_instruction_takes_as_long_as_its_arm_counterpart(what):
    operation, sequence = THUMB[what]
    made = core(operation, width=2)
    prepare(made)
    made.step()
    assert made.cycles == clocks(sequence)


@pytest.mark.parametrize("line", [IRQ_LINE, FIQ_LINE])
def test_an_interrupt_is_entered_in_2s_and_1n(line):
    made = core(0xE1A00000)
    made.set_cpsr(0x1F)
    made.lines = line
    made.run(1)
    assert (made.cycles, made.instructions) == (3, 0)


def test_aborts_add_2s_and_1n_to_the_load_and_take_the_place_of_the_fetch():
    made = core(0xE5950000)  # ldr r0, [r5]
    made.takes_aborts = True
    made.r[5] = 0x80000000
    made.step()
    assert (made.pc, made.cycles) == (0x10, clocks("1S 1N 1I") + clocks("2S 1N"))
    made.pc = 0x80000000
    made.step()
    assert (made.pc, made.cycles) == (0x0C, 6 + 3)


def test_a_device_waits_behind_the_bridge_and_not_on_the_local_bus():
    class Anything:
        def read(self, address, size):
            return 0

        def write(self, address, size, value):
            pass

    made = core(0xE5850000, 0xE5950000, 0xE5860000, device=Anything())  # str [r5], ldr [r5], str [r6]
    made.r[5], made.r[6] = 0xE0028004, 0x3FFFC018
    taken = []
    for _ in range(3):
        before = made.cycles
        made.step()
        taken.append(made.cycles - before)
    # 7 clocks against 2: "up to 3.5 times faster" (LPC2194/01 data sheet, of the fast ports)
    assert taken == [7, 8, 2]


# ---- the flash accelerator: user manual LPC2119/2129/2194/2292/2294, chapter 5; MAMTIM is 4 throughout

NOP, TO_SELF = 0xE1A00000, 0xEAFFFFFE


def trace(made, count):
    """Clocks of each of the next instructions."""
    taken = []
    for _ in range(count):
        before = made.cycles
        made.step()
        taken.append(made.cycles - before)
    return taken


def branch(place, to):
    return 0xEA000000 | (to - place - 8) >> 2 & 0xFFFFFF


def test_straight_code_waits_for_its_first_line_only():
    assert trace(core(*[NOP] * 16, at=0), 16) == [4] + [1] * 15


def test_a_slower_flash_is_not_hidden_by_four_instructions():
    made = core(*[NOP] * 12, at=0)
    made.set_mam(2, 6)
    # two clocks of each line remain; the prefetch of a line begins as the line before is entered
    assert trace(made, 12) == [6, 1, 1, 1, 1, 1, 1, 1, 3, 1, 1, 1]


def test_a_branch_to_a_new_place_waits_and_to_the_branch_trail_does_not():
    made = core(NOP, branch(4, 0x40), at=0)
    made.place(0x40, b"".join(op.to_bytes(4, "little") for op in (NOP, branch(0x44, 0))))
    # 0x40 is of the other pair of lines, but of the same (even) bank: each takes the other's branch trail buffer
    assert trace(made, 8) == [4, 3, 4, 3, 4, 3, 4, 3]
    made = core(NOP, branch(4, 0x50), at=0)
    made.place(0x50, b"".join(op.to_bytes(4, "little") for op in (NOP, branch(0x54, 0))))
    assert trace(made, 8) == [4, 3, 4, 3, 1, 3, 1, 3]  # one in each bank: both stay


def test_a_loop_over_three_lines_waits_for_the_line_that_its_bank_has_replaced():
    # 12 instructions from 0x10 on, the last of which goes back
    made = core(*[NOP] * 11, branch(0x3C, 0x10), at=0x10)
    first = trace(made, 12)
    assert first == [4, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 3]
    # the line at 0x10 is in the trail; that at 0x20 was replaced by 0x40 and is fetched while the first one runs
    assert trace(made, 12) == [1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 3]


def test_a_branch_to_the_end_of_a_line_in_the_trail_waits_for_the_rest_of_the_prefetch():
    made = core(*[NOP] * 11, branch(0x3C, 0x1C), at=0x10)
    made.trail[1] = 1
    trace(made, 12)
    # 0x1C is the last of its line: the prefetch of 0x20, begun one clock after, has three clocks left
    assert trace(made, 2) == [1, 4]


def test_a_constant_out_of_another_line_waits_and_its_neighbours_do_not():
    load = 0xE59F0000  # ldr r0, [pc, #...]
    made = core(*[load | 0x100 + 4 * (i & 1) - 4 * i for i in range(4)], at=0)
    # 0x108, 0x10C, 0x110 ...: i moves the pc, so that 0x108 and 0x10C stand in one line
    assert trace(made, 4) == [3 + 3 + 3, 3, 3, 3]


def test_a_constant_makes_the_prefetch_of_its_bank_begin_anew():
    # the first line loads from an odd line while the line after it, odd too, is prefetched
    made = core(0xE59F0110, NOP, NOP, NOP, NOP, at=0)  # ldr r0, [pc, #0x110]: at 0x118, line 17
    made.trail[0] = 0
    # entered without a wait; ldr 3 + 3; the prefetch begins again after the datum, at 5, and is there at 9
    assert trace(made, 5) == [6, 1, 1, 1, 1]
    other = core(NOP, NOP, 0xE59F0108, NOP, NOP, at=0)  # later in its line: the datum at 4, the prefetch at 11
    other.trail[0] = 0
    assert trace(other, 5) == [1, 1, 6, 1, 2]


# r0 counts down: subs r0, r0, #1; bne to it.
LOOP = (0xE3A00064, 0xE2500001, 0x1AFFFFFD)


@pytest.mark.parametrize(("mode", "cycles"), [(2, 399 + 3), (1, 399 + 3 + 99 * 3), (0, 399 + 201 * 3)])
def test_a_loop_of_100_turns_takes_by_mode_what_the_manual_says(mode, cycles):
    """399 clocks without waits: mov 1, 99 turns of 1 + 3, the last of 1 + 1."""
    made = core(*LOOP, at=0)
    made.set_mam(mode, 4)
    while made.pc != 12:
        made.step()
    assert made.instructions == 201
    # 2: the first line only. 1: also every branch. 0: every fetch.
    assert made.cycles == cycles


def test_in_mode_1_a_fetch_after_a_store_reads_flash():
    made = core(0xE5850000, NOP, NOP, at=0)
    made.r[5] = DATA
    made.set_mam(1, 4)
    assert trace(made, 3) == [2 + 3, 1 + 3, 1]


def test_with_a_fixed_number_every_instruction_takes_it_and_interrupts_their_three():
    made = core(0xE5950000, 0xE0000491, 0xEA000000, at=0)
    made.cycles_per_instruction = 2
    made.r[5] = DATA
    assert trace(made, 3) == [2, 2, 2]
    made.set_cpsr(0x1F)
    made.lines = IRQ_LINE
    made.run(made.cycles + 1)
    assert made.cycles == 9


def test_a_mode_that_the_accelerator_has_not_is_one_line():
    with pytest.raises(UserError, match="MAM mode 3 of 4 clocks"):
        Core().set_mam(3, 4)


def test_the_state_of_a_loop_in_flash_is_the_same_after_every_pass():
    made = core(*[NOP] * 11, branch(0x3C, 0x1C), at=0x10)  # three lines, entered at the end of one: prefetches matter
    states = []
    for _ in range(4):
        trace(made, 12 if not states else 9)
        state = array.array("q", [0]) * 53
        made.state_into(state)
        states.append(list(state))
    assert made.pc == 0x1C
    assert states[1] == states[2] == states[3]
    made.step()
    made.state_into(state)
    assert list(state) != states[3]
