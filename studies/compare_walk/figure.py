"""The plot of a comparison: strides of the log and of the emulated robot over each other, and their differences.

An SVG made of the answer alone (the JSON of `python -m studies.compare_walk`): the same answer gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from studies.compare_walk.gait import STATE_NAMES

MEASURED, BEFORE, AFTER, INK, GRID = "#57606a", "#d9731a", "#1f6fb2", "#24292f", "#d8dee4"
WIDTH, HEIGHT = 1000, 640
LEFT, RIGHT = 70, 560  # of the trajectories
PANELS = {
    "hip_rad": ("Hip angle, rad (inner legs ahead)", 60, 260),
    "lean_rad": ("Lean of the outer leg, rad", 310, 490),
}
LIMITS = {"hip_rad": (-0.5, 0.4), "lean_rad": (-0.3, 0.3)}
BARS_TOP = 530
DOTS = (770, 970)  # of the features
SHADES = ("#eef1f4", "#dfe5eb", "#eef1f4", "#dfe5eb")
KINDS = (("measured", MEASURED, "measured"), ("emulated", BEFORE, "emulated"), ("extended", AFTER, "extended"))


def draw(answer: Mapping[str, Any]) -> str:
    """The whole picture as text."""
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}" '
        'font-family="sans-serif">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
        *heading(answer),
        *trajectories(answer["trajectories"]),
        *states(answer["trajectories"]),
        *features(answer),
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def text(x: float, y: float, words: str, anchor: str = "start", size: int = 12, colour: str = INK) -> str:
    escaped = words.replace("&", "&amp;").replace("<", "&lt;")
    return f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size}" text-anchor="{anchor}" fill="{colour}">{escaped}</text>'


def line(x1: float, y1: float, x2: float, y2: float, colour: str = GRID, width: float = 1.0) -> str:
    return f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="{colour}" stroke-width="{width:g}"/>'


def heading(answer: Mapping[str, Any]) -> list[str]:
    """Title and legend."""
    strides = ", ".join(str(each) for each in answer["steady"])
    parts = [text(LEFT, 24, f"{answer['log']}, strides {strides}, compared with {answer['controller']}", size=15)]
    x = DOTS[0] - 190
    for key, colour, words in KINDS:
        if key in answer["trajectories"]:
            parts += [line(x, 20, x + 24, 20, colour, 2.5), text(x + 30, 24, words)]
            x += 110
    return parts


def longest_s(curves: Mapping[str, Any]) -> float:
    """End of the time axis: a tenth of a second after the longest stride."""
    return max(each["changes_s"][-1] for group in curves.values() for each in group) + 0.05


def place(value: float, limits: tuple[float, float], ends: tuple[float, float]) -> float:
    """Position of a value between two ends, in pixels."""
    return ends[0] + (value - limits[0]) / (limits[1] - limits[0]) * (ends[1] - ends[0])


def trajectories(curves: Mapping[str, Any]) -> list[str]:
    """Two panels over the time since inner swing began."""
    last = longest_s(curves)
    parts = []
    for key, (title, top, bottom) in PANELS.items():
        low, high = LIMITS[key]
        parts.append(text(LEFT, top - 8, title, size=13))
        for tenth in range(round(10 * low), round(10 * high) + 1):
            y = place(tenth / 10, (low, high), (bottom, top))
            parts += [line(LEFT, y, RIGHT, y, INK if tenth == 0 else GRID, 0.7)]
            parts += [text(LEFT - 8, y + 4, f"{tenth / 10:.1f}", "end", 11)]
        for fifth in range(int(5 * last) + 1):
            x = place(fifth / 5, (0.0, last), (LEFT, RIGHT))
            parts += [line(x, top, x, bottom), text(x, bottom + 15, f"{fifth / 5:.1f}", "middle", 11)]
        for kind, colour, _ in KINDS:
            for each in curves.get(kind, ()):
                points = " ".join(
                    f"{place(t, (0.0, last), (LEFT, RIGHT)):.1f},{place(v, (low, high), (bottom, top)):.1f}"
                    for t, v in zip(each["time_s"], each[key], strict=True)
                )
                width = 1.6 if kind == "measured" else 2.2
                parts.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="{width}"/>')
    return parts


def states(curves: Mapping[str, Any]) -> list[str]:
    """A bar for each stride, cut where the walk machine changes its state."""
    last = longest_s(curves)
    parts = [text(LEFT, BARS_TOP - 6, "States of the walk machine, s since inner swing began", size=13)]
    y: float = BARS_TOP
    for kind, colour, _ in KINDS:
        for each in curves.get(kind, ()):
            ends = [place(t, (0.0, last), (LEFT, RIGHT)) for t in each["changes_s"]]
            for number, (a, b) in enumerate(zip(ends[:-1], ends[1:], strict=True)):
                parts.append(
                    f'<rect x="{a:.1f}" y="{y:.1f}" width="{b - a:.1f}" height="17" fill="{SHADES[number]}" '
                    f'stroke="{colour}" stroke-width="1.2"/>'
                )
                if y == BARS_TOP:
                    parts.append(text((a + b) / 2, y + 12.5, STATE_NAMES[number + 1], "middle", 10))
            y += 22
    return parts


def features(answer: Mapping[str, Any]) -> list[str]:
    """A row for each feature: measured interval, emulated and extended, in the feature's own range."""
    parts = [text(DOTS[0] - 190, 52, "Features of a stride; bars: 95 % by the strides' scatter", size=13)]
    extended: Sequence[float] | None = answer.get("extended_features") if answer["causes"] else None
    for i, row in enumerate(answer["misfit"]):
        y = 84 + 52 * i
        low, high = row["ci95"]
        seen = [low, high, row["emulated"], *([extended[i]] if extended else [])]
        margin = 0.12 * (max(seen) - min(seen))
        limits = (min(seen) - margin, max(seen) + margin)

        def x(value: float, limits: tuple[float, float] = limits) -> float:
            return place(value, limits, DOTS)

        parts += [text(DOTS[0] - 190, y - 8, row["meaning"], size=11), line(DOTS[0], y + 10, DOTS[1], y + 10)]
        parts += [line(x(low), y + 10, x(high), y + 10, MEASURED, 7)]
        marks = [(row["measured"], MEASURED), (row["emulated"], BEFORE), *([(extended[i], AFTER)] if extended else [])]
        for value, colour in marks:
            parts.append(f'<circle cx="{x(value):.1f}" cy="{y + 10}" r="4.5" fill="{colour}"/>')
        shown = f"{row['measured']:.3f}, {row['emulated']:.3f}" + (f", {extended[i]:.3f}" if extended else "")
        parts.append(text(DOTS[0] - 190, y + 14, f"{shown} {row['unit']}", size=11, colour=MEASURED))
    return parts
