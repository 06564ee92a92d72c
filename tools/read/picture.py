"""Every channel of a recording over time, with its findings: as a page, or as a picture."""

from __future__ import annotations

import io
import pathlib
import textwrap

import jinja2
import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import sanity
from ranger_sim.sysid.dataset import Array, Channel, Finding
from ranger_sim.sysid.reading import Measurement
from ranger_sim.tools.read.findings import lines_of
from ranger_sim.tools.report.figures import OUTER, Figure, finished, library

HERE = pathlib.Path(__file__).parent
MOST_POINTS = 4000  # of a curve: least and most value of each stretch, so that no spike is lost
MOST_CHANNELS = 60
MOST_IN_PICTURE = 120  # channels; their picture is 23,000 pixels high
MOST_LETTERS = 150  # of a channel's findings above its curve
MOST_GAPS = 0.1  # of a channel's points
WHOLE = 0.9  # of the recording
SHADES = {sanity.NOTE: "#5b6875", sanity.WARNING: "#d9731a", sanity.FATAL: "#b3261e"}


def page(found: list[Measurement]) -> str:
    """The page as text."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(HERE),
        autoescape=jinja2.select_autoescape(["j2"]),
        undefined=jinja2.StrictUndefined,
    )
    recordings = [
        {
            "name": each.dataset.name,
            "findings": lines_of(each),
            "lines": each.ledger()["lines"],
            "figures": [_figure(channel, each) for channel in list(each.channels.values())[:MOST_CHANNELS]],
            "more": max(0, len(each.channels) - MOST_CHANNELS),
        }
        for each in found
    ]
    return environment.get_template("template.html.j2").render(recordings=recordings, library=library())


def _figure(channel: Channel, measurement: Measurement) -> Figure:
    time_s, value = thinned(channel)
    figure = go.Figure(go.Scatter(x=time_s, y=value, mode="lines", line={"color": OUTER, "width": 1}))
    own = [each for each in measurement.findings if each.channel == channel.name]
    for each in _places(channel, own):
        figure.add_vrect(x0=each.start_s, x1=each.end_s, fillcolor=SHADES[each.severity], opacity=0.15, line_width=0)
    at_limit = _at_limits(channel, own)
    if at_limit.any():
        style = {"color": SHADES[sanity.WARNING], "size": 3}
        x, y = channel.time_s[at_limit], channel.value[at_limit]
        figure.add_trace(go.Scatter(x=x, y=y, mode="markers", marker=style, showlegend=False, hoverinfo="skip"))
    figure.update_xaxes(title_text="time, s").update_yaxes(title_text=channel.unit or "not known")
    text = "; ".join(each.text for each in own) or "nothing odd"
    return finished(figure, channel.name, f"{len(channel.value)} samples; {text}.", 240)


def _places(channel: Channel, own: list[Finding]) -> list[Finding]:
    """The findings that have a place: not those of the whole recording, and not what is between cut-off values."""
    span = float(np.nanmax(channel.time_s) - np.nanmin(channel.time_s)) if len(channel.time_s) else 0.0
    return [each for each in own if 0.0 < each.end_s - each.start_s < WHOLE * span and each.kind != "saturation"]


def _at_limits(channel: Channel, own: list[Finding]) -> NDArray[np.bool_]:
    """(n,) True for the values that are cut off."""
    return np.isin(channel.value, [each.size for each in own if each.kind == "saturation"])


def thinned(channel: Channel) -> tuple[Array, Array]:
    """Stamps and values (m,) of a channel, at most MOST_POINTS: least and most value of each stretch.

    A value that is not a number breaks the line at each gap: nothing was measured there.
    """
    time_s, value = channel.time_s, channel.value
    count = len(value)
    if count > MOST_POINTS:
        stretch = -(-2 * count // MOST_POINTS)
        whole = count // stretch * stretch
        blocks = np.where(np.isfinite(value[:whole]), value[:whole], 0.0).reshape(-1, stretch)
        places = np.sort(np.stack([blocks.argmin(axis=1), blocks.argmax(axis=1)], axis=1), axis=1)
        places = (places + stretch * np.arange(len(blocks))[:, None]).ravel()
        time_s, value = time_s[places], value[places]
    steps = np.diff(time_s)
    usual = float(np.median(steps)) if len(steps) else 0.0
    gaps = np.flatnonzero(steps > sanity.GAP_STEPS * usual) + 1
    if not len(gaps) or len(gaps) > MOST_GAPS * len(value):  # events, which come when they come
        return time_s, value
    return np.insert(time_s, gaps, time_s[gaps - 1]), np.insert(value, gaps, np.nan)


def png(found: list[Measurement]) -> bytes:
    """The picture as bytes. UserError where matplotlib is missing."""
    try:
        from matplotlib.figure import Figure as Canvas
    except ImportError:
        raise UserError("--plot FILE.png needs matplotlib (pip install matplotlib); FILE.html needs nothing") from None
    channels = [(each, channel) for each in found for channel in list(each.channels.values())[:MOST_CHANNELS]]
    if len(channels) > MOST_IN_PICTURE:
        raise UserError(
            f"--plot FILE.png: {len(channels)} channels, a picture has {MOST_IN_PICTURE}; FILE.html has all"
        )
    canvas = Canvas(figsize=(10.0, 0.5 + 1.9 * len(channels)), layout="constrained")
    axes = canvas.subplots(len(channels), 1, squeeze=False)[:, 0]
    for axis, (measurement, channel) in zip(axes, channels, strict=True):
        own = [each for each in measurement.findings if each.channel == channel.name]
        axis.plot(*thinned(channel), color=OUTER, linewidth=0.7)
        for each in _places(channel, own):
            axis.axvspan(each.start_s, each.end_s, color=SHADES[each.severity], alpha=0.15)
        at_limit = _at_limits(channel, own)
        axis.plot(channel.time_s[at_limit], channel.value[at_limit], ".", color=SHADES[sanity.WARNING], markersize=2)
        whose = f"{measurement.dataset.name}: " if len(found) > 1 else ""
        remarks = textwrap.shorten("; ".join(each.text for each in own), MOST_LETTERS)
        # dollars would begin a formula
        title = f"{whose}{channel.name}" + (f"\n{remarks}" if remarks else "")
        axis.set_title(title.replace("$", r"\$"), fontsize=8, loc="left")
        axis.set_ylabel(channel.unit or "unit not known", fontsize=8)
        axis.tick_params(labelsize=8)
    axes[-1].set_xlabel("time, s", fontsize=8)
    file = io.BytesIO()
    canvas.savefig(file, format="png")
    return file.getvalue()
