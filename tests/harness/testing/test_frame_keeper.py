"""Blocks of frames that a keeper keeps: of its window, passed on to whoever listened before."""

from types import SimpleNamespace as Made

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.names import Names
from ranger_sim.harness.ranger_names import RANGER
from ranger_sim.harness.testing import frames


def test_blocks_of_the_window_are_kept_and_passed_on():
    heard, flushed = [], []
    stream = Made(sink=lambda last_ns, block: heard.append((last_ns, block)), flush=lambda: flushed.append(1))
    keeper = frames.FrameKeeper({"can0": stream}, Names(), window_s=2.0)
    assert flushed == [1] and keeper.window_ns == 2_000_000_000
    for last_s, block in ((1, b"a"), (2, b"b"), (3, b"c"), (4, b"d")):
        stream.sink(last_s * 10**9, block)
    assert [block for _, block in keeper.blocks["can0"]] == [b"b", b"c", b"d"]  # from 2 s on: the window's both ends
    assert [block for _, block in heard] == [b"a", b"b", b"c", b"d"] and heard[0][0] == 10**9


def test_a_keeper_needs_no_other_listener_and_knows_its_buses():
    stream = Made(sink=None, flush=lambda: None)
    keeper = frames.FrameKeeper({"can0": stream}, Names())
    stream.sink(5, b"")
    assert len(keeper.blocks["can0"]) == 1
    with pytest.raises(UserError, match="^unknown bus 'can9' .available: can0"):
        keeper.frames("can9")


def test_a_variable_is_known_by_name_or_number():
    assert RANGER.identifier(77) == 77
    with pytest.raises(UserError, match="unknown frame 'MCH_ANGEL'; did you mean .*'MCH_ANGLE'"):
        RANGER.identifier("MCH_ANGEL")
