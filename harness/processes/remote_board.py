"""A board that runs in a separate process, as the lockstep of the plant's process sees it.

Its inbox is that of the board that this process built but does not run: what is pushed into it goes through the
channel when the board is next asked to run. The board's outputs come back onto the wires. `begin(until)` posts the
request, so that all boards of a window run at the same time; `advance(until)` waits for the answer.

A board is asked only when that can matter. Each answer states a time before which it puts nothing out; before that it
is left alone, unless an input arrives that may make it answer at once (`urgent_kinds`). A board whose frames wait for
its tasks is asked when it may use a bus; for what else it puts out, at the end of a step of the plant, and where
nothing takes that, not even then. It runs the time that it was left alone for later, with the sensors' values of that
time.
"""

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import cython

from ranger_sim.firmware_sim.board import EVERY_KIND, Board
from ranger_sim.firmware_sim.counters import from_dict
from ranger_sim.firmware_sim.edge_line import EdgeLine
from ranger_sim.foundation.edge_buffer import EdgeBuffer
from ranger_sim.foundation.events import NEVER, ORDER_PINS, PIN_EDGE, ROW, ROW_KIND, EventQueue
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes.activity import RemoteActivity
from ranger_sim.harness.processes.channel import FIRST_OWN_KIND, LONGEST, Bell, Mailbox
from ranger_sim.harness.processes.kinds import FROM_BOARD, NOTE, NOTE_COUNTERS, TO_BOARD
from ranger_sim.harness.processes.places import (
    ALIVE,
    ANSWER_USED,
    ANSWERED,
    ASK_USED,
    ASKED,
    AWAITED,
    BOARD_SLEEPS,
    COMMAND,
    COMMAND_ADVANCE,
    COMMAND_COUNTERS,
    COMMAND_MORE,
    COMMAND_STOP,
    FATE,
    FRAMES_ONLY,
    NEXT_OUTPUT,
    NEXT_TIME,
    NEXT_TRANSMIT,
    PACED,
    PLANT_SLEEPS,
    RESULT,
    RESULT_MORE,
    RING,
    RING_ROW,
    RING_ROWS,
    ROWS,
    SLOT_TIME,
    SLOTS,
    STAGE_RING,
    UNTIL,
    URGENT,
    WAITS,
    WATCHED,
)
from ranger_sim.harness.processes.shared_words import load
from ranger_sim.harness.wiring.board_wires import BoardWires

if TYPE_CHECKING:
    from ranger_sim.harness.processes.stage import Stage

MOST_WAITING: Final = 200  # messages that may wait for a board that is left alone: some two thirds of its queue


