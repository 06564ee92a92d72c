"""Channels at their own rates on one even time base, and strikes, on records small enough to be worked by hand."""

import numpy as np
import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.dataset import Channel, Dataset, Table
from ranger_sim.sysid.machines.walk import strikes, timebase
from ranger_sim.sysid.machines.walk.strikes import Strike


def channel(name, time_s, value):
    return Channel(name, "", np.asarray(time_s, dtype=float), np.asarray(value, dtype=float))


def even(carrying, *channels):
    dataset = Dataset("log", {each.name: each for each in channels})
    return timebase.even_table(dataset, [each.name for each in channels], carrying)


def every(step_s, until_s, start_s=0.0):
    return start_s + step_s * np.arange(round((until_s - start_s) / step_s) + 1)


@pytest.mark.parametrize(("step_s", "taken_s"), [(0.0005, 0.002), (0.003, 0.003), (0.02, 0.008)])
def test_the_step_is_the_carriers_own_between_2_and_8_ms(step_s, taken_s):
    t = every(step_s, 2.0)
    table = even(("a",), channel("a", t, 3.0 * t))
    assert table.step_s == pytest.approx(taken_s, rel=1e-9)
    assert table["a"] == pytest.approx(3.0 * table.time_s, abs=1e-9)
    assert table.runs == (slice(0, len(table)),)


def test_the_table_begins_and_ends_with_the_time_all_carriers_have():
    a, b = every(0.004, 2.0, 0.5), every(0.004, 1.7)
    table = even(("a", "b"), channel("a", a, a), channel("b", b, -b), channel("c", [0.0, 3.0], [0.0, 3.0]))
    assert (table.time_s[0], table.time_s[-1]) == (pytest.approx(0.5), pytest.approx(1.7))
    assert len(table) == 301
    assert table["c"] == pytest.approx(table.time_s, abs=1e-9)


def test_without_a_carrier_every_channel_is_one_but_numbers_of_states():
    a = every(0.004, 1.0)
    states = channel("walk_state", [0.3, 0.6], [1.0, 2.0])
    assert len(even(("x",), channel("a", a, a), states)) == 251
    with pytest.raises(UserError, match="have no time in common"):
        even(("x",), channel("a", a, a), channel("b", a + 2.0, a))


def test_twenty_steps_are_the_least_in_common():
    a = every(0.004, 1.0)
    assert len(even(("a", "b"), channel("a", a, a), channel("b", a + 0.919, a))) >= 20
    with pytest.raises(UserError, match="log: a, b have no time in common"):
        even(("a", "b"), channel("a", a, a), channel("b", a + 0.925, a))


def test_states_hold_until_the_next_and_the_first_one_before_it():
    t = every(0.004, 1.0)
    table = even(("a",), channel("a", t, t), channel("walk_state", [0.2, 0.6], [3.0, 5.0]))
    expected = np.where(table.time_s >= 0.6 - 1e-9, 5.0, 3.0)
    assert np.array_equal(table["walk_state"], expected)
    assert "walk_state fresh" not in table


def test_a_slow_channel_is_held_through_a_silence_and_flagged_where_it_was_measured():
    """Samples every 20 ms, then nothing for 200 ms: it holds until one usual step before the next sample."""
    t = every(0.004, 1.0)
    slow = np.concatenate((every(0.02, 0.4), every(0.02, 1.0, 0.6)))
    value = np.where(slow < 0.5, slow, slow + 1.0)
    table = even(("a",), channel("a", t, t), channel("b", slow, value))
    at = dict(zip(np.round(table.time_s, 3), table["b"], strict=True))
    assert at[0.4] == pytest.approx(0.4) and at[0.5] == pytest.approx(0.4) and at[0.58] == pytest.approx(0.4)
    assert at[0.592] == pytest.approx(0.4 + 0.6 * 1.2) and at[0.6] == pytest.approx(1.6)
    assert at[0.048] == pytest.approx(0.048)  # between two samples a straight way
    flags = dict(zip(np.round(table.time_s, 3), table["b fresh"], strict=True))
    assert {time for time, flag in flags.items() if flag} == {round(each, 3) for each in slow}
    assert "a fresh" not in table
    assert np.array_equal(timebase.freshness(table, "b"), table["b fresh"] == 1.0)


