"""When a run is over."""

import dataclasses

from ranger_sim.foundation.user_error import ScenarioError

# Of a walk's end: 31 years of virtual time, and as many steps and metres. Time is a 64-bit number of nanoseconds, which
# ends after 292 years, and network time one of 32-bit milliseconds that wraps. Chosen by us.
MOST_TIME_S = 1e9
MOST_STEPS = 1_000_000_000
MOST_DISTANCE_M = 1e9


@dataclasses.dataclass(frozen=True)
class StopRule:
    """The end of a walk: after a number of steps, a time, or a distance; whichever comes first."""

    steps: int | None = None
    time_s: float | None = None
    distance_m: float | None = None

    def __post_init__(self) -> None:
        limits = {"steps": MOST_STEPS, "time_s": MOST_TIME_S, "distance_m": MOST_DISTANCE_M}
        for name, most in limits.items():
            value = getattr(self, name)
            if value is not None and not 0 < value <= most:
                raise ScenarioError(f"{name} is {value!r}, it must be above 0 and at most {most:g}")
        if self.steps is None and self.time_s is None and self.distance_m is None:
            raise ScenarioError("give steps, time or distance: a walk needs an end")
