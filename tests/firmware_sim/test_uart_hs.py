"""The high-speed UART with DMA: known times, flow control, and what a full buffer costs."""

import pytest

from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.peripherals.uart_hs import HsUart
from ranger_sim.firmware_sim.scheduler import Schedule
from ranger_sim.firmware_sim.vic import DMA_DONE
from ranger_sim.foundation.events import PIN_EDGE, UART_BYTE, UART_OUTPUT
from ranger_sim.foundation.user_error import UserError

BYTE_NS = 10_769  # 10 bits of 14 cycles at 13 MHz: 10 769.23 ns
CTS = 5


class Chip(Microcontroller):
    def __init__(self, **options):
        Microcontroller.__init__(self, "CHIP", 208_000_000, Crystal())
        self.uart = HsUart(self, 1, 3, **options)
        self.done_at = []
        self.vic.attach(DMA_DONE, 3, self.on_done, cost=10, slot=0)
        self.start(Schedule(slot_us=2000), 0)

    def on_done(self, queue):
        self.done_at.append(self.now)

    def output(self):
        out = []
        while self.outbox.take():
            assert self.outbox.kind == UART_OUTPUT
            out.append((self.outbox.time, self.outbox.a, self.outbox.c, self.outbox.ref))
        return out


def test_the_rate_register_gives_the_two_baud_rates_of_the_robot():
    assert Chip().uart.baud == pytest.approx(928_571.4, abs=0.1)
    assert Chip(rate=1).uart.baud == pytest.approx(464_285.7, abs=0.1)


def test_a_transfer_leaves_at_the_end_of_its_last_stop_bit_and_raises_the_dma_interrupt():
    chip = Chip()
    chip.advance(1000)
    chip.now = 1000
    assert chip.uart.transmit(b"abc")
    assert not chip.uart.transmit(b"next"), "the channel is busy"
    chip.advance(1_000_000)
    assert chip.output() == [(1000 + 3 * BYTE_NS, 1, 3, b"abc")]
    assert chip.uart.sent == 3
    assert len(chip.done_at) == 1 and 0 <= chip.done_at[0] - (1000 + 3 * BYTE_NS) < 300
    assert not chip.uart.busy


def test_clear_to_send_holds_a_transfer_back_and_lets_it_go():
    chip = Chip(cts_pin=CTS)
    chip.inbox.push(0, 0, PIN_EDGE, CTS, 1, -1, 0)
    chip.advance(10)
    chip.uart.transmit(b"abc")
    chip.advance(1_000_000)
    assert chip.output() == [] and chip.uart.busy
    chip.inbox.push(1_000_000, 0, PIN_EDGE, CTS, 0, -1, 0)
    chip.advance(2_000_000)
    assert [time for time, *_ in chip.output()] == [1_000_000 + 3 * BYTE_NS]


def test_a_transfer_that_has_begun_is_finished():
    chip = Chip(cts_pin=CTS)
    chip.uart.transmit(b"abc")
    chip.inbox.push(1, 0, PIN_EDGE, CTS, 1, -1, 0)
    chip.advance(1_000_000)
    assert len(chip.output()) == 1 and not chip.uart.busy


def test_received_bytes_wait_in_the_buffer_that_fills_until_it_is_swapped():
    chip = Chip()
    chip.inbox.push(100, 0, UART_BYTE, 1, 0x11)  # one byte
    chip.inbox.push(200, 0, UART_BYTE, 1, 0x22, 6, 0x55443322, 0x7766)  # six, low byte first
    chip.advance(1000)
    assert chip.uart.swap() == 7
    chip.inbox.push(1100, 0, UART_BYTE, 1, 0x99)
    chip.advance(2000)
    assert bytes(chip.uart.taken(i) for i in range(7)) == bytes.fromhex("11223344556677")
    assert chip.uart.swap() == 1 and chip.uart.taken(0) == 0x99


def test_a_full_buffer_switches_its_channel_off_until_the_next_swap():
    chip = Chip(buffer_bytes=2)
    chip.inbox.push(100, 0, UART_BYTE, 1, 1, 3, 0x030201, 0)
    chip.advance(1000)
    assert chip.uart.overrun and (chip.uart.received, chip.uart.lost) == (2, 1)
    assert chip.uart.swap() == 2
    assert not chip.uart.overrun


@pytest.mark.parametrize("options", [{"rate": 256}, {"rate": -1}, {"hz": 0}, {"buffer_bytes": 0}])
def test_impossible_settings_are_named(options):
    with pytest.raises(UserError, match="UART 1"):
        Chip(**options)
