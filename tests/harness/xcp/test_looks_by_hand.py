"""The XCP server on UDP look by look, on a socket made by hand: who is served, how much of it, what is counted."""

import contextlib
import struct
from types import SimpleNamespace as Made

import pytest

from ranger_sim.can_bus.edge.peers import FOREIGN, FULL, LIMITS, MALFORMED, UNKNOWN
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.xcp import udp

ME, OTHER = ("127.0.0.1", 5001), ("127.0.0.1", 5002)
CONNECT, STATUS, DISCONNECT = b"\xff\x00", b"\xfd", b"\xfe"
BURST = LIMITS["xcp-udp"].burst


class Line:
    """A socket whose datagrams the test puts in and takes out; `broken`: sends that fail."""

    def __init__(self):
        self.coming, self.sent, self.broken = [], [], 0

    def recvfrom(self, size):
        if not self.coming:
            raise BlockingIOError
        found = self.coming.pop(0)
        if isinstance(found, Exception):
            raise found
        return found

    def sendto(self, data, address):
        if self.broken:
            self.broken -= 1
            raise OSError
        self.sent.append((data, address))

    def setsockopt(self, *_):
        raise OSError  # a kernel that lets nobody share a port: the master has no socket of its own

    def fileno(self):
        return 5

    def close(self):
        pass


@pytest.fixture
def server(monkeypatch):
    watchers = []
    robot = Made(loop=Made(watchers=watchers, time=0), start_ns=1_000_000)
    with contextlib.closing(udp.XcpUdpServer(robot, 0)) as made:
        made.socket.close()
        made.socket = Line()
        made.owners, made.now_s = {ME: 7, OTHER: 7}, 50.0
        made.clock, made.asked_s = (lambda: made.now_s), 50.0
        monkeypatch.setattr(udp, "owner_of", lambda sender: made.owners.get(sender))
        monkeypatch.setattr(udp, "trusted", lambda user: user == 7)
        yield made
    assert watchers == []


def datagram(*packets, first=0):
    """Packets behind each other, each with its length and a counter."""
    return b"".join(struct.pack("<HH", len(each), first + n) + each for n, each in enumerate(packets))


def asks(server, *packets, sender=ME, now_ns=0):
    """The answers to packets in one datagram."""
    server.socket.coming.append((datagram(*packets), sender))
    before = len(server.socket.sent)
    assert server.poll(now_ns) == now_ns + 500_000
    return [data for data, address in server.socket.sent[before:] if address == sender]


def test_answers_have_their_length_and_count_on(server):
    first, second = asks(server, CONNECT), asks(server, STATUS)
    assert first == [struct.pack("<HH", 8, 0) + bytes.fromhex("FF 05 80 F8 7805 01 01")]
    assert second == [struct.pack("<HH", 6, 1) + bytes.fromhex("FF 00 00 00 00 00")]
    server.counter = 0xFFFF
    assert [struct.unpack_from("<HH", each)[1] for each in asks(server, STATUS, STATUS)] == [0xFFFF, 0]
    assert server.counters() == {"commands": 4, "packets_out": 4, "packets_dropped": 0, "writes_refused": 0}


def test_one_master_has_the_place_until_it_goes(server):
    asks(server, CONNECT)
    assert asks(server, CONNECT, sender=OTHER) == [] and server.counters()[f"sent_away_{FULL}"] == 1
    assert len(asks(server, DISCONNECT)) == 1 and server.master is None
    assert len(asks(server, CONNECT, sender=OTHER)) == 1 and server.master == OTHER


def test_a_master_that_has_ended_without_a_word_gives_its_place_to_the_next(server):
    asks(server, CONNECT)
    del server.owners[ME]
    assert len(asks(server, CONNECT, sender=OTHER)) == 1 and server.master == OTHER
    server.master, server.slave.connected = ("10.0.0.9", 1), True
    assert asks(server, CONNECT, sender=ME) == []  # of another machine nothing is known


def test_a_master_that_has_ended_leaves_its_place_within_a_second_without_another_client(server):
    asks(server, CONNECT)
    server.now_s += 1.5
    server.poll(0)
    assert server.master == ME and server.slave.connected
    del server.owners[ME]
    server.now_s += 0.5
    server.poll(1)
    assert server.master == ME
    server.now_s += 0.6
    server.poll(2)
    assert server.master is None and not server.slave.connected


def test_a_client_that_is_unknown_or_of_another_user_is_not_answered(server):
    server.owners = {OTHER: 8}
    assert asks(server, CONNECT) == asks(server, CONNECT, sender=OTHER) == []
    counted = server.counters()
    assert (counted[f"sent_away_{UNKNOWN}"], counted[f"sent_away_{FOREIGN}"], counted["commands"]) == (1, 1, 0)
    server.host = "10.0.0.1"  # open to the network: nobody's user is known there
    assert len(asks(server, CONNECT)) == 1


def test_a_client_that_does_not_connect_is_not_answered_whether_the_place_is_taken_or_not(server):
    for datagrams in (datagram(STATUS), datagram(STATUS, CONNECT), b"", b"\x02\x00\x00\x00"):
        server.socket.coming.append((datagrams, OTHER))
        server.poll(0)
    assert server.counters()[f"sent_away_{MALFORMED}"] == 4 and server.counters()["commands"] == 0
    assert len(asks(server, CONNECT)) == 1
    assert asks(server, STATUS, sender=OTHER) == [] and server.counters()[f"sent_away_{FULL}"] == 1


