"""The front panel comes from what the board drives: with a program in C and as an image, with known answers."""

import contextlib
import json
import pathlib
import shutil
import struct

import pytest

from ranger_sim import Ranger, Scenario
from ranger_sim.foundation.events import PIN_OUTPUT
from ranger_sim.foundation.row_stream import RowStream
from ranger_sim.harness.outside.profile import Profile
from ranger_sim.ranger.feed import FeedServer
from ranger_sim.ranger.firmware import native_boards
from tests.firmware_sim.native.support import COMPILER

FACE = pathlib.Path(__file__).parent / "face"
CROSS_COMPILER = shutil.which("arm-none-eabi-gcc")
LINES = b"C drives" + b"this fac"
LIGHTS = [0x302010 + 0x010101 * light for light in range(6)]
GREEN_AND_BLUE = 0b101
TICKS_PER_S = 60e6


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return shutil.copytree(FACE, tmp_path_factory.mktemp("firmware") / "face")


@pytest.fixture(
    params=[
        pytest.param("C", marks=pytest.mark.skipif(not COMPILER, reason="no C compiler here")),
        pytest.param("C in a process", marks=pytest.mark.skipif(not COMPILER, reason="no C compiler here")),
        pytest.param("image", marks=pytest.mark.skipif(not CROSS_COMPILER, reason="no arm-none-eabi-gcc here")),
    ]
)
def shown(request, folder):
    """(robot, what its feed shows as the panel now), with the program as the user interface board's."""
    if request.param == "image":
        how = {"images": {"UI": native_boards.build_image(folder).path}}
    else:
        how = {"firmware": {"UI": native_boards.build(folder)}, "in_process": request.param == "C"}
    with contextlib.closing(Ranger(Scenario(seed=3), **how)) as robot:
        feed = FeedServer(robot, "feed-of-a-face")
        robot.attach(feed)

        def panel():
            robot.run_for(0.001)  # all boards are at one instant
            return json.loads(json.dumps(feed.state(robot.loop.time)))["panel"]

        yield robot, panel


def test_two_lines_six_lights_a_tone_and_the_processors_lights(shown):
    robot, panel = shown
    robot.run_for(0.05)
    words = panel()
    assert bytes(words[:16]) == LINES
    assert words[16:22] == LIGHTS
    assert words[22:] == [440, 0, 0, GREEN_AND_BLUE]


def test_a_key_is_seen_received_and_reaches_the_main_brain(shown):
    robot, panel = shown
    robot.run_for(0.03)
    now = robot.loop.time
    robot.operator.press(2, now + 1_000_000, 40_000_000)
    robot.operator.press(5, now + 100_000_000, 40_000_000)
    robot.run_for(0.03)
    assert panel()[22:25] == [880, 0, 1 << 2]
    assert robot.variable("UI_BUTTONS") == 1 << 2
    robot.run_for(0.04)
    assert panel()[22:25] == [440, 0, 0] and robot.variable("UI_BUTTONS") == 0
    robot.run_for(0.05)
    assert panel()[22:25] == [0, 1, 1 << 5] and robot.variable("UI_BUTTONS") == 1 << 5


@pytest.mark.parametrize(("stick", "width_s"), [(-1.0, 0.001), (0.0, 0.00141667), (0.6, 0.00166667)])
def test_the_radio_stick_reaches_the_program(shown, stick, width_s):
    robot, _ = shown
    robot.operator.stick = stick
    robot.run_for(0.08)
    # the crystal is off by 30 ppm at most, 3 ticks; edges have a stamp in whole ns and captures are whole ticks
    assert robot.variable("UI_RC_0") == pytest.approx(width_s * TICKS_PER_S, abs=5)


def test_the_board_in_python_shows_what_its_pins_say():
    """The display's bytes, read by the test from what the pins did, are what the panel shows."""
    with contextlib.closing(Ranger(Scenario(seed=3))) as robot:
        wires = robot.loop.wires[robot.loop.place("UI")]
        wires.watch = RowStream("q", 5, False)
        wires.watch.sink = lambda time_ns, data: rows.extend(struct.iter_unpack("<5q", data))
        rows, levels = [], list(robot.board("UI").pins)  # what the start-up commands left there
        robot.run_for(1.5)
        wires.watch.flush()
        shown = list(robot.board("UI").memory)
    seen, address = {}, 0
    for _, kind, pin, level, _ in rows:
        if kind != PIN_OUTPUT:
            continue
        levels[pin] = level
        if pin == 11 and level == 0:
            byte = sum(levels[bit] << bit for bit in range(8))
            if levels[15]:
                seen[address] = byte
                address += 1
            else:
                assert byte & 0x80
                address = byte & 0x7F
    text = [seen.get(address, 0x20) for address in (*range(8), *range(0x40, 0x48))]
    assert text == shown[:16] and len(seen) == 16 and bytes(text).strip()


def test_a_board_without_power_shows_nothing_and_the_feed_says_why():
    with contextlib.closing(Ranger(Scenario(seed=3))) as robot:
        robot.inject("UI.supply", "brown_out", at="100 ms", off_ms=100)
        feed = FeedServer(robot, "feed-of-a-dark-face")
        robot.attach(feed)
        robot.run_for(0.09)
        assert any(feed.state(0)["panel"][16:22]) and feed.state(0)["panel_unseen"] == ""  # a light is on already
        robot.run_for(0.06)
        state = feed.state(0)
        assert state["panel"] is None
        assert state["panel_unseen"] == "The user interface board is without power or held in reset."
        robot.run_for(0.056)  # the power is back since 201 ms, and nobody has written to the display yet
        state = feed.state(0)
        assert state["panel"][:16] == [ord(" ")] * 16 and state["panel_unseen"] == ""


@pytest.mark.parametrize(
    ("state", "sentence"),
    [
        ("external", "The user interface board is outside: its own display, lights and buzzer show what it drives."),
        ("absent", "This run does not have a user interface board."),
    ],
)
def test_of_a_board_that_does_not_run_here_nothing_is_made_up(state, sentence):
    with contextlib.closing(Ranger(Scenario(seed=3))) as robot:
        feed = FeedServer(robot, "feed-of-no-face")
        robot.attach(feed)
        robot.profile = Profile("test", "test.toml", "", "", {"UI": state}, {})
        assert feed.state(0)["panel"] is None and feed.state(0)["panel_unseen"] == sentence
