"""Settings of a robot of processes."""

import dataclasses
import os

from ranger_sim.foundation.user_error import UserError

DEADLINE_S = 10.0  # for an answer of a board's process: it takes some microseconds; the rest is for a busy machine
NEVER, ON_FAILURE = "never", "on-failure"
SLOWEST, FASTEST = 1e-4, 1000.0  # times real time; chosen by us


@dataclasses.dataclass(frozen=True)
class Settings:
    """speed: virtual seconds per wall-clock second, None as fast as possible. restart: what to do with dead boards.

    real_time: ask for SCHED_FIFO and locked memory. name: by which clients find the running robot.
    processor: the one that plant and boards share, None for all. They take turns, so on several they would mostly wait
    for each other too; waking a process there costs ten times as much (a turn in a virtual machine: 3 us on
    one processor, 30 to 140 us between two; benchmarks/2026-11-21-processes.json).
    boards: those that get a process; the others are outside as real hardware, or absent. Empty: all of the robot.
    """

    speed: float | None = 1.0
    restart: str = NEVER
    real_time: bool = True
    name: str = "ranger"
    processor: int | None = None
    boards: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.speed is not None and not SLOWEST <= self.speed <= FASTEST:
            raise UserError(f"speed is {self.speed!r}, allowed are {SLOWEST:g} to {FASTEST:g}, or max")
        allowed = os.sched_getaffinity(0)
        if self.processor is not None and self.processor not in allowed:
            raise UserError(
                f"processor is {self.processor}, allowed are {', '.join(map(str, sorted(allowed)))}, or all"
            )
        if self.restart not in (NEVER, ON_FAILURE):
            raise UserError(f"restart is {self.restart!r}, allowed are {NEVER}, {ON_FAILURE}")
        if not self.name or len(self.name) > 64 or not self.name.replace("-", "").replace("_", "").isalnum():
            raise UserError(f"name is {self.name!r}, allowed are up to 64 letters, digits, - and _")

    @property
    def wants_fifo(self) -> bool:
        """Whether it needs SCHED_FIFO: not without a pace, because then it has no deadline to meet."""
        return self.real_time and self.speed is not None


def one_processor() -> int:
    """The default processor of a robot: the last one this process may use."""
    return max(os.sched_getaffinity(0))
