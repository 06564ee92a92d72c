"""Fixtures of the whole robot."""

import contextlib
import os
import pathlib
import subprocess
import sys

import pytest

from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario

ROOT = pathlib.Path(__file__).resolve().parents[2]


@pytest.fixture
def walking():
    """A robot in its default scenario, walking for some steps already."""
    with contextlib.closing(Ranger(Scenario(), log="window")) as robot:
        robot.run_for(6.0)
        assert not robot.ended
        yield robot


@pytest.fixture
def command():
    """Run the command line in its own process: command("walk", ...) -> CompletedProcess."""

    def run(*arguments, interpreted=None, **environment):
        env = {**os.environ, **environment}
        if interpreted is not None:
            env["RANGER_SIM_INTERPRETED"] = "1" if interpreted else ""
        return subprocess.run(
            [sys.executable, "-m", "ranger_sim", *map(str, arguments)],
            cwd=ROOT,
            env=env,
            capture_output=True,
            text=True,
            check=False,
            timeout=600,
        )

    return run
