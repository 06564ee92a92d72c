"""The robot of the backend `processes`: every board has its own process, this one has body, buses and the test.

A board that is lost ends the test (harness/processes/remote_boards.py).
"""

from __future__ import annotations

import sys
from typing import Any

from ranger_sim.boards.quirks import Quirks
from ranger_sim.harness.outside.profile import Profile
from ranger_sim.harness.testing.backends import PROCESSES, MissingError
from ranger_sim.ranger import wiring
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario, StopRule


class BoardLostError(AssertionError):
    """The process of a board has ended during a test."""


class ProcessRobot(Ranger):
    """Like Ranger; a board's memory is not accessible, except for the main brain's data table."""

    backend = PROCESSES

    def __init__(
        self, scenario: Scenario, log: str, quirks: Quirks | None, profile: Profile | None, firmware: Any = None
    ) -> None:
        if not sys.platform.startswith("linux"):
            raise MissingError("backend processes needs Linux (eventfd, pidfd)")
        Ranger.__init__(self, scenario, log, quirks, profile, firmware)
        self.in_own_process = wiring.BOARDS

    def run(self, stop: StopRule, slice_s: float = 1.0) -> bool:
        """Pass time; BoardLostError when a board's process has ended meanwhile."""
        __tracebackhide__ = True
        done = Ranger.run(self, stop, slice_s)
        if self.deaths and not self.lost:
            self.lost = True
            self.close()
            death = self.deaths[0]
            why = f": {death['why']}" if death["why"] else ""
            raise BoardLostError(f"{death['board']}: its process {death['how']} before {self.time_s:.6f} s{why}")
        return done

    def board(self, name: str) -> Any:
        """The built board, before time passes; MissingError afterwards, because it is in another process."""
        if self.processes is not None:
            raise MissingError(
                f"backend processes has no board memory: {name} runs in a separate process; "
                "variable(), counters(), wire() and until() see it"
            )
        return Ranger.board(self, name)  # type: ignore[call-overload]
