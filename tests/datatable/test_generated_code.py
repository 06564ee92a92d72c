"""What is generated from the table: fresh, dateless, and saying what the table says."""

import importlib
import json
import re

import pytest

from ranger_sim.datatable.generate import GENERATED_FOLDER, generated_files, stale, write
from ranger_sim.datatable.loader import load_table
from ranger_sim.datatable.packing import error_word, parts_of_error_word
from ranger_sim.foundation.user_error import UserError

from . import small_table


@pytest.fixture(scope="module")
def table():
    return load_table()


def module(name):
    return importlib.import_module(f"ranger_sim.datatable.generated.{name}")


def test_the_files_checked_in_are_what_the_table_gives(table):
    assert stale(table) == []
    assert {path.suffix for path in GENERATED_FOLDER.rglob("*") if path.is_file()} >= {
        ".py",
        ".c",
        ".h",
        ".dbc",
        ".json",
        ".a2l",
    }


def test_no_generated_file_carries_a_date_or_a_path(table):
    for name, text in generated_files(table).items():
        assert not re.search(r"\b(19|20)\d\d-\d\d-\d\d\b|\b\d\d:\d\d:\d\d\b|/home/|/tmp/", text), name


def test_a_second_writing_changes_nothing(table, tmp_path):
    assert write(table, tmp_path) == sorted(generated_files(table))
    assert write(table, tmp_path) == []


@pytest.mark.parametrize("name", ["mch.py", "c/mch_table.h", "can1.dbc", "catalogue.json"])
def test_a_changed_missing_or_left_over_file_is_stale_and_is_mended(table, tmp_path, name):
    write(table, tmp_path)
    path = tmp_path / name
    path.write_bytes(path.read_bytes() + b" ")
    (tmp_path / "arm.py").write_text("LEFT_OVER = 1\n")
    assert stale(table, tmp_path) == sorted(["arm.py", name])
    path.unlink()
    assert write(table, tmp_path) == sorted(["arm.py", name])
    assert not (tmp_path / "arm.py").exists() and stale(table, tmp_path) == []


