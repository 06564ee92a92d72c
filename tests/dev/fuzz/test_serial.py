"""A short run of `python -m dev.fuzz serial`, and that its checks can fail."""

import pytest

from dev.fuzz import Finding
from dev.fuzz import serial as fuzz_serial


def test_three_hundred_cases_of_wrong_bytes_move_the_counters_and_stop_nothing():
    result = fuzz_serial.run(300)
    assert result["cases"] == 300
    for name in ("packets", "refused", "bad_packets", "daq_segments", "daq_bad_checksums", "daq_skipped_bytes"):
        assert result[name] > 0, name


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda fuzz: setattr(fuzz.board.computer, "packets", 5), "bytes to the robot"),
        (lambda fuzz: setattr(fuzz.session.decoder, "skipped_bytes", 5), "bytes from the robot"),
        (lambda fuzz: setattr(fuzz.board.scheduler, "overruns", 1), "took too long"),
    ],
)
def test_the_checks_notice(spoil, words):
    fuzz = fuzz_serial.Fuzz()
    fuzz.case()
    spoil(fuzz)
    with pytest.raises(Finding, match=words):
        fuzz.case()
