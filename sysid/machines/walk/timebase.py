"""Channels of different rates on one even time base, with flags for the measured samples.

A run's log writes a value when it changes, the robot's boards send currents every 22 to 68 ms, a radio link is silent
for a while: between two samples a value is held, or moves in a straight line, or is unknown. A table has, next to each
slow channel, a column "NAME fresh", 1.0 at a sample and 0.0 elsewhere.
"""

import numpy as np

from ranger_sim.foundation.user_error import ModelError
from ranger_sim.sysid.dataset import Array, Channel, Dataset, Table

FINEST_STEP_S, COARSEST_STEP_S = 0.002, 0.008
SLOW_STEPS = 3.0  # of the time base: a channel with more between its samples is slow
LOSS_STEPS = 5.0  # of the channel's own: longer silences are losses, unless the value did not change
LOSS_S = 0.025  # shorter silences are bridged: half of the shortest radio gap of the robot's logs (robot.md C6.1)
STANDS_STILL = 2.5  # of the channel's finest step: largest change over a silence in which nothing happened
FRESH = " fresh"
STATES = ("outer_contact", "inner_contact", "walk_state")  # numbers of states hold until the next


def even_table(dataset: Dataset, names: list[str], carrying: tuple[str, ...]) -> Table:
    """`names` on even stamps. carrying: indispensable channels, whose losses cut the table."""
    carriers = [dataset[name] for name in carrying if name in names]
    if not carriers:
        carriers = [dataset[name] for name in names if name not in STATES] or [dataset[name] for name in names]
    steps = [_usual_step(channel) for channel in carriers]
    step_s = min(max(min(steps), FINEST_STEP_S), COARSEST_STEP_S)
    start = max(float(channel.time_s[0]) for channel in carriers)
    stop = min(float(channel.time_s[-1]) for channel in carriers)
    if stop - start < 20.0 * step_s:
        raise ModelError(f"{dataset.name}: {', '.join(each.name for each in carriers)} have no time in common")
    count = int((stop - start) / step_s + 1e-9) + 1
    time_s = np.asarray(start + step_s * np.arange(count), dtype=np.float64)
    columns: dict[str, Array] = {}
    lost = np.zeros(len(time_s), dtype=bool)
    for name in names:
        channel = dataset[name]
        if name in STATES:
            place = np.searchsorted(channel.time_s, time_s + 1e-9, side="right") - 1
            columns[name] = channel.value[np.clip(place, 0, None)]
            continue
        stamps, values = _with_holds(channel)
        columns[name] = np.interp(time_s, stamps, values)
        if channel in carriers:
            lost |= _lost(channel, time_s)
        if _usual_step(channel) > SLOW_STEPS * step_s:
            columns[name + FRESH] = _fresh(channel.time_s, time_s, step_s)
    kept = np.flatnonzero(~lost)
    if len(kept) < 20:
        raise ModelError(f"{dataset.name}: hardly any time in which all of {', '.join(c.name for c in carriers)} came")
    begins = np.flatnonzero(np.diff(kept, prepend=-2) != 1)
    runs = tuple(slice(int(a), int(b)) for a, b in zip(begins, [*begins[1:], len(kept)], strict=True))
    return Table(time_s[kept], {name: column[kept] for name, column in columns.items()}, runs, dataset.name)


def freshness(table: Table, name: str) -> np.ndarray:
    """(n,) True where this channel was measured: by its flags, or by the traces of held values and straight lines."""
    if name + FRESH in table:
        return table[name + FRESH] > 0.5
    value = table[name]
    change = np.diff(value, prepend=value[0])
    fresh = np.ones(len(value), dtype=bool)
    if np.count_nonzero(change) > 20:
        bend = np.abs(np.diff(change, append=change[-1]))
        if np.mean(change == 0.0) > 0.6:
            fresh = change != 0.0
        elif np.mean(bend < 1e-6 * np.max(np.abs(change))) > 0.6:
            fresh = bend >= 1e-6 * np.max(np.abs(change))
    return fresh


def _usual_step(channel: Channel) -> float:
    steps = np.diff(channel.time_s)
    return float(np.median(steps)) if len(steps) else np.inf


def _with_holds(channel: Channel) -> tuple[Array, Array]:
    """Stamps and values with the held value repeated before the sample that ends a silence."""
    step_s = _usual_step(channel)
    ends = np.flatnonzero(np.diff(channel.time_s) > 2.5 * step_s) + 1
    stamps = np.concatenate((channel.time_s, channel.time_s[ends] - step_s))
    values = np.concatenate((channel.value, channel.value[ends - 1]))
    order = np.argsort(stamps, kind="stable")
    return stamps[order], values[order]


def _lost(channel: Channel, time_s: Array) -> np.ndarray:
    """(n,) True in silences over which the channel moved."""
    steps, changes = np.diff(channel.time_s), np.abs(np.diff(channel.value))
    moved = changes[changes > 0.0]
    finest = float(np.quantile(moved, 0.05)) if len(moved) else 0.0
    silent = (steps > max(LOSS_STEPS * float(np.median(steps)), LOSS_S)) & (changes > STANDS_STILL * finest)
    out = np.zeros(len(time_s), dtype=bool)
    for number in np.flatnonzero(silent):
        out |= (time_s > channel.time_s[number]) & (time_s < channel.time_s[number + 1])
    return out


def _fresh(stamps: Array, time_s: Array, step_s: float) -> Array:
    """1.0 at the even stamp nearest to a sample."""
    out = np.zeros(len(time_s))
    place = np.rint((stamps - time_s[0]) / step_s).astype(int)
    out[place[(place >= 0) & (place < len(time_s))]] = 1.0
    return out
