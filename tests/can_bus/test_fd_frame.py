"""CAN FD frames to the bit: known answers, an independent oracle, and the oracle's own answers on paper."""

import pytest

from ranger_sim.can_bus.fd_frame import (
    FIELD_BRS,
    LENGTHS,
    PHASE_MASK,
    PHASE_SHIFT,
    STUFF_COUNT_CODES,
    fault_of_fd_flags,
    fd_crc,
    fd_wire,
    fd_worst_case_bits,
    length_code,
    phases,
)
from ranger_sim.can_bus.frame import FIELD_CRC_DELIMITER
from ranger_sim.foundation.events import FLAG_BRS, FLAG_ERROR, FLAG_EXTENDED, FLAG_FD, FLAG_REMOTE, FLAG_SINGLE_SHOT

from . import fd_comparison as comparison
from . import fd_oracle as oracle

CHECK = int.from_bytes(b"123456789", "big")  # the message of the catalogue of parametrised CRC algorithms
EMPTY = FLAG_FD


def text_of(*frame):
    return "".join(map(str, fd_wire(*frame)[0]))


@pytest.mark.parametrize(("width", "check"), [(17, 0x04F03), (21, 0x0ED841)])
def test_crcs_have_the_check_values_of_the_catalogue(width, check):
    assert fd_crc(CHECK, 72, width, iso=False) == check
    assert int(oracle.remainder(oracle.number(CHECK, 72), width, iso=False), 2) == check


@pytest.mark.parametrize("width", [17, 21])
def test_the_iso_crc_begins_with_a_one_in_its_highest_bit(width):
    assert fd_crc(0, 0, width) == 1 << (width - 1)
    # the first bit of a message meets the highest bit of the register: inverting it undoes the one there
    assert fd_crc(CHECK ^ 1 << 71, 72, width) == fd_crc(CHECK, 72, width, iso=False)


def test_a_crc_is_zero_after_itself():
    assert fd_crc(CHECK << 17 | fd_crc(CHECK, 72, 17), 72 + 17, 17) == 0
    assert fd_crc(CHECK << 21 | fd_crc(CHECK, 72, 21), 72 + 21, 21) == 0


def test_the_stuff_count_is_a_gray_code_with_even_parity():
    for count, code in enumerate(STUFF_COUNT_CODES):
        assert code >> 1 == count ^ count >> 1
        assert code.bit_count() % 2 == 0
        assert format(code, "04b") == oracle.COUNTS[count]


def test_an_empty_base_frame_is_written_out_by_hand():
    """Identifier 0x555: no two bits of it are equal. Of RRS and IDE on: 00 1 0 1 0 0000, so five bits 0 (ESI and the
    code) end the frame's stuffed part; a fixed stuff bit follows them, and no dynamic one."""
    text = text_of(0x555, EMPTY | FLAG_BRS, b"")
    assert text[:22] == "0" + "10101010101" + "00" + "10" + "1" + "0" + "0000"
    assert text[22:28] == "1" + "0000" + "1"  # fixed, no stuff bits, fixed
    crc = fd_crc(int(text[:22] + "0000", 2), 26, 17)
    assert text[28:49] == with_fixed_bits(format(crc, "017b"), 21)
    assert text[49:] == "1" * 10


def with_fixed_bits(crc, length):
    """A CRC with a complement after each fourth bit."""
    out = ""
    for place, bit in enumerate(crc):
        out += bit
        if place % 4 == 3:
            out += "1" if bit == "0" else "0"
    assert len(out) == length
    return out


def test_stuff_bits_are_counted_and_covered_by_the_crc():
    """Identifier 0: 0 00000000000 00 1 0 0 0 0000: stuff bits after the fifth and the tenth bit 0, and after five of
    the six that follow FDF."""
    text = text_of(0, EMPTY, b"")
    assert text[:25] == "00000" + "1" + "00000" + "1" + "0000" + "1" + "00000" + "1" + "00"
    assert text[25:31] == "1" + "0101" + "0"  # three stuff bits: Gray 010, parity 1
    crc = fd_crc(int(text[:25] + "0101", 2), 29, 17)
    assert text[31:52] == with_fixed_bits(format(crc, "017b"), 21)


