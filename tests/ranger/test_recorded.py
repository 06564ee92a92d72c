"""What a report takes from a run: columns under their names, times since power-up, variables where they changed."""

from types import SimpleNamespace

import numpy as np
import pytest

from ranger_sim import datatable
from ranger_sim.datatable.generated import all_variables
from ranger_sim.ranger.conditions import STATE_VARIABLES
from ranger_sim.ranger.records.recorded import Recorded

START_NS = 3_000_000_000
MS = 1_000_000
HIP_STATE = all_variables.ID_OF[STATE_VARIABLES["hip"]]
ANGLE = all_variables.ID_OF["MCH_ANGLE"]
ROWS = 6


def bits(value):
    """A 32-bit float as its word."""
    return int(np.float32(value).view(np.uint32))


def words():
    """The table of ROWS times, 2 ms apart: an angle that changes twice, states that change once."""
    table = np.zeros((ROWS, max(all_variables.NAMES) + 1), dtype=np.int64)
    table[:, ANGLE] = [bits(each) for each in (0.0, 0.0, 0.25, 0.25, 0.25, -1.5)]
    table[:, HIP_STATE] = [4, 4, 4, 7, 7, 7]
    return START_NS + 2 * MS * np.arange(ROWS), table


class Load:
    """A meter that closed 12 windows, of which three are kept."""

    count = 12

    def windows(self):
        return [0.1, 0.2, 0.3]


@pytest.fixture
def recorded():
    machine = SimpleNamespace(
        machine=SimpleNamespace(
            states=[SimpleNamespace(number=4, name="hold"), SimpleNamespace(number=7, name="swing")]
        )
    )
    feet = SimpleNamespace(machine=SimpleNamespace(states=[SimpleNamespace(number=0, name="flip")]))
    modes = SimpleNamespace(hip=machine, outer_foot=feet, inner_foot=feet)
    slots = SimpleNamespace(slots=SimpleNamespace(histogram=[0, 5, 2]))
    robot = SimpleNamespace(
        start_ns=START_NS,
        logbook=SimpleNamespace(samples=lambda: np.array([[3.0, 1.0, 10.0], [3.5, 2.0, 20.0]]), words=words),
        plant=SimpleNamespace(
            sample_names=("lean", "hip"), recent_steps=lambda: "the steps", recent_footholds=lambda: "the footholds"
        ),
        buses=[SimpleNamespace(name="can1", load=Load())],
        counters=lambda: {"MCH": slots},
        boards={"MB": SimpleNamespace(modes=modes)},
    )
    return Recorded(robot)


def test_samples_are_under_their_names_with_times_since_power_up(recorded):
    assert {name: list(column) for name, column in recorded.samples.items()} == {
        "time_s": [0.0, 0.5],
        "lean": [1.0, 2.0],
        "hip": [10.0, 20.0],
    }
    assert (recorded.steps, recorded.footholds) == ("the steps", "the footholds")


def test_loads_are_in_the_middle_of_their_windows_of_10_ms(recorded):
    times, loads = recorded.bus_load["can1"]
    assert list(loads) == [0.1, 0.2, 0.3]
    # twelve windows end at 120 ms; the last three are 90 to 120 ms
    assert times == pytest.approx([0.095, 0.105, 0.115], abs=1e-12)


def test_slots_are_counted_in_classes_of_five_per_cent(recorded):
    percent, counts = recorded.slot_histograms["MCH"]
    assert (list(percent), list(counts)) == ([0.0, 5.0, 10.0], [0, 5, 2])


def test_a_machines_states_are_those_of_its_variable(recorded):
    time, states, names = recorded.machine_states("hip")
    assert time == pytest.approx([0.0, 0.002, 0.004, 0.006, 0.008, 0.010], abs=1e-12)
    assert list(states) == [4, 4, 4, 7, 7, 7] and names == {4: "hold", 7: "swing"}


def test_states_are_those_at_the_given_time(recorded):
    """Before the first row the first state, behind the last one the last."""
    found = recorded.state_text([-1.0, 0.0059, 0.006, 9.0])
    assert [each[0] for each in found] == ["hip: hold", "hip: hold", "hip: swing", "hip: swing"]
    assert found[0][1:] == ["outer foot: flip", "inner foot: flip"]


def test_a_state_without_a_name_is_shown_as_such(recorded):
    recorded.words[:, HIP_STATE] = 99
    assert recorded.state_text([0.0])[0][0] == "hip: ?"


def test_variables_are_written_where_they_changed_and_at_both_ends(recorded):
    series = {each.name: each for each in recorded.variables()}
    assert set(series) == set(all_variables.NAMES.values())
    angle = series["MCH_ANGLE"]
    row = datatable.load().variable("MCH_ANGLE")
    assert (angle.unit, angle.description) == (row.unit, row.description)
    assert angle.time_s == pytest.approx([0.0, 0.004, 0.010], abs=1e-12)
    assert angle.values.dtype == np.float32 and list(angle.values) == [0.0, 0.25, -1.5]
    state = series[STATE_VARIABLES["hip"]]
    assert state.time_s == pytest.approx([0.0, 0.006, 0.010], abs=1e-12) and list(state.values) == [4, 7, 7]


def test_a_run_without_rows_has_no_variables(recorded):
    recorded.words = recorded.words[:0]
    recorded.word_times_ns = recorded.word_times_ns[:0]
    assert list(recorded.variables()) == []
