"""A classic CAN frame to the bit: CRC-15, stuffing of the actual content, length on the wire.

A frame is four integers everywhere: identifier, flags (bits 0-3 data length code, then the FLAG_* of
foundation.events), and two words: `lo` holds data bytes 0-3, `hi` bytes 4-7, both little-endian as the
transmit registers CxTDA/TDB of the LPC2194 hold them (robot.md N1.3).

Layout (ISO 11898-1): start of frame, arbitration and control field, data, CRC-15: all of these are
stuffed; then CRC delimiter, acknowledge slot and delimiter, seven bits end of frame: 10 bits unstuffed.
The three bits of intermission belong to the bus, not to the frame: `INTERMISSION_BITS`.
`_feed` holds the rules of both chains, CRC and stuffing, bit by bit; tables made from them work piece by piece.
"""

from typing import Final

import cython

from ranger_sim.foundation.events import FLAG_EXTENDED, FLAG_REMOTE, FLAG_SINGLE_SHOT

# The flags of a frame in addition to the FLAG_* of foundation.events.
LENGTH_CODE: Final = 15  # bits 0-3
EIGHT_BYTES: Final = 8  # the flags of a standard data frame of eight bytes, as the robot sends them
SENDABLE: Final = 0x7F  # all flags that a request may have: length code, remote, single shot, extended
RECEIVERS_SEE: Final = 0x75F  # the part of these on the wire, and of CAN FD frames: no single shot

HIGHEST_STANDARD: Final = 0x7FF  # identifiers of 11 bits
HIGHEST_EXTENDED: Final = 0x1FFFFFFF  # identifiers of 29 bits

INTERMISSION_BITS: Final = 3  # ISO 11898-1: recessive bits between two frames
TAIL_BITS: Final = 10  # CRC delimiter, ACK slot, ACK delimiter, 7 bits end of frame
ACK_DELIMITER_FROM_END: Final = 8  # the ACK delimiter is the eighth bit from the end
STANDARD_BITS: Final = 44  # a frame without data and without stuff bits
EXTENDED_BITS: Final = 64
ARBITRATION_END: Final = 17  # bits up to RTR and IDE, with the most stuff bits that they can have: 14 + 3
EXTENDED_ARBITRATION_END: Final = 41  # the same up to the RTR of an extended frame: 33 + 8

CRC_POLYNOMIAL: Final = 0x4599  # x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1 (ISO 11898-1)
CRC_BITS: Final = 15
CRC_MASK: Final = 0x7FFF

# Result of `measure`: bits 0-15 the length, from bit 16 the CRC.
MEASURED_BITS: Final = 0xFFFF
MEASURED_CRC_SHIFT: Final = 16

DOMINANT: Final = 0
RECESSIVE: Final = 1

# Positions in a frame: codes of the error code capture register, LPC2194 CxICR bits 16-20 (as the SJA1000's).
FIELD_ID_28_21: Final = 2
FIELD_START: Final = 3
FIELD_SRTR: Final = 4
FIELD_IDE: Final = 5
FIELD_ID_20_18: Final = 6
FIELD_ID_17_13: Final = 7
FIELD_CRC: Final = 8
FIELD_R0: Final = 9
FIELD_DATA: Final = 10
FIELD_DLC: Final = 11
FIELD_RTR: Final = 12
FIELD_R1: Final = 13
FIELD_ID_4_0: Final = 14
FIELD_ID_12_5: Final = 15
FIELD_CRC_DELIMITER: Final = 24
FIELD_ACK_SLOT: Final = 25
FIELD_END: Final = 26
FIELD_ACK_DELIMITER: Final = 27
# the same, outside frames
FIELD_ACTIVE_FLAG: Final = 17  # active error flag
FIELD_INTERMISSION: Final = 18
FIELD_TOLERATED: Final = 19  # dominant bits behind a flag
FIELD_PASSIVE_FLAG: Final = 22  # passive error flag
FIELD_DELIMITER: Final = 23  # of an error or overload frame
FIELD_OVERLOAD_FLAG: Final = 28

