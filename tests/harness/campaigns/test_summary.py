"""What results add up to: shares get an interval only when their sample is whole, and a replay is the same run."""

import shlex

import pytest

from ranger_sim.harness.campaigns import engine, plan, summary
from ranger_sim.harness.campaigns.statistics import clopper_pearson
from ranger_sim.ranger.walks import REFERENCE

GAIT = {"steps": 9, "step_length_m": 0.4, "step_time_s": 0.6, "motor_power_W": 9.0}


@pytest.fixture
def campaign_of(tmp_path):
    """A campaign of a plan, whose first runs have these outcomes."""
    made = []

    def campaign(outcomes, activated_s=2.0, detection_ms=None, **data):
        campaign = engine.Campaign(plan.of_data(data, "test.toml", REFERENCE), tmp_path)
        made.append(campaign)
        for case, outcome in zip(campaign.plan.cases(), outcomes, strict=False):
            result = {
                "key": campaign.key(case),
                "outcome": outcome,
                "why": "",
                "fall_ms": 900.0 if outcome == "fall" else None,
                "detected": [{"board": "MCH", "code": "AE_SPIKE", "rate": False, "ms": each}]
                if (each := detection_ms) is not None
                else [],
                "gait": GAIT,
                "fault": {"activated_s": activated_s, "acted": True},
            }
            campaign.store.add(result)
        campaign.take_known()
        return campaign

    yield campaign
    for each in made:
        each.close()


SAMPLE = {"vary": {"seed": {"low": 1, "high": 10**6, "step": 1}}, "sample": {"runs": 8}}


def test_a_whole_sample_has_intervals_and_a_part_of_one_has_none(campaign_of):
    whole = summary.of(campaign_of(["fall"] * 3 + ["masked"] * 5, **SAMPLE))
    expected = clopper_pearson(3, 8)
    assert whole["finished"] and whole["outcomes"]["fall"] == summary.as_dict(expected)
    assert "clopper-pearson intervals of 95 %" in whole["interval"]


def test_a_part_of_a_sample_has_none(campaign_of):
    part = summary.of(campaign_of(["fall"] * 3 + ["masked"] * 4, **SAMPLE))
    assert not part["finished"]
    assert part["outcomes"]["fall"] == {"count": 3, "of": 7, "share": 3 / 7, "low": None, "high": None}
    assert "of the runs that are there and of nothing else" in part["interval"]


TOLERANCE = {"tolerance": {"detection": {"within": "100 ms", "share": 0.5, "confidence": 0.95}}}


@pytest.mark.parametrize(
    ("ms", "verdict"),
    [(90.0, "met"), (110.0, "not met")],  # of 8: 0.5^8 is below 0.05 either way
)
def test_a_samples_tolerance_is_met_or_missed_only_as_its_size_allows(campaign_of, ms, verdict):
    reported = summary.of(campaign_of(["masked"] * 8, detection_ms=ms, **SAMPLE, **TOLERANCE))
    assert [each["verdict"] for each in reported["tolerances"]] == [verdict]


def test_a_tolerance_is_open_when_neither_it_nor_its_contrary_is_shown(campaign_of):
    strict = {"tolerance": {"detection": {"within": "100 ms", "share": 0.6, "confidence": 0.95}}}
    campaign = campaign_of(["masked"] * 8, detection_ms=90.0, **SAMPLE, **strict)
    # one of eight is never told of; the largest would be the limit, as 1 - 0.6^8 = 0.98, and 7 of 8 are not few
    for number, result in enumerate(campaign.store.results.values()):
        result["detected"] = [] if number == 0 else result["detected"]
    (reported,) = summary.of(campaign)["tolerances"]
    assert (reported["within"], reported["of"]) == (7, 8) and reported["verdict"].startswith("open: this many runs")


def test_a_replay_has_every_digit_of_the_run_and_ends_when_it_did(campaign_of):
    walk = {"slope": "0.123456789 deg", "floor_roughness": "1.23456789 mm"}
    data = {"walk": walk, "watch": {"after": "3 s"}, "vary": {"fault": ["world.robot:push,force=20"]}}
    (row,) = summary.of(campaign_of(["fall"], activated_s=0.0, **data))["rows"]
    words = shlex.split(row["replay"])
    options = dict(zip(words[2::2], words[3::2], strict=True))
    (case,) = plan.of_data(data, "test.toml", REFERENCE).cases()
    assert float(options["--slope"]) == case.settings.walk["slope_rad"]
    assert float(options["--floor-roughness"]) == case.settings.walk["floor_roughness_m"]
    assert options["--time"] == "3.000s" and options["--fault"] == "world.robot:push,force=20"
