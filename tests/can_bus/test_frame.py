"""The length of a frame, its CRC and its stuff bits, against arithmetic done another way."""

import array

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ranger_sim.can_bus import frame
from ranger_sim.foundation.events import FLAG_EXTENDED, FLAG_REMOTE

WORD = st.integers(0, 2**32 - 1)


# ---- a second derivation: strings of bits and polynomial long division, no tables, no states ------------


def plain_bits(identifier, flags, lo, hi):
    """Start of frame ... data as a string of 0 and 1, written out from the layout of ISO 11898-1."""
    length = 0 if flags & FLAG_REMOTE else min(flags & 15, 8)
    data = (lo.to_bytes(4, "little") + hi.to_bytes(4, "little"))[:length]
    remote = "1" if flags & FLAG_REMOTE else "0"
    if flags & FLAG_EXTENDED:
        whole = f"{identifier:029b}"
        head = "0" + whole[:11] + "1" + "1" + whole[11:] + remote + "0" + "0"
    else:
        head = "0" + f"{identifier:011b}" + remote + "0" + "0"
    return head + f"{flags & 15:04b}" + "".join(f"{byte:08b}" for byte in data)


def remainder(bits):
    """CRC as the remainder of the bits times x^15 divided by the generator, as whole numbers."""
    generator = 0b1100010110011001  # x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1
    value = int(bits, 2) << 15
    while value.bit_length() > 15:
        value ^= generator << (value.bit_length() - 16)
    return value


def stuffed(bits):
    """The string with a complement after every five equal bits, by looking back at what was sent."""
    sent = ""
    for bit in bits:
        sent += bit
        if sent[-5:] in ("00000", "11111"):
            sent += "1" if bit == "0" else "0"
    return sent


def whole_length(identifier, flags, lo, hi):
    body = plain_bits(identifier, flags, lo, hi)
    return len(stuffed(body + f"{remainder(body):015b}")) + 10


# ---- known answers -------------------------------------------------------------------------------------


def test_eight_bytes_take_108_bits_unstuffed_111_with_intermission_and_135_at_worst():
    assert frame.unstuffed_bits(8) == 108
    assert frame.unstuffed_bits(8) + frame.INTERMISSION_BITS == 111
    assert frame.worst_case_bits(8) + frame.INTERMISSION_BITS == 135


def test_other_unstuffed_lengths_follow_the_layout():
    assert frame.unstuffed_bits(0) == 44
    assert frame.unstuffed_bits(8 | FLAG_REMOTE) == 44
    assert frame.unstuffed_bits(8 | FLAG_EXTENDED) == 128
    assert frame.worst_case_bits(8 | FLAG_EXTENDED) + 3 == 160  # the figure of every CAN schedulability paper


def test_four_buses_of_3_mbit_at_75_percent_carry_83000_frames_per_second():
    # appendix 3.11 rounds 83,333 down
    assert int(0.75 * 4 * 3_000_000 / frame.unstuffed_bits(8)) // 1000 * 1000 == 83_000


def test_a_frame_counted_by_hand():
    # identifier 0, no data: 0 00000000000 0 0 0 0000 = 19 zeros, CRC of zeros = 15 zeros: 34 zeros.
    # Stuffed: 5 zeros and a one, then again from the sixth zero on: 34 zeros hold six whole fives.
    assert frame.crc15(0, 0, 0, 0) == 0
    assert frame.frame_bits(0, 0, 0, 0) - frame.unstuffed_bits(0) == 6
    assert frame.frame_bits(0, 0, 0, 0) == 44 + 6


def test_crc_vectors_divided_on_paper():
    # A lone one that k bits follow leaves x^(15 + k) modulo the generator. Identifier 1 without data: 7 bits
    # follow (RTR IDE r0 DLC), so x^22. From x^15 = 4599: doubling and reducing gives, in hexadecimal,
    # 4599 4EAB 58CF 7407 2D97 5B2E 73C5 2213
    assert frame.crc15(1, 0, 0, 0) == 0x2213
    # DLC 1 and the byte 00: the one of the DLC is followed by 8 bits, so x^23 = 4426
    assert frame.crc15(0, 1, 0, 0) == 0x4426


def test_a_frame_of_ones_counted_by_hand():
    # identifier 7FF, DLC 0: 0 11111 s 11111 s 1 000 0 s ... : the header alone holds 3 stuff bits
    header = stuffed(plain_bits(0x7FF, 0, 0, 0))
    assert header == "0" + "11111" + "0" + "11111" + "0" + "1" + "00000" + "1" + "00"


