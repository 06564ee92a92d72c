"""Channels brought on one time base: known values, gaps that stay gaps, and mistakes reported in a line."""

import numpy as np
import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.dataset import Channel, Dataset


def channel(name, time_s, value):
    return Channel(name, name.rpartition("_")[2], np.asarray(time_s, float), np.asarray(value, float))


def recording(*channels):
    return Dataset("recording", {each.name: each for each in channels})


def test_a_slower_channel_is_a_straight_line_between_its_samples():
    fast = channel("current_A", [0.0, 1.0, 2.0, 3.0, 4.0], [0.0, 1.0, 4.0, 9.0, 16.0])
    slow = channel("voltage_V", [0.0, 2.0, 4.0], [10.0, 20.0, 10.0])
    table = recording(slow, fast).table(["voltage_V", "current_A"])
    assert table.time_s.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert table["voltage_V"].tolist() == [10.0, 15.0, 20.0, 15.0, 10.0]
    assert table["current_A"].tolist() == [0.0, 1.0, 4.0, 9.0, 16.0]
    assert table.runs == (slice(0, 5),)


def test_a_gap_of_any_channel_cuts_the_table():
    steady = channel("current_A", np.arange(40.0), np.arange(40.0))
    broken = channel("voltage_V", [*range(10), *range(30, 40)], np.ones(20))
    table = recording(steady, broken).table(["current_A", "voltage_V"])
    assert table.time_s.tolist() == [*range(10), *range(30, 40)]
    assert table.runs == (slice(0, 10), slice(10, 20))
    assert table.part(slice(5, 15)).runs == (slice(0, 5), slice(5, 10))
    assert table.part(slice(0, 10)).runs == (slice(0, 10),)  # none that is empty
    assert table.part(slice(10, 12)).runs == (slice(0, 2),)


def test_only_the_time_that_all_channels_have_counts():
    table = recording(channel("a_V", [0, 1, 2, 3], [0, 0, 0, 0]), channel("b_V", [1, 2, 3.5], [0, 0, 0])).table(
        ["a_V", "b_V"]
    )
    assert table.time_s.tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    ("made", "names", "line"),
    [
        (lambda: recording(channel("a_V", [0, 1], [0, 0])), ["b_V"], "recording: unknown channel 'b_V' (available: a"),
        (lambda: recording(channel("a_V", [0], [0])), ["a_V"], "recording: a_V has 1 samples, at least 2 are needed"),
        (
            lambda: recording(channel("a_V", [0, 1], [0, 0]), channel("b_V", [5, 6], [0, 0])),
            ["a_V", "b_V"],
            "recording: a_V, b_V have no time in common",
        ),
        (lambda: recording(channel("a_V", [0, 1], [0])), [], "channel a_V: (2,) stamps and (1,) values"),
    ],
)  # fmt: skip
def test_a_mistake_is_reported_in_a_line(made, names, line):
    with pytest.raises(UserError) as error:
        made().table(names)
    assert line in str(error.value)
