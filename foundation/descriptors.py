"""Waiting for descriptors, with any number of them open."""

import math
import select
from collections.abc import Sequence

from ranger_sim.foundation import wallclock


def wait(readable: Sequence[int], writable: Sequence[int], seconds: float) -> tuple[list[int], list[int]]:
    """Wait until a descriptor is ready or `seconds` are over; return the readable and the writable ones.

    `select.select` waits to the microsecond but takes no descriptor from 1024 on (FD_SETSIZE); `poll` takes all of them
    and waits in whole milliseconds, here rounded up. So `select` is used where it can be, else `poll`. Windows has only
    `select`, for sockets alone, and an error for a wait for nothing.
    """
    if not (readable or writable):
        wallclock.sleep_s(max(0.0, seconds))
        return [], []
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


class Readers:
    """Descriptors that are watched for data to read, also for an end that is gone."""

    def __init__(self) -> None:
        self.numbers: set[int] = set()
        self.poller = select.poll() if hasattr(select, "poll") else None

    def add(self, number: int) -> None:
        """Watch this descriptor from now on."""
        self.numbers.add(number)
        if self.poller is not None:
            self.poller.register(number, select.POLLIN)

    def remove(self, number: int) -> None:
        """Watch it no longer. KeyError: it was not watched."""
        self.numbers.remove(number)
        if self.poller is not None:
            self.poller.unregister(number)

    def ready(self, seconds: float = 0.0) -> set[int]:
        """Wait up to `seconds` until one of them is ready; return all that are."""
        if self.poller is not None:
            return {number for number, _ in self.poller.poll(1000.0 * seconds)}
        return set(wait(list(self.numbers), [], seconds)[0])
