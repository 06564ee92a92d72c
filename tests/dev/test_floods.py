"""Floods: what they are compared with, and that an interrupted series goes on."""

import pytest

from dev.floods import flooders, floods
from tests.can_bus.hosting import hosted


def test_floods_are_compared_with_that_robot_in_peace_and_go_on_where_they_were_interrupted(tmp_path, monkeypatch):
    looked_on = flooders.PEACE_OF[flooders.SHOWN]
    paces = {flooders.PEACE: 0.25, "control set": 0.2476, "slcan V": 0.2474, looked_on: 0.2, "panel connections": 0.199}
    asked = []

    class Robot:
        def __init__(self, speed, kind):
            self.speed, self.kind, self.ended, self.close = speed, kind, False, lambda: None

    def measured(name, seconds, robot):
        asked.append((name, seconds, robot.speed, robot.kind))
        return {"flood": name, "pace": paces[name], "cpu_per_s": 0.5, "memory_mb": 1.0, "memory_growth_mb": 0.0,
                "panel_mb": 0.0, "panel_growth_mb": 0.0, "ended": False}  # fmt: skip

    monkeypatch.setattr(floods, "measured", measured)
    monkeypatch.setattr(floods, "Robot", Robot)
    said, kept = [], tmp_path / "rows"
    floods.run(5, said.append, (flooders.PEACE, "control set"), 0.25, kept)
    rows = floods.run(5, said.append, tuple(paces), 0.25, kept)
    kinds = [flooders.WHOLE] * 3 + [flooders.SHOWN] * 2
    assert asked == [(name, 5, 0.25, kind) for name, kind in zip(paces, kinds, strict=True)]
    assert [row["flood"] for row in rows] == list(paces)
    assert " 99.04 % of undisturbed, 0.500 s" in said[-5] and " 98.96 % of undisturbed" in said[-4]
    assert " 99.50 % of undisturbed" in said[-2]
    assert said[-1].startswith("2 of 3 floods leave at least 99 %") and said[-1].endswith("98.96 % (slcan V)")
    floods.run(6, said.append, (flooders.PEACE,), 0.25, kept)  # other seconds are another measurement
    assert asked[-1][:2] == (flooders.PEACE, 6) and len(asked) == 6


@pytest.mark.parametrize(("processors", "speed"), [(1, 0.25), (2, 0.25), (5, 0.5), (9, 0.5), (10, 1.0), (64, 1.0)])
def test_a_robot_under_floods_runs_as_fast_as_the_machine_can_hold(processors, speed):
    assert floods.speed_for(processors) == speed


def test_every_flood_has_a_program_and_together_they_use_each_endpoint():
    endpoints = flooders.Endpoints("x")
    counts = {name: len(flooders.programs(name, endpoints)) for name in flooders.NAMES}
    assert set(flooders.FLOODS) < set(counts)
    nobody = set(flooders.PEACE_OF.values())
    assert {name for name, count in counts.items() if count == 0} == nobody
    assert {name: count for name, count in counts.items() if count > 1} == {flooders.ALL: 3}
    assert {name.split()[0] for name in flooders.TOGETHER} == {"attach", "slcan", "socketcand"}
    kinds = [flooders.robot_of(name) for name in flooders.NAMES]
    assert [kind for place, kind in enumerate(kinds) if kinds[place - 1 : place] != [kind]] == list(flooders.PEACE_OF)


def test_a_page_of_a_flood_speaks_as_a_browser_does():
    """The handshake of RFC 6455, 1.3, and a masked text of its 5.7 but for the mask."""
    head = flooders.handshake(flooders.Endpoints("x", panel=80), "word", "http://a")
    assert head.startswith(b"GET /socket?token=word HTTP/1.1\r\nHost: 127.0.0.1:80\r\n") and head.endswith(b"\r\n\r\n")
    assert b"Sec-WebSocket-Version: 13\r\nOrigin: http://a\r\n" in head
    assert flooders.message("Hello") == b"\x81\x85\0\0\0\0Hello"
    assert flooders.message("x" * 256) == b"\x81\xfe\x01\x00\0\0\0\0" + b"x" * 256


def test_a_sender_in_the_window_is_served_as_long_as_it_lasts():
    """The dearest client that keeps to the protocol, against a bus alone: it is never sent away."""
    with (
        hosted("can1", speed=50.0) as (name, host),
        flooders.flooded(flooders.FRAMES_IN_WINDOW, flooders.Endpoints(name)),
    ):
        (server,) = host.servers
        listener = flooders.attached(flooders.Endpoints(name))
        with listener:
            heard = 0
            while heard < 40_000:  # some 1,000 frames
                heard += len(listener.recv(1 << 16))
        assert server.totals["frames_in"] > 500 and not server.sent_away
