"""The page of `ranger-sim identify`: what was found, and the appendix's figures 28, 29, 31 for these data."""

import pathlib
from typing import Any

import jinja2
import numpy as np
import plotly.graph_objects as go

from ranger_sim.sysid.dataset import Dataset
from ranger_sim.sysid.fit import Fit
from ranger_sim.sysid.identification import legs, motor
from ranger_sim.tools.report.figures import HIP, INK, INNER, OUTER, Figure, finished, library

HERE = pathlib.Path(__file__).parent
COLOURS = (OUTER, "#5aa1d8", "#8a6fb5", "#5b6875", "#2c7a4b", "#d9731a", "#b3261e")
LEAST_SPEED = 0.05  # rad/s, where a curve of figure 31 begins on either side of rest


def render(told: dict[str, Any], recordings: dict[str, Dataset], fits: dict[str, Fit], gear: float) -> str:
    """The page as text. told: of the command; recordings by bench; fits by title; gear: of the motor's bench."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(HERE),
        autoescape=jinja2.select_autoescape(["j2"]),
        undefined=jinja2.StrictUndefined,
    )
    figures = drawn(recordings, found_values(fits), gear)
    return environment.get_template("template.html.j2").render(
        told=told, figures=figures, library=library(), recordings=list(recordings)
    )


def found_values(fits: dict[str, Fit]) -> dict[str, float]:
    """The values that the figures use: later fits before earlier ones, joint fits stand last."""
    values: dict[str, float] = {}
    for found in fits.values():
        values |= found.values
    if "C_0" not in values and "C_0d" in values:
        values |= {"C_0": values["C_0d"], "mu": values["mu_d"]}
    return values


def drawn(recordings: dict[str, Dataset], v: dict[str, float], gear: float) -> list[Figure]:
    """Every figure for which there are a recording and values."""
    made = []
    if "stall" in recordings and {"R", "V_c"} <= v.keys():
        made.append(stall(recordings["stall"], v))
    if "cantilever" in recordings and {"R", "V_c", "K"} <= v.keys():
        made.append(torque_constant(recordings["cantilever"], v, gear))
        if {"C_1", "C_0", "mu"} <= v.keys():
            made.append(friction_check(recordings["cantilever"], v, gear))
    if "pendulum" in recordings:
        made.append(swings(recordings["pendulum"]))
    if "ankle-sine" in recordings:
        made.append(ankle(recordings["ankle-sine"]))
    for bench, name in (("hip-spring", "k_h"), ("ankle-spring", "k_s")):
        if bench in recordings and name in v:
            made.append(pulls(bench, name, recordings[bench], v[name]))
    return made


def dots(x: Any, y: Any, name: str, colour: str) -> go.Scatter:
    """Measured points."""
    return go.Scatter(x=x, y=y, mode="markers", name=name, marker={"color": colour, "size": 6})


def line(x: Any, y: Any, name: str, colour: str, **how: Any) -> go.Scatter:
    """The model's curve."""
    return go.Scatter(x=x, y=y, mode="lines", name=name, line={"color": colour, "width": 1.5}, **how)


def stall(data: Dataset, v: dict[str, float]) -> Figure:
    """Figure 28: voltage over current of the held motor."""
    current = data["current_A"].value
    figure = go.Figure(dots(current, data["voltage_V"].value, "measured", OUTER))
    most = 1.05 * float(np.max(np.abs(current)))
    for sign in (-1.0, 1.0):
        x = np.array([0.0, sign * most])
        figure.add_trace(line(x, v["R"] * x + sign * v["V_c"], "R I + V_c sgn I", INK, showlegend=sign > 0))
    figure.update_xaxes(title_text="current, A").update_yaxes(title_text="voltage, V")
    note = f"Slope {v['R']:.4g} ohm, intercept {v['V_c']:.4g} V (appendix, figure 28: 1.3 ohm, 0.7 V)."
    return finished(figure, "Figure 28: contact voltage and terminal resistance", note)


def torque_constant(data: Dataset, v: dict[str, float], gear: float) -> Figure:
    """Figure 29: what the resistance and the contacts leave of the voltage, over the rotor's speed."""
    current, speed = data["current_A"].value, gear * data["speed_rad_per_s"].value
    left = data["voltage_V"].value - v["R"] * current - v["V_c"] * np.sign(current)
    flows = np.abs(current) > motor.SURE_CURRENT_A
    figure = go.Figure(dots(speed[flows], left[flows], "measured", OUTER))
    ends = np.array([float(np.min(speed)), float(np.max(speed))])
    figure.add_trace(line(ends, v["K"] * ends, "K G w", INK))
    figure.update_xaxes(title_text="speed of the rotor, rad/s")
    figure.update_yaxes(title_text="V - R I - V_c sgn I, V")
    note = f"Slope {v['K']:.5g} V s/rad (appendix, figure 29: 0.018). Readings without a sure current are left out."
    return finished(figure, "Figure 29: torque constant", note)


