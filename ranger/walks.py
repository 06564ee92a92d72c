"""Ranger's walks as the subject of a campaign's runs."""

import dataclasses
from typing import Any

from ranger_sim.harness.campaigns.outcomes import CRITERIA, Band, against_fallen, classify, deviation
from ranger_sim.harness.faults.evidence import Record
from ranger_sim.harness.faults.proof import Proof, damage, gait
from ranger_sim.ranger.conditions import condition
from ranger_sim.ranger.faults.catalogue import CATALOGUE


class Walks:
    """The counterpart of a user's machine in subjects.py."""

    criteria = CRITERIA
    catalogue = CATALOGUE
    starts_s = (4.0, 5.0, 6.0, 7.0)

    @staticmethod
    def condition(wanted: str) -> Any:
        """A condition of the robot."""
        return condition(wanted)

    @staticmethod
    def version() -> str:
        """Empty: it is all in our own sources."""
        return ""

    @staticmethod
    def judge(
        proof: Proof, golden: Record, record: Record, since_ns: int, band: Band, is_sweep: bool
    ) -> dict[str, Any]:
        """Outcome, why, the gait and the golden one's, and the distance between them."""
        here = gait(record, since_ns)
        there = gait(golden, since_ns, record.end_ns)
        outcome, why = classify(proof, here, there, damage(record, since_ns), band)
        if outcome != "invalid":
            fell_ms = None if golden.fell_ns < 0 else (golden.fell_ns - since_ns) * 1e-6
            outcome, why = against_fallen(outcome, why, fell_ms, golden.fall_cause, is_sweep)
        return {
            "outcome": outcome,
            "why": why,
            "gait": dataclasses.asdict(here),
            "golden_gait": dataclasses.asdict(there),
            "deviation": deviation(here, there, band),
        }


WALKS = Walks()
