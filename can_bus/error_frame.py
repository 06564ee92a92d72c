"""An error frame: who notices an error when, and how long the error flags and the error delimiter take.

Error frames are rare: this file is not compiled.
"""

from typing import NamedTuple

from ranger_sim.can_bus.frame import DOMINANT, RECESSIVE, TAIL_BITS
from ranger_sim.can_bus.node import (
    ICR_BUS_ERROR,
    ICR_FIELD_SHIFT,
    ICR_KIND_SHIFT,
    ICR_RECEIVING,
    KIND_BIT,
    KIND_FORM,
    KIND_OTHER,
    KIND_STUFF,
)

FLAG_BITS = 6  # ISO 11898-1: an error flag, dominant from an error-active node, recessive from an error-passive one
DELIMITER_BITS = 8  # ISO 11898-1: recessive, behind the last flag

Wire = tuple[list[int], list[int]]  # bits and fields, as `frame.wire` gives them


class ErrorFrame(NamedTuple):
    """Counted in bits from the start of the frame that failed.

    `position`: of the wrong bit, `field` (FIELD_*): what it belongs to. `sender_notices`, `receivers_notice`: when the
    wrong bit, or the bit by which they know, is over. `end`: when the error delimiter is over. `sender_capture`,
    `receiver_capture`: what CxICR shows of it (ICR_*).
    """

    position: int
    field: int
    sender_notices: int
    receivers_notice: int
    end: int
    sender_capture: int
    receiver_capture: int


def collision(frames: list[Wire]) -> int:
    """First bit at which frames with one arbitration field differ, or -1 when they are equal."""
    for position, levels in enumerate(zip(*(bits for bits, _ in frames), strict=False)):
        if len(set(levels)) > 1:
            return position
    return -1


def error_frame(frames: list[Wire], position: int, passive: bool, acknowledged: bool) -> ErrorFrame:
    """What follows the wrong bit at `position` of a frame. `frames`: what its senders send, mostly one.

    `passive`: all senders are error passive. `acknowledged`: there are receivers.

    The sender's error flag begins behind the wrong bit. Receivers inside the stuffed region notice only when they have
    seen six equal bits, and add a flag of their own: the flags together take 6 ... 12 bits. Behind the CRC everybody
    notices at once. An error-passive receiver is taken to need the same time (chosen by us).
    """
    bits, fields = frames[0]
    stuffed = position < len(bits) - TAIL_BITS
    delay = _bits_until_six(frames, position, RECESSIVE if passive else DOMINANT) if acknowledged and stuffed else 0
    capture = ICR_BUS_ERROR | fields[position] << ICR_FIELD_SHIFT
    sender_kind = KIND_BIT if acknowledged else KIND_OTHER
    receiver_kind = KIND_STUFF if stuffed else KIND_FORM
    return ErrorFrame(
        position=position,
        field=fields[position],
        sender_notices=position + 1,
        receivers_notice=position + 1 + delay,
        end=position + 1 + FLAG_BITS + delay + DELIMITER_BITS,
        sender_capture=capture | sender_kind << ICR_KIND_SHIFT,
        receiver_capture=capture | ICR_RECEIVING | receiver_kind << ICR_KIND_SHIFT,
    )


def _bits_until_six(frames: list[Wire], position: int, flag: int) -> int:
    """Bits of an error flag of level `flag` until receivers have seen six equal bits, 0 ... 6.

    What they have seen already counts: the wrong bit, which is inverted (of colliding frames it is dominant), and the
    bits of the same level before it.
    """
    bits = frames[0][0]
    seen = DOMINANT if len({frame[0][position] for frame in frames}) > 1 else 1 - bits[position]
    run = 0
    if seen == flag:
        run = 1
        while run <= position and run < FLAG_BITS and bits[position - run] == flag:
            run += 1
    return FLAG_BITS - run
