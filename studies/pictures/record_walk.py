"""Draws docs/record-walk.svg out of `ranger-sim bench walks --json`: the walks before, and those on the body `ranger`.

    python -m studies.pictures.record_walk

Left: how far each of the seeds walked on the level. Right: step length over step time of each walk that reached its
end, compared with the robot's (robot.md P6). The same files give the same bytes.
"""

import json
import pathlib
import sys

from studies.pictures.svg import BLUE, RED, figure, line, place, text

ROOT = pathlib.Path(__file__).resolve().parents[2]
BEFORE = ROOT / "benchmarks" / "2026-11-22-walks.json"
NOW = ROOT / "benchmarks" / "2026-11-27-walks-on-ranger.json"
FIGURE = ROOT / "docs" / "record-walk.svg"
STEPS = 1000
ROBOT = (0.60, 0.35)  # step time s, step length m: robot.md P6
TIMES = (0.56, 0.64)
LENGTHS = (0.33, 0.39)
TOP, BOTTOM = 54, 330
LEFT_PLOT = (70, 420)
RIGHT_PLOT = (520, 830)


def walks(path: pathlib.Path, roughness_m: float = 0.0) -> list[dict]:
    """The walks of `record-2011` on this floor, by seed."""
    rows = json.loads(path.read_text(encoding="utf-8"))["walks"]
    chosen = [row for row in rows if row["controller"] == "record-2011" and row["floor_roughness_m"] == roughness_m]
    return sorted(chosen, key=lambda row: row["seed"])


def distances(before: list[dict], now: list[dict]) -> list[str]:
    """Two bars for each seed: steps walked."""
    parts = [text(LEFT_PLOT[0], 30, "Steps until the fall, or 1000: each seed", size=15)]
    for steps in range(0, STEPS + 1, 250):
        x = place(steps, (0, STEPS), LEFT_PLOT)
        parts += [line(x, TOP, x, BOTTOM), text(x, BOTTOM + 18, str(steps), "middle")]
    height = (BOTTOM - TOP) / len(now)
    for number, (old, new) in enumerate(zip(before, now, strict=True)):
        y = TOP + number * height
        for row, colour, shift in ((old, RED, 0.12), (new, BLUE, 0.5)):
            width = place(row["steps"], (0, STEPS), LEFT_PLOT) - LEFT_PLOT[0]
            parts.append(
                f'<rect x="{LEFT_PLOT[0]}" y="{y + shift * height:.1f}" width="{width:.1f}" '
                f'height="{0.36 * height:.1f}" fill="{colour}"/>'
            )
        parts.append(text(LEFT_PLOT[0] - 8, y + 0.68 * height, str(new["seed"]), "end", 10))
    return parts


def gait(level: list[dict], rough: list[dict]) -> list[str]:
    """A dot for each walk that reached its end."""
    parts = [text(RIGHT_PLOT[0], 30, "Step length over step time", size=15)]
    for hundredths in range(round(100 * TIMES[0]), round(100 * TIMES[1]) + 1, 2):
        x = place(hundredths / 100, TIMES, RIGHT_PLOT)
        parts += [line(x, TOP, x, BOTTOM), text(x, BOTTOM + 18, f"{hundredths / 100:.2f} s", "middle")]
    for hundredths in range(round(100 * LENGTHS[0]), round(100 * LENGTHS[1]) + 1, 1):
        y = place(hundredths / 100, LENGTHS, (BOTTOM, TOP))
        parts += [line(RIGHT_PLOT[0], y, RIGHT_PLOT[1], y)]
        parts += [text(RIGHT_PLOT[0] - 8, y + 4, f"{hundredths / 100:.2f} m", "end")]
    for rows, fill in ((rough, "none"), (level, BLUE)):
        for row in rows:
            if not row["fell"]:
                x = place(row["mean_step_time_s"], TIMES, RIGHT_PLOT)
                y = place(row["mean_step_length_m"], LENGTHS, (BOTTOM, TOP))
                parts.append(f'<circle cx="{x:g}" cy="{y:g}" r="4" fill="{fill}" stroke="{BLUE}"/>')
    x, y = place(ROBOT[0], TIMES, RIGHT_PLOT), place(ROBOT[1], LENGTHS, (BOTTOM, TOP))
    parts += [line(x - 9, y, x + 9, y, RED, 2.5), line(x, y - 9, x, y + 9, RED, 2.5)]
    parts.append(text(x + 12, y + 16, "the robot, May 2011", colour=RED))
    return parts


def legend() -> list[str]:
    """What the colours are."""
    y = BOTTOM + 46
    return [
        f'<rect x="{LEFT_PLOT[0]}" y="{y - 10}" width="12" height="12" fill="{RED}"/>',
        text(LEFT_PLOT[0] + 18, y, "body of before"),
        f'<rect x="{LEFT_PLOT[0] + 130}" y="{y - 10}" width="12" height="12" fill="{BLUE}"/>',
        text(LEFT_PLOT[0] + 148, y, "body ranger"),
        f'<circle cx="{RIGHT_PLOT[0] + 6}" cy="{y - 4}" r="4" fill="{BLUE}" stroke="{BLUE}"/>',
        text(RIGHT_PLOT[0] + 18, y, "level, 1000 steps"),
        f'<circle cx="{RIGHT_PLOT[0] + 166}" cy="{y - 4}" r="4" fill="none" stroke="{BLUE}"/>',
        text(RIGHT_PLOT[0] + 178, y, "1 mm, 500 steps"),
    ]


def drawn() -> str:
    """The figure as SVG."""
    level = walks(NOW)
    parts = [*distances(walks(BEFORE), level), *gait(level, walks(NOW, 0.001)), *legend()]
    return figure(860, 400, parts)


if __name__ == "__main__":
    FIGURE.write_text(drawn(), encoding="utf-8")
    sys.exit(0)