def test_the_kernel_is_asked_about_strangers_as_often_as_others_are_taken_in(server):
    server.owners = {}
    strangers = udp.QUESTIONS + 2
    for _ in range(strangers):
        asks(server, CONNECT)
    assert (server.sent_away[UNKNOWN], server.sent_away[FULL]) == (udp.QUESTIONS, 2)
    server.now_s += 0.999 / udp.ARRIVALS_PER_S
    asks(server, CONNECT)
    assert server.sent_away[FULL] == 3
    server.now_s += 0.002 / udp.ARRIVALS_PER_S
    asks(server, CONNECT)
    assert server.sent_away[UNKNOWN] == udp.QUESTIONS + 1
    server.now_s += 1e6  # never more than there is room for
    for _ in range(strangers):
        asks(server, CONNECT)
    assert server.sent_away[UNKNOWN] == 2 * udp.QUESTIONS + 1


def test_a_poll_takes_a_number_of_unknown_clients_and_the_next_poll_the_rest(server):
    server.socket.coming += [(datagram(STATUS), OTHER)] * (udp.UNKNOWN_PER_POLL + 1)
    server.poll(0)
    assert server.left_over and len(server.socket.coming) == 1
    server.poll(0)
    assert not server.left_over and server.sent_away[MALFORMED] == udp.UNKNOWN_PER_POLL + 1


def test_a_poll_carries_out_as_many_commands_as_its_burst_and_the_next_goes_on(server):
    asks(server, CONNECT)
    assert len(asks(server, *[STATUS] * (BURST + 3))) == BURST
    assert server.left_over and server.speaker == ME
    server.socket.coming.append((datagram(STATUS), ME))
    before = len(server.socket.sent)
    server.poll(0)
    assert len(server.socket.sent) - before == 4 and not server.left_over
    assert asks(server, *[STATUS] * BURST) and not server.left_over


@pytest.mark.parametrize(
    ("data", "answers"),
    [
        (b"", 0),
        (b"\x01\x00\x00", 0),
        (struct.pack("<HH", 0, 0), 0),
        (struct.pack("<HH", 2, 0) + STATUS, 0),
        (datagram(STATUS) + b"\x09", 1),
        (datagram(STATUS) + struct.pack("<HH", 0, 0) + datagram(STATUS), 1),
    ],
)
def test_bytes_that_are_not_a_packet_end_their_datagram_and_are_counted(server, data, answers):
    asks(server, CONNECT)
    server.socket.coming.append((data, ME))
    before = len(server.socket.sent)
    server.poll(0)
    assert len(server.socket.sent) - before == answers
    assert server.counters().get(f"sent_away_{MALFORMED}", 0) == (0 if data == b"" else 1)
    assert server.rest == b""


def test_a_datagram_without_a_receiver_does_not_end_a_poll(server):
    asks(server, CONNECT)
    server.socket.coming.append(ConnectionRefusedError())
    assert len(asks(server, STATUS)) == 1
    server.socket.coming += [ConnectionRefusedError()] * udp.DATAGRAMS_PER_POLL
    server.poll(0)
    assert server.left_over
    server.poll(0)
    assert not server.left_over


def test_a_packet_that_cannot_be_sent_is_counted_and_the_counter_shows_it(server):
    asks(server, CONNECT)
    server.socket.broken = 1
    assert asks(server, STATUS) == []
    assert struct.unpack_from("<HH", asks(server, STATUS)[0])[1] == 2
    assert server.counters()["packets_dropped"] == 1 and server.counters()["packets_out"] == 2


def test_measurements_wait_for_the_next_poll_up_to_the_size_of_the_buffer(server, monkeypatch):
    asks(server, CONNECT)
    asked = []
    monkeypatch.setattr(server.slave, "sample", lambda *at: asked.append(at) or [b"ab", b"c"])
    server.sample(5_000_000)
    assert asked == []  # no list runs
    monkeypatch.setattr(type(server.slave), "running", True)
    server.sampling.before_step(5_000_000)
    assert asked == [(5_000_000, 4_000_000)] and list(server.waiting) == [b"ab", b"c"]
    before = len(server.socket.sent)
    server.poll(0)
    assert [data[4:] for data, _ in server.socket.sent[before:]] == [b"ab", b"c"] and not server.waiting
    monkeypatch.setattr(udp, "WAITING", 3)
    server.sample(0)
    server.sample(0)
    assert len(server.waiting) == 3 and server.totals["packets_dropped"] == 1
    assert len(asks(server, DISCONNECT)) == 4  # what was measured, and the last answer
    server.waiting.append(b"late")
    server.poll(0)
    assert not server.waiting and server.totals["packets_out"] == 7


def test_a_port_that_is_none_or_open_to_the_network_is_refused():
    robot = Made(loop=Made(watchers=[]), start_ns=0)
    with pytest.raises(UserError, match="a port is 0 ... 65535"):
        udp.XcpUdpServer(robot, 65536)
    with pytest.raises(UserError, match=r"0\.0\.0\.0"):
        udp.XcpUdpServer(robot, 0, "0.0.0.0")
    assert robot.loop.watchers == []


def test_the_kernels_table_has_the_owner_of_a_port(monkeypatch):
    table = (
        "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode\n"
        "  1: 0100007F:1389 00000000:0000 07 00000000:00000000 00:00000000 00000000  1000        0 1 2 x 0\n"
        "  2: 00000000:138A 00000000:0000 07 00000000:00000000 00:00000000 00000000  1001        0 1 2 x 0\n"
        "  3: 0200007F:138B 00000000:0000 07 00000000:00000000 00:00000000 00000000  1002        0 1 2 x 0\n"
    )
    monkeypatch.setattr(udp.Path, "read_text", lambda path, encoding: table)
    monkeypatch.setattr(udp.sys, "byteorder", "little")
    asked = [("127.0.0.1", 5001), ("127.0.0.1", 5002), ("127.0.0.1", 5003), ("127.0.0.2", 5003)]
    assert [udp.owner_of(each) for each in asked] == [1000, 1001, None, 1002]
