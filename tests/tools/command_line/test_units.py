"""Values of the command line: read, limited, and written so that they are read back as the same number."""

import argparse
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ranger_sim.foundation.user_error import UserError, printable
from ranger_sim.tools.command_line.units import (
    ANGLES,
    LENGTHS,
    NEGATIVE_VALUE,
    TIMES,
    Quantity,
    quantity,
    whole_number,
    word,
)


@pytest.mark.parametrize(
    ("kind", "text", "value"),
    [
        (quantity(TIMES, "s"), "1.5 min", 90.0),
        (quantity(LENGTHS, "m", least=0.0), "0", 0.0),
        (quantity(LENGTHS, "m", most=0.1), "100mm", 0.1),
        (quantity(ANGLES, "rad"), "-180deg", -math.pi),
        (Quantity(), "-.5", -0.5),
        (whole_number(1, 10), "10", 10),
        (whole_number(), "-3", -3),
        (whole_number(1000), "1e6", 1_000_000),
        (whole_number(), "9" * 30, int("9" * 30)),
    ],
)
def test_a_value_is_read(kind, text, value):
    assert kind(text) == value


@pytest.mark.parametrize(
    ("kind", "text", "complaint"),
    [
        (quantity(TIMES, "s", above=0.0), "0s", "'0s' must be above 0 s"),
        (quantity(TIMES, "s", above=0.0, most=9.0), "9.1", "must be above 0 s and at most 9 s"),
        (quantity(LENGTHS, "m", least=0.0), "-1mm", "'-1mm' must be at least 0 m"),
        (quantity(LENGTHS, "m"), "1e999", "must be finite"),
        (quantity(LENGTHS, "m"), "3 parsec", "with one of the units mm, cm, m, km (none means m)"),
        (quantity(LENGTHS, "m"), "٣m", "is not a number"),
        (Quantity(), "5s", "'5s' is not a number"),
        (whole_number(1), "0", "'0' is below 1"),
        (whole_number(1, 5), "6", "'6' is above 5"),
        (whole_number(), "1.5", "is not a whole number"),
        (whole_number(), "1e400", "is not a whole number"),
        (whole_number(), "9" * 5000, "9...' is not a whole number"),
        (word("a file"), "", "a file is expected"),
    ],
)
def test_a_value_beyond_its_limit_is_refused_with_the_limit(kind, text, complaint):
    with pytest.raises(argparse.ArgumentTypeError) as refused:
        kind(text)
    assert complaint in str(refused.value) and len(str(refused.value)) < 150


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_quantity_is_read_back_as_the_very_same_number(value):
    for kind in (quantity(TIMES, "s"), quantity(ANGLES, "rad"), Quantity()):
        assert kind(kind.text(value)).hex() == value.hex()


@given(st.text())
def test_a_line_of_a_message_is_one_line_that_a_terminal_only_shows(text):
    assert printable(text).isprintable()
    assert str(UserError(text, text)).splitlines() == ([printable(text)] * 2 if text else [""])


def test_what_can_be_shown_is_left_as_it_is():
    assert printable("Größe ± 1 µm [/x]") == "Größe ± 1 µm [/x]"
    assert printable("a\033[31m\r\n\u202e\udcff") == r"a\x1b[31m\r\n\u202e\udcff"


@pytest.mark.parametrize("text", ["-1s", "-.5", "-3 mm", "-inf", "-1e300"])
def test_a_negative_value_is_not_an_option(text):
    assert NEGATIVE_VALUE.match(text) and not NEGATIVE_VALUE.match(f"-{text}") and not NEGATIVE_VALUE.match("-h")
