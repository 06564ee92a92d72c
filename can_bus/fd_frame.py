"""A CAN FD frame to the bit (ISO 11898-1:2015): formats, both kinds of stuff bits, stuff count, CRC-17 and CRC-21.

A frame is an identifier, flags (bits 0-3 data length code, then the FLAG_* of foundation.events) and data bytes.

Layout: start of frame, arbitration field with RRS, IDE, FDF (recessive), res (dominant), BRS, ESI, data length code,
data: these have dynamic stuff bits, as classic frames do. Then the CRC field with fixed stuff bits: one in front of it
and one after each fourth bit, each the complement of the bit before it; where a dynamic stuff bit would follow the last
bit of the data, the fixed one takes its place. The CRC field is the stuff count (number of dynamic stuff bits modulo 8
as a Gray code, and an even parity bit) and the CRC. Then CRC delimiter, acknowledge slot and delimiter, seven bits end
of frame.

The CRC covers the dynamic stuff bits and the stuff count, not the fixed stuff bits, and begins with a one in its
highest bit. Non-ISO frames (CAN FD Specification 1.0, before 2015) have no stuff count, and a CRC that begins with
zeros.

Two bit rates: the bit BRS up to its sample point at the nominal rate, from there to the sample point of the CRC
delimiter at the data rate. With one sample point per rate both bits together last one bit of each rate, so the length
of a frame does not depend on the sample points: `phases` counts them so.
"""

from typing import Final

import cython

from ranger_sim.can_bus.frame import (
    FIELD_ACK_DELIMITER,
    FIELD_ACK_SLOT,
    FIELD_CRC,
    FIELD_CRC_DELIMITER,
    FIELD_DATA,
    FIELD_DLC,
    FIELD_END,
    FIELD_ID_4_0,
    FIELD_ID_12_5,
    FIELD_ID_17_13,
    FIELD_ID_20_18,
    FIELD_ID_28_21,
    FIELD_IDE,
    FIELD_R0,
    FIELD_R1,
    FIELD_RTR,
    FIELD_SRTR,
    FIELD_START,
    LENGTH_CODE,
    RECESSIVE,
    STUFF_AFTER,
    TAIL_BITS,
)
from ranger_sim.foundation.events import FLAG_BRS, FLAG_ESI, FLAG_EXTENDED, FLAG_FD, FLAG_REMOTE

FD_SENDABLE: Final = 0x76F  # flags that a request may have: length code, single shot, extended, FD, BRS, ESI

# Positions in a frame that the LPC2194 has no codes for; of the 32 codes these are free (`frame.FIELD_*`).
FIELD_RES: Final = 1
FIELD_STUFF_COUNT: Final = 16
FIELD_BRS: Final = 20
FIELD_ESI: Final = 21

LONGEST: Final = 64  # data bytes
LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)  # by data length code

SHORT_CRC_UP_TO: Final = 16  # data bytes of frames with CRC-17; longer ones have CRC-21
CRC17_BITS: Final = 17
CRC17_POLYNOMIAL: Final = 0x1685B  # without its highest term, as CRC21_POLYNOMIAL
CRC21_BITS: Final = 21
CRC21_POLYNOMIAL: Final = 0x102899
STUFF_COUNT_BITS: Final = 4
FIXED_STUFF_EVERY: Final = 4
STUFF_COUNT_CODES = (0, 3, 6, 5, 12, 15, 10, 9)  # by the number of stuff bits modulo 8: Gray code, then even parity

BASE_UP_TO_BRS: Final = 17  # bits from the start of frame to BRS, without stuff bits
EXTENDED_UP_TO_BRS: Final = 36
ESI_AND_CODE: Final = 5  # bits
# `phases`: bits 0-15 nominal, from bit 16 those at the data rate
PHASE_SHIFT: Final = 16
PHASE_MASK: Final = 0xFFFF


def fd_data_length(flags: int) -> int:
    """Data bytes that an FD frame with these flags carries, 0 ... 64."""
    return LENGTHS[flags & LENGTH_CODE]


def length_code(length: int) -> int:
    """The smallest data length code of an FD frame that holds `length` bytes. ValueError above 64 bytes."""
    if not 0 <= length <= LONGEST:
        raise ValueError(f"{length} data bytes are outside 0 ... {LONGEST}, the lengths of a CAN FD frame")
    return next(code for code, holds in enumerate(LENGTHS) if holds >= length)


def fault_of_fd_flags(flags: int) -> str:
    """Error message for the flags of a frame that has FLAG_FD, FLAG_BRS or FLAG_ESI; empty when they can be sent."""
    if not flags & FLAG_FD:
        return "BRS and ESI are bits of CAN FD frames, and this frame is classic"
    if flags & FLAG_REMOTE:
        return "CAN FD has no remote frames"
    if flags & ~FD_SENDABLE:
        return f"flags {flags:#x} cannot be sent"
    return ""


