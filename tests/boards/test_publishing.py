"""What boards publish: lines of a package's table, laid out as the master table says; and how a variable is added."""

import os
import pathlib
import re
import shutil
import subprocess
import sys
import types

import pytest

from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.boards.modules.publishing import Send, laid_out
from ranger_sim.boards.modules.sender import Sender
from ranger_sim.firmware_sim.scheduler import Occasional, Schedule, Task
from ranger_sim.foundation.numbers import word_of_float
from ranger_sim.foundation.user_error import UserError
from ranger_sim.loading import packages

ROOT = pathlib.Path(__file__).resolve().parents[2]


class Heard(Sender):
    """A sender that keeps what it is given."""

    def __init__(self):
        Sender.__init__(self, NetworkTime())
        self.frames = []

    def send_words(self, identifier, value_word, time_word):
        self.frames.append((identifier, value_word, time_word))
        return True


TABLE = types.SimpleNamespace(
    BOARD="LEG",
    ANGLE=7,
    KEYS=8,
    ERROR_LEG=9,
    TYPES={7: "f32", 8: "i32", 9: "u32"},
    ROW_NAMES=(("ANGLE",), ("KEYS", "ANGLE"), ()),
    OCCASIONAL_NAMES=("ERROR_LEG", "(sweep)", "KEYS"),
    OCCASIONAL_ROW=2,
)


def sweep():
    return None


def lines(value=1.5, keys=lambda: -3, errors=None):
    errors = errors if errors is not None else ErrorModule(5, NetworkTime())
    return [
        Send("ANGLE", value, 420, 560),
        Send("KEYS", keys, 300, 400),
        Send("ERROR_LEG", errors, 200, 270),
        Task(sweep, 700, 940),
    ]


def test_lines_are_in_the_rows_that_the_master_table_names():
    schedule = Schedule(slot_us=500, **laid_out(TABLE, Heard(), lines()))
    rows = [[task.name for task in row] for row in schedule.rows]
    assert rows == [["ANGLE"], ["KEYS", "ANGLE"], ["occasional"]]
    occasional = schedule.rows[2][0]
    assert isinstance(occasional, Occasional)
    assert [task.name for task in occasional.tasks] == ["ERROR_LEG", "sweep", "KEYS"]
    assert [(task.cost, task.limit) for task in occasional.tasks] == [(200, 270), (700, 940), (300, 400)]
    assert schedule.rows[0][0] is schedule.rows[1][1]  # one line, however often it is named


def test_a_value_goes_out_as_the_tables_type_stamped_with_the_network_time():
    received = Heard()
    received.time.ms = 77
    values = [0.25, 0.5]
    rows = laid_out(TABLE, received, lines(value=lambda: values.pop(0)))["rows"]
    for task in (*rows[0], *rows[1]):
        task.function()
    assert received.frames == [(7, word_of_float(0.25), 77), (8, 2**32 - 3, 77), (7, word_of_float(0.5), 77)]


def test_a_number_that_never_changes_is_sent_as_it_is():
    received = Heard()
    laid_out(TABLE, received, lines(value=1.5))["rows"][0][0].function()
    assert received.frames == [(7, word_of_float(1.5), 0)]


def test_an_error_goes_out_only_while_one_waits_with_the_stamp_of_its_first_time():
    received = Heard()
    errors = ErrorModule(5, NetworkTime())
    send = laid_out(TABLE, received, lines(errors=errors))["occasional"][0].function
    send()
    assert received.frames == []
    errors.time.ms = 12
    errors.report(34)
    errors.update()
    received.time.ms = 99
    send()
    send()
    assert received.frames == [(9, 34 | 5 << 16 | 1 << 22, 12)]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (lines()[:1] + lines()[2:], "LEG: line 2 of what is sent is ERROR_LEG in the board's package; .* has KEYS"),
        (lines()[:3], r"line 4 of what is sent is no more in the board's package; .* has \(sweep\)"),
        ([*lines(), Send("SPEED", 1.0, 1, 2)], "line 5 of what is sent is SPEED in the board's .* has no more"),
        ([lines()[1], lines()[0], *lines()[2:]], "line 1 of what is sent is KEYS in the board's package; .* has ANGLE"),
    ],
    ids=["missing", "missing at the end", "too many", "another order"],
)
def test_a_line_that_is_not_the_tables_is_refused_by_its_place_and_name(given, message):
    with pytest.raises(UserError, match=message):
        laid_out(TABLE, Heard(), given)


# --- how a variable is added ------------------------------------------------------------------------------------


def copy_of_the_house(folder):
    """The packages without what was built."""
    unwanted = shutil.ignore_patterns("__pycache__", "*.so", "build_record.json", "*.c")
    for name in ("ranger_sim", *packages(), "profiles"):
        shutil.copytree(ROOT / name, folder / name, symlinks=True, ignore=unwanted)
    return folder


def edit(path, before, after):
    text = path.read_text(encoding="utf-8")
    assert text.count(before) == 1
    path.write_text(text.replace(before, after), encoding="utf-8")


def run(folder, *arguments):
    """Python in the copy, which knows nothing of the repository that it was copied from."""
    environment = os.environ | {"RANGER_SIM_INTERPRETED": "1", "PYTHONPATH": str(folder)}
    return subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


HEAR_A_NEW_VARIABLE = """
from ranger_sim.boards.hip import HipBoard
from ranger_sim.foundation.events import CAN_REQUEST
from ranger_sim.foundation.numbers import float_of_word
board = HipBoard()
board.words[0] = board.encoder.zero + 100
board.advance(2_000_000)
while board.outbox.take():
    if board.outbox.kind == CAN_REQUEST and board.outbox.c == 475:
        print(board.outbox.time // 500_000, float_of_word(board.outbox.e))
"""


def test_adding_a_variable_takes_a_line_a_name_in_a_row_and_a_send_and_nothing_else(tmp_path):
    """The three steps of "How to add a variable", on a copy; what is forgotten is reported at once."""
    house = copy_of_the_house(tmp_path)
    generate = ("-m", "ranger_sim", "table", "generate")
    with open(house / "datatable/master/variables.csv", "a", encoding="utf-8") as variables:
        variables.write("475,MCH_SPIKES,f32,counts,0,MCH,MB,CAN1;SSP,2,0,,joint encoder before its zero is taken off\n")
    forgotten = run(house, *generate)
    assert forgotten.returncode != 0 and "no schedule serves 2 ms: MCH never sends it" in forgotten.stderr
    edit(house / "datatable/master/boards.toml", 'rows = [["MCH_ANGLE"],', 'rows = [["MCH_ANGLE", "MCH_SPIKES"],')
    done = run(house, *generate)
    assert done.returncode == 0, done.stderr
    forgotten = run(house, "-c", HEAR_A_NEW_VARIABLE)
    assert "line 2 of what is sent is MCH_ANG_RATE in the board's package" in forgotten.stderr
    hip = house / "boards/hip.py"
    line = re.search(r'^ *Send\("MCH_ANGLE".*\n', hip.read_text(encoding="utf-8"), re.MULTILINE).group(0)
    edit(hip, line, line + " " * 16 + 'Send("MCH_SPIKES", lambda: board.encoder.value, 260, 400),\n')
    received = run(house, "-c", HEAR_A_NEW_VARIABLE)
    # the first slot begins after 0.5 ms, and its first row comes round in every fourth
    assert received.stdout == "1 4690.0\n", received.stderr
