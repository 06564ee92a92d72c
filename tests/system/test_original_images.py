"""The robot's own firmware images, unmodified: they boot, answer a stimulus as on another device model, and walk.

The images are not part of this repository: RANGER_SIM_IMAGES names a folder with MCH.hex (or .axf) and the others.
The measured frames are those of tests/boards/original_images.py: the same images, run elsewhere at two cycles for every
instruction, with words to the external converter that take no time.
"""

import contextlib
import functools
import os
import pathlib

import pytest

from ranger_sim.boards.motor_board import ANALOG, PINS
from ranger_sim.datatable.generated import mcfi, mch
from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.firmware_sim.lpc2194.image import read
from ranger_sim.foundation.events import CAN_REQUEST, CAN_RX, CAN_TX_DONE, ORDER_BUS, ORDER_PINS, PIN_EDGE
from ranger_sim.foundation.numbers import float_of_word, word_of_float
from ranger_sim.ranger.firmware import image_boards
from ranger_sim.ranger.firmware.robot_image_board import RobotImageBoard
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario
from tests.boards.motor_bench import FRAME_NS
from tests.boards.original_images import CHANNELS, COUNTS, DATA, WHOLE, Sent, frames_of_the_image, stimulus_of

FOLDER = pathlib.Path(os.environ.get("RANGER_SIM_IMAGES", "no such folder"))
STIMULI = {"MCH_ramp": ("MCH", mch), "MCFI_up": ("MCFI", mcfi)}
ANGLES = {"MCH": 4590, "MCFO": 6562 - 1956, "MCFI": 1572 + 1956}  # of the absolute encoder: legs closed, ankles at 1.5
# What each sends in turn, facts of the table: angle, rate, power ... (robot.md N3.2 to N3.7)
SENDS = {
    "MCH": {14, 21, 15, 12, 11, 22, 27, 28, 10, 23, 24},
    "MCFO": {37, 59, 50, 40, 41, 33, 49, 44},
    "MCFI": {65, 87, 77, 63, 68, 70, 78},
    "MCSI": {112, 110, 113, 119, 120, 121},
    "UI": {142, 145, 148, 149, 150, 157},
    "CSR": {0},
}
BOOTS_WITHIN_MS = {"UI": 700}  # it counts to 20 million in floats first; the others take half a millisecond
EXECUTION_TIMES = {"MCH": (23, 24), "MCFI": (79, 80)}
# Words to and from the converter take 1.6 us each here: three or more for a conversion, of which MCH has two in a slot
# and MCFI four. Half a microsecond is for a wait whose last pass ends later.
LATER_US = {"MCH": (4.0, 14.0), "MCFI": (4.0, 4 * 3 * 1.6 + 0.5)}
FIRST_US = 1_500.0  # start-up: how long the PLL takes to lock, nobody knows


def path_of(board):
    """The image of a board; skipped visibly where it is not at hand."""
    for kind in (".axf", ".hex"):
        if (FOLDER / (board + kind)).is_file():
            return FOLDER / (board + kind)
    pytest.skip(f"no image of {board} (RANGER_SIM_IMAGES names their folder)")


class Bench:
    """A board with an image on a bus that takes a frame in 37 us; times count from when its slot timer starts."""

    def __init__(self, name, cycles_per_instruction=0):
        self.board = RobotImageBoard(name, read(path_of(name)), Crystal(), 0)
        self.board.core.cycles_per_instruction = cycles_per_instruction
        self.board.words[0] = ANGLES.get(name, 0)
        self.now = 0
        self.free = {}  # by controller
        self.frames = []  # (time, controller, identifier, word, word)

    def to(self, until, step=30_000):
        while self.now < until:
            self.now = min(self.now + step, until)
            self.board.advance(self.now)
            queue = self.board.outbox
            while queue.take():
                if queue.kind == CAN_REQUEST:
                    words = queue.e & 0xFFFFFFFF, queue.f & 0xFFFFFFFF
                    self.frames.append((queue.time, queue.a, queue.c, *words))
                    self.free[queue.a] = max(self.free.get(queue.a, 0), queue.time) + FRAME_NS
                    end = max(self.free[queue.a], self.now)
                    self.board.inbox.push(end, ORDER_BUS, CAN_TX_DONE, queue.a, queue.b, 0)
        return self

    def volts(self, place, value):
        self.board.analog.set_pair(ANALOG[place], self.now, value, self.now + 1, value)


@pytest.mark.parametrize("name", SENDS)
def test_it_boots_unmodified_and_sends_its_variables(name):
    bench = Bench(name).to(1_000_000 * (BOOTS_WITHIN_MS.get(name, 1) + 150))
    assert {identifier for _, _, identifier, *_ in bench.frames} >= SENDS[name]
    controllers = {controller for _, controller, *_ in bench.frames}
    assert controllers == {1, 2, 3, 4} if name == "CSR" else len(controllers) == 1
    assert bench.board.counters().unclaimed == 0


def test_the_router_sends_its_time_on_four_buses_every_millisecond():
    bench = Bench("CSR").to(60_000_000)
    for controller in (1, 2, 3, 4):
        reported = [(time, word0, word1) for time, bus, number, word0, word1 in bench.frames if bus == controller]
        assert (
            [word0 for _, word0, _ in reported]
            == [word1 for *_, word1 in reported]
            == list(range(1, len(reported) + 1))
        )
        times = [time for time, *_ in reported]
        assert len(times) > 55
        assert all(abs(b - a - 1_000_000) < 4_000 for a, b in zip(times, times[1:], strict=False))


