"""What the link's lists promise, what comes of it, and its gaps: by hand, and on a robot that walks."""

import contextlib

import pytest

from ranger_sim.datatable import parameters
from ranger_sim.datatable.generated import all_variables
from ranger_sim.foundation.numbers import word_of_float
from ranger_sim.tools.robodaq.codec import Point
from ranger_sim.tools.robodaq.rates import BIN_MS, VARIABLES, Rates, lists_of, promised_hz
from ranger_sim.tools.robodaq.session import Session
from tests.tools.robodaq.on_a_line import OnALine

ID = all_variables.ID_OF
FAST, MEDIUM = 131072, 65536


def test_a_cycle_costs_a_step_for_each_fast_variable_one_medium_one_slow_one_and_the_return():
    """10 steps in 2 ms; 2 fast and 5 medium ones: 5 steps a cycle, 1000 cycles a second."""
    rates = promised_hz(2, 5)
    assert rates == {"fast": 1000.0, "medium": 200.0, "slow": pytest.approx(1000.0 / VARIABLES)}
    assert promised_hz(0, 0)["fast"] == 2500.0  # one slow one and the return
    assert promised_hz(2, 5, least=True)["medium"] == pytest.approx(5000.0 / 9.0 / 5.0)  # it looks at all five in vain


def test_the_lists_are_what_the_values_of_the_channels_choose():
    words = [14 + FAST, 20 + MEDIUM, 0.0, 15.0, VARIABLES + FAST, 7 + FAST, float("nan")]
    assert lists_of(words) == ([14, 7], [20])


@pytest.fixture
def walking():
    """(robot on a line, session, its rates): two fast, two medium ones, and the session's own two."""
    line = OnALine()
    session = Session(lambda point: rates.take(point))
    rates = Rates(session)
    session.select(
        [parameters.find(name) for name in ("MCH_ANGLE", "MCFO_RIGHT_LS")],
        [parameters.find(name) for name in ("UI_ROLL", "UI_PITCH")],
    )
    with contextlib.closing(line.robot):
        yield line, session, rates


def of(rates, name):
    return rates.rows([ID[name]])[0]


def test_each_list_brings_what_it_promises(walking):
    """Three fast, three medium ones (the time, two angles): 6 steps a cycle, 833 cycles a second at full speed."""
    line, session, rates = walking
    line.pass_on(session, 6.5)
    assert {all_variables.NAMES[number]: rates.list_of[number] for number in rates.chosen()} == {
        **dict.fromkeys(("ERROR_LABVIEW", "MCH_ANGLE", "MCFO_RIGHT_LS"), "fast"),
        **dict.fromkeys(("TIMESTAMP", "UI_ROLL", "UI_PITCH"), "medium"),
    }
    angle = of(rates, "MCH_ANGLE")  # published every 2 ms, and asked for in every cycle
    assert angle["promised_hz"] == 500.0 and angle["rate_hz"] == pytest.approx(500.0, rel=0.01)
    switch = of(rates, "MCFO_RIGHT_LS")  # published every 67.5 ms; and once more each time the slow list comes round
    assert switch["promised_hz"] == pytest.approx(1000 / 67.5)
    assert switch["rate_hz"] == pytest.approx(1000 / 67.5 + 5000 / 6 / VARIABLES, rel=0.03)
    roll = of(rates, "UI_ROLL")  # every third cycle at least: what is not new leaves its turn to others
    assert roll["promised_hz"] == pytest.approx(5000 / 6 / 3) and 277 < roll["rate_hz"] < 334
    slow = of(rates, "MCH_HBRIDGE_TEMP")  # comes round with all variables, once in 0.57 s
    assert slow["list"] == "slow" and slow["promised_hz"] == pytest.approx(5000 / 6 / VARIABLES)
    assert slow["rate_hz"] == pytest.approx(slow["promised_hz"], rel=0.15)
    fast, medium, rest = rates.lists()
    assert [row["variables"] for row in (fast, medium, rest)] == [3, 3, VARIABLES - 6]
    assert rest["rate_hz"] == pytest.approx(rest["promised_hz"], rel=0.05)
    assert [row["gaps"] for row in (fast, medium, rest)] == [0, 0, 0]


def test_bytes_lost_on_the_line_are_a_gap_of_the_values_due_meanwhile(walking):
    line, session, rates = walking
    line.pass_on(session, 2.0)
    begun_ms = session.clock_ms
    line.pass_on(session, 0.3, loses=True)
    line.pass_on(session, 3.0)
    angle = of(rates, "MCH_ANGLE")
    assert angle["gaps"] == 1 and 295 <= angle["longest_ms"] <= 310
    assert angle["last_ms"] == pytest.approx(begun_ms + 300, abs=10)
    assert 0.93 < of(rates, "MCH_ANGLE")["rate_hz"] / 500.0 < 0.95  # 0.3 of the last 5 s
    assert of(rates, "P_H_PM_TIME")["gaps"] == 0  # it comes rarer than that
    assert rates.lists()[0]["gaps"] == 1 and rates.lists()[2]["gaps"] == 0


def test_a_silence_of_seconds_is_a_gap_of_everything(walking):
    line, session, rates = walking
    line.pass_on(session, 2.0)
    line.pass_on(session, 4.0, loses=True)
    line.pass_on(session, 1.0)
    assert {row["gaps"] for row in rates.rows(list(range(1, VARIABLES)))} == {1}


def reported(session, **channels):
    """As the slow list brings the values of channels."""
    for name, value in channels.items():
        session._take(Point(ID[name], word_of_float(float(value)), 0))


def test_a_variable_that_moves_to_a_faster_list_has_no_gap_by_that():
    session = Session(lambda point: rates.take(point))
    rates = Rates(session)
    number = ID["MCH_ANGLE"]
    session._take(Point(ID["TIMESTAMP"], 0, 1000))
    reported(session, LV_CH_0=0)
    session._take(Point(number, 0, 1000))
    session._take(Point(number, 0, 1400))  # the slow list comes round in 0.19 s then
    reported(session, LV_CH_0=number + FAST)
    session._take(Point(number, 0, 2400))  # later than any list allows, but on another one than before
    assert of(rates, "MCH_ANGLE")["gaps"] == 0 and of(rates, "MCH_ANGLE")["list"] == "fast"
    session._take(Point(number, 0, 2440))  # below what the robot's logs count as a gap
    session._take(Point(number, 0, 2491))
    assert of(rates, "MCH_ANGLE")["gaps"] == 1 and of(rates, "MCH_ANGLE")["longest_ms"] == 51


def test_a_rate_counts_the_silence_in_it_and_a_new_start_begins_anew():
    session = Session(lambda point: rates.take(point))
    rates = Rates(session)
    for stamp in range(10_000, 10_000 + BIN_MS):
        session._take(Point(ID["TIMESTAMP"], 0, stamp))
    session._take(Point(ID["TIMESTAMP"], 0, 10_000 + 2 * BIN_MS))  # one bin with 500, one with none
    assert of(rates, "TIMESTAMP")["rate_hz"] == pytest.approx(500.0)
    session._take(Point(ID["TIMESTAMP"], 0, 5))
    assert of(rates, "TIMESTAMP")["rate_hz"] == 0.0
