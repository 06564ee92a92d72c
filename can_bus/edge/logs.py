"""Recorded frames out of whatever file python-can reads: .mf4, .asc, .blf, .trc, .csv, .db, and candump's .log."""

import pathlib
from collections.abc import Iterator

import can

from ranger_sim.can_bus.edge.candump import read_candump
from ranger_sim.can_bus.edge.messages import frame_of_message
from ranger_sim.foundation.events import FLAG_ERROR
from ranger_sim.foundation.user_error import UserError


def read_log(path: str | pathlib.Path) -> Iterator[tuple[str, int, int, int, int, int]]:
    """(channel, time_ns, identifier, flags, lo, hi) of every frame in a recording; error frames are left out.

    Times are as in the file. UserError for what cannot be read.
    """
    source = pathlib.Path(path)
    if source.suffix == ".log":
        for frame in read_candump(source):
            if not frame[3] & FLAG_ERROR:
                yield frame
        return
    try:
        with can.LogReader(source) as reader:
            for message in reader:
                if not message.is_error_frame:
                    channel = "" if message.channel is None else str(message.channel)
                    yield channel, round(message.timestamp * 1e9), *frame_of_message(message)
    except UserError:
        raise
    except Exception as error:  # whatever a reader of some format raises
        raise UserError(f"{source}: the recording cannot be read ({error or type(error).__name__})") from None
