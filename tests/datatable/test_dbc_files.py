"""The DBC files, read by cantools, decode and encode what our packing packs."""

import cantools
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ranger_sim.datatable.generate import GENERATED_FOLDER
from ranger_sim.datatable.loader import load_table
from ranger_sim.datatable.model import LIMITS
from ranger_sim.datatable.packing import error_word, pack_frame, unpack_frame
from tests.examples import examples

TABLE = load_table()
BUSES = [bus for bus in TABLE.channels if bus != "SSP"]
DATABASES = {bus: cantools.database.load_file(GENERATED_FOLDER / f"{bus.lower()}.dbc", strict=True) for bus in BUSES}
CARRIED = [(bus, variable) for bus in BUSES for variable in TABLE.on_bus(bus)]
times = st.integers(0, 2**32 - 1)


def numbers_of(variable):
    """Every value that the variable can carry within its range."""
    low, high = LIMITS[variable.type]
    low = low if variable.minimum is None else variable.minimum
    high = high if variable.maximum is None else variable.maximum
    if variable.type != "f32":
        return st.integers(low, high)
    # the ends of a range need not be singles, so draw doubles there and let both sides round
    if variable.minimum is None and variable.maximum is None:
        return st.floats(width=32, allow_nan=False, allow_infinity=False)
    return st.floats(low, high, allow_nan=False)


def check(bus, variable, value, time_ms):
    message = DATABASES[bus].get_message_by_frame_id(variable.id)
    data = pack_frame(variable.type, value, time_ms)
    unpacked, stamp = unpack_frame(variable.type, data)
    decoded = message.decode(data, decode_choices=False)
    assert decoded == {"value": unpacked, "time_ms": time_ms}
    assert stamp == time_ms
    assert message.encode({"value": value, "time_ms": time_ms}) == data


@pytest.mark.parametrize("bus", BUSES)
def test_a_bus_has_exactly_the_messages_that_the_table_puts_on_it(bus):
    messages = {message.frame_id: message for message in DATABASES[bus].messages}
    assert set(messages) == {variable.id for variable in TABLE.on_bus(bus)}
    for number, message in messages.items():
        variable = TABLE.variable(number)
        assert (message.name, message.length, message.comment) == (variable.name, 8, variable.description)
        assert message.senders == [variable.publisher] or variable.publisher == "PC"
        assert message.is_extended_frame is False
        if not variable.is_error_word:
            assert (message.get_signal_by_name("value").unit or "") == variable.unit


def test_every_id_on_can_is_on_the_bus_of_its_satellite():
    assert {variable.id for _, variable in CARRIED} == {
        variable.id for variable in TABLE.variables if set(variable.buses) - {"SSP"}
    }


@pytest.mark.parametrize(("bus", "variable"), CARRIED, ids=lambda item: getattr(item, "name", item))
def test_a_variable_is_packed_as_its_dbc_file_says(bus, variable):
    if variable.is_error_word:
        message = DATABASES[bus].get_message_by_frame_id(variable.id)
        for code, board, count in ((0, 0, 0), (62, 3, 1), (118, 9, 1023), (65535, 63, 512)):
            data = pack_frame("u32", error_word(code, board, count), 0xFFFFFFFF)
            parts = {"code": code, "board": board, "count": count, "time_ms": 0xFFFFFFFF}
            assert message.decode(data, decode_choices=False) == parts
            assert message.encode(parts, strict=False) == data
        return
    low, high = LIMITS[variable.type]
    low = low if variable.minimum is None else variable.minimum
    high = high if variable.maximum is None else variable.maximum
    for value, time_ms in ((low, 0), (high, 2**32 - 1), (variable.initial, 12345678), ((low + high) // 2, 1)):
        check(bus, variable, value, time_ms)


@settings(max_examples=examples(400))
@given(st.data())
def test_any_value_of_any_variable_is_packed_as_its_dbc_file_says(data):
    plain = [item for item in CARRIED if not item[1].is_error_word]
    bus, variable = data.draw(st.sampled_from(plain))
    check(bus, variable, data.draw(numbers_of(variable)), data.draw(times))


@settings(max_examples=examples(100))
@given(st.integers(0, 65535), st.integers(0, 63), st.integers(0, 1023), times)
def test_any_error_word_is_unpacked_as_its_dbc_file_says(code, board, count, time_ms):
    message = DATABASES["CAN1"].get_message_by_name("ERROR_MCH")
    decoded = message.decode(pack_frame("u32", error_word(code, board, count), time_ms), decode_choices=False)
    assert decoded == {"code": code, "board": board, "count": count, "time_ms": time_ms}


def test_an_error_is_decoded_by_its_name_and_its_board():
    data = pack_frame("u32", error_word(62, 3, 2), 1000)
    decoded = DATABASES["CAN1"].decode_message("ERROR_MCH", data)
    assert (str(decoded["code"]), str(decoded["board"]), decoded["count"]) == ("ASCHED_DNF", "MCH", 2)


def test_the_period_of_a_message_is_an_attribute_of_the_file():
    message = DATABASES["CAN3"].get_message_by_name("MCFO_RIGHT_HEEL_SENSE")
    assert message.dbc.attributes["PeriodMs"].value == 4.21875


def test_the_known_bytes_of_a_frame():
    # value 1.5 is 0x3FC00000, little-endian; time 0x01020304
    assert pack_frame("f32", 1.5, 0x01020304) == bytes([0, 0, 0xC0, 0x3F, 4, 3, 2, 1])
    assert pack_frame("i32", -2, 2**32 + 7) == bytes([0xFE, 0xFF, 0xFF, 0xFF, 7, 0, 0, 0])
    assert unpack_frame("i32", bytes([0xFE, 0xFF, 0xFF, 0xFF, 7, 0, 0, 0])) == (-2, 7)
    assert unpack_frame("u32", bytes([0xFE, 0xFF, 0xFF, 0xFF, 7, 0, 0, 0])) == (0xFFFFFFFE, 7)
