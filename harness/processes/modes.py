"""Where the boards of a machine run, as the machine sees it: in its process, or some of them each in its own.

A mode belongs to one machine. A board that is outside altogether is not a mode but a substitute on the wires
(harness/outside/machine.py).
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes.settings import DEADLINE_S
from ranger_sim.harness.waiting import ErrorNoted

if TYPE_CHECKING:
    from ranger_sim.harness.processes.forked_boards import ForkedBoards
    from ranger_sim.harness.waiting import Condition


class InProcess:
    """All boards run in the machine's process."""

    backend = "sim"  # harness/testing/backends.py
    forked: ForkedBoards | None = None  # the boards in other processes, once these run

    def start(self, machine: Any) -> None:
        """Start the processes, if that has not been done: before time first passes, and before a fault is armed."""

    def passing_time(self, machine: Any) -> contextlib.AbstractContextManager[None]:
        """Within it, time passes."""
        return contextlib.nullcontext()

    def after_run(self, machine: Any) -> None:
        """Check what has happened to the boards, after time has passed."""

    def waiting_for(self, machine: Any, wanted: Condition) -> contextlib.AbstractContextManager[None]:
        """Within it, time passes until `wanted` holds."""
        return contextlib.nullcontext()

    def check_reach(self, name: str) -> None:
        """UserError where the memory of board `name` is in another process."""

    def check_replace(self, name: str, task: str) -> None:
        """UserError where a task of board `name` can no longer be replaced."""

    def fetch_counters(self, names: Sequence[str] | None = None) -> None:
        """Bring the counters of boards in other processes up to the present time; None: of all."""

    def close(self) -> None:
        """End the processes."""


class OwnProcesses(InProcess):
    """The boards `names`, or all, each in a process that starts when time first passes; they may be changed before.

    deadline_s: how long a board may leave a request unanswered before its process is ended; 0: for ever.
    """

    def __init__(self, names: Sequence[str] = (), deadline_s: float = DEADLINE_S) -> None:
        self.names = tuple(names)
        self.deadline_s = deadline_s

    def start(self, machine: Any) -> None:
        if self.forked is None:
            from ranger_sim.harness.processes.forked_boards import ForkedBoards  # Linux only

            self.names = self.names or tuple(machine.boards)
            self.forked = ForkedBoards(machine, self.names, self.deadline_s)

    def passing_time(self, machine: Any) -> contextlib.AbstractContextManager[None]:
        return self.forked.processor() if self.forked is not None else contextlib.nullcontext()

    def waiting_for(self, machine: Any, wanted: Condition) -> contextlib.AbstractContextManager[None]:
        """Boards are asked for their errors at each step meanwhile, where it waits for one; that takes time."""
        self.start(machine)
        if not isinstance(wanted, ErrorNoted) or self.forked is None:
            return contextlib.nullcontext()
        return self.forked.asking(wanted.boards)

    def check_reach(self, name: str) -> None:
        if self.forked is not None and name in self.names:
            raise UserError(
                f"{name} runs in a separate process, its memory is out of reach: variable(), counters(), wire() and "
                "until() see it; or Ranger(in_process=True)"
            )

    def check_replace(self, name: str, task: str) -> None:
        if self.forked is not None and name in self.names:
            raise UserError(f"replace {task} of {name}: its process runs already; replace before time passes")

    def fetch_counters(self, names: Sequence[str] | None = None) -> None:
        if self.forked is not None:
            self.forked.fetch_counters(names)

    def close(self) -> None:
        if self.forked is not None:
            self.forked.close()
