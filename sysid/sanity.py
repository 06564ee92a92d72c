"""Oddities of measured data, each with place and size, to check before any conclusion.

This module changes nothing; `repairs.py` does, explicitly. Thresholds are chosen by us so that the measured logs of
docs/robot.md C6 give the findings described there and no others; each has its reason next to it.
"""

import dataclasses
import math
from collections.abc import Collection, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ranger_sim.foundation.user_error import DataError
from ranger_sim.sysid import headlines, order, wraps
from ranger_sim.sysid.dataset import Array, Channel, Dataset, Finding
from ranger_sim.sysid.lattice import lattice_step

NOTE, WARNING, FATAL = "note", "warning", "fatal"
KINDS = {
    # of the file, reported by its reader
    "no_header": "the columns have no names",
    "no_unit": "nothing says the unit",
    "unknown_unit": "the file says a unit that is not known",
    "unit_assumed": "nothing says the unit of the stamps, seconds are assumed",
    "time_assumed": "which column is the time follows from its values only",
    "time_of_rate": "the stamps follow from a rate above the table",
    "dates_either_way": "day and month can be exchanged",
    "names_again": "the names of the columns come again",
    "cut_off": "the last row is cut off",
    "no_stamp": "rows without a stamp",
    "form_changes": "rows have another form from a line on",
    "ragged": "rows with too many or too few cells",
    "unreadable": "cells that are not numbers",
    "text": "values of a measurement file that have a text instead of a number",
    "no_numbers": "channels of a measurement file that hold no plain numbers",
    "unknown_frames": "frames that the DBC file does not know",
    "lost_frames": "frames that the file has, or should have, and that did not come out",
    "several_buses": "messages from several buses",
    "broken_frames": "frames that do not fit their message",
    "dropouts": "the logger reports that it dropped data",
    "no_summary": "a walk's folder without its summary",
    "fell": "the robot fell in this walk",
    # of the stamps
    "empty": "no sample",
    "single_sample": "one sample",
    "one_instant": "all samples have one stamp",
    "stamp_wrap": "the clock's counter ran over",
    "reversed_stamps": "stamps that go back",
    "duplicate_stamps": "stamps that come twice",
    "rounded_stamps": "stamps are rounded so far that several samples have one",
    "quantised_stamps": "stamps are rounded, so that their distances are uneven",
    "gap": "no samples for a while",
    "slow_samples": "samples so far apart that the stamps may be in another unit",
    "clock_drift": "two clocks do not run alike",
    # of the values
    "not_finite": "values that are not numbers",
    "wrap": "an integer ran over",
    "not_repaired": "a driving channel looks wrong and stays unchanged",
    "bit_flip": "single values that are wrong by a power of two of the finest step",
    "spike": "single values far from both neighbours",
    "held": "it keeps each value for several rows",
    "resampled": "it goes in straight lines between fewer samples",
    "jump": "all channels jump at one row, and stay: two recordings were joined",
    "step": "a position jumps at one row, as in a fast movement",
    "mixed": "rows of two recordings in turn",
    "quantised": "the steps of its values are most of the noise of its derivative",
    "stuck": "a value stays constant while other channels move",
    "at_rest": "a value stays at 0 while the channels that move are small",
    "constant": "one value all the time",
    "saturation": "values cut off at a limit",
    "lag": "a channel comes later than a redundant one",
    "pair": "an angle and its rate, or two channels of one unit, that do not fit each other",
    "wrong_unit": "values as of another unit than the given one",
    "noise": "from sample to sample it jumps, and nothing of that is in another channel",
}
DOUBTED = (
    "jump",
    "mixed",
    "resampled",
    "rounded_stamps",
    "unknown_unit",
    "slow_samples",
    "wrong_unit",
    "stuck",
    "noise",
)
GAP_STEPS = 5.0  # of the median step; radio gaps of the robot's logs are 9 to 45 steps of 4 to 6 ms (C6.2)
NAMED_PLACES = 6  # single findings of a kind in a channel; more become one finding
SPIKE_STEPS = 12.0  # of the usual second difference; noise reaches 6 in a million samples
WARMTHS = ("C", "K")  # units of temperatures
STUCK_SAMPLES = 50  # a fifth of a second of a fast channel of the robot
STUCK_RATIO = 8.0  # to the longest other stretch: a quantised channel at rest is constant as well
SMALL_PART = 0.5  # of a channel's largest value: below it friction or a dead zone may hold what it drives
MOVES_PART = 0.2  # of a channel's whole range, within a stretch: less is rest
# Variance of values over half the mean square of neighbours' differences: 1 for white noise at rest, 2 for one with a
# correlation of 0.5 from sample to sample; a sine of 10 samples a period has 2.6, slower ones have more.
MOVES_RATIO = 2.25
CLIPPED_SAMPLES = 3  # in a row at the limit
CLIPPED_RUNS = 2
LEVELS = 20  # different values: with fewer, counts of a coarse instrument rest at the largest one as at any other
FLAT_PART = 0.5  # zero steps in commands that are held, which cannot be distinguished from cut-off ones
MOTIONS = ("rad", "m", "rad/s", "m/s")  # whose derivatives a model needs
QUANTISED = 0.5  # of the noise that neighbours show: the part of rounding from which on steps are seen in a derivative
DERIVATIVE_NOISE = 0.2  # of a derivative's own size
DRIFT_PPM = 100.0  # quartz crystals differ by less
LONGEST_LAG_S = 0.25
LAG_STEPS = 0.5  # of the sampling: smaller ones are the stamps' own rounding
WHITE = 0.8  # half the mean square of neighbours' differences to the variance; 1 for white noise
COMMON = 6.0  # deviations of a correlation with white noise; some hundred lags of some channels reach 4.5 by chance
COMMON_LAGS, FEWEST_OF_NOISE = 50, 300  # samples
SURE, FAR_STEPS, MOST_PAIRS = 0.01, 3.0, 30  # of pairs that only their units make
QUANTITIES = (
    "angle", "position", "pos", "rate", "speed", "velocity", "vel", "omega", "theta", "phi", "q", "dq", "v", "x", "w",
    "rad", "m", "per", "s",
)  # fmt: skip
FEWEST = 30  # samples; with fewer, only stamps are checked
SLOPES = {  # possible factor of a rate to the angle's derivative, and its meaning
    180.0 / math.pi: "the rate is in deg/s, or the angle in turns of rad",
    math.pi / 180.0: "the angle is in degrees",
    30.0 / math.pi: "the rate is in rpm",
    math.pi / 30.0: "the angle is in 9.5 times smaller units",
    6.0: "the rate is in rpm and the angle in degrees, wrongly converted",
    1000.0: "the angle is in thousands, or the stamps are in ms",
    1e-3: "the rate is in thousands, or the stamps are in ms",
    1e6: "the stamps are in us",
    1e-6: "the stamps are in us",
    -1.0: "one of the two counts the other way round",
}
SURE_SLOPES = tuple(slope for slope in SLOPES if slope != 6.0)  # which may be a gear
SLOPE_TOLERANCE = 0.05
ALIKE = 0.9  # correlation from which on a rate and a derivative are the same motion
# (angle, rate) that show the same motion. The bench's speed is at the gearbox's output, its angle at the motor.
DERIVATIVES = (
    ("joint_angle_rad", "joint_rate_rad_per_s"),
    ("target_angle_rad", "target_rate_rad_per_s"),
    ("hip_angle_rad", "hip_rate_rad_per_s"),
    ("hip_motor_angle_rad", "hip_motor_rate_rad_per_s"),
    ("outer_ankle_angle_rad", "outer_ankle_rate_rad_per_s"),
    ("inner_ankle_angle_rad", "inner_ankle_rate_rad_per_s"),
    ("outer_motor_angle_rad", "outer_motor_rate_rad_per_s"),
    ("inner_motor_angle_rad", "inner_motor_rate_rad_per_s"),
    ("outer_leg_angle_rad", "outer_leg_rate_rad_per_s"),
    ("motor_angle_rad", "motor_rate_rad_per_s"),
)
# the same angle by two encoders, up to the transmission between them
REDUNDANT = (
    ("joint_angle_rad", "motor_angle_rad"),
    ("hip_angle_rad", "hip_motor_angle_rad"),
    ("outer_ankle_angle_rad", "outer_motor_angle_rad"),
    ("inner_ankle_angle_rad", "inner_motor_angle_rad"),
)
# the same motion by angle and rate, in addition to those above: both rest at the same times
TOGETHER = (*DERIVATIVES, *REDUNDANT, ("motor_angle_rad", "speed_rad_per_s"))
JOINTS = ("hip_angle", "joint_angle", "ankle_angle", "leg_angle")
# (end of a name, largest likely value, likelier unit): a machine of this size does not exceed it
LARGEST = (
    ("_A", 200.0, "mA"),
    ("_V", 1000.0, "mV"),
    ("_C", 200.0, "K"),
    ("_Nm", 2000.0, "mNm or N mm"),
)
LARGEST_JOINT_RAD = 2.0 * math.pi
SMALLEST = 1e-12  # largest value of a channel in SI: no instrument of such machines resolves it
LONGEST_STEP_S = 0.5  # median of the stamps: slower than any experiment here


