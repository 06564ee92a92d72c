"""A table of the user's own, in a folder of theirs: a variable more, known to every board, without a clone."""

import os
import subprocess
import sys

import pytest

from ranger_sim import datatable, loading
from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools import cli

# One spare has another name, unit and start value; one variable is new, beyond every id of ours.
SPARE = "30,MCH_EMPTY_RX1,"
RENAMED = "30,MCH_COIL,f32,K,293,MCH,MB,CAN1;SSP,,250,450,temperature of the winding\n"
NEW = "1900,MCH_BRUSHES,f32,V,0,MCH,MB,CAN1;SSP,,0,5,drop of the brushes\n"

PROGRAM = """
from ranger_sim import Ranger, Scenario
from ranger_sim.datatable.generated import mch as table
from ranger_sim.foundation.numbers import word_of_float

robot = Ranger(Scenario())
hip = robot.board("MCH")
before = robot.variable("MCH_COIL")

def task():
    hip.can.send_words(table.MCH_COIL, word_of_float(310.5), hip.can.time.ms)
    hip.can.send_words(table.MCH_BRUSHES, word_of_float(1.25), hip.can.time.ms)

robot.replace("MCH", "dn_safety", task, cost=900, limit=2000)
robot.run_for(0.05)
print(before, robot.variable("MCH_COIL"), robot.variable("MCH_BRUSHES"), table.MCH_BRUSHES)
"""


@pytest.fixture(scope="module")
def mine(tmp_path_factory):
    """A copy of our table with both changes, and what is generated from it."""
    folder = tmp_path_factory.mktemp("own") / "mine"
    assert cli.main(["table", "copy", str(folder)]) == 0
    variables = folder / "variables.csv"
    lines = variables.read_text(encoding="utf-8").splitlines(keepends=True)
    changed = [RENAMED if line.startswith(SPARE) else line for line in lines]
    assert changed != lines
    variables.write_text("".join([*changed, NEW]), encoding="utf-8")
    assert cli.main(["table", "generate", "--master", str(folder)]) == 0
    return folder


def test_the_robot_runs_on_it_and_carries_what_ours_has_not(mine):
    environment = {**os.environ, "RANGER_SIM_TABLE": str(mine)}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, check=False, timeout=120
    )
    assert (done.stderr, done.stdout) == ("", "293.0 310.5 1.25 1900\n")
    assert 'SG_ value : 0|32@1- (1,0) [250|450] "K"' in (mine / "generated" / "can1.dbc").read_text(encoding="utf-8")


def test_a_table_that_changed_after_its_code_was_made_is_refused(mine, monkeypatch):
    datatable.check_own_table()  # nobody's own: nothing to say
    monkeypatch.setattr(loading, "OWN_TABLE", mine)
    with pytest.raises(UserError, match=r"mine: changed after code generation: .*--master"):
        datatable.check_own_table()


def test_a_folder_without_generated_code_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(loading, "OWN_TABLE", tmp_path)
    with pytest.raises(UserError, match="RANGER_SIM_TABLE: nothing was generated in"):
        datatable.place_of_generated(["ours"])


def test_a_copy_never_goes_over_a_folder_that_is_there(tmp_path, capsys):
    assert cli.main(["table", "copy", str(tmp_path)]) == 2
    assert capsys.readouterr().err == f"ranger-sim: {tmp_path}: File exists: the copy needs a new folder\n"