def test_a_folder_that_cannot_be_written_is_one_clear_line(table, tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(UserError, match="cannot be written") as caught:
        write(table, tmp_path / "file")
    assert "\n" not in str(caught.value)


def test_a_changed_master_table_makes_the_generated_files_stale(tmp_path):
    write(load_table(small_table.write(tmp_path)), tmp_path / "out")
    small_table.write(tmp_path, variables=small_table.VARIABLES.replace("-12.5,12.5", "-12.5,13"))
    # the range of one variable on CAN1: its DBC, the catalogue, the A2L file; and wherever the table's hash stands
    changed = ["all_variables.py", "can1.dbc", "catalogue.json", "ranger.a2l"]
    assert stale(load_table(tmp_path), tmp_path / "out") == changed


def test_a_spare_that_is_renamed_reaches_the_code_of_its_board_only(tmp_path):
    spare = "7,LEG_EMPTY_TX1,f32,,0,MB,LEG,CAN1;SSP,,,,spare\n"
    small_table.write(tmp_path, variables=small_table.VARIABLES + spare)
    write(load_table(tmp_path), tmp_path / "out")
    used = "7,LEG_LIMIT,f32,A,0,MB,LEG,CAN1;SSP,,,,a limit\n"
    small_table.write(tmp_path, variables=small_table.VARIABLES + used)
    changed = stale(load_table(tmp_path), tmp_path / "out")
    boards = {
        name for name in changed if name.endswith(("_table.c", "_table.h")) or name in ("leg.py", "keys.py", "mb.py")
    }
    version = "c/ranger_table.h"  # whose table it is; no code
    assert boards == {version, "c/leg_table.c", "c/leg_table.h", "c/mb_table.c", "c/mb_table.h", "leg.py", "mb.py"}


# ---- known answers of the Python modules


def test_the_hip_boards_module_has_its_ids_lists_and_start_values():
    mch = module("mch")
    assert (mch.BOARD, mch.BOARD_NUMBER, mch.BUS, mch.CONTROLLER, mch.SLOT_US, mch.ROWS) == (
        "MCH",
        3,
        "CAN1",
        1,
        500,
        4,
    )
    assert (mch.MCH_ANGLE, mch.MCH_ANG_RATE, mch.TIMESTAMP, mch.ERROR_VARIABLE) == (14, 21, 0, 3)
    assert mch.RECEIVE == (0, 9, 13, 16, 17, 18, 19, 20, 25, 26)
    assert mch.RECEIVE_TYPES[:5] == ("u32", "f32", "f32", "i32", "i32")
    assert mch.SEND == (3, 10, 11, 12, 14, 15, 21, 22, 23, 24, 27, 28, 29, 30, 31, 32)
    assert not hasattr(mch, "MCFO_MOTOR_POSITION")


def test_the_main_brain_sends_the_robots_fifty_identifiers_in_table_order():
    mb = module("mb")
    # robot.md N2.3: status; each motor board's eight (two for the old steering board); the display; the errors
    motor = [
        [first, *shutdown_to_dampness, *spares]
        for first, shutdown_to_dampness, spares in (
            (13, range(16, 21), (25, 26)),
            (36, (42, 43, 45, 46, 47), (53, 54)),
            (64, (71, 72, 73, 74, 75), (81, 82)),
            (111, range(114, 119), (122, 123)),
        )
    ]
    interface = [*range(130, 142), 155, 156]
    known = sorted([9, *sum(motor, []), 101, 102, *interface, 173])
    assert len(known) == 50
    assert list(mb.SEND) == known


def test_the_main_brain_knows_every_variable(table):
    mb = module("mb")
    assert mb.NAMES == {variable.id: variable.name for variable in table.variables}
    assert mb.INITIAL[mb.CTRL_HIP_KP] == 25.0 and mb.INITIAL[mb.GAIT_USE_MDP_DATA] == 1.0 and mb.INITIAL[313] == 313.0


@pytest.mark.parametrize("name", ["mb", "csr", "mch", "mcfo", "mcfi", "mcsi", "ui"])
def test_a_boards_module_says_what_the_table_says(table, name):
    generated = module(name)
    board = table.board(name.upper())
    assert all(getattr(generated, table.variable(number).name) == number for number in generated.NAMES)
    if name != "mb":
        assert set(generated.SEND) == {v.id for v in table.published_by(board.name) if v.buses}
    assert set(generated.RECEIVE) == {v.id for v in table.subscribed_by(board.name) if v.buses}
    for numbers, types in ((generated.SEND, generated.SEND_TYPES), (generated.RECEIVE, generated.RECEIVE_TYPES)):
        assert types == tuple(table.variable(number).type for number in numbers)
    assert generated.TYPES == {number: table.variable(number).type for number in generated.NAMES}
    assert generated.INITIAL == {number: table.variable(number).initial_as_stored for number in generated.NAMES}
    assert set(generated.ERRORS) == {error.id for error in table.errors if board.name in error.boards}


def test_all_variables_and_errors_can_be_looked_up_both_ways(table):
    everything, errors = module("all_variables"), module("errors")
    assert everything.TABLE_HASH == table.hash
    assert everything.TABLE_SIZE == max(everything.NAMES) + 1
    assert all(everything.ID_OF[name] == number for number, name in everything.NAMES.items())
    assert everything.UNITS[14] == "rad" and everything.PUBLISHERS[14] == "MCH" and everything.TYPES[16] == "i32"
    assert everything.BOARD_NUMBERS["UI"] == 8 and everything.BOARD_NAMES[3] == "MCH"
    assert errors.ASCHED_DNF == 62 and errors.NAMES[62] == "ASCHED_DNF" and errors.LAST == max(errors.NAMES) + 1
    assert set(errors.DESCRIPTIONS) == set(errors.NAMES)


def test_the_catalogue_has_every_variable_error_and_board(table):
    content = json.loads((GENERATED_FOLDER / "catalogue.json").read_text(encoding="utf-8"))
    assert content["format"] == 1 and content["table_hash"] == table.hash
    assert [row["id"] for row in content["variables"]] == [variable.id for variable in table.variables]
    assert len(content["errors"]) == len(table.errors) and len(content["boards"]) == len(table.boards)
    angle = content["variables"][14]
    assert (angle["name"], angle["period_ms"], angle["buses"]) == ("MCH_ANGLE", 2.0, ["CAN1", "SSP"])
    assert content["variables"][3]["error_word"] and content["variables"][25]["spare"]


def test_an_error_word_has_code_board_and_count_in_16_6_and_10_bits():
    assert error_word(62, 3, 1) == 62 | 3 << 16 | 1 << 22
    assert error_word(0xFFFF, 63, 1023) == 0xFFFFFFFF
    assert parts_of_error_word(error_word(109, 5, 7)) == (109, 5, 7)
    assert parts_of_error_word(error_word(1, 1, 5000)) == (1, 1, 1023)
