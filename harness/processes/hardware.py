"""A running robot's work for the boards that its profile has elsewhere: it sends for the absent ones and monitors
the external ones. It is another external connection that the plant's process polls.
"""

import collections
from collections.abc import Callable
from typing import Any

from ranger_sim.foundation.events import CAN_REQUEST, CAN_TX_DONE, STAGE_BUS, EventQueue
from ranger_sim.harness.outside.profile import Profile
from ranger_sim.harness.outside.rest_bus import RestBus
from ranger_sim.harness.outside.supervision import Watch

CHECK_NS = 10_000_000  # between two checks for missing frames
CONTROLLER = 1
MOST_WAITING = 100  # frames per bus that wait for a free buffer; more are lost and counted (chosen by us)


class RestNode:
    """The transmitter of the rest-bus on one bus: three buffers and a queue before them."""

    def __init__(self, inbox: EventQueue, request: Callable[[int, int, int, int, int, int], Any]) -> None:
        self.inbox = inbox
        self.request = request  # (buffer, time in ns, identifier, flags, lo, hi)
        self.free = [1, 2, 3]
        self.waiting: collections.deque[tuple[int, int, int, int]] = collections.deque()
        self.lost = 0

    def offer(self, identifier: int, flags: int, lo: int, hi: int) -> None:
        """Queue a frame to be sent as soon as a buffer is free."""
        if len(self.waiting) >= MOST_WAITING:
            self.lost += 1
            return
        self.waiting.append((identifier, flags, lo, hi))

    def poll(self, now_ns: int) -> None:
        """Take back the buffers whose frames are sent, and fill them."""
        while self.inbox.head_time <= now_ns and self.inbox.take():
            if self.inbox.kind == CAN_TX_DONE:
                self.free.append(self.inbox.b)
        while self.free and self.waiting:
            self.request(self.free.pop(0), now_ns, *self.waiting.popleft())


class HardwareInTheLoop:
    """`poll`, `filenos`, `counters` as of every external connection. `watch` and `rest` are public for reports."""

    def __init__(self, robot: Any, profile: Profile, outside: list[Any]) -> None:
        self.watch = Watch(profile, robot.start_ns)
        self.rest = RestBus(profile, robot.start_ns)
        self.nodes: dict[str, RestNode] = {}
        self.next_check_ns = robot.start_ns
        external = {bus.name: bus for bus in outside}
        order = STAGE_BUS * 256 + 16 * len(robot.boards)  # after every board
        for bus in robot.buses:
            if bus.name in external and profile.external():
                external[bus.name].sinks.append(self._sink(bus.name))
            if not profile.absent():
                continue
            inbox: EventQueue = EventQueue()
            if bus.name in external:
                peer = external[bus.name].add_peer(f"{bus.name}, rest-bus", inbox, CONTROLLER, order)
                self.nodes[bus.name] = RestNode(inbox, self._through(peer))
            else:
                node = bus.add_node("rest-bus", inbox, CONTROLLER, order)
                self.nodes[bus.name] = RestNode(inbox, self._onto(bus, node))
        robot.attach(self)

    def _sink(self, name: str) -> Callable[[int, int, int, int, int], Any]:
        def receive(time_ns: int, identifier: int, flags: int, lo: int, hi: int) -> None:
            self.watch.frame(time_ns, name, identifier, flags, lo, hi)

        return receive

    @staticmethod
    def _through(peer: Any) -> Callable[[int, int, int, int, int, int], Any]:
        def request(buffer: int, time: int, identifier: int, flags: int, lo: int, hi: int) -> None:
            peer.from_board(CAN_REQUEST, time, buffer, identifier, flags, lo, hi)

        return request

    @staticmethod
    def _onto(bus: Any, node: int) -> Callable[[int, int, int, int, int, int], Any]:
        def request(buffer: int, time: int, identifier: int, flags: int, lo: int, hi: int) -> None:
            bus.request(node, buffer, time, identifier, flags, lo, hi)

        return request

    def poll(self, now_ns: int) -> int:
        """Send frames of absent boards, and check external boards; returns the time of the next poll, ns."""
        for _time, bus, identifier, flags, lo, hi in self.rest.due(now_ns):
            self.nodes[bus].offer(identifier, flags, lo, hi)
        busy = False
        for node in self.nodes.values():
            node.poll(now_ns)
            busy = busy or bool(node.waiting)
        if now_ns >= self.next_check_ns:
            self.next_check_ns = now_ns + CHECK_NS
            self.watch.check(now_ns)
        soon = now_ns + 125_000 if busy else self.next_check_ns
        return min(soon, max(self.rest.next_time, now_ns))

    def filenos(self) -> list[int]:
        """Return an empty list: nothing to select on."""
        return []

    def counters(self) -> dict[str, int]:
        """Counters for the live view."""
        return {
            "faults_of_external_boards": self.watch.faults,
            "rest_bus_frames": self.rest.frames,
            "rest_bus_lost": sum(node.lost for node in self.nodes.values()),
        }
