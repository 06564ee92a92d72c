"""The options that put a robot's serial lines on ports, as `walk` takes them."""

import json
import re

import pytest

from ranger_sim.tools import cli
from ranger_sim.tools.run import walk


@pytest.fixture(autouse=True)
def no_waiting(monkeypatch):
    """The walk is paced by the wall clock: let the clock stop where it would wait."""
    slept = []
    monkeypatch.setattr(walk.wallclock, "sleep_s", slept.append)
    return slept


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--daq-dropouts"], "--daq-link and --daq-dropouts need --daq-port"),
        (["--daq-link", "wired"], "need --daq-port"),
        (["--imu-port", "pty", "--imu-offer", "pty"], "--imu-port and --imu-offer exclude each other"),
        (["--daq-port", "/dev/no-such-port"], "serial port /dev/no-such-port: No such file or directory"),
        (["--daq-port", "/dev/null"], "serial port /dev/null"),
    ],
)
def test_a_mistake_gets_one_line(capsys, arguments, words):
    assert cli.main(["walk", "--time", "0.1s", *arguments]) == 2
    reported = capsys.readouterr()
    assert reported.out == "" and words in reported.err and len(reported.err.splitlines()) == 1


def test_the_name_of_the_pseudo_terminal_is_printed_and_the_walk_keeps_to_the_clock(capsys, no_waiting):
    assert cli.main(["walk", "--time", "0.1s", "--daq-port", "pty", "--daq-dropouts", "--imu-offer", "pty"]) == 0
    reported = capsys.readouterr().err
    assert re.search(r"data link: ranger-sim daq --port /dev/pts/\d+\n", reported)
    assert re.search(r"emulated inertial unit: /dev/pts/\d+\n", reported)
    assert "daq: no traffic" in reported  # the rate controller has only begun
    assert re.search(r"imu-offer: bytes out \d+", reported)
    assert "cannot be repeated" not in reported
    assert no_waiting and max(no_waiting) <= 0.1


def test_with_json_the_name_still_comes_on_standard_error(capsys):
    assert cli.main(["walk", "--time", "0.05s", "--daq-port", "pty", "--json", "-"]) == 0
    reported = capsys.readouterr()
    assert json.loads(reported.out)["fell"] is False
    assert reported.err.startswith("data link: ranger-sim daq --port /dev/pts/")


def test_the_walk_is_the_same_with_a_listener_as_without(capsys):
    digests = []
    for options in ([], ["--daq-port", "pty"], ["--imu-offer", "pty"]):
        assert cli.main(["walk", "--time", "0.5s", "--json", "-", *options]) == 0
        digests.append(json.loads(capsys.readouterr().out)["trace_digest"])
    assert len(set(digests)) == 1
