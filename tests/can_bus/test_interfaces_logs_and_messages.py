"""Files, error frames, records and interfaces of the kernel, line by line: whole answers to whole inputs."""

import os
import struct
import sys

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ranger_sim.can_bus.edge import attach_records as wire
from ranger_sim.can_bus.edge import check_bus, dbc, interfaces, linux_errors, logs, peers
from ranger_sim.can_bus.edge.candump import CandumpWriter, frame_of_line, line_of_frame, read_candump
from ranger_sim.can_bus.edge.check_bus import NotReadError, Traffic, check_link, check_traffic, parse_link, read_link
from ranger_sim.can_bus.edge.messages import frame_of_message, message_of_frame
from ranger_sim.can_bus.frame_bytes import data_of_words, words_of_data
from ranger_sim.foundation.events import FLAG_ERROR, FLAG_EXTENDED, FLAG_REMOTE
from ranger_sim.foundation.user_error import UserError

SECOND = 1_000_000_000

# ---- candump


@pytest.mark.parametrize(
    ("line", "frame"),
    [
        ("(0.0) can1 123#", ("can1", 0, 0x123, 0, 0, 0)),
        ("(12.5) can1 7FF#11", ("can1", 12_500_000_000, 0x7FF, 1, 0x11, 0)),
        ("(1.000000001) v 000#1122334455667788", ("v", 1_000_000_001, 0, 8, 0x44332211, 0x88776655)),
        ("(0001.123456) c 1FFFFFFF#aAbBcCdDeE", ("c", 1_123_456_000, 0x1FFFFFFF, 5 | FLAG_EXTENDED, 0xDDCCBBAA, 0xEE)),
        ("  (3.1)   x   00000000#  ", ("x", 3_100_000_000, 0, FLAG_EXTENDED, 0, 0)),
        ("(3.1) x 123#R", ("x", 3_100_000_000, 0x123, FLAG_REMOTE, 0, 0)),
        ("(3.1) x 123#r8", ("x", 3_100_000_000, 0x123, FLAG_REMOTE | 8, 0, 0)),
        ("(3.1) x 00000123#R0", ("x", 3_100_000_000, 0x123, FLAG_REMOTE | FLAG_EXTENDED, 0, 0)),
        ("(3.1) x 123#00 R", ("x", 3_100_000_000, 0x123, 1, 0, 0)),
        ("(3.1) x 123#00 T", ("x", 3_100_000_000, 0x123, 1, 0, 0)),
        ("(3.1) x 20000080#0000000800000000", ("x", 3_100_000_000, 0, FLAG_ERROR, 8, 0)),
        ("(3.1) x 20000080#00000019", ("x", 3_100_000_000, 0, FLAG_ERROR, 25, 0)),
        ("(3.1) x 20000080#000000", ("x", 3_100_000_000, 0, FLAG_ERROR, 0, 0)),
        ("(3.1) x 20000080#", ("x", 3_100_000_000, 0, FLAG_ERROR, 0, 0)),
    ],
)  # fmt: skip
def test_a_line_of_candump_is_the_frame_that_it_shows(tmp_path, line, frame):
    path = tmp_path / "one.log"
    path.write_text(f"\n{line}\n   \n{line}\n", encoding="ascii")
    assert list(read_candump(path)) == [frame, frame]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("(1.0) can1 123#00 X", "not `"),
        ("(1.0) can1 123#00 R T", "not `"),
        ("(1.0) can1 123#00 00", "not `"),
        ("1.0) can1 123#00", "not `"),
        ("(1.0 can1 123#00", "not `"),
        ("(1) can1 123#00", "at most nine decimals"),
        ("(.5) can1 123#00", "at most nine decimals"),
        ("(1.) can1 123#00", "at most nine decimals"),
        ("(1.0000000001) can1 123#00", "at most nine decimals"),
        ("(-1.0) can1 123#00", "at most nine decimals"),
        ("(1.0) can1 1234#00", "three or eight hexadecimal digits"),
        ("(1.0) can1 12G#00", "three or eight hexadecimal digits"),
        ("(1.0) can1 #00", "three or eight hexadecimal digits"),
        ("(1.0) can1 800#00", "identifier 800 is above 7FF"),
        ("(1.0) can1 40000000#00", "identifier 40000000 is above 1FFFFFFF"),
        ("(1.0) can1 80000000#00", "identifier 80000000 is above 1FFFFFFF"),
        ("(1.0) can1 20000080#0", "up to eight bytes in hexadecimal"),
        ("(1.0) can1 20000080#0G", "up to eight bytes in hexadecimal"),
        ("(1.0) can1 20000080#000000000000000000", "up to eight bytes in hexadecimal"),
        ("(1.0) can1 123#000", "up to eight bytes in hexadecimal"),
        ("(1.0) can1 123#0G", "up to eight bytes in hexadecimal"),
        ("(1.0) can1 123#000000000000000000", "up to eight bytes in hexadecimal"),
        ("(1.0) can1 123#R9", "of a remote frame is not 0 ... 8"),
        ("(1.0) can1 123#R-1", "of a remote frame is not 0 ... 8"),
        ("(1.0) can1 123##1", "CAN FD"),
        ("(1.0) can1 123", "no #"),
    ],
)
def test_a_fault_in_a_line_is_reported_with_its_number(tmp_path, line, words):
    path = tmp_path / "bad.log"
    path.write_text(f"(0.0) can1 123#\n\n{line}\n", encoding="ascii")
    found = []
    with pytest.raises(UserError, match=words) as caught:
        for frame in read_candump(path):
            found.append(frame)
    assert str(caught.value).startswith(f"{path}:3: ") and len(found) == 1