@cython.ccall
def fd_crc(value: object, count: cython.longlong, width: cython.longlong, iso: cython.bint = True) -> cython.longlong:
    """CRC of the `count` low bits of `value` (any size), the highest first: `width` 17 or 21.

    Stuff bits and stuff count are bits like others here. `iso` False: it begins with zeros.
    """
    one: cython.longlong = 1
    polynomial: cython.longlong = CRC17_POLYNOMIAL if width == CRC17_BITS else CRC21_POLYNOMIAL
    register: cython.longlong = one << (width - 1) if iso else 0
    text: str = format(value, f"0{count}b") if count else ""
    for character in text:
        register = next_crc(register, 1 if character == "1" else 0, width, polynomial)
    return register


@cython.ccall
@cython.exceptval(check=False)
def next_crc(
    register: cython.longlong, bit: cython.longlong, width: cython.longlong, polynomial: cython.longlong
) -> cython.longlong:
    """The register of a CRC of `width` bits after one more bit."""
    one: cython.longlong = 1
    feedback: cython.longlong = bit ^ register >> (width - 1)
    register = register << 1 & ((one << width) - 1)
    return register ^ polynomial if feedback else register


@cython.cfunc
@cython.exceptval(check=False)
def _header(identifier: cython.longlong, flags: cython.longlong) -> cython.longlong:
    """The bits from the start of frame to the data length code: 22, extended 41."""
    switch: cython.longlong = 1 if flags & FLAG_BRS else 0
    passive: cython.longlong = 1 if flags & FLAG_ESI else 0
    low: cython.longlong = 1 << 7 | switch << 5 | passive << 4 | (flags & LENGTH_CODE)  # FDF res BRS ESI DLC
    if flags & FLAG_EXTENDED:  # SOF id28-18 SRR IDE id17-0 RRS
        return ((identifier >> 18 & 0x7FF) << 20 | 0xC0000 | (identifier & 0x3FFFF)) << 9 | low
    return (identifier & 0x7FF) << 10 | low  # SOF id10-0 RRS IDE


@cython.ccall
@cython.exceptval(check=False)
def crc_field_bits(flags: cython.longlong, iso: cython.bint = True) -> cython.longlong:
    """Bits of the CRC field with its fixed stuff bits, without the CRC delimiter: 27 or 32, non-ISO 22 or 27."""
    code: cython.longlong = flags & LENGTH_CODE
    bits: cython.longlong = CRC17_BITS if code <= 10 else CRC21_BITS
    if iso:
        bits += STUFF_COUNT_BITS
    return bits + 1 + bits // FIXED_STUFF_EVERY


@cython.ccall
def phases(
    identifier: cython.longlong, flags: cython.longlong, data: bytes, iso: cython.bint = True
) -> cython.longlong:
    """Length of a frame from start of frame to the end of EOF, intermission not included: data bits << 16 | nominal.

    Data bits are 0 without FLAG_BRS. BRS counts as nominal, the CRC delimiter as a data bit (see above).
    """
    slow: cython.longlong = EXTENDED_UP_TO_BRS if flags & FLAG_EXTENDED else BASE_UP_TO_BRS
    count: cython.longlong = slow + ESI_AND_CODE
    header: cython.longlong = _header(identifier, flags)
    bits: cython.longlong = count + 8 * len(data)
    run: cython.longlong = 0
    level: cython.longlong = RECESSIVE
    bit: cython.longlong
    byte: cython.longlong = 0
    place: cython.longlong
    stuffed: cython.longlong = 0
    before: cython.longlong = 0  # stuff bits up to BRS
    for place in range(bits):
        if place < count:
            bit = header >> (count - 1 - place) & 1
        else:
            if (place - count) & 7 == 0:
                byte = data[(place - count) >> 3]
            bit = byte >> (7 - ((place - count) & 7)) & 1
        run = run + 1 if bit == level else 1
        level = bit
        if place == slow - 1:
            before = stuffed
        if run == STUFF_AFTER and place < bits - 1:
            stuffed += 1
            level = 1 - bit
            run = 1
    whole: cython.longlong = bits + stuffed + crc_field_bits(flags, iso) + TAIL_BITS
    if not flags & FLAG_BRS:
        return whole
    slow += before + TAIL_BITS - 1
    return (whole - slow) << PHASE_SHIFT | slow


def padded(data: bytes) -> bytes:
    """Data bytes filled up with zeros to the next length that a CAN FD frame has."""
    return data.ljust(LENGTHS[length_code(len(data))], b"\0")