def test_length_codes_above_eight_mean_eight_bytes_but_stay_in_the_crc():
    assert frame.data_length(15) == 8
    assert frame.frame_bits(5, 12, 7, 9) == whole_length(5, 12, 7, 9)
    assert frame.crc15(5, 12, 7, 9) != frame.crc15(5, 8, 7, 9)


# ---- properties ------------------------------------------------------------------------------------------

FRAMES = st.one_of(
    st.tuples(st.integers(0, 0x7FF), st.integers(0, 15), st.just(0)),
    st.tuples(st.integers(0, 0x1FFFFFFF), st.integers(0, 15), st.just(FLAG_EXTENDED)),
)
# words with long runs make stuffing work
RUNS = st.sampled_from([0, 0xFFFFFFFF, 0x0000FFFF, 0xF0F0F0F0, 0x1F1F1F1F, 0x07C1F07C, 0x83E0F83E]) | WORD


@given(FRAMES, st.booleans(), RUNS, RUNS)
def test_crc_stuffing_and_length_agree_with_long_division_and_string_stuffing(kind, remote, lo, hi):
    identifier, code, extended = kind
    flags = code | extended | (FLAG_REMOTE if remote else 0)
    body = plain_bits(identifier, flags, lo, hi)
    crc = remainder(body)
    assert frame.crc15(identifier, flags, lo, hi) == crc
    expected = len(stuffed(body + f"{crc:015b}"))
    stuff_bits = frame.frame_bits(identifier, flags, lo, hi) - frame.unstuffed_bits(flags)
    assert stuff_bits == expected - len(body) - 15
    assert frame.frame_bits(identifier, flags, lo, hi) == expected + 10
    assert expected + 10 <= frame.worst_case_bits(flags)


@given(FRAMES, RUNS, RUNS)
def test_the_bits_on_the_wire_are_the_stuffed_string_and_the_tail(kind, lo, hi):
    identifier, code, extended = kind
    flags = code | extended
    body = plain_bits(identifier, flags, lo, hi)
    bits, fields = frame.wire(identifier, flags, lo, hi)
    assert "".join(map(str, bits)) == stuffed(body + f"{remainder(body):015b}") + "1" * 10
    assert len(fields) == len(bits)
    assert fields[0] == frame.FIELD_START
    assert fields[-9] == frame.FIELD_ACK_SLOT
    assert fields[-1] == frame.FIELD_END


@given(FRAMES, FRAMES, st.booleans(), st.booleans())
def test_the_lower_key_is_the_frame_that_stays_dominant_longer(one, two, remote_one, remote_two):
    def arbitration(kind, remote):
        identifier, code, extended = kind
        flags = code | extended | (FLAG_REMOTE if remote else 0)
        bits = plain_bits(identifier, flags, 0, 0)[1:]
        # up to RTR (extended) or IDE (standard); what differs behind is no arbitration
        return bits[:32] if extended else bits[:13], frame.arbitration_key(identifier, flags)

    bits_one, key_one = arbitration(one, remote_one)
    bits_two, key_two = arbitration(two, remote_two)
    shared = min(len(bits_one), len(bits_two))
    if bits_one[:shared] != bits_two[:shared]:
        assert (key_one < key_two) == (bits_one < bits_two)
    elif len(bits_one) == len(bits_two):
        assert key_one == key_two


@pytest.mark.parametrize("flags", [8, 8 | FLAG_EXTENDED])
def test_the_worst_case_is_reached_by_some_stuffed_region(flags):
    # the bound itself: runs of 5, then 4 and the stuff bit before them
    region = frame.unstuffed_bits(flags) - frame.TAIL_BITS
    worst = "00000" + ("1111" + "0000") * region
    assert len(stuffed(worst[:region])) - region == (region - 1) // 4
    assert frame.worst_case_bits(flags) == frame.unstuffed_bits(flags) + (region - 1) // 4


@given(st.lists(st.tuples(st.integers(0, 0x7FF), st.sampled_from((0, 3, 8, 15, FLAG_REMOTE | 8)), WORD, WORD)))
def test_many_frames_at_once_are_as_long_as_one_by_one(frames):
    columns = [array.array("q", column) for column in zip(*frames, strict=True)] or [array.array("q")] * 4
    bits = array.array("q", [0]) * len(frames)
    frame.fill_frame_bits(*columns, bits)
    assert bits.tolist() == [whole_length(*each) for each in frames]
    of_numpy = np.zeros(len(frames), np.int64)
    frame.fill_frame_bits(*(np.array(column, np.int64) for column in columns), of_numpy)
    assert of_numpy.tolist() == bits.tolist()
