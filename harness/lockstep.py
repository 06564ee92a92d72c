# cython: boundscheck=False, wraparound=False
# (every index below counts boards, buses or wires, or stands in a table filled when the robot is wired)
"""The loop that everything serves, in virtual time and in one process.

    plant -> sensors -> pins -> interrupts and slots -> data table -> CAN -> router -> main brain
          -> CAN -> slots -> PWM -> plant

Within a step of the plant the board that is due first runs, and it runs ahead: to 31 us beyond the instant at which
the next board or bus is due, or less far where something that it puts out could come back to it (`stop_at`). Those
31 us are shorter than the shortest frame on Ranger's buses (its receivers have it 35.6 us after its start) and than
the pause between two exchanges on the serial link: 34.67 us, less the 1.7 us by which a frame's interrupt can hold up
the start of the first. So nothing that any board puts out can reach a board that has run on already, and the result
depends neither on the order in which boards run nor on how far. At one instant: plant, pins, buses, then the boards
with their interrupts and slots, then their outputs.

A board is due when it has something to do: an alarm, a slot, a task, an interrupt, a message. Where frames, edges and
bytes wait for a task (`hears_in_its_slots`) it is due only when it may put something on a bus
(`Microcontroller.speaks_from`): it does everything else, each thing at its instant, when that has come, or at the end
of the plant's step, while edges and voltages still stand; what it hears alone does not even need that.

Boards in processes of their own run side by side instead: in windows of 31 us, each from the first instant at which
anything is due, all boards that are due in a window at once.

ROBOT PARITY: the plant moves in steps of 250 us. What a board writes to its bridge acts from the next step on, so up
to 250 us late; what sensors show is a straight line over a step (voltages) or stands through it (words).
"""

import array

import cython

from ranger_sim.can_bus.bus import Bus
from ranger_sim.firmware_sim.microcontroller import MESSAGE_KINDS, Microcontroller
from ranger_sim.firmware_sim.peripherals.can_controller import CanController
from ranger_sim.foundation.edge_buffer import ByteBuffer
from ranger_sim.foundation.events import CAN_REQUEST, CAN_TX_DONE, Outbox
from ranger_sim.foundation.numbers import integers
from ranger_sim.foundation.row_stream import RowStream
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes.remote_board import RemoteBoard
from ranger_sim.plant.ranger import RangerPlant

WINDOW_NS = 31_000
SAMPLE_NS = 2_000_000  # the canonical trace samples body and data table at the main brain's rate

# Why `run` returned.
REACHED_TIME = 0
REACHED_STEPS = 1
REACHED_DISTANCE = 2
FELL = 3


class WordWire:
    """The register of one digital sensor of the plant, as a board reads it over its serial interface."""

    def __init__(self, source, board, word) -> None:
        self.source = source
        self.board = board
        self.word = word


class SspWire:
    """The serial link between router (master) and main brain (slave): an exchange takes 165.3 us."""

    def __init__(self, master, slave, exchange_ns, idle_segment) -> None:
        self.master = master
        self.slave = slave
        self.exchange_ns = exchange_ns
        self.loaded = idle_segment
        self.exchanges = 0

    def start(self, time_ns: cython.longlong, segment: object) -> cython.void:
        """The master starts an exchange; both sides have the other's segment at its end."""
        # order 768: stage interrupts; kind 6: SSP_SEGMENT
        self.slave.inbox.push(time_ns + self.exchange_ns, 768, 6, 0, 0, 0, 0, 0, 0, segment)
        self.master.inbox.push(time_ns + self.exchange_ns, 768, 6, 0, 0, 0, 0, 0, 0, self.loaded)
        self.exchanges += 1

    def load(self, segment: object) -> cython.void:
        """The slave puts up what it will send in the next exchange."""
        self.loaded = segment


