"""The master table against what is known of the robot: names, ids, types, publishers, rates."""

import collections
import csv
import pathlib

import pytest

from ranger_sim import datatable
from ranger_sim.datatable.loader import load_table
from ranger_sim.datatable.model import Table
from ranger_sim.datatable.routing import destination_masks
from ranger_sim.datatable.schedule import published_schedule, scheduled_frames_per_s
from ranger_sim.foundation.user_error import UserError

HERE = pathlib.Path(__file__).parent


@pytest.fixture(scope="module")
def table() -> Table:
    return load_table()


def rows_of(name):
    with (HERE / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_every_variable_of_the_robot_has_its_id_type_and_publisher(table):
    by_id = {variable.id: variable for variable in table.variables}
    known = rows_of("robot_variables.csv")
    assert len(known) == 263 + 50
    for row in known:
        variable = by_id[int(row["id"])]
        assert (variable.name, variable.type, variable.publisher) == (row["name"], row["type"], row["publisher"])


def test_every_error_of_the_robot_has_its_code(table):
    by_id = {error.id: error.name for error in table.errors}
    known = rows_of("robot_errors.csv")
    assert len(known) == 114
    assert all(by_id[int(row["id"])] == row["name"] for row in known)


def test_what_the_robot_does_not_have_begins_at_id_314_and_error_114(table):
    robots = {int(row["id"]) for row in rows_of("robot_variables.csv")}
    assert {variable.id for variable in table.variables if variable.id < 314} - robots == {313}  # its end marker
    assert [error.name for error in table.errors if error.id >= 114][:5] == [
        "SCHED_SLOT_NEAR_LIMIT",
        "SCHED_TASK_LIMIT",
        "CAN_TX_QUEUE_FULL",
        "MC_SPEED_LIMIT",
        "MB_UNKNOWN_PARAMETER",
    ]


def test_each_board_publishes_as_many_of_the_robots_variables_as_on_the_robot(table):
    count = collections.Counter(variable.publisher for variable in table.variables if variable.id < 263)
    # rows per source in the robot's table (robot.md N2.1)
    assert count == {
        "MB": 115,
        "MCFO": 21,
        "MCFI": 21,
        "UI": 17,
        "MCH": 16,
        "MCSI": 13,
        "CSR": 11,
        "MCSO": 10,
        "COL": 10,
        "PC": 29,
    }


def test_the_main_brain_receives_98_variables_of_the_satellites(table):
    # ids to board 1 from boards 3-8 (robot.md N2.2)
    numbers = {board.name: board.number for board in table.boards}
    received = [v for v in table.subscribed_by("MB") if v.id < 263 and 3 <= numbers[v.publisher] <= 8]
    assert len(received) == 98


def test_every_variable_is_described_and_ids_are_dense_to_the_last_of_the_robot(table):
    assert [variable.id for variable in table.variables[:314]] == list(range(314))
    assert all(variable.description for variable in table.variables)


@pytest.mark.parametrize(
    ("bus", "frames_per_s"), [("CAN1", 1863.6), ("CAN2", 955.6), ("CAN3", 1955.6), ("CAN4", 1950.0 + 1800.0)]
)
def test_scheduled_traffic_upwards_is_that_of_the_robot(table, bus, frames_per_s):
    # robot.md N1.10, which rounds to 0.1 frame/s
    assert scheduled_frames_per_s(table, bus) == pytest.approx(frames_per_s, abs=0.05)


@pytest.mark.parametrize(
    ("name", "period_ms"),
    [
        ("TIMESTAMP", 1.0),
        ("MCH_ANGLE", 2.0),
        ("MCH_BATT_VOLTAGE", 22.0),  # 11 calls of 2 ms
        ("MCFO_MOTOR_CURRENT", 67.5),  # 15 calls of 4.5 ms
        ("MCFO_RIGHT_HEEL_SENSE", 4.21875),  # 222.22/s in a row and 14.81/s in the occasional list
        ("MCFI_MID_ANKLE_ANGLE", 4.0),
        ("UI_ROLL", 2.8125),
        ("CSR_MCU_POWER", 90.0),
        ("MB_EXECUTION_TIME", 22.0),
        ("MCH_COMMAND_CURRENT", None),
    ],
)
def test_periods_follow_from_slots_rows_and_occasional_calls(table, name, period_ms):
    period = table.variable(name).period_ms
    assert (None if period is None else float(period)) == period_ms


def test_the_period_of_every_scheduled_variable_is_that_of_its_boards_lists(table):
    for board in table.boards:
        for name, period in board.periods_ms().items():
            assert abs(table.variable(name).period_ms - period) * 10_000 <= period, name


def test_the_published_schedule_of_the_hip_board_is_the_robots():
    schedule = published_schedule("MCH")
    assert schedule.slot_us == 500
    assert schedule.every == ()
    assert schedule.rows == (("MCH_ANGLE",), ("MCH_ANG_RATE",), ("MCH_BATT_POWER",), ())
    assert schedule.occasional_row == 3
    assert len(schedule.occasional) == 10


@pytest.mark.parametrize(
    ("board", "slot_us", "rows", "occasional"),
    [
        ("MB", 2000, 11, 0),
        ("CSR", 1000, 10, 8),
        ("MCH", 500, 4, 10),
        ("MCFO", 500, 9, 14),
        ("MCFI", 500, 8, 14),
        ("MCSI", 500, 4, 4),
        ("UI", 1000, 3, 14),
    ],
)
def test_slots_rows_and_occasional_entries_are_the_robots(board, slot_us, rows, occasional):
    schedule = datatable.published_schedule(board)  # robot.md N3.2-N3.8
    assert (schedule.slot_us, len(schedule.rows), len(schedule.occasional)) == (slot_us, rows, occasional)


def test_an_unknown_board_has_no_schedule_and_the_message_names_the_boards():
    with pytest.raises(UserError, match=r"unknown board 'MCX' \(available: PC, MB, CSR, MCH"):
        published_schedule("MCX")


def test_the_router_sends_fifty_identifiers_away_from_the_main_brain(table):
    masks = destination_masks(table)
    assert len(masks) == 2032
    away = [number for number, mask in enumerate(masks) if mask not in (0, 1)]
    assert len(away) == 50  # robot.md N1.5
    assert [number for number, mask in enumerate(masks) if mask == 0] == [2000, 2001]  # ours, of XCP
    assert masks[table.variable("MB_STATUS").id] == 0b11110
    assert masks[table.variable("ERROR_LCD").id] == 0b00100
    assert masks[table.variable("MCH_STIFFNESS").id] == 0b00010
    assert masks[table.variable("MCFO_STIFFNESS").id] == 0b01000
    assert masks[table.variable("MCFI_STIFFNESS").id] == 0b10000
    assert masks[table.variable("MCSI_STIFFNESS").id] == 0b10000
    assert masks[0] == 1 and masks[2031] == 1


def test_routed_identifiers_are_exactly_the_main_brains_send_list(table):
    from ranger_sim.datatable.generated import mb, routes

    assert routes.DESTINATIONS == tuple(destination_masks(table))
    assert tuple(number for number, mask in enumerate(routes.DESTINATIONS) if mask > 1) == mb.SEND


def test_the_hash_does_not_depend_on_line_endings_but_on_every_character(tmp_path):
    from ranger_sim.datatable.loader import MASTER_FOLDER

    for path in MASTER_FOLDER.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    assert datatable.table_hash(tmp_path) == datatable.table_hash()
    path = tmp_path / "errors.csv"
    path.write_bytes(path.read_bytes().replace(b"nothing wrong", b"nothing Wrong"))
    assert datatable.table_hash(tmp_path) != datatable.table_hash()


def test_importing_the_generated_modules_opens_no_master_file():
    import subprocess
    import sys

    program = (
        "import sys\n"
        "import ranger_sim.datatable.generated\n"
        "from ranger_sim.datatable.generated import mch, mcfo, mcfi, mcsi, ui, csr, mb, all_variables, errors, routes\n"
        "assert not {'csv', 'tomllib', 'ranger_sim.datatable.loader'} & set(sys.modules)\n"
        "print(mch.MCH_ANGLE)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=HERE.parent.parent)
    assert (done.returncode, done.stdout.strip()) == (0, "14"), done.stderr
