"""A short run of `python -m dev.fuzz interfaces`, and that its checks can fail."""

import pytest

from dev.fuzz import Finding, interfaces
from ranger_sim.ranger.requests import Request


@pytest.fixture
def fuzz():
    each = interfaces.Fuzz()
    yield each
    each.close()


def test_two_thousand_cases_reach_every_endpoint_and_stop_nothing():
    counted = interfaces.run(2000)
    assert counted["cases"] == 2000
    for name in ("answered", "admitted", "not_admitted", "frames", "attach_malformed", "socketcand_malformed"):
        assert counted[name] > 20, name
    assert all(counted[f"{kind}_requests"] > 500 for kind in interfaces.GREETINGS)


def test_an_endpoint_that_does_too_much_or_holds_too_much_is_found(fuzz):
    fuzz.poll()
    fuzz.check(fuzz.control, fuzz.control.limits.burst)
    with pytest.raises(Finding, match=r"control: \d+ requests in a poll"):
        fuzz.check(fuzz.control, 2 * fuzz.control.limits.burst)
    fuzz.attach.peers[0].outgoing += bytes(4 * fuzz.attach.limits.backlog)
    with pytest.raises(Finding, match="attach: a peer's answers pile up"):
        fuzz.check(fuzz.attach, 0)


def test_a_request_that_must_not_be_admitted_is_found(fuzz, monkeypatch):
    monkeypatch.setattr(fuzz.control, "admitted", lambda line: Request("set", name="P_UI_LCD_TIME", value=5.0))
    with pytest.raises(Finding, match=r"value=5\.0.* was admitted"):
        for _ in range(10):
            fuzz.poll()


def test_a_well_behaved_program_that_is_not_answered_is_found(fuzz, monkeypatch):
    monkeypatch.setattr(interfaces, "POLLS_TO_ANSWER", 5)
    monkeypatch.setattr(fuzz.tcp, "_take", lambda client: False)
    with pytest.raises(Finding, match="socketcand: a well-behaved program is not answered"):
        for _ in range(20):
            fuzz.poll()


def test_an_exception_at_an_endpoint_is_reported_with_its_case(monkeypatch):
    monkeypatch.setattr(interfaces, "admitted", lambda line: 1 // 0)
    with pytest.raises(ZeroDivisionError) as fault:
        interfaces.run(100)
    assert "python -m dev.fuzz interfaces: seed 1, case" in fault.value.__notes__[0]