@pytest.mark.parametrize(("every_rows", "slow"), [(3, False), (4, True)])
def test_a_channel_is_slow_beyond_three_steps_of_the_base(every_rows, slow):
    t = every(0.004, 1.0)
    table = even(("a",), channel("a", t, t), channel("b", t[::every_rows], t[::every_rows]))
    assert ("b fresh" in table) == slow


def test_a_silence_in_which_a_carrier_moved_is_cut_out():
    """Beyond five of its own steps and 25 ms, and by more than 2.5 of its finest changes of 0.004."""
    t = every(0.004, 2.0)
    for gap_s, moved, cut in (
        (0.100, 1.0, True),
        (0.024, 1.0, False),  # bridged
        (0.100, 0.009, False),  # it stood still
        (0.100, 0.011, True),
    ):
        kept = (t <= 1.0) | (t >= 1.0 + gap_s - 1e-9)
        value = np.where(t <= 1.0, t, 1.0 + moved + (t - 1.0 - gap_s))
        table = even(("a",), channel("a", t[kept], value[kept]))
        assert len(table.runs) == (2 if cut else 1), (gap_s, moved)
        if cut:
            inside = (table.time_s > 1.0 + 1e-9) & (table.time_s < 1.0 + gap_s - 1e-9)
            assert not inside.any()
            # the end of the silence is a row or not, by the last bit of its stamp
            assert len(table) - (len(t) - round(gap_s / 0.004)) in (0, 1)
            first, second = table.runs
            assert table.time_s[first.stop - 1] == pytest.approx(1.0, abs=0.0041) and first.stop == second.start
            assert table.time_s[second.start] == pytest.approx(1.0 + gap_s, abs=0.0041)


def test_what_moves_in_silences_alone_leaves_hardly_any_time():
    t = np.concatenate([every(0.004, 0.028, start) for start in np.arange(0.0, 3.0, 0.5)])
    with pytest.raises(UserError, match="|".join(["a hardly ever arrive at the same time", "no time in common"])):
        even(("a",), channel("a", t[:16], 5.0 * t[:16]))


def test_without_flags_what_holds_or_goes_straight_was_not_measured():
    t = every(0.004, 1.0)
    held = np.repeat(np.arange(0.0, 60.0) ** 2, 5)[: len(t)]
    lines = np.interp(t, t[::5], np.sin(7.0 * t[::5]))
    noisy = np.sin(50.0 * t)
    table = Table(t, {"held": held, "lines": lines, "noisy": noisy, "still": np.ones(len(t))}, (slice(0, len(t)),))
    assert np.array_equal(np.flatnonzero(timebase.freshness(table, "held")), np.arange(5, len(t), 5))
    found = timebase.freshness(table, "lines")
    assert np.array_equal(np.flatnonzero(found[:-1]), np.arange(0, len(t) - 1, 5))
    assert timebase.freshness(table, "noisy").all() and timebase.freshness(table, "still").all()


# ---- strikes


STEP_S = 0.6


def walked(contacts=True, seconds=6.0, step_s=0.004, sway=0.4):
    """A walk whose inner legs swing as a sine of 1.2 s: they are ahead, positive, in the odd half periods."""
    t = step_s * np.arange(round(seconds / step_s))
    columns = {"hip_angle_rad": sway * np.sin(np.pi * t / STEP_S)}
    if contacts:
        phase = t % (2 * STEP_S)
        columns["inner_contact"] = ((phase >= 0.4) & (phase < 1.1)).astype(float)
        columns["outer_contact"] = ((phase >= 1.0) | (phase < 0.5)).astype(float)
    return Table(t, columns, (slice(0, len(t)),))


def test_contact_sensors_report_strikes_13_ms_late():
    """robot.md N4.9: 5.5 ms of counting, and the sole's rise."""
    found = strikes.find(walked())
    assert [each.leg for each in found] == [1, 0] * 5
    expected = [1.2 * number + late - 0.013 for number in range(5) for late in (0.4, 1.0)]
    assert [each.time_s for each in found] == pytest.approx(expected, abs=0.0041)
    assert {each.run for each in found} == {0}


