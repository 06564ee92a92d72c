"""`ranger-sim slots`, as a person uses it."""

import json
import re

import pytest

from ranger_sim.harness.timing import robot_figures
from ranger_sim.tools import cli
from ranger_sim.tools.timing import slots

# docs/robot.md N3.2, line by line: functions of every slot, then rows, then the occasional list, then the record
EVERY_SLOT = """adcx_convert_all adci_convert_all qdc_cap01_angle qdc_cap01_rate qdc_cap23_angle qdc_cap23_rate
ae_update can_rx_dispatch_all hb_beat mcu_led_update dn_safety error_update can_tx1 adcx_conversion_wait
mc_compliant_control""".split()
ROWS = ["MCH_ANGLE", "MCH_ANG_RATE", "MCH_BATT_POWER", "occasional"]
OCCASIONAL = """ERROR_MCH MCH_MOTOR_POSITION MCH_MOTOR_CURRENT MCH_STATUS MCH_BATT_CURRENT MCH_BATT_VOLTAGE
MCH_MOTOR_VELOCITY motor_encoder_rezero MCH_EXECUTION_TIME MCH_MAX_EXECUTION_TIME""".split()
CLOSING = ["can_transmit", "execution_time_record"]


def told(capsys, *arguments):
    code = cli.main(["slots", *arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


@pytest.fixture
def wide(monkeypatch):
    monkeypatch.setenv("COLUMNS", "160")


def test_the_table_of_a_board_is_the_firmwares_line_by_line(capsys, wide):
    code, out, _ = told(capsys, "MCH", "--static")
    lines = [line.split()[0] for line in out.splitlines() if line]
    first = lines.index("adcx_convert_all")
    assert lines[first : first + 31] == [*EVERY_SLOT, *ROWS, *OCCASIONAL, *CLOSING]
    assert code == 0 and "worst seen" not in out.splitlines()[33]
    assert re.search(r"motor_encoder_rezero +row 3, in turn +7,460 +10,000 +10,000 +7,080 - 7,520", out)


def test_what_was_seen_stands_beside_what_is_possible(capsys):
    code, out, _ = told(capsys, "MCFI", "--time", "0.3", "--json", "-")
    (board,) = json.loads(out)["boards"]
    assert code == 0
    assert json.loads(out)["run"] == {"seed": 1, "time_s": 0.3, "steps": 0, "ended": ""}
    assert 380 <= board["seen"]["slots"] <= 400 and board["seen"]["overruns"] == 0
    for each in board["functions"]:
        if each["seen"] is not None:
            assert each["seen"]["least"] <= each["seen"]["most"] <= each["worst"], each["name"]
    safety = next(each for each in board["functions"] if each["name"] == "dn_safety")
    assert safety["robot"] == {"least": 826, "most": 970} and safety["seen"]["most"] == 826
    assert board["robot_execution_time_us"]["walking"] == list(robot_figures.EXECUTION_TIME_US["MCFI"][1])


def test_without_a_board_the_rows_of_all_are_shown(capsys, wide):
    code, out, _ = told(capsys, "--static")
    assert code == 0
    assert [line.split(",")[0] for line in out.splitlines() if "slots of" in line] == [
        "MCH",
        "MCFO",
        "MCFI",
        "MCSI",
        "UI",
        "CSR",
        "MB",
    ]
    assert out.count("may overrun") == 2  # the rows of the ankle boards that can set a motor's encoder


def test_a_file_gets_the_json_and_the_terminal_the_table(capsys, tmp_path, wide):
    file = tmp_path / "slots.json"
    _, out, _ = told(capsys, "MCSI", "--static", "--json", str(file))
    assert json.loads(file.read_text())["run"] is None and out.startswith("MCSI, 500 us slots of 30,000 cycles, 4 rows")


def test_an_overrun_of_the_run_is_told_and_is_the_exit_code(capsys, monkeypatch, wide):
    run = slots.seen

    def with_a_slow_function(robot, names, options):
        robot.replace("MCH", "mc_compliant_control", robot.board("MCH").compliant_control, cost=29_000)
        return run(robot, names, options)

    monkeypatch.setattr(slots, "seen", with_a_slow_function)
    code, out, _ = told(capsys, "MCH", "--time", "0.15")
    assert code == slots.EXIT_OVERRAN == 1
    assert re.search(r"Seen in \d+ slots from 0.10 to 0.15 s, 0 steps, seed 1: [1-9]\d+ overran", out)


@pytest.mark.parametrize(
    "arguments, complaint",
    [
        (["MCX"], "unknown board 'MCX'"),
        (["MCH", "--time", "0.1"], "--time 0.1: the first 0.1 s do not count, so more are needed"),
    ],
)
def test_a_mistake_is_told_in_one_line(capsys, arguments, complaint):
    code, out, error = told(capsys, *arguments)
    assert code == cli.EXIT_MISUSE and out == ""
    assert complaint in error and error.count("\n") == 1


def test_an_edge_rate_below_zero_is_refused_before_anything_runs(capsys):
    with pytest.raises(SystemExit) as ended:
        cli.main(["slots", "MCH", "--static", "--edge-rate", "-1"])
    assert ended.value.code == cli.EXIT_MISUSE
    assert "--edge-rate: '-1' must be at least 0" in capsys.readouterr().err


@pytest.mark.parametrize("time", ["0", "nan", "-1s", "2 fortnights"])
def test_a_time_that_is_none_is_refused_before_anything_runs(capsys, time):
    with pytest.raises(SystemExit) as ended:
        cli.main(["slots", "MCH", f"--time={time}"])
    assert ended.value.code == cli.EXIT_MISUSE
    error = capsys.readouterr().err
    assert "--time" in error and error.count("\n") == 1
