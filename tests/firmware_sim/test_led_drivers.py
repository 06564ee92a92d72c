"""LED drivers in a chain, by words and edges of the MAX6966's data sheet."""

import pytest

from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.peripherals.led_drivers import LedDrivers
from ranger_sim.firmware_sim.peripherals.ssp import SspDevice, SspMaster
from ranger_sim.foundation.user_error import UserError

SELECT = 20
RUN = 0x1001
NOTHING = 0x2000


class Chain:
    """Drivers whose select pin and words a test moves, as a program does."""

    def __init__(self, count, bits=16):
        self.chip = Microcontroller("chip")
        self.chip.pins[SELECT] = 1
        self.drivers = LedDrivers(self.chip, SELECT, count)
        self.port = SspMaster(self.chip, self.drivers, bits)

    def select(self, level):
        self.chip.pins[SELECT] = level
        return self.drivers.on_select(level)

    def send(self, *words):
        """Words between two edges of the select pin; returns the answer."""
        assert not self.select(0)
        came = [self.port.word(word) for word in words]
        assert self.select(1)
        return came

    def levels(self, device=0):
        return [self.drivers.level(device, port) for port in range(10)]


@pytest.fixture
def one():
    chain = Chain(1)
    chain.send(RUN)
    return chain


@pytest.fixture
def two():
    chain = Chain(2)
    chain.send(RUN, RUN)
    return chain


def test_after_power_up_no_port_drives_and_without_run_mode_none_ever_does():
    chain = Chain(1)
    assert chain.levels() == [0] * 10
    chain.send(0x0080)
    assert chain.levels() == [0] * 10
    chain.send(RUN)
    assert chain.levels() == [0x80] + [0] * 9
    chain.send(0x1000)
    assert chain.levels() == [0] * 10


@pytest.mark.parametrize(
    ("value", "level"), [(0x00, 255), (0x01, 0), (0x02, 255), (0x03, 3), (0x80, 128), (0xFE, 254), (0xFF, 0)]
)
def test_a_port_is_on_off_or_has_pulses(one, value, level):
    one.send(0x0700 | value)
    assert one.levels() == [level if port == 7 else 0 for port in range(10)]


@pytest.mark.parametrize(
    ("register", "ports"), [(0x0A, range(10)), (0x0B, range(4)), (0x0C, range(4, 8)), (0x0D, (8, 9))]
)
def test_some_registers_write_several_ports(one, register, ports):
    one.send(register << 8 | 0x40)
    assert one.levels() == [0x40 if port in ports else 0 for port in range(10)]


def test_the_first_word_goes_to_the_farthest_driver(two):
    two.send(0x0111, 0x0222)
    assert two.levels(1) == [0, 0x11] + [0] * 8
    assert two.levels(0) == [0, 0, 0x22] + [0] * 7
    two.send(NOTHING, 0x0133)
    assert two.levels(1) == [0, 0x11] + [0] * 8
    assert two.levels(0) == [0, 0x33, 0x22] + [0] * 7


def test_words_are_taken_at_the_rising_edge_of_select_alone(one):
    one.select(0)
    one.port.word(0x0055)
    assert one.levels() == [0] * 10
    assert not one.select(0) and one.select(1)
    assert one.levels()[0] == 0x55
    one.port.word(0x0066)  # nobody listens
    assert not one.select(1)
    one.select(0)
    one.select(1)
    assert one.levels()[0] == 0x55


def test_bytes_do_as_well_as_words():
    chain = Chain(2, bits=8)
    chain.send(0x10, 0x01, 0x10, 0x01)
    chain.send(0x03, 0x77, 0x20, 0x00)
    assert chain.levels(1) == [0] * 3 + [0x77] + [0] * 6
    assert chain.levels(0) == [0] * 10


def test_what_leaves_the_chain_comes_back_and_so_does_a_register_that_is_read(two):
    assert two.send(0x0111, NOTHING) == [RUN, RUN]
    assert two.send(NOTHING, NOTHING) == [0x0111, NOTHING]
    two.send(0x8100, NOTHING)  # read port 1 of the far one
    assert two.send(NOTHING, NOTHING)[0] & 0xFF == 0x11
    assert two.levels(1)[1] == 0x11  # reading wrote nothing


def test_a_longer_chain_than_is_modelled_is_refused():
    with pytest.raises(UserError, match="chip: a chain of 3 LED drivers: 1 to 2 are modelled"):
        LedDrivers(Microcontroller("chip"), SELECT, 3)


def test_a_word_has_as_many_bits_as_the_port_was_set_to():
    class Echo(SspDevice):
        def exchange(self, word, time):
            return word

    chip = Microcontroller("chip")
    assert [SspMaster(chip, Echo(chip), bits).word(0x12345) for bits in (4, 8, 16)] == [5, 0x45, 0x2345]
