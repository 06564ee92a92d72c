"""The look that plots on the pages of tools have in common."""

import dataclasses
from typing import Any

OUTER, INNER, HIP, INK = "#1f6fb2", "#d9731a", "#2c7a4b", "#1d2733"


@dataclasses.dataclass
class Figure:
    """A titled plot as HTML with a note below it."""

    title: str
    html: str
    note: str = ""


def finished(figure: Any, title: str, note: str = "", height: int = 420, **layout: Any) -> Figure:
    """Common look, rendered without a copy of the library."""
    figure.update_layout(
        template="plotly_white",
        height=height,
        margin={"l": 60, "r": 20, "t": 30, "b": 45},
        legend={"orientation": "h", "y": 1.12, "x": 0},
        font={"color": INK},
        **layout,
    )
    return Figure(
        title,
        figure.to_html(full_html=False, include_plotlyjs=False, config={"displaylogo": False, "displayModeBar": False}),
        note,
    )