def model_torque(voltage: float, speed: Any, v: dict[str, float], gear: float) -> Any:
    """Eq. 32, 33, 35 at steady speed: torque at the output; between the contact drops no current flows."""
    back = voltage - gear * v["K"] * speed
    current = np.sign(back) * np.maximum(np.abs(back) - v["V_c"], 0.0) / v["R"]
    GKI = gear * v["K"] * current
    return GKI - (v["mu"] * np.abs(GKI) + v["C_0"]) * np.sign(speed) - v["C_1"] * speed


def friction_check(data: Dataset, v: dict[str, float], gear: float) -> Figure:
    """Figure 31: torque over speed for every voltage, with the curves of the model."""
    voltage, speed, torque = (data[name].value for name in ("voltage_V", "speed_rad_per_s", "torque_Nm"))
    figure = go.Figure()
    levels = np.unique(np.round(voltage * 2.0) / 2.0)  # to half a volt
    for number, level in enumerate(levels):
        colour = COLOURS[number % len(COLOURS)]
        here = np.abs(voltage - level) <= 0.25
        figure.add_trace(dots(speed[here], torque[here], f"{level:g} V", colour))
        low, high = float(np.min(speed[here])), float(np.max(speed[here]))
        for begin, end in ((low, min(high, -LEAST_SPEED)), (max(low, LEAST_SPEED), high)):
            if end > begin:
                x = np.linspace(begin, end, 200)
                mean = float(np.mean(voltage[here]))
                figure.add_trace(line(x, model_torque(mean, x, v, gear), f"{level:g} V", colour, showlegend=False))
    figure.update_xaxes(title_text="output speed, rad/s").update_yaxes(title_text="output torque, N m")
    at = motor.turning(data)
    GKI = gear * v["K"] * at.current_A
    friction = (v["mu"] * np.abs(GKI) + v["C_0"]) * np.sign(at.speed_rad_s) + v["C_1"] * at.speed_rad_s
    rms = float(np.sqrt(np.mean((at.torque_Nm - GKI + friction) ** 2)))
    note = (
        f"Dots measured, curves by the parameters found; they differ by {1e3 * rms:.2g} mN m rms. Jumps at rest are "
        "the friction's, those near zero torque the contact drop's (appendix, figure 31)."
    )
    return finished(figure, "Figure 31: the friction model against the cantilever bench", note, height=520)


def swings(data: Dataset) -> Figure:
    """Both legs' swings over time."""
    figure = go.Figure()
    for swing, colour in zip(legs.swings(data), (OUTER, INNER), strict=False):
        figure.add_trace(line(swing.time_s, swing.angle_rad, f"{swing.leg} leg", colour))
    figure.update_xaxes(title_text="time, s").update_yaxes(title_text="angle, rad")
    return finished(figure, "Swinging legs", "Free swings at the clamped hip; their period gives J (eq. 29, 30).")


def ankle(data: Dataset) -> Figure:
    """Target, motor and joint of the ankle over time."""
    figure = go.Figure()
    for name, label, colour in (
        ("target_angle_rad", "target", INK),
        ("motor_angle_rad", "motor", OUTER),
        ("joint_angle_rad", "joint", INNER),
    ):
        figure.add_trace(line(data[name].time_s, data[name].value, label, colour))
    figure.update_xaxes(title_text="time, s").update_yaxes(title_text="angle, rad")
    return finished(figure, "Ankle on its sine", "Joint and motor differ by the stretch of the cable.")


def pulls(bench: str, name: str, data: Dataset, stiffness: float) -> Figure:
    """Force over angle of a spring's pull."""
    angle = data["angle_rad"].value
    side = data["side"].value
    out = data["outward"].value > 0.0 if "outward" in data else np.ones(len(angle), dtype=bool)
    figure = go.Figure(dots(angle[out], (side * data["force_N"].value)[out], "pulled out", HIP))
    if not np.all(out):
        figure.add_trace(dots(angle[~out], (side * data["force_N"].value)[~out], "let back in", INNER))
    figure.update_xaxes(title_text="angle, rad").update_yaxes(title_text="force, N")
    return finished(figure, f"{bench}: pulls", f"{name} {stiffness:.4g} N m/rad.")
