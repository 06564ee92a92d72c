"""Recordings of CAN FD frames in every format: written by other programs from our bus, read by them and by us."""

import pathlib
import struct

import can
import pytest

from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.edge import logs
from ranger_sim.can_bus.edge.candump import CandumpWriter, frame_of_line, line_of_frame, read_candump
from ranger_sim.can_bus.edge.messages import message_of_frame
from ranger_sim.can_bus.fd_frame import LENGTHS, length_code
from ranger_sim.foundation.events import (
    FLAG_BRS,
    FLAG_ESI,
    FLAG_EXTENDED,
    FLAG_FD,
    ORDER_BUS,
    EventQueue,
)
from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.readers import frames

SENT = [
    (0x100, FLAG_FD | FLAG_BRS | length_code(64), bytes(range(64))),
    (0x101, FLAG_FD | FLAG_ESI | length_code(12), b"\xff" * 12),
    (0x1ABCDEF0, FLAG_FD | FLAG_EXTENDED | length_code(5), b"\x01\x02\x03\x04\x05"),
    (0x102, FLAG_FD, b""),
]
CLASSIC = (0x7FF, 8, 0x04030201, 0x08070605)


@pytest.fixture
def logged():
    """(time_ns, identifier, flags, lo, hi) of the frames of a CAN FD bus, in the order of its log."""
    bus = Bus("can1", 500_000, data_bitrate=2_000_000)
    for number in range(2):
        bus.add_node(f"n{number}", EventQueue(64), 1, ORDER_BUS + number)
    for turn, (identifier, flags, data) in enumerate(SENT):
        bus.request_fd(0, 1, turn * 10**7, identifier, flags, data)
        bus.advance((turn + 1) * 10**7)
    bus.request(0, 1, 4 * 10**7, *CLASSIC)
    bus.advance(5 * 10**7)
    found = [frame[:5] for frame in bus.log.take()]
    assert [frame[1:3] for frame in found] == [frame[:2] for frame in SENT] + [CLASSIC[:2]]
    return found


def data_of(lo, hi, flags):
    return (lo | hi << 32).to_bytes(64, "little")[: LENGTHS[flags & 15]]


def record(path, logged):
    with can.Logger(path) as writer:
        for frame in logged:
            writer.on_message_received(message_of_frame(*frame, channel=0))


def test_lines_of_a_candump_log_are_those_of_can_utils():
    """`##`, a digit of flags (1: BRS, 2: ESI), the data: the format of can-utils' candump and cansend."""
    frame = (1_500_000_000, 0x123, FLAG_FD | FLAG_BRS | FLAG_ESI | 2, 0x2211, 0)
    line = "(0000000001.500000) can1 123##31122\n"
    assert line_of_frame("can1", *frame) == line
    assert frame_of_line(line, fd=True) == ("can1", *frame)
    assert frame_of_line("(1.5) c 00000123##4\n", fd=True) == ("c", 1_500_000_000, 0x123, FLAG_FD | FLAG_EXTENDED, 0, 0)


@pytest.mark.parametrize(
    ("frame", "words"),
    [
        ("123##", "not a digit of flags and up to 64 bytes"),
        ("123##1123", "not a digit of flags and up to 64 bytes"),
        ("123##1" + "00" * 65, "not a digit of flags and up to 64 bytes"),
        ("123##1" + "00" * 9, "9 bytes are not a length of a CAN FD frame"),
    ],
)
def test_a_broken_line_is_refused_by_name(tmp_path, frame, words):
    path = tmp_path / "r.log"
    path.write_text(f"(1.0) can1 {frame}\n", encoding="ascii")
    with pytest.raises(UserError, match=rf"r.log:1: .*{words}"):
        list(read_candump(path, fd=True))


def test_our_candump_log_is_read_by_python_can_and_by_us(tmp_path, logged):
    path = tmp_path / "can1.log"
    with CandumpWriter(path) as writer:
        writer.write("can1", logged)
    with can.CanutilsLogReader(path) as reader:
        found = [(m.arbitration_id, m.is_fd, m.bitrate_switch, m.error_state_indicator, bytes(m.data)) for m in reader]
    assert found[0] == (0x100, True, True, False, bytes(range(64)))
    assert found[1] == (0x101, True, False, True, b"\xff" * 12)
    assert found[4] == (0x7FF, False, False, False, bytes(range(1, 9)))
    assert [frame[2:] for frame in read_candump(path, fd=True)] == [frame[1:] for frame in logged]
    with pytest.raises(UserError, match=r"can1.log:1: .*is CAN FD"):
        list(read_candump(path))


