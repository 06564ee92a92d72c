"""Conversations with the XCP slave, answer by answer, as the standard's tables have them (part 2, chapter 1.6)."""

import pytest

from ranger_sim.harness.xcp.slave import FINE, SHORT, Slave, XcpError

MS = 1_000_000
DATA = bytes(n % 251 for n in range(70_000))
# Bytes that a command has at least: its fields up to the last one that is not optional.
LENGTHS = {
    0xFF: 2, 0xFE: 1, 0xFD: 1, 0xFC: 1, 0xFB: 1, 0xFA: 2, 0xF6: 8, 0xF5: 2, 0xF4: 8, 0xF3: 8, 0xF0: 3, 0xEF: 3, 0xED: 9,
    0xE2: 6, 0xE1: 8, 0xE0: 8, 0xDF: 4, 0xDE: 4, 0xDD: 2, 0xDC: 1, 0xDA: 1, 0xD9: 1, 0xD8: 4, 0xD7: 4, 0xD6: 1, 0xD5: 4,
    0xD4: 5, 0xD3: 6, 0xC7: 2,
}  # fmt: skip
TWO_LISTS = (
    ("D6", "FF"),
    ("D5 00 0200", "FF"),
    ("D4 00 0000 02", "FF"),
    ("D4 00 0100 01", "FF"),
    ("D3 00 0000 00 01", "FF"),
    ("D3 00 0000 01 02", "FF"),
    ("D3 00 0100 00 01", "FF"),
    ("E2 00 0000 00 00", "FF"),
    ("E1 FF 04 00 04010000", "FF"),
    ("E2 00 0000 01 00", "FF"),
    ("E1 FF 02 00 10010000", "FF"),
    ("E1 FF 01 00 20010000", "FF"),
    ("E2 00 0100 00 00", "FF"),
    ("E1 FF 03 00 30010000", "FF"),
)


class Plain:
    """Byte n of 70,000 from 0x100 on is n modulo 251; every write is noted."""

    def __init__(self):
        self.data = DATA
        self.written = []

    def read(self, address, count):
        if not 0x100 <= address <= 0x100 + len(self.data) - count:
            raise XcpError(0x22)
        return self.data[address - 0x100 : address - 0x100 + count]

    def write(self, address, data):
        self.written.append((address, bytes(data)))


def connected(max_cto=8, max_dto=8, clock=SHORT, **more):
    slave = Slave(Plain(), max_cto, max_dto, clock, **more)
    slave.command(b"\xff\x00", 0)
    return slave


def held(slave, *lines):
    """Every command has its answer; an empty answer: none."""
    for command, answer in lines:
        found = slave.command(bytes.fromhex(command), 0)
        assert found == bytes.fromhex(answer), (command, found.hex(" "))


@pytest.mark.parametrize("code", range(0xC0, 0x100))
def test_a_command_that_is_shorter_than_its_fields_is_a_mistake_of_syntax(code):
    for length in range(1, 12):
        slave = connected(248, 1400)
        answer = slave.command(bytes((code, *((1,) if code in (0xF0, 0xED) else (0,)), *bytes(10)))[:length], 0)
        if code in LENGTHS:
            assert (answer == b"\xfe\x21") == (length < LENGTHS[code]), (length, answer)
        else:
            assert answer == b"\xfe\x20"


def test_a_packet_may_be_as_long_as_the_slave_allows_and_no_longer():
    slave = connected()
    assert slave.command(b"\xfd" + bytes(7), 0)[0] == 0xFF
    assert slave.command(b"\xfd" + bytes(8), 0) == b"\xfe\x21"
    assert slave.command(b"", 0) == b""


def test_a_packet_that_is_too_short_is_not_a_command():
    held(connected(8), ("ED 01 00 00 00010000", "FE 20"), ("C7 00", "FE 20"))
    held(connected(9), ("ED 01 00 00 00010000 07", "FF"), ("C7 00", "FE 20"))
    held(connected(10), ("C7 00", "FF"), ("C7 01 FF 04 00010000 00 00", "FE 29"))


@pytest.mark.parametrize(("max_cto", "packets"), [(8, 43), (10, 32), (32, 9), (248, 2), (255, 2), (17, 17), (19, 15)])
def test_a_block_of_255_bytes_comes_in_several_packets(max_cto, packets):
    held(connected(max_cto), ("FB", f"FF 00 01 00 {packets:02X} 00 00 10"))