def inspect(dataset: Dataset, motions: Sequence[tuple[str, str]] = ()) -> list[Finding]:
    """All oddities: the reader's findings, each channel's stamps and values, channels against each other.

    motions: names of an angle and a rate that are to show the same motion, next to those of Ranger.
    """
    with np.errstate(all="ignore"):  # checks report numbers near the largest; their overflows mean nothing more
        return _inspected(dataset, motions)


def _inspected(dataset: Dataset, motions: Sequence[tuple[str, str]]) -> list[Finding]:
    found = list(dataset.findings)
    if not dataset.channels:
        found.append(Finding("", "empty", 0.0, 0.0, 0.0, "", "there is no channel", FATAL))
    sound: dict[str, Channel] = {}
    for channel in dataset.channels.values():
        found += _stamps(channel, dataset.clock_is_given)
        found += headlines.of_stamps(channel)
        tidy = _tidied(channel)
        found += _not_finite(channel)
        if len(tidy.value) >= FEWEST:
            sound[channel.name] = tidy
    for channel in sound.values():
        found += _values(channel, sound)
        found += headlines.of_values(channel)
    found += _between(sound, [*DERIVATIVES, *motions])
    return found


def of_recording(dataset: Dataset) -> list[Finding]:
    """Oddities of all channels together, which only the import sees: later steps choose some of the channels."""
    with np.errstate(all="ignore"):
        return list(headlines.of_all(_sound(dataset)))


