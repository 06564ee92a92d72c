"""What intervals, tolerances and stopping rules take and refuse, and where their looks are."""

import math

import numpy as np
import pytest
from scipy import stats

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.campaigns import statistics
from ranger_sim.harness.campaigns.statistics import Share, Stopping


@pytest.mark.parametrize("make", [statistics.wilson, statistics.clopper_pearson])
def test_a_share_has_a_count_up_to_its_total_and_a_confidence_between_nothing_and_all(make):
    for count, total in ((0, 1), (1, 1), (5, 5)):
        assert (make(count, total).count, make(count, total).total, make(count, total).confidence) == (
            count,
            total,
            0.95,
        )
    assert make(0, 7).low == 0.0 and make(7, 7).high == 1.0 and make(0, 7).high > 0.0 and make(7, 7).low < 1.0
    for count, total in ((-1, 5), (6, 5), (0, 0), (1, 0)):
        with pytest.raises(UserError, match=f"share: {count} of {total}"):
            make(count, total)
    for confidence in (0.0, 1.0, -0.1, math.nan):
        with pytest.raises(UserError, match="confidence is "):
            make(1, 2, confidence)
    assert math.isnan(Share(0, 0).value) and Share(1, 4).value == 0.25


@pytest.mark.parametrize(("count", "total", "confidence"), [(0, 9, 0.9), (3, 9, 0.5), (9, 9, 0.99), (1, 2, 0.95)])
def test_both_ends_of_an_interval_are_where_the_count_becomes_too_unlikely(count, total, confidence):
    tail = (1.0 - confidence) / 2.0
    exact = statistics.clopper_pearson(count, total, confidence)
    if count:
        assert stats.binom.sf(count - 1, total, exact.low) == pytest.approx(tail)
    if count < total:
        assert stats.binom.cdf(count, total, exact.high) == pytest.approx(tail)
    score = statistics.wilson(count, total, confidence)
    z = stats.norm.ppf(1.0 - tail)
    for share in (score.low, score.high):
        if 0.0 < share < 1.0:
            assert abs(count / total - share) == pytest.approx(z * math.sqrt(share * (1.0 - share) / total))


@pytest.mark.parametrize("total", [1, 2, 13, 14, 40])
def test_a_tolerance_limit_is_the_first_value_that_bounds_the_share_surely_enough(total):
    share, confidence = 0.8, 0.94
    serves = [place for place in range(1, total + 1) if stats.binom.cdf(place - 1, total, share) >= confidence]
    assert statistics.tolerance_place(total, share, confidence) == (serves[0] if serves else None)
    values = [float(total - each) for each in range(total)]  # downwards from `total` to 1
    assert statistics.upper_tolerance(values, share, confidence) == (float(serves[0]) if serves else None)


def test_tolerances_are_refused_outside_nothing_and_all():
    assert statistics.tolerance_place(0, 0.5, 0.5) is None
    for share, confidence, name in (
        (0.0, 0.5, "share"),
        (1.0, 0.5, "share"),
        (0.5, 0.0, "confidence"),
        (0.5, 1.0, "conf"),
    ):
        with pytest.raises(UserError, match=f"tolerance: {name}"):
            statistics.tolerance_place(9, share, confidence)


@pytest.mark.parametrize("make", [statistics.pocock, statistics.obrien_fleming])
def test_a_rule_has_one_to_fifty_looks_and_an_error_below_a_half(make):
    assert len(make(50)) == 50 and len(make(1, 0.49)) == 1
    assert make(1, 0.1)[0] == pytest.approx(stats.norm.ppf(0.95), abs=1e-4)
    for looks in (0, 51):
        with pytest.raises(UserError, match=f"stopping rule: {looks} looks, allowed are 1 to 50"):
            make(looks)
    for error in (0.0, 0.5, -0.1):
        with pytest.raises(UserError, match="stopping rule: an error of "):
            make(3, error)


def test_the_shapes_of_both_rules():
    first, *rest = statistics.pocock(4)
    assert rest == [first] * 3
    bounds = statistics.obrien_fleming(4)
    assert [bound * math.sqrt(look) for look, bound in enumerate(bounds, start=1)] == pytest.approx([2 * bounds[3]] * 4)
    assert statistics.crossing_probability(bounds) == pytest.approx(0.05, abs=1e-5)
    # two looks, by the bivariate normal distribution of Z1 and Z2 with a correlation of sqrt(1/2)
    b1, b2 = 1.7, 2.1
    both = stats.multivariate_normal(cov=[[1.0, math.sqrt(0.5)], [math.sqrt(0.5), 1.0]])
    inside = both.cdf([b1, b2], lower_limit=[-b1, -b2])
    assert statistics.crossing_probability([b1, b2]) == pytest.approx(1.0 - inside, abs=1e-5)
    assert statistics.crossing_probability([1e9, 1.96]) == pytest.approx(0.05, abs=1e-4)


def test_simpsons_rule_is_exact_for_a_cubic():
    points = np.linspace(-1.0, 3.0, 9)
    assert statistics._simpson(points) @ (points**3 - points + 2.0) == pytest.approx(80 / 4 - 8 / 2 + 8)


def test_looks_are_after_equal_parts_rounded_up_and_decide_outside_the_interval():
    stopping = Stopping("fall", 0.25, 10, 4)
    assert [stopping.look_after(look) for look in (1, 2, 3, 4)] == [3, 5, 8, 10]
    assert stopping.bounds == statistics.obrien_fleming(4, 1.0 - 0.95)
    assert Stopping("fall", 0.25, 10, 4, "pocock", 0.9).bounds == statistics.pocock(4, 1.0 - 0.9)
    found = stopping.interval(2, 5, 2)
    z = stopping.bounds[1]
    same = statistics.wilson(2, 5, 2.0 * stats.norm.cdf(z) - 1.0)  # with another confidence
    assert (found.low, found.high, found.confidence) == (pytest.approx(same.low), pytest.approx(same.high), 0.95)
    for low, high, decides in ((0.25, 0.5, False), (0.1, 0.25, False), (0.26, 0.5, True), (0.1, 0.24, True)):
        assert stopping.decides(Share(1, 4, low, high)) is decides
    assert not stopping.decides(Share(1, 4)) and not stopping.decides(Share(1, 4, 0.5))
    with pytest.raises(UserError, match="share: 6 of 5"):
        stopping.interval(6, 5, 1)


def test_a_stopping_rule_is_refused_without_a_name_a_share_or_runs_enough():
    assert Stopping("fall", 0.5, 1, 1).looks == 1 and Stopping("fall", 0.5, 50, 50).looks == 50
    for arguments, reported in (
        (("fall", 0.5, 10, 5, "wald"), "stopping rule 'wald': allowed are obrien-fleming, pocock"),
        (("fall", 0.0, 10), "limit is 0.0"),
        (("fall", 1.0, 10), "limit is 1.0"),
        (("fall", 0.5, 10, 0), "0 looks at 10 runs"),
        (("fall", 0.5, 10, 11), "11 looks at 10 runs"),
        (("fall", 0.5, 100, 51), "51 looks at 100 runs"),
    ):
        with pytest.raises(UserError, match=reported):
            Stopping(*arguments)
