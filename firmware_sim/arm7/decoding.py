"""Decoding: what an ARM or Thumb instruction does, as one number that the core executes.

An instruction's number has, from bit 0, a word (constant, offset or target), three registers of four bits at
DESTINATION, FIRST and SECOND, an amount of shift at AMOUNT with its type after it, the state that it was decoded for at
IN_THUMB, its condition, and its kind. A kind is a frequent instruction in its simplest form; DATA and WHOLE are all
others, with the ARM instruction as their word, and those that have the program counter in a register. Constants that
depend on the instruction's address are computed here.

Every Thumb instruction but those that branch or reach the program counter is an ARM instruction (ARM Architecture
Reference Manual, DDI 0100, chapter A7: "equivalent ARM syntax and encoding"); `arm_of_thumb` returns that one.
"""

from typing import Final

import cython

WHOLE: Final = 1
BRANCH: Final = 2
BRANCH_LINK: Final = 3
BRANCH_LINK_LOW: Final = 4  # the second half of Thumb's
BRANCH_EXCHANGE: Final = 5
# the operand is the word
MOVE_CONSTANT: Final = 6
ADD_CONSTANT: Final = 7
REVERSE_CONSTANT: Final = 8  # RSB
AND_CONSTANT: Final = 9
OR_CONSTANT: Final = 10
XOR_CONSTANT: Final = 11
COMPARE_CONSTANT: Final = 12  # the word is the operand's complement, here and in SUBS_CONSTANT
ADDS_CONSTANT: Final = 13
SUBS_CONSTANT: Final = 14
MOVES_CONSTANT: Final = 15  # carry unchanged, here and in all that follow, but SHIFTS
TEST_CONSTANT: Final = 16
TEST_TURNED: Final = 17  # carry is the constant's highest bit
# the operand is the second register as it is
MOVE: Final = 18
ADD: Final = 19
SUBTRACT: Final = 20
REVERSE: Final = 21
AND: Final = 22
OR: Final = 23
XOR: Final = 24
CLEAR: Final = 25  # BIC
COMPARE: Final = 26
ADDS: Final = 27
SUBS: Final = 28
MOVES: Final = 29
ANDS: Final = 30
ORS: Final = 31
XORS: Final = 32
TEST: Final = 33
TEST_EQUAL: Final = 34  # TEQ
# the operand is the second register, shifted
SHIFT_LEFT: Final = 35
SHIFT_RIGHT: Final = 36
SHIFT_SIGNED: Final = 37
SHIFTS: Final = 38  # with flags, of any type
DATA: Final = 39  # every other operation on registers that takes one cycle; the word is the instruction
LOAD_CONSTANT: Final = 40  # the word is the address
# loads and stores without write-back, of first register and word
LOAD: Final = 41
STORE: Final = 42
LOAD_HALF: Final = 43
STORE_HALF: Final = 44
LOAD_BYTE: Final = 45
STORE_BYTE: Final = 46
# the same six of first and second register, that one shifted left
INDEXED: Final = 47
# MOVE to SUBS of first and second register, that one shifted; not by ROR, nor by 32
SHIFTED: Final = 53

DESTINATION: Final = 32
FIRST: Final = 36
SECOND: Final = 40
AMOUNT: Final = 44  # 5 bits, then 2 of the type of shift
IN_THUMB: Final = 51
CONDITION: Final = 52
KIND: Final = 56

# C variables when compiled: Cython makes a Python object of every literal above 31 bits.
_MASK: cython.longlong = 4294967295
_ALWAYS: cython.longlong = 3758096384  # the condition AL of an ARM instruction
_ONE: cython.longlong = 1


@cython.cfunc
@cython.exceptval(check=False)
@cython.inline
def entry_of(
    kind: cython.longlong,
    destination: cython.longlong,
    first: cython.longlong,
    second: cython.longlong,
    word: cython.longlong,
) -> cython.longlong:
    """A decoded instruction that is always executed, without a shift."""
    return (
        kind << KIND
        | _ONE * 14 << CONDITION
        | second << SECOND
        | first << FIRST
        | destination << DESTINATION
        | word & _MASK
    )


