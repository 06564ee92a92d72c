"""Waiting for descriptors, with any number of them open."""

import math
import select
from collections.abc import Sequence


def wait(readable: Sequence[int], writable: Sequence[int], seconds: float) -> tuple[list[int], list[int]]:
    """The descriptors that can be read, and those that can be written, as soon as there is one or `seconds` are over.

    `select.select` waits to the microsecond but knows no descriptor from 1024 on (FD_SETSIZE); `poll` knows all of
    them and waits in whole milliseconds, here rounded up. So the one where it can, else the other.
    """
    try:
        can_read, can_write, _ = select.select(readable, writable, (), max(0.0, seconds))
    except ValueError:
        wanted = dict.fromkeys(readable, select.POLLIN)
        for number in writable:
            wanted[number] = wanted.get(number, 0) | select.POLLOUT
        poll = select.poll()
        for number, events in wanted.items():
            poll.register(number, events)
        ready = dict(poll.poll(max(0, math.ceil(1000.0 * seconds))))
        # an end that has gone away is ready for both, as with select
        gone = select.POLLHUP | select.POLLERR | select.POLLNVAL
        can_read = [number for number in readable if ready.get(number, 0) & (select.POLLIN | gone)]
        can_write = [number for number in writable if ready.get(number, 0) & (select.POLLOUT | gone)]
    return can_read, can_write
