"""The charts of a walk's report as data: charts.js draws them, by the page's width and its light or dark colours.

All data with a time share one clock: seconds since power-up, of the last SHOWN_S seconds. The body's motion
is stored once, in `series`, and named where it is drawn, by charts and by the animation.
"""

import dataclasses
import math
from typing import Any

import numpy as np

from ranger_sim.plant.ranger import SAMPLES

SHOWN_S = (
    8.0  # six or seven strides: the part of a walk that is drawn and animated; chosen by us, for a page of 3 MB at most
)
STRAIGHT_M = 1e-3  # a path within this distance of a line counts as one

# Decimals kept of each unit: a tenth of the resolution of an encoder, a current sensor or an eye.
DECIMALS = {"rad": 4, "rad/s": 3, "m": 4, "A": 3, "W": 2, "V": 3, "%": 2, "mm": 2, "s": 4}
CURSOR_DECIMALS = {
    "rad": 3,
    "rad/s": 2,
    "m": 3,
    "A": 2,
    "W": 1,
    "V": 2,
    "%": 1,
    "mm": 0,
    "s": 3,
}  # and those at the cursor

# Samples of the body that neither charts nor animation use.
LEFT_OUT = {"motor_outer_rad_s", "motor_inner_rad_s", "outer_Fx_N", "outer_Fy_N", "inner_Fx_N", "inner_Fy_N"}
LEFT_OUT |= {"battery_A", "twist_rad", "yaw_rad", "path_y_m", "mode", "steps"}
SERIES = {name: unit for name, unit in SAMPLES.items() if name not in LEFT_OUT}
MACHINES = {"hip": "hip", "outer_foot": "outer foot", "inner_foot": "inner foot"}


@dataclasses.dataclass(frozen=True)
class Line:
    """One line or cloud of points. `x`, `y`: names of series, or separate arrays; `colour`: of the page's style."""

    name: str
    colour: str
    x: Any
    y: Any
    unit: str
    points: bool = False


@dataclasses.dataclass(frozen=True)
class Chart:
    """One pair of axes. `kind`: the quantity on x, which the cursor has too: time, plane, steps or slots."""

    key: str
    title: str
    kind: str
    x_title: str
    y_title: str
    lines: tuple[Line, ...] = ()
    machine: str | None = None  # whose states colour the background
    height: int = 200
    from_zero: bool = False


@dataclasses.dataclass(frozen=True)
class Group:
    """Charts under one heading. `columns`: side by side where the width allows."""

    title: str
    charts: tuple[Chart, ...]
    note: str = ""
    columns: bool = False


def over_time(key: str, title: str, quantity: str, unit: str, *lines: tuple, **more: Any) -> Chart:
    """A chart over time; lines as (name, colour, series or (x, y))."""
    made = []
    for name, colour, y in lines:
        x, y = y if isinstance(y, tuple) else ("time_s", y)
        made.append(Line(name, colour, x, y, unit))
    return Chart(key, title, "time", "time since power-up (s)", f"{quantity} ({unit})", tuple(made), **more)


def groups(walk: Any) -> list[Group]:
    """All charts of a walk, a `ranger.records.recorded.Recorded`."""
    found = [phase_portraits(), joint_angles(), currents_and_power(), steps(walk), bus_load(walk), slot_times(walk)]
    return [*found, *path(walk)]


def phase_portraits() -> Group:
    """Angle against rate of both legs and the hip, as the body truly moved."""
    return Group(
        "Phase portraits",
        tuple(
            Chart(
                f"phase-{key}",
                title,
                "plane",
                f"{quantity} (rad)",
                f"{quantity} rate (rad/s)",
                (Line(title, key, angle, rate, "rad/s"),),
                height=280,
            )
            for key, title, quantity, angle, rate in (
                ("outer", "outer legs", "angle", "leg_outer_rad", "leg_outer_rad_s"),
                ("inner", "inner legs", "angle", "leg_inner_rad", "leg_inner_rad_s"),
                ("hip", "hip (inner relative to outer)", "hip angle", "hip_rad", "hip_rad_s"),
            )
        ),
        "A closed loop is a periodic gait; its width is the scatter of the steps.",
        columns=True,
    )


def joint_angles() -> Group:
    """Hip and ankle angles, with the states of their machines behind them."""
    return Group(
        "Joint angles and the states of their machines",
        (
            over_time("hip-angle", "hip", "hip angle", "rad", ("hip", "hip", "hip_rad"), machine="hip"),
            over_time(
                "outer-ankle",
                "outer ankle",
                "ankle angle",
                "rad",
                ("joint", "outer", "ankle_outer_rad"),
                ("motor", "outer-light", "motor_outer_rad"),
                machine="outer_foot",
            ),
            over_time(
                "inner-ankle",
                "inner ankle",
                "ankle angle",
                "rad",
                ("joint", "inner", "ankle_inner_rad"),
                ("motor", "inner-light", "motor_inner_rad"),
                machine="inner_foot",
            ),
        ),
        "Colours behind the lines: the states of the hip's and the feet's machines in the main brain.",
    )


