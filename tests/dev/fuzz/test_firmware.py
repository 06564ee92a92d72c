"""A short run of `python -m dev.fuzz firmware`, and that its checks can fail."""

import json

import pytest

from dev.fuzz import Finding
from dev.fuzz import firmware as fuzz_firmware
from ranger_sim.foundation.user_error import UserError
from tests.firmware_sim.native.support import COMPILER

pytestmark = [
    pytest.mark.skipif(not COMPILER, reason="no C compiler here"),
    pytest.mark.skipif(not hasattr(fuzz_firmware.os, "pidfd_open"), reason="processes of boards need Linux"),
]


def test_hostile_programs_end_with_a_cause_and_leave_nothing_and_a_later_run_goes_on(tmp_path):
    state = tmp_path / "state.json"
    assert fuzz_firmware.run(6, 1, state)["cases"] == 6
    counts = fuzz_firmware.run(12, 1, state)
    assert counts["refused"] + counts["lost"] + counts["failed"] + counts["went_on"] == counts["cases"] == 12
    assert counts["images"] == 2 and counts["lost"] > 2
    with pytest.raises(UserError, match="seed 1, not 2"):
        fuzz_firmware.run(12, 2, state)


SUMMARY = {"fell": False, "failed_boards": ["MCH"], "firmware": {"MCH": {"why": "it called exit(3)", "lost_s": 0.01}}}
WITHOUT_CAUSE = {**SUMMARY, "firmware": {"MCH": {"why": None, "lost_s": 0.01}}}


@pytest.mark.parametrize(
    ("code", "output", "errors", "reported"),
    [
        (1, SUMMARY, "Traceback (most recent call last):", "Traceback"),
        (-11, None, "", "code -11"),
        (0, SUMMARY, "", "code 0, failed boards"),
        (1, WITHOUT_CAUSE, "", "lost without a cause"),
        (1, None, "", "standard output is not JSON"),
        (2, None, "oops", "refused, but"),
    ],
)
def test_a_walk_that_ends_otherwise_is_a_finding(tmp_path, code, output, errors, reported):
    fuzz = fuzz_firmware.Fuzz(1, tmp_path)
    fuzz.check(1, json.dumps(SUMMARY).encode(), "", "case 0")
    with pytest.raises(Finding, match=reported):
        fuzz.check(code, json.dumps(output).encode() if output else b"", errors, "case 1")


def test_the_same_seed_makes_the_same_programs(tmp_path, monkeypatch):
    choices = []
    for again in ("a", "b"):
        fuzz = fuzz_firmware.Fuzz(7, tmp_path / again)
        fuzz.programs.mkdir(parents=True)

        def keeps(*_, fuzz=fuzz):
            choices.append((fuzz.programs / fuzz_firmware.CHOICE).read_text(encoding="utf-8"))
            return 1, json.dumps(SUMMARY).encode(), ""

        monkeypatch.setattr(fuzz, "walk", keeps)
        fuzz.case(3)
    assert choices[0] == choices[1]
