"""All dialects, accidents and files of other writers in tests/sysid, judged: `python -m dev.dialects [--all]`."""

import argparse
import functools
import pathlib
import tempfile
from collections import Counter

from tests.sysid import dialects, strangers

STRANGERS = "by other writers"


def main() -> int:
    """Print every verdict but the right ones, and the table of scores; 1 where one is wrong."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--all", action="store_true", help="print the right ones as well")
    show_all = options.parse_args().all
    scores: dict[str, Counter[str]] = {kind: Counter() for kind in ("dialects", "accidents", STRANGERS)}
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
        for number, (title, stranger) in enumerate(strangers.strangers()):
            own = folder / str(number)
            own.mkdir()
            cases.append((STRANGERS, title, functools.partial(strangers.judged, stranger, own)))
        for kind, title, judge in cases:
            verdict, reason = judge()
            scores[kind][verdict] += 1
            if show_all or verdict not in (dialects.RIGHT, dialects.REFUSED):
                print(f"{kind}: {title}: {verdict}: {' / '.join(reason.splitlines())[:300]}")
    verdicts = (dialects.RIGHT, dialects.REFUSED, dialects.FALSELY, dialects.WRONG, strangers.MISSING)
    print(f"| | all | {' | '.join(verdicts)} |")
    for kind, counts in scores.items():
        print(f"| {kind} | {counts.total()} | {' | '.join(str(counts[verdict]) for verdict in verdicts)} |")
    return 1 if any(counts[dialects.WRONG] for counts in scores.values()) else 0


if __name__ == "__main__":
    raise SystemExit(main())
