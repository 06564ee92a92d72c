"""Observers that run once per step of the plant, and may change the robot: conditions, faults, recorders."""

import cython


@cython.cclass
class StepWatch:
    """One entry of `Lockstep.watchers`; subclasses define the actions. It sees each step of the plant once.

    It may remove itself from the list, add others (they see the next step), and set `Lockstep.stop_wanted`.
    """

    seen_ns: cython.longlong

    def __init__(self) -> None:
        self.seen_ns = -1  # the latest step whose beginning it saw

    @cython.ccall
    def before_step(self, now_ns: cython.longlong) -> object:
        """Act at `now_ns`, before the body moves. For changes of world and actuators, and for conditions."""
        return None

    @cython.ccall
    def after_step(self, start_ns: cython.longlong, end_ns: cython.longlong) -> object:
        """Act when edges, voltages, words and bytes of this step are known and no board has read them. For sensors.

        Absolute encoders: their words in `plant.words` hold from `end_ns` to the end of the next step.
        """
        return None


@cython.cclass
class StepEnd:
    """An observer at the end of every step, when the boards have run through it (`Lockstep.strikes`)."""

    @cython.ccall
    def observe(self) -> object:
        """Observe; called once per step of the plant."""
        return None


@cython.cclass
class SerialDevice:
    """A device of the plant on a board's UART that sends by itself (`Lockstep.connect_serial_device`)."""

    @cython.ccall
    def deliver(self) -> object:
        """Forward what it sent during the step just integrated."""
        return None
