"""Bounds for the score of one run of the blind cases that a method keeps at any seed if it meets the targets.

A share with target p over n independent cases is binomial. A method that is just good enough falls below k successes
with a probability from the binomial law; the bound is the largest k for which that is at most the risk. The risk
of one run, 1e-6, is divided by the number of bounds (Bonferroni), so that a run fails falsely at most once in a million
whatever the figures have to do with each other. Few cases make weak bounds; what they refuse for certain is shown in
test_bounds.py: a refit, one label for all, a diagnosis that lacks a balance.
"""

import dataclasses

from scipy import stats

from tests.blind.score import share_interval

RISK = 1e-6  # of a false failure in one run


@dataclasses.dataclass(frozen=True)
class Bound:
    """A figure of the score, the share of successes that a sufficient method has, and whether successes are hits."""

    figure: str
    target: float
    hits: bool = True  # False: the figure counts failures, and `target` is their share


# The targets of the benchmark. A figure for one balance takes the target of all.
BOUNDS = (
    Bound("answers missing", 0.0, False),
    Bound("false alarms", 0.02, False),
    Bound("detection at 2", 0.97),
    Bound("detection at 4", 0.99),
    Bound("detection at 4, balance E", 0.99),
    Bound("detection at 4, balance M", 0.99),
    Bound("detection at 4, balance T", 0.99),
    Bound("top-1 cause at 2", 0.85),
    Bound("top-1 cause at 4", 0.95),
    Bound("right subsystem", 0.95),
    Bound("truth in the set", 0.95),
    Bound("confusable pair declared a tie", 0.90),
    Bound("coverage of 95 % intervals", 0.90),
    Bound("extended model worse", 0.01, False),
    Bound("two effects exact", 0.70),
    Bound("two effects, one or more spurious", 0.10, False),
    Bound("outside: abstains", 0.85),
    Bound("outside: wrong name", 0.05, False),
)


def least(cases, target, risk):
    """The largest k with P(successes < k) <= risk for `cases` trials of probability `target`."""
    k = int(stats.binom.ppf(risk, cases, target))
    while k > 0 and stats.binom.cdf(k - 1, cases, target) > risk:
        k -= 1
    while k < cases and stats.binom.cdf(k, cases, target) <= risk:
        k += 1
    return k


def refusals(figures, bounds=BOUNDS, risk=RISK):
    """Sentences on the bounds that a run breaks; figures without a case break none."""
    by_name = {figure.name: figure for figure in figures}
    out = []
    for bound in bounds:
        figure = by_name[bound.figure]
        if not figure.cases:
            continue
        share = bound.target if bound.hits else 1.0 - bound.target
        needed = least(figure.cases, share, risk / len(bounds))
        successes = figure.successes if bound.hits else figure.cases - figure.successes
        if successes < needed:
            low, high = share_interval(successes, figure.cases)
            out.append(
                f"{figure.name}: {successes} of {figure.cases} right (95 % interval {low:.2f} ... {high:.2f}), "
                f"at least {needed} are needed for a target of {share:g}"
            )
    return out
