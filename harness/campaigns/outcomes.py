"""The outcome of a run in one word, by written criteria; the first that holds applies."""

import dataclasses
from typing import Any

from ranger_sim.harness.faults.proof import Gait, Proof

# name: criterion, in the order in which they are checked
CRITERIA = {
    "crashed": "the simulation raised an exception, or its process died: a defect of ours, not of the robot",
    "timed out": "the run took more computing than its limit, or hung",
    "invalid": "the fault never acted, cannot act there, or the golden run does not get that far, or falls itself: it "
    "proves nothing",
    "damage": "a motor's current stayed beyond 1.2 times its peak for more than 10 ms, or its thermal state beyond "
    "1.2 times what 3.1 A (steering 0.3 A) sustain",
    "fall": "the robot fell",
    "no effect": "the fault acted, and no frame, no variable of the main brain and no error count differs",
    "masked": "the firmware differs, no error reports it, and the gait stays inside its band",
    "detected and safe": "an error, or its rate, that healthy walks do not have; the gait stays inside its band",
    "degraded": "detected; the robot walks on, its gait outside the band",
    "undetected wrong": "the robot walks on with its gait outside the band, and no error reports it",
}
OUTCOMES = tuple(CRITERIA)
# Severity, for the order of worst cases and for searches; a run that proves nothing has none.
SEVERITY = {
    "damage": 5,
    "fall": 4,
    "undetected wrong": 3,
    "degraded": 2,
    "detected and safe": 1,
    "masked": 1,
    "no effect": 0,
    "invalid": -1,
    "timed out": -1,
    "crashed": -1,
}


@dataclasses.dataclass(frozen=True)
class Band:
    """How far a gait may be from the golden run's of the same time, as shares of that.

    Defaults: three times the spread that walks of six seeds have over 4 s (length and time within 5 %, motors' power
    within 4 %, power twice that again because only more of it is harm): chosen by us.
    """

    step_length: float = 0.15
    step_time: float = 0.15
    motor_power: float = 0.30


def beyond(gait: Gait, golden: Gait, band: Band) -> str:
    """The gait's quantities outside their band, in a few words; empty when all are inside."""
    if gait.step_length_m is None or gait.step_time_s is None:
        return f"{gait.steps} steps made" if golden.step_length_m is not None else ""
    if golden.step_length_m is None or golden.step_time_s is None:
        return ""
    for name, value, reference, allowed in (
        ("step length", gait.step_length_m, golden.step_length_m, band.step_length),
        ("step time", gait.step_time_s, golden.step_time_s, band.step_time),
    ):
        if abs(value / reference - 1.0) > allowed:
            return f"{name} {100.0 * (value / reference - 1.0):+.0f} %"
    more = gait.motor_power_W / golden.motor_power_W - 1.0 if golden.motor_power_W > 0.0 else 0.0
    return f"motor power {100.0 * more:+.0f} %" if more > band.motor_power else ""


def deviation(gait: Gait, golden: Gait, band: Band) -> float:
    """The largest deviation of the gait in parts of what is allowed; 2 where no gait is left to measure."""
    if gait.step_length_m is None or gait.step_time_s is None:
        return 2.0
    if golden.step_length_m is None or golden.step_time_s is None or golden.motor_power_W <= 0.0:
        return 0.0
    return max(
        abs(gait.step_length_m / golden.step_length_m - 1.0) / band.step_length,
        abs(gait.step_time_s / golden.step_time_s - 1.0) / band.step_time,
        (gait.motor_power_W / golden.motor_power_W - 1.0) / band.motor_power,
    )


def classify(proof: Proof, gait: Gait, golden: Gait, overload: str, band: Band) -> tuple[str, str]:
    """(outcome, why) of a run that ended by itself. `overload`: the result of `proof.damage` for it."""
    if not proof.acted:
        return "invalid", "the fault never acted"
    if overload:
        return "damage", overload
    if proof.fell_ns is not None:
        return "fall", proof.fall_cause
    if proof.first_firmware is None:
        return "no effect", ""
    outside = beyond(gait, golden, band)
    if proof.detected is not None:
        detection = f"{proof.detected.code} from {proof.detected.board}"
        return ("degraded", f"{outside}; {detection}") if outside else ("detected and safe", detection)
    return ("undetected wrong", outside) if outside else ("masked", "")


def against_fallen(
    outcome: str, why: str, golden_fell_ms: float | None, golden_cause: str, is_sweep: bool
) -> tuple[str, str]:
    """(outcome, why) with a golden run that fell `golden_fell_ms` after monitoring began; None: it did not fall.

    After such a fall, nothing is attributed to the fault. A sweep's run that fell or was damaged did so by itself.
    """
    if golden_fell_ms is None or (is_sweep and outcome in ("damage", "fall")):
        return outcome, why
    return "invalid", f"the golden run fell as well, after {golden_fell_ms:.0f} ms ({golden_cause})"


def severity(result: dict[str, Any]) -> float:
    """How bad a result is: its outcome's rank, then how soon it fell, or how far its gait deviated."""
    rank = SEVERITY[result["outcome"]]
    if result.get("fall_ms") is not None:
        return rank + 1.0 / (1.0 + max(0.0, result["fall_ms"]) / 1e3)
    return rank + min(0.99, max(0.0, result.get("deviation") or 0.0) / 10.0)
