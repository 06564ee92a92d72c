"""How busy the machine is, for tools whose deadlines must not depend on who else works on it."""

import pathlib

from ranger_sim.foundation import wallclock

PRESSURE = pathlib.Path("/proc/pressure/cpu")
MOST_S = 3600.0  # that others may hold a deadline up. Chosen by us


def waited_s() -> float:
    """For how long some process of this machine has waited for a processor, s; 0 where the kernel does not count it."""
    try:
        pressure = PRESSURE.read_text(encoding="ascii")
    except OSError:
        return 0.0
    return int(pressure.split("total=")[1].split()[0]) * 1e-6


class Deadline:
    """So many seconds from now, and those in which processes of this machine waited for a processor."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self.began_s, self.waited_s = wallclock.monotonic_s(), waited_s()

    def left_s(self) -> float:
        """What is left of it; not above 0 when it has passed."""
        return self.seconds + min(waited_s() - self.waited_s, MOST_S) - (wallclock.monotonic_s() - self.began_s)
