"""Writes the bits of a timeline as a value change dump (IEEE 1364, section 18): for GTKWave, Surfer and the like.

A scope for each board: its slot line (high while a slot runs), its interrupt line, its row, the pins it drove; one for
the buses: busy or idle, and the identifier on it; one for the machines: the names of their states. Time in ns.
"""

import io
from collections.abc import Iterator
from typing import IO, Any

import numpy as np

from ranger_sim.harness.timeline.model import Events, Slices

Change = tuple[int, int, Any]  # ns, number of the variable, value


def write(events: Events, file: IO[bytes], title: str) -> None:
    """Write the whole timeline into `file`; `title` is its comment. The same timeline gives the same bytes."""
    import vcd  # only here

    text = io.TextIOWrapper(file, encoding="ascii", write_through=True)
    # no date: the same run gives the same bytes
    with vcd.VCDWriter(text, timescale="1 ns", date="", comment=title, version="ranger-sim") as writer:
        variables: list[Any] = []
        changes: list[Change] = []
        for scope, name, kind, size, initial, values in lines(events):
            variable = writer.register_var(scope, name, kind, size=size, init=initial)
            number = len(variables)
            variables.append(variable)
            changes += [(time, number, value) for time, value in values]
        changes.sort(key=lambda change: change[:2])
        for time, number, value in changes:
            writer.change(variables[number], time, value)
        writer.close(max([events.end_ns, *(change[0] for change in changes[-1:])]))
    text.detach()


def lines(events: Events) -> Iterator[tuple[str, str, str, int | None, Any, list[tuple[int, Any]]]]:
    """(scope, name, kind, size, value at first, [(ns, value)]) of every signal in the file."""
    for slices in events.slices:
        if slices.path[0] == "Boards" and slices.path[-1] in ("slots", "interrupts", "main loop"):
            scope = f"boards.{slices.path[1]}"
            line = {"slots": "slot", "interrupts": "interrupt", "main loop": "main_loop"}[slices.path[-1]]
            yield scope, line, "wire", 1, 0, levels(slices)
            if line == "slot":
                yield scope, "row", "integer", 32, 0, list(zip(*columns(slices.start_ns, slices.name), strict=True))
        elif slices.path[0] == "Buses" and slices.path[-1] == "frames":
            yield "buses", slices.path[1], "wire", 1, 0, levels(slices)
            yield "buses", f"{slices.path[1]}_frame", "string", None, "", named(slices)
        elif slices.path[0] == "Machines":
            yield "machines", slices.path[1].replace(" ", "_"), "string", None, "", named(slices)
    for board, pins in events.pins.items():
        for pin, (time, level) in pins.items():
            yield f"boards.{board}", pin, "wire", 1, "x", list(zip(*columns(time, level), strict=True))


def columns(*values: np.ndarray) -> list[list[int]]:
    """As lists of Python's own numbers."""
    return [each.tolist() for each in values]


def levels(slices: Slices) -> list[tuple[int, int]]:
    """1 during a slice or one inside it, 0 between them; where two meet it stays 1."""
    start, end = slices.start_ns, slices.end_ns
    if slices.inside is not None and slices.path[-1] == "interrupts":  # a fast one need not lie in a slow one
        start = np.concatenate([start, slices.inside.start_ns])
        end = np.concatenate([end, slices.inside.end_ns])
        order = np.argsort(start, kind="stable")
        start, end = start[order], np.maximum.accumulate(end[order]) if len(order) else end
    if len(start) == 0:
        return []
    rises = np.append(True, start[1:] > end[:-1])
    falls = np.append(rises[1:], True)
    found = [(time, 1) for time in start[rises].tolist()] + [(time, 0) for time in end[falls].tolist()]
    return sorted(found)


def named(slices: Slices) -> list[tuple[int, str]]:
    """The name during a slice, nothing between them; a space would end a VCD string."""
    found: list[tuple[int, str]] = []
    for start, end, name in zip(*columns(slices.start_ns, slices.end_ns, slices.name), strict=True):
        if found and found[-1][0] == start:
            found.pop()
        found += [(start, slices.names[name].replace(" ", "_")), (end, "")]
    return found
