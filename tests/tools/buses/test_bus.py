"""`ranger-sim bus`: buses for programs of one's own."""

import re
import signal
import socket

import can
import pytest

from ranger_sim.tools import cli
from tests.can_bus.hosting import Program, fresh_name


def test_programs_of_any_kind_meet_on_a_hosted_bus():
    name = fresh_name()
    call = ("-m", "ranger_sim", "bus", "can1", "can2", "--name", name, "--slcan", "can2", "--socketcand", "0")
    with Program(*call) as host:
        host.until("can1, can2: 1000000 bit/s, 1 x real time; Ctrl-C ends")
        host.until(re.escape(f'python-can: can.Bus(interface="ranger_sim", channel="{name}/can1")'))
        path = host.until(r"slcan: can2 is (\S+)\n").group(1)
        port = int(host.until(r"socketcand: 127.0.0.1:(\d+)\n").group(1))
        with (
            can.Bus(interface="ranger_sim", channel=f"{name}/can2", ignore_config=True) as one,
            can.Bus(interface="slcan", channel=path, sleep_after_open=0, ignore_config=True) as two,
            can.Bus(interface="socketcand", channel="can2", host="127.0.0.1", port=port, ignore_config=True) as three,
        ):
            assert two.get_version(60) == (1, 1)
            buses = (one, two, three)
            for number, sender in enumerate(buses):
                sender.send(can.Message(arbitration_id=0x100 + number, data=b"\x2a", is_extended_id=False))
                for receiver in buses:
                    if receiver is not sender:
                        assert receiver.recv(60).arbitration_id == 0x100 + number
        host.process.send_signal(signal.SIGINT)
        host.until("can1: 0 frames, 0 error frames")
        host.until("can2: 3 frames, 0 error frames")
        host.until("AttachServer: clients_seen 1, frames_in 1, frames_out 2")
        assert host.ended() == (0, "")


def test_a_program_may_be_alone_on_a_bus_with_a_silent_node():
    name = fresh_name()
    with Program("-m", "ranger_sim", "bus", "--name", name, "--acknowledge") as host:
        host.until("can1: 1000000 bit/s")
        with can.Bus(
            interface="ranger_sim", channel=f"{name}/can1", receive_own_messages=True, ignore_config=True
        ) as alone:
            alone.send(can.Message(arbitration_id=0x100, is_extended_id=False))
            assert alone.recv(60).arbitration_id == 0x100
        host.process.send_signal(signal.SIGINT)
        host.until("can1: 1 frames, 0 error frames")
        assert host.ended() == (0, "")


def test_it_ends_by_itself_when_asked_to(capsys):
    assert cli.main(["bus", "--name", fresh_name(), "--seconds", "0.01", "--speed", "max"]) == 0
    assert "as fast as frames are sent" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--speed", "warp"], "speed 'warp' is neither a number in 0.001 ... 1000 nor 'max'"),
        (["--bitrate", "200000000"], "200000000 bit/s is outside 1000"),
        (["--bitrate", "500000", "--data-bitrate", "250000"], "250000"),
        (["--data-bitrate", "999"], "--data-bitrate"),
        (["--bit-error-rate", "2"], "bit error rate 2.0 is outside"),
        (["--slcan", "can9"], "--slcan can9: no such bus; there are can1"),
        (["--socketcand", "here"], "--socketcand here: PORT or HOST:PORT"),
        (["--socketcand", "99999"], "socketcand on 127.0.0.1:99999"),
        (["--name", "a b"], "name 'a b' is not"),
        (["can1", "can1"], "a name is given twice in can1 can1"),
        (["a/b"], "'a/b' is not a name for a bus"),
        (["--seconds", "-1"], "--seconds: '-1' must be above 0 s"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_a_mistake_is_one_line(arguments, words, capsys):
    given = [] if "--name" in arguments else ["--name", fresh_name()]
    try:
        code = cli.main(["bus", *arguments, *given])
    except SystemExit as left:
        code = left.code
    assert code == 2
    reported = capsys.readouterr().err.strip().splitlines()
    assert len(reported) == 1 and words in reported[0]


def test_a_taken_port_is_one_line_and_the_name_is_free_again(capsys):
    name = fresh_name()
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert cli.main(["bus", "--name", name, "--socketcand", str(port)]) == 2
    assert f"socketcand on 127.0.0.1:{port}: Address already in use" in capsys.readouterr().err
    assert cli.main(["bus", "--name", name, "--seconds", "0.01"]) == 0
