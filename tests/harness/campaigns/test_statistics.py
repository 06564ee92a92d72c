"""Intervals and stopping rules against published values."""

import math

import numpy as np
import pytest
from scipy import stats

from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.campaigns import statistics


# Newcombe, "Two-sided confidence intervals for the single proportion", Statistics in Medicine 17 (1998), table I:
# 81 of 263, 15 of 148, 0 of 20, 1 of 29, at 95 %.
@pytest.mark.parametrize(
    ("count", "total", "low", "high"),
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_wilsons_interval_is_the_published_one(count, total, low, high):
    found = statistics.wilson(count, total)
    assert (round(found.low, 4), round(found.high, 4)) == (low, high)


@pytest.mark.parametrize(
    ("count", "total", "low", "high"),
    [(81, 263, 0.2527, 0.3676), (15, 148, 0.0578, 0.1617), (0, 20, 0.0, 0.1684), (1, 29, 0.0009, 0.1776)],
)
def test_clopper_and_pearsons_interval_is_the_published_one(count, total, low, high):
    found = statistics.clopper_pearson(count, total)
    assert (round(found.low, 4), round(found.high, 4)) == (low, high)


@pytest.mark.parametrize("share", [0.02, 0.3, 0.5, 0.97])
@pytest.mark.parametrize("total", [10, 60])
def test_clopper_and_pearson_cover_at_least_what_they_say_for_every_share(total, share):
    counts = range(total + 1)
    covered = [c.low <= share <= c.high for c in (statistics.clopper_pearson(k, total) for k in counts)]
    assert sum(stats.binom.pmf(counts, total, share) * covered) >= 0.95


def test_intervals_are_mirrored_when_the_other_outcome_is_counted():
    for make in statistics.INTERVALS.values():
        one, other = make(3, 40), make(37, 40)
        assert one.low == pytest.approx(1.0 - other.high, abs=1e-12)
        assert one.high == pytest.approx(1.0 - other.low, abs=1e-12)


def test_a_census_has_no_interval():
    share = statistics.census(3, 4)
    assert (share.value, share.low, share.high, share.confidence) == (0.75, None, None, None)


def test_a_share_of_nothing_is_refused():
    for bad in ((0, 0), (3, 2), (-1, 4)):
        with pytest.raises(UserError, match=f"{bad[0]} of {bad[1]}"):
            statistics.wilson(*bad)


# Wilks (1941): the largest of 59 values bounds 95 % of the population with 95 %, of 299 bounds 99 %, of 22 bounds 90 %
# with 90 %; the second largest takes 93 values.
@pytest.mark.parametrize(("share", "confidence", "needed"), [(0.95, 0.95, 59), (0.99, 0.95, 299), (0.90, 0.90, 22)])
def test_as_many_values_are_needed_as_wilks_says(share, confidence, needed):
    assert statistics.values_needed(share, confidence) == needed
    assert statistics.tolerance_place(needed, share, confidence) == needed
    assert statistics.tolerance_place(needed - 1, share, confidence) is None


def test_the_second_largest_of_93_values_bounds_95_percent():
    assert statistics.tolerance_place(92, 0.95, 0.95) == 92
    assert statistics.tolerance_place(93, 0.95, 0.95) == 92


def test_a_run_that_detected_nothing_is_later_than_any_limit():
    times = [float(each) for each in range(58)] + [math.inf]
    assert statistics.upper_tolerance(times, 0.95, 0.95) == math.inf
    assert statistics.upper_tolerance(times[:58], 0.95, 0.95) is None


# Jennison and Turnbull (2000), tables 2.1 and 2.3, two-sided 0.05: C_P(K), C_B(K).
@pytest.mark.parametrize(
    ("looks", "pocock", "obrien_fleming"),
    [(1, 1.960, 1.960), (2, 2.178, 1.977), (3, 2.289, 2.004), (4, 2.361, 2.024), (5, 2.413, 2.040), (10, 2.555, 2.087)],
)
def test_the_bounds_of_repeated_looks_are_the_published_ones(looks, pocock, obrien_fleming):
    assert statistics.pocock(looks)[0] == pytest.approx(pocock, abs=6e-4)
    assert statistics.obrien_fleming(looks)[-1] == pytest.approx(obrien_fleming, abs=6e-4)
    assert statistics.obrien_fleming(looks)[0] == pytest.approx(obrien_fleming * math.sqrt(looks), abs=3e-3)


def test_five_looks_with_the_bound_of_one_would_err_14_percent_of_the_time():
    # Armitage, McPherson and Rowe (1969), table 2: 0.142 for five looks at the nominal 5 %
    assert statistics.crossing_probability([1.96] * 5) == pytest.approx(0.142, abs=5e-4)


def test_a_campaign_that_may_stop_early_still_errs_no_more_often_than_it_says():
    # 1200 campaigns of 200 runs whose true share is the limit: each stop is an error. 5 % are allowed; the score
    # statistic of a share is a normal one only nearly, and 1200 draws scatter by 0.6 %, so 7 % at 3 deviations.
    stopping = statistics.Stopping("fall", 0.5, runs=200, looks=5)
    bounds = stopping.bounds
    stream = RandomStream(1, "stopping")
    wrong = 0
    for _ in range(1200):
        falls = np.cumsum([stream.uniform() < 0.5 for _ in range(200)])
        for look, bound in enumerate(bounds, start=1):
            total = stopping.look_after(look)
            low, high = statistics._score_interval(int(falls[total - 1]), total, bound)
            if not low <= 0.5 <= high:
                wrong += 1
                break
    assert 0.03 < wrong / 1200 < 0.07


def test_a_clear_share_stops_early_and_a_doubtful_one_does_not():
    stopping = statistics.Stopping("fall", 0.5, runs=200, looks=5)
    assert stopping.look_after(1) == 40
    assert stopping.decides(stopping.interval(40, 40, 1))
    assert not stopping.decides(stopping.interval(24, 40, 1))
    assert stopping.decides(stopping.interval(0, 40, 1))


def test_a_tolerance_is_missed_only_when_so_few_would_hardly_come_by_chance():
    assert statistics.shown_to_miss(0, 5, 0.5, 0.95) and not statistics.shown_to_miss(0, 4, 0.5, 0.95)  # 1/32 and 1/16
    assert not statistics.shown_to_miss(95, 100, 0.95, 0.95)
    # P(Binomial(100, 0.95) <= 90) = 0.0282, <= 91 = 0.0631 (tables)
    assert statistics.shown_to_miss(90, 100, 0.95, 0.95) and not statistics.shown_to_miss(91, 100, 0.95, 0.95)
