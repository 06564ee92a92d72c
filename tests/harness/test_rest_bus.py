"""Frames of absent boards, counted and timed from the master table and the bus schedule by its own reader."""

import collections
import dataclasses
import math

import pytest

from ranger_sim import datatable
from ranger_sim.datatable.packing import value_of_word, word_of_value
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.outside import profile
from ranger_sim.harness.outside.rest_bus import RestBus

TABLE = datatable.load()
MS = 1_000_000
START = 40 * MS


def absent(*names):
    base = profile.default()
    return dataclasses.replace(base, boards={**base.boards, **dict.fromkeys(names, "absent")})


def sent(rest, until_ns, step_ns=MS):
    """Every frame before that time, taken in steps."""
    found = []
    now = START
    while now < until_ns:
        now = min(now + step_ns, until_ns)
        found += rest.due(now)
    return found


def by_identifier(frames):
    found = collections.defaultdict(list)
    for time, bus, identifier, flags, word, stamp in frames:
        assert flags == 8
        found[bus, identifier].append((time, word, stamp))
    return found


def test_a_motor_boards_variables_come_on_its_bus_as_often_as_its_schedule_has_them():
    """Row variables once in each turn of the rows, or what the bus schedule makes of it; nothing else, no errors."""
    board = TABLE.board("MCH")
    turn_ns = round(board.slot_us * 1000 * len(board.rows))
    in_rows = {name for row in board.rows for name in row if not name.startswith("(")}
    frames = by_identifier(sent(RestBus(absent("MCH"), START), START + 2000 * MS))
    names = {name_of(identifier) for _, identifier in frames}
    assert {bus for bus, _ in frames} == {board.buses[0].lower()}
    assert "MCH_ANGLE" in names and not any(TABLE.variable(name).is_error_word for name in names)
    for (_, identifier), rows in frames.items():
        name = name_of(identifier)
        assert TABLE.variable(name).publisher == "MCH"
        gaps = {later[0] - earlier[0] for earlier, later in zip(rows, rows[1:], strict=False)}
        assert len(gaps) == 1, name
        (gap,) = gaps
        if name in in_rows:
            assert gap % turn_ns == 0, name
        assert len(rows) == math.ceil((2000 * MS - (rows[0][0] - START) + 1) / gap)


def name_of(identifier):
    return next(each.name for each in TABLE.variables if each.id == identifier)


def test_first_frames_are_137_us_apart_so_that_not_all_come_at_once():
    rest = RestBus(absent("MCH"), START)
    assert rest.next_time == START
    frames = by_identifier(sent(rest, START + 3000 * MS))
    firsts = sorted(rows[0][0] - START for rows in frames.values())
    periods = {key: rows[1][0] - rows[0][0] for key, rows in frames.items()}
    long = [key for key, period in periods.items() if period > 137_000 * len(frames)]
    assert firsts[0] == 0 and len(set(firsts)) == len(firsts)
    assert {frames[key][0][0] % 137_000 for key in long} == {START % 137_000}


def test_frames_come_in_order_of_time_however_time_is_cut():
    whole = RestBus(absent("MCH", "UI"), START).due(START + 50 * MS)
    pieces = sent(RestBus(absent("MCH", "UI"), START), START + 50 * MS, step_ns=77_000)
    assert whole == pieces and [each[0] for each in whole] == sorted(each[0] for each in whole)
    rest = RestBus(absent("MCH"), START)
    assert rest.due(START - 1) == [] and rest.frames == 0
    assert [each[0] for each in rest.due(START)] == [START] and rest.frames == 1


def test_words_are_the_tables_first_values_and_stamps_whole_milliseconds():
    frames = by_identifier(sent(RestBus(absent("MCH"), START), START + 30 * MS))
    for (_, identifier), rows in frames.items():
        variable = TABLE.variable(name_of(identifier))
        for time, word, stamp in rows:
            assert word == word_of_value(variable.type, variable.initial_as_stored)
            assert stamp == (time - START) // MS


def test_both_limits_of_a_variable_are_taken_and_what_is_beyond_refused():
    rest = RestBus(absent("MCH"), START)
    angle = TABLE.variable("MCH_ANGLE")
    for value in (angle.minimum, angle.maximum, 0.25):
        rest.set("MCH_ANGLE", value)
        words = [word for _, _, identifier, _, word, _ in rest.due(rest.next_time + 10 * MS) if identifier == angle.id]
        (word,) = set(words)
        assert value_of_word(angle.type, word) == pytest.approx(value, rel=1e-6)
    for value in (angle.minimum - 1e-3, angle.maximum + 1e-3, math.nan, math.inf):
        with pytest.raises(UserError, match="rest-bus: MCH_ANGLE"):
            rest.set("MCH_ANGLE", value)
