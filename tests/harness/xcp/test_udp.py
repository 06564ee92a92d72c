"""XCP on UDP with a whole robot behind it: by datagrams, and with pyxcp as the master."""

import contextlib
import os
import socket
import struct

import pytest

from ranger_sim.can_bus.edge.peers import ARRIVALS_PER_S, FULL, MALFORMED
from ranger_sim.datatable import parameters
from ranger_sim.datatable.addresses import address_of
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.xcp import udp
from ranger_sim.harness.xcp.udp import XcpUdpServer
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario


class Client:
    """A master of a few lines; the robot runs while it waits."""

    def __init__(self, robot, server):
        self.robot = robot
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.connect((server.host, server.port))
        self.socket.setblocking(False)

    def close(self):
        self.socket.close()

    def say(self, *commands):
        for command in commands:
            packet = bytes.fromhex(command)
            self.socket.send(struct.pack("<HH", len(packet), 0) + packet)
        self.robot.run_for(0.002)
        return self.received()

    def received(self):
        packets = []
        with contextlib.suppress(BlockingIOError):
            while True:
                packets.append(self.socket.recv(2048)[4:])
        return packets


@pytest.fixture
def robot():
    with contextlib.closing(Ranger(Scenario(seed=3))) as made:
        yield made


def number_of(name):
    return parameters.find(name).id


def test_a_master_that_measures_leaves_the_run_as_it_is():
    with contextlib.closing(Ranger(Scenario(seed=3), log="full")) as alone:
        alone.run_for(0.2)
        expected = alone.trace_digest()
    with contextlib.closing(Ranger(Scenario(seed=3), log="full")) as measured, contextlib.ExitStack() as opened:
        server = XcpUdpServer(measured, 0)
        measured.attach(server)
        client = opened.enter_context(contextlib.closing(Client(measured, server)))
        address = struct.pack("<I", address_of(number_of("TIMESTAMP"))).hex()
        answers = client.say(
            "FF00", "D6", "D500 0100", "D400 0000 01", "D300 0000 00 01", "E200 0000 00 00", f"E1FF0400{address}",
            "E0100000 0000 0100", "DE01 0000",
        )  # fmt: skip
        assert len(answers) >= 9 and all(each[0] == 0xFF for each in answers[:9])
        packets = []
        while measured.time_s < 0.2:  # a socket keeps 0.1 s of these packets
            measured.run_for(min(0.05, 0.2 - measured.time_s))
            packets += [each for each in client.received() if each[0] == 0]
        stamps = [struct.unpack_from("<I", each, 1)[0] for each in packets]
        assert len(stamps) > 300 and {b - a for a, b in zip(stamps, stamps[1:], strict=False)} == {500}
        assert measured.trace_digest() == expected


def test_a_second_master_is_not_answered_and_counted(robot):
    server = XcpUdpServer(robot, 0)
    robot.attach(server)
    first, second = clients = Client(robot, server), Client(robot, server)
    assert first.say("FF00")
    assert second.say("FF00") == []
    assert server.counters()["sent_away_full"] == 1
    first.say("FE")
    assert second.say("FF00")
    second.socket.send(b"\x09\x00\x00\x00\xff")
    robot.run_for(0.002)
    assert server.counters()["sent_away_malformed"] == 1
    for client in clients:
        client.close()


def test_a_master_that_ended_without_disconnecting_gives_up_its_place_and_its_lists_stop(robot):
    server = XcpUdpServer(robot, 0)
    robot.attach(server)
    first, second = Client(robot, server), Client(robot, server)
    address = struct.pack("<I", address_of(number_of("TIMESTAMP"))).hex()
    first.say("FF00", "D6", "D500 0100", "D400 0000 01", "D300 0000 00 01", "E200 0000 00 00", f"E1FF0400{address}",
              "E0100000 0000 0100", "DE01 0000")  # fmt: skip
    assert server.slave.running
    first.close()
    answers = second.say("FF00")
    assert len(answers) == 1 and answers[0][0] == 0xFF  # its own answer, and no packet of the other's list
    assert not server.slave.running
    assert server.counters().get("sent_away_full", 0) == 0
    second.close()


