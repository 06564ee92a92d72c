"""What looks at the robot once per step of the plant, or reaches into it: conditions, faults, recorders."""

import cython


@cython.cclass
class StepWatch:
    """One entry of `Lockstep.watchers`; subclasses say what they do. It sees each step of the plant once.

    It may take itself from the list, put others there (they see the next step), and set `Lockstep.stop_wanted`.
    """

    seen_ns: cython.longlong

    def __init__(self) -> None:
        self.seen_ns = -1  # the latest step whose beginning it saw

    @cython.ccall
    def before_step(self, now_ns: cython.longlong) -> object:
        """Everything has run to `now_ns`; the body is about to move. The place for world, actuators and conditions."""
        return None

    @cython.ccall
    def after_step(self, start_ns: cython.longlong, end_ns: cython.longlong) -> object:
        """Edges, voltages, words and bytes of this step are there, no board has seen them. The place for sensors.

        Absolute encoders: their words in `plant.words` stand from `end_ns` to the end of the next step.
        """
        return None


@cython.cclass
class StepEnd:
    """What looks at the robot at the end of every step, when the boards have run through it (`Lockstep.strikes`)."""

    @cython.ccall
    def look(self) -> object:
        """Once per step of the plant."""
        return None


@cython.cclass
class SerialDevice:
    """What of the plant hangs on a board's UART and speaks by itself (`Lockstep.connect_serial_device`)."""

    @cython.ccall
    def deliver(self) -> object:
        """Carry on what it sent during the step that was just integrated."""
        return None
