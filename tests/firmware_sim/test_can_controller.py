"""The CAN controller by its registers."""

import pytest

from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.peripherals.can_controller import (
    CMR_AT,
    CMR_CDO,
    CMR_STB2,
    CMR_STB3,
    CMR_TR,
    ICR_BUS_ERROR,
    ICR_ERROR_WARNING,
    CanController,
    bit_rate_of,
    btr_value,
    sample_point_of,
)
from ranger_sim.firmware_sim.peripherals.can_controller_base import ICR_ALI, ICR_DOI, ICR_RI, ICR_TI1, ICR_TI2
from ranger_sim.firmware_sim.vic import FIQ
from ranger_sim.foundation.events import (
    CAN_ABORT,
    CAN_MODE,
    CAN_REQUEST,
    CAN_RX,
    CAN_STATUS,
    CAN_TX_DONE,
    FLAG_EXTENDED,
    FLAG_REMOTE,
    FLAG_SINGLE_SHOT,
    TX_ABORTED,
    TX_LOST,
    TX_SENT,
)
from ranger_sim.foundation.user_error import UserError


class Node:
    """A chip with one controller; `requests()` empties its outbox."""

    def __init__(self, number=1, IER=ICR_RI):
        self.chip = Microcontroller("TEST")
        self.can = CanController(self.chip, number, IER=IER)
        self.time = 0

    def tell(self, kind, *fields):
        self.time += 50_000
        self.chip.inbox.push(self.time, 512, kind, self.can.number, *fields)
        self.chip.advance(self.time + 1)

    def requests(self):
        box = self.chip.outbox
        out = []
        while box.take():
            out.append((box.kind, box.a, box.b, box.c, box.d, box.e, box.f))
        return out


def test_the_bit_timing_register_of_the_robot_gives_3_megabit_sampled_at_70_percent():
    assert btr_value(brp=1, sjw=1, tseg1=5, tseg2=2) == 0x00254001
    assert btr_value(brp=0, sjw=0, tseg1=0, tseg2=0, sam=1) == 0x00800000  # bit 23
    assert bit_rate_of(0x00254001, 60_000_000) == 3_000_000.0
    assert sample_point_of(0x00254001) == pytest.approx(0.70)
    assert Node().can.bit_rate() == 3_000_000.0


@pytest.mark.parametrize("field, value", [("brp", 1024), ("sjw", 4), ("tseg1", 16), ("tseg2", -1), ("sam", 2)])
def test_a_bit_timing_field_out_of_range_is_refused(field, value):
    fields = dict(brp=1, sjw=1, tseg1=5, tseg2=2)
    fields[field] = value
    with pytest.raises(UserError, match=f"{field.upper()} {value}"):
        btr_value(**fields)


def test_a_transmit_request_carries_identifier_length_and_both_words():
    node = Node(number=2)
    assert node.can.transmit(1, 21, 8, 0x3F800000, 1234)
    assert node.requests() == [(CAN_REQUEST, 2, 1, 21, 8, 0x3F800000, 1234)]
    assert (node.can.TFI[1], node.can.TID[1], node.can.TDA[1], node.can.TDB[1]) == (8 << 16, 21, 0x3F800000, 1234)


def test_a_buffer_is_not_free_until_the_bus_answers():
    node = Node()
    assert node.can.SR() == 0x0C0C0C
    assert node.can.transmit(2, 21, 8, 1, 2)
    assert not node.can.buffer_free(2)
    assert node.can.SR() == 0x0C000C
    assert node.can.GSR() & 0xC == 0
    assert not node.can.transmit(2, 22, 8, 3, 4)
    assert node.can.refused == 1
    assert not node.can.transmit_if_free(2, 22, 8, 3, 4)
    assert node.can.refused == 1, "who looks first commands nothing"
    assert node.can.TID[2] == 21
    node.tell(CAN_TX_DONE, 2, TX_SENT)
    assert node.can.SR() == 0x0C0C0C
    assert node.can.GSR() & 0xC == 0xC
    assert node.can.sent == 1