def test_beyond_this_machine_it_listens_only_when_that_is_asked_for(robot):
    with pytest.raises(UserError, match="allow-network"):
        XcpUdpServer(robot, 0, "0.0.0.0")


GET_STATUS, CONNECT = struct.pack("<HH", 1, 0) + b"\xfd", struct.pack("<HH", 2, 0) + b"\xff\x00"


def test_a_poll_carries_out_a_bounded_number_of_commands_however_packed(robot):
    with contextlib.closing(XcpUdpServer(robot, 0)) as server, contextlib.closing(Client(robot, server)) as client:
        client.socket.send(CONNECT + GET_STATUS * 99)
        counts = []
        for look in range(9):
            server.poll(robot.loop.time + look)
            counts.append(server.totals["commands"])
        assert counts == [16, 32, 48, 64, 80, 96, 100, 100, 100]
        assert len(client.received()) == 100


def test_strangers_are_not_asked_about_but_for_connecting_and_then_so_often_in_a_second(robot, monkeypatch):
    asked, now_s = [], 1000.0
    monkeypatch.setattr(udp, "owner_of", lambda sender: asked.append(sender) or os.getuid())
    with contextlib.closing(XcpUdpServer(robot, 0)) as server, contextlib.closing(Client(robot, server)) as stranger:
        server.clock, server.asked_s = lambda: now_s, now_s

        def looks(count, datagram):
            for _ in range(count):
                stranger.socket.send(datagram)
            for _ in range(count):
                server.poll(robot.loop.time)
            return len(asked)

        assert looks(10, GET_STATUS) == 0
        assert server.sent_away == {MALFORMED: 10}  # nobody may say that who is not connected
        with contextlib.closing(Client(robot, server)) as client:
            client.socket.send(CONNECT)
            server.poll(robot.loop.time)
            assert len(asked) == 1 and len(client.received()) == 1
            assert looks(10, GET_STATUS) == 1
            assert looks(20, CONNECT) == udp.QUESTIONS  # each time whether the master is still there
            now_s += 0.75 / ARRIVALS_PER_S
            assert looks(20, CONNECT) == udp.QUESTIONS
            now_s += 0.75 / ARRIVALS_PER_S
            assert looks(20, CONNECT) == udp.QUESTIONS + 1
        assert server.sent_away == {MALFORMED: 10, FULL: 70}
        assert stranger.received() == []


def test_what_strangers_pour_does_not_reach_the_masters_queue(robot):
    """More than the kernel keeps for a socket: of the master's commands none is lost, each poll has its share."""
    with contextlib.closing(XcpUdpServer(robot, 0)) as server, contextlib.closing(Client(robot, server)) as client:
        client.socket.send(CONNECT)
        server.poll(robot.loop.time)
        with contextlib.closing(Client(robot, server)) as stranger:
            for _ in range(4000):
                stranger.socket.send(GET_STATUS)
        for _ in range(20):
            client.socket.send(GET_STATUS)
        before = server.sent_away[FULL]
        for _ in range(3):
            server.poll(robot.loop.time)
        assert len(client.received()) == 21
        assert server.sent_away[FULL] - before == 3 * udp.UNKNOWN_PER_POLL
        assert server.left_over
        client.socket.send(struct.pack("<HH", 1, 0) + b"\xfe")
        server.poll(robot.loop.time)
        assert server.private is None and server.master is None


def test_a_port_of_an_xcp_slave_is_refused_to_another_also_while_a_master_is_there(robot):
    with contextlib.closing(XcpUdpServer(robot, 0)) as server, contextlib.closing(Client(robot, server)) as client:
        for _ in range(2):
            with pytest.raises(UserError, match=f"127.0.0.1:{server.port}: Address already in use"):
                XcpUdpServer(robot, server.port)
            client.socket.send(CONNECT)
            server.poll(robot.loop.time)
            assert server.private is not None
