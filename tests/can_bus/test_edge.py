"""Our frames among the tools of the CAN world: python-can, its player and logger, cantools."""

import io
import subprocess
import sys

import can
import cantools.logreader
import pytest
from can.io.canutils import CanutilsLogReader, CanutilsLogWriter
from hypothesis import example, given
from hypothesis import strategies as st

from ranger_sim.can_bus.edge.candump import CandumpWriter, line_of_frame, read_candump
from ranger_sim.can_bus.edge.messages import frame_of_message, message_of_frame
from ranger_sim.can_bus.frame import FIELD_CRC, data_length
from ranger_sim.foundation.events import FLAG_ERROR, FLAG_EXTENDED, FLAG_REMOTE
from ranger_sim.foundation.user_error import UserError

from .wiring import Wired

WORD = st.integers(0, 2**32 - 1)


@st.composite
def frames(draw):
    """(time_ns, identifier, flags, lo, hi) as a receiver has it: bytes that are not sent are 0."""
    extended = draw(st.booleans())
    flags = draw(st.integers(0, 8))
    identifier = draw(st.integers(0, 0x1FFFFFFF if extended else 0x7FF))
    if extended:
        flags |= FLAG_EXTENDED
    if draw(st.booleans()):
        flags |= FLAG_REMOTE
    bits = 8 * data_length(flags)
    lo = draw(WORD) & ((1 << min(bits, 32)) - 1)
    hi = draw(WORD) & ((1 << max(bits - 32, 0)) - 1)
    return draw(st.integers(0, 10**15)) * 1000, identifier, flags, lo, hi


def test_a_frame_becomes_the_message_that_its_bytes_say():
    message = message_of_frame(1_500_000_000, 0x123, 6, 0x04030201, 0x0605, "can1")
    assert message.arbitration_id == 0x123 and not message.is_extended_id
    assert bytes(message.data) == bytes([1, 2, 3, 4, 5, 6])
    assert message.timestamp == 1.5 and message.channel == "can1" and message.is_rx
    assert message_of_frame(0, 1, 8 | FLAG_ERROR, 0, 0).is_error_frame


@given(frames())
def test_frames_survive_the_way_to_python_can_and_back(frame):
    assert frame_of_message(message_of_frame(*frame)) == frame[1:]


def test_can_fd_is_refused_and_error_frames_keep_their_nature():
    with pytest.raises(UserError, match="0x7: CAN FD"):
        frame_of_message(can.Message(arbitration_id=7, is_fd=True, data=bytes(12), is_extended_id=False))
    assert frame_of_message(can.Message(is_error_frame=True))[1] == FLAG_ERROR


def test_a_line_is_what_candump_writes():
    # the example of candump's own documentation style: (time) interface id#data
    assert line_of_frame("can1", 36_000, 0x123, 8, 0x04030201, 0x08070605) == (
        "(0000000000.000036) can1 123#0102030405060708\n"
    )
    assert line_of_frame("can4", 1_436_509_052_249_713_999, 0x1F334455, 3 | FLAG_EXTENDED, 0x332211, 0) == (
        "(1436509052.249713) can4 1F334455#112233\n"
    )
    assert line_of_frame("can2", 0, 1, 4 | FLAG_REMOTE, 0, 0) == "(0000000000.000000) can2 001#R4\n"
    assert line_of_frame("can2", 0, 1, 8 | FLAG_ERROR, FIELD_CRC, 0).split()[2] == "20000080#0000000800000000"


@given(st.lists(st.tuples(st.sampled_from(["can1", "vcan0", "3"]), frames()), max_size=20))
def test_our_reader_returns_what_our_writer_wrote(tmp_path_factory, content):
    path = tmp_path_factory.mktemp("log") / "frames.log"
    with CandumpWriter(path) as writer:
        for interface, frame in content:
            writer.write(interface, [frame])
    assert writer.frames == len(content)
    assert list(read_candump(path)) == [(interface, *frame) for interface, frame in content]


@given(st.lists(frames(), max_size=10))
def test_our_reader_understands_python_cans_writer(tmp_path_factory, content):
    path = tmp_path_factory.mktemp("log") / "frames.log"
    # its writer gives remote frames no length, and moves stamps that run backwards
    content = sorted(frame for frame in content if not frame[2] & FLAG_REMOTE)
    writer = CanutilsLogWriter(str(path))
    for frame in content:
        writer.on_message_received(message_of_frame(*frame, channel="can3"))
    writer.stop()
    read = list(read_candump(path))
    assert [entry[2:] for entry in read] == [frame[1:] for frame in content]
    for entry, frame in zip(read, content, strict=True):
        assert entry[0] == "can3"
        assert abs(entry[1] - frame[0]) <= 1000  # a float of seconds, then six decimals


