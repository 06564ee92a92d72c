"""The live view of `ranger-sim up`, drawn from a state as the supervisor gives it."""

import io

from rich.console import Console

from ranger_sim.tools.run.up_view import LiveView, PlainView

LATENESS = {"slots": 10, "p50_us": 20, "p99_us": 300, "p999_us": 4000, "max_us": 5000.4}
STATE = {
    "name": "ranger",
    "speed": 1.0,
    "scheduling": "SCHED_FIFO, memory locked, on processor 1",
    "plant": 99,
    "boards": {
        name: {
            "state": state,
            "process": 100,
            "slots": 1234,
            "overruns": 0,
            "max_slot_us": 201.4,
            "errors": 7,
            "damaged": 0,
            "lateness": LATENESS,
        }
        for name, state in (("MCH", "running"), ("MCFO", "stopped"), ("UI", "elsewhere"))
    },
    "time_s": 12.34,
    "time_ns": 12_340_000_000,
    "steps": 17,
    "distance_m": 6.5,
    "speed_m_per_s": 0.59,
    "behind_s": 0.25,
    "paused": False,
    "buses": {"can1": {"load": 0.18, "errors": 0}, "can2": {"load": 0.5, "errors": 3}},
    "ends": [{"frames_in": 3, "frames_out": 0}],
    "damaged": {},
    "damage": ["channel to MCH, message 812: CAN_RX: field a is 9, allowed are 1 to 4"],
}


def drawn(terminal):
    text = io.StringIO()
    return Console(file=text, force_terminal=terminal, width=140, color_system=None), text


def test_the_live_view_shows_boards_lateness_loads_and_what_is_wrong():
    console, text = drawn(terminal=True)
    view = LiveView(console)
    view.show({"boards": {}})  # nothing yet
    view.show(STATE)
    view.close()
    view.show(STATE)  # after the end nothing is drawn
    for said in (
        "12.3 s (speed 1, 0.2 s behind), 17 steps, 6.50 m, 0.59 m/s",
        "can1 18 %",
        "can2 50 % (3 errors)",
        "SCHED_FIFO, memory locked, on processor 1",
        "frames in 3",
        "channel to MCH, message 812",
    ):
        assert said in text.getvalue(), said
    row = next(line for line in text.getvalue().splitlines() if "MCFO" in line)
    assert [word for word in row.replace("│", " ").split()] == [
        *("MCFO", "100", "stopped", "1234", "201", "0", "7"),
        *("20", "300", "4000", "5000"),
    ]


def test_without_a_terminal_there_are_plain_lines():
    console, text = drawn(terminal=False)
    view = PlainView(console)
    view.say("MCH (process 5) was killed by signal 9")
    view.show(STATE)
    view.show(STATE)  # not again so soon
    assert text.getvalue().splitlines() == [
        "MCH (process 5) was killed by signal 9",
        "12.3 s, 17 steps, 6.50 m, loads 18 50 %, late p99 300 us, MCFO stopped",
    ]
