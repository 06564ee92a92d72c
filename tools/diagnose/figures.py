"""The plots of the diagnosis: measured against the model before and after, and the plane in which a cause shows.

They know no machine: an equation's two sides, the signals that it is looked over, and an effect's own columns.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.diagnosis import Diagnosis
from ranger_sim.sysid.machine import Recording
from ranger_sim.sysid.misfit import cells
from ranger_sim.sysid.naming import Named
from ranger_sim.sysid.regression import Regression, kept_rows, reduced
from ranger_sim.tools.report.figures import Figure, placed

BEFORE, AFTER, MEASURED, FAINT = "#d9731a", "#1f6fb2", "#7a8794", "#9aa5b1"  # legible on white and on black
MOST_POINTS = 3000  # per line: a window of so many rows is shown
MOST_DOTS = 1500
CELLS = 36  # of a signal; each has a mean with its interval
LEAST_IN_CELL = 12  # samples, of which a mean is drawn
MAP_CELLS = 14  # of either signal of a map
MOST_EQUATIONS = 6
SHOWS = 0.6  # of an effect's square that the means over a signal have: below it the effect is drawn over itself
ALIKE = 0.95  # correlation above which a measured column shows what a signal shows already


@dataclasses.dataclass
class Sides:
    """One equation over all recordings at the rows that count: what was measured, and the model without and with.

    All of shape (n,); `where`: number of the recording of each row.
    """

    name: str
    unit: str
    time_s: Array
    where: np.ndarray
    measured: Array
    before: Array
    after: Array
    rows: np.ndarray  # of the equation's part that count


def sides(found: Diagnosis) -> dict[str, Sides]:
    """Both sides of every equation, the most significant first."""
    made = {}
    for name in found.plain.equations:
        part = found.plain.parts[name]
        rows = np.flatnonzero(part.valid & ~part.starts)
        if len(rows) < 10:
            continue
        unit = next(r.equations[name].unit for r in found.recordings if name in r.equations)
        stamps = [kept_rows(r, r.table.time_s) for r in found.recordings]
        shift = np.zeros(len(part.response))
        if all(r.entries and name in r.table for r in found.recordings):  # a simulator's errors: about its channel
            shift = kept(found.recordings, [r.table[name] for r in found.recordings]) - part.response
        number = np.concatenate([np.full(len(each), place) for place, each in enumerate(stamps)])
        made[name] = Sides(
            name,
            unit,
            np.concatenate(stamps)[rows],
            number[rows],
            part.response[rows] + shift[rows],
            modelled(found.plain, name)[rows] + shift[rows],
            modelled(found.extended, name)[rows] + shift[rows],
            rows,
        )
    order = sorted(made, key=lambda name: -gap(made[name]))
    return {name: made[name] for name in order}


def modelled(regression: Regression, equation: str) -> Array:
    """What a regression says of an equation's response, not whitened: (n,)."""
    return regression.parts[equation].measured @ np.array([regression.values[name] for name in regression.names])


def gap(side: Sides) -> float:
    """Share of what the extension takes out of the residual."""
    first = float(np.mean((side.measured - side.before) ** 2))
    return (first - float(np.mean((side.measured - side.after) ** 2))) / max(first, 1e-300)


def two_sides(found: Diagnosis, side: Sides) -> Figure:
    """Measured and modelled over time, and what is left, in the window where the two models differ most."""
    extended = bool(found.named)
    with_it = "model after" if found.answer["causes"] else "model with the suspects"
    first, second = side.measured - side.before, side.measured - side.after
    part = window(side, first**2 - second**2 if extended else first**2)
    time_s = side.time_s[part]
    steps = np.diff(time_s)
    gaps = np.flatnonzero(steps > 3.0 * np.median(steps)) + 1

    def line(values: Array, name: str, colour: str, row: int, width: float = 1.4) -> None:
        # a break in the stamps is a break in the line
        x, y = (np.insert(np.asarray(each, dtype=float), gaps, np.nan) for each in (time_s, values[part]))
        style = {"color": colour, "width": width}
        shown = row == 1
        figure.add_trace(go.Scatter(x=x, y=y, name=name, line=style, showlegend=shown, legendgroup=name), row, 1)

    figure = make_subplots(rows=2, shared_xaxes=True, vertical_spacing=0.07, row_heights=[0.55, 0.45])
    line(side.measured, "measured", MEASURED, 1, 2.4)
    line(side.before, "model before" if extended else "model", BEFORE, 1)
    line(first, "model before" if extended else "model", BEFORE, 2)
    if extended:
        line(side.after, with_it, AFTER, 1)
        line(second, with_it, AFTER, 2)
    figure.update_yaxes(title_text=side.unit, row=1, col=1)
    figure.update_yaxes(title_text=f"what is left, {side.unit}", row=2, col=1)
    figure.update_xaxes(title_text="s", row=2, col=1)
    recording = found.recordings[int(side.where[part.start])].table.name
    rms = [float(np.sqrt(np.mean(each**2))) for each in (first, second)]
    left = f"left: {rms[0]:.3g} {side.unit} rms"
    left += f" before, {rms[1]:.3g} after" if extended else ""
    note = f"{recording}, {time_s[0]:.4g} to {time_s[-1]:.4g} s; {left} over all recordings."
    return finished(figure, f"The {side.name} equation", note, 470)


