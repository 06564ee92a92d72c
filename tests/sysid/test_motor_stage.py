"""Motor stages by their own meters: emulated ones whose truth is known, the robot's own, and what a file may not be."""

import dataclasses
import json
import pathlib

import numpy as np
import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant import body_files
from ranger_sim.plant.electrics.motor_parameters import ANKLE_MOTOR
from ranger_sim.sysid.dataset import Channel, Dataset
from ranger_sim.sysid.machines import machine_of, motor_stage
from ranger_sim.tools import cli
from studies.motor_power.drives import Drive, drawn

LOGS = pathlib.Path(__file__).parents[3] / "shared" / "data" / "ranger_power_2015"
measured = pytest.mark.skipif(not LOGS.is_dir(), reason="the robot's logs are not here")


def of_drive(drive, motor, moving_s=0.0):
    return motor_stage.stage("MCFO", [motor_stage.samples(drive.record(moving_s=moving_s), "MCFO")], motor)


def test_the_intervals_hold_what_two_hundred_drawn_drives_have():
    inside, alarms = dict.fromkeys(("gates", "switching", "R", "V_c", "current_zero"), 0), 0
    for seed in range(1000, 1200):
        motor = drawn(seed)
        stage = of_drive(Drive(motor, seed), motor)
        truth = motor_stage.simulated_of(motor)
        assert set(stage.values) == set(inside) == set(truth) - {"factor"}
        for name, value in stage.values.items():
            inside[name] += value.low <= truth[name] <= value.high
        alarms += any(value.differs for value in stage.values.values())
    assert all(180 <= held <= 196 for held in inside.values()), inside  # 90 to 98 % for intervals of 95 %
    assert alarms <= 4  # 2 % of sound drives


def test_noise_of_a_current_sensor_is_not_taken_for_a_current():
    motor = dataclasses.replace(ANKLE_MOTOR, contact_drop_V=1.0)
    found = [of_drive(Drive(motor, seed, brushes_V=0.0), motor).values["gates"].value for seed in range(20)]
    # the noise's mean size of 2.4 mA times V_c would be 2.4 mW less; a mean of 20 scatters by 0.7 mW
    assert np.mean(found) == pytest.approx(motor_stage.simulated_of(motor)["gates"], abs=0.0014)


def test_a_smaller_drop_is_found_and_is_not_the_meters():
    motor = dataclasses.replace(ANKLE_MOTOR, resistance_ohm=0.97, contact_drop_V=0.36)
    stage = of_drive(Drive(motor, 3), ANKLE_MOTOR, 20.0)
    assert stage.values["R"].differs and stage.values["V_c"].differs
    assert stage.values["R"].value == pytest.approx(1.028, abs=0.05)
    assert stage.values["V_c"].value == pytest.approx(0.36, abs=0.1)
    assert not stage.values["factor"].differs


def test_a_meter_that_reads_low_shows_in_the_mechanical_power_too():
    stage = of_drive(Drive(ANKLE_MOTOR, 3, meter_scale=0.7), ANKLE_MOTOR, 20.0)
    assert stage.values["R"].value == pytest.approx(0.7 * ANKLE_MOTOR.loop_resistance_ohm, abs=0.05)
    assert stage.values["factor"].differs and stage.values["factor"].value == pytest.approx(0.7, abs=0.03)


def test_gates_that_switch_and_gates_that_do_not_are_different_findings():
    for scheme, more in (("switching", 0.2), ("powered", 0.0)):
        motor = dataclasses.replace(ANKLE_MOTOR, gate_power_W=0.4, gate_scheme=scheme)
        found = of_drive(Drive(motor, 5, brushes_V=0.0), motor).values
        assert found["switching"].value == pytest.approx(more, abs=0.03)
        assert found["gates"].value == pytest.approx(0.4 - more, abs=0.02)
        other = dataclasses.replace(motor, gate_scheme="powered" if scheme == "switching" else "switching")
        assert of_drive(Drive(motor, 5, brushes_V=0.0), other).values["gates"].differs