class BoardWires(Outbox):
    """The wires that lead away from one board: its outbox in the assembled robot.

    What the board puts out is carried on at once, with its stamp: frames to its buses, PWM and pins to its bridge,
    segments over the link, bytes to whoever listens. A pin, a controller or a UART that is not connected here leads
    nowhere.
    """

    def __init__(self, board, window_ns) -> None:
        self.board = board
        self.window_ns = window_ns  # nothing that the board puts out comes back to it sooner
        # by controller 1 ... 4: the bus and the node number there
        self.buses = [None] * 5
        self.nodes = [-1] * 5
        self.can_lines = {}  # {controller: what takes its requests}, where the bus is outside
        self.drive = None
        self.watchdog_pin = -1
        self.low_side_2_pin = -1
        self.low_side_6_pin = -1
        self.low_side_2 = False
        self.low_side_6 = False
        self.silent_until = 0  # ns: before that the board was to put nothing on a bus
        self.link = None
        self.imu = None
        self.imu_uart = -1
        self.serial_lines = {}  # {UART: what hears it}, where something outside is connected

    def connect_bus(self, controller, bus, node) -> None:
        """Controller 1 ... 4 of the board is `node` of `bus`; None for `bus` takes it off.

        The bus writes the ends of its transmissions where the controller looks for them.
        """
        if bus is not None and not isinstance(bus, Bus):  # taken for one without asking again
            raise UserError(f"{self.board.name}: {bus!r} is no Bus")
        self.end_by_message(controller)
        self.buses[controller] = bus
        self.nodes[controller] = node
        owner = self.board.message_table[controller * MESSAGE_KINDS + CAN_TX_DONE]
        if bus is not None and isinstance(owner, CanController):
            bus.nodes[node].connect(owner.ends)

    def end_by_message(self, controller) -> None:
        """The ends of a controller's transmissions are messages from now on: the one that looks is not here."""
        if self.buses[controller] is not None:
            self.buses[controller].nodes[self.nodes[controller]].connect(None)

    def connect_drive(self, drive, watchdog_pin, low_side_2_pin, low_side_6_pin) -> None:
        """The board's PWM unit and three of its pins drive a bridge."""
        self.drive = drive
        self.watchdog_pin = watchdog_pin
        self.low_side_2_pin = low_side_2_pin
        self.low_side_6_pin = low_side_6_pin

    def push(
        self,
        time: cython.longlong,
        order: cython.longlong,
        kind: cython.longlong,
        a: cython.longlong = 0,
        b: cython.longlong = 0,
        c: cython.longlong = 0,
        d: cython.longlong = 0,
        e: cython.longlong = 0,
        f: cython.longlong = 0,
        ref: object = None,
    ) -> None:
        """Carry on what the board puts out at `time` (ns)."""
        if kind == 36:  # PIN_OUTPUT
            if a == self.watchdog_pin:
                self.drive.watchdog_edge(time)
            elif a == self.low_side_2_pin:
                self.low_side_2 = b != 0
                self.drive.low_side(time, self.low_side_2, self.low_side_6)
            elif a == self.low_side_6_pin:
                self.low_side_6 = b != 0
                self.drive.low_side(time, self.low_side_2, self.low_side_6)
        elif kind == 35:  # PWM_UPDATE
            if self.drive is not None:
                self.drive.write_pwm(time, a, b, c)
        elif kind == 32:  # CAN_REQUEST
            self.request(time, a, b, c, d, e, f)
        elif kind == 33 or kind == 34:  # CAN_ABORT, CAN_MODE
            if self.buses[a] is None:
                self._to_bus_outside(kind, time, a, b, c, d, e, f)
            elif kind == 33:
                self.buses[a].abort(self.nodes[a], b, time)
            else:
                self.buses[a].set_mode(self.nodes[a], b, time)
        elif kind == 37:  # SSP_START
            self.link.start(time, ref)
            self.board.stop_at(time + self.link.exchange_ns + self.window_ns)
        elif kind == 38:  # SSP_LOAD
            self.link.load(ref)
        elif kind == 39:  # UART_OUTPUT
            self._to_serial_line(time, a, b, c, ref)

    def request(
        self,
        time: cython.longlong,
        controller: cython.longlong,
        buffer: cython.longlong,
        identifier: cython.longlong,
        flags: cython.longlong,
        lo: cython.longlong,
        hi: cython.longlong,
    ) -> None:
        """Carry a frame to its bus."""
        if time < self.silent_until:
            self._spoke_early(time)
        if self.buses[controller] is None:
            self._to_bus_outside(CAN_REQUEST, time, controller, buffer, identifier, flags, lo, hi)
        else:
            cython.cast(Bus, self.buses[controller]).request(
                self.nodes[controller], buffer, time, identifier, flags, lo, hi
            )
            if time + self.window_ns < self.board.horizon:
                self.board.stop_at(time + self.window_ns)

    def _spoke_early(self, time) -> None:
        raise UserError(
            f"{self.board.name}: a frame was sent at {time} ns, but by its schedule's `speakers` none could be before"
            f" {self.silent_until} ns: name the task that sends there; for a handler that sends, leave `speakers` out"
        )

    def _to_bus_outside(self, kind, time, controller, b, c, d, e, f) -> None:
        line = self.can_lines.get(controller)
        if line is not None:
            line.from_board(kind, time, b, c, d, e, f)

    def _to_serial_line(self, time, uart, byte, count, data) -> None:
        if self.imu is not None and uart == self.imu_uart:
            self.imu.receive_byte(time, byte)
            return
        line = self.serial_lines.get(uart)
        if line is not None:
            line.from_board(time, byte, count, data)