def fd_wire(identifier: int, flags: int, data: bytes, iso: bool = True) -> tuple[list[int], list[int]]:
    """The bits of a frame on the wire, from start of frame to the end of EOF, as sent; and their FIELD_*.

    A dynamic stuff bit belongs to the field of the bit before it, a fixed one to that of the bit after it.
    """
    parts: list[tuple[int, int, int]] = [(FIELD_START, 1, 0)]
    if flags & FLAG_EXTENDED:
        parts += [
            (FIELD_ID_28_21, 8, identifier >> 21),
            (FIELD_ID_20_18, 3, identifier >> 18),
            (FIELD_SRTR, 1, 1),
            (FIELD_IDE, 1, 1),
            (FIELD_ID_17_13, 5, identifier >> 13),
            (FIELD_ID_12_5, 8, identifier >> 5),
            (FIELD_ID_4_0, 5, identifier),
            (FIELD_RTR, 1, 0),
            (FIELD_R1, 1, 1),
        ]
    else:
        parts += [
            (FIELD_ID_28_21, 8, identifier >> 3),
            (FIELD_ID_20_18, 3, identifier),
            (FIELD_SRTR, 1, 0),
            (FIELD_IDE, 1, 0),
            (FIELD_R0, 1, 1),  # FDF, in the place of r0; in an extended frame of r1
        ]
    parts += [
        (FIELD_RES, 1, 0),
        (FIELD_BRS, 1, int(bool(flags & FLAG_BRS))),
        (FIELD_ESI, 1, int(bool(flags & FLAG_ESI))),
        (FIELD_DLC, 4, flags & LENGTH_CODE),
    ]
    parts += [(FIELD_DATA, 8, byte) for byte in data]
    bits: list[int] = []
    fields: list[int] = []
    run = stuffed = 0
    for number, (field, count, value) in enumerate(parts):
        for position in range(count - 1, -1, -1):
            bit = value >> position & 1
            run = run + 1 if bits and bits[-1] == bit else 1
            bits.append(bit)
            fields.append(field)
            if run == STUFF_AFTER and not (position == 0 and number == len(parts) - 1):
                bits.append(1 - bit)
                fields.append(field)
                stuffed += 1
                run = 1
    covered = list(bits)
    tail = [(FIELD_STUFF_COUNT, bit) for bit in _bits_of(STUFF_COUNT_CODES[stuffed % 8], STUFF_COUNT_BITS)]
    if not iso:
        tail = []
    width = CRC17_BITS if len(data) <= SHORT_CRC_UP_TO else CRC21_BITS
    covered += [bit for _, bit in tail]
    crc = fd_crc(int("".join(map(str, covered)), 2), len(covered), width, iso)
    tail += [(FIELD_CRC, bit) for bit in _bits_of(crc, width)]
    for place, (field, bit) in enumerate(tail):
        if place % FIXED_STUFF_EVERY == 0:
            bits.append(1 - bits[-1])
            fields.append(field)
        bits.append(bit)
        fields.append(field)
    bits += [RECESSIVE] * TAIL_BITS
    fields += [FIELD_CRC_DELIMITER, FIELD_ACK_SLOT, FIELD_ACK_DELIMITER] + [FIELD_END] * 7
    return bits, fields


def _bits_of(value: int, count: int) -> list[int]:
    """The bits of a number, the highest first."""
    return [value >> position & 1 for position in range(count - 1, -1, -1)]


def fd_worst_case_phases(flags: int, iso: bool = True) -> tuple[int, int]:
    """(nominal bits, data bits) of a frame with these flags, each with the most stuff bits it can have; see `phases`.

    No frame lasts longer, because a data bit is not longer than a nominal one.
    """
    whole = fd_worst_case_bits(flags, iso)
    if not flags & FLAG_BRS:
        return whole, 0
    slow = EXTENDED_UP_TO_BRS if flags & FLAG_EXTENDED else BASE_UP_TO_BRS
    slow += (slow - 2) // (STUFF_AFTER - 1) + TAIL_BITS - 1
    return slow, whole - slow


def fd_worst_case_bits(flags: int, iso: bool = True) -> int:
    """The most bits, nominal and data together, that a frame with these flags has on the wire; see `phases`."""
    bits = (EXTENDED_UP_TO_BRS if flags & FLAG_EXTENDED else BASE_UP_TO_BRS) + ESI_AND_CODE
    bits += 8 * fd_data_length(flags)
    # a stuff bit after the first five bits and each four more; not after the last bit
    return bits + (bits - 2) // (STUFF_AFTER - 1) + int(crc_field_bits(flags, iso)) + TAIL_BITS
