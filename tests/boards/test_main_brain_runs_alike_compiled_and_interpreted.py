"""The same bits from the same sources, compiled or not: every word of the data table in every slot."""

import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).parents[2]
PROGRAM = """
import hashlib
from tests.boards.bare_body import BareRobot

robot = BareRobot("robust")
digest = hashlib.sha256()
step = robot.step

def digested_step():
    step()
    digest.update(repr(list(robot.store.words)).encode())
    digest.update(repr(list(robot.store.stamps)).encode())

robot.step = digested_step
robot.start()
robot.walk(4, 3.0)
print(robot.body.record.steps, digest.hexdigest())
"""


def digest_of_a_run(interpreted) -> str:
    environment = {**os.environ, "RANGER_SIM_INTERPRETED": "1" if interpreted else "0", "PYTHONPATH": str(ROOT)}
    run = subprocess.run(
        [sys.executable, "-c", PROGRAM], cwd=ROOT, env=environment, capture_output=True, text=True, check=True
    )
    return run.stdout.strip()


def test_four_steps_of_the_bare_body_leave_the_same_words_in_the_table():
    compiled = digest_of_a_run(interpreted=False)
    assert compiled.startswith("4 ")
    assert digest_of_a_run(interpreted=True) == compiled