def _sound(dataset: Dataset) -> dict[str, Channel]:
    """The channels with enough finite samples, in order."""
    tidy = {name: _tidied(each) for name, each in dataset.channels.items() if len(each.value) >= FEWEST}
    return {name: each for name, each in tidy.items() if len(each.value) >= FEWEST}


def pairs(dataset: Dataset) -> list[Finding]:
    """What an angle and its rate, or two channels of one unit, show of each other, where only their units pair them.

    A gear or a transmission between two channels is not known here, so that nothing depends on these findings.
    """
    with np.errstate(all="ignore"):
        moving = {
            name: each
            for name, each in _sound(dataset).items()
            if np.ptp(each.value) > 0.0 and not _is_held(each.value)
        }
        return list(_pairs(moving))


def _pairs(channels: dict[str, Channel]) -> Iterator[Finding]:
    for unit in ("rad", "m"):
        positions = [each for each in channels.values() if each.unit == unit]
        rates = [each for each in channels.values() if each.unit == f"{unit}/s"]
        for rate in rates:
            own = [each for each in positions if _stem(each.name) == _stem(rate.name)]
            own = own or (positions if len(positions) == len(rates) == 1 else [])
            if len(own) == 1 and (own[0].name, rate.name) not in DERIVATIVES:
                yield from (
                    dataclasses.replace(each, kind="pair")
                    for each in _derivative(own[0], rate)
                    if each.kind == "lag" or any(abs(each.size / slope - 1.0) < SURE for slope in SURE_SLOPES)
                )
    alike = [
        (first, second)
        for number, first in enumerate(channels.values())
        for second in list(channels.values())[number + 1 :]
        if first.unit == second.unit != "" and (first.name, second.name) not in REDUNDANT
    ]
    for first, second in alike[:MOST_PAIRS]:
        late = lag_s(first, second)
        step = max(float(np.median(np.diff(each.time_s))) for each in (first, second))
        if late is not None and abs(late) >= FAR_STEPS * step:
            text = f"it comes {abs(late) * 1e3:.3g} ms {'after' if late > 0.0 else 'before'} {first.name}"
            ends = float(second.time_s[0]), float(second.time_s[-1])
            yield Finding(second.name, "pair", *ends, late, "s", text, NOTE)


def _stem(name: str) -> str:
    """The name without its quantity and unit: "hip" of hip_angle_rad and of hip_rate_rad_per_s."""
    words = [word for word in name.lower().split("_") if word not in QUANTITIES]
    return "_".join(words)


def stop_if_fatal(name: str, findings: list[Finding]) -> None:
    """Raise UserError with the first finding that leaves no usable data."""
    for finding in findings:
        if finding.severity == FATAL:
            raise DataError(f"{name}: {finding.channel + ': ' if finding.channel else ''}{finding.text}")


def stop_if_input_is_clipped(name: str, findings: list[Finding], inputs: Collection[str]) -> None:
    """UserError for an input of the machine that is cut off at a limit: what drove the machine is then unknown."""
    for finding in findings:
        if finding.kind == "saturation" and finding.severity != NOTE and finding.channel in inputs:
            raise DataError(
                f"{name}: {finding.channel}: {finding.text}; it drives the machine, and what drove it beyond the limit "
                f"is unknown; nothing is concluded (--assume limits={finding.channel}: the drive itself ends there; "
                f"--repair {finding.channel}: these rows are left out)"
            )


def doubts(findings: list[Finding]) -> list[Finding]:
    """Findings that forbid naming a cause with confidence: the data are not as described."""
    return [each for each in findings if each.kind in DOUBTED and each.severity != NOTE]


def as_json(finding: Finding) -> dict[str, object]:
    """A finding for programs."""
    return dataclasses.asdict(finding)


def _tidied(channel: Channel) -> Channel:
    """Finite samples only, in the order of their stamps: the input of the checks of values."""
    time_s = wraps.counted_on(channel.time_s)
    kept = order.of(time_s, channel.value).kept
    return dataclasses.replace(channel, time_s=time_s[kept], value=channel.value[kept])


# --- stamps -------------------------------------------------------------------------------------------------


