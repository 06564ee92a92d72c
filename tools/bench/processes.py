"""`ranger-sim bench processes`: the robot with a process for each board, at the wall clock's pace and unpaced."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable

PACES = ("1.0", "max")


def walked(speed: str, seconds: float) -> dict:
    """`ranger-sim up` for `seconds` of virtual time: its pace, and per board turns, slot lateness and damaged messages.

    RuntimeError with the last line of its output when it fails.
    """
    name = f"bench-{os.getpid()}"
    call = [sys.executable, "-m", "ranger_sim", "up", "--name", name, "--speed", speed, "--json", "-"]
    done = subprocess.run([*call, "--time", f"{seconds}s"], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"bench: up --speed {speed}: {(done.stderr.strip() or 'no word').splitlines()[-1]}")
    summary = json.loads(done.stdout)
    found = summary["processes"]
    return {
        "speed": found["speed"],
        "time_s": summary["time_s"],
        "trace_digest": summary["trace_digest"],
        "paced_factor": found["paced_factor"],
        "boards": found["boards"],
    }


def run(seconds: float, report: Callable[[str], None]) -> list[dict]:
    """Measure both paces and report a line for each."""
    rows = []
    for speed in PACES:
        row = walked(speed, seconds)
        rows.append(row)
        late = [board["lateness"] for board in row["boards"].values() if board["lateness"]["slots"]]
        lateness = "".join(
            f", {words} {max(each[key] for each in late):,.0f} us"
            for words, key in (("99 % of a board's slots late by at most", "p99_us"), ("the latest by", "max_us"))
            if late
        )
        report(f"up --speed {speed}: {row['paced_factor']:.2f} x real time by the wall clock{lateness}")
    return rows