def window(side: Sides, weight: Array) -> slice:
    """So many rows of one recording in a row, where `weight` (n,) is largest."""
    best, found = -np.inf, slice(0, 1)
    for number in np.unique(side.where):
        rows = np.flatnonzero(side.where == number)
        length = min(len(rows), MOST_POINTS)
        total = np.concatenate(([0.0], np.cumsum(weight[rows])))
        sums = total[length:] - total[:-length]
        start = int(np.argmax(sums))
        if sums[start] > best:
            best, found = float(sums[start]), slice(int(rows[0]) + start, int(rows[0]) + start + length)
    return found


# --- the plane in which a cause shows -------------------------------------------------------------------------


def of_cause(found: Diagnosis, each: Named, made: Mapping[str, Sides]) -> Figure | None:
    """What one named effect takes out, over the signal in which it shows best; None when no equation has it."""
    shown: tuple[float, Sides, Array] | None = None
    for name, side in made.items():
        signature = beside(found, each, name)
        if signature is None:
            continue
        strength = float(np.std(signature[side.rows])) / max(float(np.std(side.measured - side.after)), 1e-300)
        if shown is None or strength > shown[0]:
            shown = strength, side, signature[side.rows]
    if shown is None:
        return None
    _, side, signature = shown
    with_it = side.measured - side.after
    without = with_it + signature
    note = "Dots: single samples; lines: means with their 95 % interval. A model that misses nothing lies at zero."
    phase = phase_of(found, each, side.name)
    if phase is not None:
        told = np.isfinite(phase[side.rows])
        x, with_it, without = (values[told] for values in (phase[side.rows], with_it, without))
        label = f"phase of {each.effect.cause}, in periods"
        note += f" At {shape_text(each.shape)}."
    else:
        over = candidates(found, side)
        # the course of time tells everything of a short recording: it must tell twice as much as any signal does
        shares = {name: explained(over[name], signature) * (0.5 if name == "t" else 1.0) for name in over}
        name = max(shares, key=lambda name: shares[name])
        x, label = over[name], label_of(found, name)
        if shares[name] < SHOWS:
            x, label = signature, f"what {each.effect.cause} adds by its own equation, {side.unit}"
            note += " Without the effect the means would lie on the diagonal if it is all that is missing."
    figure = go.Figure()
    dots(figure, x, without)
    means(figure, x, without, "without this effect", BEFORE)
    means(figure, x, with_it, "with it", AFTER)
    figure.update_yaxes(title_text=f"what is left of {side.name}, {side.unit}", range=reach_of(figure))
    figure.update_xaxes(title_text=label)
    return finished(figure, f"Where {each.effect.cause} shows", note, 380)


def beside(found: Diagnosis, each: Named, equation: str) -> Array | None:
    """What an effect adds to an equation that the machine's own parameters cannot take up: (n,) at all kept rows."""
    parts = []
    for recording in found.recordings:
        made = each.effect.columns(recording, each.shape, found.plain.values)
        count = len(kept_rows(recording, recording.table.time_s))
        parts.append(reduced(recording, made[equation], equation) if equation in made else np.zeros((count, 0)))
    width = max(part.shape[1] for part in parts)
    if not width:
        return None
    columns = np.vstack([part if part.shape[1] else np.zeros((len(part), width)) for part in parts])
    added = columns @ np.array([found.extended.values[name] for name in each.coefficients])
    part = found.plain.parts[equation]
    base = part.measured[part.valid]
    fitted = np.linalg.lstsq(base, added[part.valid], rcond=1e-9)[0]
    return np.asarray(added - part.measured @ fitted, dtype=float)


