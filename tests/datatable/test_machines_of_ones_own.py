"""A table without main brain, router and serial link: what it may have, what it may not, and what is made of it."""

import json
import struct
import subprocess

import cantools
import pytest

from ranger_sim.datatable import generate
from ranger_sim.datatable.loader import load_table
from ranger_sim.firmware_sim.native.compiler import compiler
from ranger_sim.foundation.user_error import TableError
from tests.firmware_sim.native.support import COMPILER

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
    """The user manuals allow the LPC2194 60 MHz and the LPC3250 208 MHz. Without a processor any clock is taken."""
    at = "slot_us = 1000\nrows = [["
    unknown = BOARDS.replace(at, 'processor = "STM32F4"\nclock_hz = 168_000_000\n' + at, 1)
    with pytest.raises(TableError, match=r"boards.toml:5 ARM processor: no model of 'STM32F4' \(available: LPC2194, "):
        table(tmp_path, unknown)
    fast = unknown.replace("STM32F4", "LPC2194")
    with pytest.raises(TableError, match="ARM clock_hz: is 168000000, above the 60000000 Hz of an LPC2194"):
        table(tmp_path, fast)
    for processor, highest in (("LPC2194", 60_000_000), ("LPC2194/01", 60_000_000), ("LPC3250", 208_000_000)):
        named = unknown.replace("STM32F4", processor)
        allowed = named.replace("168_000_000", str(highest))
        assert table(tmp_path, allowed).board("ARM").clock_hz == highest
        with pytest.raises(TableError, match=f"clock_hz: is {highest + 1}, above the {highest} Hz of an {processor}"):
            table(tmp_path, named.replace("168_000_000", str(highest + 1)))
    assert table(tmp_path, fast.replace('processor = "LPC2194"\n', "")).board("ARM").clock_hz == 168_000_000
    elsewhere = unknown.replace("firmware = true", "firmware = false", 1)  # a board that runs somewhere else
    assert table(tmp_path, elsewhere).board("ARM").processor == "STM32F4"


# ---- CAN FD buses

FD_BOARDS = (
    BOARDS.replace("bit_rate = 500_000", "bit_rate = 500_000, data_bit_rate = 2_000_000")
    .replace("firmware = true", "firmware = false")
    .replace('["ARM_ANGLE"], []', '["ARM_ANGLES"], ["ARM_STATE"]')
)
FD_ROWS = "1,ARM_ANGLES,f32[12],rad,0,ARM,DESK,CAN1,2,-4,4,angles\n2,ARM_STATE,u32,,0,ARM,DESK,CAN1,2,,,a state\n"


def test_messages_of_a_can_fd_bus_are_those_that_cantools_reads(tmp_path):
    """Twelve values and a time are 52 bytes, so a frame of 64."""
    found = table(tmp_path, FD_BOARDS, FD_ROWS)
    assert found.data_bit_rates == {"CAN1": 2_000_000}
    assert (found.variable("ARM_ANGLES").count, found.variable("ARM_STATE").count) == (12, 1)
    text = generate.generated_files(found)["can1.dbc"]
    database = cantools.database.load_string(text, database_format="dbc", strict=True)
    angles, state = database.get_message_by_name("ARM_ANGLES"), database.get_message_by_name("ARM_STATE")
    assert (angles.is_fd, angles.length, state.is_fd, state.length) == (True, 64, True, 8)
    data = struct.pack("<12fI", *(0.25 * place for place in range(12)), 77).ljust(64, b"\0")
    decoded = angles.decode(data)
    assert [decoded[f"value_{place}"] for place in range(12)] == [0.25 * place for place in range(12)]
    assert decoded["time_ms"] == 77 and angles.encode(decoded) == data
    assert (angles.get_signal_by_name("value_3").unit, angles.get_signal_by_name("value_3").maximum) == ("rad", 4)
    attributes = database.dbc.attributes
    assert [attributes[name].value for name in ("BusType", "Baudrate", "BaudrateCANFD")] == ["CAN FD", 500000, 2000000]
    assert angles.dbc.attributes["CANFD_BRS"].value == 1
    assert "VFrameFormat" not in generate.generated_files(found)["can2.dbc"]


def test_the_catalogue_names_the_data_rate_and_the_number_of_values(tmp_path):
    catalogue = json.loads(generate.generated_files(table(tmp_path, FD_BOARDS, FD_ROWS))["catalogue.json"])
    assert catalogue["buses"] == [
        {"name": "CAN1", "channel": 1, "bit_rate": 500_000, "data_bit_rate": 2_000_000},
        {"name": "CAN2", "channel": 2, "bit_rate": 250_000},
    ]
    assert [row.get("count") for row in catalogue["variables"]] == [12, None]


