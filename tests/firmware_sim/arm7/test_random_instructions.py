"""Random instruction sequences against another emulator; 1,000,000 by the command in against_unicorn.py."""

import pytest

from tests.firmware_sim.arm7.against_unicorn import check


def test_twenty_thousand_random_instructions_do_what_they_do_in_unicorn():
    pytest.importorskip("unicorn", reason="the other emulator is not installed (pip install unicorn)")
    done, difference = check(20_000)
    assert difference is None
    assert done >= 20_000
