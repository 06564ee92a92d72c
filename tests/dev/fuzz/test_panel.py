"""The fuzzer of the panel's endpoints: a sample passes, and the faults that it looks for are found."""

import pytest

from dev.fuzz import Finding, panel
from ranger_sim.tools.panel import connections, messages, server

# Starlette leaves a file that it was sending to the collector when its server is broken off, as these tests do.
pytestmark = pytest.mark.filterwarnings("ignore:.*<_io.FileIO:pytest.PytestUnraisableExceptionWarning")


@pytest.fixture(scope="module")
def source():
    return panel.walked()


def run(cases, seed, source):
    return panel.asyncio.run(panel._run(cases, seed, source))


def test_hostile_pages_stop_nothing(source):
    counted = run(500, 4, source)
    assert counted["cases"] == 500 and counted["well_behaved_answered"] == 26 and counted["pages_loaded"] == 1
    # how many exactly depends on when the kernel brings what was said
    assert counted["refused_a_wrong_token"] and counted["closed_with_a_reason"] > 2 and counted["messages"] > 50


def test_a_request_that_ends_in_an_exception_is_found(source, monkeypatch):
    async def request(self, wish):
        raise TypeError("unhashable")

    monkeypatch.setattr(panel.Looked, "request", request)
    with pytest.raises(Finding, match="the server met .*unhashable"):
        run(500, 4, source)


def test_a_number_that_does_not_exist_in_a_message_to_a_page_is_found(source, monkeypatch):
    monkeypatch.setattr(panel.Looked, "values", lambda self, wanted, at: [float("nan")] * len(wanted))
    monkeypatch.setattr(messages.json, "dumps", lambda content, **_: repr(content).replace("nan", "NaN"))
    with pytest.raises(Finding, match="does not understand"):
        run(500, 4, source)


def test_more_pages_than_places_are_found(source, monkeypatch):
    monkeypatch.setattr(server, "PLACES", 40)
    monkeypatch.setattr(panel, "PLACES", 8)  # few enough that every order of arrivals comes beyond it
    with pytest.raises(Finding, match=r"(9|1\d) pages, "):
        run(4000, 4, source)


def test_connections_without_a_bound_are_found(source, monkeypatch):
    monkeypatch.setattr(connections, "MOST", 1000)
    monkeypatch.setattr(panel, "MOST", 20)
    with pytest.raises(Finding, match=r"2\d connections"):
        run(4000, 4, source)


def test_a_panel_that_does_not_answer_is_found(source, monkeypatch):
    async def silent(self, text):
        return ""

    monkeypatch.setattr(panel, "TURNS_TO_ANSWER", 50)
    monkeypatch.setattr(server.Session, "on_text", silent)
    with pytest.raises(Finding, match="a well-behaved page is not answered"):
        run(100, 4, source)
