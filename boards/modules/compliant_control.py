"""The outer loop: a motor current that makes the joint behave like a spring and a damper
(appendix eq. 3; robot.md P1.11, N4.2)."""

import cython

from ranger_sim.boards.modules.receiver import Receiver
from ranger_sim.foundation.numbers import fixed_multiply, fixed_of_float, float_of_word

COMMAND = 0
STIFFNESS = 1
DAMPNESS = 2
TARGET = 3


# A gain or a command takes 28 instructions more than the time, for float to fixed: on MCH the time and three of them
# take 716 (robot.md T2), of which 15 and 115 for each frame, and 12 for each place in the list.
GAIN_CYCLES = 2 * 28


@cython.final
@cython.cclass
class CompliantControl:
    """command + sign (K position + D velocity), K the stiffness, D the dampness; all 16.16: A, A/rad, A s/rad.

    `sign` is -1 on the robot. `latch_with_current`: the two gains come into force only when the next command
    current arrives (firmware of 2016), otherwise at once.
    """

    sign: cython.longlong
    latch_with_current: cython.bint
    command: cython.longlong
    stiffness: cython.longlong
    dampness: cython.longlong
    received_stiffness: cython.longlong
    received_dampness: cython.longlong
    target: cython.longlong

    def __init__(self, sign=-1, latch_with_current=False) -> None:
        self.sign = sign
        self.latch_with_current = latch_with_current
        self.command = 0
        self.stiffness = 0
        self.dampness = 0
        self.received_stiffness = 0
        self.received_dampness = 0
        self.target = 0

    @cython.ccall
    def set_command(self, current: cython.longlong) -> cython.void:
        """Constant term, A x 65536; the gains received so far come into force."""
        self.command = current
        self.stiffness = self.received_stiffness
        self.dampness = self.received_dampness

    @cython.ccall
    def set_stiffness(self, gain: cython.longlong) -> cython.void:
        """Position gain, A/rad x 65536."""
        self.received_stiffness = gain
        if not self.latch_with_current:
            self.stiffness = gain

    @cython.ccall
    def set_dampness(self, gain: cython.longlong) -> cython.void:
        """Velocity gain, A s/rad x 65536."""
        self.received_dampness = gain
        if not self.latch_with_current:
            self.dampness = gain

    @cython.ccall
    @cython.exceptval(check=False)
    def update(self, position: cython.longlong, velocity: cython.longlong) -> cython.longlong:
        """The current wanted now (A x 65536) at `position` (rad x 65536) and `velocity` (rad/s x 65536)."""
        return self.command + self.sign * (
            fixed_multiply(self.stiffness, position) + fixed_multiply(self.dampness, velocity)
        )


@cython.final
@cython.cclass
class GainReceiver(Receiver):
    """Delivers a received float to one setter of a CompliantControl: `what` is one of the four above.

    TARGET writes the target itself, which the law overwrites in the same slot, as on the robot.
    """

    control: CompliantControl
    what: cython.longlong

    def __init__(self, control: CompliantControl, what) -> None:
        Receiver.__init__(self, GAIN_CYCLES)
        self.control = control
        self.what = what

    def deliver(self, value_word: cython.longlong, time_word: cython.longlong) -> None:
        value: cython.longlong = fixed_of_float(float_of_word(value_word))
        self.frames += 1
        if self.what == 0:
            self.control.set_command(value)
        elif self.what == 1:
            self.control.set_stiffness(value)
        elif self.what == 2:
            self.control.set_dampness(value)
        else:
            self.control.target = value
