"""What the robot's images took, as data for tables, is what docs/robot.md T2 has."""

import pathlib
import re

import pytest

from ranger_sim.ranger.timing.robot_figures import EXECUTION_TIME_US, INSTRUCTIONS, REZEROING_US, cycles_of

ROBOT = pathlib.Path(__file__).resolve().parents[3] / "docs/robot.md"
COLUMNS = {"MCH": 1, "MCFI": 2, "MCSI": 3}
# function: how its row begins in T2
ROWS = {
    "adcx_convert_all": "adcx_convert_all",
    "adci_convert_all": "adci_convert_all",
    "qdc_cap01_rate": "qdc cap01 rate",
    "qdc_cap23_rate": "qdc cap23 rate",
    "ae_update": "ae_update",
    "can_rx_dispatch_all": "can_rx_dispatch_all",
    "ls_update": "ls_update",
    "dn_safety": "dn_safety",
    "error_update": "error_update",
    "can_tx1": "can_tx1",
    "adcx_conversion_wait": "adcx_conversion_wait",
    "dn_update_pwm": "dn_update_pwm",
    "mc_compliant_control": "mc_compliant_control",
}


def reported(row, board):
    """Least and most instructions in T2; None where it has none."""
    text = ROBOT.read_text(encoding="utf-8").split("## T2 ")[1].split("\n## T3")[0]
    cells = next(line for line in text.splitlines() if line.startswith(f"| {row}")).strip("|").split("|")
    numbers = [int(each) for each in re.findall(r"\d+", cells[COLUMNS[board]])]
    return (min(numbers), max(numbers)) if numbers else None


@pytest.mark.parametrize("board", COLUMNS)
def test_least_and_most_of_every_function_are_those_of_the_table(board):
    shown = {name: INSTRUCTIONS[board][name] for name in ROWS if name in INSTRUCTIONS[board]}
    assert shown == {name: reported(row, board) for name, row in ROWS.items() if name in shown}
    assert len(shown) >= 6


@pytest.mark.parametrize("board", COLUMNS)
def test_the_lights_take_the_same_on_every_board(board):
    text = ROBOT.read_text(encoding="utf-8")
    assert "| hb_beat, mcu_led_update | 21, 31 | 21, 31 | 21, 31 |" in text
    assert (INSTRUCTIONS[board]["hb_beat"], INSTRUCTIONS[board]["mcu_led_update"]) == ((21, 21), (31, 31))


# what T2 calls a row's or an occasional function: how its variable's name ends
SENT = {
    "angle": "ANGLE", "rate": "RATE", "power": "BATT_POWER", "current": "CURRENT", "voltage": "BATT_VOLTAGE",
    "velocity": "MOTOR_VELOCITY", "position": "MOTOR_POSITION", "motor position": "MOTOR_POSITION",
    "execution time": "EXECUTION_TIME", "status": "STATUS", "heel sense": "HEEL_SENSE", "HS": "_HS",
    "bridge": "HBRIDGE_TEMP", "LS": "_LS",
}  # fmt: skip


@pytest.mark.parametrize("board", ["MCH", "MCFI"])
def test_the_values_that_a_variable_takes_are_described_for_its_kind(board):
    text = ROBOT.read_text(encoding="utf-8").split("## T2 ")[1].split("\n## T3")[0]
    cells = [
        line.strip("|").split("|")[COLUMNS[board]]
        for line in text.splitlines()
        if line.startswith(("| rows:", "| occ"))
    ]
    found = re.findall(r"([A-Za-z][A-Za-z ]*?) (\d+)(?:-(\d+))?", " ".join(cells))
    kinds = {SENT[name]: (int(least), int(most or least)) for name, least, most in found if name in SENT}
    error = next(int(least) for name, least, _ in found if name == "error")
    shown = {name: counted for name, counted in INSTRUCTIONS[board].items() if name.startswith((board, "ERROR"))}
    for name, counted in shown.items():
        expected = [kinds[ending] for ending in kinds if name.endswith(ending)]
        assert counted == ((8, error) if name == f"ERROR_{board}" else expected[0]), name
    assert len(shown) >= 12


@pytest.mark.parametrize("board", ["MCH", "MCFI"])
def test_the_decoders_angle_the_end_of_a_slot_and_the_rezeroing_are_those_of_the_table(board):
    rows = ROBOT.read_text(encoding="utf-8").split("## T2 ")[1].splitlines()
    assert "| qdc cap01 angle, cap23 angle | 23, 23 | 23, 23 | - |" in rows
    assert next(each for each in rows if each.startswith("| dn_sched_done")).startswith("| dn_sched_done | 22 | 22 |")
    own = INSTRUCTIONS[board]
    assert own["qdc_cap01_angle"] == own["qdc_cap23_angle"] == (23, 23) and own["execution_time_record"] == (22, 22)
    assert next(each for each in rows if each.startswith("| re-zero of the motor")).startswith(
        "| re-zero of the motor encoder | 3540 / 3610 / 3760 "
    )
    assert INSTRUCTIONS["MCH"]["motor_encoder_rezero"] == (3540, 3760)


def test_the_steering_boards_own_are_those_of_the_table():
    assert INSTRUCTIONS["MCSI"]["MCSI_STATUS"] == (156, 156) and INSTRUCTIONS["MCSI"]["can_tx2"] == reported(
        "can_tx1", "MCSI"
    )
    assert INSTRUCTIONS["MCFI"]["can_tx2"] == reported("can_tx1", "MCFI")
    assert INSTRUCTIONS["MCSI"]["execution_time_record"] == (22, 22)  # as on the other motor boards


def test_the_slots_of_the_logs_are_those_of_the_table():
    rows = ROBOT.read_text(encoding="utf-8").split("## T1 ")[1].split("\n## T2")[0].splitlines()
    table = {line.split()[1]: line.strip("|").split("|") for line in rows if re.match(r"\| [A-Z]+ \(", line)}

    def numbers(cell):
        return [int(each) for each in re.findall(r"\d+", cell)]

    for board, (held, walking) in EXECUTION_TIME_US.items():
        of_held, moving = numbers(table[board][1]), numbers(table[board][2])
        assert list(held) == of_held[:2]
        assert walking[1] == (moving[1] if board == "UI" else moving[0] if moving else held[1])
        # the usual slot of MCH is the image's; of the others what their logs have at rest
        assert walking[0] == (97 if board == "MCH" else held[0])
    assert "usual slot 97-102" in table["MCH"][3]
    rezeroing = next(line for line in rows if line.startswith("| ankle boards while re-zeroing"))
    assert list(REZEROING_US) == numbers(rezeroing)[:2]


def test_an_instruction_takes_two_cycles():
    assert cycles_of("MCH", "can_rx_dispatch_all") == (30, 1432)
    assert cycles_of("MB", "anything") is None
