"""The fuzzer of requests to a walking robot: a sample stands, and what it looks for is found."""

import pytest

from dev.fuzz import Finding, requests
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.faults.fault import Fault
from ranger_sim.ranger.feed import FeedServer


def test_hostile_requests_and_viewers_stop_nothing():
    counted = requests.run(600, seed=4)
    assert counted["cases"] == 600 and counted["robots"] == 1
    assert counted["faults_armed"] > 20 and counted["faults_that_acted"] > 10
    assert counted["admitted"] > 100 and counted["refused"] > 200 and counted["records_shown"] > 50


def test_the_same_seed_gives_the_same_cases():
    assert requests.run(150, seed=9)["admitted"] == requests.run(150, seed=9)["admitted"]


def test_a_fault_that_ends_the_run_of_others_is_found(monkeypatch):
    arm = Fault.arm

    def proud(self, robot):
        self.gives_way = False
        arm(self, robot)

    monkeypatch.setattr(Fault, "arm", proud)
    with pytest.raises(UserError, match="one fault at a time") as found:
        requests.run(3000, seed=1)
    assert "python -m dev.fuzz requests: seed 1, case" in found.value.__notes__[0]


def test_a_feed_that_shows_a_value_that_is_not_a_number_is_found(monkeypatch):
    state = FeedServer.state
    monkeypatch.setattr(FeedServer, "state", lambda self, now: {**state(self, now), "distance_m": float("nan")})
    with pytest.raises(Finding, match="NaN in a record"):
        requests.run(1000, seed=4)


def test_a_feed_with_more_viewers_than_places_is_found(monkeypatch):
    monkeypatch.setattr(requests, "LIMITS", {**requests.LIMITS, "feed": requests.LIMITS["slcan"]})
    with pytest.raises(Finding, match="[2-9] viewers"):
        requests.run(200, seed=4)
