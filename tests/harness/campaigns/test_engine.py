"""What of a plan is run, and what is there already; the pool here answers by itself."""

import json

import pytest

from ranger_sim.harness.campaigns import engine, plan
from ranger_sim.ranger.walks import REFERENCE

DATA = {"vary": {"seed": [1, 2, 3]}}


class Answering:
    """Answers every request; `outcomes`: by seed. `asked`: the seeds that were asked for."""

    jobs = 2

    def __init__(self, outcomes):
        self.outcomes = outcomes
        self.asked = []

    def release(self):
        """It has no processes."""

    def run(self, requests):
        for request in requests:
            if "seeds" in request:
                yield {"key": request["key"], "healthy": {}}
                continue
            for case in request["cases"]:
                seed = case["settings"]["walk"]["seed"]
                self.asked.append(seed)
                outcome = self.outcomes.get(seed, "masked")
                yield {"key": case["key"], "outcome": outcome, "limit_s": request["watch"]["limit_s"]}


@pytest.fixture
def run(tmp_path):
    def run(outcomes=None, **data):
        campaign = engine.Campaign(plan.of_data({**DATA, **data}, "test.toml", REFERENCE), tmp_path)
        pool = Answering(outcomes or {})
        campaign.run(pool, lambda done, what: None)
        campaign.close()
        return [campaign.result(case)["outcome"] for case in campaign.cases], sorted(pool.asked)

    return run


def test_what_is_there_is_not_run_again(run):
    assert run() == (["masked"] * 3, [1, 2, 3])
    assert run() == (["masked"] * 3, [])
    assert run(vary={"seed": [3, 4]}) == (["masked"] * 2, [4])


def test_a_run_that_timed_out_is_run_again_when_its_limit_is_raised_and_not_before(run, tmp_path):
    slow = {2: "timed out"}
    assert run(slow, watch={"limit": "5 s"}) == (["masked", "timed out", "masked"], [1, 2, 3])
    assert run(watch={"limit": "5 s"}) == (["masked", "timed out", "masked"], [])
    assert run(slow, watch={"limit": "6 s"}) == (["masked", "timed out", "masked"], [2])
    assert run(watch={"limit": "7 s"}) == (["masked"] * 3, [2])
    assert run(watch={"limit": "8 s"}) == (["masked"] * 3, [])
    lines = [json.loads(line) for line in (tmp_path / "results.jsonl").read_text().splitlines()]
    assert [line["outcome"] for line in lines if "outcome" in line].count("timed out") == 2
