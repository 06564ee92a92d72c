"""A slot as a picture in text, to scale: what had the processor, tasks on one line, interrupts on another.

    tasks       each function has a letter, in the order in which they ran; "." where interrupts took most of a cell
    interrupts  each source has a digit
    limits      where the slot ends ("tick": the next one comes), and the limit of a test

A cell shows what had most of its time; what is shorter than half a cell may not be visible, but is in the list.
"""

from __future__ import annotations

import string
from typing import Any

from ranger_sim.foundation.quantities import duration_text

WIDTH = 96  # cells; with the names of the lines it fits in 110 columns
MARGIN = 1.04  # of the longest thing shown
TASK_SIGNS = string.ascii_lowercase + string.ascii_uppercase
INTERRUPT_SIGNS = string.digits[1:] + "0"
SMALLEST_SHARE = 0.002  # of a slot; shorter ones share a line of the list


def of_slot(slot: Any, executions: list[Any], limit_ns: int | None = None) -> str:
    """The picture of `slot`, with what ran in it; `limit_ns` after its tick is marked."""
    legend = slot.legend
    span = max(legend.slot_ns, slot.taken_ns, limit_ns or 0) * MARGIN
    cell = span / WIDTH
    tasks = [each for each in executions if not each.interrupt]
    interrupts = [each for each in executions if each.interrupt]
    task_signs = _signs([each.name for each in tasks], TASK_SIGNS)
    interrupt_signs = _signs([each.name for each in interrupts], INTERRUPT_SIGNS)
    stolen = [0.0] * WIDTH
    shares: list[dict[str, float]] = [{} for _ in range(WIDTH)]
    for each in interrupts:
        inner = [one for one in interrupts if one is not each and _inside(one, each)]
        for start, end in _pieces(each, inner):
            _fill(stolen, None, start - slot.start_ns, end - slot.start_ns, cell)
            _fill(None, shares, start - slot.start_ns, end - slot.start_ns, cell, interrupt_signs[each.name])
    interrupt_line = [_most(share, cell) for share in shares]
    shares = [{} for _ in range(WIDTH)]
    for each in tasks:
        if each.chooses and any(_inside(one, each) for one in tasks if not one.chooses):  # its entry is shown
            continue
        _fill(None, shares, each.start_ns - slot.start_ns, each.end_ns - slot.start_ns, cell, task_signs[each.name])
    task_line = []
    for share, lost in zip(shares, stolen, strict=True):
        sign = _most(share, cell)
        task_line.append("." if sign != " " and lost > cell / 2 else sign)
    lines = [_head(slot), "", _scale(span)]
    lines.append("tasks       " + "".join(task_line).rstrip())
    lines.append("interrupts  " + "".join(interrupt_line).rstrip())
    marks = {legend.slot_ns: f"tick {duration_text(legend.slot_ns)}"}
    if limit_ns is not None and limit_ns != legend.slot_ns:
        marks[limit_ns] = f"limit {duration_text(limit_ns)}"
    lines += _marks(marks, cell)
    lines.append("")
    lines += _list(slot, tasks, task_signs, "function", "limit")
    lines += _list(slot, interrupts, interrupt_signs, "interrupt", "waited us")
    return "\n".join(lines)


def _head(slot: Any) -> str:
    text = (
        f"{slot.board}, slot {slot.number:,} (row {slot.row}), {slot.start_ns * 1e-9:.6f} s after power-up: "
        f"{slot.cycles:,} cycles, {duration_text(slot.taken_ns)} of {duration_text(slot.legend.slot_ns)}"
    )
    if slot.overran:
        text += "; it overran, dropped: " + (", ".join(slot.dropped) or "nothing")
    return text


def _signs(names: list[str], signs: str) -> dict[str, str]:
    """One sign for each name, in order; the last one for all beyond their number."""
    return {name: signs[min(place, len(signs) - 1)] for place, name in enumerate(dict.fromkeys(names))}


