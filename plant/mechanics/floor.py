"""The floor: slope, a height per foothold, and one step up or down."""

import math

from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import ModelError


class Floor:
    """Heights of the footholds, m above the mean floor; each foothold is flat and as sloped as the floor.

    slope_rad: positive downhill (the body turns gravity by it, the heights are relative to the sloped plane).
    roughness_m: standard deviation of the height per foothold, normal, from the stream ``floor`` of the seed.
    step_at, step_m: from foothold number `step_at` on, everything lies `step_m` higher (negative: a step down).
    The first foothold (number 0) is where the robot is put down: it defines height 0 and is never rough.
    """

    def __init__(
        self,
        slope_rad: float = 0.0,
        roughness_m: float = 0.0,
        seed: int = 0,
        step_at: int | None = None,
        step_m: float = 0.0,
    ) -> None:
        if not (math.isfinite(roughness_m) and 0.0 <= roughness_m <= 0.1):
            raise ModelError(f"floor: roughness is {roughness_m!r}, allowed are 0 to 0.1 m")
        if not (math.isfinite(slope_rad) and abs(slope_rad) <= 0.5):
            raise ModelError(f"floor: slope is {slope_rad!r}, allowed are -0.5 to 0.5 rad")
        if not (math.isfinite(step_m) and abs(step_m) <= 0.1):
            raise ModelError(f"floor: the step is {step_m!r} m high, allowed are -0.1 to 0.1 m")
        if step_at is not None and step_at < 1:
            raise ModelError(f"floor: the step is at foothold {step_at!r}, it must be 1 or later")
        self.slope_rad = slope_rad
        self.roughness_m = roughness_m
        self.step_at = step_at
        self.step_m = step_m
        self.stream = RandomStream(seed, "floor")
        self.foothold = 0

    def first_height(self) -> float:
        """Height of foothold 0; starts the count again, not the random stream."""
        self.foothold = 0
        return 0.0

    def next_height(self) -> float:
        """Height in m of the next foothold."""
        self.foothold += 1
        height = self.roughness_m * self.stream.normal() if self.roughness_m > 0.0 else 0.0
        if self.step_at is not None and self.foothold >= self.step_at:
            height += self.step_m
        return height
