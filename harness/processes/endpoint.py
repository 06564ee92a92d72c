"""The loop of a board process: wait for a turn, run the board, answer.

Everything about the board is `Microcontroller.advance`; here is only what brings its inputs and takes its outputs.
"""

import json

import cython

from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.events import CAN_RX, CAN_TX_DONE, PIN_EDGE, UART_BYTE, EventQueue
from ranger_sim.harness.processes import block as places
from ranger_sim.harness.processes import snapshot
from ranger_sim.harness.processes.channel import Bell, Mailbox
from ranger_sim.harness.processes.kinds import FROM_BOARD, KINDS, NOTE, NOTE_SNAPSHOT, NOTE_WORDS, SET_WORD, TO_BOARD
from ranger_sim.harness.processes.lateness import bin_of
from ranger_sim.harness.wiring import HEAR_IN_SLOTS

EVERYTHING = 0xFFFF  # bits of all message kinds to a board
NOTE_BYTES = 8 * (NOTE_WORDS - 1)


class Endpoint:
    """Serves `board` over the block `shared`; `stage`: the two views of the stage; `audience`: its sensors."""

    def __init__(self, board, shared, stage, audience, place) -> None:
        shared.check(place)
        self.board = board
        self.out = EventQueue()
        board.outbox = self.out  # its wires are in the plant's process
        self.shared = shared
        self.block = shared.words
        self.stage, self.stage_doubles = stage
        self.ask = Bell(shared.words, places.ASKED, places.BOARD_SLEEPS, shared.ask_descriptor)
        self.answer = Bell(shared.words, places.ANSWERED, places.PLANT_SLEEPS, shared.answer_descriptor)
        # a board that takes another one's place goes on where that one's turns ended
        self.turns = shared.words[places.ANSWERED]
        self.answer.rung = shared.words[places.ANSWERED]
        self.to_board = Mailbox(
            shared.words, f"to {board.name}", shared.to_board_first, places.SLOTS, places.ASK_USED, TO_BOARD
        )
        self.from_board = Mailbox(
            shared.words, f"from {board.name}", shared.from_board_first, places.SLOTS, places.ANSWER_USED, FROM_BOARD
        )
        self.audience = audience
        errors = getattr(board, "errors", None)
        self.totals: object = None if errors is None else errors.totals
        self.router = getattr(board, "router", None)
        self.urgent_kinds = EVERYTHING
        if board.name in HEAR_IN_SLOTS:
            # edges, frames, bytes and buffers that come free wait for a task
            self.urgent_kinds &= ~(1 << PIN_EDGE | 1 << CAN_RX | 1 << CAN_TX_DONE | 1 << UART_BYTE)
        self.promised = 0
        self.estimator = getattr(board, "estimator", None)
        self.clock: object = wallclock.monotonic_ns
        self.pending = EventQueue(64)
        self.slots_seen = 0
        self.reached = 0

    def serve(self) -> cython.void:
        """Until told to stop."""
        command: cython.longlong
        while True:
            self.turns += 1
            while not self.ask.wait(self.turns):
                pass
            command = self.block[18]  # COMMAND
            if command == 4:  # COMMAND_STOP
                return
            if command == 1:  # COMMAND_ADVANCE
                self._advance()
            elif command == 3:  # COMMAND_SNAPSHOT
                self.tell(NOTE_SNAPSHOT, snapshot.take(self.board))
            self.block[34] = 1 if self._put_out() else 0  # RESULT
            self._show()
            self.answer.ring()

    def _advance(self) -> cython.void:
        """Take in what came, and run; step after step of the plant, as its sensors showed them."""
        until: cython.longlong = self.block[19]  # UNTIL
        rows: cython.longlong = self.block[21]  # ROWS
        start: cython.longlong
        if until < self.reached or (self.reached > 0 and until > self.reached + 1000000000):
            self.to_board.damaged += 1
            self.to_board.last_damage = f"channel to {self.board.name}: a turn until {until} ns after {self.reached} ns"
            return
        self.to_board.until = until
        self.to_board.open()
        while self.to_board.take(self.board.inbox):
            pass
        if self.to_board.kinds & self.block[49] or self.to_board.notes:  # URGENT
            self.promised = 0
        if self.to_board.notes:
            self.obey()
        if rows - self.audience.rows > 64:
            self.audience.rows = rows - 64
        while self.audience.rows < rows:
            start = self.audience.row_start(self.audience.rows)
            if start >= until:
                break
            self._run_to(start)
            self.audience.show(self.audience.rows)
        self._run_to(until)
        self.reached = until

    def _run_to(self, until: cython.longlong) -> None:
        """Run the board, and note how late its slots are."""
        board: Microcontroller = self.board
        if board.next_time < until or board.inbox.head_time < until:
            board.advance(until)
            if board.scheduler.slot_count != self.slots_seen:
                self._late()

    def _late(self) -> cython.void:
        """A slot has begun: hold its instant against the wall clock."""
        due: cython.longlong
        late: cython.longlong
        place: cython.longlong
        self.slots_seen = self.board.scheduler.slot_count
        if self.stage[3] == 0:  # PACED
            return
        due = self.stage[4] + int((self.board.scheduler.slot_time - self.stage[5]) * self.stage_doubles[6])
        late = self.clock()
        late -= due
        if late < 0:
            late = 0
        if late > self.block[46]:  # LATE_MAX
            self.block[46] = late
        self.block[47] += 1  # LATE_COUNT
        place = bin_of(late // 1000)
        self.block[128 + place] += 1  # LATENESS

    def _put_out(self) -> cython.bint:
        """What the board put out goes into the mailbox; True when more is left than fits."""
        out: EventQueue = self.out
        while True:
            if self.from_board.used + 23 > self.from_board.slots:  # longest message: channel.LONGEST
                self.from_board.send()
                return out.count > 0 or self.pending.count > 0
            if out.take():
                if out.time < self.promised:
                    self.broke_its_promise()
                self.from_board.put(out)
            elif self.pending.take():
                self.from_board.put(self.pending)
            else:
                break
        self.from_board.send()
        return False

    def _show(self) -> None:
        """The words that the plant's process and the supervisor look at."""
        board: Microcontroller = self.board
        self.block[35] = board.next_time  # NEXT_TIME
        self.promised = self._next_output()
        self.block[36] = self.promised  # NEXT_OUTPUT
        self.block[49] = self.urgent_kinds  # URGENT
        if self.router is not None and self.router.waiting == 0:
            self.block[49] = (
                self.urgent_kinds & ~8
            )  # a transmit buffer comes free (CAN_TX_DONE) and nothing waits for it
        self.block[39] = board.scheduler.slot_time  # SLOT_TIME
        self.block[40] = board.scheduler.slot_count  # SLOT_COUNT
        self.block[41] = board.scheduler.overruns  # OVERRUNS
        self.block[42] = board.scheduler.max_slot_cycles  # MAX_SLOT_CYCLES
        self.block[44] = self.to_board.damaged  # DAMAGED
        self.block[45] = self.reached  # REACHED
        self.block[48] += 1  # TURNS
        if (self.block[48] & 1023) == 1 and self.totals is not None:  # some ten times a second
            self.block[43] = sum(self.totals)  # ERRORS
        if self.estimator is not None:
            self.block[38] = self.estimator.swing_leg  # SWING_LEG

    def _next_output(self) -> cython.longlong:
        """Before this instant (ns) the board puts nothing out, whatever comes in of a kind that can wait."""
        board: Microcontroller = self.board
        if self.out.count > 0:  # more than the mailbox held: it goes out in the next turn, whatever that turn is
            return 0
        if not board.scheduler.done or board.vic.pending != 0:
            return 0
        if board.background is not None and board.background_wanted:
            return 0
        return board.alarm_time  # the slot timer's match is one, too

    def broke_its_promise(self) -> None:
        """An output before the instant that the last answer named: the plant has gone on without it."""
        out = self.out
        kind = KINDS[out.kind].name if out.kind in KINDS else f"kind {out.kind}"
        raise RuntimeError(f"{kind} put out at {out.time} ns, but nothing was to come before {self.promised} ns")

    def obey(self) -> None:
        """Messages that are for this process."""
        for kind, _time, _order, a, b, *_rest in self.to_board.notes:
            if kind == SET_WORD:
                self.board.store.set_word(a, b, self.board.time.ms)
        self.to_board.notes.clear()

    def tell(self, what, content) -> None:
        """Queue a dictionary for the other side, as JSON in parts."""
        data = json.dumps(content, separators=(",", ":")).encode()
        parts = [data[i : i + NOTE_BYTES] for i in range(0, len(data), NOTE_BYTES)] or [b""]
        for number, part in enumerate(parts):
            self.pending.push(self.reached, 0, NOTE, what, number, len(parts), 0, 0, 0, part)
