"""CAN FD between processes: attached clients of python-can, adapters of the slcan protocol, `ranger-sim bus`."""

import contextlib
import re
import signal

import can
import pytest

from ranger_sim.can_bus.edge import attach_records as wire
from ranger_sim.can_bus.edge.slcan import SlcanServer
from ranger_sim.can_bus.edge.socketcand import SocketcandServer
from ranger_sim.can_bus.fd_frame import LENGTHS
from ranger_sim.foundation.events import FLAG_BRS, FLAG_ESI, FLAG_EXTENDED, FLAG_FD

from .hosting import Program, fresh_name, hosted

RATES = {"bitrate": 500_000, "data_bitrate": 2_000_000}
PATIENCE_S = 60


def message(identifier, data, **options):
    return can.Message(arbitration_id=identifier, data=data, is_extended_id=identifier > 0x7FF, is_fd=True, **options)


@pytest.fixture
def attach():
    """attach(NAME/CHANNEL, ...): a client of python-can."""
    with contextlib.ExitStack() as stack:

        def opened(channel, **options):
            bus = can.Bus(interface="ranger_sim", channel=channel, ignore_config=True, **options)
            return stack.enter_context(bus)

        yield opened


def same(sent, received):
    return received.equals(sent, timestamp_delta=None, check_channel=False, check_direction=False)


def test_records_of_can_fd_have_the_bytes_that_the_page_of_the_protocol_describes():
    """Twelve bytes 1 ... 12: length code 9, BRS; a SEND is 1 + 4 + 2 + 12 bytes, a FRAME 8 more."""
    flags = FLAG_FD | FLAG_BRS | 9
    data = bytes(range(1, 13))
    lo, hi = int.from_bytes(data[:4], "little"), int.from_bytes(data[4:], "little")
    send = wire.send_record(0x123, flags, lo, hi)
    assert send == bytes.fromhex("13000000 04 23010000 0903") + data
    frame = wire.frame_record(wire.FRAME, 5, 0x123, flags, lo, hi)
    assert frame == bytes.fromhex("1b000000 05 0500000000000000 23010000 0903") + data
    assert wire.frame_of(wire.SEND_HEAD, send[5:]) == (0x123, flags, lo, hi)
    assert wire.frame_of(wire.FRAME_HEAD, frame[5:]) == (5, 0x123, flags, lo, hi)


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (b"\0" * 5, "a body of 5 bytes is too short for a frame"),
        (bytes.fromhex("23010000 0901") + b"\0" * 11, "11 data bytes in a body where 12 belong"),
        (bytes.fromhex("23010000 0900") + b"\0" * 12, "12 data bytes in a body where 8 belong"),
    ],
)
def test_a_record_whose_length_is_not_that_of_its_frame_is_malformed(body, words):
    with pytest.raises(wire.MalformedError, match=words):
        wire.frame_of(wire.SEND_HEAD, body)


def test_attached_clients_exchange_frames_of_every_length(attach):
    with hosted("can1", **RATES) as (name, _):
        a, b = (attach(f"{name}/can1", fd=True, **RATES) for _ in range(2))
        assert a.channel_info == f"ranger_sim {name}/can1, 500000 bit/s, CAN FD, 2000000 bit/s"
        for number, length in enumerate(LENGTHS):
            sent = message(
                0x100 + number * 0x1000,
                bytes(range(length)),
                bitrate_switch=number % 2 == 0,
                error_state_indicator=number % 3 == 0,
            )
            a.send(sent)
            received = b.recv(PATIENCE_S)
            assert same(sent, received), (sent, received)
        a.send(can.Message(arbitration_id=5, data=b"12345678", is_extended_id=False))
        received = b.recv(PATIENCE_S)
        assert (received.is_fd, bytes(received.data)) == (False, b"12345678")
        assert a.statistics()["sent"] == len(LENGTHS) + 1


def test_an_attached_client_receives_its_own_frame_of_64_bytes_when_it_is_on_the_bus(attach):
    with hosted("can1", acknowledge=True, **RATES) as (name, _):
        alone = attach(f"{name}/can1", fd=True, receive_own_messages=True)
        sent = message(0x1, bytes(range(64)), bitrate_switch=True)
        alone.send(sent)
        received = alone.recv(PATIENCE_S)
        assert same(sent, received) and not received.is_rx


def test_a_classic_client_answers_can_fd_frames_with_error_frames(attach):
    """Until it is error passive, after 16 of them; then the frame passes."""
    with hosted("can1", **RATES) as (name, host):
        a, b, classic = (attach(f"{name}/can1", **options) for options in ({"fd": True}, {"fd": True}, {}))
        sent = message(0x10, bytes(12))
        a.send(sent)
        while (received := b.recv(PATIENCE_S)).is_error_frame:
            pass
        assert same(sent, received)
        assert host.buses[0].bus.counters.errors >= 16
        assert classic.protocol == can.CanProtocol.CAN_20


def test_a_classic_client_that_only_listens_disturbs_no_can_fd_frame_and_receives_none(attach):
    with hosted("can1", **RATES) as (name, _):
        a, b = attach(f"{name}/can1", fd=True), attach(f"{name}/can1", fd=True)
        classic = attach(f"{name}/can1", listen_only=True)
        for number in range(20):
            a.send(message(number, bytes(64), bitrate_switch=True))
        assert [b.recv(PATIENCE_S).arbitration_id for _ in range(20)] == list(range(20))
        a.send(can.Message(arbitration_id=0x100, is_extended_id=False))
        while (received := classic.recv(PATIENCE_S)).is_error_frame:  # in its view alone: b has none
            pass
        assert (received.arbitration_id, received.is_fd) == (0x100, False)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"fd": True, "data_bitrate": 5_000_000}, "runs at a data bit rate of 2000000 bit/s, not at 5000000"),
        ({"fd": True, "bitrate": 250_000}, "runs at 500000 bit/s, not at 250000"),
        ({"fd": True, "fd_non_iso": True}, "runs with fd_non_iso False"),
    ],
)
def test_a_client_with_other_rates_than_the_bus_is_refused(options, words, attach):
    with hosted("can1", **RATES) as (name, _), pytest.raises(can.CanInitializationError, match=words):
        attach(f"{name}/can1", **options)


