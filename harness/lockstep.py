# cython: boundscheck=False, wraparound=False
# (every index below counts boards, buses or wires, or stands in a table filled when the robot is wired)
"""The loop that everything serves, in virtual time and in one process.

    plant -> sensors -> pins -> interrupts and slots -> data table -> CAN -> router -> main brain
          -> CAN -> slots -> PWM -> plant

Virtual time advances in quanta of 31.25 us, an eighth of the plant's step. That is shorter than the shortest
frame on Ranger's buses (36 us), so a frame requested within a quantum ends after it: boards that are advanced
one after the other never miss what another one sends, and the result does not depend on the order in which
they are advanced. Within a quantum: plant, pins, buses, then the boards with their interrupts and slots, then
their outputs. A board with nothing to do before the end of the quantum is passed over.

ROBOT PARITY: the plant moves in steps of 250 us. What a board writes to its bridge acts from the next step on, so up
to 250 us late; what sensors show is a straight line over a step (voltages) or stands through it (words).
"""

import array

import cython

from can_bus.bus import Bus
from firmware_sim.microcontroller import Microcontroller
from foundation.edge_buffer import ByteBuffer
from foundation.events import EventQueue
from foundation.user_error import UserError
from harness.processes.remote_board import RemoteBoard
from harness.recorder import RowStream
from plant.motor_unit import MotorUnit
from plant.ranger import RangerPlant

