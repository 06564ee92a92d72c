"""A user's machine has its channels by its own names and in its own units, whatever the file calls them."""

import pathlib
import re

import numpy as np
import pytest

from ranger_sim.foundation.user_error import DataError
from ranger_sim.sysid import api
from ranger_sim.sysid.channels import named_by
from ranger_sim.sysid.free_simulation import Output
from ranger_sim.sysid.machine import Quantity, inputs_of
from ranger_sim.sysid.reading import open_recording

ROWS = 60


def _recording(tmp_path, header, values, **how):
    time_s = 0.01 * np.arange(ROWS)
    path = tmp_path / "run.csv"
    np.savetxt(path, np.column_stack((time_s, values)), delimiter=",", header=f"time_s,{header}", comments="")
    return open_recording(path, **how)


@pytest.mark.parametrize("header", ["speed_rad_s", "speed (rad/s)", "speed_rad_per_s", "speed [rad*s^-1]"])
@pytest.mark.parametrize("name", ["speed_rad_s", "speed", "speed_rad_per_s"])
def test_a_speed_is_found_by_either_spelling_of_its_unit(tmp_path, header, name):
    made = named_by(_recording(tmp_path, header, np.arange(ROWS)), [Quantity(name, "rad/s", "")])
    assert made[name].value.tolist() == list(range(ROWS))
    assert list(made.channels) == [name]


def test_a_name_given_on_the_command_line_is_the_machines(tmp_path):
    made = _recording(tmp_path, "n [rpm]", np.full(ROWS, 60.0), mapping={"n [rpm]": "speed_rad_s"})
    made = named_by(made, [Quantity("speed_rad_s", "rad/s", "")])
    assert made["speed_rad_s"].value == pytest.approx(2.0 * np.pi)


@pytest.mark.parametrize(
    ("header", "unit", "factor"),
    [("angle_rad", "deg", 180.0 / np.pi), ("angle_deg", "deg", 1.0), ("angle [rev]", "deg", 360.0)],
)
def test_a_machine_in_degrees_has_degrees(tmp_path, header, unit, factor):
    made = named_by(_recording(tmp_path, header, np.arange(ROWS)), [Quantity("angle_deg", unit, "")])
    assert made["angle_deg"].value == pytest.approx(factor * np.arange(ROWS))
    assert made["angle_deg"].unit == "deg"
    assert made.repairs[-1].text.endswith("is called angle_deg, in deg")


@pytest.mark.parametrize(
    ("header", "name", "unit"),
    [("Q_BTU_per_h", "Q_BTU_per_h", "BTU/h"), ("heat_kJ_per_h", "heat_kJ_per_h", "kJ/h"), ("F_per_h", "F_per_h", "1/h"),
     ("F_per_h", "F_per_h", "changes/h"), ("F_per_h", "F_per_h", ""), ("speed_rpm", "speed_rpm", "turns of it")],
)  # fmt: skip
def test_a_quantity_called_as_in_the_file_has_the_numbers_of_the_file(tmp_path, header, name, unit):
    """Also where the machine has no known unit: a heat per hour was 3,600 times too small."""
    made = named_by(_recording(tmp_path, header, np.arange(ROWS)), [Quantity(name, unit, "")])
    assert made[name].value == pytest.approx(np.arange(ROWS), rel=1e-12)


def test_kelvin_and_celsius_differ_by_their_zero(tmp_path):
    recording = _recording(tmp_path, "plate_C", np.full(ROWS, 20.0) + np.arange(ROWS))
    made = named_by(recording, [Quantity("plate_K", "K", "")])
    assert made["plate_K"].value[0] == pytest.approx(293.15)


def test_a_channel_in_another_kind_of_unit_is_refused_by_both_names(tmp_path):
    recording = _recording(tmp_path, "torque_Nm", np.arange(ROWS), mapping={"torque_Nm": "current"})
    with pytest.raises(DataError, match=r"current.* is in N m, current of the machine in A"):
        named_by(recording, [Quantity("current", "A", "")])