@pytest.mark.parametrize(
    ("frame", "text"),
    [
        ((0, 0x7FF, 0, 0, 0), "(0000000000.000000) c 7FF#"),
        ((999, 0x1, 1, 0xAB, 0), "(0000000000.000000) c 001#AB"),
        ((1_000, 0x1, 3, 0x00CDAB, 0), "(0000000000.000001) c 001#ABCD00"),
        ((SECOND - 1, 0x7FF, 5 | FLAG_EXTENDED, 0x04030201, 0xFF05), "(0000000000.999999) c 000007FF#0102030405"),
        ((12_345 * SECOND, 0x1, 15, 1, 2), "(0000012345.000000) c 001#0100000002000000"),
        ((0, 0x1, 12 | FLAG_REMOTE, 0, 0), "(0000000000.000000) c 001#R8"),
        ((0, 0x1, 0 | FLAG_REMOTE | FLAG_EXTENDED, 0, 0), "(0000000000.000000) c 00000001#R0"),
        ((0, 0x1, FLAG_ERROR | 8, 0x119, 7), "(0000000000.000000) c 20000080#0000001900000000"),
    ],
)
def test_a_frame_is_the_line_that_candump_would_write(frame, text):
    assert line_of_frame("c", *frame) == text + "\n"


@pytest.mark.parametrize("content", ["", "1G0", "10G", "100000", "1" + "00" * 65])
def test_a_can_fd_line_has_a_digit_of_flags_and_up_to_64_bytes(content):
    assert frame_of_line("(1.0) can1 123##1" + "00" * 64, fd=True)[2] == 0x123
    with pytest.raises(ValueError, match="not a digit of flags and up to 64 bytes in hexadecimal"):
        frame_of_line(f"(1.0) can1 123##{content}", fd=True)


def test_a_limit_of_one_byte_reads_one_and_a_limit_of_none_reads_nothing():
    out, into = os.pipe()
    try:
        os.write(into, b"abc")
        assert [peers.read_ready(out, limit) for limit in (0, 1, 2)] == [b"", b"a", b"bc"]
    finally:
        os.close(out)
        os.close(into)


