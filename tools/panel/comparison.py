"""A walk of the panel compared with its twins: `ranger-sim diagnose`, in a process that ends with the panel."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from typing import Any

from ranger_sim.foundation import systems
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes import kernel
from ranger_sim.sysid.twins import steps
from ranger_sim.tools.diagnose import twin_words
from ranger_sim.tools.panel import export
from ranger_sim.tools.panel.source import Source

GIVES_WAY = 10  # steps of nice(2) below the panel: a robot that walks meanwhile comes first
SETS = ("C_", "P_", "D_", "DC", "DP")  # begin the names of the controller's parameters
SET_S = 1.0  # of the parameters, whose last values count
PROGRESS = re.compile(r"(.+), (\d+)%")
LONGEST = 400  # letters of an error
FOUND = (0, 1, 3)  # exit codes with an answer
NOTHING: dict[str, Any] = {"walk": "", "at": "", "share": 0.0, "error": "", "answer": None}


class Comparison:
    """One comparison at a time, for all pages. `content` is what they show of it; `changed` is called when it changes.

    report: the page that `ranger-sim diagnose --out` writes, once there is an answer.
    """

    def __init__(self, source: Source, changed: Callable[[], None]) -> None:
        self.source = source
        self.changed = changed
        self.content = NOTHING
        self.report = b""
        self.running: asyncio.Task[None] | None = None

    def start(self, number: Any) -> None:
        """Compare a walk of the source. UserError for another number, or while one is compared."""
        walks = self.source.walks
        if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number < len(walks):
            raise UserError(f"compare: {str(number)[:20]} is not one of {len(walks)} walks")
        if self.running is not None:
            raise UserError(f"compare: {self.content['walk']} is being compared")
        self._show(walk=walks[number], at="recording", error="", share=0.0, answer=None)
        self.running = asyncio.create_task(self._run(number))

    async def stop(self) -> None:
        """End a comparison and its process."""
        if self.running is not None:
            self.running.cancel()
            await asyncio.gather(self.running, return_exceptions=True)

    def _show(self, **content: Any) -> None:
        self.content = {**self.content, **content}
        self.changed()

    async def _run(self, number: int) -> None:
        self.report = b""
        try:
            with tempfile.TemporaryDirectory(prefix="ranger-sim-") as name:
                folder = pathlib.Path(name)
                data = self.source.recording(number)
                if data is None:
                    path = folder / "walk.mf4"
                    await asyncio.to_thread(save, self.source, path)
                    data = [str(path)]
                answer = await self._diagnosis(data, folder / "found")
                self.report = (folder / "found" / "report.html").read_bytes()
            self._show(at="", answer=twin_words.summed_up(answer))
        except asyncio.CancelledError:
            self.content = {**NOTHING, "walk": self.content["walk"], "error": "stopped"}
            raise
        except (UserError, OSError) as error:
            self._show(at="", error=str(error)[:LONGEST])
        finally:
            self.running = None
            self.changed()

    async def _diagnosis(self, data: list[str], folder: pathlib.Path) -> dict[str, Any]:
        """The answer of the command. UserError with its line."""
        command = [sys.executable, "-m", "ranger_sim", "diagnose", *data, "--experiment", "walk", "-v"]
        process = await asyncio.create_subprocess_exec(
            *command,
            "--out",
            str(folder),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            **alone(),
        )
        try:
            line = await self._progress(process)
            code = await process.wait()
        finally:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.wait()
        if code not in FOUND:
            raise UserError(line or f"the comparison ended with code {code}")
        answer: dict[str, Any] = json.loads((folder / "diagnosis.json").read_bytes())
        return answer

    async def _progress(self, process: asyncio.subprocess.Process) -> str:
        """Show how far it is; returns its last line that is not that."""
        assert process.stderr is not None
        last = ""
        async for raw in process.stderr:
            line = raw.decode(errors="replace").strip()
            if found := PROGRESS.fullmatch(line):
                self._show(at=found[1], share=int(found[2]) / 100.0)
            elif line:
                last = line
        return last


def alone() -> dict[str, Any]:
    """Options of a process that gets no Ctrl-C of the panel, gives way to a robot, and on Linux dies with the panel."""
    if not systems.can_fork():
        return {}
    parent = os.getpid()

    def prepare() -> None:
        if systems.is_linux():
            kernel.die_with_parent(parent)
        os.nice(GIVES_WAY)

    return {"start_new_session": True, "preexec_fn": prepare}


def save(source: Source, path: pathlib.Path) -> None:
    """The variables that a comparison reads, as far back as the panel has their samples. UserError without samples."""
    begin, end = source.span()
    begins = []
    for number, channel in enumerate(source.channels):
        if channel.name in {*steps.VARIABLES, *steps.COUNTED}:
            begins.append((number, begin))
        elif channel.name.startswith(SETS):
            begins.append((number, end - SET_S))
    export.write_mf4(path, source, begins, end)
