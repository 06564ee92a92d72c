"""A board that runs in a process of its own, as the lockstep of the plant process sees it.

`inbox` and `outbox` are those of the board that this process built and wired but does not run (its shadow): what
is pushed into the inbox goes through the channel when the board is next asked to run, what the board put out
comes back onto the board's wires. `begin(until)` posts the request, so that all boards of a window run at the same
time; `advance(until)` waits for the answer.

A board is asked only when that can matter. With each answer it says before which instant it puts nothing out;
until then it is left alone, unless something comes in that may make it answer at once (`urgent_kinds`). It then runs
the missed time later, and reads its sensors from the stage's rows of that time.
"""

import cython

from ranger_sim.firmware_sim.microcontroller import EdgeLine, Microcontroller
from ranger_sim.foundation.events import EventQueue
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes import block as places
from ranger_sim.harness.processes.channel import Bell, Mailbox
from ranger_sim.harness.processes.kinds import FROM_BOARD, TO_BOARD

if not cython.compiled:
    from ranger_sim.harness.processes.plain import load


class RemoteBoard(Microcontroller):
    """`shadow`: the wired board object of this process. `urgent_kinds`: message kinds (bits) that cannot wait.

    `follows_steps`: the plant's process reads what this board shows (the main brain's table and swing leg) after
    every step of the plant, so it is up to date by then.
    """

    def __init__(self, shadow, shared, stage, place, follows_steps) -> None:
        Microcontroller.__init__(self, shadow.name, shadow.hz, shadow.crystal)
        shared.check(place)
        self.shadow = shadow
        self.inbox = shadow.inbox
        self.outbox = shadow.outbox
        self.first_line = shadow.first_line
        self.second_line = shadow.second_line
        self.next_time = shadow.next_time
        self.block = shared.words
        self.ask = Bell(shared.words, places.ASKED, places.BOARD_SLEEPS, shared.ask_descriptor)
        self.answer = Bell(shared.words, places.ANSWERED, places.PLANT_SLEEPS, shared.answer_descriptor)
        self.to_board = Mailbox(
            shared.words, f"to {self.name}", shared.to_board_first, places.SLOTS, places.ASK_USED, TO_BOARD
        )
        self.from_board = Mailbox(
            shared.words, f"from {self.name}", shared.from_board_first, places.SLOTS, places.ANSWER_USED, FROM_BOARD
        )
        self.stage = stage
        self.place = place
        self.urgent_kinds = 0xFFFF  # all, until the board has said which
        self.follows_steps = follows_steps
        self.estimator = getattr(shadow, "estimator", None)
        self.posted = False
        self.gone = False
        self.quiet_until = 0
        self.turns = 0
        self.reached = 0

    def edges_came(self) -> cython.longlong:
        """Edges travel as messages to a board that cannot see the sensor's buffer."""
        self._send_edges(self.first_line)
        self._send_edges(self.second_line)
        return self.edge_time

    def _send_edges(self, line: EdgeLine) -> cython.void:
        """Make messages of the edges that have come on one line."""
        while line.find_next() < 1 << 62:
            line.buffer.read += 1
            # order 256: stage pins; kind 1: PIN_EDGE
            self.inbox.put(line.next_time, 256, 1, line.pin, line.levels >> 1, line.partner_pin, line.levels & 1, 0, 0)

    def begin(self, until: cython.longlong) -> cython.void:
        """Ask the board to run everything before `until` (ns), if that can matter already."""
        if self.posted:
            return
        if self.gone:
            self.inbox.clear()
            return
        self.stage.update()
        if (
            until <= self.quiet_until
            and not (self.follows_steps and until >= self.stage.shown_end)
            and not self._urgent(until)
        ):
            return
        self._post(1, until)

    def advance(self, until: cython.longlong) -> cython.longlong:
        """What the board put out before `until` comes into the outbox; returns the instant of its next event."""
        self.horizon = until
        if not self.posted:
            self.begin(until)
        if self.posted:
            self._collect()
        if self.gone:
            self.next_time = 1 << 62
        return self.next_time

    def catch_up(self, until) -> None:
        """Bring a board that was left alone up to `until` (ns): before anybody looks at it."""
        if self.gone or self.reached >= until:
            return
        self.stage.update()
        self._post(places.COMMAND_ADVANCE, until)
        self._collect()

    def command(self, command) -> None:
        """One turn with another command; what the board answers lies in the notes of `from_board`."""
        if not self.gone:
            self._post(command, self.reached)
            self._collect()

    def dismiss(self) -> None:
        """Tell the board's process to end; nothing is answered."""
        if not self.gone:
            self._ring(places.COMMAND_STOP, self.reached)
            self.posted = False
            self.gone = True

    def send(self, kind, time, a, b) -> None:
        """A message of our own kind to the board, in the next turn."""
        if self.gone:
            raise UserError(f"{self.name} is gone")
        self.inbox.push(time, 0, kind, a, b)

    def _urgent(self, until: cython.longlong) -> cython.bint:
        """True when a message before `until` may make the board put something out at once."""
        inbox: EventQueue = self.inbox
        at: cython.longlong = inbox.head
        waiting: cython.longlong = 0
        kind: cython.longlong
        while at < inbox.tail and inbox.rows[at] < until:
            kind = inbox.rows[at + 2]
            if kind >= 60 or self.urgent_kinds >> kind & 1:
                return True
            waiting += 1
            if waiting > 200:
                return True
            at += 10  # ROW
        return False

    def _post(self, command: cython.longlong, until: cython.longlong) -> cython.void:
        """Write what has come for the board, and the instant, and ring."""
        while self.inbox.head_time < until and command == 1:
            self.to_board.until = until
            if self.to_board.used + 23 > self.to_board.slots:  # longest message: channel.LONGEST
                # more than a mailbox holds: a turn up to the first message that does not fit
                self._ring(command, self.inbox.head_time)
                if not self._collect():
                    return
                continue
            self.inbox.take()
            self.to_board.put(self.inbox)
        self._ring(command, until)

    def _ring(self, command: cython.longlong, until: cython.longlong) -> None:
        """Hand the turn over."""
        self.to_board.send()
        self.block[18] = command  # COMMAND
        self.block[19] = until  # UNTIL
        self.block[21] = self.stage.rows  # ROWS
        self.reached = until
        self.turns += 1
        self.posted = True
        self.ask.ring()

    def _collect(self) -> cython.bint:
        """Wait for the answer and take it; False when the board is gone."""
        more: cython.bint = True
        self.posted = False
        while more:
            while True:
                if load(self.block, 56) != 0:  # FATE: looked at before every sleep, as its ring wakes only once
                    self.gone = True
                    self.inbox.clear()
                    return False
                if self.answer.wait(self.ask.rung):
                    break
            self.from_board.until = self.reached
            self.from_board.open()
            while self.from_board.take(self.outbox):
                pass
            more = self.block[34] == 1  # RESULT, RESULT_MORE
            if more:
                self.block[18] = 2  # COMMAND, COMMAND_MORE
                self.block[20] = 0  # ASK_USED
                self.ask.ring()
        self.next_time = self.block[35]
        self.quiet_until = self.block[36]
        self.urgent_kinds = self.block[49]
        if self.estimator is not None:
            self.estimator.swing_leg = self.block[38]
            self.shadow.scheduler.slot_time = self.block[39]
        return True
