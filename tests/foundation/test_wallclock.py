"""The clock that people set gives only stamps for other programs and dates of records: a jump loses nothing."""

import ast
import pathlib

from ranger_sim.can_bus.edge.host import BusHost
from ranger_sim.can_bus.edge.paced import PacedBus
from ranger_sim.foundation import wallclock

PACKAGES = pathlib.Path(__file__).parents[2] / "ranger_sim"
# Who reads it, and for what.
READERS = {
    ("epoch_ns", "can_bus/edge/host.py"),  # when a bus began, once: stamps of frames for other programs
    ("epoch_ns", "can_bus/edge/paced.py"),  # the same
    ("today_iso", "tools/bench/command.py"),  # the date of a record
    ("today_iso", "tools/campaign/work.py"),  # the date of a document's tables
}


def readers_in(path, name):
    text = path.read_text(encoding="utf-8")
    if "epoch_ns" not in text and "today_iso" not in text:
        return set()
    called = {ast.unparse(each.func) for each in ast.walk(ast.parse(text)) if isinstance(each, ast.Call)}
    return {(what, name) for what in ("epoch_ns", "today_iso") if {what, f"wallclock.{what}"} & called}


def test_the_clock_that_people_set_is_read_for_stamps_and_dates_only():
    found = set()
    for package in PACKAGES.iterdir():
        for path in package.resolve().glob("**/*.py") if package.is_dir() else ():
            name = f"{package.name}/{path.relative_to(package.resolve()).as_posix()}"
            found |= readers_in(path, name)
    assert found == READERS


def test_a_clock_that_jumps_while_a_bus_runs_moves_no_stamp(monkeypatch):
    read = []

    def jumping():
        read.append((-1) ** len(read) * 3_600_000_000_000 * len(read) + 10**18)
        return read[-1]

    monkeypatch.setattr(wallclock, "epoch_ns", jumping)
    bus = PacedBus("can1", 1_000_000)
    host = BusHost([bus])
    began = len(read)
    for _ in range(20):
        host.turn(0.001)
    assert len(read) == began == 2 and bus.epoch_ns == read[1]