def test_the_pointer_moves_with_every_byte_that_is_read_or_written():
    slave = connected()
    held(
        slave,
        ("F6 0000 00 05010000", "FF"),
        ("F5 07", "FF 05 06 07 08 09 0A 0B"),
        ("F5 08", "FE 22"),
        ("F5 00", "FE 22"),
        ("F5 01", "FF 0C"),
        ("F0 02 AABBCC", "FF"),  # the third byte belongs to nothing
        ("F5 01", "FF 0F"),
        ("F4 07 00 00 20010000", "FF 20 21 22 23 24 25 26"),
        ("F5 01", "FF 27"),
        ("F4 08 00 00 20010000", "FE 22"),
        ("F4 00 00 00 20010000", "FE 22"),
        ("F4 01 00 01 20010000", "FE 22"),
        ("F6 0000 01 00010000", "FE 22"),
        ("F5 01", "FF 28"),  # what is refused moves nothing
        ("F0 06 010203040506", "FF"),
        ("F5 01", "FF 2F"),
        ("F0 00 01", "FE 21"),
        ("F0 02 01", "FE 21"),
        ("F6 0000 00 01020000", "FF"),
        ("F5 01", "FF 06"),  # 257 is 251 and 6
    )
    assert slave.memory.written == [(0x10D, b"\xaa\xbb"), (0x129, b"\1\2\3\4\5\6")]


def test_a_checksum_is_of_as_many_bytes_as_the_table_can_have():
    slave = connected()
    whole = sum(n % 251 for n in range(65_536))
    held(
        slave,
        ("F6 0000 00 00010000", "FF"),
        ("F3 000000 00000100", "FF 03 00 00" + whole.to_bytes(4, "little").hex()),
        ("F3 000000 01000100", "FE 22"),
        ("F3 000000 00000000", "FE 22"),
        ("F5 01", f"FF {65_536 % 251:02X}"),
        ("FA 00", "FF 00 00 00 0A 00 00 00"),
        ("F3 000000 01000000", "FE 22"),  # the pointer is in a name
    )


def test_a_name_takes_the_pointer_until_it_is_set_anew():
    slave = connected(name="four")
    held(
        slave,
        ("FA 00", "FF 00 00 00 04 00 00 00"),
        ("F0 01 05", "FE 24"),
        ("F5 03", "FF 66 6F 75"),
        ("F5 02", "FE 22"),
        ("F5 01", "FF 72"),
        ("F5 01", "FE 22"),
        ("F6 0000 00 07010000", "FF"),
        ("F5 01", "FF 07"),
        ("FA 01", "FF 00 00 00 06 00 00 00"),
        ("F5 06", "FF 72 61 6E 67 65 72"),
        ("F4 02 00 00 03010000", "FF 03 04"),
        ("F5 01", "FF 05"),
        ("FA 02", "FF 00 00 00 00 00 00 00"),
        ("F5 01", "FE 22"),
        ("D7 00 0000", "FF 84 20 0A 05 05 00"),
        ("F5 07", "FF" + b"slot_0_".hex()),
        ("D7 00 0100", "FF 84 20 08 0A 05 00"),
        ("F5 07", "FF" + b"slot_1m".hex()),
        ("D7 00 0200", "FF 84 20 08 14 05 00"),
        ("F5 05", "FF" + b"slot_".hex()),
        ("F5 03", "FF" + b"2ms".hex()),
        ("D7 00 0300", "FE 22"),
        ("D7 00 0001", "FE 22"),  # event 256
    )
    assert slave.memory.written == []
    fine = connected(248, 1400, FINE)
    held(fine, ("FA 00", "FF 00 00 00 0A 00 00 00"), ("ED 01 00 00 09010000 AA", "FF"), ("F5 01", "FF 0A"))
    assert fine.memory.written == [(0x109, b"\xaa")]


def test_a_write_in_several_packets_is_one_write_of_all_its_bytes():
    slave = connected()
    held(
        slave,
        ("F6 0000 00 00010000", "FF"),
        ("F0 07 010203040506", ""),
        ("EF 01 07", "FF"),
        ("F0 0C 111213141516", ""),
        ("EF 06 212223242526", "FF"),
        ("F0 0D 111213141516", ""),
        ("EF 07 212223242526", ""),
        ("EF 01 31FF", "FF"),
        ("F5 01", f"FF {7 + 12 + 13:02X}"),
        ("F0 08 010203040506", ""),
        ("EF 01 07", "FE 29 02"),
        ("EF 02 0708", "FE 29 00"),  # it was broken off
        ("F0 0E 010203040506", ""),
        ("EF 08 0708090A0B", "FE 21"),  # a packet that is not full is the last one
        ("EF 02 0708", "FE 29 00"),
        ("F0 07 0102030405", "FE 21"),
    )
    assert slave.memory.written == [
        (0x100, bytes.fromhex("01020304050607")),
        (0x107, bytes.fromhex("111213141516212223242526")),
        (0x113, bytes.fromhex("11121314151621222324252631")),
    ]