def test_transmit_and_abort_together_is_a_single_shot_and_a_lost_one_frees_the_buffer_incomplete():
    node = Node()
    node.can.TFI = [0, 0, 0, 8 << 16]
    node.can.TDA = node.can.TDB = [0, 0, 0, 77]
    node.can.write_CMR(CMR_TR | CMR_AT | CMR_STB3)
    assert node.requests() == [(CAN_REQUEST, 1, 3, 0, 8 | FLAG_SINGLE_SHOT, 77, 77)]
    node.tell(CAN_TX_DONE, 3, TX_LOST)
    assert (node.can.lost, node.can.sent) == (1, 0)
    assert node.can.SR() == 0x040C0C
    node.can.transmit(3, 0, 8 | FLAG_SINGLE_SHOT, 1, 1)
    assert node.requests()[0][4] == 8 | FLAG_SINGLE_SHOT


def test_an_abort_goes_out_only_for_a_buffer_in_use():
    node = Node()
    node.can.write_CMR(CMR_AT | CMR_STB2)
    assert node.requests() == []
    node.can.transmit(2, 9, 8, 0, 0)
    node.requests()
    node.can.write_CMR(CMR_AT | CMR_STB2)
    assert node.requests() == [(CAN_ABORT, 1, 2, 0, 0, 0, 0)]
    node.tell(CAN_TX_DONE, 2, TX_ABORTED)
    assert node.can.aborted == 1
    assert node.can.buffer_free(2)


def test_remote_and_extended_frames_keep_their_flags():
    node = Node()
    node.can.transmit(1, 0x12345678, 2 | FLAG_REMOTE | FLAG_EXTENDED, 0, 0)
    assert node.can.TFI[1] == 2 << 16 | 1 << 30 | 1 << 31
    assert node.requests()[0][4] == 2 | FLAG_REMOTE | FLAG_EXTENDED
    node.tell(CAN_RX, 0x12345678, 2 | FLAG_REMOTE | FLAG_EXTENDED, 0, 0)
    assert node.can.RFS == 2 << 16 | 1 << 30 | 1 << 31


def test_a_received_frame_is_in_the_registers_and_interrupts():
    node = Node()
    seen = []

    def handler(queue):
        seen.append((node.can.RID, node.can.RFS, node.can.RDA, node.can.RDB, node.can.SR() & 1))
        node.can.release()

    node.chip.vic.attach(CAN_RX, 1, handler, cost=90, slot=0)
    node.tell(CAN_RX, 21, 8, 0xDEADBEEF, 99)
    assert seen == [(21, 8 << 16, 0xDEADBEEF, 99, 1)]
    assert node.can.SR() & 1 == 0
    assert node.can.ICR & ICR_RI == 0


def test_two_frames_fit_the_hardware_and_a_third_is_a_data_overrun():
    node = Node(IER=ICR_RI | ICR_DOI)
    errors = []
    node.chip.vic.attach(CAN_STATUS, 1, lambda queue: errors.append(node.can.read_ICR()), cost=50, slot=8)
    for identifier in (10, 11, 12):
        node.tell(CAN_RX, identifier, 8, 0, 0)
    node.chip.advance(node.time + 10_000)
    assert (node.can.received, node.can.data_overruns) == (2, 1)
    assert errors == [ICR_RI | ICR_DOI]
    assert node.can.read_ICR() == ICR_RI  # reading cleared all but the receive bit
    assert node.can.GSR() & 3 == 3
    node.can.write_CMR(CMR_CDO)
    assert node.can.GSR() & 3 == 1
    assert node.can.RID == 10
    node.can.release()
    assert node.can.RID == 11
    node.can.release()
    node.can.release()
    assert node.can.SR() & 1 == 0


