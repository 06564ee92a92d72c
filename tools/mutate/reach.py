"""A pytest plugin that notes which test runs which function of the rooms: `-p ranger_sim.tools.mutate.reach`.

Into the file that RANGER_SIM_REACH names: for each test that passed its seconds and its functions, for each file of
tests the functions that ran while its fixtures were made (they may serve every test of the file), and the functions
that ran while modules were imported. A function is `path:line` of its code. Interpreted runs only.
"""

import json
import os
import pathlib
import sys
import threading
from types import CodeType, FrameType
from typing import Any

from ranger_sim.loading import HOUSE, ROOMS, RUNS_COMPILED

ROOTS = tuple(str(HOUSE / room) + os.sep for room in ROOMS)


class Reach:
    """What was seen so far. `codes`: the set that grows at this moment."""

    def __init__(self, target: pathlib.Path) -> None:
        self.target = target
        self.imported: set[CodeType] = set()
        self.files: dict[str, set[CodeType]] = {}
        self.tests: dict[str, set[CodeType]] = {}
        self.seconds: dict[str, float] = {}
        self.failed: set[str] = set()
        self.codes = self.imported

    def note(self, frame: FrameType, event: str, _argument: object) -> None:
        """Called by the interpreter at every call."""
        if event == "call":
            self.codes.add(frame.f_code)

    def start(self) -> None:
        """From here on every call is noted, in every thread."""
        threading.setprofile(self.note)
        sys.setprofile(self.note)

    # --- pytest's hooks, by their names -----------------------------------------------------------------------

    def pytest_runtest_setup(self, item: Any) -> None:
        """Fixtures of a file may serve all its tests."""
        self.codes = self.files.setdefault(item.nodeid.partition("::")[0], set())

    def pytest_runtest_call(self, item: Any) -> None:
        """The test itself."""
        self.codes = self.tests.setdefault(item.nodeid, set())

    def pytest_runtest_teardown(self, item: Any) -> None:
        """As the set-up."""
        self.codes = self.files.setdefault(item.nodeid.partition("::")[0], set())

    def pytest_runtest_logreport(self, report: Any) -> None:
        """How long it took, and whether it can tell a mutant from the original at all."""
        self.seconds[report.nodeid] = self.seconds.get(report.nodeid, 0.0) + report.duration
        if report.outcome != "passed":
            self.failed.add(report.nodeid)

    def pytest_sessionfinish(self) -> None:
        """Write it down."""
        sys.setprofile(None)
        threading.setprofile(None)
        found = {
            "imported": places(self.imported),
            "files": {name: places(codes) for name, codes in self.files.items()},
            "tests": {
                name: {"seconds": round(self.seconds.get(name, 0.0), 4), "functions": places(codes)}
                for name, codes in self.tests.items()
                if name not in self.failed
            },
            "failed": sorted(self.failed),
        }
        self.target.write_text(json.dumps(found), encoding="utf-8")


def places(codes: set[CodeType]) -> list[str]:
    """`path:line` of those that belong to the rooms, in order."""
    root = len(str(HOUSE)) + 1
    return sorted(
        f"{code.co_filename[root:]}:{code.co_firstlineno}" for code in codes if code.co_filename.startswith(ROOTS)
    )


def pytest_configure(config: Any) -> None:
    """Watch this run, if it was asked for."""
    target = os.environ.get("RANGER_SIM_REACH")
    if target and not RUNS_COMPILED:
        reach = Reach(pathlib.Path(target))
        config.pluginmanager.register(reach, "ranger-sim-reach")
        reach.start()