@cython.cclass
class RemoteBoard(Board):
    """A proxy of the board `built`, which was built in this process; `shared`: the block of its own process.

    Inputs other than messages and edges are on the `stage`. `urgent`: message kinds (bits) that cannot wait.

    `follows_steps`: the plant's process reads this board's state (the main brain's table and swing leg) after
    every step of the plant, so it is up to date by then.
    """

    block: cython.longlong[::1]
    private: cython.longlong[::1]
    ask: Bell
    answer: Bell
    to_board: Mailbox
    from_board: Mailbox
    stage: "Stage"
    lines: list
    counted: object
    uncounted: object
    log: object
    posted: cython.bint
    gone: cython.bint
    follows_steps: cython.bint
    ring_first: cython.longlong
    place: cython.longlong
    silent_until: cython.longlong
    next_transmit: cython.longlong
    rows_shown: cython.longlong
    paced: cython.bint
    urgent: cython.longlong
    turns: cython.longlong
    reached: cython.longlong
    watched_number: cython.longlong
    slot_time: cython.longlong

    def __init__(self, built, shared, stage, place, follows_steps) -> None:
        Board.__init__(self, built.name)
        shared.check(place)
        self.out_of_process = True
        self.inbox = built.inbox
        self.next_time = built.next_time
        if shared.table_words:
            self.memory = shared.table()
        self.lines = []
        self.watched_number = built.watched()
        self.slot_time = built.latest_slot()
        self.counted = None
        self.log = RemoteActivity(self, shared.words, built.scheduler.log)
        self.uncounted = built.counters()
        self.block = shared.words
        self.private = shared.private
        self.ring_first = shared.ring_first
        self.ask = Bell(shared.words, ASKED, BOARD_SLEEPS, shared.ask_descriptor)
        self.answer = Bell(shared.words, ANSWERED, PLANT_SLEEPS, shared.answer_descriptor)
        self.to_board = Mailbox(shared.words, f"to {self.name}", shared.to_board_first, SLOTS, ASK_USED, TO_BOARD)
        self.from_board = Mailbox(
            shared.words, f"from {self.name}", shared.from_board_first, SLOTS, ANSWER_USED, FROM_BOARD
        )
        self.stage = stage
        self.place = place
        self.urgent = EVERY_KIND  # until the board has reported which
        self.follows_steps = follows_steps
        self.posted = False
        self.gone = False
        self.silent_until = 0
        self.next_transmit = 0
        self.rows_shown = 0  # rows of the stage up to its latest turn
        self.paced = False
        self.turns = 0
        self.reached = 0

    def connect_edges(self, buffer: EdgeBuffer, pin: cython.longlong, partner_pin: cython.longlong) -> None:
        """Send edges of `buffer` to `pin` of the board with the level of `partner_pin`; `note_edges` reports them."""
        self.lines.append(EdgeLine(buffer, pin, partner_pin))

    def note_edges(self) -> cython.longlong:
        """Turn new edges into messages: the board cannot see the sensors' buffers."""
        line: EdgeLine
        for line in self.lines:
            while line.find_next() < NEVER:
                line.buffer.read += 1
                self.inbox.put(
                    line.next_time,
                    ORDER_PINS,
                    PIN_EDGE,
                    line.pin,
                    line.levels >> 1,
                    line.partner_pin,
                    line.levels & 1,
                    0,
                    0,
                )
        return self.edge_time

    def stop_at(self, time: cython.longlong) -> cython.longlong:
        """Return where it stops, as requested: it has already run when its outputs arrive."""
        return self.horizon

    def watched(self) -> cython.longlong:
        """The value of `watched` of the board in its process at the end of its latest turn."""
        return self.watched_number

    def latest_slot(self) -> cython.longlong:
        """Start of its latest slot (ns), as of the end of its latest turn."""
        return self.slot_time

    def refuse_output(self, text) -> None:
        """Count it as damage: what is in another process must not end this one."""
        self.from_board.note_damage(text)

    def begin(self, until: cython.longlong) -> cython.void:
        """Ask the board to run everything before `until` (ns), if that can matter already."""
        if self.posted:
            return
        if self.gone:
            self.inbox.clear()
            return
        self.stage.update()
        if (
            until <= self.silent_until
            and not (self.follows_steps and until >= self.stage.shown_end)
            and not self._urgent(until)
        ):
            return
        self._post(COMMAND_ADVANCE, until)

    def advance(self, until: cython.longlong) -> cython.longlong:
        """Move the board's outputs before `until` into the outbox; returns the time of its next event."""
        self.horizon = until
        if not self.posted:
            self.begin(until)
        if self.posted:
            self._collect()
        if self.gone:
            self.next_time = NEVER
        return self.next_time

    def catch_up(self, until) -> None:
        """Bring a board that was left alone up to `until` (ns): before its state is read."""
        if self.gone or self.reached >= until:
            return
        self.stage.update()
        self._post(COMMAND_ADVANCE, until)
        self._collect()

    def command(self, command) -> None:
        """Run one turn with another command; the board's answer is in the notes of `from_board`."""
        if not self.gone:
            self._post(command, self.reached)
            self._collect()

    def leave(self) -> None:
        """Note that it has no process any more: nothing is asked, and its inputs are lost."""
        self.gone = True

    def reset_channel(self) -> None:
        """Reset the channel for a new process: no turn is open, both mailboxes are empty."""
        self.posted = False
        self.block[ASKED] = self.block[ANSWERED] = self.ask.rung
        self.block[ASK_USED] = self.block[ANSWER_USED] = 0
        self.to_board.sequence = self.from_board.sequence = 0
        self.to_board.used = 0

    def come_back(self, now, power_up_ns) -> None:
        """Note that it has a process again, which has run until `now` (ns), and powers up at `power_up_ns`."""
        self.gone = False
        self.next_time = power_up_ns
        self.silent_until = self.next_transmit = 0
        self.reached = now

    def fetch_counters(self) -> None:
        """Ask the board for its counters; `counters` returns them from then on."""
        counters = self.notes_of(COMMAND_COUNTERS, NOTE_COUNTERS)
        if not self.gone:
            try:
                self.counted = from_dict(type(self.uncounted), json.loads(counters))
            except (ValueError, TypeError, AttributeError, RecursionError):  # its program wrote over its memory
                self.from_board.damaged += 1
                self.from_board.last_damage = f"channel from {self.name}: its counters are not readable"

    def notes_of(self, command, what) -> bytes:
        """Run one turn with `command`; returns the bytes of the board's notes of the kind `what`."""
        self.from_board.notes.clear()
        self.command(command)
        parts = [note for note in self.from_board.notes if note[0] == NOTE and note[3] == what]
        parts.sort(key=lambda note: note[4])
        return b"".join(note[-1] for note in parts)

    def activity(self) -> object:
        """Its activity log, kept in its own process: rows come when it is flushed."""
        return self.log

    def slots_since(self, row) -> tuple:
        """Slots that have ended, from number `row` on: (bytes of RING_ROW words each, number of the next, missed ones).

        The board's process has written them; reading them asks nothing of it.
        """
        end = max(self.block[RING_ROWS] - 1, row)  # the latest may not have ended
        first = max(row, end - RING + 2)  # the oldest of a full ring may be overwritten at any moment
        words = memoryview(self.block)[self.ring_first : self.ring_first + RING * RING_ROW]
        head, tail = RING_ROW * (first % RING), RING_ROW * (end % RING)
        if first == end:
            return b"", end, first - row
        if head < tail:
            return words[head:tail].tobytes(), end, first - row
        return words[head:].tobytes() + words[:tail].tobytes(), end, first - row

    def counters(self) -> object:
        """The board's counters, as last fetched; only its last slot where it had ended by then."""
        if self.counted is not None:
            return self.counted
        return replace(
            self.uncounted, slots=replace(self.uncounted.slots, latest_ns=self.slot_time, finished_ns=self.slot_time)
        )

    def dismiss(self) -> None:
        """Order the board's process to end; there is no answer."""
        if not self.gone:
            self._ring(COMMAND_STOP, self.reached)
            self.posted = False
            self.gone = True

    def send(self, kind, time, a, b) -> None:
        """Send the board a message of a kind private to the processes, in the next turn."""
        if self.gone:
            raise UserError(f"{self.name} is gone")
        self.inbox.push(time, 0, kind, a, b)

    def earliest_transmit_ns(self) -> cython.longlong:
        """Earliest time (ns) at which the board can send on a bus, unless an urgent message arrives.

        A board that keeps a pace runs when it has something to do: its lateness is measured.
        """
        return self.next_time if self.paced else self.next_transmit

    def can_wait(self, until: cython.longlong) -> cython.bint:
        """Whether only buses take what it puts out, and its inputs up to `until` (ns) fit until it next runs."""
        wires: BoardWires = self.outbox
        if self.paced or self.follows_steps or self.gone or not wires.frames_only():
            return False
        self.stage.update()
        return self.stage.rows - self.rows_shown < STAGE_RING and not self._urgent(until)

    @cython.cfunc
    @cython.exceptval(check=False)
    def _urgent(self, until: cython.longlong) -> cython.bint:
        """True when a message before `until` may make the board put something out at once."""
        inbox: EventQueue = self.inbox
        at: cython.longlong = inbox.head
        waiting: cython.longlong = 0
        kind: cython.longlong
        while at < inbox.tail and inbox.rows[at] < until:
            kind = inbox.rows[at + ROW_KIND]
            if kind >= FIRST_OWN_KIND or self.urgent >> kind & 1:
                return True
            waiting += 1
            if waiting > MOST_WAITING:
                return True
            at += ROW
        return False

    @cython.cfunc
    @cython.exceptval(check=True)
    def _post(self, command: cython.longlong, until: cython.longlong) -> cython.void:
        """Write the board's inputs and the time, and ring."""
        while self.inbox.head_time < until and command == COMMAND_ADVANCE:
            self.to_board.until = until
            if self.to_board.used + LONGEST > self.to_board.slots:
                # more than a mailbox holds: a turn up to the first message that does not fit
                self._ring(command, self.inbox.head_time)
                if not self._collect():
                    return
                continue
            self.inbox.take()
            self.to_board.put(self.inbox)
        self._ring(command, until)

    @cython.cfunc
    def _ring(self, command: cython.longlong, until: cython.longlong) -> None:
        """Pass the turn on."""
        wires: BoardWires | None = self.outbox if isinstance(self.outbox, BoardWires) else None
        self.to_board.send()
        self.block[COMMAND] = command
        self.block[UNTIL] = until
        self.block[ROWS] = self.rows_shown = self.stage.rows
        self.block[FRAMES_ONLY] = wires is not None and wires.frames_only()
        self.paced = self.stage.words[PACED] != 0
        self.reached = until
        self.turns += 1
        self.posted = True
        self.ask.ring()

    @cython.cfunc
    def _collect(self) -> cython.bint:
        """Wait for the answer and read it; False when the board is gone."""
        more: cython.bint = True
        self.posted = False
        self.private[WAITS] += 1
        self.private[AWAITED] = 1
        while more:
            while True:
                if load(self.private, FATE) != ALIVE:  # checked before every sleep, because its ring wakes only once
                    self.private[AWAITED] = 0
                    self.gone = True
                    self.inbox.clear()
                    return False
                if self.answer.wait(self.ask.rung):
                    break
            self.from_board.until = self.reached
            self.from_board.open()
            while self.from_board.take(self.outbox):
                pass
            more = self.block[RESULT] == RESULT_MORE
            if more:
                self.block[COMMAND] = COMMAND_MORE
                self.block[ASK_USED] = 0
                self.ask.ring()
        self.private[AWAITED] = 0
        self.next_time = self.block[NEXT_TIME]
        self.silent_until = self.block[NEXT_OUTPUT]
        self.next_transmit = self.block[NEXT_TRANSMIT]
        self.urgent = self.block[URGENT]
        self.watched_number = self.block[WATCHED]
        self.slot_time = self.block[SLOT_TIME]
        return True