def test_a_writer_counts_lines_and_ends_with_a_whole_one_when_the_disk_is_full(tmp_path):
    path = tmp_path / "some.log"
    frames = [(n * 1000, n, 1, n, 0) for n in range(5)]
    with CandumpWriter(path) as writer:
        assert (writer.frames, writer.path) == (0, path)
        writer.write("c", frames[:2])
        writer.write("c", [])
        written = path.read_text()  # at once, without a buffer
        assert written.splitlines() == [line_of_frame("c", *frame).strip() for frame in frames[:2]]

        class Full:
            """Takes half of what it is given, then nothing."""

            def __init__(self, file):
                self.file, self.taken = file, 0

            def write(self, data):
                if self.taken:
                    raise OSError(28, "No space left on device")
                self.taken = self.file.write(data[: len(data) // 2])
                return self.taken

            def __getattr__(self, name):
                return getattr(self.file, name)

        whole = writer.file
        writer.file = Full(whole)
        with pytest.raises(OSError, match="No space left"):
            writer.write("c", frames[2:])
        assert path.read_text() == written and writer.frames == 2
        writer.file = whole
        whole.seek(0, 2)
        writer.write("d", frames[2:])
    assert writer.frames == 5 and len(list(read_candump(path))) == 5 and writer.file.closed


def test_a_file_that_is_not_ascii_is_not_a_log(tmp_path):
    path = tmp_path / "odd.log"
    path.write_bytes(b"(1.0) can1 123#\xff\n")
    with pytest.raises(UserError, match=r"odd.log: the frame log cannot be read \(not plain ASCII\)"):
        list(read_candump(path))
    with pytest.raises(UserError, match=r"cannot be read \(No such file"):
        list(read_candump(tmp_path / "none.log"))


# ---- messages


@pytest.mark.parametrize(
    ("frame", "fields"),
    [
        ((1_500_000_000, 0x7FF, 0, 0, 0), (1.5, 0x7FF, False, False, 0, b"")),
        ((0, 0x1, 5 | FLAG_EXTENDED, 0x04030201, 0xFF05), (0.0, 1, True, False, 5, b"\1\2\3\4\5")),
        ((0, 0x1, 3 | FLAG_REMOTE, 0, 0), (0.0, 1, False, True, 3, b"")),
        ((0, 0x1, 15, 1, 2), (0.0, 1, False, False, 8, b"\1\0\0\0\2\0\0\0")),
    ],
)
@pytest.mark.parametrize("is_rx", [True, False])
def test_a_frame_and_its_message_say_the_same(frame, fields, is_rx):
    message = message_of_frame(*frame, channel="c", is_rx=is_rx)
    assert fields == (
        message.timestamp, message.arbitration_id, message.is_extended_id, message.is_remote_frame, message.dlc,
        bytes(message.data),
    )  # fmt: skip
    assert (message.channel, message.is_rx, message.is_error_frame, message.is_fd) == ("c", is_rx, False, False)
    assert message_of_frame(*frame).is_rx and message_of_frame(*frame).channel is None


def test_an_error_frame_has_no_content_in_either_way():
    message = message_of_frame(2_500_000_000, 5, 8 | FLAG_ERROR, 1, 2, "c", False)
    assert (message.is_error_frame, message.timestamp, message.channel, message.is_rx) == (True, 2.5, "c", False)
    assert (message.arbitration_id, message.dlc) == (0, 0)
    assert frame_of_message(message) == (0, FLAG_ERROR, 0, 0)


@given(st.binary(max_size=8))
def test_words_are_bytes_in_little_endian_order(data):
    padded = data + bytes(8 - len(data))
    assert words_of_data(data) == struct.unpack("<II", padded)
    for code in range(16):
        assert data_of_words(code, *words_of_data(data)) == padded[: min(code, 8)]
        assert data_of_words(code | FLAG_REMOTE, *words_of_data(data)) == b""


# ---- recordings of other programs


@pytest.mark.parametrize("suffix", [".asc", ".blf", ".csv", ".trc"])
def test_recordings_of_python_can_are_read_without_their_error_frames(tmp_path, suffix):
    path = tmp_path / f"r{suffix}"
    sent = [
        can.Message(timestamp=1000.5, arbitration_id=0x123, data=b"\1\2", is_extended_id=False, channel=0),
        can.Message(timestamp=1000.75, arbitration_id=0x1ABCDEF0, data=b"\3" * 8, channel=0),
    ]
    with can.Logger(path) as writer:
        writer.on_message_received(sent[0])
        if suffix != ".trc":
            writer.on_message_received(can.Message(timestamp=1000.6, is_error_frame=True, channel=0))
        writer.on_message_received(sent[1])
    found = list(logs.read_log(path))
    assert [frame[2:] for frame in found] == [
        (0x123, 2, 0x0201, 0), (0x1ABCDEF0, 8 | FLAG_EXTENDED, 0x03030303, 0x03030303),
    ]  # fmt: skip
    assert found[1][1] - found[0][1] == pytest.approx(250_000_000, abs=1_000_000)
    assert all(isinstance(frame[0], str) and isinstance(frame[1], int) for frame in found)
    if suffix == ".blf":
        assert [frame[:2] for frame in found] == [("0", 0), ("0", 250_000_000)]  # since its first
    if suffix == ".csv":
        assert found[0][0] == ""  # that format has no channel


def test_candumps_own_recordings_are_read_without_their_error_frames(tmp_path):
    path = tmp_path / "r.log"
    path.write_text("(1.0) a 123#11\n(2.0) a 20000080#0000000800000000\n(3.0) b 1FFFFFFF#R2\n", encoding="ascii")
    assert list(logs.read_log(path)) == [
        ("a", SECOND, 0x123, 1, 0x11, 0), ("b", 3 * SECOND, 0x1FFFFFFF, 2 | FLAG_REMOTE | FLAG_EXTENDED, 0, 0),
    ]  # fmt: skip


def test_a_recording_that_cannot_be_read_is_one_line(tmp_path):
    for name in ("none.asc", "r.xyz"):
        with pytest.raises(UserError, match=rf"{name}: the recording cannot be read \(.+\)$"):
            list(logs.read_log(tmp_path / name))
    fd = tmp_path / "fd.blf"
    with can.Logger(fd) as writer:
        writer.on_message_received(can.Message(arbitration_id=7, is_fd=True, data=bytes(12), channel=0))
    log = logs.read_log(fd)
    assert list(log) == [] and log.read == 1 and sum(count for _, count, _ in log.losses) == 1


# ---- error frames of Linux: linux/can/error.h by its numbers

BUS_ERROR, WARNING, PASSIVE, RECEIVING = 0x80, 0x4, 0x20, 1 << 21
KINDS = {0: 0x01, 1: 0x02, 2: 0x04, 3: 0x00}  # CAN_ERR_PROT_BIT, _FORM, _STUFF, _UNSPEC


@pytest.mark.parametrize("field", [2, 8, 10, 24, 25, 26, 31])
@pytest.mark.parametrize("kind", [0, 1, 2, 3])
@pytest.mark.parametrize("receiving", [0, RECEIVING])
@pytest.mark.parametrize("more", [0, WARNING, PASSIVE])
def test_an_error_frame_has_place_kind_and_sender(field, kind, receiving, more):
    interrupts = BUS_ERROR | receiving | field << 16 | kind << 22 | more
    frame = linux_errors.frame_of_status(interrupts, (8, 300), False, False)
    acknowledgement = kind == 3 and field == 25
    classes = 0x200 | 0x80 | (0x20 if acknowledgement else 0x8) | (0x4 if more else 0)
    what = 0 if acknowledgement else KINDS[kind] | (0 if receiving else 0x80)
    controller = 0x10 if more else 0  # CAN_ERR_CRTL_RX_PASSIVE
    data = bytes([0, controller, what, field, 0, 0, 8, 255])
    assert frame == (classes, FLAG_ERROR | 8, *struct.unpack("<II", data))


@pytest.mark.parametrize(
    ("was_off", "off", "classes"), [(False, True, 0x40), (True, False, 0x100), (True, True, 0x4), (False, False, 0x4)]
)
def test_going_off_and_coming_back_take_the_place_of_what_a_controller_says(was_off, off, classes):
    frame = linux_errors.frame_of_status(WARNING, (10, 20), was_off, off)
    status = 0x40 if classes == 0x4 else 0  # CAN_ERR_CRTL_ACTIVE: both are below the warning limit
    assert frame == (0x200 | classes, FLAG_ERROR | 8, status << 8, 10 << 16 | 20 << 24)


def test_too_slow_a_reader_is_reported_by_a_class_and_a_bit():
    assert linux_errors.overflow() == (0x4, FLAG_ERROR | 8, 0x0100, 0)


# ---- records of attaching


@pytest.mark.parametrize("cut", range(1, 12))
def test_records_in_pieces_are_the_same_and_leave_the_buffer_as_they_are_taken(cut):
    whole = wire.record(9, b"\1") + wire.record(3, b"why") + wire.record(77)
    for read in (wire.records_of, lambda buffer: iter(lambda: wire.next_record(buffer), None)):
        buffer, found = bytearray(), []
        for at in range(0, len(whole), cut):
            buffer += whole[at : at + cut]
            found += list(read(buffer))
        assert found == [(9, b"\1"), (3, b"why"), (77, b"")] and not buffer


def test_records_that_are_read_one_by_one_leave_the_rest():
    buffer = bytearray(wire.record(1, b"a") + wire.record(2, b"b"))
    records = wire.records_of(buffer)
    assert next(records) == (1, b"a")
    records.close()
    assert bytes(buffer) == wire.record(2, b"b")
    assert wire.next_record(buffer) == (2, b"b") and not buffer


@pytest.mark.parametrize(("length", "fits"), [(0, False), (1, True), (1024, True), (1025, False), (1 << 31, False)])
def test_a_record_has_1_to_1024_bytes(length, fits):
    data = struct.pack("<IB", length, 7) + bytes(min(length, 2000) - 1 if length else 0)
    for read in (wire.next_record, lambda buffer: next(wire.records_of(buffer), None)):
        if fits:
            assert read(bytearray(data)) == (7, bytes(length - 1))
            assert read(bytearray(data[:-1])) is None if length > 1 else True
        else:
            with pytest.raises(wire.MalformedError, match=f"a record of {length} bytes is outside 1 ... 1024"):
                read(bytearray(data))
    assert wire.next_record(bytearray(data[:4])) is None


def test_a_body_has_exactly_the_bytes_of_its_layout():
    assert wire.unpacked(struct.Struct("<HH"), b"\1\0\2\0") == (1, 2)
    for body in (b"\1\0\2", b"\1\0\2\0\0"):
        with pytest.raises(wire.MalformedError, match=f"a body of {len(body)} bytes where 4 belong"):
            wire.unpacked(struct.Struct("<HH"), body)


@pytest.mark.parametrize(
    ("name", "fits"),
    [
        ("a", True), ("A-z_0.9", True), ("x" * 64, True),
        ("x" * 65, False), ("", False), ("a b", False), ("ä", False), ("a/b", False),
    ],
)  # fmt: skip
def test_names_are_one_to_64_plain_characters(name, fits):
    if fits:
        assert wire.address_of(name) == "\0ranger-sim/" + name
    else:
        with pytest.raises(UserError, match="is not 1 ... 64 letters"):
            wire.address_of(name)


def test_names_that_run_are_those_that_listen_under_our_prefix(monkeypatch, tmp_path):
    """Rows of /proc/net/unix: Num RefCount Protocol Flags Type St Inode Path; flag 0x10000 listens (linux/net.h)."""
    table = tmp_path / "unix"
    table.write_text(
        "Num       RefCount Protocol Flags    Type St Inode Path\n"
        "0000: 00000002 00000000 00010000 0001 01 11 @ranger-sim/two\n"
        "0000: 00000002 00000000 00010000 0001 01 12 @ranger-sim/one\n"
        "0000: 00000003 00000000 00000000 0001 03 13 @ranger-sim/accepted\n"
        "0000: 00000002 00000000 00010000 0001 01 14 @other/three\n"
        "0000: 00000002 00000000 00010000 0001 01 15\n"
        "0000: 00000002 00000000 00010000 0001 01 16 @ranger-sim/with space\n"
    )
    real = open
    monkeypatch.setattr("builtins.open", lambda _path, **options: real(table, **options))
    assert wire.names_running() == ["one", "two"]
    table.unlink()
    assert wire.names_running() == []


# ---- DBC files

DBC = """VERSION ""
NS_ :
BS_:
BU_: A
BO_ 291 PLAIN: 5 A
BO_ 2147484672 LONG: 8 A
BO_ 3 SILENT: 1 A
BO_ 4 SLOW: 1 A
BO_ 5 NEVER: 1 A
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 2000000000;
BA_DEF_ "Baudrate" INT 0 10000000;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_DEF_DEF_ "Baudrate" 0;
BA_ "GenMsgCycleTime" BO_ 291 20;
BA_ "GenMsgCycleTime" BO_ 2147484672 1;
BA_ "GenMsgCycleTime" BO_ 4 1000000000;
BA_ "GenMsgCycleTime" BO_ 5 1000000001;
BA_ "Baudrate" RATE;
"""


def test_a_dbc_file_gives_identifiers_lengths_and_periods(tmp_path):
    path = tmp_path / "net.dbc"
    path.write_text(DBC.replace("RATE", "500"))
    found = dbc.read_messages(path, None)
    messages, rate, silent = found.messages, found.bit_rate, found.silent
    assert rate == 500_000 and silent == ["SILENT", "NEVER"]
    # bits: 44 or 64, eight a byte, a stuff bit for each four of the stuffed region but the first, three between frames
    assert [(m.name, m.key, m.bits, m.period_ns, m.deadline_ns, m.jitter_ns, m.queue) for m in messages] == [
        ("PLAIN", 0x123 << 21, 44 + 40 + (34 + 40 - 1) // 4 + 3, 20_000_000, 20_000_000, 0, ""),
        ("LONG", 0x180000 | 1024 << 1, 64 + 64 + (54 + 64 - 1) // 4 + 3, 1_000_000, 1_000_000, 0, ""),
        ("SLOW", 4 << 21, 44 + 8 + (34 + 8 - 1) // 4 + 3, 10**15, 10**15, 0, ""),
    ]
    assert dbc.read_messages(path, 125_000).bit_rate == 125_000


@pytest.mark.parametrize(
    ("reported", "rate"), [("1", 1_000), ("9999", 9_999_000), ("10000", 10_000), ("1000000", 1_000_000)]
)
def test_below_10000_a_bit_rate_is_in_kbit_s(tmp_path, reported, rate):
    path = tmp_path / "net.dbc"
    path.write_text(DBC.replace("RATE", reported))
    assert dbc.read_messages(path, None).bit_rate == rate


def test_a_dbc_file_without_a_rate_that_it_needs_is_refused(tmp_path):
    path = tmp_path / "net.dbc"
    path.write_text(DBC.replace("RATE", "0"))
    with pytest.raises(UserError, match=r"net.dbc: has no bit rate .*--bit-rate"):
        dbc.read_messages(path, None)
    assert dbc.read_messages(path, 250_000).bit_rate == 250_000
    path.write_text(DBC.replace("RATE", "500").replace("SILENT: 1", "SILENT: 9"))
    with pytest.raises(UserError, match="message SILENT is of CAN FD, and the file has no data bit rate"):
        dbc.read_messages(path, None)
    with pytest.raises(UserError, match="none.dbc: cannot be read: No such file"):
        dbc.read_messages(tmp_path / "none.dbc", None)


# ---- interfaces of the kernel


def link(**changes):
    """A controller of 1 Mbit/s that is up and well, as `ip` shows it."""
    data = {"state": "ERROR-ACTIVE", "berr_counter": {"tx": 0, "rx": 0}, "bittiming": {"bitrate": 1_000_000}}
    whole = {"ifname": "can0", "flags": ["UP"], "txqlen": 100, "link_type": "can"}
    whole["linkinfo"] = {"info_kind": "can", "info_data": data}
    for key, value in changes.items():
        if key in data:
            data[key] = value
        else:
            whole[key] = value
    return whole


def findings(found, device="can0", rate=1_000_000):
    return {each.what: (each.ok, each.mend) for each in check_link(device, rate, lambda _: found)}


WELL = {
    "there": (True, ""), "bit rate": (True, ""), "up": (True, ""), "state": (True, ""), "errors": (True, ""),
}  # fmt: skip
UP = "ip link set can0 up"
RESTART = "ip link set can0 down && ip link set can0 up"
RATE = "ip link set can0 type can bitrate 1000000"
WATCH = "ip -details -statistics link show can0"


@pytest.mark.parametrize(
    ("changes", "others"),
    [
        ({}, {}),
        ({"bittiming": {"bitrate": 999_999}}, {"bit rate": (False, f"ip link set can0 down && {RATE} && {UP}")}),
        ({"bittiming": {}}, {"bit rate": (False, f"{RATE} && {UP}")}),
        ({"bittiming": None}, {"bit rate": (False, f"{RATE} && {UP}")}),
        ({"flags": []}, {"up": (False, UP), "state": (None, "")}),
        ({"flags": ["LOWER_UP"]}, {"up": (False, UP), "state": (None, "")}),
        ({"berr_counter": {"tx": 95, "rx": 95}}, {}),
        ({"berr_counter": {"tx": 96, "rx": 0}}, {"errors": (False, WATCH)}),
        ({"berr_counter": {"tx": 0, "rx": 96}}, {"errors": (False, WATCH)}),
        ({"berr_counter": {"tx": 0, "rx": 96}, "flags": []}, {"up": (False, UP), "state": (None, "")}),
        ({"berr_counter": None}, {}),
        ({"state": "ERROR-WARNING"}, {"state": (False, RESTART)}),
        ({"state": "ERROR-PASSIVE"}, {"state": (False, RESTART)}),
        ({"state": "BUS-OFF"}, {"state": (False, "ip link set can0 type can restart")}),
        ({"state": "STOPPED"}, {"state": (None, "")}),
        ({"txqlen": 99}, {"queue": (None, "ip link set can0 txqueuelen 1000")}),
        ({"txqlen": "99"}, {}),
    ],
)
def test_each_thing_that_can_be_wrong_with_a_controller_has_its_finding_and_what_mends_it(changes, others):
    assert findings(link(**changes)) == {**WELL, **others}


def test_a_link_with_few_details_is_reported_as_far_as_they_go():
    assert findings({"ifname": "can0", "link_type": "can"}) == {
        **WELL, "bit rate": (False, f"{RATE} && {UP}"), "up": (False, UP), "state": (None, ""),
    }  # fmt: skip
    little = {"ifname": "can0", "link_type": "can", "flags": ["UP"], "txqlen": 10, "only_sys": True}
    assert findings(little) == {
        "there": (True, ""), "bit rate": (None, "apt install iproute2"), "up": (True, ""),
        "queue": (None, "ip link set can0 txqueuelen 1000"),
    }  # fmt: skip


@pytest.mark.parametrize(
    ("device", "kind", "virtual"),
    [
        ("vcan0", "vcan", True), ("vxcan3", "vxcan", True), ("mine", "vcan", True), ("vcan0", "can", False),
        ("vcan1", None, True), ("vxcan1", None, True), ("can0", None, False),
    ],
)  # fmt: skip
def test_a_virtual_interface_is_recognised_by_its_kind_or_by_its_name(device, kind, virtual):
    found = {"ifname": device, "link_type": "can", "flags": ["UP"], "txqlen": 10}
    if kind:
        found["linkinfo"] = {"info_kind": kind}
    reported = findings(found, device)
    assert ("state" in reported, "queue" in reported) == (not virtual, not virtual)
    if virtual:
        assert reported == {"there": (True, ""), "bit rate": (None, ""), "up": (True, "")}


def test_an_interface_that_cannot_be_read_is_reported_with_the_command_that_shows_it():
    def broken(_):
        raise NotReadError("not permitted")

    [finding] = check_link("can0", 1, broken)
    assert (finding.what, finding.ok, finding.mend) == ("there", False, "ip -details link show can0")
    assert finding.text == "cannot be read: not permitted"


def test_errors_since_the_interface_exists_are_reported_when_they_happened():
    found = link(berr_counter={"tx": 3, "rx": 4})
    found["linkinfo"]["info_xstats"] = {"bus_error": 0, "arbitration_lost": 7, "bus_off": 1}
    [text] = [each.text for each in check_link("can0", 1_000_000, lambda _: found) if each.what == "errors"]
    assert text == "error counters tx 3, rx 4; since it is there: arbitration lost 7, bus off 1"


@pytest.mark.parametrize(
    ("text", "index"),
    [('[{"ifname": "b"}, {"ifname": "a", "n": 1}, {"ifname": "a", "n": 2}]', 1), ('[7, {"ifname": "a", "n": 1}]', 1)],
)
def test_of_several_links_the_first_of_that_name_counts(text, index):
    assert parse_link(text, "a") == {"ifname": "a", "n": index}


@pytest.mark.parametrize("text", ["{}", "[]", "[{}]", '{"ifname": "a"}', "7", '[{"ifname": "b"}]'])
def test_json_without_that_link_is_a_missing_interface(text):
    with pytest.raises(NotReadError, match="^does not exist$"):
        parse_link(text, "a")


@pytest.mark.parametrize("failing", ["flags", "type", "tx_queue_len"])
def test_without_ip_a_broken_folder_of_sys_is_reported(tmp_path, monkeypatch, failing):
    def missing(*_, **__):
        raise FileNotFoundError("ip")

    monkeypatch.setattr(check_bus.subprocess, "run", missing)
    (tmp_path / "can0").mkdir()
    for file, text in (("flags", "0x40081"), ("type", "280"), ("tx_queue_len", "10")):
        (tmp_path / "can0" / file).write_text(text + "\n")
    assert read_link("can0", tmp_path) == {
        "ifname": "can0", "flags": ["UP"], "link_type": "can", "txqlen": 10, "only_sys": True,
    }  # fmt: skip
    (tmp_path / "can0" / "type").write_text("1\n")  # ARPHRD_ETHER
    (tmp_path / "can0" / "flags").write_text("0x1002\n")
    assert read_link("can0", tmp_path)["link_type"] == "1" and read_link("can0", tmp_path)["flags"] == []
    (tmp_path / "can0" / failing).write_text("nothing")
    with pytest.raises(NotReadError, match="can0 cannot be read: "):
        read_link("can0", tmp_path)


def test_ip_that_ends_without_output_is_reported_by_its_code(monkeypatch):
    monkeypatch.setattr(
        check_bus.subprocess, "run", lambda call, **_: check_bus.subprocess.CompletedProcess(call, 3, "", " \n")
    )
    with pytest.raises(NotReadError, match="^ip left with 3$"):
        read_link("can0")


KNOWN = {n: f"B{n}_X" for n in range(8)}


@pytest.mark.parametrize(
    ("traffic", "expected", "reported"),
    [
        (Traffic(2.0, 5, 0, {1: 5}), {}, {"traffic": (True, "5 frames in 2 s (2/s): B1_X")}),
        (Traffic(0.0, 0, 0, {}), {}, {"traffic": (None, "0 frames in 0 s (0/s)")}),
        (
            Traffic(1.0, 9, 0, {n: 1 for n in range(5)}),
            {},
            {"traffic": (True, "9 frames in 1 s (9/s): B0_X, B1_X, B2_X, B3_X ...")},
        ),
        (
            Traffic(1.0, 4, 0, {n: 1 for n in range(4)}),
            {3: "B3_X", 5: "B5_X"},
            {"traffic": (True, "4 frames in 1 s (4/s): B0_X, B1_X, B2_X, B3_X")},
        ),
        (
            Traffic(1.0, 4, 0, {1: 4}),
            {3: "B3_X", 5: "B5_X", 6: "B3_Y"},
            {"traffic": (False, "4 frames in 1 s (4/s), none of them from B3, B5: is it powered and on this bus?")},
        ),
        (
            Traffic(1.0, 9, 1, {n: 1 for n in range(100, 108)}),
            {},
            {
                "traffic": (True, "9 frames in 1 s (9/s)"),
                "identifiers": (False, "not of this bus: 100, 101, 102, 103, 104, 105, 106, 107"),
                "error frames": (False, "1 while listening"),
            },
        ),
        (
            Traffic(1.0, 9, 0, {n: 1 for n in range(100, 109)}),
            {},
            {
                "traffic": (True, "9 frames in 1 s (9/s)"),
                "identifiers": (False, "not of this bus: 100, 101, 102, 103, 104, 105, 106, 107 ..."),
            },
        ),
    ],
)
def test_traffic_is_listed_with_its_rate_its_names_and_what_does_not_belong(traffic, expected, reported):
    found = check_traffic("can0", traffic, KNOWN, expected)
    assert {each.what: (each.ok, each.text) for each in found} == reported
    assert [each.mend for each in found] == ["candump -e can0" if each.ok is False else "" for each in found]


def test_listening_lasts_as_long_as_requested_and_ends_with_the_bus_shut(monkeypatch):
    now, shut = [100.0], []

    class Heard:
        messages = [
            (0.5, can.Message(arbitration_id=1)), (0.5, None), (0.5, can.Message(is_error_frame=True)),
            (0.4, can.Message(arbitration_id=1)), (0.1, can.Message(arbitration_id=2)),
            (9.0, can.Message(arbitration_id=3)),
        ]  # fmt: skip

        def __init__(self, **arguments):
            assert arguments == {"channel": "x"}
            self.left = list(self.messages)
            self.patience = []

        def recv(self, timeout):
            self.patience.append(timeout)
            passed, message = self.left.pop(0)
            now[0] += passed
            if message is not None and message.arbitration_id == 3:
                raise can.CanOperationError("two\nlines")
            return message

        def shutdown(self):
            shut.append(self.patience)

    monkeypatch.setattr(check_bus.can, "Bus", Heard)
    monkeypatch.setattr(check_bus.wallclock, "monotonic_s", lambda: now[0])
    assert check_bus.observe({"channel": "x"}, 2.0) == Traffic(2.0, 3, 1, {1: 2, 2: 1})
    assert shut[0] == pytest.approx([2.0, 1.5, 1.0, 0.5, 0.1])
    with pytest.raises(NotReadError, match="^CanOperationError: two lines$"):
        check_bus.observe({"channel": "x"}, 5.0)
    assert len(shut) == 2


# ---- interfaces of python-can


def test_interfaces_that_are_always_there_or_slow_to_find_are_not_looked_for(monkeypatch):
    asked = []

    def detect(names):
        asked.extend(names)
        return [{"interface": "b", "channel": 1}, {"interface": "a", "channel": "x"}, {"interface": "b", "channel": 1}]

    monkeypatch.setattr(interfaces.can, "detect_available_configs", detect)
    log = interfaces.logging.getLogger("can")
    before = log.level
    assert interfaces.available_interfaces() == ["a:x", "b:1"]
    assert log.level == before
    assert set(can.VALID_INTERFACES) - set(asked) == {"virtual", "udp_multicast", "socketcand"} and asked == sorted(
        asked
    )
    assert interfaces.known_interfaces() == tuple(sorted(can.VALID_INTERFACES))


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="abstract sockets")
def test_the_name_that_is_taken_when_none_is_given():
    assert wire.DEFAULT_NAME == "ranger"
