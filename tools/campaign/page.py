"""A campaign's results for people: one self-contained page, and the same as Markdown."""

import pathlib
from typing import Any

import jinja2
import plotly.graph_objects as go

from ranger_sim.harness.campaigns.summary import worst_of
from ranger_sim.tools.report.figures import library, placed

HERE = pathlib.Path(__file__).parent
# From harmless to harmful; grey proves nothing.
COLOURS = {
    "no effect": "#e3e7eb",
    "masked": "#cfe3f4",
    "detected and safe": "#8fc7a3",
    "degraded": "#f6d68b",
    "undetected wrong": "#e8894a",
    "fall": "#c8453c",
    "damage": "#6d1a4e",
    "invalid": "#ffffff",
    "timed out": "#9aa5b1",
    "crashed": "#1d2733",
}
ORDER = tuple(COLOURS)
SHORT = {
    "no effect": "none",
    "masked": "mask",
    "detected and safe": "safe",
    "degraded": "degr",
    "undetected wrong": "wrong",
    "fall": "fall",
    "damage": "dmg",
    "invalid": "inv",
    "timed out": "time",
    "crashed": "crash",
}


def render(results: dict[str, Any]) -> str:
    """The page as text. `results`: of harness/campaigns/summary.py."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(HERE),
        autoescape=jinja2.select_autoescape(["j2"]),
        undefined=jinja2.StrictUndefined,
    )
    environment.filters["share"] = share_text
    environment.filters["why"] = why_text
    environment.filters["ms"] = lambda value: "" if value is None else f"{value:.4g} ms"
    heat = results["heat"]
    return environment.get_template("template.html.j2").render(
        results=results,
        colours=COLOURS,
        heat_html=heat_map(heat) if heat["places"] else "",
        extremes=[extremes_text(each) for each in results["extremes"]],
        coverage=coverage(results),
        happened=[name for name, share in results["outcomes"].items() if share["count"]],
        healthy=healthy_texts(results),
        setting_columns=setting_columns(results["settings"]),
        settings=[(list(each["axes"].values()), cells) for each, cells in setting_rows(results["settings"])],
        times_html=times(results["rows"]) if any(row["detection_ms"] is not None for row in results["rows"]) else "",
        library=library(),
    )


def share_text(share: dict[str, Any]) -> str:
    """A share in percent, with its interval where it has one."""
    if share["share"] is None:
        return "none"
    text = f"{100.0 * share['share']:.1f} %"
    return text if share["low"] is None else f"{text} ({100.0 * share['low']:.1f} to {100.0 * share['high']:.1f} %)"


def heat_map(heat: dict[str, Any]) -> str:
    """Places by modes, coloured by the worst outcome of the cell; the text counts the outcomes."""
    colours, texts, counts = [], [], []
    for place in heat["places"]:
        cells = [heat["cells"][place].get(mode) for mode in heat["modes"]]
        worst = [None if cell is None else worst_of(cell) for cell in cells]
        colours.append([None if name is None else ORDER.index(name) for name in worst])
        texts.append(["" if name is None else SHORT[name] for name in worst])
        counts.append([counts_text(cell) for cell in cells])
    steps = len(ORDER)
    scale = []
    for place, name in enumerate(ORDER):
        scale += [[place / steps, COLOURS[name]], [(place + 1) / steps, COLOURS[name]]]
    figure = go.Figure(
        go.Heatmap(
            z=colours,
            x=heat["modes"],
            y=heat["places"],
            text=texts,
            customdata=counts,
            texttemplate="%{text}",
            hovertemplate="%{y}: %{x}<br>%{customdata}<extra></extra>",
            colorscale=scale,
            zmin=-0.5,
            zmax=steps - 0.5,
            showscale=False,
            xgap=2,
            ygap=2,
        )
    )
    figure.update_layout(
        template="plotly_white",
        height=90 + 24 * len(heat["places"]),
        margin={"l": 160, "r": 10, "t": 90, "b": 10},
        xaxis={"side": "top", "tickangle": -40},
        yaxis={"autorange": "reversed"},
        font={"size": 11},
    )
    return placed(figure, least_width=180 + 40 * len(heat["modes"]))


def counts_text(outcomes: list[str] | None) -> str:
    """A table of the outcomes and their shares."""
    listed = outcomes or []
    return ", ".join(f"{name} x {listed.count(name)}" for name in dict.fromkeys(listed))


def times(rows: list[dict[str, Any]]) -> str:
    """Plot of detection times: the share of the runs by the time since the fault's start."""
    figure = go.Figure()
    for name, column in (
        ("first error that reports it", "detection_ms"),
        ("first other state", "reaction_ms"),
        ("fall", "fall_ms"),
    ):
        found = sorted(row[column] for row in rows if row.get(column) is not None)
        shares = [100.0 * number / len(rows) for number in range(1, len(found) + 1)]
        figure.add_scatter(x=[max(each, 0.1) for each in found], y=shares, name=name, line={"shape": "hv"})
    figure.update_layout(
        template="plotly_white",
        height=340,
        margin={"l": 60, "r": 20, "t": 30, "b": 45},
        xaxis={"type": "log", "title": "ms after the fault began"},
        yaxis={"title": "share of all runs, %", "rangemode": "tozero"},
        legend={"orientation": "h", "y": 1.15, "x": 0},
    )
    return placed(figure)


