"""Replays a recorded log into one board: the others' frames come at their pace, and the board answers anew.

board = BoardAlone("MCH")
board.replay(read_log("runs/walk"))       # the folder of a walk; a candump file; .mf4, .asc, .blf, .trc ...
board.run_for("2 s")
"""

from __future__ import annotations

import pathlib
from collections.abc import Iterable, Mapping

from ranger_sim.can_bus.edge.logs import RecordedFrames
from ranger_sim.can_bus.edge.logs import read_log as read_frames
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.testing.frames import Frame, frame_type
from ranger_sim.ranger.names import RANGER

LOST = 0.01  # of a recording's frames: with more lost the traffic is different
NAMED = 3  # identifiers, of those on two buses


class Recording(list[Frame]):
    """Frames in order of time. ledger: {file: {"frames": number, "left out: reason": number}}, as `ranger-sim read`'s.

    The frames of other buses than the requested one are in it as "other buses".
    """

    def __init__(self, frames: Iterable[Frame], ledger: Mapping[str, Mapping[str, int]]) -> None:
        super().__init__(frames)
        self.ledger = {name: dict(lines) for name, lines in ledger.items()}


def read_log(
    path: str | pathlib.Path, bus: str | Mapping[str, str] | None = None, accept_loss: float = LOST
) -> Recording:
    """Frames of a recording in order of time.

    bus: of a file with several buses the one to read, as `ranger-sim read --bus`; of a file with one bus its name here,
    e.g. "can1" for vcan0; {bus in the file: bus of the robot} does both. A folder is that of a walk (`ranger-sim walk
    --out`): can1.log ... can4.log. accept_loss: share of the frames that may be lost, 0 to 1. UserError for what cannot
    be read, for more losses, and where `bus` leaves open which of several buses is meant.
    """
    source = pathlib.Path(path)
    files: list[tuple[pathlib.Path, str | Mapping[str, str] | None]] = [(source, bus)]
    if source.is_dir():
        files = [(each, each.stem) for each in sorted(source.glob("can[1-4].log"))]
        if not files:
            raise UserError(f"{source}: a folder without can1.log ... can4.log, so not that of a walk")
    made = frame_type(RANGER)
    found: list[Frame] = []
    ledger: dict[str, dict[str, int]] = {}
    for file, wanted in files:
        log = read_frames(file)
        frames = [made(row[1], row[0], *row[2:]) for row in log]
        names = _names(file, frames, wanted)
        chosen = [frame._replace(bus=names[frame.bus]) for frame in frames if frame.bus in names]
        _refuse_losses(file, log, accept_loss)
        ledger[file.name] = log.ledger()
        if len(chosen) < len(frames):
            ledger[file.name]["frames"] -= len(frames) - len(chosen)
            ledger[file.name]["other buses"] = len(frames) - len(chosen)
        found += chosen
    if not found:
        raise UserError(f"{source}: there is no frame in this recording")
    return Recording(sorted(found), ledger)


def _names(file: pathlib.Path, frames: list[Frame], wanted: str | Mapping[str, str] | None) -> dict[str, str]:
    """{bus in the file: its name here} of the buses to read. UserError for an unknown one, or an open choice."""
    there = sorted({frame.bus for frame in frames})
    if wanted is None:
        return {name: name for name in there}
    if isinstance(wanted, Mapping):
        for name in wanted:
            if name not in there:
                raise UserError(f"{file}: bus {name!r}: unknown bus (available: {', '.join(there)})")
        return dict(wanted)
    if wanted in there:
        return {wanted: wanted}
    if len(there) > 1:
        buses: dict[int, set[str]] = {}
        for frame in frames:
            buses.setdefault(frame.identifier, set()).add(frame.bus)
        several = [f"{each:#x}" for each in sorted(buses) if len(buses[each]) > 1]
        more = f" and {len(several) - NAMED} more" if len(several) > NAMED else ""
        both = f", and {', '.join(several[:NAMED])}{more} on more than one of them" if several else ""
        first = there[0]
        raise UserError(
            f"{file}: bus {wanted!r}: the recording has the buses {', '.join(there)}{both}; "
            f"read_log(path, bus={{{first!r}: {wanted!r}}}) reads {first} as {wanted}"
        )
    return {there[0]: wanted} if there else {}


def _refuse_losses(file: pathlib.Path, log: RecordedFrames, accepted: float) -> None:
    lost = sum(count for _, count, _ in log.losses)
    if lost > accepted * log.read:
        reasons = "; ".join(f"{count} {reason.replace('_', ' ')}, {where}" for reason, count, where in log.losses)
        raise UserError(
            f"{file}: {lost} of {log.read} frames are lost ({reasons}): such a recording is not replayed "
            f"(accept_loss={lost / log.read:.2g})"
        )
