"""The mode of the backend `processes`: every board has its own process, the test's has body and buses.

A board that is lost ends the test (harness/processes/forked_boards.py).
"""

from __future__ import annotations

import sys
from typing import Any

from ranger_sim.harness.processes.modes import OwnProcesses
from ranger_sim.harness.testing.backends import PROCESSES, MissingError


class BoardLostError(AssertionError):
    """The process of a board has ended during a test."""


class ProcessPerBoard(OwnProcesses):
    """Every board in its own process. MissingError where this machine does not support that."""

    backend = PROCESSES

    def __init__(self) -> None:
        if not sys.platform.startswith("linux"):
            raise MissingError("backend processes needs Linux (eventfd, pidfd)")
        OwnProcesses.__init__(self)

    def after_run(self, machine: Any) -> None:
        """BoardLostError when a board's process has ended meanwhile."""
        __tracebackhide__ = True
        if machine.deaths and not machine.lost:
            machine.lost = True
            machine.close()
            death = machine.deaths[0]
            why = f": {death['why']}" if death["why"] else ""
            raise BoardLostError(f"{death['board']}: its process {death['how']} before {machine.time_s:.6f} s{why}")

    def check_reach(self, name: str) -> None:
        if self.forked is not None:
            raise MissingError(
                f"backend processes has no board memory: {name} runs in a separate process; "
                "variable(), counters(), wire() and until() see it"
            )