QUANTUM_NS = 31_250
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
        self.recorder = recorder
        self.time = start_ns
        self.next_sample = start_ns
        self.main_brain = None
        self.encoder_boards = array.array("q")  # numbers of the boards with encoders on their pins
        self.step_times = array.array("q", [start_ns, start_ns])  # ns, of the step that the sensors show
        self.word_wires = []
        self.ssp = None
        self.main_brain_words = array.array("q")
        self.records_words = False
        self.sample_row = array.array("d", [0.0]) * 64
        self.sample_count = 0
        # per board the instant (ns) at which it must run; its inbox lowers it when something comes in earlier
        self.due = array.array("q", [start_ns]) * len(boards)
        for place, board in enumerate(boards):
            board.inbox.wake(self.due, place)
        self.bus_due = array.array("q", [start_ns]) * len(buses)  # the same of each bus
        # routing tables, index board * 4 + controller - 1; -1 where nothing is connected
        self.bus_of = array.array("q", [-1]) * (4 * len(boards))
        self.node_of = array.array("q", [-1]) * (4 * len(boards))
        self.motors = [None] * len(boards)
        self.watchdog_pin = array.array("q", [-1]) * len(boards)
        self.enable_pins = array.array("q", [-1]) * (2 * len(boards))
        self.enables = array.array("q", [0]) * (2 * len(boards))
        self.stop_steps = 1 << 62
        self.stop_distance_m = 1e300
        self.imu = None
        self.imu_board = None
        self.imu_index = -1
        self.imu_uart = 0
        self.serial_lines = None  # {(board, UART): what hears it}, when something outside is connected
        self.can_lines = None  # {(board, controller): what takes its requests}, when its bus is outside
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

    def connect_encoder(self, encoder, board, pin_a, pin_b) -> None:
        """Channels A and B of `encoder` on two pins of `board`."""
        board.listen_to_edges(encoder.edges, pin_a, pin_b)
        number = self.boards.index(board)
        if number not in self.encoder_boards:
            self.encoder_boards = array.array("q", list(self.encoder_boards) + [number])

    def connect_imu(self, imu, board, index, uart) -> None:
        """The inertial unit's bytes go to UART `uart` of `board`, the board's to the unit."""
        self.imu = imu
        self.imu_board = board
        self.imu_index = index
        self.imu_uart = uart

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
        away: RemoteBoard
        bus: Bus
        i: cython.longlong
        now: cython.longlong
        then: cython.longlong
        following: cython.longlong
        boards: list = self.boards
        buses: list = self.buses
        quantum: cython.longlong = QUANTUM_NS
        board_count: cython.longlong = len(boards)
        due: cython.longlong[::1] = self.due
        bus_due: cython.longlong[::1] = self.bus_due
        bus_count: cython.longlong = len(buses)
        for i in range(bus_count):
            bus = self.buses[i]
            bus_due[i] = bus.next_time
        for i in range(board_count):
            # between two runs anything may have been done to a board
            board = self.boards[i]
            due[i] = min(board.next_time, board.inbox.head_time, board.edge_time)
        while self.time < until:
            now = self.time
            then = now + quantum
            if plant.time_ns <= now:
                if now >= self.next_sample:
                    self._sample(now)
                if plant.fell:
                    return 3
                if plant.steps >= self.stop_steps:
                    return 1
                if plant.distance_m >= self.stop_distance_m:
                    return 2
                self._show_words()
                plant.step()
                self._sense()
                self._collect_frames()
            for i in range(bus_count):
                if bus_due[i] <= now:
                    bus = cython.cast(Bus, buses[i])
                    bus_due[i] = bus.advance(now)
            if self.remote:
                for i in range(board_count):
                    if due[i] < then:
                        away = cython.cast(RemoteBoard, boards[i])
                        away.begin(then)
            for i in range(board_count):
                if due[i] < then:
                    board = cython.cast(Microcontroller, boards[i])
                    following = board.advance(then)
                    if board.inbox.head_time < following:
                        following = board.inbox.head_time
                    if board.edge_time < following:
                        following = board.edge_time
                    due[i] = following
                    if board.outbox.count:
                        self._route(i, board)
            if self.estimator is not None and self.estimator.swing_leg != self.swing_leg:
                self._notice_strike()
            self.time = then
        return 0

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
        first: cython.longlong
        for i in range(len(self.encoder_boards)):
            board = cython.cast(Microcontroller, self.boards[self.encoder_boards[i]])
            first = board.edges_came()
            if first < self.due[self.encoder_boards[i]]:
                self.due[self.encoder_boards[i]] = first
        if self.imu is not None and self.imu.bytes.count:
            if self.imu_tap is not None:
                self.imu_tap.bytes_sent(self.imu.bytes.times, self.imu.bytes.values, self.imu.bytes.count)
            self._deliver_bytes()

    def _show_words(self) -> cython.void:
        """What the absolute encoders hold at the start of the step: their words stand until the next one."""
        plant: RangerPlant = self.plant
        i: cython.longlong
        word: WordWire
        board: Microcontroller
        wires: list = self.word_wires
        for i in range(len(wires)):
            word = cython.cast(WordWire, wires[i])
            board = word.board
            board.words[word.word] = plant.words[word.source]

    def _deliver_bytes(self) -> cython.void:
        """Bytes of the inertial unit: up to eight that follow each other closely travel as one message."""
        line: ByteBuffer = self.imu.bytes
        board: Microcontroller = self.imu_board
        i: cython.longlong = 0
        k: cython.longlong
        n: cython.longlong
        low: cython.longlong
        high: cython.longlong
        while i < line.count:
            n = 1
            while n < 8 and i + n < line.count and line.times[i + n] - line.times[i + n - 1] < 25_000:
                n += 1
            low = 0
            high = 0
            for k in range(n):
                if k < 4:
                    low |= line.values[i + k] << (8 * k)
                else:
                    high |= line.values[i + k] << (8 * (k - 4))
            # order 256: stage pins; kind 5: UART_BYTE
            board.inbox.push(line.times[i + n - 1], 256, 5, self.imu_uart, line.values[i], n, low, high)
            i += n

    def _collect_frames(self) -> None:
        """Move what the buses logged into the canonical trace, bus after bus."""
        bus: Bus
        b: cython.longlong
        for b in range(len(self.buses)):
            bus = cython.cast(Bus, self.buses[b])
            if bus.log_count > 0:
                self.recorder.add_frames(b, bus.log, bus.log_count)
                bus.log_count = 0

    def _route(self, index: cython.longlong, board: Microcontroller) -> None:
        """Hand on what a board put out: frames to its bus, PWM and pins to its drive, segments to the link."""
        out: EventQueue = board.outbox
        place: cython.longlong
        bus: Bus
        motor: MotorUnit
        ssp: SspWire
        while out.take():
            if out.kind == 36:  # PIN_OUTPUT
                motor = cython.cast(MotorUnit, self.motors[index])
                if motor is not None:
                    if out.a == self.watchdog_pin[index]:
                        motor.drive.watchdog_edge(out.time)
                        continue
                    if out.a == self.enable_pins[2 * index]:
                        self.enables[2 * index] = out.b
                        motor.drive.low_side(out.time, self.enables[2 * index], self.enables[2 * index + 1])
                        continue
                    if out.a == self.enable_pins[2 * index + 1]:
                        self.enables[2 * index + 1] = out.b
                        motor.drive.low_side(out.time, self.enables[2 * index], self.enables[2 * index + 1])
                        continue
            elif out.kind == 35:  # PWM_UPDATE
                motor = cython.cast(MotorUnit, self.motors[index])
                if motor is not None:
                    motor.drive.write_pwm(out.time, out.a, out.b, out.c)
            elif out.kind == 32:  # CAN_REQUEST
                place = 4 * index + out.a - 1
                if self.bus_of[place] >= 0:
                    bus = cython.cast(Bus, self.buses[self.bus_of[place]])
                    bus.request(self.node_of[place], out.b, out.time, out.c, out.d, out.e, out.f)
                    self.bus_due[self.bus_of[place]] = bus.next_time
                elif self.can_lines is not None:
                    self._can_output(index, out)
            elif out.kind == 37:  # SSP_START
                ssp = self.ssp
                ssp.start(out.time, out.ref)
            elif out.kind == 38:  # SSP_LOAD
                ssp = self.ssp
                ssp.load(out.ref)
            elif out.kind == 33:  # CAN_ABORT
                place = 4 * index + out.a - 1
                if self.bus_of[place] >= 0:
                    bus = cython.cast(Bus, self.buses[self.bus_of[place]])
                    bus.abort(self.node_of[place], out.b, out.time)
                    self.bus_due[self.bus_of[place]] = bus.next_time
                elif self.can_lines is not None:
                    self._can_output(index, out)
            elif out.kind == 34:  # CAN_MODE
                place = 4 * index + out.a - 1
                if self.bus_of[place] >= 0:
                    bus = cython.cast(Bus, self.buses[self.bus_of[place]])
                    bus.set_mode(self.node_of[place], out.b, out.time)
                    self.bus_due[self.bus_of[place]] = bus.next_time
                elif self.can_lines is not None:
                    self._can_output(index, out)
            elif out.kind == 39:  # UART_OUTPUT
                if index == self.imu_index and out.a == self.imu_uart and self.imu is not None:
                    self.imu.receive_byte(out.time, out.b)
                elif self.serial_lines is not None:
                    self._serial_output(index, out)

    def _can_output(self, index: cython.longlong, out: EventQueue) -> None:
        """A controller asks its bus for something, and the bus is outside."""
        line = self.can_lines.get((index, out.a))
        if line is not None:
            line.from_board(out.kind, out.time, out.b, out.c, out.d, out.e, out.f)

    def _serial_output(self, index: cython.longlong, out: EventQueue) -> None:
        """A UART has put something out: to the outside, if it is connected there."""
        line = self.serial_lines.get((index, out.a))
        if line is not None:
            line.from_board(out.time, out.b, out.c, out.ref)

    def _sample(self, now: cython.longlong) -> None:
        """One row of the trace: the body, and when a log is kept the main brain's data table."""
        stream: RowStream = self.recorder.samples
        at: cython.longlong = stream.used
        i: cython.longlong
        self.plant.fill_sample(self.sample_row)
        stream.reals[at] = now * 1e-9
        for i in range(self.sample_count):
            stream.reals[at + 1 + i] = self.sample_row[i]
        stream.used = at + 1 + self.sample_count
        stream.finish_row(now)
        if self.records_words:
            stream = self.recorder.words
            at = stream.used
            stream.integers[at] = now
            for i in range(stream.columns - 1):
                stream.integers[at + 1 + i] = self.main_brain_words[i]
            stream.used = at + stream.columns
            stream.finish_row(now)
        self.next_sample += SAMPLE_NS
