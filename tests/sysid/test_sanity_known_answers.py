"""Each check of data at its limits, from both sides, on rows made for it; what each unit's mistake looks like."""

import dataclasses
import math

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import repairs, sanity
from ranger_sim.sysid import wraps as overruns
from ranger_sim.sysid.dataset import Channel, Dataset

T = np.arange(2000) * 0.004
WAVE = 0.8 * np.sin(2.0 * math.pi * 0.7 * T)
RATE = 0.8 * 2.0 * math.pi * 0.7 * np.cos(2.0 * math.pi * 0.7 * T)


def channel(name, value, unit, time_s=T):
    return Channel(name, unit, np.array(time_s, dtype=float), np.array(value, dtype=float))


def of(kind, *channels):
    """Findings of a kind in channels that stand together."""
    data = Dataset("data", {each.name: each for each in channels})
    return [each for each in sanity.inspect(data) if each.kind == kind]


def wave(**more):
    return channel("current_A", WAVE, "A", **more)


# ---- stamps


@pytest.mark.parametrize(("gap_steps", "told"), [(5.0, False), (5.2, True)])
def test_a_gap_is_more_than_five_usual_steps(gap_steps, told):
    t = T + (gap_steps - 1.0) * 0.004 * (T >= T[1000])
    found = of("gap", wave(time_s=t))
    assert bool(found) == told
    if told:
        assert found[0].start_s == pytest.approx(T[999]) and found[0].end_s == pytest.approx(t[1000])
        assert found[0].size == pytest.approx(gap_steps * 0.004)


def test_more_than_six_gaps_are_one_finding_with_the_longest():
    for count in (6, 7):
        t = T.copy()
        for n in range(count):
            t += (0.1 + 0.01 * n) * (T >= T[200 * (n + 1)])
        found = of("gap", wave(time_s=t))
        assert len(found) == (6 if count == 6 else 1)
    (one,) = found
    assert one.size == pytest.approx(0.164) and one.severity == "note"
    assert one.text.startswith("7 gaps of more than 0.02 s, 0.938 s in all; the longest is 0.164 s at ")
    assert one.start_s == pytest.approx(t[199]) and one.end_s == pytest.approx(t[1400])


@pytest.mark.parametrize(
    ("span", "first", "last", "wraps"),
    [(65.536, 64.0, 0.0, True), (65.536, 64.0, 1.4, False), (20.0, 18.0, 0.0, False)],
    ids=["to the begin", "far behind the begin", "too short a counter"],
)
def test_a_counter_of_the_clock_runs_over_to_next_to_nothing(span, first, last, wraps):
    t = np.concatenate((np.linspace(first, span - 0.004, 1000), last + 0.004 * np.arange(1000)))
    assert overruns.of_clock(t) == ([(999, span)] if wraps else [])
    assert bool(of("stamp_wrap", wave(time_s=t))) == wraps
    assert bool(of("reversed_stamps", wave(time_s=t))) != wraps


@pytest.mark.parametrize(("step_s", "told"), [(0.49, False), (0.51, True)])
def test_samples_half_a_second_apart_are_doubted(step_s, told):
    t = step_s * np.arange(100)
    assert bool(of("slow_samples", channel("current_A", np.sin(t), "A", t))) == told
    states = channel("walk_state", np.arange(100) % 3, "", t)  # numbers of states are written when they change
    assert not of("slow_samples", states)


def test_stamps_and_values_that_are_not_numbers_are_counted():
    t, value = T.copy(), WAVE.copy()
    t[[3, 5]] = math.nan
    value[10:13] = math.inf
    found = of("no_stamp", wave(time_s=t)) + of("not_finite", channel("current_A", value, "A"))
    assert [(each.kind, each.size) for each in found] == [("no_stamp", 2), ("not_finite", 3.0)]
    assert (found[1].start_s, found[1].end_s) == (pytest.approx(T[10]), pytest.approx(T[12]))
    value[2:] = math.nan
    assert of("not_finite", channel("current_A", value, "A"))[0].severity == "warning"  # two are left
    value[1] = math.nan
    fatal = of("not_finite", channel("current_A", value, "A"))
    assert fatal[0].severity == "fatal"
    with pytest.raises(UserError, match=r"data: current_A: 1999 of 2000 values are not numbers"):
        sanity.stop_if_fatal("data", fatal)


