"""Compares the speed of two commits: cases of `ranger-sim bench` of both, in turn, in one run.

    python -m dev.regression OTHER CASE...    # OTHER: a checkout that is set up, or a commit, which is built first
    python -m dev.regression 5f3a1c robot boards-in-c-ahead --runs 5 --json speed.json

Each turn runs a case in the other commit and in this checkout, one right after the other, so that both meet the same
machine; the ratio of a case is the median over the turns. Exit code 1 when one is below `--least`.
"""

import argparse
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parents[1]
LEAST = 0.9  # chosen by us: two runs of one commit differ by some percent on a quiet machine


def interpreter_of(checkout: pathlib.Path) -> pathlib.Path:
    """The interpreter of a checkout that is set up. SystemExit where it is not."""
    for place in (".venv/bin/python", ".venv/Scripts/python.exe"):
        if (checkout / place).exists():
            return checkout / place
    raise SystemExit(f"{checkout}: no .venv in it: `make setup` there first")


def checked_out(commit: str, folder: pathlib.Path) -> pathlib.Path:
    """The commit as a checkout in `folder`, set up and compiled. SystemExit for an unknown commit or a failed build."""
    for call in (
        ["git", "-C", str(HERE), "worktree", "add", "--detach", str(folder), commit],
        ["make", "-C", str(folder), "setup"],
    ):
        done = subprocess.run(call, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise SystemExit(f"{' '.join(call)}: {(done.stderr.strip() or 'no output').splitlines()[-1]}")
    return folder


def measured(interpreter: pathlib.Path, case: str, seconds: float) -> float:
    """The figure of a case, work per second of processor time. SystemExit with the last line of what failed."""
    call = [str(interpreter), "-m", "ranger_sim.tools.bench.cases", case, str(seconds)]
    done = subprocess.run(call, cwd=interpreter.parents[2], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{call[0]}: case {case}: {(done.stderr.strip() or 'no output').splitlines()[-1]}")
    return float(json.loads(done.stdout)["figure"])


def compared(other: pathlib.Path, cases: list[str], runs: int, seconds: float) -> dict[str, dict]:
    """By case: the figures of the other checkout and of this one, and the median ratio, this one by the other."""
    then, now = interpreter_of(other), interpreter_of(HERE)
    found: dict[str, dict] = {case: {"other": [], "here": []} for case in cases}
    for turn in range(runs):
        for case, figures in found.items():
            # who is first changes: what the first one leaves in caches helps the second
            for name, interpreter in (("other", then), ("here", now))[:: 1 if turn % 2 == 0 else -1]:
                figures[name].append(measured(interpreter, case, seconds))
    for figures in found.values():
        ratios = [here / there for here, there in zip(figures["here"], figures["other"], strict=True)]
        figures.update(ratio=statistics.median(ratios), least=min(ratios), most=max(ratios))
    return found


def main() -> int:
    """0, or 1 when a case is slower than allowed."""
    parser = argparse.ArgumentParser(prog="python -m dev.regression", description=__doc__.splitlines()[0])
    parser.add_argument("other", help="a checkout that is set up, or a commit")
    parser.add_argument("case", nargs="+", help="of ranger_sim/tools/bench/cases.py")
    parser.add_argument("--runs", type=int, default=3, help="turns (default 3)")
    parser.add_argument("--seconds", type=float, default=10.0, help="virtual seconds per run (default 10)")
    parser.add_argument("--least", type=float, default=LEAST, help=f"the lowest ratio allowed (default {LEAST})")
    parser.add_argument("--json", metavar="FILE", help="everything as JSON")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="ranger-regression-") as made:
        folder = pathlib.Path(made, "other")
        is_checkout = pathlib.Path(options.other).is_dir()
        try:
            other = pathlib.Path(options.other).resolve() if is_checkout else checked_out(options.other, folder)
            found = compared(other, options.case, options.runs, options.seconds)
        finally:
            if not is_checkout:
                subprocess.run(["git", "-C", str(HERE), "worktree", "remove", "--force", str(folder)], check=False)
    print(f"load average {os.getloadavg()[0]:.1f}; this checkout by the other, {options.runs} turns")
    for case, figures in found.items():
        print(f"  {case:32} {figures['ratio']:6.2f}  ({figures['least']:.2f} to {figures['most']:.2f})")
    if options.json:
        pathlib.Path(options.json).write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
    return int(any(figures["ratio"] < options.least for figures in found.values()))


if __name__ == "__main__":
    sys.exit(main())
