"""A bus with some nodes, and what their inboxes held, for the tests of this folder."""

from ranger_sim.can_bus.bus import Bus
from ranger_sim.foundation.events import CAN_RX, CAN_STATUS, CAN_TX_DONE, STAGE_BUS, EventQueue

RATE = 3_000_000  # bit/s


class Wired:
    """`count` nodes named n0, n1 ... on one bus; `messages(n)` empties an inbox into a list of dicts."""

    def __init__(self, count=3, bitrate=RATE, seed=0):
        self.bus = Bus("can1", bitrate, seed)
        self.inboxes = [EventQueue(8) for _ in range(count)]
        for n, inbox in enumerate(self.inboxes):
            assert self.bus.add_node(f"n{n}", inbox, 1, STAGE_BUS * 256 + n) == n

    def send(self, node, identifier, time=0, buffer=1, flags=8, lo=0, hi=0):
        return self.bus.request(node, buffer, time, identifier, flags, lo, hi)

    def messages(self, node):
        queue = self.inboxes[node]
        found = []
        while queue.take():
            if queue.kind == CAN_RX:
                found.append(("rx", queue.time, queue.b, queue.c, queue.d, queue.e))
            elif queue.kind == CAN_TX_DONE:
                found.append(("done", queue.time, queue.b, queue.c))
            elif queue.kind == CAN_STATUS:
                found.append(("status", queue.time, queue.b, queue.c, queue.d, queue.e))
            else:
                raise AssertionError(f"a message of kind {queue.kind} from a bus")
            assert queue.a == 1
            assert queue.order == STAGE_BUS * 256 + node
        return found

    def of(self, node, kind):
        return [message[1:] for message in self.messages(node) if message[0] == kind]

    def log(self):
        """Logged frames as tuples (time, identifier, flags, lo, hi, node)."""
        return self.bus.log.take()


def edge(bit, bitrate=RATE):
    """First whole ns of a bit, by whole numbers of any size."""
    return -(-bit * 10**9 // bitrate)
