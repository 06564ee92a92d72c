"""What `check-bus` makes of what the kernel says: known outputs of `ip -details -statistics -json link show`."""

import json
import subprocess

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ranger_sim.can_bus.edge import check_bus
from ranger_sim.can_bus.edge.check_bus import Finding, NotReadError, Traffic, check_link, check_traffic

RATE = 1_000_000


def controller(**changes):
    """What `ip` says of a Kvaser adapter at 1 Mbit/s that is up (shortened, from a virtual machine)."""
    link = {
        "ifindex": 6,
        "ifname": "can0",
        "flags": ["NOARP", "UP", "LOWER_UP", "ECHO"],
        "mtu": 16,
        "qdisc": "pfifo_fast",
        "operstate": "DOWN",
        "txqlen": 1000,
        "link_type": "can",
        "linkinfo": {
            "info_kind": "can",
            "info_data": {
                "state": "ERROR-ACTIVE",
                "berr_counter": {"tx": 0, "rx": 0},
                "restart_ms": 0,
                "bittiming": {"bitrate": 1_000_000, "sample_point": "0.750", "tq": 125},
                "clock": 8_000_000,
            },
            "info_xstats": {"restarts": 0, "bus_error": 0, "arbitration_lost": 0, "error_warning": 0, "bus_off": 0},
        },
        "stats64": {"rx": {"packets": 0}, "tx": {"packets": 0}},
    }
    data = link["linkinfo"]["info_data"]
    for key, value in changes.items():
        (data if key in ("state", "berr_counter", "bittiming") else link)[key] = value
    return link


def virtual(**changes):
    """A vcan interface: neither bit timing nor state."""
    link = {"ifname": "vcan0", "flags": ["NOARP", "UP", "LOWER_UP"], "txqlen": 1000, "link_type": "can"}
    return {**link, "linkinfo": {"info_kind": "vcan"}, **changes}


def check(link, device="can0", rate=RATE):
    return check_link(device, rate, lambda _: link)


def failures(findings):
    return {finding.what: finding for finding in findings if finding.ok is False}


def test_an_adapter_that_is_right_has_no_failure():
    found = check(controller())
    assert failures(found) == {}
    assert [finding.what for finding in found] == ["there", "bit rate", "up", "state", "errors"]
    assert all(finding.ok for finding in found) and not any(finding.mend for finding in found)


def test_a_virtual_interface_needs_no_bit_rate():
    found = check(virtual(), "vcan0")
    assert failures(found) == {} and {finding.what for finding in found} == {"there", "bit rate", "up"}


def test_up_is_read_from_the_flags_and_not_from_operstate():
    assert failures(check(controller(operstate="DOWN"))) == {}
    assert failures(check(virtual(operstate="UNKNOWN"), "vcan0")) == {}


def test_a_wrong_bit_rate_is_reported_with_both_rates_and_mended_with_the_interface_down():
    (found,) = failures(check(controller(bittiming={"bitrate": 500_000}))).values()
    assert found.what == "bit rate" and "500000" in found.text and "1000000" in found.text
    assert found.mend == ("ip link set can0 down && ip link set can0 type can bitrate 1000000 && ip link set can0 up")


def test_an_adapter_never_set_up_needs_a_bit_rate_first():
    link = controller(flags=["NOARP", "ECHO"], state="STOPPED")
    del link["linkinfo"]["info_data"]["bittiming"]
    found = failures(check(link))
    assert set(found) == {"bit rate", "up"}
    assert found["bit rate"].mend == "ip link set can0 type can bitrate 1000000 && ip link set can0 up"


def test_an_interface_that_is_down_is_mended_by_one_command():
    (found,) = failures(check(virtual(flags=["NOARP"]), "vcan0")).values()
    assert (found.what, found.mend) == ("up", "ip link set vcan0 up")


@pytest.mark.parametrize(
    ("state", "counters", "what", "mend"),
    [
        ("BUS-OFF", {"tx": 248, "rx": 0}, {"state", "errors"}, "ip link set can0 type can restart"),
        ("ERROR-PASSIVE", {"tx": 128, "rx": 0}, {"state", "errors"}, "ip link set can0 down && ip link set can0 up"),
        ("ERROR-WARNING", {"tx": 0, "rx": 96}, {"state", "errors"}, "ip link set can0 down && ip link set can0 up"),
        ("ERROR-ACTIVE", {"tx": 0, "rx": 100}, {"errors"}, "ip -details -statistics link show can0"),
    ],
)
def test_error_states_and_counters_are_failures(state, counters, what, mend):
    found = failures(check(controller(state=state, berr_counter=counters)))
    assert set(found) == what
    assert mend in {finding.mend for finding in found.values()}


def test_errors_since_the_start_are_reported():
    link = controller()
    link["linkinfo"]["info_xstats"].update(bus_off=2, bus_error=17)
    errors = next(finding for finding in check(link) if finding.what == "errors")
    assert errors.ok and "bus error 17, bus off 2" in errors.text


def test_a_short_queue_is_reported_but_not_a_failure():
    (found,) = [finding for finding in check(controller(txqlen=10)) if finding.what == "queue"]
    assert found.ok is None and found.mend == "ip link set can0 txqueuelen 1000"