def phase_of(found: Diagnosis, each: Named, equation: str) -> Array | None:
    """Phase of a periodic effect in periods, 0 to 1, at all kept rows; None for an effect that is none.

    Not a number where the effect adds nothing: there the samples do not follow it.
    """
    if not each.effect.phase_is_free and set(each.shape) != {"pitch_m"} or len(each.effect.coefficients) != 2:
        return None
    parts = []
    for recording in found.recordings:
        made = each.effect.columns(recording, each.shape, found.plain.values).get(equation)
        if made is None:
            return None
        both = kept_rows(recording, made)
        phase = (np.arctan2(both[:, 1], both[:, 0]) / (2.0 * np.pi)) % 1.0
        parts.append(np.where(np.any(both != 0.0, axis=1), phase, np.nan))
    return np.concatenate(parts)


def candidates(found: Diagnosis, side: Sides) -> dict[str, Array]:
    """Signals over which an equation may be drawn, at its rows: those of the general tests, and other channels."""
    general = [of_equation(found.machine.generic(recording), side.name) for recording in found.recordings]
    made = {}
    for name in general[0]:
        if all(name in each for each in general):
            made[name] = kept(found.recordings, [each[name] for each in general])[side.rows]
    for name in found.recordings[0].table.columns:
        if name not in made and all(name in recording.table for recording in found.recordings):
            column = kept(found.recordings, [recording.table[name] for recording in found.recordings])[side.rows]
            if not any(alike(column, other) for other in made.values()):
                made[name] = column
    if not any(name in made for name in ("t", "time", "t_s")):
        made["t"] = side.time_s
    return made


def of_equation(generic: Mapping[str, Mapping[str, Array]], name: str) -> dict[str, Array]:
    """The signals of an equation; of all entries where a machine gives its signals by entry."""
    return dict(generic[name]) if name in generic else {k: v for each in generic.values() for k, v in each.items()}


def kept(recordings: Sequence[Recording], columns: Sequence[Array]) -> Array:
    return np.concatenate([kept_rows(each, column) for each, column in zip(recordings, columns, strict=True)])


def alike(one: Array, other: Array) -> bool:
    if np.std(one) == 0.0 or np.std(other) == 0.0:
        return True
    return bool(abs(np.corrcoef(one, other)[0, 1]) > ALIKE)


def explained(x: Array, y: Array) -> float:
    """Part of the variance of y that the means over cells of x have."""
    number = cells(x, CELLS)
    count = np.bincount(number)
    mean = np.bincount(number, y) / np.maximum(count, 1)
    return float(np.sum(count * (mean - np.mean(y)) ** 2) / max(len(y) * np.var(y), 1e-300))


def telling(found: Diagnosis, made: Mapping[str, Sides]) -> Figure | None:
    """The residual where the general tests saw it: over one signal, over two of them as a map, over a signal's past."""
    if not found.before.tests or not made:
        return None
    test = found.before.telling
    side = made.get(test.equation, next(iter(made.values())))  # an entry's misfit shows in the equations behind it
    over = candidates(found, side)
    left = side.measured - side.before
    title = f"Where the {side.name} equation is off"
    kind, _, rest = test.features.partition(" ")
    names = (rest.removeprefix("of ") if kind == "history" else rest).split(" and ")
    if any(name not in over for name in names):
        return None
    if len(names) == 2:
        return heat_map(found, side, left, names, over, title)
    x = over[names[0]]
    label = label_of(found, names[0])
    if kind == "history":
        x, label = np.gradient(x), f"change of {label}, from sample to sample"
    figure = go.Figure()
    dots(figure, x, left)
    means(figure, x, left, "what the model misses", BEFORE)
    figure.update_yaxes(title_text=f"what is left, {side.unit}")
    figure.update_xaxes(title_text=label)
    return finished(
        figure, title, f"The most significant of {len(found.before.tests)} general tests: {test.features}.", 380
    )


