"""From a file to a table that a diagnosis can work on, and what must keep it from naming a cause."""

import argparse

import numpy as np
import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools.recordings import datasets
from tests.boards.original_images import DATA

needs_data = pytest.mark.skipif(not (DATA / "emps_run1.csv").exists(), reason=f"no measured data in {DATA.name}/")


def options(*arguments):
    parser = argparse.ArgumentParser()
    datasets.add_options(parser)
    return parser.parse_args(arguments)


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


def test_a_sound_file_becomes_a_table_without_doubts(tmp_path):
    ready = datasets.prepared(options(), bench(tmp_path / "a.csv"), "motor-bench")
    assert set(ready.table.columns) == {"voltage_V", "current_A", "speed_rad_per_s", "torque_Nm"}
    assert (len(ready.table), ready.findings, ready.doubts, ready.dataset.repairs) == (400, [], [], [])


def test_the_command_lines_names_and_units_are_taken(tmp_path):
    path = bench(tmp_path / "a.csv")
    text = (tmp_path / "a.csv").read_text().replace("current_A", "strom", 1)
    (tmp_path / "a.csv").write_text(text)
    ready = datasets.prepared(options("--map", "strom=current_mA"), path, "motor-bench")
    assert float(np.max(ready.table["current_A"])) == pytest.approx(1e-3, rel=0.02)
    with pytest.raises(UserError, match="motor-bench needs current_A"):
        datasets.prepared(options(), path, "motor-bench")


@pytest.mark.parametrize(
    ("change", "kind"),
    [
        (lambda name, value: value * 1e6 if name == "current_A" else value, "wrong_unit"),
        (lambda name, value: value * 100.0 if name == "t_s" else value, "wrong_unit"),
        (lambda name, value: np.where(np.arange(400) % 3 == 0, np.nan, value) if name == "torque_Nm" else value,
         "not_finite"),
        (lambda name, value: np.where(np.arange(400) > 150, value[150], value) if name == "speed_rad_per_s" else value,
         "stuck"),
        (lambda name, value: np.floor(value * 20.0) / 20.0 if name == "t_s" else value, "duplicate_stamps"),
    ],
    ids=["microamperes", "milliseconds", "holes", "a sensor that stands", "stamps of 50 ms"],
)  # fmt: skip
def test_data_that_are_not_what_they_are_said_to_be_are_doubted(tmp_path, change, kind):
    ready = datasets.prepared(options(), bench(tmp_path / "a.csv", change), "motor-bench")
    assert kind in {each.kind for each in ready.doubts}
    assert all(np.isfinite(column).all() for column in ready.table.columns.values())


def test_a_file_of_another_experiment_is_refused_in_a_line(tmp_path):
    with pytest.raises(UserError, match="it has no channel of the experiment walk"):
        datasets.prepared(options(), bench(tmp_path / "a.csv"), "walk")


@needs_data
def test_the_measured_files_are_ready_and_not_doubted():
    for name, experiment in (("emps_run1", "positioning"), ("ranger_foot_inertia_1", "ankle"),
                             ("ranger_ankle_sine_fast", "ankle"), ("ranger_walk_20150820", "walk")):  # fmt: skip
        ready = datasets.prepared(options(), str(DATA / f"{name}.csv"), experiment)
        assert ready.doubts == [] and len(ready.table) > 2000
