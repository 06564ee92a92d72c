"""The XCP slave by packets whose bytes follow from the standard's tables (ASAM MCD-1 XCP part 2)."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ranger_sim.harness.xcp.slave import COMMANDS, FINE, MOST_LISTS, Slave, XcpError
from tests.examples import examples

MS = 1_000_000


class Bytes:
    """16 bytes of memory at 0x100, of which the last four may be written."""

    def __init__(self):
        self.data = bytearray(range(16))

    def read(self, address, count):
        if not 0x100 <= address <= 0x110 - count:
            raise XcpError(0x22)
        return bytes(self.data[address - 0x100 : address - 0x100 + count])

    def write(self, address, data):
        if not 0x100 <= address <= 0x110 - len(data):
            raise XcpError(0x22)
        if address != 0x10C or len(data) != 4:
            raise XcpError(0x24)
        self.data[12:16] = data


@pytest.fixture
def slave():
    made = Slave(Bytes())
    assert made.command(bytes.fromhex("FF00"), 0) == bytes.fromhex("FF 05 80 08 0800 01 01")
    return made


def say(slave, text, time_ns=0):
    return slave.command(bytes.fromhex(text), time_ns).hex(" ").upper()


def test_nothing_but_connect_is_answered_before_connect():
    slave = Slave(Bytes())
    assert say(slave, "FD") == ""
    assert say(slave, "FF01") == "FE 22" and not slave.connected


@pytest.mark.parametrize(
    ("command", "answer"),
    [
        ("FD", "FF 00 00 00 00 00"),
        ("FC", "FE 00"),
        ("FB", "FF 00 01 00 2B 00 00 10"),  # blocks from the master, of 43 packets: 255 bytes by 6
        ("FA00", "FF 00 00 00 0A 00 00 00"),
        ("FA01", "FF 00 00 00 06 00 00 00"),
        ("FA04", "FF 00 00 00 00 00 00 00"),
        ("F4 02 00 00 04010000", "FF 04 05"),
        ("F4 08 00 00 00010000", "FE 22"),
        ("F4 02 00 01 04010000", "FE 22"),
        ("F4 00 00 00 04010000", "FE 22"),
        ("F5 00", "FE 22"),
        ("F0 00 01", "FE 21"),
        ("F0 01 01", "FE 22"),  # one byte at the pointer, where there is no memory yet
        ("F4 02 00 00 0F010000", "FE 22"),
        ("DA", "FF 13 20 00 03 00 00 00"),
        ("D9", "FF 01 04 01 00 42 01 00"),
        ("D7 00 0000", "FF 84 20 0A 05 05 00"),  # for measuring, all lists of one instant
        ("D8 00 0000", "FE 22"),
        ("F8 00 00", "FE 20"),  # GET_SEED
        ("EA 83 00", "FE 20"),  # GET_CAL_PAGE
        ("D7 00 0300", "FE 22"),
        ("F6 00", "FE 21"),
        ("C0", "FE 20"),
        ("EB 83 00 00", "FE 20"),
    ],
)
def test_a_command_has_the_answer_of_the_standard(slave, command, answer):
    assert say(slave, command) == answer


def test_upload_moves_the_pointer_and_a_checksum_adds_bytes(slave):
    assert say(slave, "F6 0000 00 00010000") == "FF"
    assert say(slave, "F503") == "FF 00 01 02"
    assert say(slave, "F502") == "FF 03 04"
    assert say(slave, "F6 0000 00 00010000") == "FF"
    assert say(slave, "F3 000000 10000000") == "FF 03 00 00 78 00 00 00"  # 0 + 1 ... + 15 = 120


def test_the_name_is_uploaded_in_parts(slave):
    say(slave, "FA00")
    assert slave.command(b"\xf5\x07", 0)[1:] + slave.command(b"\xf5\x03", 0)[1:] == b"ranger_sim"
    assert say(slave, "F501") == "FE 22"
    say(slave, "FA01")
    assert slave.command(b"\xf5\x06", 0)[1:] == b"ranger"  # as ranger.a2l is called


def test_what_is_refused_changes_nothing(slave):
    say(slave, "F6 0000 00 00010000")
    assert say(slave, "F0 04 01020304") == "FE 24"
    assert slave.memory.data == bytearray(range(16))
    say(slave, "F6 0000 00 0C010000")
    assert say(slave, "F0 05 01020304") == "FE 21"
    assert say(slave, "F0 04 01020304") == "FF"
    assert slave.memory.data[12:] == b"\1\2\3\4"


def arranged(slave, event="0000", prescaler="01"):
    for command in (
        "D6", "D5 00 0100", "D4 00 0000 02", "D3 00 0000 00 01", "D3 00 0000 01 01", "E2 00 0000 00 00",
        "E1 FF 04 00 00010000", "E2 00 0000 01 00", "E1 FF 02 00 08010000", f"E0 10 0000 {event} {prescaler} 00",
        "DE 02 0000", "DD 01",
    ):  # fmt: skip
        assert say(slave, command)[:2] == "FF", command


def test_a_list_is_sampled_at_its_event_with_stamps_of_virtual_time(slave):
    arranged(slave, "0100")
    assert say(slave, "FD")[:5] == "FF 40"
    assert slave.sample(7 * MS, 500_000) == []
    assert slave.sample(7 * MS, 3 * MS) == [bytes.fromhex("00 BC02 00010203"), bytes.fromhex("01 0809")]
    assert say(slave, "DD00") == "FF"
    assert slave.sample(8 * MS, 4 * MS) == []


def test_a_prescaler_leaves_events_out(slave):
    arranged(slave, "0000", "03")
    found = [bool(slave.sample(at, at)) for at in range(0, 7 * MS // 2, MS // 2)]
    assert found == [True, False, False, True, False, False, True]


def test_lists_are_allocated_in_the_order_of_the_standard(slave):
    assert say(slave, "D5 00 0100") == "FE 29"
    assert say(slave, "E1 FF 04 00 00010000") == "FE 29"
    say(slave, "D6")
    assert say(slave, "D5 00 2100") == "FE 30"
    assert say(slave, "D5 00 0100") == "FF"
    assert say(slave, "D3 00 0000 00 01") == "FE 29"
    assert say(slave, "D4 00 0000 FD") == "FE 30"
    assert say(slave, "D4 00 0000 01") == "FF"
    assert say(slave, "D3 00 0000 00 08") == "FE 30" and say(slave, "D3 00 0000 00 07") == "FF"


def test_lists_are_not_changed_while_one_runs(slave):
    arranged(slave)
    assert say(slave, "E2 00 0000 00 00") == "FE 11"
    assert say(slave, "E0 10 0000 0000 01 00") == "FE 11"


def test_a_list_whose_packet_is_too_long_does_not_start(slave):
    for command in ("D6", "D5 00 0100", "D4 00 0000 01", "D3 00 0000 00 02", "E2 00 0000 00 00"):
        say(slave, command)
    for _ in range(2):
        assert say(slave, "E1 FF 04 00 00010000") == "FF"
    assert say(slave, "DE 01 0000") == "FE 2A"


def test_fine_stamps_count_microseconds_in_four_bytes():
    slave = Slave(Bytes(), 248, 1400, FINE)
    assert say(slave, "FF00") == "FF 05 80 F8 78 05 01 01"
    assert say(slave, "D9") == "FF 01 04 01 00 34 01 00"
    assert say(slave, "DC", 5_000_001_000) == "FF 00 00 00 41 4B 4C 00"


def test_a_block_is_one_write_answered_once():
    slave = Slave(Bytes())
    slave.memory.data = bytearray(40)
    slave.memory.write = lambda address, data: written.append((address, data))
    written = []
    say(slave, "FF00")
    say(slave, "F6 0000 00 00010000")
    assert say(slave, "F0 0E 010203040506") == "" and say(slave, "EF 08 0708090A0B0C") == ""
    assert say(slave, "EF 02 0D0E") == "FF"
    assert written == [(0x100, bytes(range(1, 15)))] and slave.address == 0x10E


@pytest.mark.parametrize(
    ("packets", "answer"),
    [
        (("EF 02 0102",), "FE 29 00"),  # no block was begun
        (("F0 0E 010203040506", "EF 07 0708090A0B0C"), "FE 29 08"),  # eight bytes are missing
        (("F0 08 010203040506", "EF 02 07"), "FE 21"),
        (("F0 08 010203040506", "FD"), "FF 00 00 00 00 00"),  # another command ends the block
        (("F0 08 010203040506", "FD", "EF 02 0708"), "FE 29 00"),
        (("F0 08 010203040506", "EF 02 0708"), "FE 24"),  # refused as a whole
    ],
)
def test_a_block_that_is_broken_off_writes_nothing(slave, packets, answer):
    say(slave, "F6 0000 00 00010000")
    assert [say(slave, each) for each in packets][-1] == answer
    assert slave.memory.data == bytearray(range(16))


def test_a_short_download_brings_its_address_where_a_packet_has_space():
    slave = Slave(Bytes(), 248, 1400, FINE)
    say(slave, "FF00")
    assert say(slave, "ED 04 00 00 0C010000 05060708") == "FF"
    assert slave.memory.data[12:] == b"\5\6\7\x08" and slave.address == 0x110
    assert say(slave, "ED 04 00 00 00010000 05060708") == "FE 24"
    assert say(slave, "ED 04 00 00 0C010000 050607") == "FE 21"
    assert say(slave, "ED 04 00 01 0C010000 05060708") == "FE 22"


def test_a_list_reports_its_mode(slave):
    arranged(slave, "0100", "03")
    assert say(slave, "DF 00 0000") == "FF 50 00 00 01 00 03 00"  # running, with stamps; event 1, every third
    say(slave, "DE 00 0000")
    assert say(slave, "DF 00 0000") == "FF 10 00 00 01 00 03 00"
    say(slave, "DE 02 0000")
    assert say(slave, "DF 00 0000") == "FF 11 00 00 01 00 03 00"
    assert say(slave, "DF 00 0100") == "FE 22"


def test_disconnect_stops_everything_and_is_the_last_answer(slave):
    arranged(slave)
    assert say(slave, "FE") == "FF" and not slave.running and slave.lists == []
    assert say(slave, "FD") == ""


def test_several_entries_are_written_by_one_command_where_a_packet_has_space():
    slave = Slave(Bytes(), 248, 1400, FINE)
    say(slave, "FF00")
    for command in ("D6", "D500 0100", "D400 0000 01", "D300 0000 00 03", "E200 0000 00 00"):
        assert say(slave, command) == "FF"
    assert say(slave, "C7 03 FF 04 00010000 00 00 FF 02 08010000 00 00 FF 01 0A010000 00 00") == "FF"
    assert slave.lists[0].tables == [[(0x100, 4), (0x108, 2), (0x10A, 1)]]
    assert say(slave, "D8 00 0000") == "FF 04 01 03 00 00"
    assert say(slave, "C7 01 FF 04 00010000") == "FE 21"
    assert say(Slave(Bytes()), "C7 01") == ""


def test_a_list_beyond_the_transports_rate_is_refused_and_those_that_run_go_on():
    asked = []
    slave = Slave(Bytes(), bears=lambda packets: asked.append(list(packets)) or len(packets) < 3)
    say(slave, "FF00")
    arranged(slave, "0200", "03")
    assert asked[-1] == [(7, 6 * MS), (3, 6 * MS)]  # identifier, stamp and four bytes; the third of each 2 ms
    slave.bears = lambda packets: False
    assert say(slave, "DE 02 0000") == "FE 2A"


@pytest.mark.parametrize(
    "change",
    [
        ("E0 10 0000 0000 01 00",),  # from every third 2 ms to 0.5 ms
        ("D3 00 0000 00 02",),  # an entry that nobody wrote
    ],
)
def test_a_list_that_was_changed_after_it_was_selected_is_checked_again(slave, change):
    slave.bears = lambda packets: all(period_ns > MS for _, period_ns in packets)
    for command in ("D6", "D500 0100", "D400 0000 01", "D300 0000 00 01", "E200 0000 00 00", "E1FF0400 00010000",
                    "E010 0000 0200 03 00", "DE02 0000", *change):  # fmt: skip
        assert say(slave, command)[:2] == "FF", command
    assert say(slave, "DD01") == "FE 2A" and not slave.running


PACKETS = st.builds(
    lambda code, rest: bytes((code, *rest)),
    st.one_of(st.sampled_from(sorted(COMMANDS)), st.integers(0, 255)),
    st.lists(st.one_of(st.integers(0, 3), st.integers(0, 255)), max_size=7),
)


@settings(max_examples=examples(100))
@given(st.lists(PACKETS, max_size=25))
def test_whatever_is_sent_each_packet_has_one_short_answer_or_none_and_the_lists_stay_bounded(packets):
    memory = Bytes()
    slave = Slave(memory, bears=lambda asked: sum(size for size, _ in asked) < 40)
    slave.command(b"\xff\x00", 0)
    for time, packet in enumerate(packets):
        connected = slave.connected
        answer = slave.command(packet, time * MS)
        assert len(answer) <= 8 and (answer[:1] in (b"\xff", b"\xfe") or not answer)
        if not answer:  # not connected, or a block goes on
            assert not connected or slave.block is not None
        assert len(slave.lists) <= MOST_LISTS and sum(len(each.tables) for each in slave.lists) <= 252
        measured = slave.sample(time * MS, time * MS)
        assert all(len(each) <= 8 and each[0] <= 251 for each in measured) and sum(map(len, measured)) < 40
