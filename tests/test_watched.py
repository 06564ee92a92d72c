"""The program that watches the panel: its figures have known answers, and a short run shows all channels."""

import os

import pytest

from tests import browser, watched


def row(wall_s, heap_MB=3.0, shown_per_s=30, **others):
    every = {"time_s": wall_s, "heap_MB": heap_MB, "browser_MB": 400.0, "panel_MB": 100.0, "behind_s": 0.0}
    every |= {
        "robot_s": 0.7 * wall_s,
        "panel_s": 0.2 * wall_s,
        "browser_s": 0.4 * wall_s,
        "pictures_per_s": shown_per_s,
    }
    return every | {"wall_s": 1000.0 + wall_s, "shown": shown_per_s * wall_s} | others


def test_growth_is_that_of_an_hour_and_what_is_not_settled_does_not_count():
    rows = [row(60.0 * k, heap_MB=9.0 if k < 2 else 3.0 + 0.1 * k) for k in range(20)]
    figures = watched.figures_of(rows)
    assert figures["heap_growth_MB_per_h"] == pytest.approx(6.0)  # 0.1 MB a minute
    assert figures["browser_growth_MB_per_h"] == pytest.approx(0.0, abs=1e-9)
    assert figures["pictures_per_s"] == pytest.approx(30.0) and figures["pace"] == pytest.approx(1.0)
    assert [figures[f"{whose}_share"] for whose in ("robot", "panel", "browser")] == pytest.approx([0.7, 0.2, 0.4])


@pytest.mark.parametrize(
    ("slower", "name"),
    [
        ({"shown_per_s": 29.9}, "pictures_per_s"),
        ({"leak_MB": 0.05}, "heap_growth_MB_per_h"),
        ({"pace": 0.98}, "pace"),
        ({}, ""),
    ],
)
def test_each_bound_is_missed_where_it_does_not_hold(slower, name):
    rows = [
        row(60.0 * k, 3.0 + slower.get("leak_MB", 0.0) * k, slower.get("shown_per_s", 30))
        | ({"time_s": 60.0 * k * slower["pace"]} if "pace" in slower else {})
        for k in range(10)
    ]
    found = watched.missed(watched.figures_of(rows))
    assert [line.partition(":")[0] for line in found] == ([name] if name else [])


def test_memory_and_processor_time_are_those_of_the_kernel():
    import resource

    used = resource.getrusage(resource.RUSAGE_SELF)
    own = used.ru_utime + used.ru_stime
    assert watched.processor_s(os.getpid()) >= own - 0.02  # two ticks; helpers of the test runner count as well
    assert 10.0 < watched.memory_MB(os.getpid())


@pytest.mark.skipif(browser.BROWSER is None, reason="no browser here")
def test_a_robot_with_48_channels_viewed_has_the_digest_of_one_without():
    result = watched.watch(8.0, 1.0, seed=3, width=1400, say=lambda line: None)
    assert result["digest"] == result["alone"] and result["time_s"] == pytest.approx(8.0, abs=0.01)
    assert not result["errors"]
    assert result["channels"] == 48
    assert result["figures"]["pictures_per_s"] > 3.0  # a tenth of what a quiet machine has
