"""CAN FD through python-can: frames of every length, two rates, classic clients, and what is refused."""

import can
import pytest

from ranger_sim.can_bus.edge.messages import frame_of_message, message_of_frame
from ranger_sim.can_bus.fd_frame import LENGTHS
from ranger_sim.foundation.events import FLAG_BRS, FLAG_ESI, FLAG_EXTENDED, FLAG_FD

from .test_python_can import bus  # noqa: F401 (a fixture)

FD = {"fd": True, "speed": "max", "bitrate": 500_000, "data_bitrate": 2_000_000}


def fd_message(identifier, data=b"", **options):
    return can.Message(arbitration_id=identifier, data=data, is_extended_id=identifier > 0x7FF, is_fd=True, **options)


def test_frames_of_every_length_arrive_as_they_were_sent(bus):  # noqa: F811
    a, b = bus(**FD), bus(**FD)
    for number, length in enumerate(LENGTHS):
        sent = fd_message(0x100 + number, bytes(range(length)), bitrate_switch=number % 2 == 0)
        a.send(sent)
        found = b.recv(10)
        assert found.is_fd and found.equals(sent, timestamp_delta=None, check_channel=False, check_direction=False)
        assert found.bitrate_switch == sent.bitrate_switch and not found.error_state_indicator
    assert (a.protocol, "CAN FD, 2000000 bit/s" in a.channel_info) == (can.CanProtocol.CAN_FD, True)


def test_a_frame_lasts_as_long_as_its_two_rates_say(bus):  # noqa: F811
    """0x555 with 64 bytes 0x55: 26 nominal and 550 data bits, 2 us and 0.5 us; then the intermission."""
    a, b = bus(**FD), bus(**FD)
    for _ in range(2):
        a.send(fd_message(0x555, b"\x55" * 64, bitrate_switch=True))
    first, second = b.recv(10), b.recv(10)
    assert second.timestamp - first.timestamp == pytest.approx((26 + 3) * 2e-6 + 550 * 0.5e-6, abs=1e-6)


def test_a_length_that_can_fd_does_not_have_is_filled_up_with_zeros(bus):  # noqa: F811
    a, b = bus(**FD), bus(**FD)
    a.send(fd_message(0x12345, b"\xff" * 21))
    found = b.recv(10)
    assert (found.is_extended_id, bytes(found.data), found.dlc) == (True, b"\xff" * 21 + bytes(3), 24)


def test_classic_and_fd_messages_share_a_bus(bus):  # noqa: F811
    a, b = bus(**FD), bus(**FD, receive_own_messages=True)
    a.send(can.Message(arbitration_id=1, data=b"\x01", is_extended_id=False))
    b.send(fd_message(2, bytes(48)))
    assert [(each.arbitration_id, each.is_fd) for each in (b.recv(10), b.recv(10))] == [(1, False), (2, True)]
    assert [(each.arbitration_id, each.is_fd) for each in (a.recv(10),)] == [(2, True)]


def test_a_client_without_fd_is_a_classic_node_that_disturbs_fd_frames(bus):  # noqa: F811
    a, b, classic = bus(**FD), bus(**FD), bus(speed="max")
    a.send(fd_message(0x10, bytes(12), bitrate_switch=True))
    seen = []
    while True:
        seen.append(b.recv(10))
        if not seen[-1].is_error_frame:
            break
    assert seen[-1].arbitration_id == 0x10 and len(seen) > 10
    assert classic.statistics()["receive_errors"] >= 128
    with pytest.raises(can.CanOperationError, match="the bus is classic CAN"):
        classic.send(fd_message(1))


def test_bit_timing_of_python_can_sets_rates_and_sample_points(bus):  # noqa: F811
    timing = can.BitTimingFd.from_sample_point(
        f_clock=80_000_000,
        nom_bitrate=500_000,
        nom_sample_point=87.5,
        data_bitrate=4_000_000,
        data_sample_point=70.0,
    )
    a = bus(timing=timing, speed="max")
    used = a._link.bus.paced.bus.timing
    assert (a.bitrate, used.rate // used.data) == (500_000, 4_000_000)
    assert used.sample / used.nominal == pytest.approx(0.875) and used.data_sample / used.data == pytest.approx(0.7)


def test_the_default_data_rate_is_not_below_the_nominal_one(bus):  # noqa: F811
    a = bus(fd=True, speed="max", bitrate=5_000_000)
    assert a._link.data_bitrate == 5_000_000


def test_a_client_cannot_change_what_the_first_one_has_opened(bus):  # noqa: F811
    bus(**FD)
    with pytest.raises(can.CanInitializationError, match="open with data_bitrate 2000000, not 4000000"):
        bus(**FD | {"data_bitrate": 4_000_000})
    with pytest.raises(can.CanInitializationError, match="open with fd_non_iso False"):
        bus(**FD, fd_non_iso=True)


def test_a_bus_that_is_open_as_classic_can_takes_no_fd_client(bus):  # noqa: F811
    bus(speed="max")
    with pytest.raises(can.CanInitializationError, match="open as classic CAN"):
        bus(speed="max", fd=True)


def test_non_iso_frames_are_five_bits_shorter(bus):  # noqa: F811
    a, b = bus(**FD, fd_non_iso=True), bus(**FD, fd_non_iso=True)
    assert a.protocol == can.CanProtocol.CAN_FD_NON_ISO
    for _ in range(2):
        a.send(fd_message(0x555, b"\x55" * 64, bitrate_switch=True))
    first, second = b.recv(10), b.recv(10)
    assert second.timestamp - first.timestamp == pytest.approx((26 + 3) * 2e-6 + 545 * 0.5e-6, abs=1e-6)


@pytest.mark.parametrize(
    ("broken", "words"),
    [
        ({"is_remote_frame": True}, "CAN FD has no remote frames"),
        ({"arbitration_id": 0x800, "is_extended_id": False}, "0x800 is above 0x7ff"),
        ({"data": bytearray(65)}, "65 data bytes are outside 0 ... 64"),
    ],
)
def test_misuse_is_refused(bus, broken, words):  # noqa: F811
    a = bus(**FD)
    sent = fd_message(1)
    for name, value in broken.items():
        setattr(sent, name, value)
    with pytest.raises(can.CanOperationError, match=words):
        a.send(sent)


def test_messages_and_frames_are_converted_both_ways():
    flags = FLAG_FD | FLAG_BRS | FLAG_ESI | FLAG_EXTENDED | 15
    data = bytes(range(64))
    lo, hi = int.from_bytes(data[:4], "little"), int.from_bytes(data[4:], "little")
    made = message_of_frame(1_500_000_000, 0x1ABCDEF, flags, lo, hi)
    assert (made.timestamp, made.dlc, bytes(made.data), made.error_state_indicator) == (1.5, 64, data, True)
    assert frame_of_message(made, fd=True) == (0x1ABCDEF, flags, lo, hi)
