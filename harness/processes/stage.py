"""The sensors' values, from the plant's process to the boards': one row of shared memory per step of the plant.

The last 64 rows (8 ms) stay, so a board may be behind the plant and still read its sensors' values of that time.
"""

import array

import cython

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes.places import (
    MOST_VOLTAGES,
    MOST_WORDS,
    ROW_ANALOG_END,
    ROW_ANALOG_START,
    ROW_END,
    ROW_SIZE,
    ROW_START,
    ROW_WORDS,
    STAGE_FIRST,
    STAGE_RING,
    STAGE_ROWS,
)
from ranger_sim.harness.wiring.board_wires import WordWire
from ranger_sim.plant.plant import Plant


@cython.cclass
class Stage:
    """The plant's side. `step_times`: start and end of the step that is shown (ns), as in the lockstep.

    `wires`: of the digital sensors, in the order of the rows' words.
    """

    words: cython.longlong[::1]
    step_times: cython.longlong[::1]
    doubles: cython.double[::1]
    plant: Plant
    wires: list
    rows: cython.longlong
    shown_end: cython.longlong
    word_count: cython.longlong
    voltage_count: cython.longlong

    def __init__(self, words, doubles, plant, step_times, wires) -> None:
        self.words = words
        self.doubles = doubles
        self.plant = plant
        self.step_times = step_times
        self.rows = 0
        self.shown_end = -1
        self.wires = wires
        self.word_count = len(wires)
        self.voltage_count = len(plant.analog_start)
        if self.word_count > MOST_WORDS or self.voltage_count > MOST_VOLTAGES:
            raise UserError(
                f"stage: {self.word_count} words and {self.voltage_count} voltages do not fit in its rows "
                f"({MOST_WORDS}, {MOST_VOLTAGES})"
            )

    @cython.ccall
    def update(self) -> cython.void:
        """Write a row if the plant has moved since the last one."""
        at: cython.longlong
        i: cython.longlong
        plant: Plant = self.plant
        wire: WordWire
        if self.step_times[1] == self.shown_end:
            return
        self.shown_end = self.step_times[1]
        at = STAGE_FIRST + (self.rows % STAGE_RING) * ROW_SIZE
        self.words[at + ROW_START] = self.step_times[0]
        self.words[at + ROW_END] = self.shown_end
        for i in range(self.word_count):
            wire = cython.cast(WordWire, self.wires[i])
            self.words[at + ROW_WORDS + i] = wire.board.words[wire.word]
        for i in range(self.voltage_count):
            self.doubles[at + ROW_ANALOG_START + i] = plant.analog_start[i]
            self.doubles[at + ROW_ANALOG_END + i] = plant.analog_end[i]
        self.rows += 1
        self.words[STAGE_ROWS] = self.rows


@cython.cclass
class Audience:
    """A board's side: copies a row into the arrays that the board's pins follow.

    `wires`: (place among the row's words, register) of its digital sensors.
    """

    words: cython.const[cython.longlong][::1]
    step_times: cython.longlong[::1]
    board_words: cython.longlong[::1]
    sources: cython.longlong[::1]
    registers: cython.longlong[::1]
    doubles: cython.const[cython.double][::1]
    analog_start: cython.double[::1]
    analog_end: cython.double[::1]
    rows: cython.longlong
    word_count: cython.longlong
    voltage_count: cython.longlong

    def __init__(self, words, doubles, step_times, analog_start, analog_end, board_words, wires) -> None:
        self.words = words
        self.doubles = doubles
        self.step_times = step_times
        self.analog_start = analog_start
        self.analog_end = analog_end
        self.board_words = board_words
        self.sources = array.array("q", [source for source, _ in wires])
        self.registers = array.array("q", [register for _, register in wires])
        self.word_count = len(wires)
        self.voltage_count = len(analog_start)
        self.rows = 0

    @cython.ccall
    @cython.exceptval(check=False)
    def row_start(self, row: cython.longlong) -> cython.longlong:
        """Start of the step of a row (ns)."""
        return self.words[STAGE_FIRST + (row % STAGE_RING) * ROW_SIZE]

    @cython.ccall
    def show(self, row: cython.longlong) -> cython.void:
        """Let the board's pins show this row from now on."""
        at: cython.longlong = STAGE_FIRST + (row % STAGE_RING) * ROW_SIZE
        i: cython.longlong
        self.step_times[0] = self.words[at + ROW_START]
        self.step_times[1] = self.words[at + ROW_END]
        for i in range(self.word_count):
            self.board_words[self.registers[i]] = self.words[at + ROW_WORDS + self.sources[i]]
        for i in range(self.voltage_count):
            self.analog_start[i] = self.doubles[at + ROW_ANALOG_START + i]
            self.analog_end[i] = self.doubles[at + ROW_ANALOG_END + i]
        self.rows = row + 1
