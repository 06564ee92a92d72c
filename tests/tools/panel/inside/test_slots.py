"""The slots of a running robot's boards at a time, from rows of the feed by hand."""

import numpy as np
import pytest

from ranger_sim.tools.panel.inside.slots import KEPT_S, BoardSlots

HZ = 60_000_000
START_NS = 5_000_000  # the robot's power-up
SLOT_NS = 500_000  # of the hip board


def rows(*slots):
    """(number of the slot, cycles, lateness in ns), as the feed has them."""
    return np.array([(START_NS + number * SLOT_NS, cycles, late) for number, cycles, late in slots], np.int64).tobytes()


@pytest.fixture
def slots():
    """Four seconds: 6,000 cycles each and 2 us late, the 4,000th 30,000 cycles and 1 ms late."""
    board = BoardSlots("MCH", HZ)
    board.take(
        rows(*((n, 30_000 if n == 4000 else 6_000, 1_000_000 if n == 4000 else 2_000) for n in range(8000))), START_NS
    )
    return board


def test_a_slot_has_the_time_of_its_cycles_and_its_lateness_in_microseconds(slots):
    assert slots.content(2.0) == {
        "begun_s": pytest.approx(2.0),
        "used_us": pytest.approx(500.0),
        "late_us": pytest.approx(1000.0),
        "used": {"median": pytest.approx(100.0), "most": pytest.approx(100.0), "worst": pytest.approx(500.0)},
        "late": {"median": pytest.approx(2.0), "most": pytest.approx(2.0), "worst": pytest.approx(1000.0)},
    }


def test_the_statistics_are_those_of_the_second_before(slots):
    assert slots.content(2.9)["used"]["worst"] == pytest.approx(500.0)
    assert slots.content(3.1)["used"]["worst"] == pytest.approx(100.0)
    assert slots.content(1.9999)["used"]["worst"] == pytest.approx(100.0)
    assert slots.content(None)["begun_s"] == pytest.approx(7999 * 0.0005)


def test_of_a_time_before_the_first_slot_nothing_is_known(slots):
    assert slots.content(-0.1) is None and BoardSlots("MCH", HZ).content(None) is None


def test_without_a_pace_lateness_is_absent_and_a_slot_that_never_ended_took_no_time():
    board = BoardSlots("UI", HZ)
    board.take(rows((0, 6_000, -1), (2, 0, -1)), START_NS)
    found = board.content(None)
    assert (found["used_us"], found["late_us"], found["late"]) == (None, None, None)
    assert found["used"]["worst"] == pytest.approx(100.0)


def test_slots_are_channels_and_the_spike_is_seen_from_afar(slots):
    used, late = slots.channels()
    assert (used.name, used.unit, late.name) == ("slot_MCH_us", "µs", "late_MCH_us")
    trace = slots.memory.trace(0, 0.0, 4.0, 50)
    assert trace.high.max() == pytest.approx(500.0) and trace.low.max() == pytest.approx(100.0)


def test_slot_by_slot_the_last_minutes_are_kept():
    board = BoardSlots("MB", 208_000_000)
    for second in range(0, round(KEPT_S) + 60, 10):
        times = START_NS + second * 10**9 + np.arange(5000) * 2_000_000
        board.take(
            np.stack([times, np.full(5000, 20_800), np.full(5000, -1)], axis=1).astype(np.int64).tobytes(), START_NS
        )
    newest = board.content(None)["begun_s"]
    assert board.content(newest - KEPT_S + 0.1)["used_us"] == pytest.approx(100.0)
    assert board.content(newest - KEPT_S - 0.1) is None
