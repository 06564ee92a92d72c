"""A page that shows a part of a timeline without a network: no library, everything in one file."""

import json
import pathlib
from typing import Any

from ranger_sim.harness.timeline import perfetto_reader
from ranger_sim.harness.timeline.moments import Moment
from ranger_sim.harness.timeline.perfetto_reader import ReadTrace, ReadTrack

PAGE = pathlib.Path(__file__).with_name("viewer.html")
DATA_MARK = "/* the trace */ null"


def page(path: pathlib.Path, moment: Moment, kept_ns: int, shown_ns: int) -> str:
    """The page for the trace at `path`, with `kept_ns` of it around the moment, of which it shows `shown_ns` first."""
    begin = max(moment.begin_ns, min(moment.time_ns - kept_ns // 2, moment.end_ns - kept_ns))
    end = min(moment.end_ns, begin + kept_ns)
    trace = perfetto_reader.read(path, begin, end)
    data = {
        "file": path.name,
        "title": next((track.description for track in trace.tracks.values() if not track.parent), ""),
        "begin": begin,
        "end": end,
        "whole": [moment.begin_ns, moment.end_ns],
        "at": moment.time_ns,
        "moment": moment.text,
        "shown": shown_ns,
        **laid_out(trace, begin),
    }
    text = json.dumps(data, separators=(",", ":")).replace("</", "<\\/")
    return PAGE.read_text(encoding="utf-8").replace(DATA_MARK, text)


def laid_out(trace: ReadTrace, begin_ns: int) -> dict[str, Any]:
    """Names, tracks and flows in the page's form; times in ns from `begin_ns` on.

    A track: path, unit, slices as one list of start, duration, name, depth; notes by slice; counters and instants.
    """
    names: dict[str, int] = {}
    tracks: list[dict[str, Any]] = []
    begins: dict[int, tuple[int, int]] = {}
    ends: dict[int, tuple[int, int]] = {}
    for track in sorted(trace.tracks.values(), key=lambda each: each.rank):
        if not (track.slices or track.instants or track.values):
            continue
        number = len(tracks)
        for place, each in enumerate(track.slices):
            begins.update(dict.fromkeys(each.flows, (number, place)))
            ends.update(dict.fromkeys(each.flow_ends, (number, place)))
        tracks.append(track_data(trace, track, names, begin_ns))
    flows = [[*begins[flow], *ends[flow]] for flow in begins if flow in ends]
    return {"names": list(names), "tracks": tracks, "flows": flows}


def track_data(trace: ReadTrace, track: ReadTrack, names: dict[str, int], begin_ns: int) -> dict[str, Any]:
    """One track for the page."""

    def number(name: str) -> int:
        return names.setdefault(name, len(names))

    slices: list[int] = []
    for each in track.slices:
        slices += [each.start_ns - begin_ns, each.end_ns - each.start_ns, number(each.name), each.depth]
    note_names = list(dict.fromkeys(name for each in track.slices for name in each.notes))
    notes = [[rounded(each.notes.get(name, "")) for name in note_names] for each in track.slices] if note_names else []
    return {
        "path": trace.path(track),
        "unit": track.unit,
        "slices": slices,
        "noteNames": note_names,
        "notes": notes,
        "time": [time - begin_ns for time in track.time_ns],
        "values": [rounded(value) for value in track.values],
        "instants": [[each.start_ns - begin_ns, each.name, each.notes] for each in track.instants],
    }


def rounded(value: str | float) -> Any:
    """A number in its shortest form; not finite ones as text, because JSON does not have them."""
    if isinstance(value, str):
        return value
    if value != value or value in (float("inf"), float("-inf")):
        return str(value)
    return int(value) if value == int(value) and abs(value) < 1e15 else float(f"{value:.6g}")