# Both chains in one number, as `_feed` takes and returns it: bits 0-14 the CRC register; bits 15-17 the state of
# the stuffing, level * 4 + run - 1 with run 1 ... 4 equal bits seen last; from bit 18 the stuff bits so far.
STATE_SHIFT: Final = 15
STATE_MASK: Final = 7
RUN_MASK: Final = 3
LEVEL_SHIFT: Final = 17
STUFFED_SHIFT: Final = 18
IDLE: Final = 0x20000  # before a frame: an empty register, and a recessive bit, so that the start of frame begins a run
STUFF_AFTER: Final = 5  # ISO 11898-1: equal bits that are followed by their complement

# The frame of eight bytes, which goes through tables.
STANDARD_HEADER_BITS: Final = 19  # start of frame ... data length code
DATA_BITS: Final = 64
STATES: Final = 8
BYTES: Final = 256  # values of a byte
TABLE_BYTES: Final = 2048  # eight places of BYTES
STANDARD_IDENTIFIERS: Final = 2048
# an entry of BEGUN
BEGUN_CRC_SHIFT: Final = 16
BEGUN_STUFFED_SHIFT: Final = 8
BEGUN_STUFFED_MASK: Final = 0xFF00
# an entry of STUFF: eight steps of eight bits; a step: bits 3-5 the next state, bits 6-7 stuff bits
STEP_STATE_SHIFT: Final = 3
STEP_STATE_MASK: Final = 56
STEP_STUFFED_SHIFT: Final = 6
STEP_STUFFED_MASK: Final = 192
STEP_PLACE_MASK: Final = 63


@cython.cfunc
@cython.exceptval(check=False)
def _feed(chain: cython.longlong, value: cython.longlong, count: cython.longlong) -> cython.longlong:
    """Both chains after the `count` low bits of `value`, the highest of them first: the rules, bit by bit.

    The fifth equal bit is followed at once by its complement, which begins a new run.
    """
    register: cython.longlong = chain & CRC_MASK
    run: cython.longlong = (chain >> STATE_SHIFT & RUN_MASK) + 1
    level: cython.longlong = chain >> LEVEL_SHIFT & 1
    stuffed: cython.longlong = chain >> STUFFED_SHIFT
    position: cython.longlong
    bit: cython.longlong
    feedback: cython.longlong
    for position in range(count - 1, -1, -1):
        bit = value >> position & 1
        feedback = bit ^ register >> (CRC_BITS - 1)
        register = register << 1 & CRC_MASK
        if feedback:
            register ^= CRC_POLYNOMIAL
        run = run + 1 if bit == level else 1
        level = bit
        if run == STUFF_AFTER:
            stuffed += 1
            level = 1 - bit
            run = 1
    return stuffed << STUFFED_SHIFT | level << LEVEL_SHIFT | (run - 1) << STATE_SHIFT | register


@cython.cfunc
@cython.exceptval(check=False)
def _state(chain: cython.longlong) -> cython.longlong:
    """The state of the stuffing, 0 ... 7."""
    return chain >> STATE_SHIFT & STATE_MASK


@cython.cfunc
@cython.exceptval(check=False)
def _header(identifier: cython.longlong, flags: cython.longlong) -> cython.longlong:
    """The bits from the start of frame to the data length code: 19, extended 39."""
    low: cython.longlong = (flags & FLAG_REMOTE) << 2 | (flags & LENGTH_CODE)
    if flags & FLAG_EXTENDED:  # SOF id28-18 SRR IDE id17-0 RTR r1 r0 DLC
        return ((identifier >> 18 & 0x7FF) << 20 | 0xC0000 | (identifier & 0x3FFFF)) << 7 | low
    return (identifier & 0x7FF) << 7 | low  # SOF id10-0 RTR IDE r0 DLC


@cython.cfunc
@cython.exceptval(check=False)
def _measure_bitwise(
    identifier: cython.longlong, flags: cython.longlong, lo: cython.longlong, hi: cython.longlong
) -> cython.longlong:
    """`measure` of any frame by the rules alone."""
    place: cython.longlong
    crc: cython.longlong
    length: cython.longlong = flags & LENGTH_CODE
    bits: cython.longlong = EXTENDED_BITS if flags & FLAG_EXTENDED else STANDARD_BITS
    chain: cython.longlong = _feed(IDLE, _header(identifier, flags), bits - CRC_BITS - TAIL_BITS)
    if length > 8:
        length = 8  # codes 9-15 also mean eight bytes (ISO 11898-1)
    if flags & FLAG_REMOTE:
        length = 0
    for place in range(length):
        chain = _feed(chain, (lo if place < 4 else hi) >> 8 * (place & 3), 8)
    crc = chain & CRC_MASK
    chain = _feed(chain, crc, CRC_BITS)
    return crc << MEASURED_CRC_SHIFT | (bits + 8 * length + (chain >> STUFFED_SHIFT))


