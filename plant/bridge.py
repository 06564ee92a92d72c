"""What a board's PWM unit and three of its pins act upon, whatever stands there in a machine."""

import cython


class Bridge:
    """Takes what a board writes, with the instant. Ranger's H-bridge is `plant.electrics.drive.Drive`."""

    def write_pwm(
        self, time: cython.longlong, mr2: cython.longlong, mr6: cython.longlong, mr0: cython.longlong
    ) -> None:
        """Match values of both leads and of the period, in counts, from `time` (ns) on."""
        return

    def watchdog_edge(self, time: cython.longlong) -> None:
        """The watchdog line changed its level at `time` (ns)."""
        return

    def low_side(self, time: cython.longlong, enable2: cython.bint, enable6: cython.bint) -> None:
        """The low-side enables of both leads from `time` (ns) on."""
        return
