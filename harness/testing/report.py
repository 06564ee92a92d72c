"""What a report says of the machines of a test: their properties, and after a failure how to repeat it."""

from __future__ import annotations

import pathlib
import re
import shlex
from typing import TYPE_CHECKING

import pytest

from ranger_sim.harness.testing.marks import expected_of
from ranger_sim.harness.testing.options import option

if TYPE_CHECKING:
    from ranger_sim.harness.machine import Machine
    from ranger_sim.harness.testing.health import Health
    from ranger_sim.harness.testing.making import Order

LAST_FRAMES = 12  # in the report of a failure
LAST_ERRORS = 8


class Watched:
    """A machine that a fixture has made, with what the report of a test about it needs."""

    def __init__(self, robot: Machine, order: Order, health: Health) -> None:
        self.robot = robot
        self.order = order
        self.health = health


def properties(watched: Watched) -> list[tuple[str, object]]:
    """A robot's properties for JUnit XML."""
    from ranger_sim import __version__, loading

    found: list[tuple[str, object]] = [
        ("ranger_sim_version", __version__),
        ("ranger_sim_runs", "compiled" if loading.RUNS_COMPILED else "interpreted"),
        ("ranger_sim_table", watched.robot.names.hash),
        ("ranger_sim_backend", watched.order.backend),
        ("ranger_sim_seed", watched.order.seed),
    ]
    return found + [(figure.name, figure.text()) for figure in watched.robot.observed.figures]


def description(item: pytest.Item, watched: Watched) -> str:
    """Seed, command, last events, and the trace, for the reader of a failure."""
    robot, order = watched.robot, watched.order
    command = ["pytest", item.nodeid, *order.arguments()]
    where = robot.whereabouts().replace(", in ", ", ")
    lines = [
        f"{order.describe()}; {robot.time_s:.6f} s since power-up{where}",
        f"once more: {shlex.join(command)}",
        *(f"also: {line}" for line in ([] if robot.lost else watched.health.faults(expected_of(item)))),
        "last errors that boards sent, beyond what is normal:",
        *last_errors(robot),
        "last frames:",
        *([f"  {frame.text()}" for frame in robot.observed.keeper.latest(LAST_FRAMES)] or ["  none"]),
    ]
    return "\n".join(lines + trace_of(item, watched))


def last_errors(robot: Machine) -> list[str]:
    """The last error frames, without those of errors that are normal on their board."""
    names, keeper = robot.names, robot.observed.keeper
    numbers = names.error_variables()
    frames = sorted(frame for bus in keeper.streams for frame in keeper.frames(bus, numbers))
    found = [f"  {frame.text()}" for frame in frames if not names.is_normal(frame.lo)]
    return found[-LAST_ERRORS:] or ["  none"]


def trace_of(item: pytest.Item, watched: Watched) -> list[str]:
    """The last seconds of a failed test as a timeline, where requested: its path, or why it is missing."""
    timeline = watched.robot.observed.timeline
    if timeline is None:
        return []
    from ranger_sim.foundation.user_error import UserError

    folder = pathlib.Path(option(item.config, "trace"))
    path = folder / (re.sub(r"[^\w.-]+", "_", item.nodeid) + ".pftrace")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        timeline.write(path)
    except (UserError, OSError) as reason:
        return [f"no trace: {reason}"]
    return [f"trace: ranger-sim trace open {shlex.quote(str(path))}"]
