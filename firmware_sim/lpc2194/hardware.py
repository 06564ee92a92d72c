"""What hangs on the pins of a board that runs an image: given by who builds the board, not by its program."""

import dataclasses

from ranger_sim.firmware_sim.native.hardware import Hardware


@dataclasses.dataclass(frozen=True)
class BoardHardware(Hardware):
    """As for firmware in C, and what such a program is not asked about.

    pulled_up: pins that read 1 while nobody drives them. segment_link: the SSP is the master of a link of segments
    (then there is no external converter). slot_timer: 0 or 1, the timer whose match begins a slot. `hz` is what the
    PLL makes of the crystal; the program sets it itself.
    """

    pulled_up: tuple[int, ...] = ()
    segment_link: bool = False
    slot_timer: int = 1