def test_a_non_iso_frame_has_no_stuff_count_and_its_crc_begins_with_zeros():
    iso, early = text_of(0x555, EMPTY | FLAG_BRS, b""), text_of(0x555, EMPTY | FLAG_BRS, b"", False)
    assert len(iso) - len(early) == 5  # four bits and a fixed stuff bit
    crc = fd_crc(int(iso[:22], 2), 22, 17, iso=False)
    assert early[23:44] == with_fixed_bits(format(crc, "017b"), 21)


@pytest.mark.parametrize(("length", "bits"), [(16, 27), (20, 32)])
def test_crcs_of_more_than_16_bytes_have_21_bits(length, bits):
    frame = oracle.FdFrame(0x555, b"\x55" * length, brs=True)
    text, _, delimiter = oracle.transmitted(frame)
    stuffed_part = 22 + 8 * length
    assert delimiter - stuffed_part - len(oracle.places_of_stuff_bits(text[:stuffed_part])) == bits
    assert text == text_of(0x555, comparison.fd_flags_of(frame), frame.data)


def test_length_codes_of_fd_frames():
    assert [length_code(length) for length in LENGTHS] == list(range(16))
    assert [length_code(length) for length in (9, 13, 17, 21, 25, 33, 49)] == [9, 10, 11, 12, 13, 14, 15]
    with pytest.raises(ValueError, match="65 data bytes"):
        length_code(65)


def test_a_frame_of_64_bytes_lasts_as_long_as_its_two_rates_say():
    """0x555, 64 bytes 0x55: up to BRS 17 bits without stuff bits; then ESI, 4 of the code, which with ESI has at most
    four equal bits, 512 data bits, 32 of the CRC field and the delimiter: 550 at the data rate; then 9 nominal ones."""
    packed = phases(0x555, 15 | FLAG_FD | FLAG_BRS, b"\x55" * 64)
    assert (packed & PHASE_MASK, packed >> PHASE_SHIFT) == (17 + 9, 1 + 4 + 512 + 32 + 1)
    without = phases(0x555, 15 | FLAG_FD, b"\x55" * 64)
    assert (without & PHASE_MASK, without >> PHASE_SHIFT) == (26 + 550, 0)


def test_the_rate_switches_at_brs_and_at_the_crc_delimiter():
    frame = oracle.FdFrame(0x1ABCDEF, bytes(range(20)), extended=True, brs=True)
    _, brs, delimiter = oracle.transmitted(frame)
    _, fields = fd_wire(frame.identifier, comparison.fd_flags_of(frame), frame.data)
    assert (fields.index(FIELD_BRS), fields.index(FIELD_CRC_DELIMITER)) == (brs, delimiter)


def test_no_frame_is_longer_than_the_worst_case():
    for length in LENGTHS:
        for extended in (0, FLAG_EXTENDED):
            flags = length_code(length) | FLAG_FD | extended
            longest = fd_worst_case_bits(flags)
            for data in (bytes(length), b"\x0f" * length, b"\x78" * length):
                assert phases(0, flags, data) & PHASE_MASK <= longest


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (FLAG_FD | FLAG_REMOTE, "CAN FD has no remote frames"),
        (FLAG_BRS | 8, "BRS and ESI are bits of CAN FD frames"),
        (FLAG_FD | FLAG_ERROR, "cannot be sent"),
    ],
)
def test_misused_flags_are_named(flags, words):
    assert words in fault_of_fd_flags(flags)
    assert fault_of_fd_flags(FLAG_FD | FLAG_BRS | FLAG_SINGLE_SHOT | 15) == ""


def test_the_oracle_sees_a_wrong_bit_of_every_kind():
    frame = oracle.FdFrame(0x123, b"\x00\xff", brs=True)
    text, _, delimiter = oracle.transmitted(frame)

    def flipped(place):
        return oracle.received(text[:place] + ("1" if text[place] == "0" else "0") + text[place + 1 :])

    stuff = oracle.places_of_stuff_bits(text[: delimiter - 28])
    assert flipped(stuff[0]) == "stuff"
    assert flipped(delimiter - 27) == "form"  # the first fixed stuff bit
    assert flipped(delimiter - 1) == "crc"
    assert flipped(delimiter) == "form"


def test_frames_are_coded_as_by_the_oracle():
    assert comparison.compare_fd_frames(1500) == []
