"""`python -m studies.hidden_walks --seed N`: hidden walks of every kind, their answers, and the table of rates."""

import argparse
import dataclasses
import json
import sys

from threadpoolctl import threadpool_limits

from ranger_sim.sysid.results import TwinsEvidence
from ranger_sim.tools.command_line.files import replace_file
from studies.hidden_walks import score


def main() -> int:
    """The study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, required=True, help="of everything that is drawn")
    parser.add_argument("--sound", type=int, default=50, help="sound walks on each floor (50)")
    parser.add_argument("--floors", nargs="+", default=list(score.FLOORS_M), choices=list(score.FLOORS_M))
    parser.add_argument("--rows", nargs="+", default=list(score.ROWS), choices=score.ROWS)
    parser.add_argument("--kinds", nargs="+", default=[], help="names of kinds (default: all)")
    parser.add_argument(
        "--turns",
        nargs="+",
        type=int,
        default=list(score.TURNS),
        choices=score.TURNS,
        help="in a turn every kind walks once on each floor, at one multiple (all: every kind at every multiple)",
    )
    parser.add_argument("--out", help="JSON file of all answers")
    options = parser.parse_args()

    def show(case: score.Case) -> None:
        answer = f"{case.named} {case.value:+.4g} ({case.low:.4g} to {case.high:.4g})" if case.named else "no name"
        marks = ("RIGHT" if case.right else "tie" if case.tied else "") + (" holds" if case.holds else "")
        print(
            f"{case.floor:6s} {case.row:5s} x{case.multiple:g} {case.kind:26s} {case.size:+.4g} steps {case.steps:2d} "
            f"{'detected' if case.detected else 'silent  '} {answer} {marks}",
            flush=True,
        )

    def alarm(row: str, found: TwinsEvidence) -> None:
        if found.detected:
            print(f"sound {row:5s} ALARM {found}", flush=True)

    with threadpool_limits(1):
        alarms = {}
        for floor in options.floors:
            for row, found in score.sound(options.rows, floor, options.seed, options.sound, alarm).items():
                raised = [each for each in found if each.detected]
                alarms[row, floor] = len(raised), len(found)
                names = [f"{each.named.name} at {each.named.at}" if each.named else "no name" for each in raised]
                print(f"{floor} {row}: {len(raised)} of {len(found)} sound walks raise an alarm {names}", flush=True)
        cases = score.all_cases(options.seed, options.floors, options.rows, options.kinds, show, options.turns)
    rates = score.table(cases, alarms)
    for each in rates:
        print(json.dumps(each))
    if options.out:
        import pathlib

        content = {"seed": options.seed, "rates": rates, "cases": [dataclasses.asdict(each) for each in cases]}
        replace_file(pathlib.Path(options.out), json.dumps(content, indent=1).encode())
    return 0


if __name__ == "__main__":
    sys.exit(main())
