"""The devices at the pins of a board that runs an image: given by the builder of the board, not by its program."""

import dataclasses

from ranger_sim.firmware_sim.native.hardware import DEFAULT_HZ, Hardware


@dataclasses.dataclass(frozen=True)
class BoardHardware(Hardware):
    """As for firmware in C, with the values that such a program does not supply.

    pulled_up: pins that read 1 while undriven. slot_timer: 0 or 1, the timer whose match begins a slot.
    segment_interval_ns: not 0 where the SSP is the master of a link of segments (then there is no external converter):
    the least time from one exchange to the next. `hz` is what the PLL makes of the crystal; the program sets it itself.
    """

    hz: int = DEFAULT_HZ
    pulled_up: tuple[int, ...] = ()
    segment_interval_ns: int = 0
    slot_timer: int = 1
