"""What a board process tells about its board at the end (or when asked): a dictionary of public fields.

One list for all boards: a path that a board does not have is left out. `take` reads them in the board's process,
`put` writes them into the board object that the plant's process built and never ran, so that summary, report and
files read the same objects as after a lockstep run.
"""

from typing import Any

NUMBERS = (
    "next_time",
    "unclaimed",
    "scheduler.slot_count",
    "scheduler.slot_time",
    "scheduler.overruns",
    "scheduler.dropped_tasks",
    "scheduler.max_slot_cycles",
    "scheduler.total_slot_cycles",
    "scheduler.near_limits",
    "time.ms",
    "can.controller.data_overruns",
    "can.controller.received",
    "can.controller.sent",
    "can.received",
    "can.queued",
    "can.receive_lost",
    "can.send_lost",
    "router.routed",
    "router.receive_lost",
    "router.own_lost",
    "router.unroutable",
    "can1.data_overruns",
    "can2.data_overruns",
    "can3.data_overruns",
    "can4.data_overruns",
    "link.segments_sent",
    "link.segments_received",
    "link.frames_sent",
    "link.frames_received",
    "link.checksum_errors",
    "estimator.swing_leg",
)
ARRAYS = (
    "scheduler.histogram",
    "errors.totals",
    "router.receive_lost_from",
    "router.transmit_lost",
    "clock.skipped",
)


def _holder(board: Any, path: str) -> tuple[Any, str]:
    """The object that has the last name of `path`, and that name; (None, name) when the board has no such part."""
    *parts, name = path.split(".")
    holder = board
    for part in parts:
        holder = getattr(holder, part, None)
    return (holder if hasattr(holder, name) else None), name


def take(board: Any) -> dict:
    """The fields of a board, as JSON can carry them."""
    found: dict = {}
    for path in NUMBERS:
        holder, name = _holder(board, path)
        if holder is not None:
            found[path] = getattr(holder, name)
    for path in ARRAYS:
        holder, name = _holder(board, path)
        if holder is not None:
            found[path] = list(getattr(holder, name))
    return found


def put(board: Any, found: dict) -> None:
    """Write what `take` found into a board object of the same class."""
    for path in NUMBERS:
        if path in found:
            holder, name = _holder(board, path)
            setattr(holder, name, found[path])
    for path in ARRAYS:
        if path in found:
            holder, name = _holder(board, path)
            target = getattr(holder, name)
            for place, value in enumerate(found[path]):
                target[place] = value
