"""Waiting for descriptors, with any number of them open."""

import math
import select
from collections.abc import Sequence


def wait(readable: Sequence[int], writable: Sequence[int], seconds: float) -> tuple[list[int], list[int]]:
    """Wait until a descriptor is ready or `seconds` are over; return the readable and the writable ones.

    `select.select` waits to the microsecond but takes no descriptor from 1024 on (FD_SETSIZE); `poll` takes all of them
    and waits in whole milliseconds, here rounded up. So `select` is used where it can be, else `poll`.
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
        # a closed peer is ready for both, as with select
        gone = select.POLLHUP | select.POLLERR | select.POLLNVAL
        can_read = [number for number in readable if ready.get(number, 0) & (select.POLLIN | gone)]
        can_write = [number for number in writable if ready.get(number, 0) & (select.POLLOUT | gone)]
    return can_read, can_write
