"""How late slots are: bins, quantiles and the report without slots."""

from hypothesis import given
from hypothesis import strategies as st

from ranger_sim.harness.processes.lateness import BINS, bin_of, figures, quantile_us, upper_edge_us
from ranger_sim.harness.processes.places import LATENESS_WORDS


def test_bins_by_hand():
    assert [bin_of(late) for late in (-5, 0, 1, 63, 64, 65, 127, 128, 129, 130)] == [
        0,
        0,
        1,
        63,
        64,
        65,
        127,
        128,
        128,
        129,
    ]
    assert bin_of(1 << 40) == BINS - 1 == LATENESS_WORDS - 1


@given(st.integers(0, (1 << 26) - 1))
def test_a_time_lies_below_the_edge_of_its_bin_and_above_the_one_before(late):
    number = bin_of(late)
    assert upper_edge_us(number) >= late
    assert number == 0 or upper_edge_us(number - 1) < late
    assert upper_edge_us(number) <= late * 65 / 64 + 1


def test_quantiles_of_known_slots():
    bins = [0] * BINS
    for late in range(1, 61):
        bins[bin_of(late)] += 1
    assert quantile_us(bins, 0.5) == 30
    assert quantile_us(bins, 1.0) == 60
    assert figures(bins, 60.0) == {"slots": 60, "p50_us": 30, "p99_us": 60, "p999_us": 60, "max_us": 60.0}


def test_without_slots_no_figures_exist():
    assert figures([0] * BINS, 0.0) == {"slots": 0, "p50_us": None, "p99_us": None, "p999_us": None, "max_us": None}