def markdown(results: dict[str, Any]) -> str:
    """The same in Markdown, without the plots."""
    lines = (
        [f"# {results['title']}", "", results["description"], ""]
        if results["description"]
        else [f"# {results['title']}", ""]
    )
    runs = f"{results['runs']} runs"
    if not results["finished"]:
        runs = f"**Not finished: {results['runs']} of {results['foreseen']} runs, shares are of these.** The plan"
    lines += [
        f"{runs} ({results['population']}), version {results['version']}. {results['interval']}",
        "",
        "| Outcome | Runs | Share | Criterion |",
        "|---|---|---|---|",
    ]
    for name, share in results["outcomes"].items():
        lines.append(f"| {name} | {share['count']} | {share_text(share)} | {results['criteria'][name]} |")
    lines += ["", "| Coverage | Share | Runs |", "|---|---|---|"]
    for what, share in coverage(results).items():
        lines.append(f"| {what} | {share_text(share)} | {share['count']} of {share['of']} |")
    for each in results["tolerances"]:
        lines += ["", tolerance_text(each)]
    for text in healthy_texts(results):
        lines += ["", text]
    heat = results["heat"]
    if heat["places"]:
        lines += ["", "## Worst outcome by place and mode", ""]
        lines += ["| Place | " + " | ".join(heat["modes"]) + " |", "|---" * (len(heat["modes"]) + 1) + "|"]
        for place in heat["places"]:
            cells = [heat["cells"][place].get(mode) for mode in heat["modes"]]
            lines.append(f"| {place} | " + " | ".join(SHORT[worst_of(cell)] if cell else "" for cell in cells) + " |")
        lines += ["", "; ".join(f"{short}: {name}" for name, short in SHORT.items()) + "."]
    if results["codes"]:
        lines += ["", "## What reported the faults first", ""]
        lines += ["| Error | From | First | Of the faulty board | Median |", "|---|---|---|---|---|"]
        for each in results["codes"]:
            told_first = f"{each['first']} | {each['own_board']} | {each['median_ms']:.4g} ms"
            lines.append(f"| {each['code']} | {each['board']} | {told_first} |")
    if results["stopped_at_look"] is not None and results["runs"] < results["foreseen"]:
        early = f"Stopped early, at look {results['stopped_at_look']}: {results['runs']} of {results['foreseen']} runs."
        lines += ["", early]
    for each in results["extremes"]:
        lines += ["", extremes_text(each)]
    if results["settings"]:
        axes, columns = list(results["settings"][0]["axes"]), setting_columns(results["settings"])
        lines += ["", "## Settings", ""]
        lines += ["| " + " | ".join([*axes, *columns]) + " |", "|---" * (len(axes) + len(columns)) + "|"]
        lines += [f"| {' | '.join([str(each['axes'][name]) for name in axes] + cells)} |"
                  for each, cells in setting_rows(results["settings"])]  # fmt: skip
    for title, name in (("Worst cases", "worst"), ("Runs that prove nothing", "unsure")):
        if results[name]:
            lines += ["", f"## {title}", "", "| Outcome | Fault | Why | Detected | Again |", "|---|---|---|---|---|"]
            for each in results[name]:
                first = each["detected"]
                detected = f"{first['code']} from {first['board']}, {first['ms']:.4g} ms" if first else "no"
                why = why_text(each)
                fault = each["fault"] or ", ".join(f"{key} {value}" for key, value in each["axes"].items())
                lines.append(f"| {each['outcome']} | {fault} | {why} | {detected} | `{each['replay']}` |")
    return "\n".join(lines) + "\n"


