"""Draws docs/mujoco-lag.svg out of docs/mujoco_lag.json: an arm's actuator with a lag, and the lag that was found.

    python -m studies.pictures.mujoco_lag             # draw again
    python -m studies.pictures.mujoco_lag --record    # the commands of docs/how-to/mujoco.md first: some minutes

The arm, the commands and the seeds are those of the page. The same JSON gives the same bytes.
"""

import csv
import json
import pathlib
import re
import subprocess
import sys
import tempfile

from studies.pictures.svg import BLUE, GREY, RED, figure, line, place, text

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "how-to" / "mujoco.md"
KEPT = ROOT / "docs" / "mujoco_lag.json"
FIGURE = ROOT / "docs" / "mujoco-lag.svg"
PALE = "#7a8494"
LAGS_MS = (0, 2, 5, 10, 20)  # hidden
SHOWN_MS = {0: PALE, 10: BLUE, 20: RED}  # whose first moments are drawn, and in which colour
FIRST_S = 0.4
WIDTH, HEIGHT, TOP, BOTTOM = 860, 330, 50, 270
LEFT, RIGHT = (70, 460), (570, 830)  # the two plots


def record() -> dict:
    """What the page's commands give for each lag."""
    (robot,) = re.findall(r"```xml\n<!-- robot.xml -->\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    rows = []
    with tempfile.TemporaryDirectory() as base:
        pathlib.Path(base, "robot.xml").write_text(robot, encoding="utf-8")
        run(base, "-m", "ranger_sim", "new", "my-robot", "--plant", "mujoco", "robot.xml")
        project = pathlib.Path(base, "my-robot")
        for lag_ms in LAGS_MS:
            for seed, day in ((1, "monday"), (2, "tuesday")):
                lag = ["--seed", str(seed), "--lag", str(lag_ms * 1e-3)]
                run(project, "record.py", "SHOULDER", f"{day}.csv", *lag)
            found = ["diagnose", "monday.csv", "--holdout", "tuesday.csv", "--experiment", "experiment:SHOULDER"]
            run(project, "-m", "ranger_sim", *found, "--out", f"found{lag_ms}", codes=(0, 1))
            answer = json.loads((project / f"found{lag_ms}" / "diagnosis.json").read_text(encoding="utf-8"))
            rows.append({"hidden_ms": lag_ms, **found_in(answer), **beginning(project / "monday.csv")})
            print(lag_ms, rows[-1]["named"], rows[-1].get("found_ms"))
    return {"rows": rows}


def run(folder, *command, codes=(0,)) -> None:
    """A command of ours, in a folder."""
    result = subprocess.run([sys.executable, *command], cwd=folder, capture_output=True, text=True, check=False)
    if result.returncode not in codes:
        raise SystemExit(f"{' '.join(command)}: {result.returncode}\n{result.stdout}{result.stderr}")


def found_in(answer: dict) -> dict:
    """The first cause of a diagnosis, and the lag with its interval, in ms."""
    if not answer["causes"]:
        return {"named": ""}
    first = answer["causes"][0]
    lag = first["parameters"].get("lag_s")
    found = {"named": f"{first['name']} at {first['at']}"}
    if lag is None:
        return found
    return found | {
        "found_ms": round(lag["value"] * 1e3, 3),
        "ci95_ms": [round(end * 1e3, 3) for end in lag["ci95"]],
    }


def beginning(recording: pathlib.Path) -> dict:
    """The first moments of a recording: the joint's angle in degrees, every 4 ms."""
    with recording.open(encoding="utf-8", newline="") as file:
        rows = [(float(row["t_s"]), float(row["shoulder_rad"])) for row in csv.DictReader(file)]
    return {"angle_deg": [round(angle * 57.29578, 2) for time, angle in rows if time <= FIRST_S][::2]}


# ---- the figure


def movement(rows: list[dict]) -> list[str]:
    """The joint's angle after the beginning, for some lags."""
    shown = [row for row in rows if row["hidden_ms"] in SHOWN_MS]
    angles = [angle for row in shown for angle in row["angle_deg"]]
    limits = (float(int(min(angles) // 1)), float(int(max(angles) // 1 + 1)))
    parts = [text(LEFT[0], 26, "The shoulder follows its target, degrees", size=15)]
    for tick in range(int(limits[0]), int(limits[1]) + 1):
        y = place(tick, limits, (BOTTOM, TOP))
        parts += [line(LEFT[0], y, LEFT[1], y), text(LEFT[0] - 8, y + 4, f"{tick:g}", "end")]
    for tick in (0.0, 0.1, 0.2, 0.3, 0.4):
        x = place(tick, (0.0, FIRST_S), LEFT)
        parts.append(text(x, BOTTOM + 18, f"{tick:g} s", "middle"))
    for number, row in enumerate(shown):
        colour = SHOWN_MS[row["hidden_ms"]]
        points = " ".join(
            f"{place(0.004 * k, (0.0, FIRST_S), LEFT):g},{place(angle, limits, (BOTTOM, TOP)):g}"
            for k, angle in enumerate(row["angle_deg"])
        )
        parts.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2"/>')
        words = f"lag {row['hidden_ms']} ms" if row["hidden_ms"] else "no lag"
        x = LEFT[0] + 40 + 120 * number
        parts += [line(x - 28, BOTTOM + 41, x - 6, BOTTOM + 41, colour, 2.0), text(x, BOTTOM + 46, words)]
    return parts


def answers(rows: list[dict]) -> list[str]:
    """The lag that the diagnosis found against the one that was hidden."""
    limits, ends = (0.0, 22.0), (BOTTOM, TOP)
    parts = [text(RIGHT[0], 26, "Found by the diagnosis, ms", size=15)]
    for tick in (0, 5, 10, 15, 20):
        x, y = place(tick, limits, RIGHT), place(tick, limits, ends)
        parts += [line(RIGHT[0], y, RIGHT[1], y), text(RIGHT[0] - 8, y + 4, f"{tick}", "end")]
        parts.append(text(x, BOTTOM + 18, f"{tick}", "middle"))
    parts.append(line(RIGHT[0], BOTTOM, RIGHT[1], TOP, GREY, 1.5, ' stroke-dasharray="4 3"'))
    for row in rows:
        x = place(row["hidden_ms"], limits, RIGHT)
        if "found_ms" not in row:
            parts.append(text(RIGHT[1], BOTTOM - 8, "nothing hidden: nothing found", "end", 12))
            parts.append(f'<circle cx="{x:g}" cy="{BOTTOM:g}" r="5" fill="white" stroke="{BLUE}" stroke-width="2"/>')
            continue
        parts.append(f'<circle cx="{x:g}" cy="{place(row["found_ms"], limits, ends):g}" r="5" fill="{BLUE}"/>')
    parts.append(text((RIGHT[0] + RIGHT[1]) / 2, BOTTOM + 46, "hidden, ms", "middle"))
    return parts


def drawn() -> str:
    """The figure as SVG."""
    rows = json.loads(KEPT.read_text(encoding="utf-8"))["rows"]
    return figure(WIDTH, HEIGHT, [*movement(rows), *answers(rows)])


def main() -> int:
    if "--record" in sys.argv[1:]:
        KEPT.write_text(json.dumps(record(), indent=1) + "\n", encoding="utf-8")
    FIGURE.write_text(drawn(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