@functools.cache
def answers(stimulus):
    """(frames of the measured run, those of ours), both in us since the slot timer started."""
    name, table = STIMULI[stimulus]
    if not (DATA / f"image_{stimulus}_frames.csv").exists():
        pytest.skip(f"no measurements of the original images in {DATA.name}/")
    trial = Bench(name, 2)
    while trial.board.slots_begun == 0:
        trial.to(trial.now + 100_000)
    start = trial.board.slot_begin - 500_000
    bench = Bench(name, 2)
    bench.volts("battery_voltage", 800 * 3.3 / 1024.0)
    measured = frames_of_the_image(stimulus)
    for row in stimulus_of(stimulus):
        at = round(float(row["t_us"]) * 1000.0) + start
        if at > measured[-1].t_us * 1000.0 + start:
            break
        bench.to(max(bench.now, at - 30_000))
        if row["kind"] == "can_rx":
            whole = row["name"] in WHOLE
            word = int(row["value"]) if whole else word_of_float(float(row["value"]))
            stamp = int(row["value"]) if whole else 0
            controller = table.CONTROLLER
            number = getattr(table, row["name"])
            bench.board.inbox.push(at, ORDER_BUS, CAN_RX, controller, number, 8, word, stamp)
        elif row["kind"] == "edge":
            pair = CHANNELS[row["name"]]
            pins = PINS[f"encoder_{pair}_a"], PINS[f"encoder_{pair}_b"]
            level, partner = int(row["value"]), int(row["more"].partition("=")[2])
            bench.board.inbox.push(at, ORDER_PINS, PIN_EDGE, pins[0], level, pins[1], partner)
        else:
            bench.to(max(at, bench.now))
            if row["name"] == "absolute_encoder_word":
                bench.board.words[0] = int(row["value"])
            elif row["name"] in COUNTS:
                bench.volts(COUNTS[row["name"]], int(row["value"]) * 2.5 / (2 * 8192.0))
    bench.to(round(measured[-1].t_us * 1000.0) + start + 200_000)
    ours = [Sent((time - start) / 1000.0, number, a, b) for time, _, number, a, b in bench.frames]
    return measured, ours[: len(measured)]


@pytest.mark.parametrize("stimulus", STIMULI)
def test_it_sends_what_it_sent_elsewhere_in_the_same_order(stimulus):
    measured, ours = answers(stimulus)
    assert [each.identifier for each in ours] == [each.identifier for each in measured]


@pytest.mark.parametrize("stimulus", STIMULI)
def test_every_frame_is_asked_for_later_by_the_words_to_the_converter_and_no_more(stimulus):
    measured, ours = answers(stimulus)
    later = [o.t_us - m.t_us for m, o in zip(measured, ours, strict=True) if m.t_us > FIRST_US]
    least, most = LATER_US[STIMULI[stimulus][0]]
    assert least < min(later)
    assert max(later) < most


@pytest.mark.parametrize("stimulus", STIMULI)
def test_values_are_equal_to_the_bit_but_for_an_edge_on_the_other_side_of_a_reading(stimulus):
    measured, ours = answers(stimulus)
    name, _ = STIMULI[stimulus]
    apart = [
        (m, o)
        for m, o in zip(measured, ours, strict=True)
        if m.identifier not in EXECUTION_TIMES[name] and (m.value, m.time) != (o.value, o.time)
    ]
    assert len(apart) <= 0.005 * len(measured)
    for m, o in apart:
        # one count of the hip's motor encoder, 2.5e-4 rad
        assert (m.identifier, m.time) == (12, o.time)
        assert float_of_word(o.value) == pytest.approx(float_of_word(m.value), abs=2.6e-4)


def test_the_hips_longest_slot_is_the_measured_one_and_the_converters_words():
    measured, ours = answers("MCH_ramp")
    for identifier in EXECUTION_TIMES["MCH"]:
        times = [
            (float_of_word(m.value) * 1e6, float_of_word(o.value) * 1e6)
            for m, o in zip(measured, ours, strict=True)
            if m.identifier == identifier and m.t_us > 100_000
        ]
        assert len(times) > 15
        assert all(4.0 < o - m < 14.0 for m, o in times), times[:3]
        assert all(214 <= o <= 248 for _, o in times)  # medians of the robot's logs, standing or held


def test_the_robot_walks_with_all_of_them_and_loses_no_frame():
    images = {name: read(path_of(name)) for name in image_boards.BOARDS}
    with contextlib.closing(Ranger(Scenario(), images=images)) as robot:
        robot.run_for(0.8)
        # while the UI board counts to 20 million nobody takes its frames out of its controller
        booting = robot.summary()["can"]
        robot.until("step 4", within="5 s")
        summary = robot.summary()
        assert not summary["fell"]
        assert summary["failed_boards"] == []
        assert 0.3 < summary["distance_m"] / summary["steps"] < 0.4
        for name, bus in summary["can"].items():
            assert (bus["lost"] - booting[name]["lost"], bus["errors"], bus["queue_full"]) == (0, 0, 0)
            assert name == "can2" or booting[name]["lost"] == 0
