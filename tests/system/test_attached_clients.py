"""Programs from outside on the buses of the whole robot: they see what it logs, and cannot kill a board."""

import contextlib
import itertools
import socket

import can
import pytest

from ranger_sim.can_bus.edge import attach_records as wire
from ranger_sim.can_bus.edge.attach import AttachServer
from ranger_sim.can_bus.edge.candump import read_candump
from ranger_sim.can_bus.edge.messages import frame_of_message
from ranger_sim.can_bus.edge.taps import OFF
from ranger_sim.can_bus.node import OPERATING
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario
from tests.can_bus.hosting import Program, fresh_name

MS = 1_000_000


def buses_of(robot):
    return {bus.name: bus for bus in robot.buses}


class Client:
    """A client of a robot in the same thread: everything it has received, and frames kept on the way."""

    def __init__(self, name, channel):
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.socket.connect(wire.address_of(name))
        self.socket.sendall(wire.record(wire.HELLO, wire.HELLO_BODY.pack(wire.MAGIC, 1, 0) + channel.encode()))
        self.socket.setblocking(False)
        self.data = bytearray()
        self.frames = []
        self.outstanding = self.sent = 0
        self.dropped = []
        self.off = False

    def hear(self):
        with contextlib.suppress(BlockingIOError):
            self.data += self.socket.recv(1 << 20)
        for kind, body in wire.records_of(self.data):
            assert kind != wire.REFUSED, body
            if kind == wire.FRAME:
                self.frames.append(wire.FRAME_BODY.unpack(body))
            elif kind in (wire.SENT, wire.DROPPED):
                self.outstanding -= 1
                self.sent += kind == wire.SENT
                if kind == wire.DROPPED:
                    self.dropped.append(wire.FRAME_BODY.unpack(body)[1:])
            elif kind == wire.STATE:
                was_off, self.off = self.off, wire.STATE_BODY.unpack(body)[1] == OFF
                if self.off and not was_off:
                    self.socket.sendall(wire.record(wire.CONTROL, bytes([wire.ACTIVATE])))

    def send(self, frames, window=32):
        """From the list's end; what was dropped in a bus-off goes back to it."""
        while self.dropped:
            frames.append(self.dropped.pop())
        while frames and not self.off and self.outstanding < window:
            self.socket.sendall(wire.send_record(*frames.pop()))
            self.outstanding += 1


def pass_time(robot, server, clients, until_ns, act=lambda: None):
    while robot.loop.time < until_ns and not robot.ended:
        server.poll(robot.loop.time)
        for client in clients:
            client.hear()
        act()
        robot.run_for((robot.loop.time // MS + 1) * MS * 1e-9 - robot.loop.time * 1e-9)
    server.poll(robot.loop.time)
    for client in clients:
        client.hear()


def test_listeners_receive_what_the_robot_logs_and_change_nothing():
    with contextlib.closing(Ranger(Scenario(seed=2))) as alone:
        alone.run_for(0.5)
        digest = alone.trace_digest()
    with contextlib.closing(Ranger(Scenario(seed=2))) as robot:
        name = fresh_name()
        server = AttachServer(name, buses_of(robot))
        clients = {bus: Client(name, bus) for bus in buses_of(robot)}
        pass_time(robot, server, clients.values(), 500 * MS)
        counted = {bus.name: bus.counters.frames for bus in robot.buses}
        server.close()
        assert robot.trace_digest() == digest
    for bus, client in clients.items():
        # the last frame may have been decided but not be over
        assert counted[bus] - 1 <= len(client.frames) <= counted[bus]
        times = [frame[0] for frame in client.frames]
        assert times == sorted(times)
        client.socket.close()


def test_next_to_a_running_robot_python_can_sees_what_the_robot_logs(tmp_path):
    name = fresh_name()
    call = ("-m", "ranger_sim", "up", "--time", "2s", "--name", name, "--log", "full", "--out", str(tmp_path))
    with Program(*call, together=True) as robot:
        robot.until(r"python-can: .*\n")
        got = []
        with can.Bus(interface="ranger_sim", channel=f"{name}/can4", ignore_config=True) as bus:
            with pytest.raises(can.CanOperationError, match="has gone"):
                while True:
                    got.append(bus.recv())
            assert bus.statistics()["missed"] == 0
        assert robot.ended()[0] == 0
    logged = [entry[1:] for entry in read_candump(tmp_path / "can4.log")]
    seen = [(round(each.timestamp * 1e9), *frame_of_message(each)) for each in got]

    def same(one, other):  # stamps pass through a float, the log cuts to microseconds
        return one[1:] == other[1:] and abs(one[0] - other[0]) <= 1000

    first = next(place for place, entry in enumerate(logged) if same(entry, seen[0]))
    assert len(seen) > 5000
    assert all(same(*pair) for pair in zip(seen, logged[first : first + len(seen)], strict=True))


def test_frames_of_every_identifier_and_length_kill_no_board():
    """All 2048 standard identifiers with 0 ... 8 bytes, and extended and remote ones, on all four buses at once."""
    dice = RandomStream(11, "attacker")
    word = 1 << 32
    standard = [
        (identifier, length, dice.integer(word), dice.integer(word))
        for length, identifier in itertools.product(range(9), range(2048))
    ]
    other = [(dice.integer(1 << 29), 64 | dice.integer(9), dice.integer(word), 0) for _ in range(500)]
    other += [(dice.integer(2048), 16 | dice.integer(9), 0, 0) for _ in range(500)]
    left = {f"can{number}": standard + other for number in range(1, 5)}
    seed = sent = 0
    while any(left.values()):  # a robot with such frames on its buses soon falls; then the next one gets the rest
        seed += 1
        assert seed < 60
        with contextlib.closing(Ranger(Scenario(seed=seed))) as robot:
            name = fresh_name()
            server = AttachServer(name, buses_of(robot))
            clients = {bus: Client(name, bus) for bus in left}

            def act(clients=clients):
                for bus, client in clients.items():
                    client.send(left[bus])

            while not robot.ended and (any(left.values()) or any(client.outstanding for client in clients.values())):
                pass_time(robot, server, clients.values(), robot.loop.time + 100 * MS, act)
            for client in clients.values():
                sent += client.sent
                client.socket.close()
            for board_name, board in robot.boards.items():
                assert robot.loop.time - board.scheduler.slot_time < 5 * MS, f"{board_name} has stopped"
            boards = [node for bus in robot.buses for node in bus.nodes if "client" not in node.name]
            # colliding with a board's own identifiers throws the client off, never the board
            assert all(node.mode == OPERATING and node.received > 0 for node in boards)
            assert server.counters()["frames_in"] > 0
            server.close()
    # the frames that were in a queue when a robot fell are all that is missing
    assert sent >= 4 * (len(standard) + len(other)) - seed * 4 * 32
