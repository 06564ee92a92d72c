"""An output that is cut off or lacks samples: a simulator runs through these rows, which decide nothing."""

import dataclasses

import numpy as np
import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.dataset import Channel, Dataset
from ranger_sim.sysid.pipeline import diagnose
from ranger_sim.sysid.preparation import prepared
from tests.sysid.machines_of_a_user import HeatedRod, ThrustStand
from tests.sysid.other_machines import heated_rod, thrust_stand


def cut(table, share, channel="thrust_N"):
    """A channel that ends at this quantile of itself."""
    limited = np.minimum(table[channel], np.quantile(table[channel], share))
    return dataclasses.replace(table, columns=table.columns | {channel: limited})


def dataset(table):
    units = {each.name: each.unit for each in ThrustStand.quantities}
    return Dataset(
        table.name, {name: Channel(name, units[name], table.time_s, column) for name, column in table.columns.items()}
    )


def test_a_load_cell_that_ends_below_a_tenth_of_the_thrust_changes_neither_parameters_nor_answer():
    """7.9e-6 N s^2; with the rows at the limit it would be too small by a tenth."""
    result = diagnose(ThrustStand(), [cut(thrust_stand("none", 0.0, 1, 10.0), 0.9)]).result
    value = result.evidence.parameters["ct"]
    assert value.ci95[0] < 7.9 < value.ci95[1] and not result.causes
    note = next(each for each in result.data_findings if each.kind == "unmeasured")
    assert note.channel == "thrust_N" and 150 < note.size < 201 and "no measurement" in note.text


def test_a_hidden_offset_is_found_with_a_load_cell_that_is_cut_off():
    train, other = (cut(thrust_stand("offset", 0.1, seed, 10.0), 0.9) for seed in (1, 2))
    first = diagnose(ThrustStand(), [train], [other]).result.causes[0]
    assert first.name == "sensor_offset" and first.at == "thrust_N"


def test_rows_that_are_cut_off_do_not_count_whatever_their_value():
    """The likelihood of a fit is the same to the last digit but for the straight lines of the first guess."""
    table = heated_rod("none", 0.0, 1)
    name = HeatedRod().outputs[0].channel
    rows = np.arange(len(table)) % 100 < 20
    spoilt = {shift: np.where(rows, table[name] + shift, table[name]) for shift in (0.0, 30.0)}
    found = [
        diagnose(
            HeatedRod(),
            [dataclasses.replace(table, columns=table.columns | {name: column}, unmeasured={name: rows})],
        ).result
        for column in spoilt.values()
    ]
    for known in HeatedRod.parameters:
        one, other = (each.evidence.parameters[known.name] for each in found)
        assert one.value == pytest.approx(other.value, abs=0.05 * (one.ci95[1] - one.ci95[0]))
    assert not found[0].causes and not found[1].causes


def test_samples_that_are_not_numbers_are_rows_without_a_measurement():
    data = dataset(thrust_stand("none", 0.0, 1, 10.0))
    thrust = data["thrust_N"]
    lacking = np.arange(len(thrust.value)) % 200 > 189
    data.channels["thrust_N"] = dataclasses.replace(thrust, value=np.where(lacking, np.nan, thrust.value))
    table = prepared(data, ThrustStand()).table
    assert len(table.runs) == 1 and len(table) > 1980
    assert np.array_equal(table.unmeasured["thrust_N"], lacking[: len(table)])


def test_an_input_that_lacks_as_much_is_refused():
    data = dataset(thrust_stand("none", 0.0, 1, 10.0))
    volts = data["voltage_V"]
    lacking = np.arange(len(volts.value)) % 200 > 189
    data.channels["voltage_V"] = dataclasses.replace(volts, value=np.where(lacking, np.nan, volts.value))
    with pytest.raises(UserError, match=r"voltage_V: 100 of 2000 samples are lost, 5 %"):
        prepared(data, ThrustStand())


def test_an_output_of_which_most_is_cut_off_is_refused():
    with pytest.raises(UserError, match=r"thrust_N: \d+\.\d% of its values are cut off .* at most 50%"):
        diagnose(ThrustStand(), [cut(thrust_stand("none", 0.0, 1, 10.0), 0.4)])


def test_a_machine_that_makes_an_input_of_its_output_is_refused_where_that_lacks_rows():
    class Driven(ThrustStand):
        def inputs(self, table):
            return {"V": table["voltage_V"] + 0.0 * table["thrust_N"]}

    with pytest.raises(UserError, match="thrust_N: values are cut off .* makes its input V of them"):
        diagnose(Driven(), [cut(thrust_stand("none", 0.0, 1, 10.0), 0.9)])
