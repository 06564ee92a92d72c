"""What all peripherals of a chip share, and where messages end that none of them has claimed."""

from typing import TYPE_CHECKING

import cython

from ranger_sim.firmware_sim.vic import InterruptSource
from ranger_sim.foundation.events import PIN_EDGE, EventQueue

if TYPE_CHECKING:
    from ranger_sim.firmware_sim.chip import Chip


@cython.cclass
class Peripheral:
    """What all peripherals share: the chip, and the ways in which the outside reaches them."""

    chip: "Chip"

    def __init__(self, chip) -> None:
        self.chip = chip
        chip.peripherals.append(self)

    def retune(self, now, before) -> None:
        """The chip's crystal runs at another rate from `now` (ns) on than `before` (a Crystal)."""

    @cython.ccall
    def on_message(self, queue: EventQueue) -> InterruptSource | None:
        """A message of a kind claimed by this peripheral; it is in the fields of `queue`.

        Returns the interrupt source that shall be served because of it, if any.
        """
        return None

    @cython.ccall
    def on_pin(self, channel: cython.longlong, level: cython.longlong, time: cython.longlong) -> cython.longlong:
        """The pin of `channel` changed to `level` at `time`; returns 1 to ask for the pin's interrupt, else 0."""
        return 0

    @cython.ccall
    def on_level(self, pin: cython.longlong, level: cython.longlong) -> cython.int:
        """The level of a pin that this follows (`Chip.followers`) is `level` from now on, driven by whomever."""
        return 0

    @cython.ccall
    def on_pwm(self, pwm: object) -> cython.int:
        """What the PWM unit drives is what `pwm` has latched from now on (`Chip.pwm_follower`)."""
        return 0

    @cython.ccall
    def on_alarm(self, alarm: cython.longlong, time: cython.longlong) -> InterruptSource | None:
        """The alarm that this peripheral numbered `alarm` is due; returns what `on_message` does."""
        return None

    @cython.ccall
    def transmit_ends(self) -> object:
        """Where a bus writes the ends of a CAN controller's transmissions; None: they come as messages."""
        return None


@cython.final
@cython.cclass
class Unclaimed(Peripheral):
    """Where messages end that no peripheral has claimed."""

    def on_message(self, queue: EventQueue) -> InterruptSource | None:
        """Keep it in the interrupt source of its kind and index, if a handler is attached there."""
        source: InterruptSource = self.chip.vic.sources.get((queue.kind, queue.a))
        if source is not None and source.bit != 0:
            source.keep_message(queue)
            return source
        if queue.kind != PIN_EDGE:
            self.chip.unclaimed += 1
        return None