def _stamps(channel: Channel, clock_is_given: bool) -> Iterator[Finding]:
    name, time_s = channel.name, channel.time_s
    count = len(time_s)
    if count == 0:
        yield Finding(name, "empty", 0.0, 0.0, 0.0, "", "there is no sample", FATAL)
        return
    finite = time_s[np.isfinite(time_s)]
    if len(finite) < count:
        missing = count - len(finite)
        first = float(finite[0]) if len(finite) else 0.0
        yield Finding(name, "no_stamp", first, first, missing, "samples", f"{missing} stamps are not numbers")
    if len(finite) < 2:
        place = float(finite[0]) if len(finite) else 0.0
        yield Finding(name, "single_sample", place, place, 1.0, "samples", "there is one sample only", FATAL)
        return
    steps = np.diff(finite)
    if not steps.any():
        text = f"all {len(finite)} samples are at {finite[0]:g} s"
        yield Finding(name, "one_instant", float(finite[0]), float(finite[0]), 0.0, "s", text, FATAL)
        return
    back = np.flatnonzero(steps < 0.0)
    overruns = [place for place, _ in wraps.of_clock(finite)]
    for place in overruns[:NAMED_PLACES]:
        size = -float(steps[place])
        text = f"the clock's counter runs over: {size:.6g} s back"
        yield Finding(name, "stamp_wrap", float(finite[place]), float(finite[place + 1]), size, "s", text)
    back = np.setdiff1d(back, overruns)
    if len(back):
        size = -float(steps[back].min())
        text = f"stamps go back {len(back)} times, by up to {size:.6g} s"
        yield Finding(name, "reversed_stamps", float(finite[back[0]]), float(finite[back[-1]]), size, "s", text)
    same = np.flatnonzero(steps == 0.0)
    if len(same):
        text = f"{len(same)} stamps come twice"
        ends = float(finite[same[0]]), float(finite[same[-1]])
        yield Finding(name, "duplicate_stamps", *ends, len(same), "samples", text)
    if len(back) or overruns:  # gaps are those that remain after sorting the samples
        finite = wraps.counted_on(finite)
        finite = finite[order.of(finite, np.zeros(len(finite))).kept]
        steps = np.diff(finite)
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    yield from _gaps(name, finite, steps, usual)
    states = np.all(channel.value == np.round(channel.value))  # numbers of states are written when they change
    if usual > LONGEST_STEP_S and len(finite) >= FEWEST and not states:
        text = f"samples are {usual:.4g} s apart"
        severity = NOTE if clock_is_given else WARNING
        if not clock_is_given:
            text += ": the stamps are probably in ms, or readings were taken one by one (--time-unit s: they are in s)"
        yield Finding(name, "slow_samples", float(finite[0]), float(finite[-1]), usual, "s", text, severity)


def _gaps(name: str, time_s: Array, steps: Array, usual: float) -> Iterator[Finding]:
    places = np.flatnonzero(steps > GAP_STEPS * usual) if usual > 0.0 else np.array([], dtype=int)
    if len(places) > NAMED_PLACES:
        longest = places[np.argmax(steps[places])]
        text = (
            f"{len(places)} gaps of more than {GAP_STEPS * usual:.4g} s, {float(steps[places].sum()):.4g} s in all; "
            f"the longest is {float(steps[longest]):.4g} s at {float(time_s[longest]):.4g} s"
        )
        ends = float(time_s[places[0]]), float(time_s[places[-1] + 1])
        yield Finding(name, "gap", *ends, float(steps[longest]), "s", text, NOTE)
        return
    for place in places:
        text = f"no sample for {float(steps[place]):.4g} s, usual are {usual:.4g} s"
        yield Finding(name, "gap", float(time_s[place]), float(time_s[place + 1]), float(steps[place]), "s", text)


# --- values of one channel ----------------------------------------------------------------------------------


def _not_finite(channel: Channel) -> Iterator[Finding]:
    wrong = np.flatnonzero(~np.isfinite(channel.value))
    if len(wrong):
        ends = [float(t) if math.isfinite(t) else 0.0 for t in channel.time_s[wrong[[0, -1]]]]
        text = f"{len(wrong)} of {len(channel.value)} values are not numbers"
        worst = FATAL if len(channel.value) - len(wrong) < 2 else WARNING
        yield Finding(channel.name, "not_finite", ends[0], ends[1], float(len(wrong)), "samples", text, worst)


def _values(channel: Channel, all_channels: dict[str, Channel]) -> Iterator[Finding]:
    value, time_s = channel.value, channel.time_s
    if np.ptp(value) == 0.0:
        text = f"it is {value[0]:.6g} all the time"
        yield Finding(channel.name, "constant", float(time_s[0]), float(time_s[-1]), 0.0, channel.unit, text, NOTE)
        return
    yield from _size(channel)
    overruns = wraps_of(channel)
    for place in overruns.places[:NAMED_PLACES]:
        size = abs(float(value[place + 1] - value[place]))
        text = f"it jumps by {channel.shown(size)} against its motion: {overruns.meaning}"
        yield Finding(
            channel.name, "wrap", float(time_s[place]), float(time_s[place + 1]), size, channel.unit, text
        )  # fmt: skip
    yield from _spikes(channel, overruns.places)
    yield from _stuck(channel, all_channels)
    yield from _saturation(channel)
    yield from _quantised(channel)


