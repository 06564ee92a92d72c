"""Puts a walk's numbers, charts and animation into one self-contained page."""

import json
import math
import pathlib
from typing import Any

import jinja2
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from ranger_sim import datatable
from ranger_sim.firmware_sim.native import coverage
from ranger_sim.harness import normal_errors
from ranger_sim.ranger.names import RANGER
from ranger_sim.tools.command_line.units import duration_text, figure, length_text
from ranger_sim.tools.faults import fault_text
from ranger_sim.tools.report import charts
from ranger_sim.tools.report.figures import packed
from ranger_sim.tools.run import unexpected

MOST_LINES = 5000  # of a source in the page; chosen by us
HERE = pathlib.Path(__file__).parent
SCRIPTS = ("stage.js", "charts.js", "report.js")
MACHINES = (("hip", "hip", "hip"), ("outer_foot", "outer ankle", "outer"), ("inner_foot", "inner ankle", "inner"))

# Results of the real robot on 1-2 May 2011 (appendix 1, table of the ultra-marathon walk).
ROBOT = {
    "step": "0.35 m",
    "time": "0.60 s",
    "speed": "0.59 m/s",
    "motors": "11.3 W",
    "total": "16 W",
    "tcot": "0.28",
    "delay": "14 ± 3 ms",
    "walked": "65.2 km in 30.8 h",
    "energy": "493 Wh, 7.56 Wh/km",  # for 65.243 km
}


def render(robot: Any, summary: dict, comparison: str = "", twins: dict[str, Any] | None = None) -> str:
    """The page as text. `robot`: a `ranger.robot.Ranger` that kept a log; `summary`: its summary; comparison: the
    command that compares the walk with its twins, empty where the run's folder does not have the variables; twins: what
    it finds (`twins.compared`), where that was asked for."""
    walk = robot.recorded()
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(HERE),
        autoescape=jinja2.select_autoescape(["j2"]),
        undefined=jinja2.StrictUndefined,
    )
    groups = charts.groups(walk)
    data = charts.data(robot, walk, groups)
    time = data["series"]["time_s"]
    return environment.get_template("template.html.j2").render(
        summary=summary,
        shown_s=time[-1] - time[0],
        unexpected=[
            *unexpected.ending(summary),
            *unexpected.lines(summary, robot.plant.parameters.floor_friction),
        ],
        healthy=unexpected.HEALTHY,
        tiles=tiles(summary),
        contact=contact(summary["oddities"]),
        machines=MACHINES,
        groups=groups,
        states=data["states"],
        energy=energy(summary),
        errors=errors(robot, summary),
        fault_lines=[fault_text(fault) for fault in summary["faults"]],
        firmware=firmware(robot, summary),
        lengths=length_text,
        durations=duration_text,
        plotly=packed(get_plotlyjs()),
        walk=packed(json.dumps(data, allow_nan=False, separators=(",", ":"))),
        scripts=[Markup((HERE / name).read_text(encoding="utf-8")) for name in SCRIPTS],
        command=summary["command"],
        comparison=comparison,
        twins=twins,
        table_hash=datatable.table_hash(),
    )


def firmware(robot: Any, summary: dict) -> list[dict]:
    """Each program in C: its end, the findings, and its sources with the count of each line."""
    programs = []
    shown: set[pathlib.Path] = set()
    for board, each in summary["firmware"].items():
        made = robot.firmware[board]
        why = each["why"] or "its process ended"
        lost = f"lost at {each['lost_s']:.3f} s: {why}" if each["lost_s"] is not None else ""
        sources = []
        twins = [other for other in robot.firmware.values() if other.folder == made.folder]
        for file in coverage.merged(twin.ran() for twin in twins) if made.folder not in shown else ():
            figures = file.figures(made.folder)
            sources.append({**figures, "rows": rows_of(file), "share": share(figures["covered"], figures["lines"])})
        # boards of one source have figures each; its lines are shown once, with all their counts
        shown.add(made.folder)
        ran = each["coverage"]
        programs.append(
            {
                **each,
                "board": board,
                "lost": lost,
                "sources": sources,
                "share": share(ran["covered"], ran["lines"]) if ran["lines"] is not None else None,
                "findings": [
                    {**finding, "place": f"{finding['file']}:{finding['line']}" if finding["line"] else finding["file"]}
                    for finding in each["findings"]
                ],
            }
        )
    return programs


def share(part: int, whole: int) -> str:
    """Part of a whole, as text."""
    return f"{100.0 * part / whole:.1f} %" if whole else "none"


def rows_of(file: coverage.FileCounts) -> list[tuple[int, str, str, str]]:
    """(line, count, colour class, text) of a source; a branch never taken is "half"."""
    try:
        lines = file.path.read_text(encoding="utf-8", errors="replace").splitlines()[:MOST_LINES]
    except OSError:
        return []
    rows = []
    for number, line in enumerate(lines, 1):
        count = file.lines.get(number)
        kind = "" if count is None else "missed" if count == 0 else "ran"
        if kind == "ran" and 0 in file.branches.get(number, ()):
            kind = "half"
        rows.append((number, "" if count is None else f"{count:,}", kind, line))
    return rows


def of_the_robot(what: str) -> str:
    """The real robot's measured value, to be shown next to a figure."""
    return f"the robot: {ROBOT[what]}"


