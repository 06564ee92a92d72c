"""The most important time of a trace: where a fault acted, where the robot fell, or its last step."""

import dataclasses
import pathlib

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.timeline import perfetto_reader

# searched in this order: the first of a kind, but of steps the last
FIRST = (("acted: ", "Faults"), ("activated: ", "Faults"), ("fell", "Steps"))


@dataclasses.dataclass(frozen=True)
class Moment:
    """`time_ns` since the run began, and the event there; begin_ns ... end_ns: the whole trace."""

    time_ns: int
    text: str
    begin_ns: int
    end_ns: int


def find(path: pathlib.Path, asked_ns: int | None) -> Moment:
    """The requested time, or the most important one. UserError for one that the trace does not have."""
    begin_ns, end_ns, instants = perfetto_reader.read_instants(path)
    if asked_ns is not None:
        if not begin_ns <= asked_ns <= end_ns:
            raise UserError(
                f"trace {path}: {asked_ns * 1e-9:g} s is not in it, "
                f"it is from {begin_ns * 1e-9:g} to {end_ns * 1e-9:g} s"
            )
        return Moment(asked_ns, f"{asked_ns * 1e-9:g} s", begin_ns, end_ns)
    for start, track in FIRST:
        for instant in instants.get(track, []):
            if instant.name.startswith(start):
                return Moment(instant.start_ns, instant.name, begin_ns, end_ns)
    if instants.get("Steps"):
        last = instants["Steps"][-1]
        return Moment(last.start_ns, last.name, begin_ns, end_ns)
    return Moment((begin_ns + end_ns) // 2, "the middle", begin_ns, end_ns)
