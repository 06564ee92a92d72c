"""The main brain's data store: words, stamps, read flags, ids beyond the table; the same compiled and interpreted."""

import array
import struct
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ranger_sim import datatable
from ranger_sim.datatable import store as store_module
from ranger_sim.datatable.generated import all_variables, mb
from ranger_sim.datatable.store import DataStore

words = st.integers(0, 2**32 - 1)


def test_a_new_store_is_zero_and_unread_by_every_subscriber():
    store = DataStore(4)
    assert [store.get_word(number) for number in range(4)] == [0, 0, 0, 0]
    assert all(store.is_unread(2, subscriber) for subscriber in range(len(store_module.SUBSCRIBERS)))


def test_the_main_brain_starts_with_the_tables_values_for_every_id():
    store = datatable.main_brain_store()
    assert store.size == all_variables.TABLE_SIZE > 313
    assert store.get_float(mb.CTRL_HIP_KP) == 25.0
    assert store.get_float(mb.ID_LAST) == 313.0
    for number, kind in all_variables.TYPES.items():
        read = {"f32": store.get_float, "i32": store.get_int, "u32": store.get_u32}[kind]
        assert read(number) == all_variables.INITIAL[number]
        assert store.stamp(number) == 0 and store.is_unread(number, store_module.SSP)


@given(st.floats(width=32, allow_nan=False))
def test_a_single_comes_back_as_it_was_stored(value):
    store = DataStore(2)
    store.set_float(1, value)
    assert store.get_float(1) == value
    assert store.get_word(1) == struct.unpack("<I", struct.pack("<f", value))[0]


def test_a_number_is_rounded_to_single_precision():
    store = DataStore(2)
    store.set_float(1, 0.1)
    assert store.get_word(1) == 0x3DCCCCCD
    assert store.get_float(1) == 0.10000000149011612


@given(st.integers(-(2**40), 2**40))
def test_integers_keep_their_low_32_bits(value):
    store = DataStore(2)
    store.set_int(1, value)
    assert store.get_int(1) == (value + 2**31) % 2**32 - 2**31
    assert store.get_u32(1) == value % 2**32
    store.set_u32(0, value)
    assert store.get_word(0) == value % 2**32


@given(words, words)
def test_a_frame_is_stored_word_for_word_with_its_stamp(word, stamp):
    store = DataStore(3)
    store.set_word(2, word, stamp)
    assert (store.get_word(2), store.stamp(2)) == (word, stamp)
    store.set_word(2, word + 2**32, stamp + 2**32)
    assert (store.get_word(2), store.stamp(2)) == (word, stamp)


@pytest.mark.parametrize("write", ["set_float", "set_int", "set_u32"])
def test_a_local_write_is_stamped_with_the_network_time_received_last(write):
    store = DataStore(3)
    store.set_word(0, 777, 777)
    getattr(store, write)(1, 5)
    assert store.stamp(1) == store.network_time_ms() == 777


@pytest.mark.parametrize(
    ("stamp", "now", "age"),
    [(100, 100, 0), (100, 350, 250), (2**32 - 5, 10, 15), (2**32 - 1, 0, 1), (0, 2**32 - 1, 2**32 - 1)],
)
def test_the_age_is_right_across_the_wrap_of_the_ms_count(stamp, now, age):
    store = DataStore(2)
    store.set_word(1, 0, stamp)
    assert store.age_ms(1, now) == age


@given(words, st.integers(0, 2**32 - 1))
def test_the_age_is_the_time_elapsed_at_any_count(stamp, elapsed):
    store = DataStore(2)
    store.set_word(1, 0, stamp)
    assert store.age_ms(1, (stamp + elapsed) % 2**32) == elapsed


def test_reading_by_one_subscriber_leaves_it_new_for_the_others():
    store = DataStore(3)
    store.mark_read(1, store_module.SSP)
    assert not store.is_unread(1, store_module.SSP)
    others = [i for i, name in enumerate(store_module.SUBSCRIBERS) if name != "SSP"]
    assert all(store.is_unread(1, subscriber) for subscriber in others)
    assert store.is_unread(2, store_module.SSP)