# A standard frame of eight bytes, which nearly every frame is, goes through tables, byte by byte. The CRC is linear:
# each byte adds the table entry of its position. For the stuffing a byte is a map from the state before it to the state
# after it.
#
# Compiled: CRC_OF_BYTE by place * 256 + byte. STUFF by byte, a map that is read while the state is still being found,
# by eight bits per state: next state << 3 | stuff bits << 6. BEGUN by identifier, of the header: CRC << 16 | stuff
# bits << 8 | state << 3.
#
# Interpreted, the states are lists: by byte the state after it; the last item is the number of stuff bits so far.
# CRC_LISTS: by place, by byte. WALK: by stuff bits, by state. WALKS: by identifier, as `_begin`.
CRC_OF_BYTE: cython.short[TABLE_BYTES] = [0] * TABLE_BYTES
STUFF: cython.ulonglong[BYTES] = [0] * BYTES
BEGUN: cython.int[STANDARD_IDENTIFIERS] = [0] * STANDARD_IDENTIFIERS
CRC_LISTS: list = []
WALK: list = []
WALKS: dict = {}


def _fill_tables() -> None:
    """The tables of the compiled `measure`."""
    place: cython.longlong
    byte: cython.longlong
    state: cython.longlong
    identifier: cython.longlong
    crc: cython.longlong
    stuffed: cython.longlong
    chain: cython.longlong
    steps: cython.ulonglong
    step: cython.ulonglong
    for byte in range(BYTES):
        for place in range(8):
            CRC_OF_BYTE[place * BYTES + byte] = _feed(_feed(0, byte, 8), 0, 56 - 8 * place) & CRC_MASK
        steps = 0
        for state in range(STATES):
            chain = _feed(state << STATE_SHIFT, byte, 8)
            step = (chain >> STUFFED_SHIFT) << STEP_STUFFED_SHIFT | _state(chain) << STEP_STATE_SHIFT
            steps |= step << (8 * state)
        STUFF[byte] = steps
    for identifier in range(STANDARD_IDENTIFIERS):
        chain = _feed(IDLE, _header(identifier, EIGHT_BYTES), STANDARD_HEADER_BITS)
        crc = _feed(chain, 0, DATA_BITS) & CRC_MASK
        stuffed = chain >> STUFFED_SHIFT
        BEGUN[identifier] = crc << BEGUN_CRC_SHIFT | stuffed << BEGUN_STUFFED_SHIFT | _state(chain) << STEP_STATE_SHIFT


def _fill_lists() -> None:
    """The lists of the interpreted `measure`."""
    for place in range(8):
        CRC_LISTS.append([_feed(_feed(0, byte, 8), 0, 56 - 8 * place) & CRC_MASK for byte in range(BYTES)])
    steps = [[_feed(state << STATE_SHIFT, byte, 8) for byte in range(BYTES)] for state in range(STATES)]
    most = worst_case_bits(EIGHT_BYTES) - unstuffed_bits(EIGHT_BYTES)
    WALK.extend([[] for _ in range(STATES)] for _ in range(most + 1))
    for stuffed, states in enumerate(WALK):
        for state, branches in enumerate(states):
            for after in steps[state]:
                branches.append(WALK[min(stuffed + (after >> STUFFED_SHIFT), most)][_state(after)])
            branches.append(stuffed)


def _begin(identifier):
    """CRC of the header of a standard frame of eight bytes followed by 64 bits 0, and its end on the walk."""
    chain = _feed(IDLE, _header(identifier, EIGHT_BYTES), STANDARD_HEADER_BITS)
    WALKS[identifier] = (_feed(chain, 0, DATA_BITS) & CRC_MASK, WALK[chain >> STUFFED_SHIFT][_state(chain)])
    return WALKS[identifier]


