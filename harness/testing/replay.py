"""Replays a recorded log into one board: the others' frames come at their pace, and the board answers anew.

board = BoardAlone("MCH")
board.replay(read_log("runs/walk"))       # the folder of a walk; a candump file; .mf4, .asc, .blf, .trc ...
board.run_for("2 s")
"""

from __future__ import annotations

import pathlib

from ranger_sim.can_bus.edge.logs import read_log as read_frames
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.ranger_names import RANGER
from ranger_sim.harness.testing.frames import Frame, frame_type

LOST = 0.01  # of a recording's frames: with more lost the traffic is different


def read_log(path: str | pathlib.Path, bus: str | None = None) -> list[Frame]:
    """Frames of a recording in order of time. `bus`: that of a file with one channel, e.g. "can1" for vcan0.

    A folder is that of a walk (`ranger-sim walk --out`): can1.log ... can4.log. UserError for what cannot be read.
    """
    source = pathlib.Path(path)
    files = [(source, bus)]
    if source.is_dir():
        files = [(each, each.stem) for each in sorted(source.glob("can[1-4].log"))]
        if not files:
            raise UserError(f"{source}: a folder without can1.log ... can4.log, so not that of a walk")
    found = []
    for file, name in files:
        log = read_frames(file)
        for channel, time_ns, identifier, flags, lo, hi in log:
            found.append(frame_type(RANGER)(time_ns, name or channel, identifier, flags, lo, hi))
        lost = sum(count for _, count, _ in log.losses)
        if lost > LOST * log.read:
            reasons = "; ".join(f"{count} {reason.replace('_', ' ')}, {where}" for reason, count, where in log.losses)
            raise UserError(
                f"{file}: {lost} of {log.read} frames are lost ({reasons}): such a recording is not replayed"
            )
    if not found:
        raise UserError(f"{source}: there is no frame in this recording")
    return sorted(found)