def why_text(each: dict[str, Any]) -> str:
    """The reason of a run's outcome, and the time of its fall."""
    if each["fall_ms"] is None:
        return str(each["why"])
    fallen = " after" if each["outcome"] == "fall" else "; fell after"
    return f"{each['why']}{fallen} {each['fall_ms']:.0f} ms"


def coverage(results: dict[str, Any]) -> dict[str, Any]:
    """The shares that are shares of anything; a machine that cannot fall has none of its falls."""
    return {what: share for what, share in results["coverage"].items() if share["of"]}


def healthy_texts(results: dict[str, Any]) -> list[str]:
    """The false alarms of healthy runs, a sentence for each different result."""
    texts = []
    for each in results["healthy"]:
        count, total = each["false_alarms"]
        codes = f" ({', '.join(each['false_alarm_codes'])})" if each["false_alarm_codes"] else ""
        texts.append(
            f"Healthy runs of seeds {', '.join(map(str, each['seeds']))}, each judged by the others as if a fault had "
            f"begun, from several times on: {count} false alarms of {total}{codes}."
        )
    return list(dict.fromkeys(texts))


UNITS = ("m", "s", "W")  # of a gait's quantities, at the end of their names


def measured(settings: list[dict[str, Any]]) -> list[str]:
    """The quantities by which a sweep's runs were judged: the gait's, or those of the machine's body."""
    return list(dict.fromkeys(name for each in settings for name in each["gait"]))


def setting_columns(settings: list[dict[str, Any]]) -> list[str]:
    """Headings of the table of settings, after the settings themselves."""
    names = []
    for name in measured(settings):
        words, _, unit = name.rpartition("_")
        names.append(f"{words}, {unit}".replace("_", " ") if unit in UNITS else name.replace("_", " "))
    return ["outcome", "why", *names, "least slot margin", "overruns"]


def setting_rows(settings: list[dict[str, Any]]) -> list[tuple[dict[str, Any], list[str]]]:
    """(the run, its cells after the settings themselves) for each line of the table of settings."""
    names = measured(settings)
    rows = []
    for each in settings:
        slot, values = each["slot"], [each["gait"].get(name) for name in names]
        margin = "" if slot["margin"] is None else f"{100.0 * slot['margin']:.1f} % ({slot['board']})"
        numbers = ["" if value is None else f"{value:.3g}" for value in values]
        overruns = "" if slot["overruns"] is None else str(slot["overruns"])
        rows.append((each, [each["outcome"], each["why"], *numbers, margin, overruns]))
    return rows


def extremes_text(each: dict[str, Any]) -> str:
    """A search's result for one listed combination, in a sentence."""
    parts = [f"{each['cell'] or 'Search'}: {each['hits']} of {each['runs']} runs ended as {each['outcome']}"]
    for what in ("least", "soonest"):
        if (found := each[what]) is not None:
            values = ", ".join(f"{name} {value}" for name, value in found["axes"].items())
            after = "" if found["fall_ms"] is None else f", fell after {found['fall_ms']:.0f} ms"
            parts.append(f"{what} {values}{after}")
    return "; ".join(parts) + "."


def tolerance_text(each: dict[str, Any]) -> str:
    """A tolerance and whether it was met, in a sentence."""
    upper = f"; upper tolerance limit {each['upper_ms']:.4g} ms" if each.get("upper_ms") is not None else ""
    return (
        f"{each['what']} within {each['limit_ms']:g} ms for {100 * each['share']:g} % ({each['by']}): "
        f"{each['verdict']}; {each['within']} of {each['of']} within{upper}."
    )
