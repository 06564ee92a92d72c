"""What peers may ask: bytes and requests of a poll, answers that no peer reads, places, and their owners."""

import os
import socket
import struct
import threading

import pytest

from ranger_sim.can_bus.edge import peers
from ranger_sim.can_bus.edge.peers import LIMITS, MS, Peer, PeerServer, SocketStream, Terminal
from ranger_sim.foundation.user_error import UserError

LIMIT = LIMITS["attach"]
TEN = b"x" * 10


class Echo(PeerServer[Peer]):
    """Answers every line with ten bytes; counts what it read and wrote."""

    def __init__(self):
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        listener.bind("")  # an abstract name of the kernel's choice
        listener.listen(LIMIT.peers)
        listener.setblocking(False)
        super().__init__("attach", listener)
        self.partakers = set()

    def _welcome(self, connection):
        return Peer(SocketStream(connection))

    def _take(self, peer):
        end = peer.incoming.find(b"\n")
        if end < 0:
            return False
        del peer.incoming[: end + 1]
        peer.answer(TEN)
        return True

    def _takes_part(self, peer):
        return peer in self.partakers

    def _last_bytes(self, reason):
        return reason.encode()


@pytest.fixture
def server():
    each = Echo()
    each.clients = []

    def connect():
        client = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        client.connect(each.listener.getsockname())
        client.setblocking(False)
        each.clients.append(client)
        return client

    each.connect = connect
    yield each
    each.close()
    for client in each.clients:
        client.close()


def pour(client, data=b"\n" * 65536):
    try:
        return client.send(data)
    except BlockingIOError:
        return 0


def test_one_poll_reads_and_executes_no_more_than_the_table_allows(server):
    clients = [server.connect() for _ in range(3)]
    server.receive(0)
    for client in clients:
        pour(client)
    before = server.worked
    server.receive(0)
    assert server.worked - before == LIMIT.burst
    # each was read once: what it said and was not carried out is kept, and no more is read than one request needs
    assert all(len(peer.incoming) <= LIMIT.read_bytes for peer in server.peers)
    for _ in range(5):
        server.receive(0)
    assert all(len(peer.incoming) <= LIMIT.read_bytes + LIMIT.longest for peer in server.peers)