@pytest.fixture
def walk_log(tmp_path):
    """A log of three frames, one repeated after an error, as the bus wrote it."""
    wired = Wired(3)
    wired.bus.inject_errors(1)
    wired.send(0, 0x00E, lo=0x40490FDB, hi=17)  # 3.14159274 as a float
    wired.send(1, 0x123, flags=5 | FLAG_EXTENDED, lo=0x01020304, hi=9)
    wired.send(2, 0x7F0, flags=FLAG_REMOTE | 8)
    wired.bus.advance(10_000_000)
    path = tmp_path / "can1.log"
    with CandumpWriter(path) as writer:
        writer.write("can1", [frame[:5] for frame in wired.log()])
    assert writer.frames == 4
    return path


def test_python_cans_reader_reads_our_log(walk_log):
    messages = list(CanutilsLogReader(str(walk_log)))
    assert [message.is_error_frame for message in messages] == [True, False, False, False]
    assert [frame_of_message(message)[:3] for message in messages[1:]] == [
        (0x123, 5 | FLAG_EXTENDED, 0x01020304),
        (0x00E, 8, 0x40490FDB),
        (0x7F0, 8 | FLAG_REMOTE, 0),
    ]
    assert all(message.channel == "can1" for message in messages[1:])


def test_python_cans_player_plays_our_log(walk_log):
    played = subprocess.run(
        [sys.executable, "-m", "can.player", "-i", "virtual", "-c", "x", "-v", "--error-frames", str(walk_log)],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert played.returncode == 0, played.stderr
    assert "7f0" in played.stdout.lower() and "db 0f 49 40 11" in played.stdout.lower()


def test_cantools_parses_and_decodes_our_log(walk_log, tmp_path):
    parsed = list(cantools.logreader.Parser(io.StringIO(walk_log.read_text())))
    # error frames are not its business
    assert [frame.frame_id for frame in parsed] == [0x123, 0x00E, 0x7F0]
    assert [frame.is_extended_frame for frame in parsed] == [True, False, False]
    assert parsed[1].data == bytes.fromhex("DB0F494011000000")
    dbc = tmp_path / "one.dbc"
    dbc.write_text(
        'VERSION ""\nNS_ :\nBS_:\nBU_: A\n'
        'BO_ 14 ANGLE: 8 A\n SG_ value : 0|32@1- (1,0) [0|0] "rad" A\n SG_ stamp : 32|32@1+ (1,0) [0|0] "ms" A\n'
        "SIG_VALTYPE_ 14 value : 1;\n"
    )
    decoded = subprocess.run(
        [sys.executable, "-m", "cantools", "decode", "--single-line", str(dbc)],
        input=walk_log.read_text(),
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert decoded.returncode == 0, decoded.stderr
    assert "ANGLE(value: 3.14159" in decoded.stdout and "stamp: 17" in decoded.stdout


def test_an_error_in_the_log_says_where_in_the_frame_it_was(walk_log):
    interface, time_ns, identifier, flags, field, _ = next(read_candump(walk_log))
    assert (interface, identifier, flags) == ("can1", 0, FLAG_ERROR)
    assert field > 0 and time_ns > 0


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("hello", "not `"),
        ("(1.0) can1", "not `"),
        ("1.0 can1 123#00", "not `"),
        ("(one) can1 123#00", "time"),
        ("(1.0) can1 123", "no #"),
        ("(1.0) can1 12#00", "identifier"),
        ("(1.0) can1 FFF#00", "above 7FF"),
        ("(1.0) can1 FFFFFFFF#0", "data"),
        ("(1.0) can1 123#0", "data"),
        ("(1.0) can1 123#00112233445566778899", "data"),
        ("(1.0) can1 123#R9", "remote"),
        ("(1.0) can1 123##100", "CAN FD"),
    ],
)
def test_a_bad_line_is_named_with_its_place(tmp_path, line, complaint):
    path = tmp_path / "bad.log"
    path.write_text("(0.0) can1 123#\n\n" + line + "\n")
    with pytest.raises(UserError, match=complaint) as caught:
        list(read_candump(path))
    assert str(caught.value).startswith(f"{path}:3: ")
    assert "\n" not in str(caught.value)


@given(st.text(max_size=60))
@example("(1.0) can1 123#\u00b2")
@example("(\u0661.0) can1 123#R\u0661")
def test_no_text_breaks_the_reader(tmp_path_factory, text):
    path = tmp_path_factory.mktemp("log") / "fuzz.log"
    path.write_text(text, encoding="utf-8")
    try:
        for _ in read_candump(path):
            pass
    except UserError as error:
        assert "\n" not in str(error).replace(str(path), "")


def test_a_file_that_cannot_be_written_or_read_is_the_users_mistake(tmp_path):
    with pytest.raises(UserError, match="cannot be written"):
        CandumpWriter(tmp_path)
    with pytest.raises(UserError, match="cannot be read"):
        list(read_candump(tmp_path / "missing.log"))
