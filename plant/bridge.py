"""Interface of the device that a board's PWM unit and three of its pins drive, in any machine."""

import cython


@cython.cclass
class Bridge:
    """Takes a board's writes, with their times. Ranger's H-bridge is `plant.electrics.drive.Drive`."""

    @cython.ccall
    def write_pwm(
        self, time: cython.longlong, mr2: cython.longlong, mr6: cython.longlong, mr0: cython.longlong
    ) -> object:
        """Match values of both leads and of the period, in counts, from `time` (ns) on."""
        return

    @cython.ccall
    def watchdog_edge(self, time: cython.longlong) -> object:
        """The watchdog line changed its level at `time` (ns)."""
        return

    @cython.ccall
    def low_side(self, time: cython.longlong, enable2: cython.bint, enable6: cython.bint) -> object:
        """The low-side enables of both leads from `time` (ns) on."""
        return
