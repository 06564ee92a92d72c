"""Ends of serial lines: what they stamp, what they keep, what a client cannot do to them."""

import contextlib
import os

import pytest
import serial
from hypothesis import given, settings
from hypothesis import strategies as st

from ranger_sim.boards.modules.imu_parser import ImuParser, start_command
from ranger_sim.boards.quirks import Quirks
from ranger_sim.boards.user_interface import UserInterfaceBoard
from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.foundation import descriptors
from ranger_sim.foundation.events import NEVER, PIN_EDGE, UART_BYTE
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.outside import serial_ports
from ranger_sim.harness.outside.serial_ports import Dropouts, PtyPort, RealPort, SerialLine
from ranger_sim.plant.sensors.imu import Imu
from ranger_sim.ranger import serial_ports as robot_ports
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario
from tests.examples import examples

BYTE_NS = 10_000
MS = 1_000_000


class Inbox:
    """Receives what a line pushes."""

    def __init__(self):
        self.messages = []

    def push(self, time, order, kind, *fields):
        self.messages.append((time, kind, fields))

    def bytes(self):
        data = b""
        for _, kind, (uart, first, count, low, high) in self.messages:
            assert kind == UART_BYTE and uart == 1
            data += (low | high << 32).to_bytes(8, "little")[:count]
            assert data[-count] == first
        return data


class Paper:
    """A port that is a list: `take` bytes are taken per write, None: all."""

    path = "paper"

    def __init__(self, incoming=b"", take=None):
        self.incoming = incoming
        self.written = b""
        self.take = take
        self.fails = None

    def read(self, limit):
        if self.fails:
            raise self.fails
        data, self.incoming = self.incoming[:limit], self.incoming[limit:]
        return data

    def write(self, data):
        part = data if self.take is None else data[: self.take]
        self.written += part
        return len(part)

    def filenos(self):
        return []

    def close(self):
        pass


def line_on(port, **options):
    inbox = Inbox()
    return SerialLine(inbox.push, 1, port, BYTE_NS, **options), inbox


def read_all(port, count):
    """So many bytes of a port; the kernel carries them in its own time."""
    data = b""
    while len(data) < count and descriptors.wait(port.filenos(), [], 10.0)[0]:
        data += port.read(count - len(data))
    return data


@pytest.fixture
def pty():
    with contextlib.closing(PtyPort()) as port:
        yield port


# --- stamps ---------------------------------------------------------------------------------------------


def test_bytes_that_arrived_are_stamped_one_after_the_other_after_the_poll():
    line, inbox = line_on(Paper(b"0123456789"))
    line.poll(5 * MS)
    assert inbox.messages == [
        (5 * MS + 8 * BYTE_NS, UART_BYTE, (1, 0x30, 8, 0x33323130, 0x37363534)),
        (5 * MS + 10 * BYTE_NS, UART_BYTE, (1, 0x38, 2, 0x3938, 0)),
    ]
    assert line.asynchronous


def test_the_next_bytes_follow_those_that_are_still_on_the_line():
    port = Paper(b"x" * 100)
    line, inbox = line_on(port)
    line.poll(0)
    port.incoming = b"y"
    line.poll(100_000)  # the hundred take 1 ms
    assert inbox.messages[-1][0] == 101 * BYTE_NS


def test_no_more_is_read_than_the_line_carries_in_20_ms():
    port = Paper(b"x" * 10_000)
    line, inbox = line_on(port)
    line.poll(0)
    assert len(inbox.bytes()) == 2000
    line.poll(1 * MS)
    assert len(inbox.bytes()) == 2100
    assert len(port.incoming) == 7900


def test_what_the_board_sends_leaves_when_its_last_bit_is_over():
    port = Paper()
    line, _ = line_on(port)
    line.from_board(3 * MS, 0x41, 0, None)
    line.from_board(4 * MS, 0, 3, b"BCD")
    assert line.poll(2 * MS) == 3 * MS
    assert port.written == b""
    line.poll(3 * MS)
    assert port.written == b"A"
    line.poll(4 * MS)
    assert port.written == b"ABCD" and not line.asynchronous


def test_a_full_port_loses_whole_pieces_and_never_parts():
    port = Paper(take=2)
    line, _ = line_on(port)
    for _ in range(3):
        line.from_board(0, 0, 5, b"abcde")
    for now in range(6):
        line.poll(now)
    assert port.written == b"abcde"
    assert line.counters()["bytes_lost"] == 10
    line.from_board(9, 0, 5, b"fghij")
    for now in range(9, 15):
        line.poll(now)
    assert port.written == b"abcdefghij"


def test_a_port_that_fails_is_given_up_with_the_reason_and_the_robot_goes_on():
    port = Paper()
    line, _ = line_on(port)
    port.fails = OSError(5, "Input/output error")
    line.poll(0)
    line.from_board(1, 65, 0, None)
    assert line.poll(1) == NEVER
    assert line.gone == "Input/output error" and line.filenos() == []
    assert not line.outgoing


