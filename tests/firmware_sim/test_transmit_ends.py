"""The ends of transmissions, written by the bus beforehand or sent as messages: a program sees no difference."""

import pytest

from ranger_sim.can_bus.bus import Bus
from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.peripherals.can_controller import CMR_AT, CMR_STB1, CMR_TR, CanController
from ranger_sim.firmware_sim.peripherals.can_controller_base import ICR_RI, ICR_TI1, ICR_TI2, ICR_TI3
from ranger_sim.firmware_sim.scheduler import Schedule, Task
from ranger_sim.foundation.events import CAN_ABORT, CAN_REQUEST, CAN_TX_DONE, STAGE_BUS, EventQueue
from ranger_sim.foundation.random_stream import RandomStream

WINDOW_NS = 25_000  # shorter than the shortest frame
SLOT_US = 20
TRANSMIT_INTERRUPTS = (0, ICR_TI1, ICR_TI2, ICR_TI3, ICR_TI1 | ICR_TI2 | ICR_TI3)


class Sender:
    """A board whose slots do anything to its controller at random, on a bus with errors and a rival.

    `seen`: what it read, each with the time.
    """

    def __init__(self, seed, beforehand):
        self.random = RandomStream(seed, "sender")
        self.rival_random = RandomStream(seed, "rival")
        self.bus = Bus("can1", 3_000_000, seed)
        self.chip = Microcontroller("SENDER", crystal=Crystal(10_000_000, 0))
        self.can = CanController(self.chip, 1)
        self.seen = []
        node = self.bus.add_node("sender", self.chip.inbox, 1, STAGE_BUS * 256 + 1)
        if beforehand:
            self.bus.nodes[node].connect(self.can.ends)
        self.rival = self.bus.add_node("rival", EventQueue(), 1, STAGE_BUS * 256 + 2)
        self.chip.vic.attach(CAN_TX_DONE, 1, self.on_done, cost=60, slot=3, latency=0)
        self.chip.start(Schedule(slot_us=SLOT_US, every=(Task(self.act, cost=100), Task(self.act, cost=50))), 0)
        self.bus.set_bit_error_rate((0.0, 1e-4, 3e-3)[seed % 3])
        self.time = 0

    def look(self, what):
        can = self.can
        self.seen.append((what, self.chip.now, can.SR(), can.GSR(), can.sent, can.aborted, can.lost, can.refused))

    def on_done(self, queue):
        self.look(("interrupt", self.can.read_ICR()))

    def act(self):
        """One of the things that a program may do. The bus answers an abort or a change of mode at once."""
        self.do_something()
        if self.can.chip.outbox.count:
            self.chip.stop_at(self.chip.now + 1)

    def do_something(self):
        can, buffer = self.can, 1 + self.random.integer(3)
        choice = self.random.integer(16)
        if choice < 5:
            if can.buffer_free(buffer):
                can.transmit(buffer, self.random.integer(64), 8, self.random.integer(256), 0)
        elif choice == 5:
            can.transmit(buffer, self.random.integer(64), 8, 1, 2)
        elif choice == 6:
            can.TFI, can.TID = [8 << 16] * 4, [self.random.integer(64)] * 4
            can.write_CMR(CMR_TR | CMR_AT | CMR_STB1 << (buffer - 1))
        elif choice == 7:
            can.write_CMR(CMR_AT | CMR_STB1 << (buffer - 1))
        elif choice == 8:
            can.write_IER(ICR_RI | TRANSMIT_INTERRUPTS[self.random.integer(5)])
        elif choice == 9:
            self.seen.append(("ICR", self.chip.now, can.read_ICR()))
        elif choice == 10 and can.bus_off:
            can.write_MOD(0)
        elif choice == 11 and self.random.integer(20) == 0:
            can.write_MOD(1 - (can.MOD & 1))
        elif choice == 12:
            self.seen.append(("free", self.chip.now, can.buffer_free(buffer)))
        else:
            self.look("status")

    def run(self, until):
        out = self.chip.outbox
        while self.time < until:
            if self.rival_random.integer(3) == 0:
                self.bus.request(
                    self.rival, 1 + self.rival_random.integer(3), self.time, self.rival_random.integer(64), 8, 5, 5
                )
            self.bus.advance(self.time)
            self.chip.advance(self.time + WINDOW_NS)
            self.time = self.chip.horizon  # the chip has run no further than that
            while out.take():
                if out.kind == CAN_REQUEST:
                    self.bus.request(0, out.b, out.time, out.c, out.d, out.e, out.f)
                elif out.kind == CAN_ABORT:
                    self.bus.abort(0, out.b, out.time)
                else:
                    self.bus.set_mode(0, out.b, out.time)
        return self.seen


@pytest.mark.parametrize("seed", range(24))
def test_every_register_reads_the_same_whether_ends_are_written_beforehand_or_are_messages(seed):
    beforehand, by_message = Sender(seed, True), Sender(seed, False)
    assert beforehand.run(60_000_000) == by_message.run(60_000_000)
    assert len(by_message.seen) > 1000
    assert beforehand.chip.inbox.pushed < by_message.chip.inbox.pushed
