"""Changes to measured data, each explicit, each recorded in the dataset with its reason and its count.

`mend` makes the repairs with one right answer: it leaves out everything that is not a sample, sorts samples that are
out of order, corrects an overrun counter. A judgement (another unit, a lag, a zero) is requested by name, and so is any
change to an input of the machine. A value is never invented: a wrong one is left out, and is a loss in the channel's
ledger.
"""

import dataclasses
from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from ranger_sim.foundation.user_error import DataError
from ranger_sim.sysid import even_clock, order, sanity, units, wraps
from ranger_sim.sysid.dataset import CLIPPED, LOSSES, NOTHING_LOST, Channel, Dataset, Finding, Repair

EVEN_CLOCK = "--assume clock=even"
REPEATED = 0.5  # of the samples with one stamp: as many with the same values are repeated rows
FEWEST = 2  # samples that a channel must keep
KINDS = {
    "stamp_wrap": "an overrun counter of the clock counts on",
    "not_finite": "values and stamps that are not numbers are left out",
    "sorted": "samples out of order are sorted by their stamps",
    "reversed_stamps": "samples whose stamps go back and do not fit elsewhere are left out",
    "restarted_stamps": "of recordings that lie over each other one is kept",
    "duplicate_stamps": "of samples with one stamp the first is kept",
    "repeated": "a repeated sample is kept once",
    "wrap": "an overrun integer counts on",
    "bit_flip": "single wrong values are left out",
    "clipped": "values that are cut off at a limit are left out",
    "dropped": "a channel with nothing in it is left out",
    # requested by name
    "even_clock": "rounded stamps, or stamps of blocks, become those of the even clock that explains them",
    "converted": "another unit than was given",
    "shifted": "a channel's stamps moved",
    "offset": "a constant added",
    "cut": "a time left out",
}


def mend(dataset: Dataset, findings: list[Finding] | None = None, inputs: Collection[str] = ()) -> Dataset:
    """The dataset without certain errors; findings (`sanity.inspect` where not given) are included.

    inputs: channels that drive the machine. Their values stay unchanged, and a finding names the possible repair.
    A channel with fewer than FEWEST samples left is not in the result. UserError when no channel is left.
    """
    findings = sanity.inspect(dataset) if findings is None else findings
    limits: dict[str, list[float]] = {}
    for each in findings:
        if each.kind == "saturation" and each.severity != sanity.NOTE:
            limits.setdefault(each.channel, []).append(each.size)
    flips = {each.channel for each in findings if each.kind == "bit_flip"}
    channels = {}
    repairs, kept_as_is = list(dataset.repairs), []
    for channel in dataset.channels.values():
        channel = _in_order(_counted_on(channel, repairs), repairs)
        if len(channel.value) < FEWEST:
            text = f"{len(channel.value)} sound samples: left out"
            repairs.append(Repair(channel.name, "dropped", len(channel.value), text))
            continue
        wrapped = sanity.wraps_of(channel)
        flipped = sanity.spike_places(channel.value) if channel.name in flips else np.array([], dtype=np.intp)
        if channel.name in inputs:
            if wrapped.places or len(flipped):
                kept_as_is.append(_not_repaired(channel, len(wrapped.places) + len(flipped)))
        else:
            channel = _without_bits(_unwrapped(channel, wrapped, repairs), flipped, repairs)
            channel = _without_clipped(channel, limits.get(channel.name, []), repairs)
        channels[channel.name] = channel
    if not channels:
        raise DataError(f"{dataset.name}: no channel has {FEWEST} sound samples")
    findings = [*findings, *kept_as_is]
    return dataclasses.replace(dataset, channels=channels, findings=findings, repairs=repairs)


def _not_repaired(channel: Channel, count: int) -> Finding:
    ends = float(channel.time_s[0]), float(channel.time_s[-1])
    text = (
        f"it drives the machine: {count} values that look wrong stay as they are (--repair {channel.name} changes them)"
    )
    return Finding(channel.name, "not_repaired", *ends, float(count), "samples", text)


