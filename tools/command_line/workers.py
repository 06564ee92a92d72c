"""Processes that do parts of a command's work."""

import concurrent.futures
import contextlib
import multiprocessing
from collections.abc import Callable, Iterator

from ranger_sim.tools.command_line import interrupts


@contextlib.contextmanager
def workers(jobs: int) -> Iterator[Callable]:
    """A `map` that runs in `jobs` processes; 1: in this one. They end with the context, even in the middle of work.

    Ctrl-C is handled by the process that waits for them.
    """
    if jobs == 1:
        yield map
        return
    with concurrent.futures.ProcessPoolExecutor(jobs, initializer=interrupts.leave_to_parent) as pool:
        try:
            yield pool.map
        except BaseException:
            for each in multiprocessing.active_children():
                each.kill()
            raise