@pytest.mark.parametrize(
    ("old", "new", "rule"),
    [
        (
            "firmware = false",
            "firmware = true",
            "ARM buses: CAN1 is a CAN FD bus, whose frames a classic controller destroys by error frames",
        ),
        (
            "data_bit_rate = 2_000_000",
            "data_bit_rate = 250_000",
            "buses CAN1: data_bit_rate 250000 is below bit_rate 500000",
        ),
        ("data_bit_rate = 2_000_000", "data_rate = 2", "buses 'CAN1': needs exactly channel and bit_rate"),
        ("f32[12]", "f32[16]", r"ARM_ANGLES type: is 'f32\[16\]', and a variable of several values has 2 ... 15"),
        ("f32[12]", "f64[12]", r"ARM_ANGLES type: is 'f64\[12\]', not one of f32, i32, u32"),
        (
            ", data_bit_rate = 2_000_000",
            "",
            r"ARM_ANGLES type: is 'f32\[12\]': several values need a CAN FD bus, and CAN1 is",
        ),
    ],
)
def test_what_a_can_fd_bus_cannot_have_is_refused_by_name(tmp_path, old, new, rule):
    boards, rows = FD_BOARDS.replace(old, new), FD_ROWS.replace(old, new)
    assert (boards, rows) != (FD_BOARDS, FD_ROWS)
    with pytest.raises(TableError, match=rule):
        table(tmp_path, boards, rows)


FIRMWARE_BOARDS = FD_BOARDS.replace("firmware = false", 'firmware = true\ncan = "fd"')


def test_a_board_with_can_fd_controllers_gets_arrays_lengths_and_rates_in_c(tmp_path):
    files = generate.generated_files(table(tmp_path, FIRMWARE_BOARDS, FD_ROWS.replace("rad,0,", "rad,0.5,")))
    header, source = files["c/arm_table.h"], files["c/arm_table.c"]
    assert "#define ARM_BIT_RATE 500000\n#define ARM_DATA_BIT_RATE 2000000\n" in header
    assert "float arm_angles[12]; /* 1 [rad] angles */" in header
    assert ".arm_angles = {0.5f, 0.5f, 0.5f, 0.5f, 0.5f, 0.5f, 0.5f, 0.5f, 0.5f, 0.5f, 0.5f, 0.5f}," in source
    assert "{ ARM_ANGLES, RANGER_F32, offsetof(struct arm_data, arm_angles), 12, 64 }," in source
    assert "{ ARM_STATE, RANGER_U32, offsetof(struct arm_data, arm_state), 1, 8 }," in source
    assert "uint8_t count;\n    uint8_t bytes;\n};" in files["c/ranger_table.h"]


@pytest.mark.skipif(not COMPILER, reason="no C compiler is installed here")
def test_the_generated_c_of_a_can_fd_table_compiles_without_a_warning(tmp_path):
    for name, text in generate.generated_files(table(tmp_path, FIRMWARE_BOARDS, FD_ROWS)).items():
        if name.startswith("c/"):
            (tmp_path / name).parent.mkdir(exist_ok=True)
            (tmp_path / name).write_text(text, encoding="utf-8")
    for board in ("arm", "desk"):
        command = [compiler(), "-std=c99", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", f"c/{board}_table.c"]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


def test_the_header_of_a_classic_table_has_nothing_of_can_fd(tmp_path):
    files = generate.generated_files(table(tmp_path))
    assert files["c/ranger_table.h"].endswith("    size_t offset;\n};\n\n#endif\n")
    assert not [name for name, text in files.items() if "count;" in text or "BIT_RATE" in text]


@pytest.mark.parametrize(
    ("new", "rule"),
    [
        ('firmware = true\ncan = "xl"', "ARM can: is 'xl', not one of classic, fd"),
        ('firmware = true\ncan = "classic"', "ARM buses: CAN1 is a CAN FD bus"),
        (
            'firmware = true\ncan = "fd"\nprocessor = "LPC2194"',
            "ARM can: is 'fd', and an LPC2194 has classic controllers",
        ),
        ('firmware = false\ncan = "fd"', "'can': is not a key of a board"),
    ],
)
def test_controllers_that_a_board_cannot_have_are_refused_by_name(tmp_path, new, rule):
    with pytest.raises(TableError, match=rule):
        table(tmp_path, FD_BOARDS.replace("firmware = false", new), FD_ROWS)