@cython.cfunc
@cython.exceptval(check=False)
@cython.boundscheck(False)  # bytes are masked to 8 bits
@cython.wraparound(False)
def _measure_by_bytes(identifier: cython.longlong, lo: cython.longlong, hi: cython.longlong) -> cython.longlong:
    """`measure` of a standard frame of eight bytes, compiled."""
    crc: cython.longlong = BEGUN[identifier] >> BEGUN_CRC_SHIFT
    # the six low bits of `steps`: position of the next state in the next map
    steps: cython.ulonglong = BEGUN[identifier] & STEP_STATE_MASK
    # times 64, as in the maps
    stuffed: cython.ulonglong = (BEGUN[identifier] & BEGUN_STUFFED_MASK) >> (BEGUN_STUFFED_SHIFT - STEP_STUFFED_SHIFT)
    data: cython.ulonglong = hi << 32 | lo
    byte: cython.ulonglong
    place: cython.longlong
    for place in range(8):
        byte = data & 0xFF
        data >>= 8
        crc ^= CRC_OF_BYTE[place * BYTES + byte]
        steps = STUFF[byte] >> (steps & STEP_PLACE_MASK)
        stuffed += steps & STEP_STUFFED_MASK
    steps = STUFF[crc >> 7] >> (steps & STEP_PLACE_MASK)
    stuffed += steps & STEP_STUFFED_MASK
    # the last byte is filled up with the complement of the last bit, which never adds a stuff bit
    steps = STUFF[(crc << 1 & 0xFE) | (crc & 1 ^ 1)] >> (steps & STEP_PLACE_MASK)
    stuffed += steps & STEP_STUFFED_MASK
    return crc << MEASURED_CRC_SHIFT | (STANDARD_BITS + DATA_BITS + (stuffed >> STEP_STUFFED_SHIFT))


@cython.ccall
@cython.exceptval(check=False)
def measure(
    identifier: cython.longlong, flags: cython.longlong, lo: cython.longlong, hi: cython.longlong
) -> cython.longlong:
    """CRC-15 and length of a frame with exactly this content: crc << 16 | bits.

    Bits: from start of frame to the end of EOF, stuff bits included, intermission not.
    """
    if identifier >> 11 or flags & ~FLAG_SINGLE_SHOT != EIGHT_BYTES:  # single shot is not visible on the wire
        return _measure_bitwise(identifier, flags, lo, hi)
    if cython.compiled:
        return _measure_by_bytes(identifier, lo, hi)
    else:
        crc, walk = WALKS.get(identifier) or _begin(identifier)
        a, b, c, d, e, f, g, h = (hi << 32 | lo).to_bytes(8, "little")
        t, u, v, w, x, y, z, s = CRC_LISTS
        crc ^= t[a] ^ u[b] ^ v[c] ^ w[d] ^ x[e] ^ y[f] ^ z[g] ^ s[h]
        # the last byte is filled up with the complement of the last bit, which never adds a stuff bit
        stuffed = walk[a][b][c][d][e][f][g][h][crc >> 7][(crc << 1 & 0xFE) | (crc & 1 ^ 1)][-1]
        return crc << MEASURED_CRC_SHIFT | (STANDARD_BITS + DATA_BITS + stuffed)


@cython.ccall
@cython.exceptval(check=False)
def crc15(
    identifier: cython.longlong, flags: cython.longlong, lo: cython.longlong, hi: cython.longlong
) -> cython.longlong:
    """CRC-15 over start of frame ... data, 0 ... 0x7FFF (ISO 11898-1)."""
    return measure(identifier, flags, lo, hi) >> MEASURED_CRC_SHIFT


@cython.ccall
@cython.exceptval(check=False)
def frame_bits(
    identifier: cython.longlong, flags: cython.longlong, lo: cython.longlong, hi: cython.longlong
) -> cython.longlong:
    """Bits on the wire from start of frame to the end of EOF, stuff bits included, intermission not.

    44 + 8 per byte (extended 64) without stuffing, so 108 for the robot's frames (robot.md N1.2).
    """
    return measure(identifier, flags, lo, hi) & MEASURED_BITS