def test_over_time_requests_are_carried_out_at_the_rate_of_the_table(server):
    pour(server.connect(), b"\n" * 4000)
    server.receive(0)
    begun = server.worked
    for step in range(1, 321):  # 10 ms of the robot's time in the steps of a busy bus
        server.receive(step * MS // 32)
    assert server.worked - begun == pytest.approx(10 * LIMIT.requests, abs=1)


def test_requests_of_a_program_that_ended_are_carried_out_without_a_reader_of_the_answers(server):
    client = server.connect()
    wanted = 3 * LIMIT.burst
    pour(client, b"\n" * wanted)
    server.receive(0)
    server.write()
    begun = server.worked
    assert begun < wanted
    client.close()  # with answers unread: from now on writing to it fails
    for _ in range(4):
        server.receive(0)
        server.write()
    assert server.worked == wanted and not server.peers


def test_a_peer_with_endless_requests_does_not_keep_another_waiting(server):
    greedy, modest = server.connect(), server.connect()
    pour(greedy)
    server.receive(0)
    modest.send(b"\n")
    server.receive(0)
    server.write()
    assert modest.recv(100) == TEN


def test_a_peer_that_takes_no_answers_is_not_read_holds_bounded_memory_and_is_sent_away(server):
    clock = [0.0]
    server.clock = lambda: clock[0]
    client = server.connect()
    server.receive(0)
    (peer,) = server.peers
    for _ in range(20_000):
        pour(client)
        server.receive(0)
        server.write()
        if peer.reads_too_little(LIMIT):
            break
    assert LIMIT.unread <= len(peer.outgoing) <= LIMIT.unread + LIMIT.burst * len(TEN)
    held, read = len(peer.outgoing), server.worked
    for _ in range(10):
        pour(client)
        server.receive(0)
    assert (len(peer.outgoing), server.worked) == (held, read)
    assert peer.stream.fileno() not in server.filenos()  # nobody is woken for it
    clock[0] = peers.PATIENCE_S + 0.1
    server.receive(0)
    assert server.sent_away == {"stalled": 1} and not server.peers


def test_a_peer_that_takes_its_answers_late_is_read_again(server):
    clock = [0.0]
    server.clock = lambda: clock[0]
    client = server.connect()
    server.receive(0)
    (peer,) = server.peers
    while not peer.reads_too_little(LIMIT):
        pour(client)
        server.receive(0)
        server.write()
    for _ in range(5):  # ten seconds, but it takes something every two
        server.receive(0)
        clock[0] += peers.PATIENCE_S
        client.recv(65536)
        server.write()
    while peer.outgoing:
        client.recv(1 << 20)
        server.write()
    before = server.worked
    server.receive(0)
    assert server.worked > before and not server.sent_away


def test_with_all_places_taken_one_more_gets_the_reason_and_is_closed(server):
    for _ in range(LIMIT.peers):
        server.connect()
        server.receive(0)
    server.partakers.update(server.peers)
    extra = server.connect()
    server.receive(0)
    assert extra.recv(100) == b"full" and extra.recv(1) == b""
    server.partakers.clear()
    another = server.connect()
    another.send(b"\n")
    server.receive(0)
    server.write()
    assert another.recv(100) == TEN and server.sent_away == {"full": 1, "idle": 1}


def test_endless_connections_are_accepted_at_a_rate_and_delay_no_other_peer(server):
    """250 in a second of the wall clock: 1 in 4 ms. Connections once used up the share of requests."""
    now = [0.0]
    server.clock = lambda: now[0]
    modest = server.connect()
    server.receive(0)
    for _ in range(2 * LIMIT.peers - 1):  # what stood free at the beginning
        server.connect()
        server.receive(0)
        server.partakers.update(server.peers)
    connections_wait = [server.connect() for _ in range(8)]
    server.receive(0)
    begun = server.arrived
    assert server.connections_wait and server.listener.fileno() not in server.filenos()  # nobody is woken for it
    for step in range(1, 6):
        now[0] = step * 0.004 + 1e-9
        modest.send(b"\n")
        server.receive(0)
        server.write()
        assert modest.recv(100) == TEN
        assert server.arrived - begun == step
    now[0] = 1.0
    server.receive(0)
    assert server.arrived - begun == len(connections_wait) and not server.connections_wait


def test_the_peer_that_has_sent_nothing_for_longest_gives_up_its_place(server):
    first, *others = [server.connect() for _ in range(LIMIT.peers)]
    server.receive(0)
    first.send(b"\n")
    server.receive(0)
    server.connect()
    server.receive(0)
    assert others[0].recv(100) == b"idle"
    with pytest.raises(BlockingIOError):
        others[1].recv(100)
    server.write()
    assert first.recv(100) == TEN


def test_a_peer_that_has_left_gives_up_its_place_before_others_with_requests_left(server):
    """Programs that fill the places, pour requests and leave once kept a new one out for 0.2 s of the robot."""
    leavers = [server.connect() for _ in range(LIMIT.peers - 1)]
    for client in leavers:
        pour(client, b"\n" * 1000)
    server.receive(0)
    quiet = server.connect()
    server.receive(0)
    server.write()
    server.partakers.update(server.peers[:-1])
    for client in leavers:
        client.close()  # with answers unread: from now on writing to it fails
    for _ in range(4):
        server.receive(0)
        server.write()
    assert len(server.peers) == LIMIT.peers and sum(peer.lost for peer in server.peers) == LIMIT.peers - 1
    new = server.connect()
    pour(new, b"\n")
    server.receive(0)
    server.write()
    assert new.recv(100) == TEN
    with pytest.raises(BlockingIOError):
        quiet.recv(1)  # it has kept its place
    assert server.sent_away == {"idle": 1}


def test_while_a_robot_waits_for_its_time_no_requests_are_carried_out_and_while_it_is_paused_at_the_rate(server):
    now = [0.0]
    server.clock = lambda: now[0]
    client = server.connect()
    server.receive(MS)
    done = []
    for _ in range(400):  # 0.4 s in which virtual time stands still
        pour(client)
        now[0] += 0.001
        server.receive(2 * MS)
        done.append(server.worked)
    waiting = round(1000 * peers.PAUSED_S)
    assert done[waiting - 5] == done[3] <= 2 * LIMIT.burst
    assert done[-1] - done[waiting + 5] == pytest.approx((395 - waiting) * LIMIT.requests, rel=0.02)


def test_another_users_program_is_closed_before_the_first_byte(server, monkeypatch):
    monkeypatch.setattr(peers, "user_behind", lambda connection: os.getuid() + 1)
    monkeypatch.setattr(server, "_welcome", lambda connection: pytest.fail("it was greeted"))
    client = server.connect()
    server.receive(0)
    assert client.recv(100) == b"" and server.sent_away == {"foreign": 1} and not server.peers


def test_a_server_of_another_user_is_not_trusted(server, monkeypatch):
    """Its process is forked, so that the kernel knows another user behind the socket; only root can do that."""
    if os.getuid() != 0:
        pytest.skip("only root can be another user")
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listener:
        listener.bind("")
        ours, theirs = socket.socketpair()
        child = os.fork()
        if child == 0:
            ours.close()
            os.setuid(65534)
            listener.listen(1)  # SO_PEERCRED tells who listened
            theirs.send(b"1")
            theirs.recv(1)
            os._exit(0)
        theirs.close()
        with ours:
            ours.recv(1)
            with pytest.raises(UserError, match="the robot x belongs to user 65534, not to you: it is not trusted"):
                peers.connected(listener.getsockname(), "the robot x", 10.0)
        os.waitpid(child, 0)


def told_of(state, user, inode):
    """inet_diag_msg as linux/inet_diag.h has it, behind the header of a netlink message (netlink(7))."""
    body = bytes([2, state, 0, 0]) + bytes(48) + struct.pack("=5I", 0, 0, 0, user, inode)
    return struct.pack("=IHHII", 16 + len(body), 20, 0, 0, 1299) + body


def test_an_end_belongs_to_the_process_that_holds_it_open():
    assert peers._owner_in(told_of(1, 1234, 77)) == 1234
    assert peers._owner_in(told_of(5, 0, 0)) is None  # FIN_WAIT2: closed already, and the kernel says root
    assert peers._owner_in(told_of(1, 0, 0)) is None
    refused = struct.pack("=IHHII", 36, 2, 0, 0, 0) + struct.pack("=i", -2) + bytes(16)  # ENOENT: no such connection
    assert peers._owner_in(refused) is None
    with pytest.raises(OSError, match="not supported"):
        peers._owner_in(struct.pack("=IHHII", 36, 2, 0, 0, 0) + struct.pack("=i", -95) + bytes(16))


def test_a_kernel_without_an_answer_for_a_connection_shows_its_table(monkeypatch):
    def refused(*ends):
        raise OSError("no netlink here")

    with socket.create_server(("127.0.0.1", 0)) as listener:
        client = socket.create_connection(listener.getsockname())
        connection, _ = listener.accept()
        with connection:
            assert peers._owner_in(peers._asked_of_kernel(client.getsockname(), listener.getsockname())) == os.getuid()
            with monkeypatch.context() as patch:
                patch.setattr(peers, "_asked_of_kernel", refused)
                assert peers.user_behind(connection) == os.getuid()
            client.close()
            assert peers.fault_of_owner(connection) == peers.UNKNOWN


def test_the_owner_of_a_loopback_connection_is_read_from_the_kernels_table():
    table = (
        "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode\n"
        "   0: 0100007F:1F90 0100007F:C350 01 00000000:00000000 00:00000000 00000000     0        0 1 1\n"
        "   1: 0100007F:C350 0100007F:1F90 01 00000000:00000000 00:00000000 00000000  1234        0 2 1\n"
        "   2: 0100007F:C351 0100007F:1F90 06 00000000:00000000 00:00000000 00000000     0        0 0 1\n"
    )
    here = ("127.0.0.1", 8080)
    assert peers._owner_of(("127.0.0.1", 50000), here, table) == 1234
    assert peers._owner_of(("127.0.0.1", 50001), here, table) is None  # gone already: nobody owns it
    with socket.create_server(("127.0.0.1", 0)) as listener, socket.create_connection(listener.getsockname()):
        connection, _ = listener.accept()
        with connection:
            assert peers.user_behind(connection) == os.getuid() and peers.fault_of_owner(connection) is None


@pytest.mark.parametrize(("host", "address"), [("127.0.0.1", "127.0.0.1"), ("localhost", "127.0.0.1")])
def test_this_machine_alone_needs_no_permission(host, address):
    assert peers.listening_address(host, "socketcand on x", False) == address


def test_beyond_this_machine_it_needs_permission():
    with pytest.raises(UserError, match="socketcand on x: 0.0.0.0 is reached from beyond this machine.*allow-network"):
        peers.listening_address("0.0.0.0", "socketcand on x", False)
    assert peers.listening_address("0.0.0.0", "socketcand on x", True) == "0.0.0.0"


def test_a_pseudo_terminal_is_for_this_user_alone():
    terminal = Terminal()
    try:
        assert os.stat(terminal.path).st_mode & 0o777 == 0o600
        assert terminal.read(10) is None
    finally:
        terminal.close()


def test_connecting_waits_no_longer_than_its_limit(server):
    """A server that never accepts: its queue takes the connection, so that only the answer is missing."""
    done = threading.Event()
    with peers.connected(server.listener.getsockname(), "x", 0.01) as link:
        with pytest.raises(TimeoutError):
            link.recv(1)
        done.set()
    assert done.is_set()
