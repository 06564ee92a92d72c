"""Processes that do parts of a command's work."""

import concurrent.futures
import contextlib
import multiprocessing
from collections.abc import Callable, Iterator

from ranger_sim.tools.command_line import interrupts


@contextlib.contextmanager
def workers(jobs: int) -> Iterator[Callable]:
    """A `map` that runs in so many processes; 1: here. They end when this is left, in the middle of their work as well.

    Ctrl-C is for the process that waits for them.
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