def test_a_unit_in_a_row_of_its_own_counts_as_one_in_the_name(tmp_path):
    path = tmp_path / "rows.csv"
    lines = ["t;torque;angle;load", "s;Nm;deg;"] + [f"{0.01 * k:.2f};{k};{k};{k}" for k in range(ROWS)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    wanted = [Quantity(name, unit, "") for name, unit in (("torque_Nm", "N m"), ("angle_rad", "rad"), ("load_N", "N"))]
    made = named_by(open_recording(path), wanted)
    assert {"torque_Nm", "angle_rad"} <= set(made.channels) and "load_N" not in made.channels
    assert made["angle_rad"].value[45] == pytest.approx(np.pi / 4.0)


def test_channels_without_a_unit_and_channels_of_no_quantity_stay_as_they_are(tmp_path):
    recording = _recording(tmp_path, "load,spare_V", np.column_stack((np.arange(ROWS), np.arange(ROWS))))
    made = named_by(recording, [Quantity("load", "N m", "")])
    assert set(made.channels) == {"load", "spare_V"}
    assert not made.repairs


def _written(name):
    """A class of the page, as a reader would type it."""
    page = pathlib.Path(__file__).parents[2] / "docs" / "diagnose-your-machine.md"
    blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    made = {}
    exec(next(each for each in blocks if f"class {name}(" in each), made)  # noqa: S102 - the page's own example
    return made[name]


def test_the_disc_of_the_page_finds_the_channels_that_it_names(tmp_path):
    time_s = 0.01 * np.arange(2000)
    voltage, speed = np.sign(np.sin(1.3 * time_s)), np.zeros(2000)
    for row in range(1999):  # 5 rad/s^2/V and 1/s, solved exactly while the voltage is held
        speed[row + 1] = 5.0 * voltage[row] + (speed[row] - 5.0 * voltage[row]) * np.exp(-0.01)
    path = tmp_path / "disc.csv"
    table = np.column_stack((time_s, voltage, speed + 0.01 * np.sin(0.1 * np.arange(2000) ** 2)))
    np.savetxt(path, table, delimiter=",", header="time_s,voltage_V,speed_rad_s", comments="")
    found = api.diagnose(path, _written("Disc")())
    assert not found.causes


def test_an_output_in_volts_is_not_an_input_of_the_machine():
    machine = type("Tank", (), {})()
    machine.quantities = (
        Quantity("pump_V", "V", ""),
        Quantity("level_V", "V", ""),
        Quantity("sense_V", "V", "", drives=True),
    )
    machine.outputs = (Output("level_V", "M", "level", "V"), Output("sense_V", "M", "level", "V"))
    assert inputs_of(machine) == {"pump_V", "sense_V"}


def test_the_joint_of_the_page_finds_the_gravity_that_it_lacks(tmp_path):
    time_s = 0.01 * np.arange(3000)
    angle = np.sin(1.7 * time_s) + 0.4 * np.sin(4.3 * time_s + 1.0)
    rate = 1.7 * np.cos(1.7 * time_s) + 1.72 * np.cos(4.3 * time_s + 1.0)
    acceleration = -(1.7**2) * np.sin(1.7 * time_s) - 4.3 * 1.72 * np.sin(4.3 * time_s + 1.0)
    current = 0.2 * acceleration + 1.1 * rate + 0.4 * np.sign(rate) + 0.6 * np.sin(angle)
    current += 0.02 * np.sin(0.1 * np.arange(3000) ** 2)  # as good as noise
    path = tmp_path / "joint.csv"
    table = np.column_stack((time_s, angle, rate, current))
    np.savetxt(path, table, delimiter=",", header="time_s,angle_rad,rate_rad_s,current_A", comments="")
    first = api.diagnose(path, _written("Joint")()).causes[0]
    low, high = first.parameters["sine"].ci95
    assert first.name == "gravity" and low < 0.6 < high
