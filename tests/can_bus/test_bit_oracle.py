"""The oracle of a CAN bus, bit by bit, gives the answers that ISO 11898-1 gives on paper."""

import pytest

from tests.can_bus.bit_oracle import Bus, Frame, Node, crc15, number_bits, stuffed

ZEROS = Frame(0x100, bytes(8))
ONES = Frame(0x100, b"\xff" * 8)


def nodes(count):
    return [Node(name) for name in "abcdefgh"[:count]]


def seen(node, what):
    """Events of one kind: [(bit, ...)]."""
    return [(each[0], *each[2:]) for each in node.events if each[1] == what]


def error_end(bus, first):
    """The bit at which every node is in intermission for the first time after `first`."""
    while bus.bit <= first or any(node.state != "intermission" for node in bus.nodes):
        bus.step()
    return bus.bit


def test_the_crc_of_a_known_message():
    """x^15 mod g is g without its first term; a message of one bit 1 is that remainder."""
    assert crc15([1]) == [1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1]  # 0x4599
    assert crc15(number_bits(0, 40)) == [0] * 15


def test_a_frame_of_zeros_is_stuffed_after_every_fifth_equal_bit():
    bits, is_stuff, arbitration = stuffed(Frame(0, b""))
    # SOF and 18 header bits are dominant: four times five bits and a recessive one; counted out by hand
    assert bits[:24] == [0, 0, 0, 0, 0, 1] * 4
    assert [i for i, stuff in enumerate(is_stuff) if stuff][:4] == [5, 11, 17, 23]
    assert arbitration == 13 + 2


def test_a_frame_is_received_one_bit_before_its_sender_is_done():
    a, b = nodes(2)
    a.waiting = [(5, Frame(0x123, bytes(range(8))))]
    Bus([a, b]).run(300)
    length = len(stuffed(Frame(0x123, bytes(range(8))))[0]) + 10  # delimiter, ACK, delimiter, seven of EOF
    assert seen(a, "sent") == [(5 + length - 1, Frame(0x123, bytes(range(8))))]
    assert seen(b, "received") == [(5 + length - 2, (0x123, False, False, 8, bytes(range(8))))]


def test_the_lower_identifier_wins_and_the_other_follows_after_three_bits():
    a, b, c = nodes(3)
    low, high = Frame(0x0FF, b"\x01"), Frame(0x100, b"\x02")
    a.waiting, b.waiting = [(1, high)], [(1, low)]
    Bus([a, b, c]).run(400)
    [(done, _)] = seen(b, "sent")
    [(later, _)] = seen(a, "sent")
    assert later - done == 3 + len(stuffed(high)[0]) + 10
    assert seen(a, "lost arbitration") == [(1 + 3,)]  # SOF, 0, 0: the third bit of the identifier differs


def test_a_node_alone_becomes_passive_and_repeats_for_ever():
    """Sixteen missing acknowledgements bring 128; from there on no dominant bit answers the passive flag."""
    [a] = nodes(1)
    a.waiting = [(1, ZEROS)]
    Bus([a]).run(20_000)
    assert a.tec == 128 and a.passive and a.state != "bus-off"


@pytest.mark.parametrize("others", [0, 1, 3])
def test_equal_identifiers_with_different_data_both_get_through_after_sixteen_errors(others):
    """Each collision costs both eight: 16 of them make both passive, and then the passive flag of the one that sends
    recessive no longer destroys the other's frame. That is the 17th error; the second frame goes out alone."""
    a, b, *rest = nodes(2 + others)
    a.waiting, b.waiting = [(1, ZEROS)], [(1, ONES)]
    Bus([a, b, *rest]).run(20_000)
    assert len(seen(a, "sent")) == len(seen(b, "sent")) == 1
    assert max(len(seen(a, "error")), len(seen(b, "error"))) == 17
    assert a.state == b.state == "idle"


def test_an_inverted_stuff_bit_after_five_recessive_ones_is_noticed_by_all_at_once():
    """Six recessive bits in a row: the sender (bit error) and the receivers (stuff error) flag together, six bits, then
    come eight of delimiter."""
    a, b, c = nodes(3)
    a.waiting = [(1, ONES)]
    bits, is_stuff, arbitration = stuffed(ONES)
    at = next(i for i in range(arbitration, len(bits)) if is_stuff[i] and bits[i] == 0)
    bus = Bus([a, b, c])
    bus.inverted = {1 + at}
    assert error_end(bus, 1 + at) == 1 + at + 1 + 6 + 8
    assert seen(a, "error") == [(1 + at, "bit", "sending")]
    assert seen(b, "error") == seen(c, "error") == [(1 + at, "stuff", "receiving")]
    assert (a.tec, b.rec, c.rec) == (8, 1, 1)


def test_an_inverted_bit_that_starts_no_run_is_noticed_by_receivers_only_at_the_senders_sixth_flag_bit():
    """A recessive bit in the middle of alternating ones: the flag's six dominant bits are what receivers notice, and
    theirs add six more."""
    a, b = nodes(2)
    frame = Frame(0x100, b"\x55" * 8)
    a.waiting = [(1, frame)]
    bits, is_stuff, arbitration = stuffed(frame)
    at = next(i for i in range(arbitration + 8, len(bits)) if bits[i - 1 : i + 1] == [1, 0] and not is_stuff[i])
    bus = Bus([a, b])
    bus.inverted = {1 + at}
    assert error_end(bus, 1 + at) == 1 + at + 1 + 6 + 6 + 8
    assert seen(b, "error") == [(1 + at + 6, "stuff", "receiving")]


def test_a_dominant_crc_delimiter_is_a_form_error_of_every_receiver():
    a, b = nodes(2)
    a.waiting = [(1, ZEROS)]
    at = len(stuffed(ZEROS)[0])
    bus = Bus([a, b])
    bus.inverted = {1 + at}
    assert error_end(bus, 1 + at) == 1 + at + 1 + 6 + 8
    assert seen(b, "error") == [(1 + at, "form", "receiving")]


def test_a_passive_sender_waits_eight_bits_more():
    a, b = nodes(2)
    a.tec, a.passive = 140, True
    first, second = Frame(0x10, b"\x01"), Frame(0x11, b"\x02")
    a.waiting = [(1, first), (1, second)]
    Bus([a, b]).run(400)
    [(one, _), (two, _)] = seen(a, "sent")
    assert two - one == 3 + 8 + len(stuffed(second)[0]) + 10


def test_a_node_off_the_bus_is_back_after_128_times_eleven_recessive_bits():
    [a] = nodes(1)
    a.tec, a.state, a.sequences = 256, "integrating", 128
    bus = Bus([a])
    bus.run(128 * 11 - 1)
    assert a.state == "integrating"
    bus.run(1)
    assert (a.state, a.tec, a.rec, a.passive) == ("idle", 0, 0, False)
