"""Draws docs/walk-2015.svg out of docs/walk_2015.json, an answer of `studies.compare_walk LOG --causes`.

    python -m studies.pictures.walk_2015

The same file gives the same bytes.
"""

import json
import pathlib

from studies.compare_walk import figure

ROOT = pathlib.Path(__file__).resolve().parents[2]
ANSWER = ROOT / "docs" / "walk_2015.json"
FIGURE = ROOT / "docs" / "walk-2015.svg"


def draw() -> str:
    """The figure as text."""
    return figure.draw(json.loads(ANSWER.read_text(encoding="utf-8")))


if __name__ == "__main__":
    FIGURE.write_text(draw(), encoding="utf-8")
