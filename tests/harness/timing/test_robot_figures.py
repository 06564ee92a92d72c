"""What the robot's images took, as data for tables, is what docs/robot.md T2 tells."""

import pathlib
import re

import pytest

from ranger_sim.harness.timing.robot_figures import INSTRUCTIONS, cycles_of

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


def told(row, board):
    """Least and most instructions that T2 tells; None where it tells nothing."""
    text = ROBOT.read_text(encoding="utf-8").split("## T2 ")[1].split("\n## T3")[0]
    cells = next(line for line in text.splitlines() if line.startswith(f"| {row}")).strip("|").split("|")
    numbers = [int(each) for each in re.findall(r"\d+", cells[COLUMNS[board]])]
    return (min(numbers), max(numbers)) if numbers else None


@pytest.mark.parametrize("board", COLUMNS)
def test_least_and_most_of_every_function_are_those_of_the_table(board):
    shown = {name: INSTRUCTIONS[board][name] for name in ROWS if name in INSTRUCTIONS[board]}
    assert shown == {name: told(row, board) for name, row in ROWS.items() if name in shown}
    assert len(shown) >= 6


@pytest.mark.parametrize("board", COLUMNS)
def test_the_lights_take_the_same_on_every_board(board):
    text = ROBOT.read_text(encoding="utf-8")
    assert "| hb_beat, mcu_led_update | 21, 31 | 21, 31 | 21, 31 |" in text
    assert (INSTRUCTIONS[board]["hb_beat"], INSTRUCTIONS[board]["mcu_led_update"]) == ((21, 21), (31, 31))


def test_an_instruction_takes_two_cycles():
    assert cycles_of("MCH", "can_rx_dispatch_all") == (30, 1432)
    assert cycles_of("MB", "anything") is None