def test_a_contact_with_the_legs_together_or_the_other_one_ahead_is_not_a_strike():
    """0.15 rad apart at the least, the touching leg ahead."""
    for sway, number in ((0.16, 10), (0.14, 0), (-0.4, 0)):
        table = walked(sway=sway)
        phase = table.time_s % (2 * STEP_S)
        table.columns["inner_contact"] = (np.abs(phase - 0.3) < 0.05).astype(float)  # at the top of the swing
        table.columns["outer_contact"] = (np.abs(phase - 0.9) < 0.05).astype(float)
        touched = strikes.find(table)
        at = abs(sway) * np.sin(np.pi * 0.252 / STEP_S)
        assert len(touched) == (number if at > 0.15 or number == 0 else 0)


def test_without_sensors_the_sharpest_jump_of_the_hips_rate_is_the_strike():
    """The hip swings to 0.4 rad and is turned round there at once: a triangle."""
    t = 0.004 * np.arange(1500)
    phase = (t / STEP_S + 0.5) % 2.0
    hip = 0.4 * (2.0 * np.abs(phase - 1.0) - 1.0)
    found = strikes.find(Table(t, {"hip_angle_rad": hip}, (slice(0, len(t)),)))
    turns = [(0.3 + 0.6 * n, n % 2) for n in range(10)]
    signs = [0 if hip[round(time / 0.004)] < 0 else 1 for time, _ in turns]
    inner = [each for each in found if 0.1 < each.time_s < 5.7]
    assert [each.leg for each in inner] == signs[: len(inner)]
    assert [each.time_s for each in inner] == pytest.approx([time for time, _ in turns][: len(inner)], abs=0.0081)


def test_swings_below_0_15_rad_and_runs_below_twenty_rows_have_no_strikes():
    assert strikes.find(walked(contacts=False, sway=0.149)) == []
    assert len(strikes.find(walked(contacts=False, sway=0.16))) >= 9
    table = walked(seconds=19 * 0.004)
    assert strikes.find(table) == []


def test_the_leg_that_struck_stands_until_the_other_one_strikes():
    table = walked()
    touches = [Strike(1.0, 1, 0), Strike(1.6, 0, 0), Strike(2.2, 1, 0), Strike(2.3, 0, 0), Strike(4.0, 1, 0)]
    stands, single = strikes.standing(table, touches, 0.15, 0.07)
    t = table.time_s
    # 0.1 s and 1.7 s are no steps
    expected = np.full(len(t), -1)
    expected[(t >= 1.0) & (t < 1.6)] = 1
    expected[(t >= 1.6) & (t < 2.2)] = 0
    assert np.array_equal(stands, expected)
    alone = ((t > 1.15) & (t < 1.53)) | ((t > 1.75) & (t < 2.13))
    assert np.array_equal(single, alone)


@pytest.mark.parametrize(
    ("second", "counts"),
    [
        (Strike(1.251, 0, 0), True),
        (Strike(1.249, 0, 0), False),
        (Strike(2.199, 0, 0), True),
        (Strike(2.201, 0, 0), False),
        (Strike(1.6, 1, 0), False),  # the same leg
        (Strike(1.6, 0, 1), False),  # beyond a gap
    ],
)
def test_a_step_lasts_from_a_quarter_to_1_2_s_of_one_run_and_legs_take_turns(second, counts):
    stands, single = strikes.standing(walked(), [Strike(1.0, 1, 0), second], 0.0, 0.0)
    assert (stands == 1).any() == counts and single.any() == counts


def test_rows_of_one_place_in_the_strides_have_one_number():
    table = walked()
    touches = [Strike(0.4, 1, 0), Strike(1.0, 0, 0), Strike(1.6, 1, 0), Strike(2.2, 0, 0)]
    stands, _ = strikes.standing(table, touches, 0.0, 0.0)
    found = strikes.places(table, touches, stands, 0.1, 0.06)
    rows = {number: np.flatnonzero(found == number) for number in np.unique(found) if number >= 0}
    # 0.1 s after a strike and every 60 ms until the next one: nine in 0.6 s, numbered twice and the leg
    assert set(rows) == {2 * n + leg for n in range(9) for leg in (0, 1)}
    for number, where in rows.items():
        begins = [0.4, 1.6] if number % 2 else [1.0]
        assert table.time_s[where] == pytest.approx([each + 0.1 + 0.06 * (number // 2) for each in begins], abs=0.0021)
