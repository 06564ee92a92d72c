"""From a file to a table that a diagnosis can work on, and what must keep it from naming a cause."""

import numpy as np
import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import losses, preparation
from ranger_sim.sysid.machines import made
from ranger_sim.tools.recordings import datasets
from tests.boards.original_images import DATA

needs_data = pytest.mark.skipif(not (DATA / "emps_run1.csv").exists(), reason=f"no measured data in {DATA.name}/")


def prepared(path, experiment, mapping=None, accepted=losses.ACCEPTED):
    return preparation.prepared(datasets.open_recording(path, mapping), made(experiment)(), accepted)


def bench(path, change=lambda name, value: value, count=400):
    time_s = np.arange(count) * 0.01
    columns = {
        "t_s": time_s,
        "voltage_V": 5.0 * np.sin(1.7 * time_s) + 0.01 * np.sin(91.0 * time_s),
        "current_A": np.cos(1.7 * time_s) + 0.01 * np.sin(83.0 * time_s),
        "speed_rad_per_s": 8.0 * np.sin(1.7 * time_s - 0.2) + 0.01 * np.sin(97.0 * time_s),
        "torque_Nm": 0.3 * np.cos(1.7 * time_s) + 0.001 * np.sin(71.0 * time_s),
    }
    columns = {name: change(name, value) for name, value in columns.items()}
    rows = [",".join(f"{value[k]:.6g}" for value in columns.values()) for k in range(count)]
    path.write_text("\n".join([",".join(columns), *rows]))
    return str(path)


def test_a_sound_file_becomes_a_table_of_which_nothing_is_lost(tmp_path):
    ready = prepared(bench(tmp_path / "a.csv"), "motor-bench")
    assert set(ready.table.columns) == {"voltage_V", "current_A", "speed_rad_per_s", "torque_Nm"}
    assert (len(ready.table), ready.findings, ready.repairs) == (400, [], [])
    whole = {"read": 400, "kept": 400, "left_out": []}
    assert ready.ledger == dict.fromkeys(ready.table.columns, whole)


def test_the_command_lines_names_and_units_are_taken(tmp_path):
    path = bench(tmp_path / "a.csv")
    text = (tmp_path / "a.csv").read_text().replace("current_A", "strom", 1)
    (tmp_path / "a.csv").write_text(text)
    ready = prepared(path, "motor-bench", {"strom": "current_mA"})
    assert float(np.max(ready.table["current_A"])) == pytest.approx(1e-3, rel=0.02)
    with pytest.raises(UserError, match="motor-bench needs current_A"):
        prepared(path, "motor-bench")


def holes(share):
    return lambda name, value: np.where(np.arange(400) % share == 0, np.nan, value) if name == "torque_Nm" else value


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (lambda name, value: value * 1e6 if name == "current_A" else value, "they are probably mA"),
        (lambda name, value: value * 100.0 if name == "t_s" else value, "stamps are probably in ms"),
        (holes(3), "a.csv: torque_Nm: 134 of 400 samples are lost, 33.5 % where 1 % are accepted: 134 for values"),
        (lambda name, value: np.where(np.arange(400) > 150, value[150], value) if name == "speed_rad_per_s" else value,
         "speed_rad_per_s: it stays at"),
        (lambda name, value: np.floor(value * 20.0) / 20.0 if name == "t_s" else value,
         "voltage_V: 320 of 400 samples are lost, 80 % where 1 % are accepted: 320 for stamps that come twice"),
        (lambda name, value: np.where(value < 2.0, value, value - 2.0) if name == "t_s" else value,
         "voltage_V: 200 of 400 samples are lost, 50 % where 1 % are accepted: 200 for stamps that begin again"),
    ],
    ids=["microamperes", "milliseconds", "holes", "a stuck sensor", "stamps of 50 ms", "two recordings"],
)  # fmt: skip
def test_data_that_are_not_what_they_are_declared_to_be_are_refused(tmp_path, change, line):
    with pytest.raises(UserError, match=line):
        prepared(bench(tmp_path / "a.csv", change), "motor-bench")


def test_a_loss_that_is_accepted_leaves_a_table_without_what_is_lost(tmp_path):
    path = bench(tmp_path / "a.csv", holes(20))
    with pytest.raises(UserError, match="5 % where 1 % are accepted.*--accept-loss 5% does"):
        prepared(path, "motor-bench")
    ready = prepared(path, "motor-bench", accepted=0.05)
    assert all(np.isfinite(column).all() for column in ready.table.columns.values())
    lost = [{"reason": "not_finite", "count": 20, "where": "at 0 s"}]
    assert ready.ledger["torque_Nm"] == {"read": 400, "kept": 380, "left_out": lost}


def test_rows_out_of_order_give_the_same_table(tmp_path):
    sound = prepared(bench(tmp_path / "a.csv"), "motor-bench").table
    lines = (tmp_path / "a.csv").read_text().split("\n")
    blocks = [line for first in range(1, 401, 8) for line in lines[first : first + 8][::-1]]
    for number, rows in enumerate((lines[:0:-1], lines[201:] + lines[1:201], blocks)):
        path = tmp_path / f"{number}.csv"
        path.write_text("\n".join([lines[0], *rows]))
        ready = prepared(path, "motor-bench")
        assert np.array_equal(ready.table.time_s, sound.time_s) and {each.kind for each in ready.repairs} == {"sorted"}
        assert all(np.array_equal(ready.table[name], sound[name]) for name in sound.columns)


def test_rows_that_cannot_be_read_are_lost_in_every_channel(tmp_path):
    path = tmp_path / "a.csv"
    bench(path)
    lines = path.read_text().split("\n")
    lines[11:17] = ["torn"] * 6
    path.write_text("\n".join(lines))
    with pytest.raises(UserError, match=r"voltage_V: 6 of 400 samples .* 6 for rows with .* the first in line 12"):
        prepared(path, "motor-bench")


def test_a_repair_of_a_channel_that_is_not_there_is_refused(tmp_path):
    data = datasets.open_recording(bench(tmp_path / "a.csv"))
    with pytest.raises(UserError, match=r"--repair amps: unknown channel of a.csv \(available: voltage_V, current_A"):
        preparation.prepared(data, made("motor-bench")(), asked=["amps"])


def test_a_file_of_another_experiment_is_refused_in_a_line(tmp_path):
    with pytest.raises(UserError, match="positioning needs position_m"):
        prepared(bench(tmp_path / "a.csv"), "positioning")


@needs_data
def test_the_measured_files_are_ready():
    for name, experiment in (("emps_run1", "positioning"), ("ranger_foot_inertia_1", "ankle"),
                             ("ranger_ankle_sine_fast", "ankle")):  # fmt: skip
        assert len(prepared(str(DATA / f"{name}.csv"), experiment).table) > 2000


CASE = DATA.parent / "cases" / "03-shuffled-stamps"


@pytest.mark.skipif(not CASE.exists(), reason=f"no case in {CASE.name}/")
def test_the_shuffled_case_becomes_the_recording_that_it_was():
    sound, shuffled = (prepared(str(CASE / f"{name}.csv"), "motor-bench").table for name in ("base_1", "g_shuffled_1"))
    assert np.array_equal(shuffled.time_s, sound.time_s)
    assert all(np.array_equal(shuffled[name], sound[name]) for name in sound.columns)
