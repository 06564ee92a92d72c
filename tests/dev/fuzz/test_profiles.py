"""A short run of `python -m dev.fuzz profiles`, and that its checks can fail."""

import pytest

from dev.fuzz import profiles as fuzz_profiles
from ranger_sim.harness.outside import profile


def test_broken_profiles_pass_or_are_refused_with_a_line_per_fault():
    figures = fuzz_profiles.run(120)
    assert figures["passed"] + figures["refused"] == figures["cases"] == 120
    assert figures["passed"] > 5 and figures["refused"] > 50 and figures["faults"] > figures["refused"]


def test_a_traceback_would_end_it(monkeypatch):
    def breaks(*_, **__):
        raise KeyError("can1")

    monkeypatch.setattr(profile, "_boards", breaks)
    with pytest.raises(KeyError):
        fuzz_profiles.run(50)
