"""examples/servo as a whole: nothing of Ranger in it, one trace in every mode, its table generated and readable."""

import pathlib
import subprocess
import sys

import cantools
import pytest

from ranger_sim.datatable import generate
from ranger_sim.datatable.loader import load_table
from tests.firmware_sim.native.support import COMPILER

SERVO = pathlib.Path(__file__).resolve().parents[2] / "examples" / "servo"
RANGERS = (
    "ranger_sim.boards",
    "ranger_sim.datatable.generated",
    "ranger_sim.ranger.conditions",
    "ranger_sim.ranger.robot",
    "ranger_sim.ranger.wiring",
    "ranger_sim.plant.mechanics.body",
    "ranger_sim.plant.ranger",
    "ranger_sim.sysid",
    "ranger_sim.tools",
)
needs_a_compiler = pytest.mark.skipif(not COMPILER, reason="no C compiler is installed here")


def said(program, **environment):
    """What a program printed, run with the servo's own modules in a fresh process."""
    import os

    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=SERVO,
        env={**os.environ, "PYTHONPATH": str(SERVO.parents[1]), **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


RUN = """
import contextlib
from servo import Servo
with contextlib.closing(Servo(seed=3)) as servo:
    servo.inject("DRIVE.current", "noise", at="0.1 s", until="+50 ms")
    servo.run_for(0.4)
    print(servo.trace_digest())
"""


@needs_a_compiler
def test_the_trace_is_the_same_compiled_and_interpreted_and_another_one_for_another_seed():
    compiled = said(RUN)
    assert said(RUN, RANGER_SIM_INTERPRETED="1") == compiled
    assert said(RUN.replace("seed=3", "seed=4")) != compiled


@needs_a_compiler
def test_nothing_of_ranger_is_imported_by_a_run_with_faults_slots_frames_and_proof():
    program = f"""
import contextlib, sys
from servo import Servo
from ranger_sim.harness.testing.health import Expected, Health
with contextlib.closing(Servo()) as servo:
    servo.slots("DRIVE"), servo.wire()
    fault = servo.inject("DRIVE.encoder", "stuck", at="0.05 s", proof=True)
    servo.until("error DRIVE_FAULT from CONTROL", within="2 s")
    print(fault.detected.code, servo.wire().assert_period("DRIVE_RATE", "4 ms", jitter="300 us").count > 1)
    print(len(Health(servo, from_power_up=True).faults(Expected())))
print([name for name in sys.modules if name.startswith({RANGERS!r})])
"""
    assert said(program).splitlines() == ["ENCODER_DEAD True", "2", "[]"]


def test_what_is_generated_is_of_the_table_and_without_what_only_a_main_brain_has():
    table = load_table(SERVO / "table")
    assert generate.stale(table, SERVO / "table" / "generated") == []
    names = set(generate.generated_files(table))
    assert {"c/drive_table.h", "c/control_table.c", "can1.dbc", "catalogue.json"} <= names
    assert not {name for name in names if name.endswith((".py", ".a2l"))}


def test_the_dbc_file_has_the_periods_and_units_of_the_table():
    database = cantools.database.load_file(SERVO / "table" / "generated" / "can1.dbc")
    angle = database.get_message_by_name("DRIVE_ANGLE")
    assert (angle.frame_id, angle.senders, angle.dbc.attributes["PeriodMs"].value) == (32, ["DRIVE"], 2.0)
    assert angle.get_signal_by_name("value").unit == "rad"
    assert angle.decode(b"\x00\x00\xc0\x3f\x05\x00\x00\x00") == {"value": 1.5, "time_ms": 5}