@pytest.mark.parametrize(
    ("device", "mend"),
    [("vcan3", "ip link add dev vcan3 type vcan && ip link set vcan3 up"), ("can7", "ip link show type can")],
)
def test_an_interface_that_is_not_there_is_named(device, mend):
    def nothing(_):
        raise NotReadError(check_bus.NO_DEVICE)

    (found,) = check_link(device, RATE, nothing)
    assert not found.ok and device in found.text and found.mend == mend


def test_an_interface_that_is_not_can_is_refused():
    (found,) = check({"ifname": "eth0", "flags": ["UP"], "link_type": "ether"}, "eth0")
    assert not found.ok and "'ether'" in found.text


def test_the_output_of_ip_is_read_and_its_refusal_reported(monkeypatch):
    def answer(stdout="", stderr="", code=0):
        def run(call, **_):
            assert call[:5] == ["ip", "-details", "-statistics", "-json", "link"] and call[-1] == "can0"
            return subprocess.CompletedProcess(call, code, stdout, stderr)

        monkeypatch.setattr(check_bus.subprocess, "run", run)

    answer(json.dumps([{}, controller()]))
    assert check_bus.read_link("can0")["txqlen"] == 1000
    answer(stderr='Device "can0" does not exist.\n', code=1)
    with pytest.raises(NotReadError, match=check_bus.NO_DEVICE):
        check_bus.read_link("can0")
    answer(stderr="RTNETLINK answers: Operation not permitted\n", code=2)
    with pytest.raises(NotReadError, match="not permitted"):
        check_bus.read_link("can0")
    answer("6: can0: <NOARP,UP>")
    with pytest.raises(NotReadError, match="no JSON"):
        check_bus.read_link("can0")


def test_without_ip_the_values_of_sys_are_used(tmp_path, monkeypatch):
    def missing(*_, **__):
        raise FileNotFoundError("ip")

    monkeypatch.setattr(check_bus.subprocess, "run", missing)
    for name, flags in (("can0", "0x400c1"), ("can1", "0x40080")):
        (tmp_path / name).mkdir()
        for file, text in (("flags", flags), ("type", "280"), ("tx_queue_len", "1000")):
            (tmp_path / name / file).write_text(text + "\n", encoding="ascii")
    found = check_link("can0", RATE, lambda device: check_bus.read_link(device, tmp_path))
    assert failures(found) == {} and "iproute2" in next(one for one in found if one.what == "bit rate").text
    assert set(failures(check_link("can1", RATE, lambda device: check_bus.read_link(device, tmp_path)))) == {"up"}
    for device in ("can2", "../can0"):
        with pytest.raises(NotReadError, match=check_bus.NO_DEVICE):
            check_bus.read_link(device, tmp_path)


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.text(max_size=5),
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    )
)
def test_any_json_of_ip_is_read_or_refused(content):
    with pytest.raises(NotReadError):
        check_bus.parse_link(json.dumps(content), "can0")


# ---- traffic

KNOWN = {0: "TIMESTAMP", 14: "MCH_ANGLE", 18: "MCH_COMMAND_CURRENT"}


def test_traffic_that_belongs_here_is_listed_with_its_rate():
    (found,) = check_traffic("can0", Traffic(2.0, 1000, 0, {0: 500, 14: 500}), KNOWN, {14: "MCH_ANGLE"})
    assert found.ok and "500/s" in found.text and "TIMESTAMP, MCH_ANGLE" in found.text


def test_an_external_board_that_sends_nothing_is_a_failure():
    (found,) = check_traffic("can0", Traffic(1.0, 1000, 0, {0: 1000}), KNOWN, {14: "MCH_ANGLE"})
    assert not found.ok and "MCH" in found.text and found.mend == "candump -e can0"


def test_silence_is_not_a_failure_where_no_board_is_expected():
    assert check_traffic("can0", Traffic(1.0, 0, 0, {}), KNOWN, {}) == [
        Finding("traffic", None, "0 frames in 1 s (0/s)")
    ]


def test_foreign_identifiers_and_error_frames_are_failures():
    found = failures(check_traffic("can0", Traffic(1.0, 3, 2, {0: 1, 77: 1, 1000: 1}), KNOWN, {}))
    assert "77, 1000" in found["identifiers"].text and "2 while" in found["error frames"].text


def test_listening_counts_what_a_python_can_bus_receives():
    import can

    place = {"interface": "virtual", "channel": "check-bus-test"}
    with can.Bus(**place) as sender:
        received = []
        bus_class = can.Bus

        def opened(**arguments):
            bus = bus_class(**arguments)
            sender.send(can.Message(arbitration_id=14, is_extended_id=False, data=bytes(8)))
            sender.send(can.Message(is_error_frame=True))
            received.append(bus)
            return bus

        patch = pytest.MonkeyPatch()
        with patch.context() as patched:
            patched.setattr(check_bus.can, "Bus", opened)
            traffic = check_bus.observe(place, 0.05)
    assert (traffic.frames, traffic.error_frames, traffic.identifiers) == (1, 1, {14: 1})


def test_an_interface_that_cannot_be_opened_is_reported_in_one_line():
    with pytest.raises(NotReadError) as caught:
        check_bus.observe({"interface": "no_such_interface", "channel": "x"}, 0.01)
    assert "no_such_interface" in str(caught.value) and "\n" not in str(caught.value)
