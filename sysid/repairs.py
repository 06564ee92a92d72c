"""Changes to measured data, each explicit, each recorded in the dataset with its reason and its count.

`mend` does what has one right answer: it leaves out what is no sample, puts an overrun counter right. What is a
judgement (another unit, a lag, a zero) is asked for by name. A value is never invented: a wrong one is left out.
"""

import dataclasses
import math

import numpy as np

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import sanity, units
from ranger_sim.sysid.dataset import Array, Channel, Dataset, Finding, Repair

FEWEST = 2  # samples that a channel must keep
KINDS = {
    "stamp_wrap": "an overrun counter of the clock counts on",
    "not_finite": "values and stamps that are no numbers are left out",
    "reversed_stamps": "samples whose stamps go back are left out",
    "duplicate_stamps": "of samples with one stamp the first is kept",
    "wrap": "an overrun integer counts on",
    "bit_flip": "single wrong values are left out",
    "dropped": "a channel with nothing in it is left out",
    # asked for by name
    "converted": "another unit than was told",
    "shifted": "a channel's stamps moved",
    "offset": "a constant added",
    "cut": "a time left out",
}


def mend(dataset: Dataset, findings: list[Finding] | None = None) -> Dataset:
    """The dataset without what is certainly wrong; findings (`sanity.inspect` where not given) come along.

    UserError when no channel is left.
    """
    findings = sanity.inspect(dataset) if findings is None else findings
    wraps = {each.channel for each in findings if each.kind == "stamp_wrap"}
    channels = {}
    repairs = list(dataset.repairs)
    for channel in dataset.channels.values():
        time_s, value = channel.time_s, channel.value
        if channel.name in wraps:
            time_s = _counted_on(channel.name, time_s, repairs)
        time_s, value = _forward(channel.name, time_s, value, repairs)
        if len(value) < FEWEST:
            repairs.append(Repair(channel.name, "dropped", len(value), f"{len(value)} sound samples: left out"))
            continue
        value = _unwrapped(channel, value, repairs)
        time_s, value = _without_spikes(channel, time_s, value, findings, repairs)
        channels[channel.name] = dataclasses.replace(channel, time_s=time_s, value=value)
    if not channels:
        raise UserError(f"{dataset.name}: no channel has {FEWEST} sound samples")
    return Dataset(dataset.name, channels, findings, repairs)


def _counted_on(name: str, time_s: Array, repairs: list[Repair]) -> Array:
    """Stamps with an overrun counter's span added behind each overrun."""
    steps = np.diff(time_s)
    finite = steps[np.isfinite(steps)]
    usual = float(np.median(finite[finite > 0.0])) if (finite > 0.0).any() else 0.0
    back = [place for place in np.flatnonzero(steps < 0.0) if sanity.is_clock_wrap(time_s, int(place))]
    mended = time_s.copy()
    for place in back:
        span = _span_of(float(time_s[place] - time_s[place + 1]) + usual)
        mended[place + 1 :] += span
        text = f"{span:.9g} s added behind {time_s[place]:.6g} s, where the counter ran over"
        repairs.append(Repair(name, "stamp_wrap", len(time_s) - int(place) - 1, text))
    return mended


def _span_of(step_s: float) -> float:
    """A counter's span, next to a step back: a power of two of microseconds or milliseconds."""
    spans = [2.0**bits * tick for bits in (16, 24, 31, 32) for tick in (1e-6, 1e-3)]
    nearest = min(spans, key=lambda span: abs(span - step_s))
    return nearest if abs(nearest / step_s - 1.0) < 0.02 else step_s