@cython.ccall
@cython.exceptval(check=False)
@cython.locals(kind=cython.longlong, offset=cython.longlong)
def decode_thumb(op: cython.longlong, pc: cython.longlong) -> cython.longlong:
    """The Thumb instruction `op` at `pc`."""
    kind = op >> 11
    offset = (op & 0x7FF) << 1
    if kind == 9:
        op = entry_of(LOAD_CONSTANT, op >> 8 & 7, 0, 0, (pc + 4 & -4) + ((op & 0xFF) << 2))
    elif kind == 20:
        op = entry_of(MOVE_CONSTANT, op >> 8 & 7, 0, 0, (pc + 4 & -4) + ((op & 0xFF) << 2))
    elif op & 0xF000 == 0xD000 and op & 0x0E00 != 0x0E00:
        offset = (op & 0xFF) << 1
        kind = op >> 8 & 15
        op = entry_of(BRANCH, 0, 0, 0, pc + 4 + (offset - 0x200 if offset & 0x100 else offset))
        op = op & ~(_ONE * 15 << CONDITION) | kind << CONDITION
    elif kind == 28:
        op = entry_of(BRANCH, 0, 0, 0, pc + 4 + (offset - 0x1000 if offset & 0x800 else offset))
    elif kind == 30:
        offset <<= 11
        op = entry_of(MOVE_CONSTANT, 14, 0, 0, pc + 4 + (offset - 0x800000 if offset & 0x400000 else offset))
    elif kind == 31:
        op = entry_of(BRANCH_LINK_LOW, 0, 0, 0, offset)
    else:
        op = decode_arm(_ALWAYS | arm_of_thumb(op), pc)
    return op | _ONE << IN_THUMB


@cython.cfunc
@cython.exceptval(check=False)
@cython.locals(kind=cython.longlong, rd=cython.longlong, rs=cython.longlong, code=cython.longlong)
def arm_of_thumb(op: cython.longlong) -> cython.longlong:
    """The ARM instruction, without its condition, that a Thumb instruction is; an undefined one for those without."""
    kind = op >> 11
    rd = op & 7
    rs = op >> 3 & 7
    if kind < 3:  # MOVS rd, rs, shifted
        return 0x01B00000 | rd << 12 | (op >> 6 & 31) << 7 | kind << 5 | rs
    if kind == 3:  # ADDS or SUBS, of a register or three bits
        return (0x00500000 if op & 0x200 else 0x00900000) | (op & 0x400) << 15 | rs << 16 | rd << 12 | op >> 6 & 7
    rd = op >> 8 & 7
    if kind == 4:
        return 0x03B00000 | rd << 12 | op & 0xFF
    if kind == 5:
        return 0x03500000 | rd << 16 | op & 0xFF
    if kind == 6:
        return 0x02900000 | rd << 16 | rd << 12 | op & 0xFF
    if kind == 7:
        return 0x02500000 | rd << 16 | rd << 12 | op & 0xFF
    if kind == 8 and op & 0x400:  # high registers
        rd = op & 7 | op >> 4 & 8
        code = op >> 8 & 3
        if code == 0:
            return 0x00800000 | rd << 16 | rd << 12 | op >> 3 & 15
        if code == 1:
            return 0x01500000 | rd << 16 | op >> 3 & 15
        if code == 3:
            return 0x012FFF10 | op >> 3 & 15
        return 0x01A00000 | rd << 12 | op >> 3 & 15
    if kind == 8:
        rd = op & 7
        code = op >> 6 & 15
        if code == 2 or code == 3 or code == 4 or code == 7:  # MOVS rd, rd, shifted by a register
            return 0x01B00010 | rd << 12 | rs << 8 | (3 if code == 7 else code - 2) << 5 | rd
        if code == 9:
            return 0x02700000 | rs << 16 | rd << 12
        if code == 13:
            return 0x00100090 | rd << 16 | rd << 8 | rs
        if code == 8 or code == 10 or code == 11:
            return 0x00100000 | code << 21 | rd << 16 | rs
        if code == 15:
            return 0x01F00000 | rd << 12 | rs
        return 0x00100000 | code << 21 | rd << 16 | rd << 12 | rs
    if kind < 12:  # an offset in a register
        rd = op & 7
        code = rs << 16 | rd << 12 | op >> 6 & 7
        kind = op >> 9 & 7
        if kind == 0:
            return 0x07800000 | code
        if kind == 1:
            return 0x018000B0 | code
        if kind == 2:
            return 0x07C00000 | code
        if kind == 3:
            return 0x019000D0 | code
        if kind == 4:
            return 0x07900000 | code
        if kind == 5:
            return 0x019000B0 | code
        if kind == 6:
            return 0x07D00000 | code
        return 0x019000F0 | code
    if kind < 18:
        code = (op & 0x800) << 9 | rs << 16 | (op & 7) << 12
        rd = op >> 6 & 31
        if kind < 14:
            return 0x05800000 | code | rd << 2
        if kind < 16:
            return 0x05C00000 | code | rd
        return 0x01C000B0 | code | (rd & 0x18) << 5 | rd << 1 & 15
    if kind < 20:
        return 0x058D0000 | (op & 0x800) << 9 | rd << 12 | (op & 0xFF) << 2
    if kind == 21:  # constants times four: rotated by 30
        return 0x028D0F00 | rd << 12 | op & 0xFF
    if op & 0xFF00 == 0xB000:
        return (0x024DDF00 if op & 0x80 else 0x028DDF00) | op & 0x7F
    if op & 0xFE00 == 0xB400:  # the ninth bit is r14 or the program counter
        return 0x092D0000 | op & 0xFF | (op & 0x100) << 6
    if op & 0xFE00 == 0xBC00:
        return 0x08BD0000 | op & 0xFF | (op & 0x100) << 7
    if kind == 24 or kind == 25:
        return (0x08B00000 if op & 0x800 else 0x08A00000) | rd << 16 | op & 0xFF
    if op & 0xFF00 == 0xDF00:
        return 0x0F000000 | op & 0xFF
    return 0x06000010


