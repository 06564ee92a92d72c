"""What a second of the walking robot costs: processor instructions by package and module, counted by valgrind.

    python -m dev.instructions                   # two seconds of the robot: some minutes
    python -m dev.instructions --modules 30      # also the modules that take the most

Counted are two runs of different length; the difference is that of the seconds between, without start and imports.
The count hardly depends on the processor or its load: it shows what a change costs where times do not.
"""

import argparse
import collections
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping

from ranger_sim.loading import RUNS_COMPILED

FIRST_S = 1.0  # of the robot, that both runs have: it stands up and begins to walk
PROGRAM = "import sys; from ranger_sim import Ranger; Ranger().run_for(sys.argv[1])"
COUNTS = re.compile(r"(?:[+-]?\d+|\*) (\d+)$")
LIBRARY = re.compile(r".*/ranger_sim/(?:(.+)/)?([^/.]+)\.[^/]*$")


def by_object(text: str) -> dict[str, int]:
    """{library or program: instructions of its functions themselves} of a file that callgrind wrote."""
    names: dict[str, str] = {}
    found: dict[str, int] = collections.Counter()
    current, is_call = "", False
    for line in text.splitlines():
        if line.startswith("ob="):
            number, _, name = line[3:].partition(" ")
            current = names.setdefault(number, name)
        elif line.startswith("cob="):  # names are given once, wherever they come first
            number, _, name = line[4:].partition(" ")
            names.setdefault(number, name)
        elif line.startswith("calls="):
            is_call = True  # the next line is of the function that is called
        elif counts := COUNTS.match(line):
            if not is_call:
                found[current] += int(counts[1])
            is_call = False
    return dict(found)


def module_of(path: str) -> str:
    """`package.module` of one of our libraries; else what the library is."""
    if ours := LIBRARY.match(path):
        return ".".join([*(ours[1].split("/") if ours[1] else []), ours[2]])
    name = pathlib.PurePath(path).name
    if name.startswith(("python", "libpython")):
        return "(CPython)"
    return "(C library)" if name.startswith(("libc.", "libc-", "libm.", "libm-", "ld-")) else "(others)"


def counted(seconds: float, folder: pathlib.Path) -> collections.Counter[str]:
    """Instructions by module of a process in which the robot runs for so long. SystemExit where it fails."""
    out = folder / f"{seconds:g}.out"
    done = subprocess.run(
        ["valgrind", "--tool=callgrind", f"--callgrind-out-file={out}", sys.executable, "-c", PROGRAM, f"{seconds:g}s"],
        env=os.environ | {"PYTHONHASHSEED": "0"},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise SystemExit(f"valgrind: {(done.stderr.strip() or 'no output').splitlines()[-1]}")
    found: collections.Counter[str] = collections.Counter()
    for path, count in by_object(out.read_text(encoding="utf-8", errors="replace")).items():
        found[module_of(path)] += count
    return found


def table(counts: Mapping[str, float], most: int) -> str:
    """Lines of Markdown: millions of instructions of each name, the most first, and their sum."""
    whole = sum(counts.values())
    rows = sorted(counts.items(), key=lambda each: -each[1])[:most]
    lines = ["| | M instructions | share |", "|---|---|---|"]
    lines += [f"| {name} | {count / 1e6:.1f} | {count / whole:.1%} |" for name, count in rows]
    return "\n".join([*lines, f"| in all | {whole / 1e6:.1f} | |"])


def main(arguments: list[str] | None = None) -> int:
    """Count and print."""
    command = argparse.ArgumentParser(
        prog="python -m dev.instructions", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    command.add_argument("--seconds", type=float, default=2.0, metavar="S", help="of the robot (default 2)")
    command.add_argument("--modules", type=int, default=0, metavar="N", help="print the N modules that take the most")
    options = command.parse_args(arguments)
    if not shutil.which("valgrind"):
        raise SystemExit("valgrind is not installed")
    if not RUNS_COMPILED:
        raise SystemExit("the robot runs interpreted: its instructions would be Python's")
    with tempfile.TemporaryDirectory() as folder:
        first = counted(FIRST_S, pathlib.Path(folder))
        last = counted(FIRST_S + options.seconds, pathlib.Path(folder))
    modules = {name: (last[name] - first[name]) / options.seconds for name in last}
    packages: collections.Counter[str] = collections.Counter()
    for name, count in modules.items():
        packages[name.partition(".")[0]] += count
    print("In a second of the robot:\n")
    print(table(packages, len(packages)))
    if options.modules:
        print()
        print(table(modules, options.modules))
    return 0


if __name__ == "__main__":
    sys.exit(main())