def test_without_currents_only_the_gates_are_given():
    drive = Drive(ANKLE_MOTOR, 2).record(moving_s=0.0)
    quiet = {name: each for name, each in drive.channels.items()}
    current = quiet["MCFO_MOTOR_CURRENT"]
    kept = np.abs(current.value) < 0.01
    quiet["MCFO_MOTOR_CURRENT"] = dataclasses.replace(current, time_s=current.time_s[kept], value=current.value[kept])
    power = quiet["MCFO_BATT_POWER"]
    kept = power.value < 0.6
    quiet["MCFO_BATT_POWER"] = dataclasses.replace(power, time_s=power.time_s[kept], value=power.value[kept])
    stage = motor_stage.diagnose([Dataset("rests", quiet)], body=body_files.load("appendix")).stages["MCFO"]
    assert "gates" in stage.values and not {"R", "V_c", "factor"} & set(stage.values)
    assert any(note.startswith("R, V_c: not to be seen") for note in stage.notes)


def test_recordings_that_disagree_at_rest_are_named():
    both = []
    for seed, watts in enumerate((0.1, 0.1, 0.4)):
        motor = dataclasses.replace(ANKLE_MOTOR, gate_power_W=watts, gate_scheme="powered")
        both.append(Drive(motor, seed).record(moving_s=0.0))
    (stage,) = motor_stage.diagnose(both).stages.values()
    assert any("recordings disagree" in note and "drive 2" in note and "drive 1" not in note for note in stage.notes)
    assert all(value.simulated is None and not value.differs for value in stage.values.values())


def written(path, dataset):
    rows = sorted(
        (t, name, v) for name, each in dataset.channels.items() for t, v in zip(each.time_s, each.value, strict=True)
    )
    path.write_text("t_ms,variable,value\n" + "".join(f"{1000 * t:.0f},{name},{v:.6g}\n" for t, name, v in rows))
    return str(path)


def test_the_command_prints_a_table_and_predicts_what_was_left_aside(tmp_path, capsys):
    motor = dataclasses.replace(ANKLE_MOTOR, resistance_ohm=0.6)
    files = [written(tmp_path / f"log{seed}.csv", Drive(motor, seed).record(moving_s=0.0)) for seed in (1, 2)]
    code = cli.main(["diagnose", files[0], "--holdout", files[1], "--experiment", "motor-stage", "--model", "appendix",
                     "--json", str(tmp_path / "found.json")])  # fmt: skip
    out = capsys.readouterr().out
    assert code == 1 and "differs" in out and "held-out holds: error" in out
    found = json.loads((tmp_path / "found.json").read_text())
    board = found["boards"]["MCFO"]
    assert found["detected"] and board["held_out_after_W"] < 0.3 * board["held_out_before_W"]
    values = {each["name"]: each for each in board["values"]}
    assert values["R"]["value"] == pytest.approx(0.658, abs=0.03) and values["R"]["differs"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("t_ms,variable,value\n1,MCH_BATT_POWER,x\n", "log.csv:2: '1,MCH_BATT_POWER,x' is not t_ms, variable, value"),
        ("t_ms,variable,value\n1,MCH_BATT_POWER,nan\n", "log.csv:2: MCH_BATT_POWER is nan at 1: not a finite number"),
        ("t_ms,variable,value\n", "the table has no rows"),
        ("t_ms,variable,value\n1,MCH_ANGLE,1\n2,MCH_ANGLE,2\n", "motor-stage needs BOARD_BATT_POWER"),
        (
            "t_ms,variable,value\n" + "".join(f"{n},MCH_BATT_POWER,1\n{n},MCH_MOTOR_CURRENT,1\n" for n in range(9)),
            "motor-stage needs MCH_BATT_VOLTAGE",
        ),
        (
            "t_ms,variable,value\n1,MCH_BATT_POWER,1\n1,MCH_MOTOR_CURRENT,1\n",
            "fewer than 3 samples of power or current of MCH",
        ),
    ],
)
def test_a_bad_table_is_refused_in_one_line(tmp_path, capsys, text, message):
    path = tmp_path / "log.csv"
    path.write_text(text)
    assert cli.main(["diagnose", str(path), "--experiment", "motor-stage"]) == 2
    line = capsys.readouterr().err
    assert message in line and line.count("\n") == 1


def test_a_log_without_rests_is_too_little_and_not_sound(tmp_path, capsys):
    path = written(tmp_path / "log.csv", Drive(ANKLE_MOTOR, 1).record(holds=1, moving_s=0.0))
    assert cli.main(["diagnose", path, "--experiment", "motor-stage"]) == 3
    assert "too little was measured at rest" in capsys.readouterr().out