@cython.ccall
@cython.exceptval(check=False)
@cython.locals(entry=cython.longlong)
def decode_arm(op: cython.longlong, pc: cython.longlong) -> cython.longlong:
    """The ARM instruction `op` at `pc`."""
    entry = 0
    if op >> 25 & 7 == 5:
        entry = (op & 0xFFFFFF) << 2
        entry = entry_of(
            BRANCH_LINK if op & 0x01000000 else BRANCH, 0, 0, 0, pc + 8 + entry - (0x4000000 if op & 0x800000 else 0)
        )
    elif op & 0x0FFFFFF0 == 0x012FFF10:
        entry = entry_of(BRANCH_EXCHANGE, 0, 0, op & 15, 0)
    elif op & 0x0E000090 == 0x90 or op >> 26 & 3 == 1:
        if op >> 12 & 15 != 15 and op & 0x01200000 == 0x01000000:
            entry = decode_transfer(op, pc)
    elif op >> 26 & 3 == 0 and op & 0x01900000 != 0x01000000 and (op >> 12 & 15 != 15 or op & 0x01800000 == 0x01000000):
        if op & 0x02000000 or op & 0x10 == 0:
            entry = decode_constant(op) if op & 0x02000000 else decode_register(op)
            if entry == 0 or entry >> FIRST & 15 == 15 or entry >> SECOND & 15 == 15:
                entry = entry_of(DATA, 0, 0, 0, op)
    if entry == 0 or entry >> FIRST & 15 == 15 or entry >> SECOND & 15 == 15:
        entry = entry_of(WHOLE, 0, 0, 0, op)
    return entry & ~(_ONE * 15 << CONDITION) | (op >> 28) << CONDITION