def _counted_on(channel: Channel, repairs: list[Repair]) -> Channel:
    """Stamps with an overrun counter's span added behind each overrun."""
    for place, span in wraps.of_clock(channel.time_s):
        text = f"{span:.9g} s added behind {channel.time_s[place]:.6g} s, where the counter ran over"
        step = float(channel.time_s[place + 1] - channel.time_s[place]) + span
        away = abs(step - float(np.nanmedian(np.abs(np.diff(channel.time_s)))))
        repairs.append(Repair(channel.name, "stamp_wrap", len(channel.time_s) - place - 1, text, away, "s"))
    return dataclasses.replace(channel, time_s=wraps.counted_on(channel.time_s))


def _in_order(channel: Channel, repairs: list[Repair]) -> Channel:
    """Finite samples in the order of their stamps, none twice."""
    found = order.of(channel.time_s, channel.value)
    for reason, places in found.left_out.items():
        text = f"{len(places)} samples are left out: {LOSSES.get(reason) or NOTHING_LOST[reason]}"
        repairs.append(Repair(channel.name, reason, len(places), text))
    if found.moved:
        text = (
            f"{found.moved} samples were out of order and are sorted by their stamps: {found.even:.2%} of the steps "
            f"are then {found.step_s:.4g} s"
        )
        steps = np.diff(channel.time_s[found.kept])
        uneven = float(np.sqrt(np.mean((steps[steps < 1.5 * found.step_s] - found.step_s) ** 2)))
        repairs.append(Repair(channel.name, "sorted", found.moved, text, uneven, "s"))
    losses = channel.losses
    for reason, places in found.left_out.items():
        mask = np.zeros(len(channel.value), dtype=bool)
        mask[places] = True
        losses += channel.without(mask, reason).losses[len(channel.losses) :]
    return dataclasses.replace(
        channel, time_s=channel.time_s[found.kept], value=channel.value[found.kept], losses=losses
    )


def _unwrapped(channel: Channel, found: wraps.Wraps, repairs: list[Repair]) -> Channel:
    """An overrun integer counted on by its span."""
    if not found.places:
        return channel
    turns = np.zeros(len(channel.value))
    places = np.array(found.places)
    turns[places + 1] = np.sign(np.diff(channel.value)[places])
    mended = channel.value - found.span * np.cumsum(turns)
    text = f"{channel.shown(found.span)} taken out at {len(found.places)} places: {found.meaning}"
    steps = np.diff(mended)
    around = np.stack([np.clip(places + away, 0, len(steps) - 1) for away in (-1, 1)])
    off = steps[places] - steps[around].mean(axis=0)  # the motion goes on as around the place
    residual = float(np.sqrt(np.mean(off**2)))
    # every value behind the first place changes, but for those where as many turns go back
    count = int(np.count_nonzero(np.cumsum(turns)))
    repairs.append(Repair(channel.name, "wrap", count, text, residual, channel.unit))
    return dataclasses.replace(channel, value=mended)


def _without_bits(channel: Channel, places: NDArray[np.intp], repairs: list[Repair]) -> Channel:
    """Without single values that are wrong by one bit; other spikes may be true and stay."""
    if not len(places):
        return channel
    text = f"{len(places)} single values with a wrong bit are left out"
    repairs.append(Repair(channel.name, "bit_flip", len(places), text))
    mask = np.zeros(len(channel.value), dtype=bool)
    mask[places] = True
    return channel.without(mask, "bit_flip")


def _without_clipped(channel: Channel, limits: list[float], repairs: list[Repair]) -> Channel:
    """Without the values at a limit where they are cut off: the true ones are beyond it."""
    mask = np.isin(channel.value, limits)
    if not limits or not mask.any():
        return channel
    at = ", ".join(map(channel.shown, limits))
    text = f"{int(mask.sum())} values are left out: cut off at {at}"
    repairs.append(Repair(channel.name, "clipped", int(mask.sum()), text))
    return channel.without(mask, CLIPPED)


def even_clocks(dataset: Dataset) -> tuple[dict[str, even_clock.EvenClock], list[Repair]]:
    """{channel: the even clock behind its stamps} and the repairs that these are, to be requested by their option.

    Channels of one time base have one clock. Rows that are there twice, values and all, are not two samples.
    """
    of_base: dict[bytes, list[str]] = {}
    for name, channel in dataset.channels.items():
        of_base.setdefault(channel.time_s.tobytes(), []).append(name)
    clocks: dict[str, even_clock.EvenClock] = {}
    made = []
    for names in of_base.values():
        time_s = dataset[names[0]].time_s
        clock = even_clock.of(time_s)
        if clock is None:
            continue
        twice = np.diff(time_s) == 0.0
        alike = np.all([np.diff(dataset[name].value)[twice] == 0.0 for name in names], axis=0)
        if twice.any() and alike.mean() > REPEATED:
            continue
        count = int(np.count_nonzero(even_clock.changed(time_s, clock)))
        for name in names:
            clocks[name] = clock
            made.append(Repair(name, "even_clock", count, clock.text, clock.residual_s, "s", EVEN_CLOCK))
    return clocks, made