def _inside(inner: Any, outer: Any) -> bool:
    return bool(outer.start_ns <= inner.start_ns and inner.end_ns <= outer.end_ns)


def _pieces(each: Any, inner: list[Any]) -> list[tuple[int, int]]:
    """The time of an execution without that of those inside."""
    pieces, at = [], each.start_ns
    for one in inner:
        pieces.append((at, one.start_ns))
        at = one.end_ns
    pieces.append((at, each.end_ns))
    return [piece for piece in pieces if piece[1] > piece[0]]


def _fill(
    sums: list[float] | None,
    shares: list[dict[str, float]] | None,
    start_ns: float,
    end_ns: float,
    cell: float,
    sign: str = "",
) -> None:
    """Add a piece of time to the cells that it covers."""
    first, last = max(0, int(start_ns // cell)), min(WIDTH - 1, int(end_ns // cell))
    for place in range(first, last + 1):
        covered = min(end_ns, (place + 1) * cell) - max(start_ns, place * cell)
        if covered > 0.0 and sums is not None:
            sums[place] += covered
        if covered > 0.0 and shares is not None:
            shares[place][sign] = shares[place].get(sign, 0.0) + covered


def _most(share: dict[str, float], cell: float) -> str:
    """What had most of a cell, if together they had at least a tenth of it."""
    if sum(share.values()) < cell / 10:
        return " "
    return max(share, key=lambda sign: share[sign])


def _scale(span_ns: float) -> str:
    """Marks at round times."""
    step = next(size for size in (10_000, 20_000, 50_000, 100_000, 200_000, 500_000, 10**6) if size * 12 >= span_ns)
    line = [" "] * (WIDTH + 12)
    for number in range(int(span_ns // step) + 1):
        at = round(number * step / span_ns * WIDTH)
        text = f"|{number * step // 1000}"
        line[at : at + len(text)] = text
    return "us          " + "".join(line).rstrip()


def _marks(marks: dict[int, str], cell: float) -> list[str]:
    """A line for each mark, its sign at its place."""
    lines = []
    for time_ns, text in sorted(marks.items()):
        at = int(time_ns / cell)
        line = " " * at + "^ " + text if at + len(text) + 2 <= WIDTH + 8 else " " * (at - len(text) - 1) + text + " ^"
        lines.append("            " + line)
    return lines


def _list(slot: Any, executions: list[Any], signs: dict[str, str], what: str, last: str) -> list[str]:
    """Cycles by name, with their share of the slot, and a function's limit or an interrupt's longest wait."""
    legend = slot.legend
    if not executions:
        return []
    lines = [f"   {what:<26} {'times':>5} {'cycles':>8} {'us':>8} {'% of slot':>9} {last:>9}"]
    small: list[int] = []
    for name, sign in signs.items():
        runs = [each for each in executions if each.name == name]
        cycles = sum(each.cycles for each in runs)
        if cycles < SMALLEST_SHARE * legend.slot_cycles:
            small.append(cycles)
            continue
        lines.append(_line(sign, name, len(runs), cycles, legend) + _against(runs))
    if small:
        called = "(a shorter one)" if len(small) == 1 else f"({len(small)} shorter ones)"
        lines.append(_line(" ", called, len(small), sum(small), legend))
    return lines


def _against(runs: list[Any]) -> str:
    """The last column: a function's limit, and whether it was exceeded, or how long an interrupt waited at most."""
    if runs[0].interrupt:
        return f" {max(each.latency_ns for each in runs) / 1000:>9.2f}"
    limit = runs[0].limit
    over = "  over!" if max(each.cycles for each in runs) > limit else ""
    return f" {limit:>9,}{over}" if limit else ""


def _line(sign: str, name: str, times: int, cycles: int, legend: Any) -> str:
    us = cycles / legend.cycles_per_ns / 1000.0
    share = 100.0 * cycles / legend.slot_cycles
    return f" {sign} {name:<26} {times:>5} {cycles:>8,} {us:>8.1f} {share:>9.1f}"