def test_lists_tables_and_entries_are_allocated_in_this_order_and_within_their_number():
    held(
        connected(),
        ("D5 00 0100", "FE 29"),
        ("D4 00 0000 01", "FE 29"),
        ("D6", "FF"),
        ("D4 00 0000 01", "FE 29"),
        ("D5 00 2100", "FE 30"),
        ("D5 00 0001", "FE 30"),  # 256
        ("D5 00 2000", "FF"),
        ("D5 00 0100", "FE 29"),
        ("D3 00 0000 00 01", "FE 29"),
        ("D4 00 2000 01", "FE 22"),
        ("D4 00 1F00 FC", "FF"),  # 252 packets have an identifier
        ("D4 00 0000 01", "FE 30"),
        ("D4 00 1F00 FB", "FF"),  # once more for the same list: it counts once
        ("D4 00 0000 01", "FF"),
        ("DE 00 1F00", "FF 01"),  # identifiers follow each other in the order of the lists
        ("DE 00 0000", "FF 00"),
        ("D3 00 2000 00 01", "FE 22"),
        ("D3 00 0000 01 01", "FE 22"),
        ("D3 00 0000 00 08", "FE 30"),
        ("D3 00 0000 00 07", "FF"),
        ("D4 00 0000 01", "FE 29"),
        ("D3 00 1F00 FA 02", "FF"),
        ("D8 00 1F00", "FF 04 FB 02 00 00"),
        ("D8 00 0100", "FF 04 00 00 00 00"),
        ("D8 00 0000", "FF 04 01 07 00 00"),
        ("D8 00 2000", "FE 22"),
        ("D6", "FF"),
        ("D8 00 0000", "FE 22"),
        ("D5 00 0000", "FF"),
    )


def test_an_entry_is_written_where_the_pointer_is_and_the_pointer_ends_with_its_table():
    slave = connected()
    held(
        slave,
        ("D6", "FF"),
        ("D5 00 0100", "FF"),
        ("D4 00 0000 02", "FF"),
        ("D3 00 0000 01 03", "FF"),
        ("E1 FF 01 00 00010000", "FE 29"),
        ("E2 00 0100 00 00", "FE 22"),
        ("E2 00 0000 02 00", "FE 22"),
        ("E2 00 0000 01 03", "FE 22"),
        ("E2 00 0000 00 00", "FE 22"),  # a table without entries
        ("E2 00 0000 01 01", "FF"),
        ("E1 FE 01 00 00010000", "FE 22"),
        ("E1 FF 00 00 00010000", "FE 22"),
        ("E1 FF 05 00 00010000", "FE 22"),
        ("E1 FF 01 01 00010000", "FE 22"),
        ("E1 FF 01 00 FF000000", "FE 22"),
        ("E1 FF 04 00 08010000", "FF"),
        ("E1 FF 01 00 0C010000", "FF"),
        ("E1 FF 01 00 0D010000", "FE 29"),
        ("E2 00 0000 01 00", "FF"),
        ("E1 FF 02 00 02010000", "FF"),
    )
    assert slave.lists[0].tables == [[], [(0x102, 2), (0x108, 4), (0x10C, 1)]]
    held(slave, ("D6", "FF"), ("E1 FF 01 00 00010000", "FE 29"))


def test_several_entries_in_one_packet_are_all_there_or_the_packet_is_too_short():
    slave = connected(248, 1400, FINE)
    two = "FF 04 00010000 00 00 FF 02 08010000 00 00"
    held(
        slave,
        ("D6", "FF"),
        ("D5 00 0100", "FF"),
        ("D4 00 0000 01", "FF"),
        ("D3 00 0000 00 02", "FF"),
        ("E2 00 0000 00 00", "FF"),
        (f"C7 02 {two}"[:-3], "FE 21"),
        (f"C7 03 {two}", "FE 21"),
        ("C7 01 FF 04 00010000 01 00", "FE 22"),
        (f"C7 02 {two} 00", "FF"),
    )
    assert slave.lists[0].tables == [[(0x100, 4), (0x108, 2)]]


