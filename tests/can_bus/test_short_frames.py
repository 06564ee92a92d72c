"""Frames of fewer than eight bytes: what a program leaves in the rest of its buffer does not go over the bus."""

import pytest

from .wiring import Wired

LOW, HIGH = 0xDDCCBBAA, 0x44332211


@pytest.mark.parametrize("length", range(9))
def test_only_the_bytes_of_a_frame_arrive_and_zeros_behind_them(length):
    wired = Wired(2)
    wired.send(0, 0x123, flags=length, lo=LOW, hi=HIGH)
    wired.bus.advance(1_000_000)
    (received,) = wired.of(1, "rx")
    sent = (LOW.to_bytes(4, "little") + HIGH.to_bytes(4, "little"))[:length].ljust(8, b"\0")
    assert tuple(received[-2:]) == (int.from_bytes(sent[:4], "little"), int.from_bytes(sent[4:], "little"))