def test_the_second_frame_asks_for_its_own_interrupt_when_the_first_is_released():
    node = Node()
    seen = []

    def handler(queue):
        seen.append((node.can.RID, node.chip.now))
        node.can.release()

    def busy(queue):
        seen.append("busy")

    node.chip.vic.attach(CAN_RX, 1, handler, cost=60, slot=0, latency=0)
    blocker = node.chip.vic.attach(CAN_STATUS, 4, busy, cost=6000, slot=FIQ, latency=0)
    node.chip.request(blocker)
    node.chip.inbox.push(10_000, 512, CAN_RX, 1, 5, 8, 0, 0)
    node.chip.inbox.push(50_000, 512, CAN_RX, 1, 6, 8, 0, 0)
    node.chip.advance(200_000)
    assert seen == ["busy", (5, 100_000), (6, 101_000)]


def test_transmit_interrupts_come_only_when_enabled():
    node = Node(IER=ICR_TI2)
    served = []
    node.chip.vic.attach(CAN_TX_DONE, 1, lambda queue: served.append(node.can.read_ICR()), cost=50, slot=7)
    node.can.transmit(1, 5, 8, 0, 0)
    node.can.transmit(2, 6, 8, 0, 0)
    node.tell(CAN_TX_DONE, 1, TX_SENT)
    node.tell(CAN_TX_DONE, 2, TX_SENT)
    assert served == [ICR_TI1 | ICR_TI2]


def test_error_counters_and_warning_are_in_the_global_status():
    node = Node(IER=ICR_ERROR_WARNING | ICR_BUS_ERROR)
    served = []
    node.chip.vic.attach(CAN_STATUS, 1, lambda queue: served.append(node.can.read_ICR()), cost=50, slot=8)
    node.tell(CAN_STATUS, ICR_BUS_ERROR, 8, 3, 0)
    node.tell(CAN_STATUS, ICR_ERROR_WARNING, 96, 3, 0)
    node.tell(CAN_STATUS, ICR_ALI, 96, 3, 0)  # not enabled
    assert served == [ICR_BUS_ERROR, ICR_ERROR_WARNING]
    assert node.can.GSR() >> 24 == 96
    assert node.can.GSR() >> 16 & 255 == 3
    assert node.can.GSR() >> 6 & 1


def test_bus_off_means_reset_mode_until_software_restarts_the_controller():
    node = Node(IER=ICR_ERROR_WARNING)
    restarted = []

    def handler(queue):
        if node.can.GSR() >> 7 & 1:
            restarted.append(node.can.read_ICR())
            node.can.write_MOD(0)

    node.can.transmit(1, 5, 8, 0, 0)
    node.requests()
    node.tell(CAN_STATUS, ICR_ERROR_WARNING, 256, 0, 1)
    assert node.can.bus_off
    assert not node.can.transmit(1, 5, 8, 0, 0)
    node.tell(CAN_RX, 5, 8, 0, 0)
    assert node.can.received == 0
    node.chip.vic.attach(CAN_STATUS, 1, handler, cost=50, slot=8)
    node.chip.request(node.can.error_source)
    node.chip.advance(node.time + 10_000)
    assert restarted == [ICR_ERROR_WARNING]
    assert node.requests() == [(CAN_MODE, 1, 0, 0, 0, 0, 0)]
    node.tell(CAN_STATUS, 0, 0, 0, 0)
    assert not node.can.bus_off
    assert node.can.transmit(1, 5, 8, 0, 0)


def test_reset_mode_empties_both_sides():
    node = Node()
    node.tell(CAN_RX, 5, 8, 0, 0)
    node.can.transmit(1, 5, 8, 0, 0)
    node.can.write_MOD(1)
    assert node.can.SR() == 0x0C0C04  # free, but the one in hand was not completed
    assert node.requests()[-1] == (CAN_MODE, 1, 1, 0, 0, 0, 0)


def test_a_controller_number_that_does_not_exist_is_refused():
    with pytest.raises(UserError, match="CAN controller 5"):
        Node(number=5)
