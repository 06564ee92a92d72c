"""Ctrl-C arrives also where Python drops what is raised: in callbacks of the garbage collector and in finalizers."""

import subprocess
import sys

import pytest

PROGRAM = """
import gc, signal, sys, threading
from ranger_sim.tools.command_line import interrupts

NUMBER = getattr(signal, sys.argv[2])

def once(*_):
    gc.callbacks.clear()
    signal.raise_signal(NUMBER)

class Last:
    __del__ = once

interrupts.end_in_order()
if sys.argv[1] == "collector":
    gc.callbacks.append(once)
    gc.collect()
else:
    Last()
print("goes on", flush=True)
try:
    threading.Event().wait(20.0)
except KeyboardInterrupt:
    print("interrupted")
"""
IN_TEXT = """
import sys
from ranger_sim.tools import cli, info

def interrupted(_options):
    exec("raise KeyboardInterrupt")  # as in the text of a dataclass, while its module loads

info.run = interrupted
sys.exit(cli.main(["info"]))
"""
PATIENCE_S = 60.0


@pytest.mark.parametrize("signal_name", ["SIGINT", "SIGTERM"])
@pytest.mark.parametrize("where", ["collector", "finalizer"])
def test_an_interrupt_that_python_dropped_is_raised_again(where, signal_name):
    ended = subprocess.run(
        [sys.executable, "-c", PROGRAM, where, signal_name], capture_output=True, text=True, timeout=PATIENCE_S
    )
    assert ended.stdout.split("\n")[-2] == "interrupted" and not ended.stderr and not ended.returncode


def test_an_interrupt_in_text_that_python_runs_ends_a_command_with_its_code(tmp_path):
    (tmp_path / "in_text.py").write_text(IN_TEXT, encoding="utf-8")
    ended = subprocess.run(
        [sys.executable, "-m", "in_text"], capture_output=True, text=True, timeout=PATIENCE_S, cwd=tmp_path
    )
    assert ended.returncode == 130 and ended.stderr == "ranger-sim: interrupted\n"