# --- drop-outs ------------------------------------------------------------------------------------------


def switches(seed, seconds):
    dropouts = Dropouts(seed)
    times = []
    while dropouts.switch_ns < seconds * 1e9:
        times.append(dropouts.switch_ns)
        assert dropouts.advance(dropouts.switch_ns)
    return times, dropouts


def test_drop_outs_have_the_lengths_and_the_rate_of_the_robots_logs():
    times, dropouts = switches(1, 3700)
    lengths = [b - a for a, b in zip(times[::2], times[1::2], strict=False)]
    assert min(lengths) >= 50 * MS and max(lengths) <= 180 * MS
    assert sum(lengths) / len(lengths) == pytest.approx(115 * MS, rel=0.05)
    # 3.7 s between the end of one and the begin of the next, exponential: of 970 the mean is good to 3 %
    assert dropouts.count == pytest.approx(3700 / 3.815, rel=0.1)


def test_drop_outs_follow_from_the_seed():
    assert switches(1, 100)[0] == switches(1, 100)[0] != switches(2, 100)[0]


def test_with_flow_control_the_board_is_held_and_nothing_is_lost():
    port = Paper()
    dropouts = Dropouts(1)
    line, inbox = line_on(port, dropouts=dropouts, cts_pin=7)
    begin = dropouts.switch_ns
    assert line.poll(begin - MS // 2) == begin
    end = line.poll(begin)
    assert inbox.messages == [(begin, PIN_EDGE, (7, 1, -1, 0))]
    port.incoming = b"later"
    line.from_board(begin + 1, 0, 3, b"abc")  # what was on its way
    line.poll(begin + MS)
    assert port.written == b"" and port.incoming == b"later"
    line.poll(dropouts.switch_ns)
    assert inbox.messages[1][1:] == (PIN_EDGE, (7, 0, -1, 0))
    assert port.written == b"abc" and port.incoming == b""
    assert end > begin


def test_without_flow_control_the_bytes_of_a_drop_out_are_lost():
    port = Paper()
    dropouts = Dropouts(1)
    line, inbox = line_on(port, dropouts=dropouts)
    begin = dropouts.switch_ns
    line.poll(begin)
    line.from_board(begin + 1, 0, 3, b"abc")
    line.poll(begin + MS)
    line.poll(dropouts.switch_ns)
    assert port.written == b"" and line.counters() == {
        "bytes_in": 0,
        "bytes_out": 0,
        "bytes_lost": 0,
        "bytes_unheard": 3,
        "dropouts": 1,
    }
    assert inbox.messages == []


# --- ports ----------------------------------------------------------------------------------------------


def test_a_pseudo_terminal_carries_every_byte_value_both_ways(pty):
    every = bytes(range(256))
    with serial.Serial(pty.path, 921_600, timeout=10) as client:
        assert pty.write(every) == 256
        assert client.read(256) == every
        client.write(every)
        assert read_all(pty, 256) == every
    assert pty.read(300) == b""


def test_an_unread_pseudo_terminal_takes_some_bytes_and_then_none(pty):
    taken = [pty.write(bytes(1000)) for _ in range(200)]
    assert taken[-1] == 0 and 0 < sum(taken) < 200_000


def test_a_real_port_is_whatever_pyserial_opens(pty):
    with contextlib.closing(RealPort(pty.path, 921_600)) as port:
        assert port.read(10) == b""
        pty.write(b"abc")
        assert read_all(port, 3) == b"abc"
        assert port.write(b"de") == 2
        assert read_all(pty, 2) == b"de"


def test_a_port_whose_other_side_is_gone_reports_it():
    pty = PtyPort()
    with contextlib.closing(RealPort(pty.path, 921_600)) as port:
        pty.close()
        with pytest.raises(OSError, match="Input/output error"):
            port.read(10)


def test_a_port_that_is_not_there_is_a_users_mistake():
    with pytest.raises(UserError, match="serial port /dev/no-such-port: No such file or directory"):
        serial_ports.open_port("/dev/no-such-port")
    with pytest.raises(UserError, match="serial port strange://"):
        serial_ports.open_port("strange://")


# --- on a robot -----------------------------------------------------------------------------------------


def test_a_listener_changes_nothing_and_the_run_can_be_repeated():
    digests = []
    for connected in (False, True):
        with contextlib.closing(Ranger(Scenario())) as robot:
            if connected:
                line = robot_ports.connect_daq(robot, PtyPort())
            robot.run_for(1.2)  # the rate controller lets the first points through after a second
            digests.append(robot.trace_digest())
    assert digests[0] == digests[1]
    assert line.counters()["bytes_out"] > 0 and not line.asynchronous


def test_drop_outs_hold_the_link_of_a_robot_with_bluetooth():
    with contextlib.closing(Ranger(Scenario(), quirks=Quirks(computer_link="bluetooth"))) as robot:
        dropouts = Dropouts(1)
        dropouts.switch_ns = 200 * MS
        line = robot_ports.connect_daq(robot, PtyPort(), dropouts)
        link = robot.board("MB").computer
        link.rate_sum = 40_960
        robot.run_for(0.2)
        before = line.counters()["bytes_out"]
        robot.run_for(0.05)
        assert line.counters()["bytes_out"] == before
        assert link.used > 5 and not robot.board("MB").computer_uart.clear_to_send
        robot.run_for(0.25)
        assert link.used <= 1 and line.counters()["bytes_out"] > before


def test_a_real_inertial_unit_takes_the_place_of_the_plants():
    with contextlib.closing(Ranger(Scenario())) as robot, contextlib.closing(PtyPort()) as unit:
        line = robot_ports.connect_imu(robot, RealPort(unit.path, serial_ports.IMU_BAUD))
        robot.run_for(0.05)
        assert read_all(unit, 4) == start_command(0xC2)
        body = bytes((0xC2,)) + bytes.fromhex("00000000 00000000 bf800000 3f000000 3e800000 00000000 00000000")
        unit.write(body + (sum(body) & 0xFFFF).to_bytes(2, "big"))
        descriptors.wait(line.filenos(), [], 10.0)
        robot.run_for(0.05)
        assert robot.board("UI").imu.packets == 1
        assert robot.variable("UI_ANG_RATE_X") == 0.5


def test_the_plants_inertial_unit_can_be_read_by_a_real_host_in_addition_to_its_board():
    with contextlib.closing(Ranger(Scenario())) as robot:
        offer = robot_ports.offer_imu(robot, PtyPort())
        with serial.Serial(offer.port.path, serial_ports.IMU_BAUD, timeout=10) as host:
            robot.run_for(0.1)
            received = host.read(offer.counters()["bytes_out"])
        board = robot.board("UI").imu
        reader = ImuParser(pytest.fail, 0xC2)
        for start in range(0, len(received), 31):
            for byte in received[start : start + 31]:
                reader.push(byte)
            reader.update()
        assert reader.packets > 50 and abs(reader.packets - board.packets) <= 2
        # the acknowledgement has the packet's header in it: one false start, for host and board alike
        assert reader.bad_checksums == board.bad_checksums == 1


def test_a_host_may_command_the_plants_inertial_unit():
    with contextlib.closing(Ranger(Scenario())) as robot:
        offer = robot_ports.offer_imu(robot, PtyPort())
        with serial.Serial(offer.port.path, serial_ports.IMU_BAUD, timeout=10) as host:
            robot.run_for(0.1)
            before = offer.counters()["bytes_out"]
            host.read(before)
            host.write(start_command(0xCF))
            descriptors.wait(offer.filenos(), [], 10.0)
            robot.run_for(0.02)
            received = host.read(offer.counters()["bytes_out"] - before)
    assert bytes((0xC4, 0xCF)) in received  # the acknowledgement
    assert received.count(0xCF) >= 2
    assert offer.asynchronous


def test_closing_a_robot_closes_its_ends_once():
    robot = Ranger(Scenario())
    line = robot_ports.connect_daq(robot, PtyPort())
    master = line.port.terminal.master
    os.fstat(master)
    robot.close()
    assert (line.port.terminal.master, line.port.terminal.slave, line.filenos()) == (-1, -1, [])
    robot.close()
    assert line.poll(0) == NEVER


@settings(max_examples=examples(60))
@given(
    st.lists(st.one_of(st.binary(max_size=30), st.sampled_from((start_command(0xCF), start_command(0xC2)))), max_size=8)
)
def test_no_bytes_of_a_host_stop_the_plants_inertial_unit(pieces):
    imu = Imu(seed=1)
    offer = serial_ports.ImuOffer(imu, Paper(b"".join(pieces)))
    for step in range(200):
        offer.poll(step * MS)
        imu.update(step * MS, (step + 1) * MS, 0.1, 0.2, 0.1, 0.2)
        offer.bytes_sent(imu.bytes.times, imu.bytes.values, imu.bytes.count)
    assert imu.samples == 200
    # whatever came before: four bytes end a command that was begun, and then one gets through
    offer.line.port.incoming = bytes(4) + start_command(0xC2)
    for step in range(200, 230):
        offer.poll(step * MS)
        imu.update(step * MS, (step + 1) * MS, 0.1, 0.2, 0.1, 0.2)
    assert imu.mode == 0xC2


@settings(max_examples=examples(25))
@given(st.binary(max_size=600))
def test_no_bytes_at_the_imu_port_stop_the_board(data):
    board = UserInterfaceBoard(Crystal(), Quirks())
    line = SerialLine(board.inbox.push, 1, Paper(data), board.uart1.byte_ns)
    for ms in range(40):
        line.poll(ms * MS)
        board.advance((ms + 1) * MS)
    imu = board.imu
    assert board.scheduler.overruns == 0 and board.scheduler.slot_count == 40
    assert 31 * imu.packets + imu.bad_checksums + imu.skipped_bytes + imu.waiting() + imu.bytes_lost == len(data)
