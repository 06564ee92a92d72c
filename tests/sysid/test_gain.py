"""The interval of a gain: drawn from blocks of held-out rows."""

from types import SimpleNamespace

import numpy as np
import pytest

from ranger_sim.sysid import gain


@pytest.mark.parametrize(
    ("whitened", "step_s", "every", "rows", "block"),
    [
        (True, 0.002, 1, 10_000, 50),  # longer than any memory that whitening leaves
        (False, 0.002, 1, 10_000, 500),  # a second
        (False, 0.004, 3, 850, 83),  # a second again: one row in three of 4 ms
        (False, 0.004, 3, 400, 50),  # eight blocks of what there is
        (False, 0.1, 1, 4000, 50),
        (True, 0.002, 1, 80, 10),
        (True, 0.002, 1, 3, 1),
    ],
)
def test_blocks_of_the_bootstrap_are_a_second_long_and_eight_or_more(whitened, step_s, every, rows, block):
    recording = SimpleNamespace(whitened=whitened, every=every, table=SimpleNamespace(step_s=step_s))
    plain = SimpleNamespace(recordings=[recording], residual=np.zeros(rows))
    assert gain._rows_of_a_block(plain) == block
