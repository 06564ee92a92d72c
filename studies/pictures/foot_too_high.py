"""Draws docs/foot-too-high.svg out of docs/foot_too_high.json: what each set of figures says of height and mass.

    python -m studies.pictures.foot_too_high

A line is a 95 % interval of the answers of `python -m studies.figures`, as the JSON kept them, of the best hypothesis
under which the number is wrong; the dot its value. The same file gives the same bytes.
"""

import json
import pathlib
import sys

from studies.pictures.svg import BLUE, RED, figure, line, place, text

ROOT = pathlib.Path(__file__).resolve().parents[2]
KEPT = ROOT / "docs" / "foot_too_high.json"
FIGURE = ROOT / "docs" / "foot-too-high.svg"
# candidate: title, ends of the axis, ticks, as printed, as found by hand (robot.md P1.13, P6)
PLOTS = {
    "ankle_offset_m": ("d, ankle to the arc's centre, m", (0.08, 0.16), (0.08, 0.10, 0.12, 0.14, 0.16), 0.11, 0.146),
    "mass_offset_kg_m": ("w m, centre of mass ahead, kg m", (-0.06, 0.06), (-0.06, -0.03, 0.0, 0.03, 0.06), 0.0, 0.04),
}
WIDTH, LEFT, GAP, TOP, ROW = 860, 235, 45, 62, 44


def inside(value: float, limits: tuple, ends: tuple) -> float:
    """As `place`; values beyond the limits are drawn at the end."""
    return place(min(max(value, limits[0]), limits[1]), limits, ends)


def plot(name: str, rows: list[dict], ends: tuple[float, float], bottom: float) -> list[str]:
    """One candidate: an interval for each set of figures."""
    title, limits, ticks, printed, by_hand = PLOTS[name]
    parts = [text(ends[0], 24, title, size=15)]
    for tick in ticks:
        x = place(tick, limits, ends)
        parts += [line(x, TOP, x, bottom), text(x, bottom + 18, f"{tick:g}", "middle")]
    for value, words, dashed in ((printed, "printed", ' stroke-dasharray="4 3"'), (by_hand, "by hand", "")):
        x = place(value, limits, ends)
        parts += [line(x, TOP - 6, x, bottom, RED, 1.5, dashed), text(x, TOP - 10, words, "middle", 12, RED)]
    for number, row in enumerate(rows):
        y = TOP + (number + 0.5) * ROW
        tied = row["hypotheses"]
        found = next((each["values"][name] for each in tied if name in each["wrong"]), None)
        found = found or row["estimates"][name]
        low, high = (inside(end, limits, ends) for end in found["ci95"])
        parts.append(line(low, y, high, y, BLUE, 4.0 if row["named"].count(name) else 2.0))
        parts.append(f'<circle cx="{inside(found["value"], limits, ends):g}" cy="{y:g}" r="5" fill="{BLUE}"/>')
    return parts


def drawn() -> str:
    """The figure as SVG."""
    rows = json.loads(KEPT.read_text(encoding="utf-8"))["measured"]
    bottom = TOP + len(rows) * ROW
    width = (WIDTH - LEFT - 2 * GAP) / 2.0
    parts = []
    for number, name in enumerate(PLOTS):
        begin = LEFT + number * (width + GAP)
        parts += plot(name, rows, (begin, begin + width), bottom)
    for number, row in enumerate(rows):
        parts.append(text(LEFT - 14, TOP + (number + 0.5) * ROW + 4, row["figures"], "end"))
    told = "95 % intervals, each if it is this number that is wrong; thick where the figures name it"
    parts.append(text(LEFT, bottom + 42, told, size=12))
    return figure(WIDTH, bottom + 56, parts)


if __name__ == "__main__":
    FIGURE.write_text(drawn(), encoding="utf-8")
    sys.exit(0)
