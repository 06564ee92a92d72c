"""All dialects and accidents of `tests/sysid/dialects.py`, read and judged: `python -m dev.dialects [--all]`."""

import argparse
import functools
import pathlib
import tempfile
from collections import Counter

from tests.sysid import dialects


def main() -> int:
    """Print every verdict but the right ones, and the table of scores; 1 where one is wrong."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--all", action="store_true", help="print the right ones as well")
    show_all = options.parse_args().all
    scores: dict[str, Counter[str]] = {"dialects": Counter(), "accidents": Counter()}
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        cases = [
            ("dialects", title, functools.partial(dialects.judged_dialect, how, folder))
            for title, how in dialects.dialects()
        ]
        cases += [
            ("accidents", title, functools.partial(dialects.judged_accident, make(), folder))
            for title, make in dialects.accidents()
        ]
        for kind, title, judge in cases:
            verdict, reason = judge()
            scores[kind][verdict] += 1
            if show_all or verdict not in (dialects.RIGHT, dialects.REFUSED):
                print(f"{kind[:-1]}: {title}: {verdict}: {' / '.join(reason.splitlines())[:300]}")
    verdicts = (dialects.RIGHT, dialects.REFUSED, dialects.FALSELY, dialects.WRONG)
    print(f"| | all | {' | '.join(verdicts)} |")
    for kind, counts in scores.items():
        print(f"| {kind} | {counts.total()} | {' | '.join(str(counts[verdict]) for verdict in verdicts)} |")
    return 1 if any(counts[dialects.WRONG] for counts in scores.values()) else 0


if __name__ == "__main__":
    raise SystemExit(main())
