"""Every channel of a recording over time, with its findings: as a page, or as a picture."""

from __future__ import annotations

import io
import pathlib

import jinja2
import numpy as np
import plotly.graph_objects as go

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import sanity
from ranger_sim.sysid.dataset import Array, Channel
from ranger_sim.sysid.reading import Measurement
from ranger_sim.tools.report.figures import OUTER, Figure, finished, library

HERE = pathlib.Path(__file__).parent
MOST_POINTS = 4000  # of a curve: least and most value of each stretch, so that no spike is lost
MOST_CHANNELS = 60
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
            "findings": each.findings,
            "proposals": each.proposals,
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
    for each in own:
        if each.end_s > each.start_s:
            figure.add_vrect(
                x0=each.start_s, x1=each.end_s, fillcolor=SHADES[each.severity], opacity=0.15, line_width=0
            )
    figure.update_xaxes(title_text="time, s").update_yaxes(title_text=channel.unit or "not known")
    text = "; ".join(each.text for each in own) or "nothing odd"
    return finished(figure, channel.name, f"{len(channel.value)} samples; {text}.", 240)


def thinned(channel: Channel) -> tuple[Array, Array]:
    """Stamps and values (m,) of a channel, at most MOST_POINTS: least and most value of each stretch."""
    count = len(channel.value)
    if count <= MOST_POINTS:
        return channel.time_s, channel.value
    stretch = -(-2 * count // MOST_POINTS)
    whole = count // stretch * stretch
    blocks = np.where(np.isfinite(channel.value[:whole]), channel.value[:whole], 0.0).reshape(-1, stretch)
    places = np.sort(np.stack([blocks.argmin(axis=1), blocks.argmax(axis=1)], axis=1), axis=1)
    places = (places + stretch * np.arange(len(blocks))[:, None]).ravel()
    return channel.time_s[places], channel.value[places]


def png(found: list[Measurement]) -> bytes:
    """The picture as bytes. UserError where matplotlib is missing."""
    try:
        from matplotlib.figure import Figure as Canvas
    except ImportError:
        raise UserError("--plot FILE.png needs matplotlib (pip install matplotlib); FILE.html needs nothing") from None
    channels = [(each, channel) for each in found for channel in list(each.channels.values())[:MOST_CHANNELS]]
    canvas = Canvas(figsize=(10.0, 1.8 * len(channels)), layout="constrained")
    axes = canvas.subplots(len(channels), 1, squeeze=False)[:, 0]
    for axis, (measurement, channel) in zip(axes, channels, strict=True):
        axis.plot(*thinned(channel), color=OUTER, linewidth=0.7)
        for each in measurement.findings:
            if each.channel == channel.name and each.end_s > each.start_s:
                axis.axvspan(each.start_s, each.end_s, color=SHADES[each.severity], alpha=0.15)
        axis.set_title(channel.name, fontsize=8, loc="left")
        axis.set_ylabel(channel.unit)
    file = io.BytesIO()
    canvas.savefig(file, format="png")
    return file.getvalue()