@cython.boundscheck(False)  # all five are of one length
@cython.wraparound(False)
def fill_frame_bits(identifiers, flags, lows, highs, bits) -> None:
    """`frame_bits` of many frames into `bits`: five buffers of 64-bit integers, of one length."""
    if not cython.compiled:  # numpy integers are not Python integers
        identifiers, flags, lows, highs = (memoryview(each).tolist() for each in (identifiers, flags, lows, highs))
    ids: cython.longlong[::1] = identifiers
    flag: cython.longlong[::1] = flags
    low: cython.longlong[::1] = lows
    high: cython.longlong[::1] = highs
    found: cython.longlong[::1] = bits
    place: cython.longlong
    for place in range(len(found)):
        found[place] = measure(ids[place], flag[place], low[place], high[place]) & MEASURED_BITS


@cython.ccall
@cython.exceptval(check=False)
def arbitration_key(identifier: cython.longlong, flags: cython.longlong) -> cython.longlong:
    """The arbitration field as a 32-bit number in the order of its bits: the lower key wins the bus.

    Standard: id10-0, RTR, IDE = 0. Extended: id28-18, SRR = 1, IDE = 1, id17-0, RTR. So a standard frame
    beats an extended one with the same first 11 bits, and data beats remote (ISO 11898-1).
    """
    remote: cython.longlong = flags >> 4 & 1
    if flags & FLAG_EXTENDED:
        return (identifier >> 18 & 0x7FF) << 21 | 0x180000 | (identifier & 0x3FFFF) << 1 | remote
    return (identifier & 0x7FF) << 21 | remote << 20


def data_length(flags: int) -> int:
    """Data bytes that a classic frame with these flags carries, 0 ... 8 (CAN FD: `fd_frame.fd_data_length`)."""
    return 0 if flags & FLAG_REMOTE else min(flags & LENGTH_CODE, 8)


def unstuffed_bits(flags: int) -> int:
    """Length without any stuff bit and without intermission: 108 for 8 bytes, standard."""
    return (EXTENDED_BITS if flags & FLAG_EXTENDED else STANDARD_BITS) + 8 * data_length(flags)


def worst_case_bits(flags: int) -> int:
    """Longest possible length with stuffing, without intermission: 132 for 8 bytes, standard.

    The stuffed region has g = 34 (extended 54) + 8n bits; a stuff bit counts into the next run, so the
    first may come after 5 and each further one after 4 more: (g - 1) // 4.
    """
    length = unstuffed_bits(flags)
    return length + (length - TAIL_BITS - 1) // 4


def wire(identifier: int, flags: int, lo: int, hi: int) -> tuple[list[int], list[int]]:
    """The bits of a frame as they pass on the wire and, for each, its field (FIELD_*), stuff bits included.

    The acknowledge slot is given as the sender drives it, recessive. Slow and simple: for errors and for displaying a
    frame.
    """
    parts: list[tuple[int, int, int]] = [(FIELD_START, 1, 0)]  # field, number of bits, value
    remote = flags >> 4 & 1
    if flags & FLAG_EXTENDED:
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
    parts.append((FIELD_CRC, CRC_BITS, crc15(identifier, flags, lo, hi)))
    bits: list[int] = []
    fields: list[int] = []
    run = 0
    for field, count, value in parts:
        for position in range(count - 1, -1, -1):
            bit = value >> position & 1
            run = run + 1 if bits and bits[-1] == bit else 1
            bits.append(bit)
            fields.append(field)
            if run == STUFF_AFTER:
                bits.append(1 - bit)
                fields.append(field)
                run = 1
    bits += [RECESSIVE] * TAIL_BITS
    fields += [FIELD_CRC_DELIMITER, FIELD_ACK_SLOT, FIELD_ACK_DELIMITER] + [FIELD_END] * 7
    return bits, fields


def first_difference(one: list[int], other: list[int]) -> int:
    """First bit in which two frames differ on the wire, or -1 when they are equal."""
    if one == other:
        return -1
    return next(place for place, levels in enumerate(zip(one, other, strict=False)) if levels[0] != levels[1])


if cython.compiled:
    _fill_tables()
else:
    _fill_lists()
