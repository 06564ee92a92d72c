"""The base of all peripherals of a chip, and the receiver of messages that none of them has claimed."""

from typing import TYPE_CHECKING

import cython

from ranger_sim.firmware_sim.vic import InterruptSource
from ranger_sim.foundation.events import PIN_EDGE, EventQueue

if TYPE_CHECKING:
    from ranger_sim.firmware_sim.chip import Chip


@cython.cclass
class Peripheral:
    """The base of all peripherals: the chip, and the calls by which the outside reaches them."""

    chip: "Chip"

    def __init__(self, chip) -> None:
        self.chip = chip
        chip.peripherals.append(self)

    def retune(self, now, before) -> None:
        """Adapt to the chip's crystal, whose rate from `now` (ns) on differs from that of `before` (a Crystal)."""

    @cython.ccall
    def on_message(self, queue: EventQueue) -> InterruptSource | None:
        """Take a message of a kind claimed by this peripheral; it is in the fields of `queue`.

        Returns the interrupt source that is to be served because of it, if any.
        """
        return None

    @cython.ccall
    def on_pin(self, channel: cython.longlong, level: cython.longlong, time: cython.longlong) -> cython.longlong:
        """Take a change of the pin of `channel` to `level` at `time`; returns 1 to request its interrupt, else 0."""
        return 0

    @cython.ccall
    def on_level(self, pin: cython.longlong, level: cython.longlong) -> cython.int:
        """Take the new level of a pin that this follows (`Chip.followers`), whatever drives it."""
        return 0

    @cython.ccall
    def on_pwm(self, pwm: object) -> cython.int:
        """Take the values that `pwm` has latched and drives from now on (`Chip.pwm_follower`)."""
        return 0

    @cython.ccall
    def on_alarm(self, alarm: cython.longlong, time: cython.longlong) -> InterruptSource | None:
        """Handle the alarm that this peripheral numbered `alarm`, which is due; returns as `on_message` does."""
        return None

    @cython.ccall
    def transmit_ends(self) -> object:
        """Where a bus writes the ends of a CAN controller's transmissions; None: they come as messages."""
        return None

    def filter_bytes(self) -> bytes | None:
        """The acceptance filter of a CAN controller; None: every frame passes, or it is not a controller."""
        return None

    def can_rates(self) -> tuple[int, int] | None:
        """Both bit rates of a CAN FD controller, bit/s; None: it is another peripheral."""
        return None


@cython.final
@cython.cclass
class Unclaimed(Peripheral):
    """The receiver of messages that no peripheral has claimed."""

    def on_message(self, queue: EventQueue) -> InterruptSource | None:
        """Keep it in the interrupt source of its kind and index, if a handler is attached there."""
        source: InterruptSource = self.chip.vic.sources.get((queue.kind, queue.a))
        if source is not None and source.bit != 0:
            source.keep_message(queue)
            return source
        if queue.kind != PIN_EDGE:
            self.chip.unclaimed += 1
        return None
