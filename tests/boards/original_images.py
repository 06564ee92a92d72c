"""What the robot's own firmware of 2016 answered to a stimulus, and what our boards answer to the same.

The measurements are not part of this repository: unmodified images ran on a device model of the LPC2194. A stimulus has
`t_us, kind, name, value, more` per line: `can_rx` a received variable, `edge` channel A of an encoder at its new level
with channel B's, `level` the absolute encoder's word or counts of the external converter, which stand until they
change. The frames are `t_us, id, word0_hex, word1_hex`, stamped when the program asks for them to be sent.
"""

import csv
import dataclasses
import os
import pathlib

from ranger_sim.boards.motor_board import PINS
from ranger_sim.foundation.events import CAN_REQUEST, CAN_RX, CAN_TX_DONE, ORDER_BUS, ORDER_PINS, PIN_EDGE
from ranger_sim.foundation.numbers import word_of_float
from tests.boards.motor_bench import FRAME_NS, Bench

DATA = pathlib.Path(os.environ.get("RANGER_SIM_DATA", pathlib.Path(__file__).parents[3] / "shared" / "data"))
CHANNELS = {f"P0.{PINS[f'encoder_{pair}_a']}": pair for pair in ("01", "23")}
COUNTS = {"adcx_motor_current_counts": "motor_current", "adcx_battery_current_counts": "battery_current"}
WHOLE = ("TIMESTAMP",)


@dataclasses.dataclass(frozen=True)
class Sent:
    """A frame: when the program asked for it (us), identifier, value word, time word."""

    t_us: float
    identifier: int
    value: int
    time: int


def frames_of_the_image(name):
    """What the image sent."""
    with open(DATA / f"image_{name}_frames.csv", encoding="utf-8") as file:
        return [
            Sent(float(row["t_us"]), int(row["id"]), int(row["word0_hex"], 16), int(row["word1_hex"], 16))
            for row in csv.DictReader(file)
        ]


def stimulus_of(name):
    """The lines of a stimulus."""
    with open(DATA / f"image_{name}_stimulus.csv", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def frames_of_our_board(name, board, quirks, until_us):
    """What our board sends to the same stimulus."""
    bench = Bench(board, quirks, sync=False)
    inbox, table = bench.board.inbox, bench.table
    sent = []

    def advance(until):
        bench.board.advance(until)
        queue = bench.board.outbox
        while queue.take():
            if queue.kind == CAN_REQUEST:
                bench.bus_free = max(bench.bus_free, queue.time) + FRAME_NS
                sent.append(Sent(queue.time / 1000.0, queue.c, queue.e, queue.f))
                inbox.push(max(bench.bus_free, until), ORDER_BUS, CAN_TX_DONE, bench.controller, queue.b, 0)
        bench.now = until

    bench.volts("battery_voltage", 800 * 3.3 / 1024.0)  # 800 counts of the internal converter
    for row in stimulus_of(name):
        at = round(float(row["t_us"]) * 1000.0)
        if at / 1000.0 >= until_us:
            break
        while bench.now + 125_000 < at:
            advance(bench.now + 125_000)
        if row["kind"] == "can_rx":
            identifier = getattr(table, row["name"])
            word = int(row["value"]) if row["name"] in WHOLE else word_of_float(float(row["value"]))
            stamp = int(row["value"]) if row["name"] in WHOLE else 0
            inbox.push(at, ORDER_BUS, CAN_RX, bench.controller, identifier, 8, word, stamp)
        elif row["kind"] == "edge":
            pair = CHANNELS[row["name"]]
            partner = int(row["more"].partition("=")[2])
            inbox.push(
                at,
                ORDER_PINS,
                PIN_EDGE,
                PINS[f"encoder_{pair}_a"],
                int(row["value"]),
                PINS[f"encoder_{pair}_b"],
                partner,
            )
        else:
            advance(max(at, bench.now))
            if row["name"] == "absolute_encoder_word":
                bench.board.words[0] = int(row["value"])
            elif row["name"] in COUNTS:
                bench.counts(COUNTS[row["name"]], int(row["value"]))
    while bench.now / 1000.0 < until_us:
        advance(bench.now + 125_000)
    return sent