def test_a_lists_mode_is_taken_whole_or_not_at_all():
    slave = connected()
    held(
        slave,
        *TWO_LISTS,
        *((f"E0 {mode:02X} 0100 0000 01 00", "FE 27") for mode in (0x01, 0x02, 0x20, 0x40, 0x52)),
        ("E0 10 0100 0300 01 00", "FE 22"),
        ("E0 10 0100 0001 01 00", "FE 22"),
        ("E0 10 0100 0000 00 00", "FE 22"),
        ("E0 10 0200 0000 01 00", "FE 22"),
        ("DF 00 0100", "FF 00 00 00 00 00 01 00"),
        ("E0 10 0100 0200 FF 00", "FF"),
        ("DF 00 0100", "FF 10 00 00 02 00 FF 00"),
        ("E0 0C 0100 0100 02 00", "FF"),
        ("DF 00 0100", "FF 00 00 00 01 00 02 00"),
        ("DF 00 0000", "FF 00 00 00 00 00 01 00"),
        ("DF 00 0200", "FE 22"),
    )


def test_lists_are_started_stopped_and_selected_one_by_one_and_together():
    held(
        connected(),
        *TWO_LISTS,
        ("DE 03 0000", "FE 27"),
        ("DE 01 0200", "FE 22"),
        ("DD 03", "FE 27"),
        ("DE 02 0100", "FF 02"),
        ("FD", "FF 00 00 00 00 00"),
        ("DF 00 0100", "FF 01 00 00 00 00 01 00"),
        ("DD 01", "FF"),
        ("FD", "FF 40 00 00 00 00"),
        ("DF 00 0100", "FF 40 00 00 00 00 01 00"),
        ("DF 00 0000", "FF 00 00 00 00 00 01 00"),
        ("DE 01 0000", "FF 00"),
        ("DF 00 0000", "FF 40 00 00 00 00 01 00"),
        ("DE 02 0000", "FF 00"),
        ("DD 02", "FF"),  # stops what is selected
        ("DF 00 0000", "FF 00 00 00 00 00 01 00"),
        ("DF 00 0100", "FF 40 00 00 00 00 01 00"),
        ("DE 02 0000", "FF 00"),
        ("DE 00 0000", "FF 00"),  # no longer selected
        ("DF 00 0000", "FF 00 00 00 00 00 01 00"),
        ("DE 02 0000", "FF 00"),
        ("DD 00", "FF"),
        ("FD", "FF 00 00 00 00 00"),
        ("DF 00 0000", "FF 00 00 00 00 00 01 00"),
        ("DF 00 0100", "FF 00 00 00 00 00 01 00"),
    )


@pytest.mark.parametrize(
    "change",
    ["D5 00 0100", "D4 00 0000 01", "D3 00 0000 00 01", "E2 00 0000 00 00", "E1FF040000010000", "E010 0000 0000 01 00"],
)
def test_nothing_of_a_list_is_changed_while_one_runs_but_all_can_be_freed(change):
    slave = connected()
    held(slave, *TWO_LISTS, ("E2 00 0000 01 00", "FF"), ("DE 01 0100", "FF 02"), (change, "FE 11"))
    held(slave, ("D6", "FF"), ("FD", "FF 00 00 00 00 00"))
    assert slave.lists == [] and slave.sample(0, 0) == []


