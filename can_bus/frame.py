"""A classic CAN frame to the bit: CRC-15, stuffing of the actual content, length on the wire.

A frame is four integers everywhere: identifier, flags (bits 0-3 data length code, then the FLAG_* of
foundation.events), and two words: `lo` holds data bytes 0-3, `hi` bytes 4-7, both little-endian as the
transmit registers CxTDA/TDB of the LPC2194 hold them (facts network-and-boards 1.3).

Layout (ISO 11898-1): start of frame, arbitration and control field, data, CRC-15: all of these are
stuffed; then CRC delimiter, acknowledge slot and delimiter, seven bits end of frame: 10 bits unstuffed.
The three bits of intermission belong to the bus, not to the frame: `INTERMISSION_BITS`.
Both chains, CRC and stuffing, go byte by byte through tables; the tables are made from the bitwise rules.
"""

import cython

INTERMISSION_BITS = 3  # ISO 11898-1: recessive bits between two frames
TAIL_BITS = 10  # CRC delimiter, ACK slot, ACK delimiter, 7 bits end of frame
CRC_POLYNOMIAL = 0x4599  # x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1 (ISO 11898-1)

DOMINANT = 0
RECESSIVE = 1

# Where in a frame: codes of the error code capture register, LPC2194 CxICR bits 16-20 (as the SJA1000's).
FIELD_ID_28_21 = 2
FIELD_START = 3
FIELD_SRTR = 4
FIELD_IDE = 5
FIELD_ID_20_18 = 6
FIELD_ID_17_13 = 7
FIELD_CRC = 8
FIELD_R0 = 9
FIELD_DATA = 10
FIELD_DLC = 11
FIELD_RTR = 12
FIELD_R1 = 13
FIELD_ID_4_0 = 14
FIELD_ID_12_5 = 15
FIELD_CRC_DELIMITER = 24
FIELD_ACK_SLOT = 25
FIELD_END = 26
FIELD_ACK_DELIMITER = 27


def _crc_of_byte(byte: int, zeros: int) -> int:
    """CRC register after a byte (most significant bit first) and `zeros` zero bits entered it empty."""
    register = 0
    for position in range(7, -1 - zeros, -1):
        feedback = (byte >> position & 1 if position >= 0 else 0) ^ (register >> 14 & 1)
        register = register << 1 & 0x7FFF
        if feedback:
            register ^= CRC_POLYNOMIAL
    return register


def _stuff_of_byte(state: int, byte: int) -> int:
    """Stuffing of one byte: next state << 8 | stuff bits inserted.

    A state is level * 4 + run - 1 with run 1..4 equal bits seen last: the fifth equal bit is followed at
    once by its complement, which begins a run of its own.
    """
    level = state >> 2
    run = (state & 3) + 1
    inserted = 0
    for position in range(7, -1, -1):
        bit = byte >> position & 1
        if bit == level:
            run += 1
        else:
            level = bit
            run = 1
        if run == 5:
            inserted += 1
            level = 1 - level
            run = 1
    return (level * 4 + run - 1) << 8 | inserted


# CRC_n: a byte that n - 1 further bytes follow; the CRC is linear, so four bytes go in at once.
# HEADER_CRC, HEADER_STUFF: both chains after the start of frame and the upper ten bits of a standard identifier.
# Compiled, the tables are C arrays (declared in the .pxd).
if not cython.compiled:
    CRC_1, CRC_2, CRC_3, CRC_4 = ([0] * 256 for _ in range(4))
    STUFF_STEP = [0] * 2048
    HEADER_CRC, HEADER_STUFF = ([0] * 1024 for _ in range(2))


def _fill_tables() -> None:
    for byte in range(256):
        CRC_1[byte] = _crc_of_byte(byte, 0)
        CRC_2[byte] = _crc_of_byte(byte, 8)
        CRC_3[byte] = _crc_of_byte(byte, 16)
        CRC_4[byte] = _crc_of_byte(byte, 24)
        for state in range(8):
            STUFF_STEP[state * 256 + byte] = _stuff_of_byte(state, byte)
    for upper in range(1024):
        # SOF id10-9 | id8-1, filled up in front as `measure` says
        HEADER_CRC[upper] = CRC_2[upper >> 8] ^ CRC_1[upper & 0xFF]
        first = STUFF_STEP[upper >> 8 | 0xA8]
        HEADER_STUFF[upper] = STUFF_STEP[(first & 0x700) | (upper & 0xFF)] + (first & 0xFF)


_fill_tables()


