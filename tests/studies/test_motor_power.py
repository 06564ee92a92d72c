"""The tables of motor stages: known answers, and what they print of logs and of drives."""

import pytest

from ranger_sim.plant import body_files
from ranger_sim.plant.electrics.motor_parameters import ANKLE_MOTOR
from ranger_sim.sysid.machines import motor_stage
from studies.motor_power import __main__ as command
from studies.motor_power import tables
from studies.motor_power.drives import Drive


def test_the_power_of_a_held_stage_is_the_law_worked_by_hand():
    values = {"gates": 0.12, "switching": 0.03, "R": 1.0, "V_c": 0.5}
    assert tables.power(values, None, 0.0, 25.0) == pytest.approx(0.12 * 25 / 30)
    assert tables.power(values, None, 2.0, 25.0) == pytest.approx(0.15 * 25 / 30 + 4.0 + 1.0)


def test_the_law_of_the_body_leaves_little_of_what_the_law_before_left():
    body = body_files.load("ranger")
    for board, amps, volts, watts in tables.READINGS:
        motor = getattr(body.electrics, motor_stage.MOTORS[board])
        has = tables.power(motor_stage.simulated_of(motor), motor, amps, volts)
        assert abs(has - watts) < 0.25 * watts, (board, amps)


def test_logs_are_printed_as_tables_of_their_boards(capsys):
    data = [Drive(ANKLE_MOTOR, seed).record(moving_s=0.0) for seed in (1, 2)]
    lines = tables.boards(data).splitlines()
    assert lines[0] == "|  | MCFO | appendix |" and lines[2].startswith("| holds, with a current | 96, 48 |")
    assert any(line.startswith("| R, ohm | 1.3") and line.endswith("| 1.36 |") for line in lines)
    board, holds, found, *_ = tables.predictions(data).splitlines()[2].split(" | ")
    assert board == "| MCFO" and holds == "48" and float(found) < 0.2
    assert tables.predictions(data[:1]) == "One log alone predicts nothing."


def test_drives_are_counted_by_parameter():
    lines = tables.coverage(1000, 3).splitlines()
    assert [line.split(" | ")[0] for line in lines[2:]] == [
        f"| {name}" for name in ("current_zero", "gates", "R", "V_c", "switching", "factor", "false alarms")
    ]
    assert lines[2].startswith("| current_zero | 3 of 3 | 100.0%")


def test_a_file_of_another_form_is_refused_in_one_line(tmp_path, monkeypatch, capsys):
    path = tmp_path / "a.csv"
    path.write_text("time_s,a,b\n1,2,3\n")
    monkeypatch.setattr("sys.argv", ["motor_power", str(path)])
    assert command.main() == 2
    assert capsys.readouterr().err == f"{path}: not a table of t_ms, variable, value\n"
