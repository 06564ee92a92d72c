"""Quantities as people write them."""

import math

import numpy as np
import pytest

from ranger_sim.foundation.quantities import (
    SHARES,
    SLOPES,
    TIMES,
    duration_ns,
    duration_text,
    given_text,
    in_base_units,
    nanoseconds,
)
from ranger_sim.foundation.user_error import UserError


@pytest.mark.parametrize(
    ("text", "ns"),
    [("450 us", 450_000), ("50ms", 50_000_000), ("2 s", 2 * 10**9), ("0 ns", 0), ("7 ns", 7), ("1.5 min", 90 * 10**9)],
)
def test_a_duration_is_whole_nanoseconds(text, ns):
    assert nanoseconds(text) == ns


@pytest.mark.parametrize("text", ["450", "us", "1 light-year", "nan s", "inf s", "1 2 s", "", 5, None])
def test_a_text_that_is_not_a_duration_is_refused_by_name(text):
    with pytest.raises(UserError, match=r"within .*a number with one of the units ns, us, ms, s, min, h is needed"):
        nanoseconds(text, "within")


def test_a_negative_duration_is_refused():
    with pytest.raises(UserError, match="must not be below 0"):
        nanoseconds("-1 ns")


@pytest.mark.parametrize(
    ("duration", "ns"),
    [("1 s", 10**9), ("20 ms", 20_000_000), ("500 us", 500_000), (1, 10**9), (0.02, 20_000_000), (0, 0), ("0 s", 0)],
)
def test_a_duration_is_text_or_a_number_of_seconds(duration, ns):
    assert duration_ns(duration) == duration_ns(np.float64(ns * 1e-9)) == ns


@pytest.mark.parametrize(
    "duration", ["5", "ms", "", "-1 ms", -1, -0.5, math.nan, math.inf, True, None, b"1 s", [1], "1e400 s", "1 ms 2", 1j]
)
def test_anything_else_as_a_duration_is_one_clear_error(duration):
    with pytest.raises(UserError) as error:
        duration_ns(duration, "run_for")
    assert str(error.value) == (
        f"run_for {duration!r}: a time from 0 on is needed, as text such as '20 ms' (units ns, us, ms, s, min, h) or "
        "as a number of seconds"
    )


def test_a_duration_is_printed_as_it_was_given():
    assert [given_text(each) for each in ("20ms", 0.02, 0)] == ["20ms", "20 ms", "0 ns"]


def test_a_unit_may_be_left_out_where_a_base_is_known():
    assert in_base_units("3", TIMES) == 3.0
    assert in_base_units("3 m", TIMES) is None


@pytest.mark.parametrize(
    ("ns", "text"), [(0, "0 ns"), (999, "999 ns"), (1000, "1 us"), (-12_500, "-12.5 us"), (1.25e9, "1.25 s")]
)
def test_a_duration_is_printed_in_the_unit_that_reads_best(ns, text):
    assert duration_text(ns) == text


@pytest.mark.parametrize(
    ("text", "rad"),
    [
        ("0.1", 0.1),
        ("100 mrad", 0.1),
        ("45deg", 0.7853981633974483),
        ("100%", 0.7853981633974483),
        ("-10 %", -0.09966865),
    ],
)
def test_a_slope_in_percent_is_height_over_distance(text, rad):
    assert in_base_units(text, SLOPES) == pytest.approx(rad, abs=1e-8)


def test_a_share_in_percent_is_a_hundredth_of_the_number():
    assert in_base_units("70 %", SHARES) == pytest.approx(0.7, rel=1e-12)
    assert in_base_units("0.7", SHARES) == 0.7