@cython.boundscheck(False)  # table places are masked to 8, 10 and 11 bits: no index can leave its table
@cython.wraparound(False)
def measure(
    identifier: cython.longlong, flags: cython.longlong, lo: cython.longlong, hi: cython.longlong
) -> cython.longlong:
    """CRC-15 and length of a frame with this very content: crc << 16 | bits, in one pass over the bytes.

    Bits: from start of frame to the end of EOF, stuff bits included, intermission not.
    The header is 19 bits (extended: 39). Its first byte is filled up in front: zeros leave an empty CRC
    register empty, and for the stuffing an alternating pattern that ends recessive, so that the dominant
    start of frame begins a new run.
    """
    crc: cython.longlong
    stuff: cython.longlong
    total: cython.longlong
    byte: cython.longlong
    second: cython.longlong
    third: cython.longlong
    fourth: cython.longlong
    word: cython.longlong
    bits: cython.longlong
    length: cython.longlong = flags & 15
    if length > 8:
        length = 8  # codes 9-15 also mean eight bytes (ISO 11898-1)
    if flags & 16:  # FLAG_REMOTE
        length = 0
    bits = 44 + 8 * length
    if flags & 64:  # FLAG_EXTENDED: SOF id28-23 | id22-18 SRR IDE id17 | id16-9 | id8-1 | id0 RTR r1 r0 DLC
        bits += 20
        byte = identifier >> 23 & 0x3F
        crc = CRC_1[byte]
        stuff = STUFF_STEP[byte | 0x80]
        total = stuff
        byte = (identifier >> 15 & 0xF8) | 6 | (identifier >> 17 & 1)
        crc = ((crc << 8) ^ CRC_1[(crc >> 7) ^ byte]) & 0x7FFF
        stuff = STUFF_STEP[(stuff & 0x700) | byte]
        total += stuff
        byte = identifier >> 9 & 0xFF
        crc = ((crc << 8) ^ CRC_1[(crc >> 7) ^ byte]) & 0x7FFF
        stuff = STUFF_STEP[(stuff & 0x700) | byte]
        total += stuff
        byte = identifier >> 1 & 0xFF
        crc = ((crc << 8) ^ CRC_1[(crc >> 7) ^ byte]) & 0x7FFF
        stuff = STUFF_STEP[(stuff & 0x700) | byte]
        total += stuff
    else:  # SOF id10-9 | id8-1 | id0 RTR IDE r0 DLC
        crc = HEADER_CRC[identifier >> 1 & 0x3FF]
        stuff = HEADER_STUFF[identifier >> 1 & 0x3FF]
        total = stuff
    byte = (identifier << 7 & 0x80) | (flags << 2 & 0x40) | (flags & 15)
    crc = ((crc << 8) ^ CRC_1[(crc >> 7) ^ byte]) & 0x7FFF
    stuff = STUFF_STEP[(stuff & 0x700) | byte]
    total += stuff
    word = lo
    while length > 0:
        if length >= 4:
            byte = word & 0xFF
            second = word >> 8 & 0xFF
            third = word >> 16 & 0xFF
            fourth = word >> 24 & 0xFF
            crc = CRC_4[(crc >> 7) ^ byte] ^ CRC_3[(crc << 1 & 0xFF) ^ second] ^ CRC_2[third] ^ CRC_1[fourth]
            stuff = STUFF_STEP[(stuff & 0x700) | byte]
            total += stuff
            stuff = STUFF_STEP[(stuff & 0x700) | second]
            total += stuff
            stuff = STUFF_STEP[(stuff & 0x700) | third]
            total += stuff
            stuff = STUFF_STEP[(stuff & 0x700) | fourth]
            total += stuff
            length -= 4
            word = hi
        else:
            byte = word & 0xFF
            crc = ((crc << 8) ^ CRC_1[(crc >> 7) ^ byte]) & 0x7FFF
            stuff = STUFF_STEP[(stuff & 0x700) | byte]
            total += stuff
            word = word >> 8
            length -= 1
    stuff = STUFF_STEP[(stuff & 0x700) | crc >> 7]
    total += stuff
    # the last 7 bits, filled up behind with the complement of the last one, which never adds a stuff bit
    total += STUFF_STEP[(stuff & 0x700) | (crc << 1 & 0xFE) | (crc & 1 ^ 1)]
    # the states summed above bit 8 do not matter; at most 29 stuff bits
    return crc << 16 | (bits + (total & 0xFF))


def crc15(
    identifier: cython.longlong, flags: cython.longlong, lo: cython.longlong, hi: cython.longlong
) -> cython.longlong:
    """CRC-15 over start of frame ... data, 0 ... 0x7FFF (ISO 11898-1)."""
    return measure(identifier, flags, lo, hi) >> 16


