"""What happens to whole recordings between the machine and the file: joined, mixed, resampled, held, rounded.

As in sanity.py nothing is changed here. Each check compares a channel with itself, so that it needs no model.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ranger_sim.sysid import even_clock
from ranger_sim.sysid.dataset import Array, Channel, Finding

NOTE, WARNING = "note", "warning"
FEWEST = 60  # samples
PARTS = 4  # of a recording's channels: so many time bases may share them
UNEVEN = 0.2  # of a step: rounding of stamps below it changes a rate by less than its own noise
# A join: every smooth channel steps at one row, farther than anywhere else by this factor, and goes on smoothly.
JOIN, USUAL_PERCENT = 8.0, 99.5
SMOOTH = 0.2  # largest usual step of a smooth channel to its range
# Straight lines: kinks at one distance, and nothing between them but the rounding of the digits.
LINES_PART, FEWEST_STEPS, DIGITS, SHARP = 0.8, 3, 2.5, 10.0
POSITIONS = ("rad", "m")
MOST_JOINS = 3
CLOCK_STEP = 0.5  # of the usual step of an even clock
NEAR, LEAD = 20, 3  # rows on either side; by which a reference is ahead
STAYS, FOLLOWS = 0.5, 0.5  # part of a jump that is left a row later; correlation of steps
MOST_HELD = 200
MIXED = 3.0  # neighbours are so many times as far from each other as next neighbours


def of_stamps(channel: Channel) -> Iterator[Finding]:
    """Stamps that were rounded: so far that several samples have one, or that their distances are uneven by it."""
    finite = channel.time_s[np.isfinite(channel.time_s)]
    steps = np.diff(finite)
    if len(finite) < FEWEST or not steps.any() or (steps < 0.0).any():
        return
    ends = float(finite[0]), float(finite[-1])
    clock = even_clock.of(finite)
    different = 1 + int(np.count_nonzero(steps))
    if np.mean(steps == 0.0) >= even_clock.SAME_PART and len(finite) >= 1.5 * different:
        rounded = clock.rounding_s if clock is not None else even_clock.rounding(finite)
        what = clock.text if clock is not None else f"stamps are rounded to {rounded:g} s, and no even clock fits them"
        if rounded:
            text = f"{what}; {len(finite)} samples have {different} different ones"
            yield Finding(channel.name, "rounded_stamps", *ends, rounded, "s", text)
    elif clock is not None:
        share = clock.rounding_s / clock.step_s
        text = f"{clock.text}; their distances are uneven by {share:.2g} of a step"
        severity = NOTE if share < UNEVEN else WARNING
        yield Finding(channel.name, "quantised_stamps", *ends, clock.rounding_s, "s", text, severity)


def of_values(channel: Channel) -> Iterator[Finding]:
    """A channel that holds its values over several rows, or goes from one to another in straight lines."""
    value, time_s = channel.value, channel.time_s
    if len(value) < FEWEST or not np.ptp(value) > 0.0:
        return
    ends = float(time_s[0]), float(time_s[-1])
    changes = np.flatnonzero(np.diff(value) != 0.0)
    held = _usual_distance(changes)
    if held > 1 and len(changes) >= 20 and len(set(value.tolist())) > 20:
        text = f"it has a new value every {held} rows only: held in between, sampled every {held * _step(time_s):.4g} s"
        yield Finding(channel.name, "held", *ends, held * _step(time_s), "s", text, NOTE)
        return
    rounding = DIGITS * max(channel.resolution, 1e-9 * float(np.ptp(value)))
    bends = np.abs(np.diff(value, 2))
    kinks = np.flatnonzero(bends > rounding)
    distance = _usual_distance(kinks)
    if distance < FEWEST_STEPS or len(kinks) < 10 or float(np.median(bends[kinks])) < SHARP * rounding:
        return
    text = (
        f"it goes in straight lines over {distance} rows each: resampled from samples "
        f"{distance * _step(time_s):.4g} s apart"
    )
    yield Finding(channel.name, "resampled", *ends, distance * _step(time_s), "s", text)


def _usual_distance(places: NDArray[np.intp]) -> int:
    """The distance of most neighbours; 0 when they have none in common."""
    if len(places) < 2:
        return 0
    steps = np.diff(places)
    usual = int(np.median(steps))
    return usual if usual <= MOST_HELD and np.mean(steps == usual) >= LINES_PART else 0


def _step(time_s: Array) -> float:
    return float(np.median(np.diff(time_s)))


def of_all(channels: dict[str, Channel]) -> Iterator[Finding]:
    """Recordings that were joined, or whose rows are mixed: what happens to all channels of one time base at a row."""
    moving = sum(len(each.value) >= FEWEST and np.ptp(each.value) > 0.0 for each in channels.values())
    for group in _by_stamps(channels):
        if PARTS * len(group) >= moving:  # a few of a robot's variables restart together; a joint is in all channels
            smooth = [channel for channel in group if _is_smooth(channel.value)]
            yield from _joined(smooth, group)
        yield from _mixed(group)


def _by_stamps(channels: dict[str, Channel]) -> list[list[Channel]]:
    """Channels of one time base together."""
    groups: dict[tuple[int, float, float], list[Channel]] = {}
    for channel in channels.values():
        if len(channel.value) >= FEWEST and np.ptp(channel.value) > 0.0:
            key = (len(channel.time_s), float(channel.time_s[0]), float(channel.time_s[-1]))
            groups.setdefault(key, []).append(channel)
    return [group for group in groups.values() if len(group) > 1]


def _is_smooth(value: Array) -> bool:
    """True for what moves in steps that are small against its range, but for a few."""
    steps = np.abs(np.diff(value))
    return bool(np.percentile(steps, USUAL_PERCENT) < SMOOTH * np.ptp(value)) and bool(np.mean(steps == 0.0) < 0.5)


def _joined(smooth: list[Channel], group: list[Channel]) -> Iterator[Finding]:
    """Rows at which every position jumps, and another channel with it: joined recordings, or a fast movement.

    Something that breaks loose may move in one row, and a controller answers in the same row. A join has evidence of
    its own: the clock steps there, or channels that do not follow the position go over to another course and stay.
    """
    if len(smooth) < 2 or not (positions := [channel for channel in smooth if channel.unit in POSITIONS]):
        return
    time_s = smooth[0].time_s
    usual_s = _step(time_s)
    jumps = {channel.name: _jumps(channel) for channel in smooth}
    at_all = np.all([jumps[channel.name] > 0.0 for channel in positions], axis=0)
    places = np.flatnonzero(at_all & (np.sum([each > 0.0 for each in jumps.values()], axis=0) > 1))
    clock_is_even = np.percentile(np.abs(np.diff(time_s) - usual_s), USUAL_PERCENT) < CLOCK_STEP * usual_s
    for place in map(int, places if len(places) <= MOST_JOINS else ()):
        at, after = float(time_s[place]), float(time_s[place + 1])
        names = [name for name, sizes in jumps.items() if sizes[place] > 0.0]
        text = f"{', '.join(names[:3])} jump at one row ({at:.6g} s)"
        staying = [channel for channel in group if _stays(channel, place)]
        clock_steps = clock_is_even and abs(after - at - usual_s) > CLOCK_STEP * usual_s
        others = [each for each in staying if each is not positions[0] and not _follows(each, positions[0], place)]
        if clock_steps or (others and all(each in staying for each in positions)):
            text += ": two recordings were joined there"
            yield Finding("", "jump", at, after, float(len(names)), "channels", text)
            continue
        for channel in positions:
            size = float(jumps[channel.name][place])
            text = (
                f"it jumps by {size:.4g} {channel.unit} at one row, and {', '.join(names[1:3])} with it: a fast "
                "movement; nothing else says that two recordings were joined there"
            )
            yield Finding(channel.name, "step", at, after, size, channel.unit, text)


def _jumps(channel: Channel) -> Array:
    """Sizes (n - 1,) of the steps from row to row that are far larger than usual; 0 elsewhere."""
    steps = np.abs(np.diff(channel.value))
    steps[np.diff(channel.time_s) > 3.0 * _step(channel.time_s)] = 0.0  # across a gap it may have moved
    usual = max(float(np.percentile(steps, USUAL_PERCENT)), 2.0 * channel.resolution)
    return np.where(steps > JOIN * usual, steps, 0.0)


def _stays(channel: Channel, place: int) -> bool:
    """True when the channel steps farther than anywhere near, and does not go back in the row behind."""
    value = channel.value[max(0, place - NEAR) : place + NEAR + 2]
    here = min(place, NEAR)
    size = abs(float(value[here + 1] - value[here]))
    near = np.delete(np.abs(np.diff(value)), here)
    before, after = value[max(0, here - 1) : here + 1], value[here + 1 : here + 3]
    stays = float(np.abs(after[:, None] - before[None, :]).min()) > STAYS * size
    return stays and size > JOIN * max(float(near.max(initial=0.0)), 2.0 * channel.resolution)


def _follows(channel: Channel, position: Channel, place: int) -> bool:
    """True for a channel whose steps are those of the position, as a controller's are: it jumps because that jumps.

    What the position follows some rows later, as a reference, does not follow it.
    """
    one, two = (np.delete(np.diff(each.value), place) for each in (channel, position))
    if not one.any() or not two.any():
        return False
    same_row = abs(float(np.corrcoef(one, two)[0, 1]))
    later = abs(float(np.corrcoef(one[:-LEAD], two[LEAD:])[0, 1]))
    return same_row > FOLLOWS and later <= same_row


def _mixed(group: list[Channel]) -> Iterator[Finding]:
    """Rows of two recordings in turn: next neighbours are alike, and neighbours are not, in every channel."""
    for channel in group:
        one, two = np.abs(np.diff(channel.value)), np.abs(channel.value[2:] - channel.value[:-2])
        if not float(np.median(one)) > MIXED * float(np.median(two)):
            return
    text = "from row to row all channels go to and fro between two courses: two recordings are mixed in one file"
    first = group[0]
    yield Finding("", "mixed", float(first.time_s[0]), float(first.time_s[-1]), float(len(group)), "channels", text)
