"""The loop of a board process: wait for a turn, run the board, answer.

The board itself is all in `Microcontroller.advance`; this module only brings its inputs and takes its outputs.
"""

import json
from typing import TYPE_CHECKING

import cython

from ranger_sim.firmware_sim.counters import as_dict
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.scheduler import SlotScheduler
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.events import (
    CAN_FILTER,
    CAN_MODE,
    CAN_REQUEST,
    CAN_RX,
    CAN_TX_DONE,
    PIN_EDGE,
    UART_BYTE,
    EventQueue,
)
from ranger_sim.harness.processes.activity import ActivityStore
from ranger_sim.harness.processes.channel import LONGEST, Bell, Mailbox
from ranger_sim.harness.processes.kinds import (
    FROM_BOARD,
    KINDS,
    NOTE,
    NOTE_ACTIVITY,
    NOTE_COUNTERS,
    SET_WORD,
    TO_BOARD,
)
from ranger_sim.harness.processes.lateness import bin_of
from ranger_sim.harness.processes.places import (
    ANSWER_USED,
    ANSWERED,
    ASK_USED,
    ASKED,
    BOARD_SLEEPS,
    COMMAND,
    COMMAND_ACTIVITY,
    COMMAND_ADVANCE,
    COMMAND_COUNTERS,
    COMMAND_STOP,
    DAMAGED,
    ERRORS,
    FRAMES_ONLY,
    LATE_COUNT,
    LATE_MAX,
    LATENESS,
    MAX_SLOT_CYCLES,
    NEXT_OUTPUT,
    NEXT_TIME,
    NEXT_TRANSMIT,
    NOTE_WORDS,
    OVERRUNS,
    PACE_TIME_NS,
    PACE_WALL_NS,
    PACE_WALL_PER_TIME,
    PACED,
    PLANT_SLEEPS,
    REACHED,
    RESULT,
    RESULT_DONE,
    RESULT_MORE,
    RING,
    RING_CYCLES,
    RING_LATE,
    RING_ROW,
    RING_ROWS,
    RING_START,
    ROWS,
    SLOT_COUNT,
    SLOT_TIME,
    SLOTS,
    STAGE_RING,
    TURNS,
    UNTIL,
    URGENT,
    WATCHED,
)

if TYPE_CHECKING:
    from ranger_sim.harness.processes.stage import Audience

# Kinds that wait for a task of a board that receives in its slots: edges, frames, bytes and freed buffers.
SLOT_KINDS = 1 << PIN_EDGE | 1 << CAN_RX | 1 << CAN_TX_DONE | 1 << UART_BYTE
LONGEST_TURN_NS = 1_000_000_000
ERRORS_EVERY = 1023  # turns; a mask. Some ten times a second
NOTE_BYTES = 8 * (NOTE_WORDS - 1)