def _size(channel: Channel) -> Iterator[Finding]:
    top = float(np.abs(channel.value).max())
    ends = float(channel.time_s[0]), float(channel.time_s[-1])
    typical = float(np.median(np.abs(channel.value)))
    if top < SMALLEST:
        text = f"values up to {channel.shown(top, 4)}: below what any instrument shows"
        yield Finding(channel.name, "wrong_unit", *ends, top, channel.unit, text)
    for end, largest, rather in LARGEST:
        if channel.name.endswith(end) and typical > largest:
            text = f"values around {channel.shown(typical, 4)}: they are probably {rather}"
            yield Finding(channel.name, "wrong_unit", *ends, typical, channel.unit, text)
    if channel.unit == "rad" and any(word in channel.name for word in JOINTS) and "motor" not in channel.name:
        if top > LARGEST_JOINT_RAD:
            text = f"a joint's angle of {top:.4g} rad is more than a turn: it is probably in degrees or counts"
            yield Finding(channel.name, "wrong_unit", *ends, top, "rad", text)


def wraps_of(channel: Channel) -> wraps.Wraps:
    """Places where the channel's integer overflows; the channel's samples are in order and finite."""
    return wraps.of(channel.value, channel.unit, (lattice_step(channel.value), channel.resolution))


def spike_places(value: Array) -> NDArray[np.intp]:
    """Samples far from both neighbours, which agree with each other."""
    if len(value) < FEWEST:
        return np.array([], dtype=np.intp)
    left, right = value[1:-1] - value[:-2], value[1:-1] - value[2:]
    size = np.minimum(np.abs(left), np.abs(right))
    usual = max(_usual(np.abs(value[2:] - 2.0 * value[1:-1] + value[:-2])), _usual(np.abs(np.diff(value))))
    far = (left * right > 0.0) & (size > SPIKE_STEPS * usual) & (np.abs(left - right) < 0.35 * size)
    return np.flatnonzero(far & (size > 4.0 * lattice_step(value))) + 1


def _usual(sizes: Array) -> float:
    """A size that most do not exceed: the 90th percentile, so that a channel mostly at rest is not all spikes."""
    return float(np.percentile(sizes, 90.0))


def _spikes(channel: Channel, overruns: Sequence[int]) -> Iterator[Finding]:
    places = np.array([place for place in spike_places(channel.value) if place not in overruns], dtype=int)
    if not len(places):
        return
    value, time_s = channel.value, channel.time_s
    sizes = value[places] - 0.5 * (value[places - 1] + value[places + 1])
    step = lattice_step(np.delete(value, places))
    ends = float(time_s[places[0]]), float(time_s[places[-1]])
    worst = float(sizes[np.argmax(np.abs(sizes))])
    if step > 0.0:
        # moving neighbours blur the size by a few steps, little compared with a high bit
        powers = np.round(np.log2(np.abs(sizes) / step))
        blur = np.abs(value[places + 1] - value[places - 1]) + 2.0 * step
        if np.all(np.abs(np.abs(sizes) - step * 2.0**powers) <= blur) and powers.min() >= 3:
            bits = ", ".join(str(int(each)) for each in sorted(set(powers))[:8])
            text = f"{len(places)} single values are wrong by one bit ({bits}) of steps of {channel.shown(step, 4)}"
            yield Finding(channel.name, "bit_flip", *ends, abs(worst), channel.unit, text)
            return
    are = "value is" if len(places) == 1 else "values are"
    text = f"{len(places)} single {are} off, by up to {channel.shown(abs(worst), 4)}"
    yield Finding(channel.name, "spike", *ends, abs(worst), channel.unit, text)


