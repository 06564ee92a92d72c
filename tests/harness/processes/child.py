"""A process that a test forks, and a second one that watches it: no process waits for ever for one that is gone."""

import os
import signal

from ranger_sim.foundation import descriptors
from ranger_sim.harness.processes import kernel, places

PATIENCE_S = 60.0  # a guard against waiting for ever; nothing asserts on it


def fork(body):
    """A process that runs `body`, leaves with what that returns, and does not outlive the test's; its number."""
    parent = os.getpid()
    process = os.fork()
    if process == 0:
        code = 9
        try:
            kernel.die_with_parent(parent)
            code = body()
        finally:
            os._exit(code)
    return process


class Child:
    """Runs `body` on the board's side of `block`.

    As the supervisor does with a board's process, the one that watches marks the block and rings the answer's bell
    when the child has ended. It does so as well when the child hangs: after PATIENCE_S.
    """

    def __init__(self, block, body):
        self.block = block
        self.process = fork(body)
        self.watch = os.pidfd_open(self.process)
        self.watcher = fork(self._look_after)

    def _look_after(self):
        descriptors.wait([self.watch], [], PATIENCE_S)
        self.block.private[places.FATE] = places.GONE
        os.eventfd_write(self.block.answer_descriptor, 1)
        return 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for process in (self.process, self.watcher):
            os.kill(process, signal.SIGKILL)
            os.waitpid(process, 0)
        os.close(self.watch)

    def answered(self, bell, turn):
        """Wait until it has rung `turn` times; fails when it has ended instead or hangs."""
        while not bell.wait(turn):
            assert self.block.private[places.FATE] == places.ALIVE, f"no answer in turn {turn}: {self._fate()}"

    def ended(self):
        """Wait for its end; how it ended, as os.waitid has it. Fails when it hangs."""
        assert descriptors.wait([self.watch], [], PATIENCE_S)[0], f"does not end: {self._fate()}"
        return os.waitid(os.P_PID, self.process, os.WEXITED | os.WNOWAIT)

    def _fate(self):
        end = os.waitid(os.P_PID, self.process, os.WEXITED | os.WNOWAIT | os.WNOHANG)
        return f"stood still for {PATIENCE_S} s" if end is None else f"ended with {end.si_status}"