def _forward(name: str, time_s: Array, value: Array, repairs: list[Repair]) -> tuple[Array, Array]:
    """Finite samples at stamps that run forward."""
    finite = np.isfinite(time_s) & np.isfinite(value)
    if not finite.all():
        count = int((~finite).sum())
        repairs.append(Repair(name, "not_finite", count, f"{count} samples that are no numbers are left out"))
        time_s, value = time_s[finite], value[finite]
    if len(time_s) < 2:
        return time_s, value
    before = np.concatenate(([-math.inf], np.maximum.accumulate(time_s)[:-1]))
    for kind, wrong in (("reversed_stamps", time_s < before), ("duplicate_stamps", time_s == before)):
        if wrong.any():
            count = int(wrong.sum())
            text = f"{count} samples whose stamps {'go back' if kind[0] == 'r' else 'came before'} are left out"
            repairs.append(Repair(name, kind, count, text))
    kept = time_s > before
    return time_s[kept], value[kept]


def _unwrapped(channel: Channel, value: Array, repairs: list[Repair]) -> Array:
    """An overrun integer counted on: the jump less the motion around it is its span."""
    places = sanity.wrap_places(value)
    if not places:
        return value
    steps = np.diff(value)
    jumps = [steps[p] - 0.5 * (steps[p - 1] + steps[p + 1]) for p in places]
    span = float(np.median(np.abs(jumps)))
    mended = value.copy()
    for place, jump in zip(places, jumps, strict=True):
        mended[place + 1 :] -= math.copysign(span, jump)
    text = f"{span:.6g} {channel.unit} taken out at {len(places)} places where the integer ran over"
    repairs.append(Repair(channel.name, "wrap", len(places), text))
    return mended


def _without_spikes(
    channel: Channel, time_s: Array, value: Array, findings: list[Finding], repairs: list[Repair]
) -> tuple[Array, Array]:
    """Without single values that are wrong by one bit; other spikes may be true and stay."""
    if not any(each.channel == channel.name and each.kind == "bit_flip" for each in findings):
        return time_s, value
    places = sanity.spike_places(value)
    if len(places):
        text = f"{len(places)} single values with a wrong bit are left out"
        repairs.append(Repair(channel.name, "bit_flip", len(places), text))
    return np.delete(time_s, places), np.delete(value, places)


# --- asked for by name --------------------------------------------------------------------------------------


def converted(dataset: Dataset, name: str, unit: str) -> Dataset:
    """The channel `name`, whose values are in `unit` whatever was told, in SI. UserError for an unknown unit."""
    channel = dataset[name]
    true = units.unit_of(unit)
    if true is None or not unit.strip():
        raise UserError(f"{dataset.name}: {unit!r} is no unit that is known here")
    value = channel.value * true.factor + true.offset
    text = f"the values are in {unit}: times {true.factor:.10g}, now in {true.text}"
    return _with(dataset, dataclasses.replace(channel, value=value, unit=true.text), "converted", len(value), text)


def shifted(dataset: Dataset, name: str, later_s: float) -> Dataset:
    """The channel's stamps moved by `later_s`, for a lag that is known."""
    channel = dataset[name]
    text = f"its stamps are moved by {later_s:+g} s"
    moved = dataclasses.replace(channel, time_s=channel.time_s + later_s)
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
        kept = (channel.time_s < start_s) | (channel.time_s > end_s)
        if kept.sum() < FEWEST:
            raise UserError(f"{dataset.name}: {name} has {int(kept.sum())} samples outside {start_s:g} to {end_s:g} s")
        left_out += int((~kept).sum())
        channels[name] = dataclasses.replace(channel, time_s=channel.time_s[kept], value=channel.value[kept])
    repair = Repair("", "cut", left_out, f"{start_s:g} to {end_s:g} s is left out of all channels")
    return Dataset(dataset.name, channels, list(dataset.findings), [*dataset.repairs, repair])


def _with(dataset: Dataset, channel: Channel, kind: str, count: int, text: str) -> Dataset:
    repair = Repair(channel.name, kind, count, text)
    return Dataset(
        dataset.name, dataset.channels | {channel.name: channel}, list(dataset.findings), [*dataset.repairs, repair]
    )
