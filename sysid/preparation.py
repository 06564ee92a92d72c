"""Recordings made ready for a diagnosis: named, inspected, mended, on one time base."""

import dataclasses
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from ranger_sim.foundation.user_error import DataError
from ranger_sim.sysid import losses, repairs, sanity
from ranger_sim.sysid.channels import named_by, named_for
from ranger_sim.sysid.dataset import Dataset, Finding, Repair, Table
from ranger_sim.sysid.machine import Machine, inputs_of, simulated_outputs
from ranger_sim.sysid.machines import is_ours

LEAST_ROWS = 50  # below, filters are longer than the data; useful data have some hundreds


@dataclasses.dataclass(frozen=True)
class Prepared:
    """A prepared recording: its table, its anomalies, its repairs, and the fate of its samples."""

    table: Table
    findings: list[Finding]
    repairs: list[Repair]
    ledger: Mapping[str, Any]


def parted(data: Sequence[Prepared], part: float) -> tuple[list[Prepared], list[Prepared]]:
    """The first and the last part of each recording by time, the last above 0 and below 1 of it. Findings, repairs and
    ledger belong to the first."""
    first: list[Prepared] = []
    last: list[Prepared] = []
    for each in data:
        table = each.table
        begin, end = float(table.time_s[0]), float(table.time_s[-1])
        row = int(np.searchsorted(table.time_s, end - part * (end - begin)))
        first.append(dataclasses.replace(each, table=table.part(slice(0, row))))
        rest = table.part(slice(row, None))
        rest.name = f"{table.name} from {table.time_s[row]:.1f} s on"
        last.append(Prepared(rest, [], [], {}))
    return first, last


def _motions(machine: Machine) -> list[tuple[str, str]]:
    """(angle, rate) of a balance's joint, which show one motion; none where it names only one of them."""
    names = getattr(machine, "angle", ""), getattr(machine, "rate", "")
    return [names] if all(names) else []


def prepared(
    dataset: Dataset, machine: Machine, accepted: float = losses.ACCEPTED, asked: Collection[str] = ()
) -> Prepared:
    """A recording mended, its channels on one time base.

    accepted: share of a channel's samples that may be lost. asked: inputs of the machine that are repaired all the
    same. UserError for data that are not what they say, or of which too much is lost.
    """
    ours = is_ours(machine)
    dataset = named_for(dataset, machine.name) if ours else named_by(dataset, machine.quantities)
    missing = [each.name for each in machine.quantities if each.needed and each.name not in dataset]
    names = [each.name for each in machine.quantities if each.name in dataset]
    if missing or not names:
        wanted = ", ".join(missing) or "one of its channels"
        there = ", ".join(dataset.channels) or "none"
        raise DataError(
            f"{dataset.name}: {machine.name} needs {wanted}; there are {there} (--map NAME=CHANNEL names it)"
        )
    for name in asked:
        if name not in names:
            raise DataError(f"--repair {name}: unknown channel of {dataset.name} (available: {', '.join(names)})")
    dataset.channels = {name: dataset.channels[name] for name in names}
    dataset.findings = [each for each in dataset.findings if each.channel in ("", *names)]
    dataset.repairs = [each for each in dataset.repairs if each.channel in ("", *names)]
    findings = sanity.inspect(dataset, _motions(machine))
    sanity.stop_if_fatal(dataset.name, findings)
    inputs = inputs_of(machine) - set(asked)
    sanity.stop_if_input_is_clipped(dataset.name, findings, inputs)
    mended = repairs.mend(dataset, findings, inputs)
    outputs = simulated_outputs(machine) - inputs
    losses.stop_if_too_many(mended, names, accepted, outputs)
    needed = [each.name for each in machine.quantities if each.needed]
    for doubt in sanity.doubts(findings):
        if doubt.kind == "noise" and doubt.channel not in needed:
            continue  # a channel at rest; what it is needed for says more
        if doubt.kind == "slow_samples" and not ours:
            continue  # a user's own machine may be a tank
        place = f"{doubt.channel}: " if doubt.channel else ""
        raise DataError(f"{dataset.name}: {place}{doubt.text}; nothing is concluded from such data")
    if ours:  # a user's own machine may have a setting for a channel
        for each in machine.quantities:
            if each.needed and np.ptp(mended[each.name].value) == 0.0:
                raise DataError(f"{dataset.name}: {each.name}: one value all the time; nothing is concluded from that")
    own = getattr(machine, "table", None)  # of a machine whose channels come at rates of their own
    table = own(mended, names) if own is not None else mended.table(names, outputs=outputs)
    if len(table) < LEAST_ROWS:
        raise DataError(f"{dataset.name}: {len(table)} rows with all channels, at least {LEAST_ROWS} are needed")
    return Prepared(table, mended.findings, mended.repairs, mended.ledger())
