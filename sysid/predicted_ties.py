"""Ties that structure predicts before any data (`isolability.py`), against those that the data leave.

A prediction uses a reference motion, with the experiment's channels alone. The data confirm it when both causes
explain them equally well, and break it when one of them is behind: their motion, or their noise, separates causes that
the reference motion does not. Conversely, a tie without a prediction shows that this motion is a poor one.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import causes, inspection, isolability
from ranger_sim.sysid.experiment_models import MODELS
from ranger_sim.sysid.machine import Machine, Recording
from ranger_sim.sysid.naming import TIE, Named

CONFIRMED = "confirmed"  # these data cannot separate them either
BROKEN = "broken"  # the data prefer the named cause
IMPOSSIBLE = "broken by its value"  # the other explains as much, with a value that no machine has
NOT_TRIED = "not tried"  # the machine's equations have no such effect
NOT_PREDICTED = "not predicted"  # and the data cannot separate them


def of(machine: Machine, recordings: Sequence[Recording], named: Named) -> dict[str, Any] | None:
    """Predictions for a named cause, and the data's result; None without a prediction: for another machine, or for
    another place than that of the prediction.

    status: of the cause with these channels; ties: for each its other cause, reason and cosine of the prediction (None
    without one), the data's result, and the other's deficit in the information criterion.
    """
    if machine.name not in MODELS or not recordings:
        return None
    model = isolability.model_of(machine.name)
    channels = [name for name in recordings[0].table.columns if name in model.channels]
    analysis = isolability.analyse(machine.name, channels)
    key = key_of(named.effect.cause, named.effect.at)
    if key not in analysis.status or model.places.get(key, named.effect.at) != named.effect.at:
        return None
    behind: dict[str, float] = {}
    for effect, bic in named.rivals:
        other = key_of(effect.cause, effect.at)
        behind[other] = min(bic, behind.get(other, bic))
    tied = {key_of(each.cause, each.at) for each in named.tied} - {key}
    ties = []
    for tie in analysis.ties:
        if key not in (tie.first, tie.second):
            continue
        other = tie.second if tie.first == key else tie.first
        ties.append(
            {
                "with": other,
                "reason": tie.reason,
                "cosine": tie.cosine,
                "data": _outcome(other, tied, behind, machine, recordings),
                "behind": behind.get(other),
            }
        )
    predicted = {each["with"] for each in ties}
    ties += [
        {"with": other, "reason": None, "cosine": None, "data": NOT_PREDICTED, "behind": behind.get(other)}
        for other in sorted(tied - predicted)
    ]
    return {"status": analysis.status[key], "ties": ties}


def _outcome(
    other: str, tied: set[str], behind: Mapping[str, float], machine: Machine, recordings: Sequence[Recording]
) -> str:
    if other in tied:
        return CONFIRMED
    if other not in behind:
        there = {key_of(each.cause, each.at) for each in machine.effects(recordings)}
        return BROKEN if other in there else NOT_TRIED
    return BROKEN if behind[other] >= TIE else IMPOSSIBLE


def key_of(cause: str, at: str) -> str:
    """A cause of an effect as the catalogue names it, with its place where it has several: "sensor_offset@current"."""
    try:
        return causes.find(cause).key
    except UserError:
        for word, place in inspection.PLACES.items():
            here = word in at if not word.startswith("_") else at.endswith(word)
            if here and f"{cause}@{place}" in causes.CAUSES:
                return f"{cause}@{place}"
        return f"{cause}@{at}"


def described(predicted: Mapping[str, Any] | None) -> list[str]:
    """The same in sentences."""
    lines = []
    for each in (predicted or {}).get("ties", ()):
        if each["data"] == NOT_PREDICTED:
            lines.append(f"a tie with {each['with']} was not predicted, these data cannot decide: another motion may")
            continue
        text = f"predicted tie with {each['with']} (cosine {each['cosine']:.2f} on the reference motion): "
        if each["data"] == CONFIRMED:
            text += "confirmed, these data cannot decide either"
        elif each["data"] == NOT_TRIED:
            text += "not tried, these equations have no such effect"
        elif each["data"] == IMPOSSIBLE:
            text += "broken, it explains as much and with a value that no machine has"
        elif each["behind"] is None:
            text += "broken by the data, it is far behind"
        else:
            text += f"broken by the data, it is {each['behind']:.3g} behind in the information criterion"
        lines.append(text)
    if predicted is not None and predicted["status"] == isolability.HIDDEN:
        lines.append("it was predicted not to show by these channels: what shows may be something else")
    return lines