def tiles(summary: dict) -> list[dict]:
    """The key figures, with the real robot's."""
    delay = summary["heel_strike_delay_ms"]
    rows = (
        ("steps", f"{summary['steps']:,}", None),
        ("mean step length", figure(summary["mean_step_length_m"], "{:.3f} m"), of_the_robot("step")),
        ("mean step time", figure(summary["mean_step_time_s"], "{:.3f} s"), of_the_robot("time")),
        ("speed", figure(summary["speed_m_per_s"], "{:.2f} m/s"), of_the_robot("speed")),
        ("motors", figure(summary["motor_power_W"], "{:.1f} W"), of_the_robot("motors")),
        ("in all", figure(summary["total_power_W"], "{:.1f} W"), of_the_robot("total")),
        ("cost of transport", figure(summary["tcot"], "{:.2f}"), of_the_robot("tcot")),
        (
            "heel-strike delay",
            "none" if delay["mean"] is None else f"{delay['mean']:.1f} ± {delay['std']:.1f} ms",
            of_the_robot("delay"),
        ),
        ("walked", f"{length_text(summary['distance_m'])} in {since_release(summary)}", of_the_robot("walked")),
        ("energy used", energy_used(summary), of_the_robot("energy")),
        (
            "batteries",
            "empty" if summary["battery"]["empty"] else f"{100.0 * summary['battery']['charge']:.0f} %",
            None,
        ),
    )
    return [{"name": name, "value": value, "beside": real_robot} for name, value, real_robot in rows]


def energy_used(summary: dict) -> str:
    """Energy from the batteries since the robot was let go, and per kilometre, which can be compared."""
    used_Wh, km = summary["energy_Wh"]["total"], summary["distance_m"] / 1000.0
    return energy_text(used_Wh) + (f", {used_Wh / km:.2f} Wh/km" if km > 0.0 else "")


def since_release(summary: dict) -> str:
    """Duration of the walk: in hours, or in seconds below one hour."""
    hours: float = summary["walked_h"]
    return f"{hours:.1f} h" if hours >= 1.0 else f"{3600.0 * hours:.1f} s"


def contact(oddities: dict) -> list[dict]:
    """Tiles of the contact of feet and floor, next to the abilities of a real floor."""
    strikes = oddities["tensile_strikes"]
    rows = (
        ("contact", oddities["contact"], None),
        (
            "strikes that pull",
            figure(strikes, "{}") + (f" (to {oddities['tensile_impulse_min_Ns']:.2f} N s)" if strikes else ""),
            "a floor: none",
        ),
        ("lowest push of the floor", figure(oddities["normal_force_min_N"], "{:.1f} N"), "a floor: 0 N or more"),
        ("worst friction ratio", figure(oddities["friction_ratio_max"], "{:.2f}"), None),
        ("slides", f"{oddities['slides']} in {oddities['slip_s'] * 1e3:.0f} ms", None),
        ("touches, lift-offs", f"{oddities['touches']}, {oddities['lift_offs']}", None),
        ("lowest clearance of the swing foot", figure(clearance_mm(oddities), "{:.0f} mm"), None),
    )
    return [{"name": name, "value": value, "beside": real_robot} for name, value, real_robot in rows]


def clearance_mm(oddities: dict) -> float | None:
    """The least clearance in millimetres, if the walk had a swing."""
    metres = oddities["min_clearance_m"]
    return None if metres is None else 1e3 * metres


def energy_scale(largest_Wh: float) -> tuple[str, float, int]:
    """(unit, units per Wh, decimals) for a column: its largest energy has three digits."""
    unit, factor = ("Wh", 1.0) if largest_Wh >= 1.0 else ("mWh", 1e3)
    digits = math.floor(math.log10(largest_Wh * factor)) if largest_Wh > 0.0 else 0
    return unit, factor, max(0, 2 - digits)


def energy_text(energy_Wh: float) -> str:
    """An energy with three digits."""
    unit, factor, decimals = energy_scale(energy_Wh)
    return f"{energy_Wh * factor:.{decimals}f} {unit}"


def energy(summary: dict) -> dict:
    """The energy by consumer, in one unit."""
    total = summary["energy_Wh"]["total"]
    unit, factor, decimals = energy_scale(total)
    rows = [
        {
            "consumer": consumer.replace("_", " "),
            "energy": f"{value * factor:.{decimals}f}",
            "share": f"{100.0 * value / total if total else 0.0:.1f} %",
        }
        for consumer, value in summary["energy_Wh"].items()
    ]
    return {"unit": unit, "rows": rows, "delivered": energy_text(summary["battery"]["delivered_Wh"])}


def errors(robot: Any, summary: dict) -> dict[str, list[dict]]:
    """{heading: rows} of the errors that boards noted, first those that a healthy walk does not have."""
    beyond = normal_errors.beyond(RANGER, summary["errors"], summary["time_s"])
    found: dict[str, list[dict]] = {"Unexpected": [], "As in every healthy walk": []}
    for board, names in summary["errors"].items():
        for name, count in names.items():
            heading = "Unexpected" if name in beyond.get(board, {}) else "As in every healthy walk"
            row = {"board": board, "parts": name.split("_"), "meaning": robot.error_meaning(name), "count": count}
            found[heading].append(row)
    return {heading: rows for heading, rows in found.items() if rows}