def without_clipped_rows(dataset: Dataset, findings: list[Finding]) -> Dataset:
    """A table of one row per sample without the rows in which a value is cut off at a limit."""
    wrong: set[float] = set()
    for each in findings:
        if each.kind == "saturation" and each.severity != sanity.NOTE:
            channel = dataset[each.channel]
            wrong.update(channel.time_s[channel.value == each.size].tolist())
    if not wrong:
        return dataset
    repairs = [*dataset.repairs]
    channels = {}
    for name, channel in dataset.channels.items():
        mask = np.isin(channel.time_s, list(wrong))
        repairs.append(Repair(name, "clipped", int(mask.sum()), "rows with a value that is cut off are left out"))
        channels[name] = channel.without(mask, CLIPPED)
    return dataclasses.replace(dataset, channels=channels, repairs=repairs)


# --- asked for by name --------------------------------------------------------------------------------------


def evenly_stamped(dataset: Dataset) -> Dataset:
    """The channels with the stamps of the even clock that explains theirs. UserError when none explains any."""
    clocks, made = even_clocks(dataset)
    if not made:
        raise DataError(f"{dataset.name}: {EVEN_CLOCK}: no even clock fits the stamps within their rounding")
    channels = {
        name: dataclasses.replace(channel, time_s=clocks[name].time_s) if name in clocks else channel
        for name, channel in dataset.channels.items()
    }
    return dataclasses.replace(dataset, channels=channels, repairs=[*dataset.repairs, *made])


def converted(dataset: Dataset, name: str, unit: str) -> Dataset:
    """The channel `name` in SI, whose values are in `unit` despite its stated one. UserError for an unknown unit."""
    channel = dataset[name]
    true = units.unit_of(unit)
    if true is None or not unit.strip():
        raise DataError(f"{dataset.name}: unknown unit {unit!r}")
    value = channel.value * true.factor + true.offset
    text = f"the values are in {unit}: times {true.factor:.10g}, now in {true.text}"
    return _with(dataset, dataclasses.replace(channel, value=value, unit=true.text), "converted", len(value), text)


def shifted(dataset: Dataset, name: str, later_s: float) -> Dataset:
    """The channel's stamps moved by `later_s`, for a lag that is known."""
    channel = dataset[name]
    text = f"its stamps are moved by {later_s:+g} s"
    moved = dataclasses.replace(channel, time_s=channel.time_s + later_s, masked_s=channel.masked_s + later_s)
    return _with(dataset, moved, "shifted", len(channel.value), text)


def offset(dataset: Dataset, name: str, value: float) -> Dataset:
    """A constant added to the channel, for a zero that is known."""
    channel = dataset[name]
    text = f"{value:+g} {channel.unit} added"
    return _with(dataset, dataclasses.replace(channel, value=channel.value + value), "offset", len(channel.value), text)


def cut(dataset: Dataset, start_s: float, end_s: float) -> Dataset:
    """All channels without their samples in [start, end]. UserError when nothing is left of one."""
    channels = {}
    left_out = 0
    for name, channel in dataset.channels.items():
        inside = (channel.time_s >= start_s) & (channel.time_s <= end_s)
        outside = int((~inside).sum())
        if outside < FEWEST:
            raise DataError(f"{dataset.name}: {name} has {outside} samples outside {start_s:g} to {end_s:g} s")
        left_out += int(inside.sum())
        channels[name] = channel.without(inside, "cut")
    repair = Repair("", "cut", left_out, f"{start_s:g} to {end_s:g} s is left out of all channels")
    return dataclasses.replace(dataset, channels=channels, repairs=[*dataset.repairs, repair])


def _with(dataset: Dataset, channel: Channel, kind: str, count: int, text: str) -> Dataset:
    repair = Repair(channel.name, kind, count, text)
    channels = dataset.channels | {channel.name: channel}
    return dataclasses.replace(dataset, channels=channels, repairs=[*dataset.repairs, repair])