@pytest.mark.parametrize("write", ["set_float", "set_int", "set_u32", "set_word", "mark_unread"])
def test_any_write_makes_a_value_new_for_every_subscriber(write):
    store = DataStore(2)
    for subscriber in range(len(store_module.SUBSCRIBERS)):
        store.mark_read(1, subscriber)
    assert store.unread[1] == 0
    getattr(store, write)(*{"mark_unread": (1,), "set_word": (1, 0, 0)}.get(write, (1, 0)))
    assert all(store.is_unread(1, subscriber) for subscriber in range(len(store_module.SUBSCRIBERS)))


def test_unread_ids_of_a_list_are_found_in_list_order():
    store = DataStore(10)
    numbers = array.array("q", [7, 2, 5])
    store.mark_read(7, store_module.SSP)
    found = []
    position = store.next_unread(numbers, 0, store_module.SSP)
    while position >= 0:
        found.append(numbers[position])
        store.mark_read(numbers[position], store_module.SSP)
        position = store.next_unread(numbers, position + 1, store_module.SSP)
    assert found == [2, 5]
    assert store.next_unread(numbers, 0, store_module.SSP) == -1
    assert store.next_unread(numbers, 0, store_module.LCD) == 0


@pytest.mark.parametrize("number", [-1, 10, 2047, 2**40])
def test_an_id_beyond_the_table_is_reported_and_changes_nothing(number):
    store = DataStore(10)
    reported = []
    store.on_out_of_range = lambda: reported.append(store.out_of_range_id)
    before = bytes(store.words), bytes(store.stamps), bytes(store.unread)
    calls = [
        lambda: store.set_word(number, 1, 1),
        lambda: store.set_float(number, 1.0),
        lambda: store.set_int(number, 1),
        lambda: store.set_u32(number, 1),
        lambda: store.mark_read(number, 0),
        lambda: store.mark_unread(number),
        lambda: store.get_word(number),
        lambda: store.get_float(number),
        lambda: store.get_int(number),
        lambda: store.get_u32(number),
        lambda: store.stamp(number),
        lambda: store.age_ms(number, 5),
        lambda: store.is_unread(number, 0),
    ]
    assert [call() or 0 for call in calls] == [0] * len(calls)
    assert reported == [number] * len(calls)
    assert store.out_of_range_count == len(calls)
    assert (bytes(store.words), bytes(store.stamps), bytes(store.unread)) == before


def test_without_a_callback_an_id_beyond_the_table_is_only_counted():
    store = DataStore(1)
    store.set_float(1, 2.0)
    assert (store.out_of_range_count, store.out_of_range_id) == (1, 1)


PROGRAM = """
import hashlib
from ranger_sim import datatable
from ranger_sim.datatable.store import DataStore
store = datatable.main_brain_store()
state = 12345
for step in range(20000):
    state = (state * 1103515245 + 12345) % 2**31
    number, value = state % (store.size + 3) - 1, (state >> 7) - 2**22
    store.set_word(0, step, step * 1000003)
    if step % 2:
        store.set_float(number, value / 7.0)
    else:
        store.set_int(number, value)
    store.mark_read(state % store.size, state % 7)
    store.set_float(1, store.get_float(number) + store.age_ms(number, step))
digest = hashlib.sha256(bytes(store.words) + bytes(store.stamps) + bytes(store.unread))
print(digest.hexdigest(), store.out_of_range_count)
"""


def test_compiled_and_interpreted_stores_hold_the_same_bits():
    import os
    import pathlib

    root = pathlib.Path(__file__).resolve().parent.parent.parent
    printed = set()
    for forced in ("", "1"):
        environment = {**os.environ, "RANGER_SIM_INTERPRETED": forced}
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM], cwd=root, env=environment, capture_output=True, text=True, check=True
        )
        printed.add(done.stdout)
    assert len(printed) == 1
    assert int(printed.pop().split()[1]) > 0
