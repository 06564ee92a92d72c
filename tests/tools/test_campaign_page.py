"""What a campaign's page says of a run."""

from ranger_sim.tools.campaign.page import why_text


def test_a_fall_is_reported_with_its_time_and_not_mixed_up_with_another_outcomes_reason():
    assert why_text({"outcome": "fall", "why": "fell forward", "fall_ms": 722.4}) == "fell forward after 722 ms"
    damaged = {"outcome": "damage", "why": "hip motor beyond 6 A for 14 ms", "fall_ms": 1990.0}
    assert why_text(damaged) == "hip motor beyond 6 A for 14 ms; fell after 1990 ms"
    assert why_text({"outcome": "undetected wrong", "why": "step time +20 %", "fall_ms": None}) == "step time +20 %"
