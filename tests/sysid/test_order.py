"""Samples in the order of their stamps: sorted where they fit, left out and counted where they do not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import losses, order, repairs
from ranger_sim.sysid.dataset import LOSSES, NOTHING_LOST, Channel, Dataset, Loss
from tests.examples import examples

STEP = 0.004
T = STEP * np.arange(3000)
V = np.sin(3.0 * T) + 0.1 * T


def mended(time_s, value):
    data = Dataset("data", {"a_V": Channel("a_V", "V", np.asarray(time_s, float), np.asarray(value, float))})
    return repairs.mend(data)


def shuffled(block):
    random = generator(4, "order")
    return np.concatenate([first + random.permutation(block) for first in range(0, 3000, block)])


ORDERS = {
    "blocks of 20": shuffled(20),
    "all rows": shuffled(3000),
    "reversed": np.arange(3000)[::-1],
    "the second half first": np.roll(np.arange(3000), 1500),
    "one row late": np.concatenate((np.arange(1000), [1001, 1000], np.arange(1002, 3000))),
}


@pytest.mark.parametrize("name", ORDERS)
@pytest.mark.parametrize("jitter", [0.0, 0.05])
def test_rows_that_are_merely_out_of_order_are_sorted(name, jitter):
    stamps = T + jitter * STEP * generator(5, "jitter").uniform(-1.0, 1.0, 3000)
    found = mended(stamps[ORDERS[name]], V[ORDERS[name]])
    assert np.array_equal(found["a_V"].time_s, stamps) and np.array_equal(found["a_V"].value, V)
    assert found["a_V"].losses == ()
    (repair,) = found.repairs
    assert repair.kind == "sorted" and repair.count > 0 and " of the steps are then 0.00" in repair.text
    losses.stop_if_too_many(found, found.channels)


def test_as_few_samples_as_can_be_are_moved():
    assert order.of(np.delete(np.insert(T, 10, T[2000]), 2001), np.zeros(3000)).moved == 1
    assert order.of(T[::-1].copy(), V).moved == 2999
    assert order.of(T, V).moved == 0


def test_the_evidence_is_how_even_the_sorted_stamps_are():
    found = order.of(T[ORDERS["blocks of 20"]], V)
    assert found.step_s == pytest.approx(STEP) and found.even == 1.0
    uneven = T.copy()
    uneven[1::4] += 0.2 * STEP
    found = order.of(uneven[ORDERS["blocks of 20"]], V)
    assert found.even == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("offset", [0.0, 0.1, 0.37, 0.5])
def test_two_recordings_in_one_file_are_not_laid_into_each_other(offset):
    time_s = np.concatenate((T, T[:2000] + offset * STEP))
    found = mended(time_s, np.concatenate((V, np.cos(5.0 * T[:2000]))))
    assert np.array_equal(found["a_V"].time_s, T) and np.array_equal(found["a_V"].value, V)
    assert [(each.reason, each.count) for each in found["a_V"].losses] == [("restarted_stamps", 2000)]
    with pytest.raises(UserError, match=r"^data: a_V: 2000 of 5000 samples are lost, 40 % .* begin again"):
        losses.stop_if_too_many(found, found.channels)
    losses.stop_if_too_many(found, found.channels, 0.4)


@pytest.mark.parametrize("stamp", [1.502, 0.0015, -3.0, 1e9])
def test_a_sample_with_a_wrong_stamp_is_left_out(stamp):
    time_s = T.copy()
    time_s[1000] = stamp
    found = mended(time_s, V)["a_V"]
    assert np.array_equal(found.time_s, np.delete(T, 1000)) and np.array_equal(found.value, np.delete(V, 1000))
    assert [(each.reason, each.count) for each in found.losses] == [("reversed_stamps", 1)] or stamp == 1e9
    assert found.read == 3000


def test_a_repeated_sample_is_not_a_loss_and_another_value_at_its_stamp_is():
    twice = mended(np.repeat(T, 2), np.repeat(V, 2))
    assert [(each.reason, each.count) for each in twice["a_V"].losses] == [("repeated", 3000)]
    losses.stop_if_too_many(twice, twice.channels)
    mixed = mended(np.repeat(T, 2), np.column_stack((V, V + 1.0)).ravel())
    assert [(each.reason, each.count) for each in mixed["a_V"].losses] == [("duplicate_stamps", 3000)]
    assert np.array_equal(mixed["a_V"].value, V)
    with pytest.raises(UserError, match=r"3000 of 6000 samples are lost, 50 % .*--accept-loss 50% does"):
        losses.stop_if_too_many(mixed, mixed.channels)


def test_of_three_samples_at_one_stamp_each_is_held_against_the_first():
    found = order.of(np.array([0.0, 1.0, 1.0, 1.0, 2.0]), np.array([5.0, 6.0, 7.0, 6.0, 8.0]))
    assert found.kept.tolist() == [0, 1, 4]
    assert {key: each.tolist() for key, each in found.left_out.items()} == {"repeated": [3], "duplicate_stamps": [2]}


@pytest.mark.parametrize(("count", "refused"), [(30, False), (31, True)])
def test_one_sample_in_a_hundred_may_be_lost(count, refused):
    value = V.copy()
    value[50 : 50 + count] = np.nan
    found = mended(T, value)
    assert found["a_V"].lost_share == count / 3000
    if refused:
        with pytest.raises(UserError, match=r"31 of 3000 .* 1.03 % where 1 % .* not numbers, the first at 0.2 s"):
            losses.stop_if_too_many(found, found.channels)
    losses.stop_if_too_many(found, found.channels, 0.0104)
    losses.stop_if_too_many(found, found.channels, 0.01 if not refused else 1.0)


def test_lines_of_which_nothing_says_whose_they_were_count_too():
    data = Dataset("data", {"a_V": Channel("a_V", "V", T, V)}, rows=1000, losses=[Loss("ragged", 11, "in line 7")])
    with pytest.raises(UserError, match=r"data: 11 of 1000 lines are lost, 1.1 %.* cells, the first in line 7"):
        losses.stop_if_too_many(data, data.channels)
    assert data.ledger()[""] == {
        "read": 1000, "kept": 989, "left_out": [{"reason": "ragged", "count": 11, "where": "in line 7"}]
    }  # fmt: skip


def test_a_channel_with_nothing_left_is_refused():
    good = Channel("a_V", "V", T, V)
    data = Dataset("data", {"a_V": good, "b_V": Channel("b_V", "V", T, np.full(3000, np.nan))})
    with pytest.raises(UserError, match="data: b_V: too few sound samples are left"):
        losses.stop_if_too_many(repairs.mend(data, []), ["a_V", "b_V"])


NUMBERS = st.one_of(st.floats(width=32), st.integers(-5, 5).map(float))


@settings(max_examples=examples(200))
@given(st.lists(st.tuples(NUMBERS, NUMBERS), min_size=2, max_size=60))
def test_every_sample_is_kept_or_left_out_for_one_reason(pairs):
    time_s, value = np.array(pairs, dtype=float).T
    found = order.of(time_s, value)
    everything = np.concatenate([found.kept, *found.left_out.values()])
    assert sorted(everything.tolist()) == list(range(len(pairs)))
    assert set(found.left_out) <= {*LOSSES, *NOTHING_LOST}
    assert (np.diff(time_s[found.kept]) > 0.0).all()


def test_what_is_read_is_what_is_kept_and_what_is_left_out():
    channel = Channel("a_V", "V", T, V).without(T < 0.1, "not_finite").without(T[25:] > 11.0, "cut")
    assert (channel.read, len(channel.value)) == (3000, 3000 - sum(each.count for each in channel.losses))
    assert [each.where for each in channel.losses] == ["at 0 s", "at 11.004 s"]
    assert channel.lost_share == 25 / (len(channel.value) + 25)  # what is cut is not lost