def stuff_bits(
    identifier: cython.longlong, flags: cython.longlong, lo: cython.longlong, hi: cython.longlong
) -> cython.longlong:
    """Number of stuff bits of this very content (one after every five equal bits, CRC included)."""
    return (measure(identifier, flags, lo, hi) & 0xFFFF) - unstuffed_bits(flags)


def frame_bits(
    identifier: cython.longlong, flags: cython.longlong, lo: cython.longlong, hi: cython.longlong
) -> cython.longlong:
    """Bits on the wire from start of frame to the end of EOF, stuff bits included, intermission not.

    44 + 8 per byte (extended 64) without stuffing, so 108 for the robot's frames (facts 1.2).
    """
    return measure(identifier, flags, lo, hi) & 0xFFFF


def arbitration_key(identifier: cython.longlong, flags: cython.longlong) -> cython.longlong:
    """The arbitration field as a 32-bit number in the order of its bits: the lower key wins the bus.

    Standard: id10-0, RTR, IDE = 0. Extended: id28-18, SRR = 1, IDE = 1, id17-0, RTR. So a standard frame
    beats an extended one with the same first 11 bits, and data beats remote (ISO 11898-1).
    """
    remote: cython.longlong = flags >> 4 & 1
    if flags & 64:  # FLAG_EXTENDED
        return (identifier >> 18 & 0x7FF) << 21 | 0x180000 | (identifier & 0x3FFFF) << 1 | remote
    return (identifier & 0x7FF) << 21 | remote << 20


def data_length(flags: int) -> int:
    """Data bytes that a frame with these flags carries, 0 ... 8."""
    return 0 if flags & 16 else min(flags & 15, 8)


def unstuffed_bits(flags: int) -> int:
    """Length without any stuff bit and without intermission: 108 for 8 bytes, standard."""
    return (64 if flags & 64 else 44) + 8 * data_length(flags)


def worst_case_bits(flags: int) -> int:
    """Longest possible length with stuffing, without intermission: 132 for 8 bytes, standard.

    The stuffed region has g = 34 (extended 54) + 8n bits; a stuff bit counts into the next run, so the
    first may come after 5 and each further one after 4 more: (g - 1) // 4.
    """
    length = unstuffed_bits(flags)
    return length + (length - TAIL_BITS - 1) // 4


def wire(identifier: int, flags: int, lo: int, hi: int) -> tuple[list[int], list[int]]:
    """The bits of a frame as they pass on the wire and, for each, its field (FIELD_*), stuff bits included.

    The acknowledge slot is given as the sender drives it, recessive. Slow and plain: for errors and for
    people who want to look at a frame.
    """
    parts: list[tuple[int, int, int]] = [(FIELD_START, 1, 0)]  # field, number of bits, value
    remote = flags >> 4 & 1
    if flags & 64:
        parts += [
            (FIELD_ID_28_21, 8, identifier >> 21),
            (FIELD_ID_20_18, 3, identifier >> 18),
            (FIELD_SRTR, 1, 1),
            (FIELD_IDE, 1, 1),
            (FIELD_ID_17_13, 5, identifier >> 13),
            (FIELD_ID_12_5, 8, identifier >> 5),
            (FIELD_ID_4_0, 5, identifier),
            (FIELD_RTR, 1, remote),
            (FIELD_R1, 1, 0),
        ]
    else:
        parts += [
            (FIELD_ID_28_21, 8, identifier >> 3),
            (FIELD_ID_20_18, 3, identifier),
            (FIELD_SRTR, 1, remote),
            (FIELD_IDE, 1, 0),
        ]
    parts += [(FIELD_R0, 1, 0), (FIELD_DLC, 4, flags)]
    for index in range(data_length(flags)):
        parts.append((FIELD_DATA, 8, (lo if index < 4 else hi) >> 8 * (index & 3)))
    parts.append((FIELD_CRC, 15, crc15(identifier, flags, lo, hi)))
    bits: list[int] = []
    fields: list[int] = []
    run = 0
    for field, count, value in parts:
        for position in range(count - 1, -1, -1):
            bit = value >> position & 1
            run = run + 1 if bits and bits[-1] == bit else 1
            bits.append(bit)
            fields.append(field)
            if run == 5:
                bits.append(1 - bit)
                fields.append(field)
                run = 1
    bits += [RECESSIVE] * TAIL_BITS
    fields += [FIELD_CRC_DELIMITER, FIELD_ACK_SLOT, FIELD_ACK_DELIMITER] + [FIELD_END] * 7
    return bits, fields