# ---- values


@pytest.mark.parametrize(
    ("name", "unit", "largest", "rather"),
    [
        ("current_A", "A", 200.0, "mA"),
        ("voltage_V", "V", 1000.0, "mV"),
        ("winding_C", "C", 200.0, "K"),
        ("torque_Nm", "N m", 2000.0, "mNm or N mm"),
    ],
)
def test_values_beyond_such_machines_are_probably_of_a_smaller_unit(name, unit, largest, rather):
    for size, told in ((0.99, False), (1.01, True)):
        sine = size * largest + 1e-3 * largest * np.sin(7.0 * T)  # around this size all the time
        found = of("wrong_unit", channel(name, sine, unit))
        assert [rather in each.text for each in found] == [True] * told


def test_a_joint_turns_no_further_than_once():
    for size, told in ((6.2, 0), (6.4, 1)):
        for name in ("hip_angle_rad", "joint_angle_rad", "outer_ankle_angle_rad", "outer_leg_angle_rad"):
            assert len(of("wrong_unit", channel(name, size * WAVE / 0.8, "rad"))) == told
        assert not of("wrong_unit", channel("hip_motor_angle_rad", size * WAVE / 0.8, "rad"))


@pytest.mark.parametrize(("size", "told"), [(0.9e-12, True), (1.1e-12, False)])
def test_what_no_instrument_shows_is_of_another_unit(size, told):
    assert bool(of("wrong_unit", channel("current_A", size * WAVE / 0.8, "A"))) == told


# what somebody did wrong: (to the rate, to the angle, what is told)
MISTAKES = [
    (np.degrees, lambda a: a, "the rate is in deg/s"),
    (lambda w: w, np.degrees, "the angle is in degrees"),
    (lambda w: w * 60.0 / (2.0 * math.pi), lambda a: a, "the rate is in rpm"),
    (lambda w: w, lambda a: a * 60.0 / (2.0 * math.pi), "9.5 times smaller"),
    (lambda w: 1000.0 * w, lambda a: a, "the angle is in thousands, or the stamps are in ms"),
    (lambda w: w / 1000.0, lambda a: a, "the rate is in thousands"),
    (lambda w: 1e6 * w, lambda a: a, "stamps are in us"),
    (lambda w: w / 1e6, lambda a: a, "stamps are in us"),
    (np.negative, lambda a: a, "the other way round"),
    (lambda w: 6.0 * w, lambda a: a, "rpm and the angle in degrees"),
    (lambda w: 1.3 * w, lambda a: a, "a gear, or another unit"),
]


@pytest.mark.parametrize(("to_rate", "to_angle", "told"), MISTAKES)
def test_each_mistake_of_units_between_an_angle_and_its_rate_is_reported_by_its_factor(to_rate, to_angle, told):
    found = of(
        "wrong_unit",
        channel("motor_angle_rad", to_angle(WAVE), "rad"),
        channel("motor_rate_rad_per_s", to_rate(RATE), "rad/s"),
    )
    assert len(found) == 1 and told in found[0].text and found[0].channel == "motor_rate_rad_per_s"
    expected = to_rate(np.array([1.0]))[0] / to_angle(np.array([1.0]))[0]
    assert found[0].size == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(("factor", "told"), [(1.0, False), (1.19, False), (1.22, True), (0.82, False), (0.78, True)])
def test_a_rate_may_be_a_fifth_off(factor, told):
    rate = channel("motor_rate_rad_per_s", factor * RATE, "rad/s")
    assert bool(of("wrong_unit", channel("motor_angle_rad", WAVE, "rad"), rate)) == told


def ramp(span, step, count=2000, start=0.0):
    return (start + step * np.arange(count)) % span


def places(value, unit="rad", quantum=0.001):
    return list(overruns.of(value, unit, (quantum,)).places)