def equal_runs(value: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """(first sample, length) of every stretch of equal values."""
    starts = np.flatnonzero(np.concatenate(([True], np.diff(value) != 0.0)))
    return starts, np.diff(np.concatenate((starts, [len(value)])))


def _stuck(channel: Channel, all_channels: dict[str, Channel]) -> Iterator[Finding]:
    """The longest stretch of one value, when it is far longer than all others and other channels move in it.

    A second sensor of the same motion that is constant too indicates rest: friction holds, whatever the drive does.
    """
    starts, lengths = equal_runs(channel.value)
    longest = int(np.argmax(lengths))
    length = int(lengths[longest])
    rest = np.delete(channel.value, slice(starts[longest] + 1, starts[longest] + length))
    if len(lengths) < 10 or _is_held(rest):
        return
    others = np.delete(lengths, longest)
    if length < STUCK_SAMPLES or length < STUCK_RATIO * others.max():
        return
    begin, end = channel.time_s[starts[longest]], channel.time_s[starts[longest] + length - 1]
    partners = {name for pair in TOGETHER if channel.name in pair for name in pair} & set(all_channels)
    if any(_rests(all_channels[name], begin, end) for name in partners - {channel.name}):
        return
    moving = []
    for other in all_channels.values():
        warm = other.unit in WARMTHS and channel.unit not in WARMTHS  # a machine at rest cools and warms as well
        if other.name != channel.name and not _is_held(other.value) and not warm and _moves(other, begin, end):
            moving.append(other.name)
    if moving:
        value = float(channel.value[starts[longest]])
        stays = f"it stays at {channel.shown(value)} for {end - begin:.4g} s while "
        stays += f"{', '.join(moving[:3])} {'moves' if len(moving) == 1 else 'move'}"
        where = (float(begin), float(end), float(end - begin), "s")
        if value == 0.0 and all(_is_small(all_channels[name], begin, end) for name in moving):
            text = f"{stays} little: friction or a dead zone may hold it"
            yield Finding(channel.name, "at_rest", *where, text, NOTE)
        else:
            yield Finding(channel.name, "stuck", *where, stays)


def _is_small(channel: Channel, begin: float, end: float) -> bool:
    """True when within these stamps the channel is far below its largest value, of either sign."""
    inside = channel.value[(channel.time_s > begin) & (channel.time_s < end)]
    return bool(np.max(np.abs(inside)) < SMALL_PART * np.max(np.abs(channel.value)))


def _moves(channel: Channel, begin: float, end: float) -> bool:
    """True when the channel covers a part of its range within these stamps, and not as noise does."""
    inside = channel.value[(channel.time_s > begin) & (channel.time_s < end)]
    if len(inside) <= 3 or np.ptp(inside) <= MOVES_PART * np.ptp(channel.value):
        return False
    return bool(np.var(inside) > MOVES_RATIO * 0.5 * np.mean(np.diff(inside) ** 2))


def _rests(channel: Channel, begin: float, end: float) -> bool:
    """True when the channel has samples within these stamps and does not move."""
    count = np.count_nonzero((channel.time_s > begin) & (channel.time_s < end))
    return bool(count >= FEWEST) and not _moves(channel, begin, end)


def _is_held(value: Array) -> bool:
    """True for a command or a state: most of its steps are zero."""
    return bool(np.mean(np.diff(value) == 0.0) > FLAT_PART)


def _saturation(channel: Channel) -> Iterator[Finding]:
    """Stretches at the largest or smallest value that begin at speed: a turning point begins slowly."""
    value, time_s = channel.value, channel.time_s
    starts, lengths = equal_runs(value)
    if len(lengths) < 20 or np.mean(np.diff(value) == 0.0) > 0.9 or len(np.unique(value)) < LEVELS:
        return
    step = lattice_step(value)
    usual = float(np.median(np.abs(np.diff(value))[np.diff(value) != 0.0]))
    for limit in (float(value.min()), float(value.max())):
        runs = [k for k in range(1, len(starts)) if value[starts[k]] == limit and lengths[k] >= CLIPPED_SAMPLES]
        fast = [k for k in runs if abs(value[starts[k]] - value[starts[k] - 1]) > max(3.0 * step, 0.3 * usual)]
        count = int(sum(lengths[k] for k in runs))
        if len(fast) < CLIPPED_RUNS or len(fast) < 0.5 * len(runs) or _rests_at(value, limit):
            continue
        ends = float(time_s[starts[fast[0]]]), float(time_s[starts[fast[-1]] + lengths[fast[-1]] - 1])
        text = f"{count} values are cut off at {channel.shown(limit)}, in {len(runs)} stretches"
        if channel.limits_are_true:
            text = f"{count} values are at the limit {channel.shown(limit)}, which is assumed to be a true one"
        severity = NOTE if channel.limits_are_true else WARNING
        yield Finding(channel.name, "saturation", *ends, limit, channel.unit, text, severity)


def _quantised(channel: Channel) -> Iterator[Finding]:
    """A motion whose derivative from sample to sample is mostly the steps of its own values.

    Rounding to steps q adds noise of q / sqrt(12) to each value, and of q / (sqrt(6) dt) to a derivative. It counts
    where other noise is not larger: that would hide the steps.
    """
    if channel.unit not in MOTIONS:
        return
    step, sample_s = lattice_step(channel.value), float(np.median(np.diff(channel.time_s)))
    bends = float(np.sqrt(np.mean(np.diff(channel.value, 2) ** 2)))
    rounding, seen = step / math.sqrt(12.0), bends / math.sqrt(6.0)
    if not step > 0.0 or not sample_s > 0.0 or not QUANTISED * seen <= rounding <= seen / QUANTISED:
        return
    noise = step / (math.sqrt(6.0) * sample_s)
    rate = float(np.std(_smooth(np.gradient(channel.value, channel.time_s))))
    if not noise > DERIVATIVE_NOISE * rate:
        return
    ends = float(channel.time_s[0]), float(channel.time_s[-1])
    text = (
        f"its values are in steps of {channel.shown(step, 4)}: from sample to sample that is {noise:.3g} "
        f"{channel.unit}/s of noise in its derivative, which is {rate:.3g} {channel.unit}/s in all"
    )
    yield Finding(channel.name, "quantised", *ends, step, channel.unit, text, NOTE)


def _rests_at(value: Array, limit: float) -> bool:
    """True when the value is there most of the time: a resting value, not a limit."""
    return bool(np.mean(value == limit) > 0.5)


# --- channels against each other ----------------------------------------------------------------------------


def _between(channels: dict[str, Channel], motions: Sequence[tuple[str, str]]) -> Iterator[Finding]:
    for channel in channels.values():
        yield from _clock(channel)
    yield from _noise(channels)
    for angle, rate in dict.fromkeys(motions):
        if angle in channels and rate in channels:
            yield from _derivative(channels[angle], channels[rate])
    for first, second in REDUNDANT:
        if first in channels and second in channels:
            late = lag_s(channels[first], channels[second])
            if late is not None:
                yield from _lag(channels[first], channels[second], late)


def _noise(channels: dict[str, Channel]) -> Iterator[Finding]:
    """Channels that are white noise and have nothing in common with any other; all of them, where rows are disordered.

    White noise may drive a motor: then the motor's channels correlate with it, within some samples.
    """
    white = [each for each in channels.values() if _is_white(each)]
    if len(white) > 1 and len(white) == len([each for each in channels.values() if np.ptp(each.value) > 0.0]):
        text = "every channel jumps from sample to sample as white noise does: nothing in it moves"
        ends = float(white[0].time_s[0]), float(white[0].time_s[-1])
        yield Finding(white[0].name, "noise", *ends, 0.0, "", text)
        return
    for channel in white:
        others = [each for each in channels.values() if each.name != channel.name and np.ptp(each.value) > 0.0]
        if others and not any(_have_in_common(channel, other) for other in others):
            text = "it is noise from sample to sample, and nothing of it is in any other channel"
            yield Finding(channel.name, "noise", float(channel.time_s[0]), float(channel.time_s[-1]), 0.0, "", text)


def _is_white(channel: Channel) -> bool:
    value = channel.value
    if len(value) < FEWEST_OF_NOISE or not np.var(value) > 0.0 or not channel.unit or channel.unit in WARMTHS:
        return False
    return bool(0.5 * np.mean(np.diff(value) ** 2) > WHITE * np.var(value))


def _have_in_common(channel: Channel, other: Channel) -> bool:
    """True when a white channel correlates with another one or its differences, at some lag."""
    value = (channel.value - channel.value.mean()) / channel.value.std()
    beside = np.interp(channel.time_s, other.time_s, other.value)
    for shown in (beside, np.gradient(beside)):
        if not shown.std() > 0.0:
            continue
        shown = (shown - shown.mean()) / shown.std()
        for lag in range(-COMMON_LAGS, COMMON_LAGS + 1):
            rows = len(value) - abs(lag)
            if abs(float(value[max(0, -lag) :][:rows] @ shown[max(0, lag) :][:rows])) > COMMON * math.sqrt(rows):
                return True
    return False


def _clock(channel: Channel) -> Iterator[Finding]:
    """A channel that is itself a clock, against the stamps."""
    if channel.unit != "s" or len(channel.value) < FEWEST or not (np.diff(channel.value) >= 0.0).all():
        return
    span = channel.time_s[-1] - channel.time_s[0]
    slope, offset = np.polyfit(channel.time_s - channel.time_s[0], channel.value, 1)
    if not 0.99 < slope < 1.01:
        return
    left = channel.value - slope * (channel.time_s - channel.time_s[0]) - offset
    # uncertainty of a straight line through n stamps with this scatter
    uncertain = float(left.std()) * math.sqrt(12.0 / len(left)) / span
    ppm = (slope - 1.0) * 1e6
    if abs(ppm) > max(DRIFT_PPM, 5e6 * uncertain):
        text = f"its clock runs {abs(ppm):.0f} ppm {'fast' if ppm > 0 else 'slow'} against the stamps"
        ends = float(channel.time_s[0]), float(channel.time_s[-1])
        yield Finding(channel.name, "clock_drift", *ends, ppm, "ppm", text)


def _derivative(angle: Channel, rate: Channel) -> Iterator[Finding]:
    """A rate against the derivative of its angle: the factor between them, and the lag."""
    slopes = np.gradient(angle.value, angle.time_s)
    derivative = dataclasses.replace(angle, value=_smooth(slopes))
    usual = float(np.median(np.diff(angle.time_s)))
    turned = dataclasses.replace(rate, value=-rate.value)
    late = lag_s(derivative, rate)
    shift = late if late is not None else (lag_s(derivative, turned) or 0.0)
    inside = (rate.time_s - shift > angle.time_s[0]) & (rate.time_s - shift < angle.time_s[-1])
    if inside.sum() < FEWEST:
        return
    expected = np.interp(rate.time_s[inside] - shift, derivative.time_s, derivative.value)
    given = rate.value[inside]
    if expected.std() == 0.0 or given.std() == 0.0:
        return
    alike = float(np.corrcoef(expected, given)[0, 1])
    ends = float(rate.time_s[inside][0]), float(rate.time_s[inside][-1])
    if abs(alike) < ALIKE:
        return
    factor = float(given.std() / expected.std()) * (1.0 if alike > 0.0 else -1.0)
    for slope, meaning in SLOPES.items():
        if abs(factor / slope - 1.0) < SLOPE_TOLERANCE:
            text = f"it is {factor:.4g} times the derivative of {angle.name}: {meaning}"
            yield Finding(rate.name, "wrong_unit", *ends, factor, "", text)
            return
    if abs(factor - 1.0) > 0.2:
        text = f"it is {factor:.4g} times the derivative of {angle.name}: a gear, or another unit"
        yield Finding(rate.name, "wrong_unit", *ends, factor, "", text)
        return
    if late is not None and abs(late) > usual:
        yield from _lag(derivative, rate, late)


def _smooth(value: Array) -> Array:
    """The mean of five neighbours, which causes no shift."""
    if len(value) < FEWEST:
        return value
    return np.convolve(np.pad(value, 2, mode="edge"), np.full(5, 0.2), mode="valid")


def _lag(first: Channel, second: Channel, late: float) -> Iterator[Finding]:
    usual = float(np.median(np.diff(second.time_s)))
    base = float(np.median(np.diff(first.time_s)))
    if abs(late) <= LAG_STEPS * max(usual, base):
        return
    text = f"it comes {abs(late) * 1e3:.3g} ms {'after' if late > 0.0 else 'before'} {first.name}"
    ends = float(second.time_s[0]), float(second.time_s[-1])
    yield Finding(second.name, "lag", *ends, late, "s", text)
    drift = _drift(first, second)
    if drift is not None:
        text = f"its lag against {first.name} changes by {drift * 1e6:.0f} us per second: their clocks differ"
        yield Finding(second.name, "clock_drift", *ends, drift * 1e6, "ppm", text)


def lag_s(first: Channel, second: Channel) -> float | None:
    """Delay of the second channel after the first, in s; None when they are not the same motion.

    The maximum of their cross-correlation, between samples by a parabola.
    """
    if min(len(first.value), len(second.value)) < FEWEST:
        return None
    step = min(float(np.median(np.diff(first.time_s))), float(np.median(np.diff(second.time_s))))
    begin, end = _longest_stretch(first, second)
    if not step > 0.0 or (end - begin) / step < FEWEST or (end - begin) / step > 5e6:
        return None
    grid = np.arange(begin, end, step)
    a = np.interp(grid, first.time_s, first.value)
    b = np.interp(grid, second.time_s, second.value)
    a, b = a - a.mean(), b - b.mean()
    longest = min(int(LONGEST_LAG_S / step), len(a) // 4)
    wide = 1 << (len(a) + longest).bit_length()
    product = np.fft.irfft(np.fft.rfft(b, wide) * np.conj(np.fft.rfft(a, wide)), wide)
    shifts = np.arange(-longest, longest + 1)
    # each shift uses its own overlap: otherwise the shorter overlap of larger shifts biases the result towards zero
    squares = [np.concatenate(([0.0], np.cumsum(each * each))) for each in (a, b)]
    ahead, behind = np.maximum(shifts, 0), np.maximum(-shifts, 0)
    count = len(a)
    energy_a = squares[0][count - ahead] - squares[0][behind]
    energy_b = squares[1][count - behind] - squares[1][ahead]
    sizes = np.sqrt(energy_a * energy_b)
    if not (sizes > 0.0).all():
        return None
    values = product[shifts] / sizes
    best = int(np.argmax(values))
    if values[best] < ALIKE or best in (0, len(values) - 1):
        return None
    low, mid, high = values[best - 1 : best + 2]
    bend = low - 2.0 * mid + high
    part = 0.5 * (low - high) / bend if bend < 0.0 else 0.0
    return float((shifts[best] + part) * step)


def _longest_stretch(first: Channel, second: Channel) -> tuple[float, float]:
    """Begin and end of the longest time without a gap in either: across a gap, straight lines would be compared."""
    begin, end = max(first.time_s[0], second.time_s[0]), min(first.time_s[-1], second.time_s[-1])
    edges = [begin, end]
    for time_s in (first.time_s, second.time_s):
        steps = np.diff(time_s)
        for place in np.flatnonzero(steps > GAP_STEPS * np.median(steps)):
            edges += [time_s[place], time_s[place + 1]]
    edges = sorted(edge for edge in edges if begin <= edge <= end)
    pieces = [(low, high) for low, high in zip(edges[:-1], edges[1:], strict=True) if high > low]
    sound = [piece for piece in pieces if not _is_gap(*piece, first, second)]
    low, high = max(sound, key=lambda piece: piece[1] - piece[0], default=(begin, begin))
    return float(low), float(high)


def _is_gap(low: float, high: float, *channels: Channel) -> bool:
    """True when one of the channels has no sample between."""
    return any(not ((channel.time_s > low) & (channel.time_s < high)).any() for channel in channels)


def _drift(first: Channel, second: Channel) -> float | None:
    """Change of the lag in s per s, when five parts of the recording agree on it; otherwise None."""
    begin, end = max(first.time_s[0], second.time_s[0]), min(first.time_s[-1], second.time_s[-1])
    cuts = np.linspace(begin, end, 6)
    lags, middles = [], []
    for low, high in zip(cuts[:-1], cuts[1:], strict=True):
        parts = [_part(channel, low, high) for channel in (first, second)]
        if min(len(part.value) for part in parts) < FEWEST:
            return None
        late = lag_s(parts[0], parts[1])
        if late is None:
            return None
        lags.append(late)
        middles.append(0.5 * (low + high))
    slope, offset = np.polyfit(middles, lags, 1)
    left = np.array(lags) - slope * np.array(middles) - offset
    error = math.sqrt(float(left @ left) / 3.0) / math.sqrt(float(np.var(middles)) * 5.0)  # two of five are fitted
    return float(slope) if abs(slope) > max(DRIFT_PPM * 1e-6, 6.0 * error) else None


def _part(channel: Channel, low: float, high: float) -> Channel:
    inside = (channel.time_s >= low) & (channel.time_s <= high)
    return dataclasses.replace(channel, time_s=channel.time_s[inside], value=channel.value[inside])
