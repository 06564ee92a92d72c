"""`python -m dev.soak`: a short walk, and that its checks can fail."""

import contextlib
import os
import socket
import sys

import pytest

from dev import soak
from dev.floods import flooders
from dev.kills import Finding
from dev.soak import Count
from ranger_sim.foundation.user_error import UserError

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="processes are listed as on Linux")


class Itself:
    """A command whose only process is this one."""

    def processes(self):
        return [os.getpid()]


def counts(*rows):
    return [Count(*row) for row in rows]


FLAT = counts(*[(9, 50, 100.0)] * 8)


def test_a_run_that_is_flat_from_the_second_quarter_on_has_not_grown():
    start = counts((1, 5, 10.0), (9, 900, 50.0))
    assert soak.check_flat(start + FLAT[2:], "it") == {"processes": 0, "descriptors": 0, "memory_mb": 0.0, "of_mb": 100}


def test_the_first_quarter_is_the_start_and_the_last_one_the_end():
    rows = counts(*[(number, 0, 0.0) for number in range(9)])
    earlier, later = soak.quarters(rows)
    assert [each.processes for each in earlier] == [2, 3] and [each.processes for each in later] == [7, 8]


@pytest.mark.parametrize(
    ("last", "found"),
    [
        ([(10, 50, 100.0)] * 2, "1 more processes"),
        ([(9, 52, 100.0), (9, 51, 100.0)], "1 more descriptors"),  # the least: passing clients add to the other
        ([(9, 60, 100.0), (9, 50, 100.0)], ""),
        ([(9, 50, 118.1)] * 2, "memory grew by 18.1 MB"),  # the limit: 8 MB and a tenth
        ([(9, 50, 117.9)] * 2, ""),
    ],
)
def test_what_has_grown_at_the_end_is_a_finding(last, found):
    rows = FLAT[:6] + counts(*last)
    with pytest.raises(Finding, match=found) if found else contextlib.nullcontext():
        soak.check_flat(rows, "it")


def test_a_bound_of_memory_is_that_of_every_count_and_growth_below_it_is_none():
    rows = counts(*[(1, 5, 50.0 * number) for number in range(8)])
    soak.check_flat(rows, "the panel", 350.0)
    with pytest.raises(Finding, match="350 MB, more than its bound of 349"):
        soak.check_flat(rows, "the panel", 349.0)


def test_seven_counts_are_too_few():
    with pytest.raises(UserError, match="7 counts"):
        soak.check_flat(FLAT[:7], "it")


def test_a_socket_that_stays_open_is_counted_and_named():
    before, opened = soak.count(Itself()), soak.opened(Itself())
    with socket.socket() as left:
        now = soak.count(Itself())
        more = soak.opened(Itself()) - opened
        link = os.readlink(f"/proc/self/fd/{left.fileno()}")
    assert (now.processes, now.descriptors) == (1, before.descriptors + 1) and now.memory_mb > 1.0
    assert more == {(os.getpid(), link)}


def test_every_client_of_a_soak_is_a_flood_that_puts_nothing_on_a_bus():
    assert set(soak.CLIENTS) <= set(flooders.NAMES)
    changing = ("send", "key", "set", "slcan", "on CAN", "data link", "take part", "both", "flush", "resume")
    assert not [name for name in soak.CLIENTS if any(word in name for word in changing)]


def test_a_short_walk_is_counted_and_has_the_digest_of_the_walk_alone(tmp_path, monkeypatch):
    monkeypatch.setattr(soak, "WALK_COUNT_S", 0.05)
    monkeypatch.setattr(soak, "STOP_EVERY", 12)
    monkeypatch.setattr(soak, "check_flat", lambda rows, _who: {"counted": len(rows)})
    reported = []
    found = soak.soak_walk("1m", "", True, tmp_path, reported.append)
    assert found["digest"] == found["digest_alone"] and found["distance_m"] >= 1.0
    assert found["counts"] >= 12 and reported  # it has been stopped and continued
    with pytest.raises(Finding, match="alone 0123"):
        soak.soak_walk("1m", "0123", False, tmp_path / "again", reported.append)
