"""What a user waits for: starts, a small campaign, an image's board, a walk with its trace, a rebuild of one module.

Each function returns {"figure": work per second of processor time} of all processes that it starts.
"""

from __future__ import annotations

import os
import pathlib
import subprocess
import sys
import tempfile
from typing import Any

from ranger_sim import loading
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.user_error import UserError

COMMAND = (sys.executable, "-m", "ranger_sim")
STARTS = {
    "python": (sys.executable, "-c", "pass"),
    "version": (*COMMAND, "--version"),
    "info": (*COMMAND, "info"),
    "robot": (sys.executable, "-c", "from ranger_sim import Ranger; Ranger().close()"),
    "pytest": (sys.executable, "-m", "pytest", "--collect-only", "-q", "-p", "no:cacheprovider", "test_one.py"),
}
SECONDS_PER_RUN = 4  # of --seconds, for each repetition of something that takes a part of a second
REBUILT = "can_bus/frame"


def children_s() -> float:
    """Processor seconds of the ended processes that this one has started."""
    times = os.times()
    return times.children_user + times.children_system


def ran(call: tuple[str, ...], folder: pathlib.Path | None = None) -> None:
    """Run a command to its end. UserError with its last line where it fails; exit code 1 is a result."""
    done = subprocess.run(call, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        last = (done.stderr.strip() or done.stdout.strip() or "no output").splitlines()[-1]
        raise UserError(f"bench: {' '.join(call)}: exit code {done.returncode}: {last}")


def start(seconds: float, what: str) -> dict:
    """One of `STARTS`, several times."""
    count = max(1, round(seconds / SECONDS_PER_RUN))
    with tempfile.TemporaryDirectory(prefix="ranger-bench-") as folder:
        pathlib.Path(folder, "test_one.py").write_text("def test_nothing():\n    pass\n", encoding="utf-8")
        ran(STARTS[what], pathlib.Path(folder))  # what is read from the disk is in memory then
        before = children_s()
        for _ in range(count):
            ran(STARTS[what], pathlib.Path(folder))
        return {"figure": count / (children_s() - before)}


def campaign(bare: bool = False) -> dict:
    """The campaign of the machine that `new` writes: every fault of its encoder, twice; runs per processor second.

    bare: the machine alone, for as long as a run, in one process.
    """
    with tempfile.TemporaryDirectory(prefix="ranger-bench-") as made:
        folder = pathlib.Path(made, "wheel")
        ran((*COMMAND, "new", str(folder)))
        os.chdir(folder)
        sys.path.insert(0, str(folder))
        from ranger_sim.harness.campaigns import plan
        from ranger_sim.harness.stop_rule import StopRule

        cases = plan.load(folder / "campaign.toml").cases()
        machine = cases[0].golden().robot()  # compiles the firmware
        try:
            if bare:
                count, run_s = 20, 1.3
                started = wallclock.process_cpu_s()
                machine.run(StopRule(time_s=count * run_s), count * run_s)
                return {"figure": count / (wallclock.process_cpu_s() - started)}
        finally:
            machine.close()
            os.chdir("/")
        before = children_s()
        ran((*COMMAND, "campaign", "campaign.toml"), folder)
        return {"figure": len(cases) / (children_s() - before), "runs": len(cases)}


def image(seconds: float, native: bool = False) -> dict:
    """The board of `wheel/` as an image of the chip, instruction by instruction; native: for this computer.

    UserError without the cross compiler.
    """
    import shutil

    from ranger_sim.firmware_sim.clock import Crystal
    from ranger_sim.firmware_sim.native import build, image_build, manifest
    from ranger_sim.tools.bench import twelve_boards

    with tempfile.TemporaryDirectory(prefix="ranger-bench-") as made:
        folder = pathlib.Path(made, "wheel")
        shutil.copytree(twelve_boards.SOURCE, folder, ignore=shutil.ignore_patterns("build"))
        with (folder / manifest.FILE).open("a", encoding="utf-8") as file:
            file.write("[defines]\nAHEAD = 0\nFILTER = 0\n")
        given = manifest.load(folder)
        crystal = Crystal(10_000_000)
        board: Any  # its outbox is a queue, which the declared type does not say
        if native:
            from ranger_sim.firmware_sim.native.native_board import NativeBoard

            board = NativeBoard("WHEEL", build.build(given).path, crystal)
        else:
            from ranger_sim.firmware_sim.lpc2194 import image as image_file
            from ranger_sim.firmware_sim.lpc2194.board import ImageBoard

            board = ImageBoard("WHEEL", image_file.read(image_build.build_image(given).path), crystal)
        end_ns, step_ns = round(seconds * 1e9), 1_000_000
        started = wallclock.process_cpu_s()
        for until in range(step_ns, end_ns + step_ns, step_ns):
            board.advance(until)
            while board.outbox.take():
                pass
        return {"figure": seconds / max(wallclock.process_cpu_s() - started, 1e-3)}


def walk(seconds: float, trace: bool = False) -> dict:
    """`ranger-sim walk` for `seconds` of the robot, start included, with its trace or without."""
    with tempfile.TemporaryDirectory(prefix="ranger-bench-") as folder:
        file = pathlib.Path(folder, "walk.pftrace")
        call = (*COMMAND, "walk", "--time", f"{seconds}s", "--quiet", "--out", str(pathlib.Path(folder, "run")))
        before = children_s()
        ran((*call, "--trace", str(file)) if trace else call)
        used = children_s() - before
        size = file.stat().st_size / seconds if trace else 0.0
        return {"figure": seconds / used, "bytes_per_s": size}


def rebuild(nothing: bool = False) -> dict:
    """The set-up's build of a checkout after one compiled module was removed; nothing: with all in place."""
    if loading.COMPILED is None or not (pathlib.Path(loading.COMPILED).parents[2] / "setup.py").exists():
        raise UserError("bench: rebuild: this installation is not a checkout with compiled modules")
    root = pathlib.Path(loading.COMPILED).parents[2]
    if not nothing:
        for built in [*root.glob(f"build/compiled/**/{REBUILT}.*.so"), *root.glob(f"build/temp*/**/{REBUILT}.o")]:
            built.unlink()
    before = children_s()
    ran((sys.executable, "setup.py", "-q", "build_ext", "--inplace"), root)
    return {"figure": 1.0 / (children_s() - before)}