def test_the_packets_of_two_lists_are_those_of_their_entries_stamps_and_prescalers():
    slave = connected()
    held(slave, *TWO_LISTS, ("E0 10 0000 0100 01 00", "FF"), ("E0 00 0100 0000 03 00", "FF"))
    held(slave, ("DE 02 0000", "FF 00"), ("DE 02 0100", "FF 02"), ("DD 01", "FF"))
    first = bytes.fromhex("0405 0607")
    found = {half: slave.sample(40 * MS + half * MS // 2, half * MS // 2) for half in range(8)}
    for half, packets in found.items():
        stamp = (4000 + 50 * half).to_bytes(2, "little")  # units of 10 us
        of_first = [b"\0" + stamp + first, bytes.fromhex("01 1011 20")] if half % 2 == 0 else []
        of_second = [bytes.fromhex("02 303132")] if half % 3 == 0 else []
        assert packets == of_first + of_second
    # a list that runs goes on counting when others are started, one that is started begins anew
    held(slave, ("DE 02 0100", "FF 02"), ("DD 01", "FF"))
    assert [len(slave.sample(0, half * MS // 2)) for half in (9, 11)] == [0, 1]  # its events 8 and 9


def test_a_list_that_is_started_alone_begins_with_its_first_event():
    slave = connected()
    held(slave, *TWO_LISTS, ("E0 00 0100 0000 03 00", "FF"), ("DE 01 0100", "FF 02"))
    assert [len(slave.sample(0, 500_000 * n)) for n in range(5)] == [1, 0, 0, 1, 0]
    held(slave, ("DE 01 0100", "FF 02"))
    assert [len(slave.sample(0, 500_000 * n)) for n in range(4)] == [1, 0, 0, 1]
    held(slave, ("DE 00 0100", "FF 02"), ("DE 02 0100", "FF 02"), ("DD 01", "FF"))
    assert [len(slave.sample(0, 500_000 * n)) for n in range(4)] == [1, 0, 0, 1]


def test_a_list_without_a_table_or_with_an_empty_entry_or_too_long_a_packet_does_not_start():
    head = (("D6", "FF"), ("D5 00 0100", "FF"))
    held(connected(), *head, ("DE 01 0000", "FE 2A"), ("DE 02 0000", "FE 2A"))
    held(connected(), *head, ("D4 00 0000 01", "FF"), ("DE 01 0000", "FF 00"))  # an identifier alone
    held(connected(), *head, ("D4 00 0000 01", "FF"), ("D3 00 0000 00 01", "FF"), ("DE 01 0000", "FE 2A"))
    two = (
        *head,
        ("D4 00 0000 02", "FF"),
        ("D3 00 0000 00 02", "FF"),
        ("D3 00 0000 01 02", "FF"),
        ("E2 00 0000 01 00", "FF"),
        ("E1 FF 04 00 00010000", "FF"),
        ("E1 FF 03 00 00010000", "FF"),
        ("E2 00 0000 00 00", "FF"),
        ("E1 FF 04 00 00010000", "FF"),
    )
    # the stamp of two bytes is in the first packet alone: 1 + 2 + 5 bytes are eight, 1 + 2 + 6 nine
    held(connected(), *two, ("E1 FF 01 00 00010000", "FF"), ("E0 10 0000 0000 01 00", "FF"), ("DE 01 0000", "FF 00"))
    held(connected(), *two, ("E1 FF 02 00 00010000", "FF"), ("E0 10 0000 0000 01 00", "FF"), ("DE 01 0000", "FE 2A"))
    held(connected(), *two, ("E1 FF 03 00 00010000", "FF"), ("DE 01 0000", "FF 00"))
    held(connected(), *two, ("E1 FF 04 00 00010000", "FF"), ("DE 01 0000", "FE 2A"))


def test_the_transport_is_asked_for_all_that_would_be_measured_at_once():
    asked = []
    slave = connected(bears=lambda packets: asked.append(list(packets)) or True)
    held(slave, *TWO_LISTS, ("E0 10 0000 0100 02 00", "FF"), ("E0 00 0100 0200 05 00", "FF"))
    first, second = [(7, 2 * MS), (4, 2 * MS)], [(4, 10 * MS)]
    held(slave, ("DE 01 0100", "FF 02"), ("DE 02 0000", "FF 00"), ("DD 01", "FF"))
    assert asked == [second, first + second, first + second]
    held(slave, ("DD 00", "FF"), ("DE 02 0000", "FF 00"), ("DE 01 0100", "FF 02"))
    assert asked[3:] == [first, first + second]


@pytest.mark.parametrize(
    ("clock", "time_ns", "stamp"),
    [
        (SHORT, 9_999, "00000000"),
        (SHORT, 10_000, "01000000"),
        (SHORT, 655_359_999, "FFFF0000"),
        (SHORT, 655_360_000, "00000000"),
        (FINE, 999, "00000000"),
        (FINE, 258_000, "02010000"),
        (FINE, 4_294_967_295_000, "FFFFFFFF"),
        (FINE, 4_294_967_296_000, "00000000"),
    ],
)
def test_the_clock_counts_its_unit_and_wraps_at_its_size(clock, time_ns, stamp):
    assert connected(clock=clock).command(b"\xdc", time_ns) == bytes.fromhex("FF 00 00 00" + stamp)


def test_connecting_again_forgets_lists_and_pointer_and_disconnecting_everything():
    slave = connected()
    held(slave, *TWO_LISTS, ("F6 0000 00 05010000", "FF"), ("DE 01 0000", "FF 00"))
    held(slave, ("FF 00", "FF 05 80 08 0800 01 01"), ("FD", "FF 00 00 00 00 00"), ("D5 00 0100", "FE 29"))
    held(slave, ("D8 00 0000", "FE 22"), ("F5 01", "FE 22"))
    assert slave.connected and not slave.running and slave.address == 0
    held(slave, *TWO_LISTS, ("FE", "FF"), ("FD", ""), ("FF 01", "FE 22"), ("FF 00", "FF 05 80 08 0800 01 01"))
    assert slave.lists == []