@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf", ".mf4"])
def test_what_python_can_records_from_our_bus_is_read_back_by_it_and_by_us(tmp_path, logged, suffix):
    path = tmp_path / f"r{suffix}"
    record(path, logged)
    with can.LogReader(path) as reader:
        theirs = [(m.arbitration_id, m.is_fd, m.bitrate_switch, m.error_state_indicator, bytes(m.data)) for m in reader]
    assert theirs == [
        (identifier, True, bool(flags & FLAG_BRS), bool(flags & FLAG_ESI), data) for identifier, flags, data in SENT
    ] + [(0x7FF, False, False, False, bytes(range(1, 9)))]
    log = logs.read_log(path, fd=True)
    ours = list(log)
    assert [frame[2:] for frame in ours] == [frame[1:] for frame in logged]
    assert (log.read, log.losses) == (5, [])
    assert ours[1][1] - ours[0][1] == pytest.approx(logged[1][0] - logged[0][0], abs=1_000_000)


@pytest.mark.parametrize("suffix", [".csv", ".db"])
def test_formats_without_a_mark_for_can_fd_show_it_by_the_length_only(tmp_path, logged, suffix):
    path = tmp_path / f"r{suffix}"
    record(path, logged)
    found = [frame[2:] for frame in logs.read_log(path, fd=True)]
    flags = [each[1] for each in found]
    assert flags == [FLAG_FD | 15, FLAG_FD | 9, FLAG_EXTENDED | 5, 0, 8]
    assert data_of(found[0][2], found[0][3], flags[0]) == bytes(range(64))
    log = logs.read_log(path)
    assert [frame[2] for frame in log] == [0x1ABCDEF0, 0x102, 0x7FF] and log.losses == [("can_fd", 2, "")]


def test_asammdf_reads_the_bus_logging_of_our_frames(tmp_path, logged):
    asammdf = pytest.importorskip("asammdf")
    path = tmp_path / "r.mf4"
    record(path, logged)
    with asammdf.MDF(path) as mdf:
        frames_of = mdf.get("CAN_DataFrame").samples
        named = {name.rsplit(".", 1)[-1]: name for name in frames_of.dtype.names}
        assert frames_of[named["ID"]].tolist() == [0x100, 0x101, 0x1ABCDEF0, 0x102, 0x7FF]
        assert frames_of[named["EDL"]].tolist() == [1, 1, 1, 1, 0]
        assert frames_of[named["BRS"]].tolist() == [1, 0, 0, 0, 0]
        assert frames_of[named["ESI"]].tolist() == [0, 1, 0, 0, 0]
        assert frames_of[named["DataLength"]].tolist() == [64, 12, 5, 0, 8]
        assert bytes(frames_of[named["DataBytes"]][0].tolist()) == bytes(range(64))


def test_a_trace_of_pcan_view_with_fd_frames_is_read(tmp_path):
    """Version 2.1 by its published description: FB is a frame with BRS, the code 9 means twelve bytes."""
    path = tmp_path / "r.trc"
    path.write_text(
        ";$FILEVERSION=2.1\n;$STARTTIME=43474.5\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n"
        "      1      10.000 FB 1      0100 Rx -  9    01 02 03 04 05 06 07 08 09 0A 0B 0C\n"
        "      2      20.000 DT 1      0101 Rx -  1    FF\n",
        encoding="ascii",
    )
    log = logs.read_log(path, fd=True)
    first, second = [frame[2:] for frame in log]
    assert first == (0x100, FLAG_FD | FLAG_BRS | 9, 0x04030201, int.from_bytes(bytes(range(5, 13)), "little"))
    assert second == (0x101, 1, 0xFF, 0) and log.losses == []


def test_a_packet_capture_with_fd_frames_is_read(tmp_path):
    """A capture of link type 227 by its description: identifier big-endian, length, flags 4 (FD) and 1 (BRS)."""
    packet = struct.pack(">IBBBB", 0x100, 12, 0x04 | 0x01, 0, 0) + bytes(range(12))
    path = tmp_path / "r.pcap"
    head = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 227)
    path.write_bytes(head + struct.pack("<IIII", 1, 0, len(packet), len(packet)) + packet)
    [frame] = logs.read_log(path, fd=True)
    assert frame[2:4] == (0x100, FLAG_FD | FLAG_BRS | 9)
    assert data_of(*frame[4:], frame[3]) == bytes(range(12))


def test_signals_behind_the_eighth_byte_become_channels(tmp_path, logged):
    path = pathlib.Path(tmp_path, "r.asc")
    record(path, logged)
    database = tmp_path / "fd.dbc"
    database.write_text(
        'VERSION ""\nNS_ :\nBS_:\nBU_: A\n\nBO_ 256 WIDE: 64 A\n SG_ LAST : 504|8@1+ (1,0) [0|255] "rad" A\n\n',
        encoding="ascii",
    )
    dataset = frames.decode("r.asc", logs.read_log(path, fd=True), [database])
    assert dataset.channels["WIDE.LAST"].value.tolist() == [63.0]
