"""The picture of a walk compared with its twins: how far its features are from those of sound walks."""

from __future__ import annotations

from typing import Any

import plotly.graph_objects as go

from ranger_sim.tools.diagnose.figures import AFTER, BEFORE, finished
from ranger_sim.tools.diagnose.twin_words import USUAL
from ranger_sim.tools.report.figures import Figure


def unusual(found: dict[str, Any] | None) -> Figure | None:
    """Bars of the most unusual features, in deviations of sound walks; None without a comparison."""
    if found is None or not found["unusual"]:
        return None
    rows = list(reversed(found["unusual"]))
    colours = [BEFORE if abs(away) > USUAL else AFTER for _, away in rows]
    bars = go.Bar(
        x=[away for _, away in rows], y=[name for name, _ in rows], orientation="h", marker={"color": colours}
    )
    figure = go.Figure(bars)
    figure.update_xaxes(title_text="deviations of sound walks, given the state at the start of each step")
    note = "Means over all steps of either leg. Within three deviations a feature is that of a sound robot."
    return finished(figure, "Compared with its twins", note, 120 + 26 * len(rows))
