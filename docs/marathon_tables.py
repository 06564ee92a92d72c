"""Prints the tables of docs/marathon.md out of the summary of the walk that is kept in benchmarks/.

    python docs/marathon_tables.py

A test compares them with the page.
"""

import json
import pathlib

ROOT = pathlib.Path(__file__).resolve().parent.parent
KEPT = ROOT / "benchmarks" / "2026-11-27-marathon.json"
PAGE = ROOT / "docs" / "marathon.md"
# robot.md B5: steps, m, s, W, Wh and cost of transport of 1 and 2 May 2011
ROBOT = {"steps": 186_076, "distance_m": 65_243, "time_s": 110_942, "motors_W": 11.3, "electronics_W": 4.7}


def clock(seconds: float) -> str:
    """30 h 49 min."""
    minutes = round(seconds / 60.0)
    return f"{minutes // 60} h {minutes % 60:02} min"


def walk_table(walk: dict) -> str:
    """The walk compared with the robot's, and with what was predicted for it (docs/explanation/motor-power.md)."""
    km, hours = walk["distance_m"] / 1000.0, walk["walked_h"]
    drawn_Wh, late = walk["battery"]["delivered_Wh"], walk["heel_strike_delay_ms"]
    drawn_W, robot_km = drawn_Wh / hours, ROBOT["distance_m"] / 1000.0
    robot_W = ROBOT["motors_W"] + ROBOT["electronics_W"]
    step = f"{walk['mean_step_length_m']:.3f} m, {walk['mean_step_time_s']:.3f} s"
    motors_W = drawn_W - walk["energy_Wh"]["electronics"] / hours
    rows = [
        ("", "robot, May 2011", "predicted", "here"),
        ("---", "---", "---", "---"),
        ("distance", f"{robot_km:.2f} km", f"{robot_km:.2f} km", f"{km:.2f} km"),
        ("steps", f"{ROBOT['steps']:,}", "", f"{walk['steps']:,}"),
        ("falls", "0", "", "0"),
        ("time", clock(ROBOT["time_s"]), "", clock(hours * 3600)),
        ("step length, time", "0.35 m, 0.60 s", "0.353 to 0.356 m, 0.607 to 0.611 s", step),
        ("speed", "0.59 m/s", "0.578 to 0.587 m/s", f"{walk['speed_m_per_s']:.3f} m/s"),
        ("out of the batteries", "493 Wh", "471 Wh (466 to 476)", f"{drawn_Wh:.0f} Wh"),
        ("the same per kilometre", f"{493 / robot_km:.2f} Wh", "7.20 to 7.29 Wh", f"{drawn_Wh / km:.2f} Wh"),
        ("mean power out of them", f"{robot_W:.1f} W", "15.2 W", f"{drawn_W:.1f} W"),
        ("of it motors, net", f"{ROBOT['motors_W']} W", "10.5 W", f"{motors_W:.1f} W"),
        ("cost of transport of that", "0.28", "", f"{walk['tcot'] * drawn_W / walk['total_power_W']:.2f}"),
        ("heel strike reported late by", "14 ± 3 ms", "", f"{late['mean']:.1f} ± {late['std']:.1f} ms"),
    ]
    return table(rows)


def energy_table(walk: dict) -> str:
    """What each consumer took; what the motors gave back is its own line."""
    taken = {name: value for name, value in walk["energy_Wh"].items() if name != "total" and value > 0.0}
    total = walk["energy_Wh"]["total"]
    back = total - walk["battery"]["delivered_Wh"]
    rows = [("consumer", "Wh", "W", "share"), ("---", "---:", "---:", "---:")]
    for name, value in taken.items():
        share = f"{100 * value / total:.0f} %"
        rows.append((name.replace("_", " "), f"{value:.1f}", f"{value / walk['walked_h']:.2f}", share))
    rows += [
        ("together", f"{total:.1f}", f"{total / walk['walked_h']:.2f}", "100 %"),
        ("given back by braking motors", f"{back:.1f}", f"{back / walk['walked_h']:.2f}", ""),
    ]
    return table(rows)


def network_table(walk: dict) -> str:
    """Frames and slots, and what the floor did to the feet."""
    rows = [
        ("", "count"),
        ("---", "---:"),
        ("frames on four buses", f"{sum(bus['frames'] for bus in walk['can'].values()):,}"),
        ("of them lost", f"{sum(bus['lost'] for bus in walk['can'].values()):,}"),
        ("slots of seven boards", f"{sum(board['count'] for board in walk['slots'].values()):,}"),
        ("of them overrun", f"{sum(board['overruns'] for board in walk['slots'].values()):,}"),
        ("strikes that pulled", f"{walk['oddities']['tensile_strikes']:,}"),
        ("strikes that bounced, feet that scuffed", f"{walk['oddities']['bounces'] + walk['oddities']['scuffs']:,}"),
    ]
    return table(rows)


def table(rows: list[tuple[str, ...]]) -> str:
    """Rows as Markdown."""
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def tables() -> list[str]:
    """The three tables of the page."""
    walk = json.loads(KEPT.read_text(encoding="utf-8"))["walk"]
    return [walk_table(walk), energy_table(walk), network_table(walk)]


if __name__ == "__main__":
    print("\n\n".join(tables()))