def currents_and_power() -> Group:
    """Motor currents, the power each motor draws from the battery, and the battery's voltage."""
    motors = (("hip", "hip"), ("outer", "outer"), ("inner", "inner"), ("steering", "steering"))
    return Group(
        "Currents and power",
        (
            over_time("current", "motor currents", "current", "A", *((n, c, f"{n}_A") for n, c in motors)),
            over_time("power", "power from the battery", "power", "W", *((n, c, f"{n}_W") for n, c in motors)),
            over_time("voltage", "battery voltage", "voltage", "V", ("battery", "ink", "battery_V"), height=160),
        ),
    )


def steps(walk: Any) -> Group:
    """Length and time of every step."""
    number, length, seconds, outer = walk.steps
    sides = (("onto the outer feet", "outer", outer), ("onto the inner feet", "inner", ~outer))
    return Group(
        "Steps",
        tuple(
            Chart(
                f"step-{name}",
                f"{name} of each step",
                "steps",
                "step (number)",
                f"step {name} ({unit})",
                tuple(
                    Line(side, colour, number[mask].tolist(), rounded(values[mask], unit), unit, points=True)
                    for side, colour, mask in sides
                ),
                from_zero=True,
            )
            for name, unit, values in (("length", "m", length), ("time", "s", seconds))
        ),
    )


def bus_load(walk: Any) -> Group:
    """Share of the time each bus was busy, in windows of 10 ms."""
    shown = []
    begin = shown_from(walk)
    for number, (name, (time, load)) in enumerate(walk.bus_load.items(), start=1):
        keep = time >= begin
        shown.append((name, f"bus-{number}", (rounded(time[keep], "s"), rounded(100.0 * load[keep], "%"))))
    chart = over_time("bus-load", "load in windows of 10 ms", "share of the bit rate", "%", *shown, from_zero=True)
    return Group("Load of the four CAN buses", (chart,), "With stuff bits and intermission.")


def slot_times(walk: Any) -> Group:
    """The time used of each board's slots, as a share of their length."""
    boards = list(walk.slot_histograms)
    percent = walk.slot_histograms[boards[0]][0]
    shares = [100.0 * counts / max(1, counts.sum()) for _, counts in walk.slot_histograms.values()]
    lines = tuple(
        Line(board, "ink", (percent + 2.5).tolist(), [float(f"{share:.3g}") for share in row], "%")
        for board, row in zip(boards, shares, strict=True)
    )
    return Group(
        "Slot times",
        (
            Chart(
                "slots",
                "how much of its slots each board used",
                "slots",
                "time used, interrupts included (% of the slot)",
                "board",
                lines,
                height=320,
            ),
        ),
        "Numbers: % of the board's slots. Right of the dashed line a slot has overrun.",
    )


def path(walk: Any) -> list[Group]:
    """The walk seen from above; none for a straight one."""
    first = begin_of(walk)
    aside = walk.samples["path_y_m"][first:]
    if not len(aside) or float(np.ptp(aside)) < STRAIGHT_M:
        return []
    line = Line("sideways", "ink", "path_x_m", rounded(1e3 * aside, "mm"), "mm")
    chart = Chart("path", "seen from above", "plane", "distance forward (m)", "sideways (mm)", (line,), height=260)
    return [Group("Path in the plane", (chart,), "Not to scale: millimetres over metres.")]


def shown_from(walk: Any) -> float:
    """The first time that is shown, s since power-up."""
    return float(walk.samples["time_s"][-1]) - SHOWN_S


def begin_of(walk: Any) -> int:
    """Index of the first sample that is shown."""
    return int(np.searchsorted(walk.samples["time_s"], shown_from(walk)))


def rounded(values: Any, unit: str) -> list[float | None]:
    """The numbers with the decimals of their unit; anything but a number becomes a gap."""
    return [each if math.isfinite(each) else None for each in np.round(values, DECIMALS[unit]).tolist()]


def data(robot: Any, walk: Any, drawn: list[Group]) -> dict:
    """The data for charts.js and stage.js; charts.js describes the fields."""
    first = begin_of(walk)
    series = {name: rounded(walk.samples[name][first:], unit) for name, unit in SERIES.items()}
    series["time_s"] = rounded(walk.samples["time_s"][first:], "s")
    return {
        "series": series,
        "steps": walk.samples["steps"][first:].astype(int).tolist(),
        "states": {machine: states(walk, machine, shown_from(walk)) for machine in MACHINES},
        "charts": [dataclasses.asdict(chart) for group in drawn for chart in group.charts],
        "decimals": CURSOR_DECIMALS,
        "geometry": robot.plant.geometry(),
        "footholds": walk.footholds,
    }


def states(walk: Any, machine: str, begin_s: float) -> dict:
    """{names: of the states that occurred, by number; runs: [[since s, number], ...]} of one machine."""
    time, numbers, names = walk.machine_states(machine)
    first = int(np.searchsorted(time, begin_s))
    time, numbers = time[first:], numbers[first:]
    changed = [at == 0 or numbers[at] != numbers[at - 1] for at in range(len(numbers))]
    starts = np.flatnonzero(changed)
    runs = [[round(float(time[at]), DECIMALS["s"]), int(numbers[at])] for at in starts]
    return {
        "names": {number: names.get(number, str(number)) for _, number in sorted(runs, key=lambda run: run[1])},
        "runs": runs,
    }