def test_a_counter_runs_over_against_a_motion_that_goes_on():
    assert places(ramp(6.4, 0.013)) == [n for n in range(1999) if (n + 1) * 0.013 // 6.4 > n * 0.013 // 6.4]
    assert len(places(-ramp(6.4, 0.013))) == 4
    step = np.concatenate((0.01 * np.arange(100), 5.12 + 0.01 * np.arange(100)))  # with the motion: not a counter
    assert places(step, quantum=0.01) == []
    turned = np.concatenate((0.01 * np.arange(100), -5.12 - 0.01 * np.arange(100)))  # it goes on the other way
    assert places(turned, quantum=0.01) == []
    rests = np.concatenate((0.01 * np.arange(100), np.full(100, -5.12)))
    assert places(rests, quantum=0.01) == []
    for before, place in ((2, []), (3, [3])):  # of the motion on either side three steps are needed
        short = np.concatenate((0.01 * np.arange(before + 1), 0.01 * (before + 1) - 5.12 + 0.01 * np.arange(100)))
        assert places(short, quantum=0.01) == place
    wild = np.concatenate((np.cumsum(np.where(np.arange(100) % 2, 12.0, -11.7)), -60.0 + 0.3 * np.arange(100)))
    assert places(wild, quantum=0.01) == []


def test_a_spike_is_far_from_both_neighbours_that_agree():
    smooth = np.sin(0.01 * np.arange(1000))
    usual = float(np.percentile(np.abs(np.diff(smooth)), 90.0))
    for size, places in ((20.0, [500]), (-20.0, [500]), (6.0, [])):  # of twelve usual steps
        value = smooth.copy()
        value[500] += size * usual
        assert list(sanity.spike_places(value)) == places
    step = smooth + 20.0 * usual * (np.arange(1000) >= 500)  # its neighbours do not agree
    assert list(sanity.spike_places(step)) == []
    lopsided = smooth.copy()
    lopsided[500] += 40.0 * usual
    lopsided[501:] += 20.0 * usual
    assert list(sanity.spike_places(lopsided)) == []
    assert list(sanity.spike_places(np.array([0.0] * 14 + [9.0] + [0.0] * 14))) == []  # 29 samples are too few


def test_stretches_of_equal_values_have_a_begin_and_a_length():
    starts, lengths = sanity.equal_runs(np.array([1.0, 1.0, 2.0, 1.0, 1.0, 1.0]))
    assert (list(starts), list(lengths)) == ([0, 2, 3], [2, 1, 3])


@pytest.mark.parametrize("step", [1e-4, 0.25, 3.0])
def test_the_step_of_a_lattice_is_found_and_none_where_there_is_none(step):
    sine = np.round(200.0 * np.sin(0.01 * np.arange(3000))) * step + 7.0
    assert sanity.lattice_step(sine) == pytest.approx(step, rel=1e-6)
    assert sanity.lattice_step(generator(3, "no lattice").normal(0.0, 1.0, 3000)) == 0.0
    assert sanity.lattice_step(np.array([1.0, 2.0, 3.0, 1.0])) == 0.0  # three values are too few
    assert sanity.lattice_step(np.array([1.0, 2.0, 3.0, 4.0])) == pytest.approx(1.0)


@pytest.mark.parametrize(("samples", "told"), [(240, False), (260, True)])
def test_a_value_that_stands_far_longer_than_it_ever_does_is_stuck_while_others_move(samples, told):
    """Eight times the longest other stretch, of 32 samples here."""
    value = np.round(WAVE, 1)
    longest = max(sanity.equal_runs(value)[1])
    base = generator(5, "stuck").permutation(2000) * 1e-3
    base[100:132] = 5.0  # the longest other stretch
    base[500 : 500 + samples] = 7.0
    found = of("stuck", channel("voltage_V", base, "V"), wave())
    assert bool(found) == told and longest > 32
    if told:
        assert found[0].start_s == pytest.approx(T[500]) and found[0].size == pytest.approx(T[samples - 1])
        assert "while current_A move" in found[0].text
    still = channel("current_A", np.where((T > T[490]) & (T < T[800]), WAVE[490], WAVE), "A")
    told_of = [each.channel for each in of("stuck", channel("voltage_V", base, "V"), still)]
    assert "voltage_V" not in told_of  # nothing moves in it


def test_values_are_cut_off_where_they_are_entered_at_speed_twice_for_three_samples():
    triangle = 0.02 * np.abs((np.arange(2000) + 50) % 200 - 100) - 1.0  # ten times from 1 to -1, 0.02 a step
    triangle = triangle + 1e-3 * np.sin(13.0 * T)  # on no lattice
    low, high = channel("current_A", np.clip(triangle, -0.61, 9.0), "A"), np.clip(triangle, -9.0, 0.61)
    assert [each.size for each in of("saturation", low)] == [pytest.approx(-0.61)]
    (found,) = of("saturation", channel("current_A", high, "A"))
    count = int(np.count_nonzero(high == 0.61))
    assert found.text == f"{count} values are cut off at 0.61 A, in 10 stretches"
    assert found.start_s == pytest.approx(T[np.flatnonzero(high == 0.61)[0]], abs=0.81)
    both = of("saturation", channel("current_A", np.clip(triangle, -0.61, 0.71), "A"))
    assert [each.size for each in both] == [pytest.approx(-0.61), pytest.approx(0.71)]
    assert not of("saturation", channel("current_A", triangle, "A"))  # one sample at each turn
    assert not of("saturation", wave())  # a turning point is entered slowly
    for stretches, told in ((1, 0), (2, 1)):
        some = np.where(np.arange(2000) < 200 * stretches - 50, high, 0.5 * triangle)
        assert len(of("saturation", channel("current_A", some, "A"))) == told


def test_one_value_all_the_time_is_reported():
    (found,) = of("constant", channel("current_A", np.full(2000, 0.5), "A"))
    assert (found.severity, found.text) == ("note", "it is 0.5 all the time")


# ---- lags


@pytest.mark.parametrize("rows", [-30, -3, 0, 3, 30])
def test_a_lag_is_found_to_a_tenth_of_a_sample(rows):
    noise = generator(2, "lag").normal(0.0, 1.0, 2400)
    motion = np.convolve(noise, np.hanning(21), mode="same")
    first = channel("a", motion[200:2200], "rad")
    second = channel("b", motion[200 - rows : 2200 - rows], "rad")
    assert sanity.lag_s(first, second) == pytest.approx(rows * 0.004, abs=0.0004)
    assert sanity.lag_s(first, channel("c", noise[:2000], "rad")) is None
    assert sanity.lag_s(first, channel("d", np.zeros(2000), "rad")) is None


def test_channels_with_29_samples_have_no_lag():
    short = channel("a", WAVE[:29], "rad", T[:29])
    assert sanity.lag_s(short, wave()) is None


def test_doubts_are_kinds_that_say_the_data_are_others():
    loss = sanity.Finding("current_A", "not_finite", 0.0, 1.0, 200.0, "samples", "")
    stuck = dataclasses.replace(loss, kind="stuck", size=0.1)
    gap = dataclasses.replace(loss, kind="gap", size=900.0)
    assert sanity.doubts([loss, stuck, gap]) == [stuck]


# ---- what is asked for by name


def recording():
    return Dataset("data", {"a": channel("a", WAVE, "V"), "b": channel("b", RATE, "rad/s", T + 1.0)})


@pytest.mark.parametrize(
    ("unit", "factor", "zero", "si"),
    [("mV", 1e-3, 0.0, "V"), ("deg", math.pi / 180, 0.0, "rad"), ("K", 1.0, -273.15, "C")],
)
def test_values_in_another_unit_are_converted_and_that_is_reported(unit, factor, zero, si):
    found = repairs.converted(recording(), "a", unit)
    assert found["a"].value == pytest.approx(WAVE * factor + zero, rel=1e-12) and found["a"].unit == si
    (repair,) = found.repairs
    assert (repair.channel, repair.kind, repair.count) == ("a", "converted", 2000)
    assert np.array_equal(found["b"].value, RATE)


def test_no_unit_is_not_a_conversion():
    for unit in ("furlongs", " "):
        with pytest.raises(UserError, match="unknown unit"):
            repairs.converted(recording(), "a", unit)


def test_stamps_are_moved_later_and_values_by_a_constant():
    moved = repairs.shifted(recording(), "a", 0.02)
    assert moved["a"].time_s == pytest.approx(T + 0.02) and np.array_equal(moved["a"].value, WAVE)
    added = repairs.offset(moved, "b", -0.3)
    assert added["b"].value == pytest.approx(RATE - 0.3) and [each.kind for each in added.repairs] == [
        "shifted",
        "offset",
    ]
    assert [each.count for each in added.repairs] == [2000, 2000]


def test_a_time_is_cut_out_of_all_channels_both_ends_with_it():
    found = repairs.cut(recording(), T[500], T[1500])
    assert np.array_equal(found["a"].time_s, np.delete(T, slice(500, 1501)))
    assert np.array_equal(found["b"].value, np.delete(RATE, slice(250, 1251)))
    assert found.repairs[0].count == 1001 + 1001
    rest = repairs.cut(recording(), T[2], 1.0 + T[-3])
    assert len(rest["a"].value) == 2
    with pytest.raises(UserError, match="a has 1 samples outside"):
        repairs.cut(recording(), T[1], 1.0 + T[-3])


@pytest.mark.parametrize(("period", "moves"), [(6.0, False), (8.0, True), (20.0, True)])
def test_a_sine_of_more_than_six_samples_a_period_moves_and_a_faster_one_is_taken_for_noise(period, moves):
    """Its variance over half the mean square of differences is 1 / (1 - cos(360 / period)): 2 and 3.4, against 2.25."""
    n = np.arange(2400)
    other = channel("b", np.sin(2.0 * math.pi * n / period), "V", 0.004 * n)
    assert sanity._moves(other, 1.0, 9.0) == moves
    # and of a fifth of its range there must be more
    for part, there in ((0.19, False), (0.21, moves)):
        small = np.where((n > 260) & (n < 2200), part, 1.0) * other.value
        assert sanity._moves(channel("b", small, "V", 0.004 * n), 1.1, 8.7) == there


# ---- clocks


@pytest.mark.parametrize(
    ("ppm", "told"), [(99.0, False), (101.0, True), (-99.0, False), (-101.0, True), (9000.0, True)]
)
def test_a_clock_that_runs_off_by_more_than_a_hundred_parts_in_a_million_is_reported(ppm, told):
    found = of("clock_drift", channel("board_s", 3.0 + (1.0 + 1e-6 * ppm) * (T + 1.0), "s", T + 1.0))
    assert bool(found) == told
    if told:
        assert found[0].size == pytest.approx(ppm, abs=0.1) and found[0].unit == "ppm"
        assert (found[0].start_s, found[0].end_s) == (1.0, pytest.approx(1.0 + T[-1]))
        assert found[0].text == f"its clock runs {abs(ppm):.0f} ppm {'fast' if ppm > 0 else 'slow'} against the stamps"


@pytest.mark.parametrize("scatter_s", [4e-4, 8e-3])
def test_a_clock_s_drift_must_be_five_times_what_its_scatter_leaves_open(scatter_s):
    """A line through n stamps is known to its scatter times sqrt(12 / n) over the span."""
    ours = T[::40]
    noise = scatter_s * generator(6, "clock").normal(size=len(ours))
    shown = 1.002 * ours + noise
    assert np.all(np.diff(shown) >= 0.0)
    slope, offset = np.polyfit(ours, shown, 1)
    spread = float(np.std(shown - slope * ours - offset)) * math.sqrt(12.0 / len(ours)) / ours[-1]
    assert ((slope - 1.0) > 5.0 * spread) == (scatter_s == 4e-4)
    found = of("clock_drift", channel("board_s", shown, "s", ours))
    assert bool(found) == (scatter_s == 4e-4)


def test_what_is_not_a_clock_has_no_drift():
    assert not of("clock_drift", channel("time_s", 1.02 * T, "s"))  # another rate altogether
    assert not of("clock_drift", channel("time_s", -T, "s")) and not of(
        "clock_drift", channel("x_rad", 1.001 * T, "rad")
    )


def test_of_a_constant_channel_nothing_else_is_reported():
    data = Dataset("data", {"current_A": channel("current_A", np.full(2000, 500.0), "A")})
    assert [each.kind for each in sanity.inspect(data)] == ["constant"]
