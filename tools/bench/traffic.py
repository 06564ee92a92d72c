"""Speed of the bus: a load for four of them; every receiver checks every frame.

The load is compiled like the bus, so that the figures are those of the bus.
"""

import array

import cython

from ranger_sim.can_bus.bus import Bus
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.events import CAN_RX, CAN_TX_DONE, STAGE_BUS, EventQueue

ROBOT_BIT_RATE = 3_000_000  # bit/s, robot.md N1.2
ROBOT_BUSES = 4


@cython.cclass
class Load:
    """Nodes on some buses that send continuously and check every frame they receive.

    Node n of a bus sends identifiers 16 n + 1 ... 16 n + `per_node`, in turn, from its three buffers,
    `nodes_per_bus` * rate frames/s per bus in all; `load` is the share of the bus's bits it aims at,
    and with 1 or more every buffer is refilled as soon as it is free. The data carry a running number
    per identifier: a frame lost, doubled or out of order shows up in `out_of_order`.
    """

    buses: list
    inboxes: list
    per_node: cython.longlong
    nodes_per_bus: cython.longlong
    period_ns: cython.longlong
    quantum_ns: cython.longlong
    time: cython.longlong
    requested: cython.longlong
    delivered: cython.longlong
    done: cython.longlong
    out_of_order: cython.longlong
    wrong: cython.longlong
    sent: cython.longlong[::1]
    expected: cython.longlong[::1]
    free: cython.longlong[::1]
    word: cython.longlong[::1]

    def __init__(self, buses=4, nodes_per_bus=3, load=0.75, per_node=3) -> None:
        self.per_node = per_node
        self.nodes_per_bus = nodes_per_bus
        self.quantum_ns = 25_000
        # 117 bits: mean length of such frames with stuffing and intermission
        self.period_ns = int(117 * nodes_per_bus * 1e9 / ROBOT_BIT_RATE / load) if load < 1.0 else 0
        self.time = 0
        self.requested = 0
        self.delivered = 0
        self.done = 0
        self.out_of_order = 0
        self.wrong = 0
        self.buses = []
        self.inboxes = []
        for b in range(buses):
            bus = Bus(f"can{b + 1}", ROBOT_BIT_RATE)
            queues = [EventQueue(64) for _ in range(nodes_per_bus)]
            for n, queue in enumerate(queues):
                bus.add_node(f"node{n}", queue, 1, STAGE_BUS * 256 + n)
            bus.log.capacity = 0
            self.buses.append(bus)
            self.inboxes.append(queues)
        count = buses * nodes_per_bus
        self.sent = array.array("q", [0]) * (count * per_node)  # running number per identifier
        self.expected = array.array("q", [0]) * (count * nodes_per_bus * per_node)  # by receiver
        self.free = array.array("q", [7]) * count  # bit set of free buffers
        self.word = array.array("q", [0]) * (2 * count)  # next time to send (ns), identifiers used

    @cython.ccall
    @cython.exceptval(check=True)
    def run(self, frames: cython.longlong) -> cython.void:
        """Pass time until `frames` have been asked for, then until the buses are empty."""
        bus: Bus
        inbox: EventQueue
        b: cython.longlong
        n: cython.longlong
        node: cython.longlong
        buffer: cython.longlong
        which: cython.longlong
        number: cython.longlong
        due: cython.longlong
        goal: cython.longlong = self.requested + frames
        busy: cython.bint = True
        while busy:
            busy = self.requested < goal
            for b in range(len(self.buses)):
                bus = self.buses[b]
                if bus.next_time <= self.time:
                    bus.advance(self.time)
                if bus.buffers.waiting_count > 0:
                    busy = True
                for n in range(self.nodes_per_bus):
                    inbox = self.inboxes[b][n]
                    node = b * self.nodes_per_bus + n
                    if inbox.count > 0:
                        busy = True
                        self._drain(bus, b, n, inbox)
                    while self.free[node] != 0 and self.requested < goal:
                        due = self.word[2 * node]
                        if due >= self.time + self.quantum_ns:
                            break
                        if due < self.time:
                            due = self.time
                        # identifier number i always from buffer i % 3, so equal identifiers keep order
                        which = self.word[2 * node + 1] % self.per_node
                        buffer = which % 3
                        if self.free[node] >> buffer & 1 == 0:
                            break
                        number = self.sent[node * self.per_node + which]
                        bus.request(n, buffer + 1, due, 16 * n + 1 + which, 8, number * 40503, number)
                        self.sent[node * self.per_node + which] = number + 1
                        self.word[2 * node + 1] += 1
                        self.word[2 * node] += self.period_ns
                        self.free[node] ^= 1 << buffer
                        self.requested += 1
            self.time += self.quantum_ns

    @cython.cfunc
    @cython.exceptval(check=True)
    def _drain(self, bus: Bus, b: cython.longlong, n: cython.longlong, inbox: EventQueue) -> cython.void:
        """Check the frames that a node has received so far."""
        sender: cython.longlong
        which: cython.longlong
        place: cython.longlong
        mask: cython.longlong = 0xFFFFFFFF
        node: cython.longlong = b * self.nodes_per_bus + n
        while inbox.head_time <= self.time:
            inbox.take()
            if inbox.kind == CAN_RX:
                sender = inbox.b // 16
                which = inbox.b % 16 - 1
                place = (node * self.nodes_per_bus + sender) * self.per_node + which
                if inbox.e != self.expected[place]:
                    self.out_of_order += 1
                if inbox.d != (inbox.e * 40503 & mask):
                    self.wrong += 1
                self.expected[place] = inbox.e + 1
                self.delivered += 1
            elif inbox.kind == CAN_TX_DONE:
                self.free[node] |= 1 << (inbox.b - 1)
                self.done += 1


def million_frames(frames: int = 1_000_000, load: float = 1.0, nodes_per_bus: int = 3) -> dict:
    """`frames` over four buses at `load`; every node checks every frame of the others.

    Figures: frames, delivered, lost (requested but not received by every other node), out_of_order, cpu_s,
    frames_per_s (of processor time), simulated_s, load_mean, times_real_time.
    """
    traffic = Load(ROBOT_BUSES, nodes_per_bus, load)
    start = wallclock.process_cpu_s()
    traffic.run(frames)
    cpu_s = max(wallclock.process_cpu_s() - start, 1e-9)
    simulated_s = traffic.time * 1e-9
    return {
        "frames": traffic.requested,
        "sent": sum(bus.counters.frames for bus in traffic.buses),
        "delivered": traffic.delivered,
        "lost": traffic.requested * (nodes_per_bus - 1)
        - traffic.delivered
        + sum(bus.counters.lost for bus in traffic.buses),
        "out_of_order": traffic.out_of_order + traffic.wrong,
        "cpu_s": cpu_s,
        "frames_per_s": traffic.requested / cpu_s,
        "simulated_s": simulated_s,
        "times_real_time": simulated_s / cpu_s,
        "load_mean": sum(bus.load_mean(traffic.time) for bus in traffic.buses) / len(traffic.buses),
    }
