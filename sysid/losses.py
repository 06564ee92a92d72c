"""The limit of what may be lost of a channel before anything is concluded from it."""

import math
from collections.abc import Collection, Iterable

from ranger_sim.foundation.user_error import DataError
from ranger_sim.sysid.dataset import LOSSES, UNMEASURED, Dataset, Loss

ACCEPTED = 0.01  # of a channel's samples; radio links lose less (docs/robot.md, C6.2)


def stop_if_too_many(
    dataset: Dataset, names: Iterable[str], accepted: float = ACCEPTED, outputs: Collection[str] = ()
) -> None:
    """UserError for the first of these channels that lost more than the accepted share (0 to 1) of its samples.

    outputs: channels that a simulator runs through; samples that are cut off or not a number are not counted there.
    """
    lost = sum(loss.count for loss in dataset.losses if loss.reason in LOSSES)
    if lost > accepted * dataset.rows:
        _refuse(dataset, "", lost, dataset.rows, dataset.losses, accepted)
    for name in names:
        if name not in dataset:
            raise DataError(f"{dataset.name}: {name}: too few sound samples are left; nothing is concluded without it")
        channel = dataset[name]
        unmeasured = UNMEASURED if name in outputs else ()
        lost = sum(loss.count for loss in channel.losses if loss.reason in LOSSES and loss.reason not in unmeasured)
        if lost > accepted * (len(channel.value) + lost):
            _refuse(dataset, name, lost, lost + len(channel.value), channel.losses, accepted)


def _refuse(dataset: Dataset, name: str, lost: int, read: int, losses: Iterable[Loss], accepted: float) -> None:
    what = "lines" if any(loss.reason == "ragged" for loss in losses) else "frames"
    reasons = "; ".join(loss.text for loss in losses if loss.reason in LOSSES)
    share = 100.0 * lost / read
    place = f"{dataset.name}: {name}: {lost} of {read} samples" if name else f"{dataset.name}: {lost} of {read} {what}"
    raise DataError(
        f"{place} are lost, {share:.3g} % where {100.0 * accepted:.3g} % are accepted: {reasons}; nothing is concluded "
        f"from the rest (--accept-loss {min(math.ceil(share), 100)}% does)"
    )