@cython.cfunc
@cython.exceptval(check=False)
@cython.locals(kind=cython.longlong, word=cython.longlong)
def decode_transfer(op: cython.longlong, pc: cython.longlong) -> cython.longlong:
    """A load or store without write-back; 0 for one without a kind."""
    kind = LOAD if op & 0x100000 else STORE
    word = op & 0xFFF
    if op >> 25 & 7 == 0:
        if op & 0x60 != 0x20:
            return 0
        kind += LOAD_HALF - LOAD
        word = op >> 4 & 0xF0 | op & 15
    elif op & 0x400000:
        kind += LOAD_BYTE - LOAD
    if op & 0x02000000 or op & 0x0E400000 == 0:  # offset in a register
        if not op & 0x800000 or op & 0x02000000 and op & 0x70:
            return 0
        kind = entry_of(kind + INDEXED - LOAD, op >> 12 & 15, op >> 16 & 15, op & 15, 0)
        return kind | _ONE * (op >> 7 & 31 if op & 0x02000000 else 0) << AMOUNT
    if not op & 0x800000:
        word = -word
    if kind == LOAD and op >> 16 & 15 == 15 and pc + word & 3 == 0:
        return entry_of(LOAD_CONSTANT, op >> 12 & 15, 0, 0, pc + 8 + word)
    return entry_of(kind, op >> 12 & 15, op >> 16 & 15, 0, word)


@cython.cfunc
@cython.exceptval(check=False)
@cython.locals(word=cython.longlong, turn=cython.longlong, kind=cython.longlong, code=cython.longlong)
def decode_constant(op: cython.longlong) -> cython.longlong:
    """A data operation with a constant; 0 for one without a kind."""
    word = op & 0xFF
    turn = op >> 7 & 30
    word = word >> turn | word << (32 - turn)
    code = op >> 21 & 15
    kind = 0
    if op & 0x100000:
        if code == 2:
            kind = SUBS_CONSTANT
            word = ~word
        elif code == 4:
            kind = ADDS_CONSTANT
        elif code == 10:
            kind = COMPARE_CONSTANT
            word = ~word
        elif code == 8:
            kind = TEST_TURNED if turn else TEST_CONSTANT
        elif code == 13 and turn == 0:
            kind = MOVES_CONSTANT
    elif code == 0:
        kind = AND_CONSTANT
    elif code == 1:
        kind = XOR_CONSTANT
    elif code == 2:
        kind = ADD_CONSTANT
        word = -(word & _MASK)
    elif code == 3:
        kind = REVERSE_CONSTANT
    elif code == 4:
        kind = ADD_CONSTANT
    elif code == 12:
        kind = OR_CONSTANT
    elif code == 13:
        kind = MOVE_CONSTANT
    elif code == 14:
        kind = AND_CONSTANT
        word = ~word
    elif code == 15:
        kind = MOVE_CONSTANT
        word = ~word
    return entry_of(kind, op >> 12 & 15, op >> 16 & 15, 0, word) if kind else 0


@cython.cfunc
@cython.exceptval(check=False)
@cython.locals(
    kind=cython.longlong, code=cython.longlong, amount=cython.longlong, type=cython.longlong, sets=cython.bint
)
def decode_register(op: cython.longlong) -> cython.longlong:
    """A data operation with a register shifted by a constant; 0 for one without a kind."""
    code = op >> 21 & 15
    amount = op >> 7 & 31
    type = op >> 5 & 3
    sets = op & 0x100000 != 0
    kind = 0
    if code == 13 and (amount or type) and (sets or amount and type < 3):
        kind = SHIFTS if sets else SHIFT_LEFT + type
    elif sets:
        if code == 2:
            kind = SUBS
        elif code == 4:
            kind = ADDS
        elif code == 10:
            kind = COMPARE
        elif amount or type:  # the shifter gives the carry
            return 0
        elif code == 0:
            kind = ANDS
        elif code == 1:
            kind = XORS
        elif code == 8:
            kind = TEST
        elif code == 9:
            kind = TEST_EQUAL
        elif code == 12:
            kind = ORS
        elif code == 13:
            kind = MOVES
    elif code == 0:
        kind = AND
    elif code == 1:
        kind = XOR
    elif code == 2:
        kind = SUBTRACT
    elif code == 3:
        kind = REVERSE
    elif code == 4:
        kind = ADD
    elif code == 12:
        kind = OR
    elif code == 13:
        kind = MOVE
    elif code == 14:
        kind = CLEAR
    if kind < SHIFT_LEFT and (amount or type):
        if kind == 0 or amount == 0 or type == 3:
            return 0
        kind += SHIFTED - MOVE
    if kind == 0:
        return 0
    return entry_of(kind, op >> 12 & 15, op >> 16 & 15, op & 15, 0) | _ONE * (type << 5 | amount) << AMOUNT