def heat_map(
    found: Diagnosis, side: Sides, left: Array, names: Sequence[str], over: Mapping[str, Array], title: str
) -> Figure:
    """Means of the residual over cells of two signals."""
    edges = []
    for name in names:
        low, high = np.quantile(over[name], [0.005, 0.995])
        edges.append(np.linspace(low, high, MAP_CELLS + 1))
    x, y = over[names[0]], over[names[1]]
    count = np.histogram2d(x, y, edges)[0]
    total = np.histogram2d(x, y, edges, weights=left)[0]
    mean = np.where(count >= 3, total / np.maximum(count, 1), np.nan).T
    reach = float(np.nanquantile(np.abs(mean), 0.98)) if np.isfinite(mean).any() else 1.0
    middles = [0.5 * (each[1:] + each[:-1]) for each in edges]
    bar = {"title": {"text": side.unit}, "thickness": 12}
    shown = [[None if np.isnan(value) else float(value) for value in row] for row in mean]
    figure = go.Figure(
        go.Heatmap(
            x=middles[0], y=middles[1], z=shown, zmid=0.0, zmin=-reach, zmax=reach, colorscale="RdBu", colorbar=bar
        )
    )
    figure.update_xaxes(title_text=label_of(found, names[0]))
    figure.update_yaxes(title_text=label_of(found, names[1]))
    told = f"The most significant of {len(found.before.tests)} general tests."
    note = f"Means of what is left; a model that misses nothing would be pale all over. {told}"
    return finished(figure, title, note, 420)


# --- common --------------------------------------------------------------------------------------------------


def label_of(found: Diagnosis, name: str) -> str:
    """What a signal is called on an axis: by the machine's `labels` where it has them."""
    told = getattr(found.machine, "labels", {}).get(name)
    return str(told) if told else {"t": "time, s"}.get(name, name)


def shape_text(shape: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {value:g}" for name, value in shape.items())


def dots(figure: Any, x: Array, y: Array) -> None:
    """Some of the samples, faint."""
    step = max(1, len(x) // MOST_DOTS)
    style = {"color": FAINT, "size": 3, "opacity": 0.45}
    figure.add_trace(go.Scatter(x=x[::step], y=y[::step], mode="markers", marker=style, showlegend=False))


def means(figure: Any, x: Array, y: Array, name: str, colour: str) -> None:
    """Means of y over equally wide cells of x, with their 95 % interval; cells with few samples join the next."""
    low, high = (float(each) for each in np.quantile(x, [0.002, 0.998]))
    number = np.clip(((x - low) / max(high - low, 1e-300) * CELLS).astype(int), 0, CELLS - 1)
    held = np.cumsum(np.bincount(number, minlength=CELLS))
    number = np.unique((held[number] - 1) // max(1, LEAST_IN_CELL), return_inverse=True)[1]
    count = np.bincount(number)
    at, mean = (np.bincount(number, each) / count for each in (x, y))
    spread = np.sqrt(np.maximum(np.bincount(number, y * y) / count - mean**2, 0.0) / count)
    bars = {"type": "data", "array": 1.96 * spread, "thickness": 1, "width": 0}
    style = {"color": colour, "width": 2}
    dot = {"size": 5}
    figure.add_trace(go.Scatter(x=at, y=mean, error_y=bars, name=name, line=style, mode="lines+markers", marker=dot))


def reach_of(figure: Any) -> list[float]:
    """Limits of the vertical axis that show the means, whatever single samples do."""
    drawn = [each for each in figure.data if each.mode != "markers"]
    most = max(float(np.max(np.abs(each.y) + np.asarray(each.error_y.array))) for each in drawn)
    return [-1.6 * most, 1.6 * most]


def finished(figure: Any, title: str, note: str, height: int) -> Figure:
    """Common look: no own background, so that the page's light or dark ground shows."""
    figure.update_layout(
        template="plotly_white",
        height=height,
        margin={"l": 62, "r": 16, "t": 34, "b": 46},
        legend={"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 0, "bgcolor": "rgba(0,0,0,0)"},
        paper_bgcolor="rgba(0,0,0,0)",
        plot_bgcolor="rgba(0,0,0,0)",
        font={"size": 12},
    )
    figure.update_xaxes(automargin=True, zeroline=False)
    return Figure(title, placed(figure), note)
