"""Plots on the pages of tools: their common look, and their embedding in a page with their library."""

import base64
import dataclasses
import functools
import gzip
import pathlib
from typing import Any

from markupsafe import Markup
from plotly.io import to_json
from plotly.offline import get_plotlyjs

HERE = pathlib.Path(__file__).parent
OUTER, INNER, HIP, INK = "#115599", "#bb5500", "#009475", "#1d2733"  # the report's and the panel's


@dataclasses.dataclass
class Figure:
    """A titled plot with a note below it."""

    title: str
    html: Markup
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
    return Figure(title, placed(figure), note)


def placed(figure: Any, least_width: int = 0) -> Markup:
    """A figure's place on the page and its numbers as JSON, which `library` draws; the same bytes every time.

    least_width: px, below which it is not squeezed; what holds it scrolls.
    """
    height = figure.layout.height or 450  # px, plotly's own
    numbers = Markup(to_json(figure, validate=False))  # has < and > as escapes
    width = f";min-width:{least_width}px" if least_width else ""
    return Markup(
        f'<div style="height:{height}px{width}"></div><script type="application/json" class="figure">{numbers}</script>'
    )


@functools.cache
def library() -> Markup:
    """The end of a page with figures: plotly, packed, and the script that draws them."""
    script = (HERE / "plots.js").read_text(encoding="utf-8")
    notice = "The plots need a browser of 2023 or later with JavaScript; they load nothing from elsewhere."
    return Markup(
        f'<noscript><p>{notice}</p></noscript>\n<p id="no-plots" hidden>{notice}</p>\n'
        f'<script type="application/gzip+base64" id="packed-plotly">{packed(get_plotlyjs())}</script>\n'
        f"<script>{script}</script>"
    )


def packed(text: str) -> Markup:
    """Compressed text that a page unpacks by itself, with the same bytes every time: a third of Plotly's 4.8 MB."""
    return Markup(base64.b64encode(gzip.compress(text.encode(), 9, mtime=0)).decode())
