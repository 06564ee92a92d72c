"""The wires of a machine, as tables: which sensor is on which pin of which board, which board on which bus.

Read a line from left to right in the direction of the signal. Ranger's tables are ranger/wiring.py.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from ranger_sim.foundation.user_error import UserError


class CanWire(NamedTuple):
    """Controller `controller` of `board` is on bus `bus`, counted from 1 in the order of the machine's buses."""

    board: str
    controller: int
    bus: int


class EncoderWire(NamedTuple):
    """Channels A and B of an incremental encoder (place in the plant's list) on two pins of a board."""

    encoder: int
    board: str
    pin_a: str
    pin_b: str


class AnalogInput(NamedTuple):
    """A voltage of the plant on an analog input of a board."""

    voltage: int
    board: str
    input: str


class EncoderWord(NamedTuple):
    """The serial word of an absolute encoder, read by a board's SPI."""

    word: int
    board: str
    register: str


class BridgeWire(NamedTuple):
    """A board's PWM unit and three of its pins drive a bridge (place in the plant's list); "": without such a pin."""

    board: str
    bridge: int
    watchdog: str = ""
    low_side_2: str = ""
    low_side_6: str = ""


class LinkWire(NamedTuple):
    """A synchronous serial link; every `exchange_ns` both boards exchange a segment. idle(): a segment without data."""

    master: str
    slave: str
    exchange_ns: int
    idle: Callable[[], Any]


class ImuUart(NamedTuple):
    """The plant's inertial unit on a UART of a board."""

    board: str
    uart: int


@dataclasses.dataclass(frozen=True)
class Wiring:
    """All wires of a machine. names: {board: {pin, input or register: its number}}; P0.n is pin n, P1.n pin 32 + n.

    receive_in_slots: boards on which frames, edges and bytes wait for a task: none of their handlers or main loops
    answers them at once; they are then left alone until they have something to send.
    """

    can: Sequence[CanWire] = ()
    encoders: Sequence[EncoderWire] = ()
    analog: Sequence[AnalogInput] = ()
    words: Sequence[EncoderWord] = ()
    bridges: Sequence[BridgeWire] = ()
    link: LinkWire | None = None
    imu: ImuUart | None = None
    receive_in_slots: Sequence[str] = ()
    names: Mapping[str, Mapping[str, int]] = dataclasses.field(default_factory=dict)

    def number(self, board: str, name: str) -> int:
        """The number of a pin, an input or a register of a board. UserError for a name that the board does not have."""
        if name == "":
            return -1
        known = self.names.get(board, {})
        if name not in known:
            raise UserError(f"wiring: {board} has no {name!r}, but {', '.join(known) or 'no names at all'}")
        return known[name]
