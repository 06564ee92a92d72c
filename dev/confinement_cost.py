"""python -m dev.confinement_cost: processor time of a walk with a hip board in C, confined, in part, and not at all.

The three kinds of walk take turns, so that other work on the machine meets all of them alike, in an order that changes
from turn to turn. Counted is the processor time (user and system) of the command and of all its processes. A kind costs
what the median of its walks has more than that of the walks without confinement. All digests have to agree.
"""

from __future__ import annotations

import argparse
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile

from dev.kills import digest_in
from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools.command_line.files import json_target, replace_file
from ranger_sim.tools.command_line.units import number, whole_number

COMMAND = "python -m dev.confinement_cost"
ROOT = pathlib.Path(__file__).resolve().parents[1]
TURNS, SECONDS = 9, 20.0
WITHOUT = "not confined"
NO_NUMBERS = (
    "forked = confinement.fork\n"
    "confinement.fork = lambda _numbers, prepare=lambda: None: forked(False, prepare)\n"
    'confinement.without_numbers = ""\n'
)
# What each kind replaces in `confinement` before the command begins.
KINDS = {
    WITHOUT: NO_NUMBERS + "confinement.confine = lambda _needs, _keep: []",
    "without process numbers": NO_NUMBERS,
    "confined": "",
}
PROGRAM = """\
import sys
from ranger_sim.firmware_sim.native import confinement
%s
from ranger_sim.tools.cli import main
sys.exit(main(sys.argv[1:]))
"""


def used_s(kind: str, seconds: float, out: pathlib.Path) -> float:
    """Processor seconds of one walk of this kind; UserError where it does not end well or is another kind."""
    words = ["walk", "--time", f"{seconds:g}s", "--firmware", f"MCH={ROOT / 'examples' / 'hip_in_c'}"]
    words += ["--log", "none", "--out", str(out)]
    with tempfile.TemporaryFile() as printed:
        started = subprocess.Popen(
            [sys.executable, "-c", PROGRAM % KINDS[kind], *words], cwd=ROOT, stdout=printed, stderr=subprocess.STDOUT
        )
        _, status, used = os.wait4(started.pid, 0)
        started.returncode = code = os.waitstatus_to_exitcode(status)
        if code:
            raise UserError(f"{kind}: code {code}: {os.pread(printed.fileno(), 1 << 20, 0).decode()[-2000:]}")
    confined = json.loads((out / "summary.json").read_text(encoding="utf-8"))["firmware"]["MCH"]["confined"]
    if confined != "yes":  # what is missing then would be measured as if it cost nothing
        raise UserError(f"{kind}: this system confines it {confined}")
    return used.ru_utime + used.ru_stime


def costs(used: dict[str, list[float]]) -> dict[str, float]:
    """By how much, in percent, the median of each kind is above that of WITHOUT."""
    base = statistics.median(used[WITHOUT])
    return {kind: round(100.0 * (statistics.median(each) / base - 1.0), 2) for kind, each in used.items()}


def measured(turns: int, seconds: float, folder: pathlib.Path) -> dict[str, list[float]]:
    """{kind: processor seconds of each walk}; UserError where the digests differ."""
    used: dict[str, list[float]] = {kind: [] for kind in KINDS}
    digests = set()
    for turn in range(turns):
        kinds = list(KINDS)
        for kind in kinds[turn % len(kinds) :] + kinds[: turn % len(kinds)]:
            out = folder / f"{turn}-{kind.replace(' ', '-')}"
            used[kind].append(round(used_s(kind, seconds, out), 3))
            digests.add(digest_in(out))
    if len(digests) != 1:
        raise UserError(f"the walks have {len(digests)} digests: {sorted(digests)}")
    return used


def main(arguments: list[str] | None = None) -> int:
    """0 with the figures, 2 where they cannot be had."""
    command = argparse.ArgumentParser(prog=COMMAND, description=(__doc__ or "").partition("\n")[0])
    command.add_argument("--turns", type=whole_number(1), default=TURNS, metavar="N", help=f"default {TURNS}")
    command.add_argument("--seconds", type=number(above=0.0), default=SECONDS, metavar="S", help="of the robot's time")
    command.add_argument("--json", metavar="FILE|-", help="the figures as JSON; - prints them and nothing else")
    options = command.parse_args(arguments)
    try:
        target = json_target(options.json)
        with tempfile.TemporaryDirectory(prefix="ranger-sim-confinement-") as folder:
            used = measured(options.turns, options.seconds, pathlib.Path(folder))
    except UserError as mistake:
        print(f"{COMMAND}: {mistake}", file=sys.stderr)
        return 2
    percent = costs(used)
    text = json.dumps({"walked_s": options.seconds, "processor_s": used, "costs_percent": percent}, indent=2)
    if target is not None:
        replace_file(target, (text + "\n").encode())
    if options.json == "-":
        print(text)
        return 0
    for kind, each in used.items():
        print(
            f"{kind:24} {statistics.median(each):7.3f} s ({min(each):.3f} to {max(each):.3f})  {percent[kind]:+.2f} %"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
