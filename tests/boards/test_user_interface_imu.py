"""The IMU parser: known packets, damaged streams, and that it always finds back."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ranger_sim.boards.modules.imu_parser import ImuParser, start_command
from ranger_sim.datatable.generated import errors
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.peripherals.uart import Uart
from ranger_sim.foundation.events import UART_BYTE
from ranger_sim.foundation.numbers import float32


def packet(header, values, timer=0):
    body = bytes([header]) + struct.pack(">6f", *values) + struct.pack(">I", timer)
    return body + struct.pack(">H", sum(body) & 0xFFFF)


def feed(parser, data):
    for byte in data:
        parser.push(byte)


@pytest.fixture
def said():
    return []


def test_a_packet_of_angles_and_rates_is_read_field_by_field(said):
    parser = ImuParser(said.append)
    feed(parser, packet(0xCF, (0.25, -0.5, 1.5, -2.0, 3.0, 4.0), timer=0x01020304))
    assert parser.update() == 31
    assert (parser.roll, parser.pitch, parser.yaw) == (0.25, -0.5, 1.5)
    assert (parser.rate_x, parser.rate_y, parser.rate_z) == (-2.0, 3.0, 4.0)
    assert parser.timer == 0x01020304
    assert (parser.packets, parser.waiting()) == (1, 0)


def test_a_known_packet_byte_by_byte(said):
    # header, roll 1.0, five zeros, timer 0; sum 0xCF + 0x3F + 0x80 = 0x018E
    parser = ImuParser(said.append)
    feed(parser, bytes.fromhex("cf 3f800000" + "00000000" * 6 + "018e"))
    parser.update()
    assert (parser.packets, parser.roll) == (1, 1.0)


def test_a_rate_packet_brings_rates_and_leaves_the_angles_alone(said):
    parser = ImuParser(said.append, 0xC2)
    feed(parser, packet(0xC2, (0.0, 0.0, -1.0, 0.7, 0.1, 0.2)))
    parser.update()
    assert (parser.rate_x, parser.rate_y, parser.rate_z) == (float32(0.7), float32(0.1), float32(0.2))
    assert parser.acceleration_z == -1.0
    assert (parser.roll, parser.pitch, parser.yaw) == (0.0, 0.0, 0.0)


def test_the_start_command_asks_for_the_packet_continuously():
    assert start_command(0xCF) == bytes.fromhex("c4c129cf")


def test_a_call_takes_a_single_packet_although_more_wait(said):
    parser = ImuParser(said.append)
    feed(parser, packet(0xCF, (1.0,) * 6) + packet(0xCF, (2.0,) * 6))
    parser.update()
    assert parser.roll == 1.0
    parser.update()
    assert parser.roll == 2.0


def test_the_firmwares_parser_waits_for_the_first_byte_of_the_next_packet(said):
    parser = ImuParser(said.append, 0xCF, True)
    feed(parser, packet(0xCF, (1.0,) * 6))
    parser.update()
    assert parser.packets == 0
    parser.push(0xCF)
    parser.update()
    assert parser.packets == 1


def test_bytes_before_the_header_are_skipped(said):
    parser = ImuParser(said.append)
    feed(parser, bytes(9) + packet(0xCF, (1.0,) * 6))
    parser.update()
    assert (parser.packets, parser.skipped_bytes) == (1, 9)


def test_a_wrong_checksum_costs_one_byte_and_keeps_the_old_values(said):
    parser = ImuParser(said.append)
    feed(parser, packet(0xCF, (1.0,) * 6))
    parser.update()
    bad = bytearray(packet(0xCF, (2.0,) * 6))
    bad[7] ^= 0x10
    feed(parser, bad)
    parser.update()
    assert (parser.roll, parser.bad_checksums, parser.waiting()) == (1.0, 1, 30)


def test_a_full_ring_reports_and_loses_the_byte(said):
    parser = ImuParser(said.append)
    feed(parser, bytes(129))
    assert said == [errors.MSIMU_RX_OF] * 2
    assert (parser.waiting(), parser.bytes_lost) == (127, 2)


@pytest.mark.parametrize(("stored", "kept"), [(118, 127), (119, 127), (120, 127)])
def test_what_the_fifo_brings_fills_the_ring_to_its_last_place_and_the_rest_is_reported(said, stored, kept):
    chip = Microcontroller("UI", 60_000_000)
    uart = Uart(chip, number=1, trigger=14)
    for byte in range(9):
        chip.inbox.push(1000 * (1 + byte), 0, UART_BYTE, 1, byte)
    chip.advance(20_000)
    parser = ImuParser(said.append)
    feed(parser, bytes(stored))
    assert parser.receive(uart) == 9
    lost = max(0, stored + 9 - kept)
    assert (parser.waiting(), parser.bytes_lost, len(said)) == (min(stored + 9, kept), lost, lost)


@given(st.lists(st.one_of(st.binary(max_size=40), st.just(packet(0xCF, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0))))))
def test_no_stream_of_bytes_stops_the_parser_and_it_finds_back(pieces):
    parser = ImuParser(lambda code: None)
    for piece in pieces:
        feed(parser, piece)
        before = parser.waiting()
        assert 0 <= parser.update() <= before + 31
        assert 0 <= parser.waiting() <= before
    # a dozen good packets, each with time to be read: the parser is in step again and has read them
    before = parser.packets
    for _ in range(12):
        feed(parser, packet(0xCF, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)))
        for _ in range(32):
            parser.update()
    assert parser.packets > before
    assert (parser.roll, parser.rate_z) == (1.0, 6.0)
    assert parser.waiting() == 0
