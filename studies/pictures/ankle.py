"""Prints the tables of docs/ankle-measured.md and draws docs/ankle-measured.svg, from the robot's own logs.

RANGER_SIM_DATA=folder python -m studies.pictures.ankle       # the folder with ranger_ankle_sine_slow.csv and the rest
"""

import os
import pathlib

import numpy as np
from scipy.signal import butter, filtfilt

from ranger_sim.sysid.channels import named_for
from ranger_sim.sysid.machines.ankle import Ankle, Prediction, predicted
from ranger_sim.sysid.reading import open_recording

ROOT = pathlib.Path(__file__).resolve().parents[2]
DATA = pathlib.Path(os.environ.get("RANGER_SIM_DATA", ROOT.parent / "shared" / "data"))
FIGURE = ROOT / "docs" / "ankle-measured.svg"
FORMS = {"base": None, "square": {"square": lambda m: -(m.a**2)}, "cube": {"cube": lambda m: -(m.a**3)}}
INK, SOFT, LINE, RED, BLUE, GREEN = "#24292f", "#667085", "#e3e6ec", "#c8452f", "#2460a7", "#2e7d4f"
COLOURS = {"base": RED, "square": BLUE, "cube": GREEN}
WIDTH, HEIGHT = 1160, 400


def recording(name):
    data = named_for(open_recording(DATA / f"ranger_{name}.csv"), "ankle")
    return data.table([each.name for each in Ankle.quantities if each.name in data])


def halves(table):
    middle = int(np.searchsorted(table.time_s, 0.5 * (table.time_s[0] + table.time_s[-1])))
    return table.part(slice(0, middle)), table.part(slice(middle, None))


def by_current(table, cutoff_hz):
    """NRMSE of the current that the joint's angle would have drawn, I_0 - K a - D a', on the second half: by form."""
    step_s = table.step_s
    b, a = butter(2, 2.0 * cutoff_hz * step_s)
    q = filtfilt(b, a, table["joint_angle_rad"])
    v = np.gradient(q, step_s)
    command = table["command_current_A"] - table["command_stiffness_A_per_rad"] * table["joint_angle_rad"]
    current = filtfilt(b, a, command - table["command_dampness_A_s_per_rad"] * v)
    train = np.arange(len(q)) < 0.5 * len(q)
    found = {}
    for form, power in (("base", 0), ("square", 2), ("cube", 3)):
        columns = [q, np.ones_like(q), np.tanh(v / 0.05), v, np.gradient(v, step_s)] + ([q**power] if power else [])
        matrix = np.column_stack(columns)
        values = np.linalg.lstsq(matrix[train], current[train], rcond=None)[0]
        missed = current[~train] - matrix[~train] @ values
        found[form] = float(np.sqrt(np.mean(missed**2)) / np.std(current[~train]))
    return found


def between(table):
    """Joint's angle less the motor's over the joint's, by direction."""
    a, p = table["joint_angle_rad"], table["motor_angle_rad"]
    up = table["target_rate_rad_per_s"] > 0.0
    print("run 1, joint less motor in mrad, upward and downward:")
    for least in np.arange(0.3, 1.85, 0.25):
        inside = (a >= least) & (a < least + 0.1)
        means = [1e3 * float(np.mean((a - p)[inside & way])) for way in (up, ~up)]
        print(f"  {least:.2f} to {least + 0.1:.2f} rad: {means[0]:.1f}, {means[1]:.1f}")


