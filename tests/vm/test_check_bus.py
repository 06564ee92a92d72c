"""`ranger-sim check-bus` against the kernel's own answers."""

import json
import subprocess

import pytest

from ranger_sim.tools import cli

from .test_adapters import BIT_RATE, ip_link, set_up

pytestmark = pytest.mark.adapters
PROFILE = """
title = "two adapters and a virtual bus"
[buses.can1]
interface = "socketcan"
channel = "can0"
bit_rate = 1_000_000
schedule = "1mbit"
[buses.can2]
interface = "socketcan"
channel = "can1"
bit_rate = 1_000_000
schedule = "1mbit"
[buses.can3]
interface = "socketcan"
channel = "vcan2"
bit_rate = 1_000_000
schedule = "1mbit"
"""


@pytest.fixture
def check_bus(tmp_path, capsys):
    """check_bus(profile) -> (exit code, {bus: {what: finding}})."""

    def run(profile=PROFILE):
        path = tmp_path / "profile.toml"
        path.write_text(profile)
        code = cli.main(["check-bus", str(path), "--listen", "0.2s", "--json", "-"])
        buses = json.loads(capsys.readouterr().out)["buses"]
        return code, {bus["bus"]: {each["what"]: each for each in bus["findings"]} for bus in buses}

    return run


def test_a_wrong_bit_rate_is_reported_and_the_command_next_to_it_mends_it(check_bus, figure):
    set_up("can0")
    set_up("can1", BIT_RATE // 2)
    code, found = check_bus()
    assert code == 1
    assert {finding["ok"] for bus in ("can1", "can3") for finding in found[bus].values()} <= {True, None}
    assert [what for what, finding in found["can2"].items() if finding["ok"] is False] == ["bit rate"]
    wrong = found["can2"]["bit rate"]
    assert "500000" in wrong["text"] and "1000000" in wrong["text"]
    assert "ip link set can1 type can bitrate 1000000" in wrong["mend"]
    subprocess.run(wrong["mend"], shell=True, check=True)
    code, found = check_bus()
    assert code == 0, found
    assert found["can1"]["state"]["text"] == found["can2"]["state"]["text"] == "ERROR-ACTIVE"
    figure(f"check-bus with can1 at {BIT_RATE // 2} bit/s: {wrong['text']}; mended by {wrong['mend']}")


def test_what_is_down_or_missing_is_reported_and_the_commands_mend_it(check_bus):
    set_up("can0")
    set_up("can1")
    ip_link("can1", "down")
    profile = PROFILE.replace("vcan2", "vcan9")
    code, found = check_bus(profile)
    assert code == 1
    faults = {bus: {what: each["mend"] for what, each in found[bus].items() if each["ok"] is False} for bus in found}
    assert {bus: list(each) for bus, each in faults.items() if each} == {"can2": ["up"], "can3": ["there"]}
    for mend in (faults["can2"]["up"], faults["can3"]["there"]):
        subprocess.run(mend, shell=True, check=True)
    try:
        code, found = check_bus(profile)
        assert code == 0, found
    finally:
        subprocess.run(["ip", "link", "delete", "vcan9"], check=True)
