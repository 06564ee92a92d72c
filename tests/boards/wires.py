"""A few wires for a board alone on the table: buses that carry one frame after the other, a link partner."""

from ranger_sim.boards.modules.ssp_link import EXCHANGE_NS, MainBrainSspLink
from ranger_sim.foundation.events import (
    CAN_ABORT,
    CAN_REQUEST,
    CAN_RX,
    CAN_TX_DONE,
    PIN_EDGE,
    SSP_SEGMENT,
    SSP_START,
    STAGE_BUS,
    STAGE_INTERRUPTS,
    STAGE_PINS,
    TX_SENT,
    UART_BYTE,
    UART_OUTPUT,
)

FRAME_NS = 37_000  # 111 bits at 3 Mbit/s
IMU_BYTE_NS = 21_714  # 10 bits at 460 526 baud


class Wires:
    """Runs one board in steps and answers what it puts out. `sent`: (time, bus, id, flags, word0, word1)."""

    def __init__(self, board, brain=None, quantum=25_000):
        self.board = board
        self.brain = brain
        self.quantum = quantum
        self.time = 0
        self.sent = []
        self.uart = []
        self.free = {n: 0 for n in (1, 2, 3, 4)}
        self.dead = set()  # buses that never finish a frame
        self.heard = []  # frames that the main brain read: (id, word0, word1)
        self.feeds = []  # called before every step with (time, until)

    def run(self, until):
        while self.time < until:
            then = min(self.time + self.quantum, until)
            for feed in self.feeds:
                feed(self.time, then)
            self.board.advance(then)
            self.drain()
            self.time = then
        return self

    def drain(self):
        out = self.board.outbox
        while out.take():
            if out.kind == CAN_REQUEST:
                self.sent.append((out.time, out.a, out.c, out.d, out.e, out.f))
                if out.a not in self.dead:
                    end = max(out.time, self.free[out.a]) + FRAME_NS
                    self.free[out.a] = end
                    self.board.inbox.push(end, STAGE_BUS * 256, CAN_TX_DONE, out.a, out.b, TX_SENT)
            elif out.kind == SSP_START and self.brain is not None:
                down = self.brain.exchanged(out.ref)
                self.board.inbox.push(
                    out.time + EXCHANGE_NS, STAGE_INTERRUPTS * 256, SSP_SEGMENT, 0, 0, 0, 0, 0, 0, down
                )
                self.brain.parse()
                self.heard += self.brain.parsed()
            elif out.kind == UART_OUTPUT:
                self.uart.append((out.time, out.b))
            elif out.kind == CAN_ABORT:
                raise AssertionError("no board aborts a frame")

    def frame(self, time, bus, identifier, word0=0, word1=0, flags=8):
        """A frame of another node, whole at `time`."""
        self.board.inbox.push(time, STAGE_BUS * 256, CAN_RX, bus, identifier, flags, word0, word1)

    def pin(self, time, pin, level):
        self.board.inbox.push(time, STAGE_PINS * 256, PIN_EDGE, pin, level, -1, 0)

    def bytes(self, time, uart, data, group=8):
        """Bytes that begin at `time`, in messages of `group`."""
        for i in range(0, len(data), group):
            part = data[i : i + group]
            end = time + (i + len(part)) * IMU_BYTE_NS
            low = int.from_bytes(part[:4], "little")
            high = int.from_bytes(part[4:8], "little")
            self.board.inbox.push(end, STAGE_PINS * 256, UART_BYTE, uart, part[0], len(part), low, high)

    def of(self, identifier, bus=None):
        """What was sent of `identifier`: (time, word0, word1)."""
        return [(s[0], s[4], s[5]) for s in self.sent if s[2] == identifier and (bus is None or s[1] == bus)]


def quiet_brain():
    """A main brain's end of the link that listens from the first segment on."""
    said = []
    brain = MainBrainSspLink(said.append, 2031, False)
    return brain, said
