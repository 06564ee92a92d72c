"""The kinds of message in the channel between the processes, with the range of each field.

Extend only this table for a new kind; `PAYLOADS` lists the kinds that carry an object (`ref`),
whose codec is in `Mailbox` (channel.py). Meanings of the fields: foundation/events.py.
"""

from typing import NamedTuple

from ranger_sim.can_bus.fd_frame import FD_SENDABLE
from ranger_sim.foundation import events
from ranger_sim.harness.processes.places import FRAME_WORDS, LIMIT_SIZE, NOTE_WORDS, SSP_WORDS

TO_BOARD, FROM_BOARD = 0, 1
WORD = (0, 0xFFFFFFFF)
NONE = (0, 0)
CONTROLLER, BUFFER, PIN, LEVEL, PORT, BYTE = (1, 4), (1, 3), (0, 63), (0, 1), (0, 15), (0, 255)
IDENTIFIER = (0, 0x1FFFFFFF)
FLAGS = (0, 0x7FF)  # of a frame
REQUESTED = (0, FD_SENDABLE)  # those of a frame to send; those of CAN FD only with its data

# Kinds between the processes only: no chip sees them.
NOTE = 64  # a NOTE_*, b part, c parts, ref bytes (UTF-8 of JSON, or of activity.py here, cut into parts)
SET_WORD = 65  # a number of the variable, b its word: written into the board's data table
NOTE_COUNTERS = 1  # the board's counters, for summary and report
NOTE_FAULT = 2  # why a board process ends
NOTE_ACTIVITY = 3  # rows of its activity log


class Kind(NamedTuple):
    """A kind of message: name, direction, and the least and largest value of the fields a ... f."""

    name: str
    direction: int
    ranges: tuple


KINDS = {
    events.PIN_EDGE: Kind("PIN_EDGE", TO_BOARD, (PIN, LEVEL, (-1, 63), LEVEL, NONE, NONE)),
    events.CAN_RX: Kind("CAN_RX", TO_BOARD, (CONTROLLER, IDENTIFIER, FLAGS, WORD, WORD, NONE)),
    events.CAN_TX_DONE: Kind("CAN_TX_DONE", TO_BOARD, (CONTROLLER, BUFFER, (0, 2), NONE, NONE, NONE)),
    events.CAN_STATUS: Kind("CAN_STATUS", TO_BOARD, (CONTROLLER, WORD, WORD, WORD, LEVEL, NONE)),
    events.UART_BYTE: Kind("UART_BYTE", TO_BOARD, (PORT, BYTE, (0, 8), WORD, WORD, NONE)),
    events.SSP_SEGMENT: Kind("SSP_SEGMENT", TO_BOARD, (PORT, NONE, NONE, NONE, NONE, NONE)),
    events.CAN_REQUEST: Kind("CAN_REQUEST", FROM_BOARD, (CONTROLLER, BUFFER, IDENTIFIER, REQUESTED, WORD, WORD)),
    events.CAN_ABORT: Kind("CAN_ABORT", FROM_BOARD, (CONTROLLER, BUFFER, NONE, NONE, NONE, NONE)),
    events.CAN_MODE: Kind("CAN_MODE", FROM_BOARD, (CONTROLLER, LEVEL, NONE, NONE, NONE, NONE)),
    events.CAN_FILTER: Kind("CAN_FILTER", FROM_BOARD, (CONTROLLER, LEVEL, NONE, NONE, NONE, NONE)),
    events.PWM_UPDATE: Kind("PWM_UPDATE", FROM_BOARD, (WORD, WORD, (1, 0xFFFFFFFF), NONE, NONE, NONE)),
    events.PIN_OUTPUT: Kind("PIN_OUTPUT", FROM_BOARD, (PIN, LEVEL, NONE, NONE, NONE, NONE)),
    events.SSP_START: Kind("SSP_START", FROM_BOARD, (PORT, NONE, NONE, NONE, NONE, NONE)),
    events.SSP_LOAD: Kind("SSP_LOAD", FROM_BOARD, (PORT, NONE, NONE, NONE, NONE, NONE)),
    events.UART_OUTPUT: Kind("UART_OUTPUT", FROM_BOARD, (PORT, BYTE, (0, 2040), NONE, NONE, NONE)),
    NOTE: Kind("NOTE", FROM_BOARD, ((1, 3), (0, 10_000), (1, 10_001), NONE, NONE, NONE)),
    SET_WORD: Kind("SET_WORD", TO_BOARD, ((0, 65535), WORD, NONE, NONE, NONE, NONE)),
}
# kind -> most words of its payload; the others carry none
PAYLOADS = {
    events.SSP_SEGMENT: SSP_WORDS,
    events.SSP_START: SSP_WORDS,
    events.SSP_LOAD: SSP_WORDS,
    events.CAN_RX: FRAME_WORDS,  # the data of a CAN FD frame; a classic one carries none
    events.CAN_REQUEST: FRAME_WORDS,
    events.CAN_FILTER: NOTE_WORDS,
    events.UART_OUTPUT: NOTE_WORDS,  # bytes of a whole transfer; a single byte carries none
    NOTE: NOTE_WORDS,
}
OPTIONAL = (
    events.CAN_RX,
    events.CAN_REQUEST,
    events.CAN_FILTER,
    events.UART_OUTPUT,
)  # kinds that may come without their payload
FIELDS = ("a", "b", "c", "d", "e", "f")


def limits() -> list:
    """Per kind 0 ... 127: direction (-1 unknown), least and most payload words, least and largest of a ... f."""
    table = []
    for number in range(128):
        kind = KINDS.get(number)
        if kind is None:
            table += [-1] + [0] * (LIMIT_SIZE - 1)
            continue
        most = PAYLOADS.get(number, 0)
        table += [kind.direction, 1 if most and number not in OPTIONAL else 0, most]
        for least, largest in kind.ranges:
            table += [least, largest]
    return table