@cython.cclass
class Endpoint:
    """Serves `board` over the block `shared`; `stage`: the two views of the stage; `audience`: its sensors."""

    board: Microcontroller
    counts_errors: cython.bint
    runs_c: cython.bint
    clock: object
    shared: object
    activity: object
    block: cython.longlong[::1]
    stage: cython.const[cython.longlong][::1]
    stage_doubles: cython.const[cython.double][::1]
    ask: Bell
    answer: Bell
    to_board: Mailbox
    from_board: Mailbox
    audience: "Audience"
    pending: EventQueue
    out: EventQueue
    slots_seen: cython.longlong
    cycles_seen: cython.longlong
    ring_first: cython.longlong
    turns: cython.longlong
    reached: cython.longlong
    can_wait: cython.longlong
    promised: cython.longlong

    def __init__(self, board, shared, stage, audience, place, in_slots) -> None:
        shared.check(place)
        self.board = board
        self.out = EventQueue()
        board.outbox = self.out  # its wires are in the plant's process
        self.shared = shared
        self.block = shared.words
        self.stage, self.stage_doubles = stage
        self.ask = Bell(shared.words, ASKED, BOARD_SLEEPS, shared.ask_descriptor)
        self.answer = Bell(shared.words, ANSWERED, PLANT_SLEEPS, shared.answer_descriptor)
        # a board that replaces another one continues where that one's turns ended
        self.turns = shared.words[ANSWERED]
        self.answer.rung = shared.words[ANSWERED]
        self.to_board = Mailbox(shared.words, f"to {board.name}", shared.to_board_first, SLOTS, ASK_USED, TO_BOARD)
        self.from_board = Mailbox(
            shared.words, f"from {board.name}", shared.from_board_first, SLOTS, ANSWER_USED, FROM_BOARD
        )
        self.audience = audience
        self.counts_errors = hasattr(board, "errors")
        self.runs_c = hasattr(board, "write_counts")
        self.activity: object = ActivityStore(board, shared.words)
        self.can_wait = SLOT_KINDS if in_slots else 0
        self.promised = 0
        self.clock: object = wallclock.monotonic_ns
        self.pending = EventQueue(64)
        self.slots_seen = board.scheduler.slot_count
        self.cycles_seen = board.scheduler.total_slot_cycles
        self.ring_first = shared.ring_first
        self.reached = 0

    @cython.ccall
    @cython.exceptval(check=True)
    def serve(self) -> cython.void:
        """Serve until ordered to stop."""
        command: cython.longlong
        while True:
            self.turns += 1
            while not self.ask.wait(self.turns):
                pass
            command = self.block[COMMAND]
            if command == COMMAND_STOP:
                return
            if command == COMMAND_ADVANCE:
                self._advance()
            elif command == COMMAND_COUNTERS:
                self.send_note(
                    NOTE_COUNTERS, json.dumps(as_dict(self.board.counters()), separators=(",", ":")).encode()
                )
                if self.runs_c:
                    self.board.write_counts()
            elif command == COMMAND_ACTIVITY:
                self.send_note(NOTE_ACTIVITY, self.activity.next())
            self.block[RESULT] = RESULT_MORE if self._put_out() else RESULT_DONE
            self._show()
            self.answer.ring()

    @cython.cfunc
    @cython.exceptval(check=True)
    def _advance(self) -> cython.void:
        """Read the inputs, and run step after step of the plant with its sensors' values."""
        until: cython.longlong = self.block[UNTIL]
        rows: cython.longlong = self.block[ROWS]
        start: cython.longlong
        if until < self.reached or (self.reached > 0 and until > self.reached + LONGEST_TURN_NS):
            self.to_board.damaged += 1
            self.to_board.last_damage = f"channel to {self.board.name}: a turn until {until} ns after {self.reached} ns"
            return
        self.to_board.until = until
        self.to_board.open()
        while self.to_board.take(self.board.inbox):
            pass
        if self.to_board.kinds & self.block[URGENT] or self.to_board.notes:
            self.promised = 0
        if self.to_board.notes:
            self.obey()
        if rows - self.audience.rows > STAGE_RING:
            self.audience.rows = rows - STAGE_RING
        while self.audience.rows < rows:
            start = self.audience.row_start(self.audience.rows)
            if start >= until:
                break
            self._run_to(start)
            self.audience.show(self.audience.rows)
        self._run_to(until)
        self.reached = until

    @cython.cfunc
    def _run_to(self, until: cython.longlong) -> None:
        """Run the board, and record how late its slots are."""
        board: Microcontroller = self.board
        if board.next_time < until or board.inbox.head_time < until:
            board.advance(until)
            self._keep_slots()

    @cython.cfunc
    @cython.exceptval(check=True)
    def _keep_slots(self) -> cython.void:
        """Copy the latest slots into the ring: in most calls none, or one that has begun and ended."""
        scheduler: SlotScheduler = self.board.scheduler
        begun: cython.bint = scheduler.slot_count != self.slots_seen
        closed: cython.longlong = scheduler.total_slot_cycles - self.cycles_seen
        before: cython.longlong = closed
        row: cython.longlong
        self.cycles_seen += closed
        if scheduler.done:
            before = closed - scheduler.last_slot_cycles if begun else 0
        if before > 0:  # of the slot before the latest
            row = self.block[RING_ROWS] - (1 if begun else 2)
            if row >= 0:
                self.block[self.ring_first + RING_ROW * (row % RING) + RING_CYCLES] = before
        if begun:
            self.slots_seen = scheduler.slot_count
            row = self.ring_first + RING_ROW * (self.block[RING_ROWS] % RING)
            self.block[row + RING_START] = scheduler.slot_time
            self.block[row + RING_CYCLES] = 0
            self.block[row + RING_LATE] = self._late()
            self.block[RING_ROWS] += 1
        if scheduler.done and closed > 0 and self.block[RING_ROWS] > 0:
            row = self.ring_first + RING_ROW * ((self.block[RING_ROWS] - 1) % RING)
            self.block[row + RING_CYCLES] = scheduler.last_slot_cycles

    @cython.cfunc
    @cython.exceptval(-2, check=True)
    def _late(self) -> cython.longlong:
        """Compare the start of a slot with the wall clock; ns, -1 where no pace is kept."""
        due: cython.longlong
        late: cython.longlong
        place: cython.longlong
        if self.stage[PACED] == 0:
            return -1
        due = self.stage[PACE_WALL_NS] + int(
            (self.board.scheduler.slot_time - self.stage[PACE_TIME_NS]) * self.stage_doubles[PACE_WALL_PER_TIME]
        )
        late = self.clock()
        late -= due
        if late < 0:
            late = 0
        if late > self.block[LATE_MAX]:
            self.block[LATE_MAX] = late
        self.block[LATE_COUNT] += 1
        place = bin_of(late // 1000)
        self.block[LATENESS + place] += 1
        return late

    @cython.cfunc
    def _put_out(self) -> cython.bint:
        """Put the board's outputs into the mailbox; True when more is left than fits."""
        out: EventQueue = self.out
        frames_only: cython.bint = self.block[FRAMES_ONLY] != 0
        while True:
            if self.from_board.used + LONGEST > self.from_board.slots:
                self.from_board.send()
                return out.count > 0 or self.pending.count > 0
            if out.take():
                if out.time < self.promised:
                    self.broke_its_promise()
                if not frames_only or CAN_REQUEST <= out.kind <= CAN_MODE or out.kind == CAN_FILTER:
                    self.from_board.put(out)
            elif self.pending.take():
                self.from_board.put(self.pending)
            else:
                break
        self.from_board.send()
        return False

    @cython.cfunc
    def _show(self) -> None:
        """Update the words that the plant's process and the supervisor read."""
        board: Microcontroller = self.board
        self.block[NEXT_TIME] = board.next_time
        # more than the mailbox held goes out in the next turn, whatever that turn is
        self.promised = 0 if self.out.count > 0 else board.quiet_until()
        self.block[NEXT_OUTPUT] = self.promised
        self.block[NEXT_TRANSMIT] = 0 if self.out.count > 0 else board.earliest_transmit_ns()
        self.block[URGENT] = board.urgent_kinds() & ~self.can_wait
        self.block[SLOT_TIME] = board.latest_slot()
        self.block[SLOT_COUNT] = board.scheduler.slot_count
        self.block[OVERRUNS] = board.scheduler.overruns
        self.block[MAX_SLOT_CYCLES] = board.scheduler.max_slot_cycles
        self.block[WATCHED] = board.watched()
        self.block[DAMAGED] = self.to_board.damaged
        self.block[REACHED] = self.reached
        self.block[TURNS] += 1
        if (self.block[TURNS] & ERRORS_EVERY) == 1 and self.counts_errors:
            self.block[ERRORS] = sum(self.board.errors.totals)

    def broke_its_promise(self) -> None:
        """Report an output before the time promised in the last answer: the plant has continued without it."""
        out = self.out
        kind = KINDS[out.kind].name if out.kind in KINDS else f"kind {out.kind}"
        raise RuntimeError(f"{kind} put out at {out.time} ns, but nothing was to come before {self.promised} ns")

    def obey(self) -> None:
        """Handle messages that are for this process."""
        for kind, _time, _order, a, b, *_rest in self.to_board.notes:
            if kind == SET_WORD:
                self.board.store.set_word(a, b, self.board.time.ms)
        self.to_board.notes.clear()

    def send_note(self, what, data) -> None:
        """Queue bytes for the other side, in parts."""
        parts = [data[i : i + NOTE_BYTES] for i in range(0, len(data), NOTE_BYTES)] or [b""]
        for number, part in enumerate(parts):
            self.pending.push(self.reached, 0, NOTE, what, number, len(parts), 0, 0, 0, part)
