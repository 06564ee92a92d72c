"""CAN FD frames bit by bit, as ISO 11898-1:2015 describes them: slow, and independent of `ranger_sim.can_bus`.

A transmitter builds the frame as a text of "0" and "1"; a receiver reads such a text bit by bit. Polynomials are texts
as well, and divided by hand. Levels: 0 dominant, 1 recessive.
"""

import dataclasses

CODES = {0: 0, 1: 1, 2: 2, 3: 3, 4: 4, 5: 5, 6: 6, 7: 7, 8: 8, 12: 9, 16: 10, 20: 11, 24: 12, 32: 13, 48: 14, 64: 15}
BYTES = {code: length for length, code in CODES.items()}
# stuff bits modulo 8 -> three bits Gray code and the parity bit, as tabled in the standard
COUNTS = {0: "0000", 1: "0011", 2: "0110", 3: "0101", 4: "1100", 5: "1111", 6: "1010", 7: "1001"}
TERMS = {17: (17, 16, 14, 13, 11, 6, 4, 3, 1, 0), 21: (21, 20, 13, 11, 7, 4, 3, 0)}


@dataclasses.dataclass(frozen=True)
class FdFrame:
    """What a node wants to send."""

    identifier: int
    data: bytes = b""
    extended: bool = False
    brs: bool = False
    esi: bool = False
    single_shot: bool = False
    buffer: int = 0
    remote: bool = False  # never; the oracle of the classic bus asks for it


def number(value, count):
    return format(value, "b").zfill(count) if count else ""


def remainder(message, width, iso=True):
    """`message` times x^width, modulo the generator. A register that begins with 100...0 is a first bit inverted."""
    rest = [int(bit) for bit in message]
    if iso and rest:
        rest[0] ^= 1
    rest += [0] * width
    for at in range(len(message)):
        if rest[at]:
            for term in TERMS[width]:
                rest[at + width - term] ^= 1
    return "".join(map(str, rest[-width:]))


def header(frame):
    """(start of frame to BRS, ESI and data length code)."""
    if frame.extended:
        text = "0" + number(frame.identifier >> 18, 11) + "11" + number(frame.identifier & 0x3FFFF, 18) + "0"
    else:
        text = "0" + number(frame.identifier, 11) + "00"
    return text + "10" + str(int(frame.brs)), str(int(frame.esi)) + number(CODES[len(frame.data)], 4)


def transmitted(frame, iso=True):
    """(text on the wire from start of frame to the end of EOF, place of BRS, place of the CRC delimiter)."""
    first, second = header(frame)
    plain = first + second + "".join(number(byte, 8) for byte in frame.data)
    out, stuffed, brs = "", 0, 0
    for at, bit in enumerate(plain):
        out += bit
        if at == len(first) - 1:
            brs = len(out) - 1
        ends_a_run = since_stuffing(out, places_of_stuff_bits(out)) == 5
        if ends_a_run and at < len(plain) - 1:
            out += "10"[int(bit)]
            stuffed += 1
    count = COUNTS[stuffed % 8] if iso else ""
    field = count + remainder(out + count, 17 if len(frame.data) <= 16 else 21, iso)
    for start in range(0, len(field), 4):
        out += "10"[int(out[-1])] + field[start : start + 4]
    delimiter = len(out)
    return out + "1" * 10, brs, delimiter


def places_of_stuff_bits(text):
    """Places of the dynamic stuff bits in a stuffed text: what follows five equal bits, which begin anew with it."""
    found, run, last = [], 0, None
    for at, bit in enumerate(text):
        if run == 5:
            found.append(at)
            run, last = 1, bit
            continue
        run = run + 1 if bit == last else 1
        last = bit
    return found


def since_stuffing(text, stuff):
    """Equal bits at the end of `text`, as far back as the last stuff bit, which counts."""
    run = 0
    for at in range(len(text) - 1, -1, -1):
        if text[at] != text[-1]:
            break
        run += 1
        if stuff and at == stuff[-1]:
            break
    return run


def received(text, iso=True):
    """The frame that a receiver reads out of a text, or the name of the error that it sees: "stuff", "form", "crc"."""
    plain, covered, run, last, stuffed, at = "", "", 0, "", 0, 0
    total = None
    while total is None or len(plain) < total:
        bit = text[at]
        at += 1
        if run == 5:
            if bit == last:
                return "stuff"
            covered += bit
            stuffed += 1
            run, last = 1, bit
            continue
        run = run + 1 if bit == last else 1
        last = bit
        plain += bit
        covered += bit
        extended = len(plain) > 13 and plain[13] == "1"
        dlc_at = 37 if extended else 18
        fdf_at = 33 if extended else 14
        if len(plain) == fdf_at + 2 and plain[fdf_at : fdf_at + 2] != "10":
            return "form"
        if total is None and len(plain) == dlc_at + 4:
            total = dlc_at + 4 + 8 * BYTES[int(plain[dlc_at : dlc_at + 4], 2)]
    length = BYTES[int(plain[dlc_at : dlc_at + 4], 2)]
    width = 17 if length <= 16 else 21
    field, wanted = "", width + (4 if iso else 0)
    while len(field) < wanted:
        if len(field) % 4 == 0:
            if text[at] == text[at - 1]:
                return "form"
            at += 1
        field += text[at]
        at += 1
    count, crc = (field[:4], field[4:]) if iso else ("", field)
    if text[at] != "1":
        return "form"
    if (iso and count != COUNTS[stuffed % 8]) or crc != remainder(covered + count, width, iso):
        return "crc"
    identifier = int(plain[1:12] + plain[14:32], 2) if extended else int(plain[1:12], 2)
    data = bytes(int(plain[i : i + 8], 2) for i in range(dlc_at + 4, total, 8))
    return FdFrame(identifier, data, extended, plain[dlc_at - 2] == "1", plain[dlc_at - 1] == "1")
