"""What the commands that measure the diagnosis compute themselves, by hand: sizes that theory allows, coverage."""

import numpy as np
import pytest
from scipy.signal import lfilter

from ranger_sim.foundation.random_arrays import generator
from tests.sysid import coverage, left_out_terms


def test_19_of_20_intervals_leave_the_target_open_95_of_100_keep_it_and_half_of_20_miss_it():
    def records(held, of=20):
        return [
            {"what": "drag", "detected": True, "right": True, "value": 1.1, "true": 1.0,
             "ci95": [0.9, 1.2] if n < held else [1.05, 1.2]}
            for n in range(of)
        ]  # fmt: skip

    few, missed = (coverage.markdown(records(held)).splitlines()[2] for held in (19, 10))
    assert "| kept |" in coverage.markdown(records(95, 100))
    assert few == "| drag | 20 of 20 | 20 of 20 | 19 of 20 | 75% to 100% | open | 10.0% |"
    assert missed == "| drag | 20 of 20 | 20 of 20 | 10 of 20 | 27% to 73% | **missed** | 10.0% |"


def test_a_cause_that_was_not_named_has_no_interval():
    lines = coverage.markdown([{"what": "lag", "detected": False, "right": False}, {"what": "lag", "failed": "stack"}])
    assert "| lag | 0 of 1 | 0 of 1 |  |  |  |  |" in lines and "lag: 1 without an answer" in lines


@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_the_smallest_share_is_that_of_generalised_least_squares(memory, monkeypatch):
    """A known joint in noise with a memory: the scatter of its Coulomb friction is the one computed."""
    time_s = np.arange(4000) * 0.01
    angle = np.sin(0.9 * time_s) + 0.4 * np.sin(2.3 * time_s + 1.0)
    rate = 0.9 * np.cos(0.9 * time_s) + 0.92 * np.cos(2.3 * time_s + 1.0)
    exact = 0.06 * np.gradient(rate, 0.01) + 0.35 * rate + 0.25 * np.sign(rate) + 0.02
    term = next(each for each in left_out_terms.TERMS if each.title == "joint 1, Coulomb friction")

    def fitted(seed):
        shocks = generator(seed, "joint in noise").normal(size=4000) * np.sqrt(1.0 - memory**2)
        current = exact + 0.03 * lfilter([1.0], [1.0, -memory], shocks)
        values = {"angle_rad": angle, "rate_rad_per_s": rate, "current_A": current}
        monkeypatch.setattr(left_out_terms.Source, "parts", lambda self: [(time_s, values)])
        return term.fitted()

    found = [fitted(seed) for seed in range(25)]
    values, errors = np.array([each[0] for each in found]), np.array([each[1] for each in found])
    assert np.mean(values) == pytest.approx(0.25, abs=0.006)
    # plain least squares has the value, so that its scatter is no less than what the computed error says is possible
    assert 0.7 * np.mean(errors) < np.std(values) < 3.0 * np.mean(errors)
