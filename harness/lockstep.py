# cython: boundscheck=False, wraparound=False
# (every index below counts boards, buses or wires, or is in a table filled when the robot is wired)
"""The loop that everything serves: conservative simulation with lookahead, in virtual time.

    plant -> sensors -> pins -> interrupts and slots -> data table -> CAN -> router -> main brain
          -> CAN -> slots -> PWM -> plant

Boards, buses and plant each have their own events, each at a time. In conservative simulation nothing runs past a time
at which something may still reach it, so nothing is ever taken back. How far ahead of the others a board may run safely
is its lookahead: the least time in which an output of another board can arrive.

The lookahead is 31 us (WINDOW_NS). It is shorter than the shortest frame on Ranger's buses: the receivers have it
35.6 us after its start. And it is shorter than the pause between two exchanges on the serial link: 34.67 us, less the
1.7 us by which a frame's interrupt can delay the start of the first. So the result depends neither on the order in
which boards run nor on how far each of them runs.

Within a step of the plant the board that is due first runs, to 31 us beyond the time at which the next board or bus
is due. It stops earlier where an answer to its own output could reach it (`Board.stop_at`). The order at one time
is: plant, pins, buses, then the boards with their interrupts and slots, then their outputs.

A board is due when it has something to do: an alarm, a slot, a task, an interrupt, a message. On some boards frames,
edges and bytes wait for a task (`receives_in_its_slots`). Such a board is due only when it may put something on a bus
(`Board.earliest_transmit_ns`). Before that the loop leaves it alone; it then handles everything else late, each event
at its time. Edges and voltages are kept for one step of the plant, so the board has caught up with its own events by
the end of the step. A frame or a byte that it has only received may wait longer: until the board is due, or `run`
returns.

Boards that run out of process (`Board.out_of_process`), one process each, run in parallel: in windows as long as the
lookahead, each from the first time at which anything is due, all boards that are due in a window at once.

ROBOT PARITY: the plant moves in steps of 250 us. What a board writes to its bridge acts from the next step on, so up
to 250 us late. Sensors show a straight line over a step (voltages) or a constant (words).
"""

import array
from typing import Final

import cython

from ranger_sim.can_bus.bus import Bus
from ranger_sim.firmware_sim.board import Board
from ranger_sim.foundation.events import NEVER
from ranger_sim.foundation.numbers import integers
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.records.sampler import Sampler
from ranger_sim.harness.step_watch import SerialDevice, StepEnd, StepWatch
from ranger_sim.harness.wiring.board_wires import BoardWires, SspWire, WordWire
from ranger_sim.plant.plant import Plant

# Why `run` returned.
REACHED_TIME: Final = 0
REACHED_STEPS: Final = 1
REACHED_DISTANCE: Final = 2
FELL: Final = 3
A_WATCHER_STOPPED: Final = 4

WINDOW_NS = 31_000  # the lookahead
ANY_DISTANCE_M = 1e300


