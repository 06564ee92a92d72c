"""The lateness of slots: a histogram in shared memory, fine for short times and never full.

Bins: 64 of 1 us each up to 64 us; from there 64 per doubling (1.6 % and less), to 2^26 us. All in whole us.
"""

from typing import Any

FINE = 64
DOUBLINGS = 20
BINS = FINE + FINE * DOUBLINGS  # 1344, block.LATENESS_WORDS


def bin_of(late_us: int) -> int:
    """Number of the bin; below zero counts as zero."""
    if late_us < FINE:
        return max(late_us, 0)
    doubling = late_us.bit_length() - 7  # 64 ... 127 us: 0
    if doubling >= DOUBLINGS:
        return BINS - 1
    return FINE + FINE * doubling + (late_us >> doubling) - FINE


def upper_edge_us(number: int) -> int:
    """The largest whole number of us that falls into a bin."""
    if number < FINE:
        return number
    doubling, place = divmod(number - FINE, FINE)
    return ((FINE + place + 1) << doubling) - 1


def quantile_us(bins: Any, share: float) -> int | None:
    """The lateness (us) that `share` of the slots did not exceed, by the upper edge of its bin; None without slots."""
    total = sum(bins)
    if not total:
        return None
    wanted, seen = share * total, 0
    for number, count in enumerate(bins):
        seen += count
        if seen >= wanted:
            return upper_edge_us(number)
    return upper_edge_us(BINS - 1)


def figures(bins: Any, largest_us: float) -> dict:
    """p50, p99, p99.9 and largest lateness in us, and the number of slots."""
    shares = {"p50_us": 0.5, "p99_us": 0.99, "p999_us": 0.999}
    found: dict = {}
    for name, share in shares.items():
        value = quantile_us(bins, share)
        found[name] = None if value is None else min(value, largest_us)
    return {"slots": sum(bins), **found, "max_us": largest_us if sum(bins) else None}
