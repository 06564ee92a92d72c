"""A misfit without a name that chance could explain needs held-out data that show it, where there are any."""

import pytest

from ranger_sim.sysid import misfit
from ranger_sim.sysid.diagnosis import Diagnosis
from ranger_sim.sysid.plausibility import Doubts
from ranger_sim.sysid.results import HeldOutError


def found(p, features, black_box, share=0.1):
    """A diagnosis without a name; black_box: its error on held-out data of an equation that leaves 1 there."""
    before = misfit.Misfit([misfit.Test("force", features, 30.0, 1, p, share)], p, share)
    errors = {} if black_box is None else {"force": HeldOutError(1.0, 1.0, black_box, (1.0, 1.0))}
    return Diagnosis(
        None, [], None, None, [], [], [], [], {}, before, before, Doubts([], False),
        level=0.01, errors=errors, by_candidates=True,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("p", "features", "black_box", "detected"),
    [
        (0.005, "over a", 1.0, False),  # the black box is no better than the equation
        (0.005, "over a", 0.995, False),  # by 1 % of the square
        (0.005, "over a", 0.98, True),  # by 4 %
        (0.005, "over a", None, True),  # there are no held-out data
        (0.02, "over a", 0.5, False),  # chance explains it
        (1e-7, "over a", 1.0, True),  # chance does not, whatever another run shows
        (0.005, "over t", 1.0, True),  # another run has its own time
        (0.005, "a line in time", 1.0, True),
        (0.005, "over torque", 1.0, False),
    ],
)
def test_held_out_data_confirm_what_chance_might_explain(p, features, black_box, detected):
    assert found(p, features, black_box).detected is detected


def test_a_large_part_counts_though_the_black_box_learns_nothing_that_another_run_has():
    assert found(0.005, "over x", 1.0, share=0.6).detected