def test_a_can_fd_client_of_a_classic_bus_is_refused_and_takes_no_place(attach):
    with hosted("can1") as (name, host):
        with pytest.raises(can.CanInitializationError, match=f"{name}/can1 is classic CAN, not CAN FD"):
            attach(f"{name}/can1", fd=True)
        assert not host.buses[0].taps.taps


def test_a_client_that_takes_the_place_of_a_can_fd_client_may_be_a_classic_one(attach):
    with hosted("can1", **RATES) as (name, host):
        with can.Bus(interface="ranger_sim", channel=f"{name}/can1", fd=True, ignore_config=True):
            pass
        a, classic = attach(f"{name}/can1", fd=True), attach(f"{name}/can1")
        a.send(message(0x10, bytes(12)))
        while host.buses[0].bus.counters.errors == 0:
            classic.recv(PATIENCE_S)


def test_a_program_with_an_adapter_of_the_slcan_protocol_sends_and_receives_can_fd(attach):
    """The other program is python-can's own interface `slcan`."""
    with hosted("can1", servers=[lambda taps: SlcanServer("can1", taps["can1"])], **RATES) as (name, host):
        here = attach(f"{name}/can1", fd=True)
        with can.Bus(interface="slcan", channel=host.servers[1].path, sleep_after_open=0, ignore_config=True) as there:
            assert there.get_version(PATIENCE_S) == (1, 1)
            for number, length in enumerate(LENGTHS):
                sent = message(0x100 + number * 0x1000, bytes(range(length)), bitrate_switch=number % 2 == 0)
                there.send(sent)
                assert same(sent, here.recv(PATIENCE_S))
                here.send(sent)
                assert same(sent, there.recv(PATIENCE_S))
            there.send(can.Message(arbitration_id=7, is_remote_frame=True, dlc=3, is_extended_id=False))
            assert here.recv(PATIENCE_S).is_remote_frame


@pytest.mark.parametrize(
    "line", [b"d1239", b"d12380102", b"b123g", b"D200000000", b"d1230" + b"0" * 160, b"d8000", b"d123"]
)
def test_a_malformed_can_fd_line_is_refused_with_a_bell(line):
    with hosted("can1", servers=[lambda taps: SlcanServer("can1", taps["can1"])], **RATES) as (_, host):
        with open(host.servers[1].path, "r+b", buffering=0) as terminal:
            terminal.write(b"O\r" + line + b"\r")
            answer = b""
            while len(answer) < 2:
                answer += terminal.read(2)
        assert answer == b"\r\a"


def test_a_classic_bus_refuses_the_lines_of_can_fd():
    with hosted("can1", servers=[lambda taps: SlcanServer("can1", taps["can1"])]) as (_, host):
        with open(host.servers[1].path, "r+b", buffering=0) as terminal:
            terminal.write(b"O\rd1230\r")
            answer = b""
            while len(answer) < 2:
                answer += terminal.read(2)
        assert answer == b"\r\a"


def test_socketcand_carries_the_classic_frames_of_a_can_fd_bus_and_counts_the_others(attach):
    with hosted("can1", servers=[lambda taps: SocketcandServer(taps, 0)], **RATES) as (name, host):
        server = host.servers[1]
        here = attach(f"{name}/can1", fd=True)
        with can.Bus(
            interface="socketcand", channel="can1", host="127.0.0.1", port=server.port, ignore_config=True
        ) as there:
            here.send(message(0x10, bytes(64), bitrate_switch=True))
            here.send(can.Message(arbitration_id=0x11, data=b"ab", is_extended_id=False))
            received = there.recv(PATIENCE_S)
            assert (received.arbitration_id, bytes(received.data)) == (0x11, b"ab")
            assert (server.totals["not_carried"], host.buses[0].bus.counters.errors) == (1, 0)


def test_the_command_hosts_can_fd_buses():
    name = fresh_name()
    call = "bus can1 --bitrate 500000 --data-bitrate 2000000 --acknowledge --name".split()
    with Program("-m", "ranger_sim", *call, name) as host:
        host.until("can1: 500000 bit/s, CAN FD at 2000000 bit/s, 1 x real time; Ctrl-C ends")
        host.until(re.escape(f'python-can: can.Bus(interface="ranger_sim", channel="{name}/can1", fd=True)'))
        with can.Bus(
            interface="ranger_sim", channel=f"{name}/can1", fd=True, receive_own_messages=True, ignore_config=True
        ) as alone:
            sent = message(0x100, bytes(64), bitrate_switch=True)
            alone.send(sent)
            assert same(sent, alone.recv(PATIENCE_S))
        host.process.send_signal(signal.SIGINT)
        host.until("can1: 1 frames, 0 error frames")
        assert host.ended() == (0, "")


def test_flags_of_the_protocol_are_those_of_its_page():
    """ATTACH.md: bit 6 extended identifier, bit 8 CAN FD, bit 9 BRS, bit 10 ESI."""
    assert (FLAG_EXTENDED, FLAG_FD, FLAG_BRS, FLAG_ESI) == (1 << 6, 1 << 8, 1 << 9, 1 << 10)
