"""Puts a walk's numbers, plots and animation into one self-contained page."""

import json
import pathlib
from typing import Any

import jinja2
import numpy as np
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from ranger_sim import datatable
from ranger_sim.tools.faults import fault_text
from ranger_sim.tools.report import figures
from ranger_sim.tools.units import figure

HERE = pathlib.Path(__file__).parent
ANIMATION_HZ = 125  # frames kept per second: smooth at one eighth of real time on a 60 Hz screen
ANIMATION_S = 8.0

# What the robot itself did on 1-2 May 2011 (appendix 1, table of the ultra-marathon walk).
ROBOT = {
    "step": "0.35 m",
    "time": "0.60 s",
    "speed": "0.59 m/s",
    "motors": "11.3 W",
    "total": "16 W",
    "tcot": "0.28",
    "delay": "14 ± 3 ms",
    "walked": "65.2 km in 30.8 h",
    "energy": "493 Wh in 30.8 h",
}


def render(robot: Any, summary: dict) -> str:
    """The page as text. `robot`: a `harness.ranger.Ranger` that kept a log; `summary`: its summary."""
    walk = robot.recorded()
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(HERE),
        autoescape=jinja2.select_autoescape(["j2"]),
        undefined=jinja2.StrictUndefined,
    )
    plots = [
        make(walk)
        for make in (
            figures.phase_portraits,
            figures.joint_angles,
            figures.currents_and_power,
            figures.steps,
            figures.bus_load,
            figures.slot_times,
            figures.path,
        )
    ]
    for plot in plots:
        plot.html = Markup(plot.html)
    return environment.get_template("template.html.j2").render(
        summary=summary,
        shown_s=float(walk.samples["time_s"][-1] - walk.samples["time_s"][0]),
        tiles=tiles(summary),
        figures=plots,
        error_rows=[
            {"board": board, "name": name, "meaning": robot.error_meaning(name), "count": count}
            for board, names in summary["errors"].items()
            for name, count in names.items()
        ],
        fault_lines=[fault_text(fault) for fault in summary["faults"]],
        animation=Markup(json.dumps(animation(robot, walk), allow_nan=False).replace("</", "<\\/")),
        walker_js=Markup((HERE / "walker.js").read_text(encoding="utf-8")),
        plotly_js=Markup(get_plotlyjs()),
        command=summary["command"],
        table_hash=datatable.table_hash(),
    )


def of_the_robot(what: str) -> str:
    """What was measured on the real robot, as it stands beside a figure."""
    return f"the robot: {ROBOT[what]}"


def tiles(summary: dict) -> list[dict]:
    """The key figures, beside the real robot's or what a real floor can do."""
    delay = summary["heel_strike_delay_ms"]
    rows = (
        ("steps", f"{summary['steps']}", None),
        ("mean step length", figure(summary["mean_step_length_m"], "{:.3f} m"), of_the_robot("step")),
        ("mean step time", figure(summary["mean_step_time_s"], "{:.3f} s"), of_the_robot("time")),
        ("speed", figure(summary["speed_m_per_s"], "{:.2f} m/s"), of_the_robot("speed")),
        ("motors", figure(summary["motor_power_W"], "{:.1f} W"), of_the_robot("motors")),
        ("in all", figure(summary["total_power_W"], "{:.1f} W"), of_the_robot("total")),
        (
            "cost of transport",
            figure(summary["tcot"], "{:.3f}"),
            of_the_robot("tcot"),
        ),
        (
            "heel-strike delay",
            "none" if delay["mean"] is None else f"{delay['mean']:.1f} ± {delay['std']:.1f} ms",
            of_the_robot("delay"),
        ),
        (
            "walked",
            f"{summary['distance_m'] / 1000.0:.3f} km in {summary['walked_h']:.2f} h",
            of_the_robot("walked"),
        ),
        ("energy used", f"{summary['energy_Wh']['total']:.3g} Wh", of_the_robot("energy")),
        *odd(summary["oddities"]),
        (
            "batteries",
            "empty" if summary["battery"]["empty"] else f"{100.0 * summary['battery']['charge']:.0f} %",
            None,
        ),
    )
    return [{"name": name, "value": value, "beside": beside} for name, value, beside in rows]


def odd(oddities: dict) -> tuple:
    """Tiles of what the contact of feet and floor did that a real floor could not, or that a walk should not need."""

    strikes = oddities["tensile_strikes"]
    return (
        ("contact", oddities["contact"], None),
        (
            "strikes that pull",
            figure(strikes, "{}") + (f" (to {oddities['tensile_impulse_min_Ns']:.2f} N s)" if strikes else ""),
            "a floor: none",
        ),
        ("lowest push of the floor", figure(oddities["normal_force_min_N"], "{:.1f} N"), "a floor: 0 N or more"),
        ("worst friction ratio", figure(oddities["friction_ratio_max"], "{:.2f}"), None),
        ("slides", f"{oddities['slides']} in {oddities['slip_s'] * 1e3:.1f} ms", None),
        ("touches, lift-offs", f"{oddities['touches']}, {oddities['lift_offs']}", None),
    )


def animation(robot: Any, walk: Any) -> dict:
    """Arrays for walker.js, thinned to ANIMATION_HZ over the last ANIMATION_S seconds."""
    s = walk.samples
    time = s["time_s"]
    first = np.searchsorted(time, time[-1] - ANIMATION_S)
    interval = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
    pick = slice(first, None, max(1, round(1 / (ANIMATION_HZ * interval))))
    names = {
        "hip_x": "hip_x_m",
        "hip_y": "hip_y_m",
        "foot_outer": "foot_outer_rad",
        "leg_outer": "leg_outer_rad",
        "leg_inner": "leg_inner_rad",
        "foot_inner": "foot_inner_rad",
        "hip_A": "hip_A",
        "outer_A": "outer_A",
        "inner_A": "inner_A",
    }
    data = {key: np.round(s[name][pick], 5).tolist() for key, name in names.items()}
    data["t"] = np.round(time[pick], 4).tolist()
    data["state"] = walk.state_text(time[pick])
    data["geometry"] = robot.plant.geometry()
    data["footholds"] = walk.footholds
    return data
