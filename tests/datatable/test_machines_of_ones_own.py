"""A table without main brain, router and serial link: what it may have, what it may not, and what is made of it."""

import pytest

from ranger_sim.datatable import generate
from ranger_sim.datatable.loader import load_table
from ranger_sim.foundation.user_error import TableError

BOARDS = """\
[buses]
CAN1 = { channel = 1, bit_rate = 500_000 }
CAN2 = { channel = 2, bit_rate = 250_000 }

[boards.ARM]
number = 1
description = "an arm"
controller = 1
buses = ["CAN1"]
firmware = true
slot_us = 1000
rows = [["ARM_ANGLE"], []]

[boards.DESK]
number = 2
description = "a desk on both buses"
controller = 2
buses = ["CAN1", "CAN2"]
firmware = true
slot_us = 1000
rows = [[]]
"""
HEAD = "id,name,type,unit,initial,publisher,subscribers,bus,period_ms,minimum,maximum,description\n"
ROWS = "1,ARM_ANGLE,f32,rad,0,ARM,DESK,CAN1,2,,,an angle\n2000,DESK_LAMP,u32,,0,DESK,ARM,CAN1,,0,1,a lamp\n"
ERRORS = "id,name,boards,normal_per_s,normal_at_start,description\n0,DEFAULT,ARM;DESK,,,nothing wrong\n"


def table(folder, boards=BOARDS, rows=ROWS):
    (folder / "boards.toml").write_text(boards, encoding="utf-8")
    (folder / "variables.csv").write_text(HEAD + rows, encoding="utf-8")
    (folder / "errors.csv").write_text(ERRORS, encoding="utf-8")
    return load_table(folder)


def test_boards_without_a_ribbon_and_any_controller_on_any_bus_are_taken(tmp_path):
    found = table(tmp_path)
    assert [(board.name, board.controller, board.ribbon) for board in found.boards] == [("ARM", 1, 0), ("DESK", 2, 0)]
    assert found.variable("DESK_LAMP").id == 2000  # of XCP on the robot alone


def test_c_dbc_and_catalogue_are_made_of_it_and_nothing_that_needs_a_main_brain(tmp_path):
    names = set(generate.generated_files(table(tmp_path)))
    assert names == {
        "c/arm_table.c", "c/arm_table.h", "c/desk_table.c", "c/desk_table.h", "c/ranger_errors.h", "c/ranger_table.h",
        "can1.dbc", "can2.dbc", "catalogue.json",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("boards", "rows", "rule"),
    [
        (BOARDS, ROWS.replace("DESK,CAN1,2", "DESK,CAN2,2"), "does not get from ARM to DESK: they have CAN1 in common"),
        (BOARDS.replace('"CAN1", "CAN2"', '"CAN2"'), ROWS, "does not get from ARM to DESK: they have no bus in common"),
        (BOARDS.replace("number = 2\n", 'number = 2\nrole = "router"\n'), ROWS, "SSP, the link .* is missing"),
        (BOARDS.replace("number = 2\n", 'number = 2\nrole = "main brain"\n'), ROWS, "must have the role 'router'"),
        (BOARDS.replace("[boards.ARM]", "SSP = { channel = 0, bit_rate = 1 }\n\n[boards.ARM]"), ROWS, "'main brain'"),
        (BOARDS.replace("controller = 1\n", "controller = 1\nribbon = 1\n"), ROWS, "'ribbon': is not a key of a board"),
    ],
)
def test_parts_that_do_not_belong_together_are_reported(tmp_path, boards, rows, rule):
    with pytest.raises(TableError, match=rule):
        table(tmp_path, boards, rows)


def test_a_processor_without_a_model_and_a_clock_above_its_highest_are_refused(tmp_path):
    """The LPC2194's user manual allows 60 MHz. Without a processor any clock is taken."""
    at = "slot_us = 1000\nrows = [["
    unknown = BOARDS.replace(at, 'processor = "STM32F4"\nclock_hz = 168_000_000\n' + at, 1)
    with pytest.raises(TableError, match=r"boards.toml:5 ARM processor: no model of 'STM32F4' \(available: LPC2194, "):
        table(tmp_path, unknown)
    fast = unknown.replace("STM32F4", "LPC2194")
    with pytest.raises(TableError, match="ARM clock_hz: is 168000000, above the 60000000 Hz of an LPC2194"):
        table(tmp_path, fast)
    assert table(tmp_path, fast.replace('processor = "LPC2194"\n', "")).board("ARM").clock_hz == 168_000_000
    elsewhere = unknown.replace("firmware = true", "firmware = false", 1)  # a board that runs somewhere else
    assert table(tmp_path, elsewhere).board("ARM").processor == "STM32F4"
