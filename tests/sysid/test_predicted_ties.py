"""Ties predicted by structure, confirmed or broken by data; and those that were not predicted."""

import pytest

from ranger_sim.sysid import predicted_ties
from ranger_sim.sysid.benches.motor_run import motor_run
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.machine import Effect
from ranger_sim.sysid.machines.motor_bench import MotorBench
from ranger_sim.sysid.naming import Named
from ranger_sim.sysid.pipeline import diagnose
from tests.sysid.test_diagnose import Cart, cart_run


@pytest.fixture(scope="module")
def bench():
    machine = MotorBench()
    recorded = motor_run(seed=1, seconds=1.0)
    return machine, [machine.prepare(recorded.table(list(recorded.channels)))]


def effect(cause, at):
    return Effect(cause, at, "electrical", ("size",), [{}], lambda *_: {})


def named(cause, at, tied=(), rivals=()):
    """A cause as the naming gives it: tied with effects, others behind by so much."""
    return Named(
        effect(cause, at), {}, 50.0, 1, 1e-6, 40.0, [effect(*each) for each in tied],
        [(effect(*each), behind) for *each, behind in rivals],
    )  # fmt: skip


DROP, DEAD = ("contact_drop_change", "hip_motor"), ("dead_time", "hip_motor")  # predicted: structure, cosine 1


@pytest.mark.parametrize(
    ("tied", "rivals", "data", "text"),
    [
        ([DEAD], [(*DEAD, 0.4)], predicted_ties.CONFIRMED, "confirmed, these data cannot decide either"),
        ([], [(*DEAD, 31.7)], predicted_ties.BROKEN, "broken by the data, it is 31.7 behind"),
        ([], [(*DEAD, 2.0)], predicted_ties.IMPOSSIBLE, "with a value that no machine has"),
        ([], [], predicted_ties.BROKEN, "broken by the data, it is far behind"),
    ],
)
def test_a_predicted_tie_is_confirmed_or_broken_by_the_data(bench, tied, rivals, data, text):
    found = predicted_ties.of(*bench, named(*DROP, tied, rivals))
    (tie,) = found["ties"]
    assert (tie["with"], tie["reason"], tie["data"]) == ("dead_time", "structure", data)
    assert tie["cosine"] == pytest.approx(1.0, abs=1e-3)
    (line,) = predicted_ties.described(found)
    assert line.startswith("predicted tie with dead_time (cosine 1.00 on the reference motion): ") and text in line


def test_the_nearest_form_of_the_other_cause_counts(bench):
    found = predicted_ties.of(*bench, named(*DROP, rivals=[(*DEAD, 90.0), (*DEAD, 12.0)]))
    assert found["ties"][0]["behind"] == 12.0


def test_a_tie_that_was_not_predicted_is_reported(bench):
    found = predicted_ties.of(*bench, named("stribeck", "hip_motor", [("presliding", "hip_motor")]))
    assert [(each["with"], each["data"]) for each in found["ties"]] == [("presliding", predicted_ties.NOT_PREDICTED)]
    assert predicted_ties.described(found) == [
        "a tie with presliding was not predicted, these data cannot decide: another motion may"
    ]


def test_what_the_equations_do_not_have_is_reported_as_not_tried(bench):
    machine, recordings = bench

    class WithoutDeadTime(MotorBench):
        def effects(self, those):
            return [each for each in super().effects(those) if each.cause != "dead_time"]

    found = predicted_ties.of(WithoutDeadTime(), recordings, named(*DROP))
    assert found["ties"][0]["data"] == predicted_ties.NOT_TRIED


def test_a_cause_that_these_channels_were_not_predicted_to_show_is_reported(bench):
    """A backlash between motor and output, without the motor's angle."""
    machine, (recording,) = bench
    table = recording.table
    columns = {name: each for name, each in table.columns.items() if name != "motor_angle_rad"}
    without = machine.prepare(Table(table.time_s, columns, table.runs))
    found = predicted_ties.of(machine, [without], named("cable_backlash", "transmission"))
    assert found["status"] == "not shown" and "predicted not to show" in predicted_ties.described(found)[-1]
    assert predicted_ties.of(machine, [recording], named("cable_backlash", "transmission"))["status"] == "shown"


@pytest.mark.parametrize(
    ("cause", "at", "key"),
    [
        ("stribeck", "hip_motor", "stribeck"),
        ("sensor_offset", "current_A", "sensor_offset@current"),
        ("sensor_offset", "hip_angle_rad", "sensor_offset@angle"),
        ("sensor_offset", "torque_Nm", "sensor_offset@torque_Nm"),  # no place of the catalogue
        ("wobble", "cart", "wobble@cart"),
    ],
)
def test_a_cause_is_called_as_the_catalogue_calls_it(cause, at, key):
    assert predicted_ties.key_of(cause, at) == key


def test_a_machine_of_ones_own_has_no_prediction():
    (cause,) = diagnose(Cart(), [cart_run(1, drag=0.02)]).answer["causes"]
    assert cause["evidence"]["predicted"] is None and predicted_ties.described(None) == []