def test_options_that_it_cannot_use_are_refused(tmp_path, capsys):
    path = written(tmp_path / "log.csv", Drive(ANKLE_MOTOR, 1).record(holds=3, moving_s=0.0))
    for option in (["--holdout-part", "0.5"], ["--gear", "3"]):
        assert cli.main(["diagnose", path, "--experiment", "motor-stage", *option]) == 2
        assert f"{option[0]}: motor-stage has no use for it" in capsys.readouterr().err
    with pytest.raises(UserError, match="its function is ranger_sim.sysid.machines.motor_stage.diagnose"):
        machine_of("motor-stage")


def test_a_table_of_another_form_is_left_to_the_other_readers(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("time_s,a,b\n1,2,3\n")
    assert motor_stage.read_long(path) is None and motor_stage.read_long(tmp_path / "no.csv") is None


def test_boards_are_in_the_robots_order_and_others_follow():
    channel = Channel("c", "", np.arange(3.0), np.zeros(3))
    names = ("ARM_BATT_POWER", "ARM_MOTOR_CURRENT", "MCSI_BATT_POWER", "MCSI_MOTOR_CURRENT", "MCH_BATT_POWER",
             "MCH_MOTOR_CURRENT", "MCFO_BATT_POWER")  # fmt: skip
    assert motor_stage.boards_of([Dataset("d", dict.fromkeys(names, channel))]) == ["MCH", "MCSI", "ARM"]


@measured
def test_the_robots_logs_say_what_the_body_has():
    data = [motor_stage.read_long(path) for path in sorted(LOGS.glob("*.csv"))]
    found = motor_stage.diagnose(data, body=body_files.load("ranger")).stages
    # the steering's code changed in September; a body has one of both
    assert not any(value.differs for board in ("MCH", "MCFO", "MCFI") for value in found[board].values.values())
    ankle = found["MCFO"].values
    assert ankle["R"].high < 1.358 and ankle["V_c"].high < 0.7
    assert (ankle["R"].value, ankle["V_c"].value) == (pytest.approx(1.04, abs=0.02), pytest.approx(0.41, abs=0.02))
    # at rest: the table of docs/robot.md T5, which is at 25.5 V
    assert found["MCH"].values["gates"].value * 25.5 / 30.0 == pytest.approx(0.117, abs=0.01)
    assert found["MCFO"].values["gates"].value * 25.5 / 30.0 == pytest.approx(0.147, abs=0.01)
    assert found["MCFI"].values["gates"].value * 25.5 / 30.0 == pytest.approx(0.085, abs=0.01)
    assert any("2015-09-30" in note for note in found["MCSI"].notes)


@measured
def test_logs_that_were_left_aside_are_predicted_better_than_by_the_bench():
    paths = sorted(LOGS.glob("*.csv"))
    data, held = ([motor_stage.read_long(path) for path in some] for some in (paths[::2], paths[1::2]))
    for stage in motor_stage.diagnose(data, held, body_files.load("appendix")).stages.values():
        assert stage.held_out_holds >= 8
        assert stage.held_out_after_W < 0.7 * stage.held_out_before_W
    assert motor_stage.diagnose(data, held, body_files.load("appendix")).stages["MCFO"].held_out_after_W < 0.05


@measured
def test_a_hold_far_beyond_the_currents_of_a_fit_is_named_with_its_own_error():
    """The logs of 7 August end at 2.4 A; one of 20 August has a hold at 4.07 A, which decides the whole error."""
    paths = sorted(LOGS.glob("*.csv"))
    august = [motor_stage.read_long(path) for path in paths if path.name.startswith("2015-08-07")]
    later = [motor_stage.read_long(path) for path in paths if not path.name.startswith("2015-08-07")]
    found = motor_stage.diagnose(august, later).stages["MCH"]
    note = next(each for each in found.notes if "exceed" in each)
    assert "4.07 A" in note and "2.41 A" in note
    assert found.held_out_after_W > 1.0  # of all holds
    assert float(note.rpartition("others is ")[2].removesuffix(" W")) < 0.3
    assert not any("exceed" in each for each in motor_stage.diagnose(later, august).stages["MCH"].notes)