class Lockstep:
    """Boards, buses and plant on one clock. Built by `harness.ranger.Ranger`, which wires it."""

    def __init__(self, plant, boards, buses, recorder, start_ns) -> None:
        # the compiled loop takes these for what they should be without asking again
        for thing, kind in (*((b, Microcontroller) for b in boards), *((b, Bus) for b in buses)):
            if not isinstance(thing, kind):
                raise UserError(f"lockstep: {thing!r} is no {kind.__name__}")
        self.plant = plant
        self.boards = boards
        self.remote = all(isinstance(board, RemoteBoard) for board in boards)  # each in a process of its own
        self.buses = buses
        self.samples = recorder.samples
        self.words = recorder.words
        self.time = start_ns
        self.window_ns = WINDOW_NS
        self.next_sample = start_ns
        self.main_brain = None
        self.encoder_boards = array.array("q")  # numbers of the boards with encoders on their pins
        self.step_times = array.array("q", [start_ns, start_ns])  # ns, of the step that the sensors show
        self.word_wires = []
        self.main_brain_words = array.array("q")
        self.records_words = False
        self.sample_row = array.array("d", [0.0]) * 64
        self.sample_count = 0
        # per board the instant (ns) at which it must run, and that at which something comes in that may wait;
        # behind the boards' the instant at which a bus must decide
        self.due = integers(len(boards) + 1, start_ns)
        self.came = integers(len(boards), start_ns)
        self.prompt = integers(len(boards), 1)
        for place, board in enumerate(boards):
            board.inbox.wake(self.due, self.due, place)
        self.wires = [BoardWires(board, WINDOW_NS) for board in boards]
        for board, wires in zip(boards, self.wires, strict=True):
            board.outbox = wires
        for bus in buses:
            bus.wake(self.due, len(boards))
        self.stop_steps = 1 << 62
        self.stop_distance_m = 1e300
        self.imu = None
        self.imu_board = None
        self.imu_uart = 0
        self.imu_tap = None  # hears what the inertial unit sends, beside its board
        self.estimator = None
        self.swing_leg = 1
        self.strike_seen_ns = -1
        self.strike_count = 0
        self.strikes_unmatched = 0
        self.strikes_missed = 0
        self.steps_noticed = 0
        self.strike_sum_ms = 0.0
        self.strike_squares_ms2 = 0.0

    def hears_in_its_slots(self, board) -> None:
        """Not urgent messages (`EventQueue.put`) wait for tasks of `board`: no handler sends or looks at a sensor."""
        place = self.boards.index(board)
        self.prompt[place] = 0
        board.inbox.wake(self.came, self.due, place)

    def connect_encoder(self, encoder, board, pin_a, pin_b) -> None:
        """Channels A and B of `encoder` on two pins of `board`."""
        board.listen_to_edges(encoder.edges, pin_a, pin_b)
        number = self.boards.index(board)
        if number not in self.encoder_boards:
            self.encoder_boards = array.array("q", list(self.encoder_boards) + [number])

    def connect_imu(self, imu, board, uart) -> None:
        """The inertial unit's bytes go to UART `uart` of `board`, the board's to the unit; None: no unit is there."""
        wires: BoardWires = self.wires[self.boards.index(board)]
        self.imu = imu
        self.imu_board = board
        self.imu_uart = uart
        wires.imu = imu
        wires.imu_uart = uart

    def connect_link(self, wire) -> None:
        """The serial link `wire` between two boards."""
        for board in (wire.master, wire.slave):
            wires: BoardWires = self.wires[self.boards.index(board)]
            wires.link = wire

    def connect_voltage(self, source, board, channel) -> None:
        """Voltage `source` of the plant on analog input `channel` of `board`."""
        board.analog.follow(channel, self.step_times, self.plant.analog_start, self.plant.analog_end, source)

    def watch_strikes(self, main_brain) -> None:
        """Time from the body's heel strikes to the main-brain slots that notice them."""
        self.main_brain = main_brain
        self.estimator = main_brain.estimator
        self.swing_leg = main_brain.estimator.swing_leg

    def run(self, until: cython.longlong) -> cython.longlong:
        """Advance to `until` (ns) or until the walk is over; returns one of the reasons above."""
        plant: RangerPlant = self.plant
        board: Microcontroller
        wires: BoardWires
        i: cython.longlong
        now: cython.longlong
        end: cython.longlong
        reason: cython.longlong = 0
        boards: list = self.boards
        board_count: cython.longlong = len(boards)
        due: cython.longlong[::1] = self.due
        came: cython.longlong[::1] = self.came
        due[board_count] = self.time  # between two runs anything may have been done to a bus
        for i in range(board_count):
            # between two runs anything may have been done to a board
            board = boards[i]
            due[i] = came[i] = min(board.next_time, board.inbox.head_time, board.edge_time)
            wires = self.wires[i]
            wires.silent_until = 0
        while self.time < until:
            now = self.time
            if plant.time_ns <= now:
                if now >= self.next_sample:
                    self._sample(now)
                reason = self._walk_is_over()
                if reason:
                    break
                self._show_words()
                plant.step()
                self._sense()
            end = plant.time_ns if plant.time_ns < until else until
            if self.remote:
                self._run_side_by_side(end)
            else:
                self._run_in_turn(end, end == until)
            self.time = end
            if self.estimator is not None and self.estimator.swing_leg != self.swing_leg:
                self._notice_strike()
        due[board_count] = self._decide(self.time - 1)
        return reason

    @cython.final
    def _run_in_turn(self, end: cython.longlong, last: cython.bint) -> cython.longlong:
        """Run boards and buses to `end` (ns), always the one that is due first; returns when the next one is.

        `last`: somebody looks at the boards then. Otherwise a board that has only heard something is left alone.
        """
        board: Microcontroller
        i: cython.longlong
        alone: cython.longlong
        first: cython.longlong
        second: cython.longlong
        time: cython.longlong
        later: cython.longlong
        # compiled, addresses: to take a memoryview into a variable is counted by an atomic instruction
        due: cython.p_longlong = cython.address(self.due[0]) if cython.compiled else self.due
        came: cython.p_longlong = cython.address(self.came[0]) if cython.compiled else self.came
        board_count: cython.longlong = len(self.boards)
        while True:
            if cython.compiled:  # without a branch: no processor could foresee which board is next
                alone = board_count
                first = due[board_count]
                second = 1 << 62
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
            if came[i] < end:
                board = cython.cast(Microcontroller, self.boards[i])
                if last or board.next_time < end or board.edge_time < end:
                    due[i] = self._advance(i, end)
        return first

    @cython.final
    def _run_side_by_side(self, end: cython.longlong) -> cython.longlong:
        """Run boards in processes of their own, and buses, to `end` (ns) in windows; returns how many there were."""
        i: cython.longlong
        now: cython.longlong = self.time
        late: cython.longlong = 0
        windows: cython.longlong = 0
        first: cython.longlong
        away: RemoteBoard
        due: cython.longlong[::1] = self.due
        came: cython.longlong[::1] = self.came
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
            for i in range(board_count):
                if due[i] < now or came[i] < late:
                    away = cython.cast(RemoteBoard, self.boards[i])
                    away.begin(now)
            for i in range(board_count):
                if due[i] < now or came[i] < late:
                    due[i] = self._advance(i, now)
            windows += 1
        return windows

    @cython.final
    def _advance(self, place: cython.longlong, until: cython.longlong) -> cython.longlong:
        """Run a board to `until` (ns) or less; returns when it is due again."""
        board: Microcontroller = cython.cast(Microcontroller, self.boards[place])
        wires: BoardWires
        following: cython.longlong = board.advance(until)
        if board.inbox.head_time < following:
            following = board.inbox.head_time
        if board.edge_time < following:
            following = board.edge_time
        self.came[place] = following
        if self.prompt[place] == 0 and board.inbox.urgent_until < board.horizon:
            following = board.speaks_from()
            wires = board.outbox
            wires.silent_until = following
        return following

    def _walk_is_over(self) -> cython.longlong:
        """One of the reasons above why the walk ends here, or 0."""
        if self.plant.fell:
            return FELL
        if self.plant.steps >= self.stop_steps:
            return REACHED_STEPS
        if self.plant.distance_m >= self.stop_distance_m:
            return REACHED_DISTANCE
        return REACHED_TIME

    def _decide(self, until: cython.longlong) -> cython.longlong:
        """Let every bus decide what starts up to and including `until` (ns); returns their next instant of interest."""
        bus: Bus
        i: cython.longlong
        next_time: cython.longlong
        first: cython.longlong = 1 << 62
        buses: list = self.buses
        for i in range(len(buses)):
            bus = cython.cast(Bus, buses[i])
            next_time = bus.next_time
            if next_time <= until:
                next_time = bus.advance(until)
            if next_time < first:
                first = next_time
        return first

    def _notice_strike(self) -> cython.void:
        """The main brain has flipped the swing leg: how long after the body's strike began that slot?"""
        delay_ms: cython.double
        struck: cython.longlong = self.plant.strike_time_ns
        self.swing_leg = self.estimator.swing_leg
        if self.plant.steps == 0:
            return  # the reset on entering the walk
        if struck == self.strike_seen_ns:
            self.strikes_unmatched += 1
            return
        if self.plant.steps > self.steps_noticed + 1:
            self.strikes_missed += self.plant.steps - self.steps_noticed - 1
        self.steps_noticed = self.plant.steps
        self.strike_seen_ns = struck
        delay_ms = (self.main_brain.scheduler.slot_time - struck) * 1e-6
        self.strike_count += 1
        self.strike_sum_ms += delay_ms
        self.strike_squares_ms2 += delay_ms * delay_ms

    def _sense(self) -> cython.void:
        """What the plant's sensors showed during the step that was just integrated."""
        plant: RangerPlant = self.plant
        i: cython.longlong
        end: cython.longlong = plant.time_ns
        start: cython.longlong = end - plant.step_ns
        self.step_times[0] = start
        self.step_times[1] = end
        board: Microcontroller
        place: cython.longlong
        first: cython.longlong
        for i in range(len(self.encoder_boards)):
            place = self.encoder_boards[i]
            board = cython.cast(Microcontroller, self.boards[place])
            first = board.edges_came()
            if first < self.came[place]:
                self.came[place] = first
                if self.prompt[place] and first < self.due[place]:
                    self.due[place] = first
        if self.imu is not None and self.imu.bytes.count:
            if self.imu_tap is not None:
                self.imu_tap.bytes_sent(self.imu.bytes.times, self.imu.bytes.values, self.imu.bytes.count)
            self._deliver_bytes()

    def _show_words(self) -> cython.void:
        """What the absolute encoders hold at the start of the step: their words stand until the next one."""
        plant: RangerPlant = self.plant
        wire: WordWire
        for wire in self.word_wires:
            wire.board.words[wire.word] = plant.words[wire.source]

    def _deliver_bytes(self) -> cython.void:
        """Bytes of the inertial unit: up to eight that follow each other closely travel as one message."""
        line: ByteBuffer = self.imu.bytes
        board: Microcontroller = self.imu_board
        time: cython.longlong = line.times[0]
        following: cython.longlong
        byte: cython.longlong
        n: cython.longlong = 0  # bytes in `low` and `high`, the first one in the lowest place
        low: cython.longlong = 0
        high: cython.longlong = 0
        i: cython.longlong
        for i in range(line.count):
            following = line.times[i]
            if n == 8 or following - time >= 25_000:
                # order 256: stage pins; kind 5: UART_BYTE
                board.inbox.put(time, 256, 5, self.imu_uart, low & 255, n, low, high, 0)
                n = low = high = 0
            byte = line.values[i]
            if n < 4:
                low |= byte << (8 * n)
            else:
                high |= byte << (8 * n - 32)
            n += 1
            time = following
        board.inbox.put(time, 256, 5, self.imu_uart, low & 255, n, low, high, 0)

    def _sample(self, now: cython.longlong) -> None:
        """One row of the trace: the body, and when a log is kept the main brain's data table."""
        stream: RowStream = self.samples
        at: cython.longlong = stream.used
        i: cython.longlong
        self.plant.fill_sample(self.sample_row)
        stream.reals[at] = now * 1e-9
        for i in range(self.sample_count):
            stream.reals[at + 1 + i] = self.sample_row[i]
        stream.finish_row(now)
        if self.records_words:
            stream = self.words
            at = stream.used
            stream.integers[at] = now
            for i in range(stream.columns - 1):
                stream.integers[at + 1 + i] = self.main_brain_words[i]
            stream.finish_row(now)
        self.next_sample += SAMPLE_NS