def panel(x0, title, across, curves, dots, low, high):
    """One diagram: curves and dots are {form or 'measured': (x, y in mrad)}; across: (label, least, most, marks)."""
    label, least, most, marks = across
    left, right, top, bottom = x0 + 62, x0 + 560, 56, 340

    def place(x, y):
        return left + (x - least) / (most - least) * (right - left), bottom - (y - low) / (high - low) * (bottom - top)

    out = [f'<text x="{left}" y="32" font-size="15" fill="{INK}">{title}</text>']
    for y in range(int(low), int(high) + 1, 20 if high - low > 60 else 10):
        at = place(least, y)[1]
        out.append(f'<line x1="{left}" x2="{right}" y1="{at:.1f}" y2="{at:.1f}" stroke="{LINE}"/>')
        out.append(f'<text x="{left - 8}" y="{at + 4:.1f}" font-size="12" fill="{SOFT}" text-anchor="end">{y}</text>')
    for mark in marks:
        at = place(mark, low)[0]
        out.append(
            f'<text x="{at:.1f}" y="{bottom + 18}" font-size="12" fill="{SOFT}" text-anchor="middle">{mark:g}</text>'
        )
    middle = 0.5 * (left + right)
    out.append(f'<text x="{middle}" y="{bottom + 38}" font-size="13" fill="{SOFT}" text-anchor="middle">{label}</text>')
    out.append(f'<text x="{x0 + 14}" y="48" font-size="12" fill="{SOFT}">mrad</text>')
    for colour, x, y in curves:
        points = " ".join("{:.1f},{:.1f}".format(*place(a, b)) for a, b in zip(x, y, strict=True))
        out.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.6"/>')
    for colour, x, y in dots:
        for a, b in zip(x, y, strict=True):
            at = place(a, b)
            out.append(f'<circle cx="{at[0]:.1f}" cy="{at[1]:.1f}" r="1.6" fill="{colour}"/>')
    return out


def figure(found: dict[str, Prediction]):
    """What the law leaves to explain, measured and simulated over time; what the simulation misses, over the angle."""
    some = slice(None, None, 10)
    measured = found["base"]
    t, law = measured.time_s[some], measured.law_rad[some]
    curves = [(INK, t, 1e3 * (measured.angle[some] - law))]
    curves += [(COLOURS[form], t, 1e3 * (found[form].simulated[some] - law)) for form in ("base", "square")]
    dots = [
        (COLOURS[form], found[form].angle[some], 1e3 * (found[form].angle - found[form].simulated)[some])
        for form in ("base", "square")
    ]
    over_time = ("s", 10, 21, range(10, 22, 2))
    over_angle = ("joint angle, rad", 0.2, 2.4, (0.4, 0.8, 1.2, 1.6, 2.0, 2.4))
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
        *panel(0, "Joint angle less what the law alone would hold", over_time, curves, [], -100, 40),
        *panel(580, "What the simulation misses", over_angle, [], dots, -20, 20),
    ]
    for number, (colour, text) in enumerate(
        ((INK, "measured"), (RED, "simulated before: linear spring"), (BLUE, "simulated after: with the square"))
    ):
        x = 70 + 250 * number
        out.append(f'<line x1="{x}" x2="{x + 26}" y1="390" y2="390" stroke="{colour}" stroke-width="3"/>')
        out.append(f'<text x="{x + 34}" y="394" font-size="12" fill="{INK}">{text}</text>')
    FIGURE.write_text("\n".join([*out, "</svg>", ""]), encoding="utf-8")


def main():
    slow = recording("ankle_sine_slow")
    print("current of the joint's angle, second half of the slow run:")
    for cutoff_hz in (2.0, 5.0, 10.0):
        print(
            f"  low pass {cutoff_hz:g} Hz: " + ", ".join(f"{k} {v:.1%}" for k, v in by_current(slow, cutoff_hz).items())
        )
    for name in ("slow", "fast"):
        train, held = halves(recording(f"ankle_sine_{name}"))
        found = {}
        for form, extra in FORMS.items():
            values, (found[form],) = predicted(train, held, extra)
            said = ", ".join(f"{key} {value:.4g}" for key, value in values.items())
            print(f"{name}, {form}: held out {1e3 * found[form].rms:.2f} mrad, NRMSE {found[form].nrmse:.1%}; {said}")
        if name == "slow":
            figure(found)
    runs = [recording(f"foot_inertia_{number}") for number in range(1, 6)]
    between(runs[0])
    for of_program in (False, True):
        print("law of the robot's program:" if of_program else "law as given, K (target - p) + D (target' - p'):")
        for number, run in enumerate(runs[:3], 1):
            values, parts = predicted(run, run, None, of_program)
            said = ", ".join(f"{key} {value:.4g}" for key, value in values.items())
            print(f"  run {number}: " + ", ".join(f"{p.channel} {1e3 * p.rms:.1f} mrad {p.nrmse:.0%}" for p in parts))
            print(f"    {said}")
        for number in (4, 5):
            _, parts = predicted(runs[2], runs[number - 1], None, of_program)
            said = ", ".join(f"{p.channel} {1e3 * p.rms:.1f} mrad {p.nrmse:.0%}" for p in parts)
            print(f"  run {number} predicted with the values of run 3: {said}")


if __name__ == "__main__":
    main()
