"""The plots of the report, each from what the robot recorded."""

import dataclasses
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

OUTER, INNER, HIP, INK = "#1f6fb2", "#d9731a", "#2c7a4b", "#1d2733"
STATE_COLOURS = (
    "#cfe3f4",
    "#fbe3cf",
    "#d6ecd9",
    "#eadcf2",
    "#fdf3c4",
    "#e3e7eb",
    "#f7d6d6",
    "#d3eeee",
    "#e9e2d4",
    "#dde3fb",
)
MOST_POINTS = 4000  # per line: more cannot be seen and makes the page heavy


@dataclasses.dataclass
class Figure:
    """A titled plot as HTML with a note below it."""

    title: str
    html: str
    note: str = ""


def thin(*arrays: Any) -> Any:
    """Every n-th point, so that no line has more than MOST_POINTS."""
    step = max(1, len(arrays[0]) // MOST_POINTS)
    return [np.asarray(a)[::step] for a in arrays]


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


def phase_portraits(walk: Any) -> Figure:
    """Angle against rate of both legs and the hip, as the body truly moved."""
    s = walk.samples
    figure = make_subplots(cols=3, subplot_titles=("outer leg", "inner leg", "hip (inner relative to outer)"))
    for column, (angle, rate, colour) in enumerate(
        (
            (s["leg_outer_rad"], s["leg_outer_rad_s"], OUTER),
            (s["leg_inner_rad"], s["leg_inner_rad_s"], INNER),
            (s["hip_rad"], s["hip_rad_s"], HIP),
        ),
        start=1,
    ):
        x, y = thin(angle, rate)
        figure.add_trace(go.Scatter(x=x, y=y, mode="lines", line={"color": colour, "width": 1}), 1, column)
        figure.update_xaxes(title_text="rad", row=1, col=column)
    figure.update_yaxes(title_text="rad/s", row=1, col=1)
    return finished(
        figure,
        "Phase portraits",
        "A closed loop is a periodic gait; its width is the scatter of the steps.",
        showlegend=False,
    )


def states_as_bands(figure: Any, time_s: Any, states: Any, names: Any, row: int) -> None:
    """Colour the background of one subplot by a state machine's state."""
    if len(time_s) == 0:
        return
    edges = np.flatnonzero(np.diff(states)) + 1
    starts = np.concatenate([[0], edges])
    ends = np.concatenate([edges, [len(states) - 1]])
    for a, b in zip(starts, ends, strict=True):
        figure.add_vrect(
            x0=time_s[a],
            x1=time_s[b],
            fillcolor=STATE_COLOURS[int(states[a]) % len(STATE_COLOURS)],
            opacity=0.75,
            layer="below",
            line_width=0,
            row=row,
            col=1,
        )
        if time_s[b] - time_s[a] > 0.06:
            figure.add_annotation(
                x=(time_s[a] + time_s[b]) / 2,
                y=1,
                yref=f"y{'' if row == 1 else row} domain",
                xref=f"x{'' if row == 1 else row}",
                text=names.get(int(states[a]), str(int(states[a]))),
                showarrow=False,
                font={"size": 9},
                yanchor="top",
                textangle=-90,
            )


def joint_angles(walk: Any, seconds: float = 2.6) -> Figure:
    """Hip and ankle angles over the last steps, with the states of their machines behind them."""
    s = walk.samples
    keep = s["time_s"] >= s["time_s"][-1] - seconds
    time = s["time_s"][keep]
    figure = make_subplots(
        rows=3, shared_xaxes=True, vertical_spacing=0.05, subplot_titles=("hip", "outer ankle", "inner ankle")
    )
    rows = (
        ("hip", [("hip_rad", "hip angle", HIP)]),
        (
            "outer_foot",
            [("ankle_outer_rad", "outer ankle, joint", OUTER), ("motor_outer_rad", "outer ankle, motor", "#7fb2dc")],
        ),
        (
            "inner_foot",
            [("ankle_inner_rad", "inner ankle, joint", INNER), ("motor_inner_rad", "inner ankle, motor", "#f0b27a")],
        ),
    )
    for row, (machine, lines) in enumerate(rows, start=1):
        for name, label, colour in lines:
            x, y = thin(time, s[name][keep])
            figure.add_trace(
                go.Scatter(
                    x=x,
                    y=y,
                    name=label,
                    line={"color": colour, "width": 1.6},
                ),
                row,
                1,
            )
        state_time, states, names = walk.machine_states(machine)
        shown = state_time >= time[0]
        states_as_bands(figure, state_time[shown], states[shown], names, row)
        figure.update_yaxes(title_text="rad", row=row, col=1)
    figure.update_xaxes(title_text="s", row=3, col=1)
    return finished(
        figure,
        "Joint angles and the states of their machines",
        "Bands: the state of the hip, outer-foot and inner-foot machines in the main brain.",
        height=760,
    )


def currents_and_power(walk: Any, seconds: float = 2.6) -> Figure:
    """Motor currents, and the power each motor draws from the battery."""
    s = walk.samples
    keep = s["time_s"] >= s["time_s"][-1] - seconds
    time = s["time_s"][keep]
    figure = make_subplots(
        rows=3,
        shared_xaxes=True,
        vertical_spacing=0.06,
        subplot_titles=("current", "power from the battery", "battery voltage"),
    )
    for key, colour in (("hip", HIP), ("outer", OUTER), ("inner", INNER), ("steering", "#8a6fb0")):
        x, y = thin(time, s[f"{key}_A"][keep])
        figure.add_trace(go.Scatter(x=x, y=y, name=key, legendgroup=key, line={"color": colour, "width": 1.2}), 1, 1)
        x, y = thin(time, s[f"{key}_W"][keep])
        figure.add_trace(
            go.Scatter(x=x, y=y, showlegend=False, legendgroup=key, line={"color": colour, "width": 1.2}),
            2,
            1,
        )
    x, y = thin(time, s["battery_V"][keep])
    figure.add_trace(go.Scatter(x=x, y=y, showlegend=False, line={"color": INK, "width": 1.2}), 3, 1)
    for row, unit in enumerate(("A", "W", "V"), start=1):
        figure.update_yaxes(title_text=unit, row=row, col=1)
    figure.update_xaxes(title_text="s", row=3, col=1)
    return finished(figure, "Currents and power", height=720)


def bus_load(walk: Any) -> Figure:
    """Share of the time each bus was busy, in windows of 10 ms."""
    figure = go.Figure()
    for name, (time, load) in walk.bus_load.items():
        x, y = thin(time, 100 * load)
        figure.add_trace(go.Scatter(x=x, y=y, name=name, mode="lines", line={"width": 1.2}))
    figure.update_xaxes(title_text="s")
    figure.update_yaxes(title_text="% of the bit rate", rangemode="tozero")
    return finished(
        figure,
        "Load of the four CAN buses",
        "Windows of 10 ms, with stuff bits and intermission.",
        height=340,
    )


def slot_times(walk: Any) -> Figure:
    """How long the slots of each board took, against their length."""
    boards = list(walk.slot_histograms)
    percent = walk.slot_histograms[boards[0]][0]
    shares = np.array([counts / max(1, counts.sum()) for _, counts in walk.slot_histograms.values()])
    figure = go.Figure(
        go.Heatmap(
            x=percent + 2.5,
            y=boards,
            z=np.where(shares > 0, np.log10(np.maximum(shares, 1e-9)) + 2, None),
            customdata=100 * shares,
            text=[[f"{100 * share:.3g}" if share > 0 else "" for share in row] for row in shares],
            texttemplate="%{text}",
            hovertemplate="%{y}: %{customdata:.3g} % of the slots took about %{x} % of their length<extra></extra>",
            colorscale="Blues",
            zmin=-4,
            zmax=2.6,
            showscale=False,
            xgap=2,
            ygap=4,
        )
    )
    figure.update_xaxes(title_text="% of the slot used, interrupts included", range=[0, 107], dtick=10)
    figure.update_yaxes(autorange="reversed")
    figure.add_vline(x=100, line={"color": "#b3261e", "dash": "dash"})
    return finished(
        figure, "Slot times", "Numbers: % of the slots. Right of the dashed line a slot has overrun.", height=330
    )


def steps(walk: Any) -> Figure:
    """Length and time of every step."""
    figure = make_subplots(rows=2, shared_xaxes=True, vertical_spacing=0.08)
    number, length, time, outer = walk.steps
    for row, (values, unit) in enumerate(((length, "m"), (time, "s")), start=1):
        for side, colour, mask in (
            ("onto the outer feet", OUTER, outer),
            ("onto the inner feet", INNER, ~outer),
        ):
            x, y = thin(number[mask], values[mask]) if mask.any() else ([], [])
            figure.add_trace(
                go.Scatter(
                    x=x,
                    y=y,
                    name=side,
                    showlegend=row == 1,
                    mode="markers",
                    marker={"size": 4, "color": colour},
                ),
                row,
                1,
            )
        figure.update_yaxes(title_text=unit, row=row, col=1, rangemode="tozero")
    figure.update_xaxes(title_text="step", row=2, col=1)
    return finished(figure, "Steps", height=420)


def path(walk: Any) -> Figure:
    """The walk seen from above."""
    figure = go.Figure()
    s = walk.samples
    x, y = thin(s["path_x_m"], s["path_y_m"])
    figure.add_trace(go.Scatter(x=x, y=y, mode="lines", line={"color": INK}))
    figure.update_xaxes(title_text="m")
    figure.update_yaxes(title_text="m", scaleanchor="x")
    return finished(figure, "Path in the plane", height=320, showlegend=False)
