"""Crystals: true time and the board's time, exact for any length of run."""

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ranger_sim.firmware_sim.clock import Crystal, TickTrain, seeded_crystal
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import UserError

HOUR_NS = 3_600_000_000_000


def test_a_perfect_crystal_ticks_at_exact_multiples():
    assert Crystal(10_000_000, 0).tick_time_ns(7, 500_000, 123) == 3_500_123


def test_a_crystal_50_ppm_fast_gains_one_slot_of_half_a_millisecond_in_ten_seconds():
    # 20,001 slots in 10.0005 s of its own time, which are 10 s of true time
    assert Crystal(10_000_000, 50_000).tick_time_ns(20_001, 500_000, 0) == 10_000_000_000


def test_a_slow_crystal_ticks_late():
    assert Crystal(10_000_000, -20_000).tick_time_ns(2000, 500_000, 0) == 1_000_020_000


def test_one_cycle_of_60_megahertz_is_16_ns_and_60_are_a_microsecond():
    crystal = Crystal()
    assert crystal.cycles_to_ns(1, 60_000_000) == 16
    assert crystal.cycles_to_ns(60, 60_000_000) == 1000
    assert crystal.ns_to_cycles(1000, 60_000_000) == 60


@given(n=st.integers(0, 2**40), period=st.sampled_from([500_000, 1_000_000, 13]), ppb=st.integers(-(10**6), 10**6))
def test_every_tick_is_the_exact_quotient_rounded_down_even_after_years(n, period, ppb):
    exact = Fraction(n * period) * 10**9 / (10**9 + ppb)
    assert Crystal(10_000_000, ppb).tick_time_ns(n, period, 0) == exact.__floor__()


@given(
    first=st.integers(0, 2**40),
    period=st.sampled_from([500_000, 1_000_000, 13, 7_777_777]),
    phase=st.integers(0, 10**9),
    ppb=st.integers(-(10**6), 10**6),
)
def test_ticks_by_addition_are_those_of_the_absolute_count(first, period, phase, ppb):
    crystal = Crystal(10_000_000, ppb)
    train = TickTrain(crystal, period, phase)
    assert (train.number, train.time) == (0, phase)
    train.go_to(first)
    assert train.time == crystal.tick_time_ns(first, period, phase)
    for n in range(first + 1, first + 50):
        assert (train.next(), train.number) == (crystal.tick_time_ns(n, period, phase), n)


@given(ns=st.integers(0, 1000 * 24 * HOUR_NS), ppb=st.integers(-(10**6), 10**6))
def test_local_time_and_true_time_undo_each_other_to_a_nanosecond(ns, ppb):
    crystal = Crystal(10_000_000, ppb)
    assert ns - 2 <= crystal.true_ns(crystal.local_ns(ns)) <= ns


@given(ns=st.integers(0, 365 * 24 * HOUR_NS), ppb=st.integers(-(10**6), 10**6))
def test_counted_cycles_are_exact_after_a_year(ns, ppb):
    exact = Fraction(ns) * (10**9 + ppb) * 208_000_000 / 10**18
    assert abs(Crystal(13_000_000, ppb).ns_to_cycles(ns, 208_000_000) - exact) < 2


def test_the_short_conversions_agree_with_the_exact_ones():
    crystal = Crystal(10_000_000, 31_000)
    assert int(30_000 * crystal.ns_per_cycle(60_000_000)) == crystal.cycles_to_ns(30_000, 60_000_000) == 499_984
    assert int(500_000 * crystal.cycles_per_ns(60_000_000)) == crystal.ns_to_cycles(500_000, 60_000_000) == 30_000


def test_seeded_crystals_differ_by_stream_and_stay_within_their_tolerance():
    errors = [seeded_crystal(RandomStream(1, f"crystal {i}")).ppb for i in range(100)]
    assert len(set(errors)) > 90
    assert -30_000 <= min(errors) < -20_000
    assert 20_000 < max(errors) <= 30_000
    assert seeded_crystal(RandomStream(1, "crystal 5")).ppb == errors[5]


@pytest.mark.parametrize("hz, ppb", [(0, 0), (-1, 0), (10, 10**9)])
def test_an_impossible_crystal_is_refused(hz, ppb):
    with pytest.raises(UserError, match="crystal"):
        Crystal(hz, ppb)