@cython.final
@cython.cclass
class Lockstep:
    """Boards, buses and plant on one clock. Built by `harness.machine.Machine`, which wires it."""

    plant: Plant
    boards: list
    buses: list
    wires: list
    word_wires: list
    encoder_wires: list
    time: cython.longlong
    window_ns: cython.longlong
    stop_steps: cython.longlong
    stop_distance_m: cython.double
    sampler: Sampler
    strikes: StepEnd
    watchers: list
    serial_device: SerialDevice
    encoder_boards: cython.longlong[::1]
    due: cython.longlong[::1]
    arrival: cython.longlong[::1]
    prompt: cython.longlong[::1]
    begun: cython.longlong[::1]
    step_times: cython.longlong[::1]
    side_by_side: cython.bint
    stop_wanted: cython.bint

    def __init__(self, plant, boards, buses, sampler, start_ns) -> None:
        # the compiled loop uses these without checking their types again
        for thing, kind in ((plant, Plant), *((b, Board) for b in boards), *((b, Bus) for b in buses)):
            if not isinstance(thing, kind):
                raise UserError(f"lockstep: {thing!r} is not a {kind.__name__}")
        self.plant = plant
        self.boards = list(boards)
        self.buses = buses
        self.sampler = sampler
        self.strikes = None  # a StepEnd
        self.watchers = []  # StepWatch: observers of every step of the plant, which may change it
        self.stop_wanted = False  # a watcher sets it: `run` returns before the step
        self.time = start_ns
        self.window_ns = WINDOW_NS
        self.side_by_side = False
        self.stop_steps = NEVER
        self.stop_distance_m = ANY_DISTANCE_M
        self.step_times = array.array("q", [start_ns, start_ns])  # ns, of the step that the sensors show
        self.prompt = integers(0)
        self.wires = []
        for place, board in enumerate(boards):
            self.wires.append(BoardWires(board, WINDOW_NS))
            self._set_board(place, board)
        self._rebuild_due_table()
        self.word_wires = []
        self.encoder_wires = []  # (place of the board, edges, two pins)
        self.encoder_boards = array.array("q")  # places of the boards with encoders on their pins
        self.serial_device = None

    def _set_board(self, place, board) -> None:
        """Set `board` at index `place`, on the wires there."""
        self.boards[place] = board
        self.wires[place].lead_from(board)
        self.side_by_side = any(each.out_of_process for each in self.boards)

    def _rebuild_due_table(self) -> None:
        """Rebuild the due table of all boards, in which senders note when a board must run."""
        count = len(self.boards)
        # per board the time (ns) at which it must run, and that at which an input arrives that may wait; after the
        # boards' the time at which a bus must decide
        self.due = integers(count + 1, self.time)
        self.arrival = integers(count, self.time)
        self.begun = integers(count + 1)  # places of the boards that run in a window
        before, self.prompt = list(self.prompt), integers(count, 1)
        for place in range(count):
            if place < len(before):
                self.prompt[place] = before[place]
            self._register_wakeup(place)
        for bus in self.buses:
            bus.wake(self.due, count)

    def _register_wakeup(self, place) -> None:
        """Let that board's inbox report when it must run: at once, or by `prompt` at a time of its choice."""
        self.boards[place].inbox.wake(self.due if self.prompt[place] else self.arrival, self.due, place)

    # --- wiring -------------------------------------------------------------------------------------------

    def place(self, name) -> int:
        """Return the index of the board of this name."""
        for place, board in enumerate(self.boards):
            if board.name == name:
                return place
        raise UserError(f"lockstep: no board is named {name}")

    def board(self, name) -> Board:
        """Return the board of this name."""
        return self.boards[self.place(name)]

    def add(self, board) -> BoardWires:
        """Add a board after the existing ones, between two runs. Returns its wires, not yet connected."""
        if not isinstance(board, Board) or board.name in [each.name for each in self.boards]:
            raise UserError(f"lockstep: {board!r} is not a Board, or its name is taken")
        wires = BoardWires(board, WINDOW_NS)
        self.boards.append(board)
        self.wires.append(wires)
        self._set_board(len(self.boards) - 1, board)
        self._rebuild_due_table()
        return wires

    def replace(self, board) -> None:
        """Put `board` in the place of the board of its name: on the same wires, at the same sensors.

        It takes over the inbox of the previous board, because buses, link and operator write there.
        """
        place = self.place(board.name)
        before = self.boards[place]
        if not isinstance(board, Board):
            raise UserError(f"lockstep: {board!r} is not a Board")
        if board.inbox is not before.inbox:
            raise UserError(f"lockstep: the inbox of the new {board.name} is not that of the one whose place it takes")
        self._set_board(place, board)
        for wire in self.encoder_wires:
            if wire[0] == place:
                board.connect_edges(*wire[1:])
        for wire in self.word_wires:
            if wire.board is before:
                wire.board = board
        for watcher in (self.sampler, self.strikes):
            if watcher is not None and watcher.board is before:
                watcher.board = board

    def receives_in_its_slots(self, board) -> None:
        """Messages that are not urgent (`EventQueue.put`) wait for tasks of `board`; no handler sends or senses."""
        place = self.place(board.name)
        self.prompt[place] = 0
        self._register_wakeup(place)

    def connect_encoder(self, encoder, board, pin_a, pin_b) -> None:
        """Connect channels A and B of `encoder` on two pins of `board`."""
        place = self.place(board.name)
        board.connect_edges(encoder.edges, pin_a, pin_b)
        self.encoder_wires.append((place, encoder.edges, pin_a, pin_b))
        self.encoder_boards = array.array("q", sorted({wire[0] for wire in self.encoder_wires}))

    def connect_voltage(self, source, board, channel) -> None:
        """Connect voltage `source` of the plant to analog input `channel` of `board`."""
        board.analog.follow(channel, self.step_times, self.plant.analog_start, self.plant.analog_end, source)

    def connect_word(self, source, board, word) -> None:
        """Connect digital word `source` of the plant to word `word` of `board`."""
        self.word_wires.append(WordWire(source, board, word))

    def connect_link(self, master, slave, exchange_ns, idle_segment) -> None:
        """Connect two boards by the serial link; the slave sends `idle_segment` until it has queued one itself."""
        link = SspWire(master, slave, exchange_ns, idle_segment)
        for board in (master, slave):
            self.wires[self.place(board.name)].link = link

    def connect_serial_device(self, device, board, uart) -> None:
        """Connect `device` of the plant (a SerialDevice that receives `from_board`) to UART `uart` of `board`."""
        self.serial_device = device
        self.connect_serial_line(board, uart, device)

    def connect_serial_line(self, board, uart, line) -> None:
        """Send the output of UART `uart` of `board` to `line.from_board(time, byte, count, data)` only."""
        self.wires[self.place(board.name)].serial_lines[uart] = line

    # --- passing time -------------------------------------------------------------------------------------

    def stop_at(self, steps, distance_m) -> None:
        """End the walk after `steps` steps or `distance_m` metres; None: no such end."""
        self.stop_steps = NEVER if steps is None else steps
        self.stop_distance_m = ANY_DISTANCE_M if distance_m is None else distance_m

    @cython.ccall
    def run(self, until: cython.longlong) -> cython.longlong:
        """Advance to `until` (ns) or until the walk is over; returns one of the reasons above."""
        plant: Plant = self.plant
        sampler: Sampler = self.sampler
        board: Board
        wires: BoardWires
        i: cython.longlong
        now: cython.longlong
        end: cython.longlong
        reason: cython.longlong = REACHED_TIME
        boards: list = self.boards
        board_count: cython.longlong = len(boards)
        due: cython.longlong[::1] = self.due
        arrival: cython.longlong[::1] = self.arrival
        due[board_count] = self.time  # a bus may have been changed between two runs
        for i in range(board_count):
            # a board may have been changed between two runs
            board = boards[i]
            wires = self.wires[i]
            wires.silent_until = 0
            arrival[i] = min(board.next_time, board.inbox.head_time, board.edge_time)
            # in its own process only what it is sent can have changed it
            due[i] = self._next_due(i, arrival[i]) if board.out_of_process else arrival[i]
        while self.time < until:
            now = self.time
            if plant.time_ns <= now:
                if now >= sampler.next_ns:
                    sampler.take(now)
                reason = self._walk_is_over()
                if reason:
                    break
                if self.watchers and self._watch_before(now):
                    reason = A_WATCHER_STOPPED
                    break
                self._show_words()
                plant.step()
                if self.watchers:
                    self._watch_after(now, plant.time_ns)
                self._sense()
            end = plant.time_ns if plant.time_ns < until else until
            if self.side_by_side:
                self._run_side_by_side(end, end == until)
            else:
                self._run_in_turn(end, end == until)
            self.time = end
            if self.strikes is not None:
                cython.cast(StepEnd, self.strikes).observe()
        due[board_count] = self._decide(self.time - 1)
        return reason

    @cython.cfunc
    @cython.final
    def _run_in_turn(self, end: cython.longlong, last: cython.bint) -> cython.longlong:
        """Run boards and buses to `end` (ns), always the one that is due first; returns when the next one is due.

        `last`: a reader sees the boards then. Otherwise a board that has only received something is left alone.
        """
        board: Board
        i: cython.longlong
        alone: cython.longlong
        first: cython.longlong
        second: cython.longlong
        time: cython.longlong
        later: cython.longlong
        # compiled, addresses: a memoryview in a variable costs an atomic reference count
        due: cython.p_longlong = cython.address(self.due[0]) if cython.compiled else self.due
        arrival: cython.p_longlong = cython.address(self.arrival[0]) if cython.compiled else self.arrival
        board_count: cython.longlong = len(self.boards)
        while True:
            if cython.compiled:  # without a branch: a processor cannot predict which board is next
                alone = board_count
                first = due[board_count]
                second = NEVER
                for i in range(board_count):
                    time = due[i]
                    later = first if first > time else time
                    second = later if later < second else second
                    alone = i if time < first else alone
                    first = time if time < first else first
            else:
                first, second, *_ = sorted(due)
                alone = due.index(first) if first < due[board_count] else board_count
            if first >= end:
                break
            if alone == board_count:
                due[board_count] = self._decide(first)
            else:
                second += self.window_ns
                due[alone] = self._advance(alone, second if second < end else end)
        for i in range(board_count):
            if arrival[i] < end:
                board = cython.cast(Board, self.boards[i])
                if last or board.next_time < end or board.edge_time < end:
                    due[i] = self._advance(i, end)
        return first

    @cython.cfunc
    @cython.final
    def _run_side_by_side(self, end: cython.longlong, last: cython.bint) -> cython.longlong:
        """Run out-of-process boards, and buses, to `end` (ns) in windows; returns how many windows there were.

        `last`: a reader sees the boards then. Otherwise those are left alone that act on nothing but a bus.
        """
        i: cython.longlong
        now: cython.longlong = self.time
        late: cython.longlong = 0
        windows: cython.longlong = 0
        first: cython.longlong
        begun: cython.longlong
        board: Board
        due: cython.longlong[::1] = self.due
        arrival: cython.longlong[::1] = self.arrival
        places: cython.longlong[::1] = self.begun
        board_count: cython.longlong = len(self.boards)
        while now < end:
            first = due[board_count]
            for i in range(board_count):
                if due[i] < first:
                    first = due[i]
            if first > now:
                now = first
            if due[board_count] <= now < end:
                due[board_count] = self._decide(now)
            now += self.window_ns
            if now >= end:
                now = late = end
            begun = 0
            for i in range(board_count):
                if due[i] < now or arrival[i] < late:
                    board = cython.cast(Board, self.boards[i])
                    if due[i] >= now and not last and board.can_wait(now):
                        continue
                    board.begin(now)
                    places[begun] = i
                    begun += 1
            for i in range(begun):
                due[places[i]] = self._advance(places[i], now)
            windows += 1
        return windows

    @cython.cfunc
    @cython.final
    def _advance(self, place: cython.longlong, until: cython.longlong) -> cython.longlong:
        """Run a board to `until` (ns) or less; returns when it is due again."""
        board: Board = cython.cast(Board, self.boards[place])
        following: cython.longlong = board.advance(until)
        if board.inbox.head_time < following:
            following = board.inbox.head_time
        if board.edge_time < following:
            following = board.edge_time
        self.arrival[place] = following
        return self._next_due(place, following)

    @cython.cfunc
    @cython.final
    def _next_due(self, place: cython.longlong, following: cython.longlong) -> cython.longlong:
        """When a board must run (ns) that has something to do at `following`: not before it may use a bus."""
        board: Board = cython.cast(Board, self.boards[place])
        wires: BoardWires
        if self.prompt[place] == 0 and board.inbox.urgent_until < board.horizon:
            following = board.earliest_transmit_ns()
            wires = board.outbox
            wires.silent_until = following
        return following

    @cython.cfunc
    def _walk_is_over(self) -> cython.longlong:
        """One of the reasons above why the walk ends here, or 0."""
        if self.plant.fell:
            return FELL
        if self.plant.steps >= self.stop_steps:
            return REACHED_STEPS
        if self.plant.distance_m >= self.stop_distance_m:
            return REACHED_DISTANCE
        return REACHED_TIME

    @cython.cfunc
    def _decide(self, until: cython.longlong) -> cython.longlong:
        """Let every bus decide what starts up to and including `until` (ns); returns their next time of interest."""
        bus: Bus
        i: cython.longlong
        next_time: cython.longlong
        first: cython.longlong = NEVER
        buses: list = self.buses
        for i in range(len(buses)):
            bus = cython.cast(Bus, buses[i])
            next_time = bus.next_time
            if next_time <= until:
                next_time = bus.advance(until)
            if next_time < first:
                first = next_time
        return first

    @cython.cfunc
    def _sense(self) -> None:
        """Record what the plant's sensors showed during the step just integrated."""
        plant: Plant = self.plant
        i: cython.longlong
        end: cython.longlong = plant.time_ns
        start: cython.longlong = end - plant.step_ns
        self.step_times[0] = start
        self.step_times[1] = end
        board: Board
        place: cython.longlong
        first: cython.longlong
        for i in range(len(self.encoder_boards)):
            place = self.encoder_boards[i]
            board = cython.cast(Board, self.boards[place])
            first = board.note_edges()
            if first < self.arrival[place]:
                self.arrival[place] = first
                if self.prompt[place] and first < self.due[place]:
                    self.due[place] = first
        if self.serial_device is not None:
            cython.cast(SerialDevice, self.serial_device).deliver()

    @cython.cfunc
    def _watch_before(self, now: cython.longlong) -> cython.bint:
        """Call every watcher once before a step; True when one of them wants to stop here."""
        watch: StepWatch
        for watch in list(self.watchers):
            if watch.seen_ns < now:
                watch.seen_ns = now
                watch.before_step(now)
        if self.stop_wanted:
            self.stop_wanted = False
            return True
        return False

    @cython.cfunc
    def _watch_after(self, start: cython.longlong, end: cython.longlong) -> None:
        """Call every watcher once per step, when its sensors are known and no board has read them."""
        watch: StepWatch
        for watch in list(self.watchers):
            watch.after_step(start, end)

    @cython.cfunc
    def _show_words(self) -> cython.void:
        """Show the absolute encoders' words at the start of the step; they hold until the next one."""
        plant: Plant = self.plant
        wire: WordWire
        for wire in self.word_wires:
            wire.board.words[wire.word] = plant.words[wire.source]
