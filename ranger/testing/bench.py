"""A single board, or a single bus, on the bench: pins, voltages, words and buses are driven by the test.

    board = BoardAlone("MCH")
    board.word("absolute_encoder", 4590)
    board.can(1).send("MCH_COMMAND_CURRENT", 0.5)
    board.run_for("20 ms")
    assert board.can(1).received("MCH_ANGLE")[-1].value == 0.0

The board is that of the robot, in virtual time; its buses are simulated to the bit, each with one node of the test,
which acknowledges. Nothing more is connected: a sensor that is not set shows 0.
"""

from __future__ import annotations

import collections
import heapq
from collections.abc import Callable, Iterable
from typing import Any

from ranger_sim.boards.quirks import Quirks
from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.frame import frame_bits
from ranger_sim.datatable.generated import all_variables
from ranger_sim.datatable.packing import word_of_value
from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.firmware_sim.native import crash
from ranger_sim.firmware_sim.native.trial import tried
from ranger_sim.foundation.edge_buffer import EdgeBuffer
from ranger_sim.foundation.events import (
    CAN_ABORT,
    CAN_FILTER,
    CAN_MODE,
    CAN_REQUEST,
    CAN_RX,
    CAN_TX_DONE,
    FLAG_EXTENDED,
    NEVER,
    ORDER_PINS,
    PIN_EDGE,
    PIN_OUTPUT,
    PWM_UPDATE,
    SSP_LOAD,
    SSP_START,
    STAGE_BUS,
    UART_BYTE,
    UART_OUTPUT,
    EventQueue,
    Outbox,
)
from ranger_sim.foundation.quantities import Duration, duration_ns, duration_text
from ranger_sim.foundation.row_stream import FrameStream
from ranger_sim.foundation.user_error import UserError, unknown
from ranger_sim.harness.firmware.fresh_board import first_outputs, pass_on
from ranger_sim.harness.firmware.native_firmware import Firmware
from ranger_sim.harness.testing.figures import Figure, Observed
from ranger_sim.harness.testing.frames import Frame, FrameKeeper, frame_type
from ranger_sim.harness.testing.wire import Wire
from ranger_sim.ranger import wiring
from ranger_sim.ranger.assembly import BUS_BIT_RATE
from ranger_sim.ranger.board_programs import BOARD_CLASSES
from ranger_sim.ranger.conditions import ConditionNotMetError
from ranger_sim.ranger.firmware import native_boards
from ranger_sim.ranger.names import RANGER
from ranger_sim.ranger.testing.links import Link, link_of

# A board or node runs at most this many bits ahead of a bus: a frame without data has passed its receivers after
# 41 bits or more, so nothing arrives in a receiver's past.
AHEAD_BITS = 36
DATA_8 = 8  # flags of a data frame of eight bytes
SYNC_NS = 1_000_000  # the router sends the network time every ms (robot.md N1.4)
SYNC_ID = all_variables.ID_OF["TIMESTAMP"]
BUFFERS = (1, 2, 3)
NODE_ORDER = STAGE_BUS * 256 + 128  # after every board of the robot
FIRST_ORDER = STAGE_BUS * 256
SECOND_NS = 1_000_000_000


class Node:
    """A node of the test on a bus: sends in the order of the calls, receives everything that others send."""

    def __init__(self, bench: Bench, bus: Bus, name: str) -> None:
        self.bench = bench
        self.bus = bus
        self.name = name
        self.inbox: EventQueue = EventQueue()
        self.number = bus.add_node(name, self.inbox, 1, NODE_ORDER + len(bus.nodes))
        self.free = list(BUFFERS)
        self.due: list[tuple[int, int, int, int, int, int]] = []  # time, count, identifier, flags, words
        self.offered = 0
        self.all_received: list[Frame] = []

    def send(
        self,
        what: str | int,
        value: float | bytes = 0.0,
        stamp_ms: int | None = None,
        at: Duration = "0 s",
        extended: bool = False,
    ) -> None:
        """Send a variable of the table, or bytes under any other identifier, `at` this long from now.

        `stamp_ms`: its time word; default: the network time.
        """
        identifier = RANGER.identifier(what)
        due_ns = self.bench.now + duration_ns(at, "at")
        if isinstance(value, bytes):
            if len(value) > 8:
                raise UserError(f"send {what!r}: {len(value)} bytes, a frame has up to 8")
            padded = value.ljust(8, b"\0")
            flags = len(value) | (FLAG_EXTENDED if extended else 0)
            words = (int.from_bytes(padded[:4], "little"), int.from_bytes(padded[4:], "little"))
        else:
            kind = all_variables.TYPES.get(identifier)
            if kind is None:
                raise UserError(f"send {what!r}: no variable of the table; give its bytes")
            flags = DATA_8
            stamp = due_ns // SYNC_NS if stamp_ms is None else stamp_ms
            words = (word_of_value(kind, value), stamp & 0xFFFFFFFF)
        self.send_words(due_ns, identifier, flags, *words)

    def send_words(self, due_ns: int, identifier: int, flags: int, lo: int, hi: int) -> None:
        """Request a frame at a time of the bench (ns)."""
        self.offered += 1
        heapq.heappush(self.due, (due_ns, self.offered, identifier, flags, lo, hi))

    @property
    def next_time(self) -> int:
        """When it next has something to do (ns): frames to read, or to send while a buffer is free."""
        sends = max(self.due[0][0], self.bench.now) if self.due and self.free else NEVER
        return min(sends, self.inbox.head_time)

    def poll(self, now_ns: int) -> None:
        """Receive frames that have arrived, and send those that are due."""
        while self.inbox.head_time <= now_ns and self.inbox.take():
            queue = self.inbox
            if queue.kind == CAN_TX_DONE:
                self.free.append(queue.b)
            elif queue.kind == CAN_RX:
                self.all_received.append(
                    frame_type(RANGER)(queue.time, self.bus.name, queue.b, queue.c, queue.d, queue.e)
                )
        while self.due and self.free and self.due[0][0] <= now_ns:
            _, _, *frame = heapq.heappop(self.due)
            self.bus.request(self.number, self.free.pop(0), now_ns, *frame)

    def received(self, what: str | int | None = None) -> list[Frame]:
        """What others sent: every frame, or those of one variable, since the start or the last `forget`."""
        if what is None:
            return list(self.all_received)
        wanted = RANGER.identifier(what)
        return [frame for frame in self.all_received if frame.identifier == wanted]

    def forget(self) -> None:
        """Forget what was received."""
        self.all_received.clear()

    def wait_for(self, what: str | int, within: Duration = "100 ms") -> Frame:
        """Pass time until the next frame of a variable arrives; AssertionError if none does `within` this time."""
        before = len(self.received(what))
        self.bench.until(lambda: len(self.received(what)) > before, within, f"a frame {what} on {self.bus.name}")
        return self.received(what)[before]


class Bench:
    """Passes time on buses and runs the test's calls. `now`: virtual time, ns."""

    def __init__(self, buses: dict[str, int]) -> None:
        self.now = 0
        self.buses = {name: Bus(name, bit_rate, 0, log_capacity=0) for name, bit_rate in buses.items()}
        streams = {}
        for number, (name, bus) in enumerate(self.buses.items()):
            bus.log.stream = streams[name] = FrameStream(number)
        self.observed = Observed(FrameKeeper(streams, RANGER))
        self.window_ns = AHEAD_BITS * SECOND_NS // max([BUS_BIT_RATE, *buses.values()])
        self.nodes: list[Node] = []
        self.calls: list[tuple[int, int, int, Callable[[float], Any]]] = []  # time, count, period, function
        self.called = 0

    @property
    def time_s(self) -> float:
        """Virtual time, s."""
        return self.now * 1e-9

    @property
    def figures(self) -> list[Figure]:
        """Measurements that have a limit."""
        return self.observed.figures

    def wire(self, bus: str | None = None, since_s: float | None = None) -> Wire:
        """Periods and latencies of the frames on a bus (the first one), as assertions."""
        return Wire(self.observed, bus if bus is not None else next(iter(self.buses)), since_s, self.time_s)

    def every(self, period: Duration, function: Callable[[float], Any]) -> None:
        """Call `function(time_s)` now and then every `period`: a model of what is connected to the board."""
        self.call_at(self.now, function, duration_ns(period, "every"))

    def call_at(self, time_ns: int, function: Callable[[float], Any], period_ns: int = 0) -> None:
        """Call `function(time_s)` at a time, and again every `period_ns` if that is above 0."""
        self.called += 1
        heapq.heappush(self.calls, (time_ns, self.called, period_ns, function))

    def run_for(self, duration: Duration) -> None:
        """Pass this much virtual time: "20 ms", or a number of seconds."""
        self.run_to(self.now + duration_ns(duration, "run_for"))

    def until(self, condition: Callable[[], Any], within: Duration = "1 s", what: str = "") -> float:
        """Pass time until `condition()` is true; returns the virtual time then, s. Checked every 36 bits of the bus.

        ConditionNotMetError, an AssertionError, when it is not true `within` this time.
        """
        __tracebackhide__ = True
        begun, end = self.now, self.now + duration_ns(within, "until: within")
        while not condition():
            if self.now >= end:
                text = what or getattr(condition, "__name__", "the condition")
                raise ConditionNotMetError(f"{text}: not within {duration_text(self.now - begun)}")
            self.run_to(min(end, self.now + self.window_ns))
        return self.time_s

    def run_to(self, end: int) -> None:
        """Pass time to `end` (ns)."""
        while self.now < end:
            while self.calls and self.calls[0][0] <= self.now:
                time_ns, count, period_ns, function = heapq.heappop(self.calls)
                function(self.time_s)
                if period_ns:
                    heapq.heappush(self.calls, (time_ns + period_ns, count, period_ns, function))
            for bus in self.buses.values():
                if bus.next_time <= self.now:
                    bus.advance(self.now)
            for node in self.nodes:
                node.poll(self.now)
            # a call or a node runs at its time; the board may run beyond its own events
            begins = min([self.calls[0][0] if self.calls else NEVER, *(node.next_time for node in self.nodes)])
            first = min([begins, self.board_due(), *(bus.next_time for bus in self.buses.values())])
            if self.now < first:
                self.now = min(first, end)
                continue
            step = min(self.now + self.window_ns, end)
            for at in (begins, *(bus.next_time for bus in self.buses.values())):
                if self.now < at < step:
                    step = at
            self.advance_board(step)
            self.now = step
        self.advance_board(end)
        for node in self.nodes:
            node.poll(end)

    def board_due(self) -> int:
        """When the board has something to do (ns); here there is not a board."""
        return NEVER

    def advance_board(self, until: int) -> None:
        """Run the board."""


class BusAlone(Bench):
    """A bus with nodes of the test: `a = bus.node("a")`; `a.send("MCH_ANGLE", 0.5)`; `bus.run_for("1 ms")`.

    `bus`: the bus itself, with counters and disturbances (can_bus/bus.py).
    """

    def __init__(self, bit_rate: int = BUS_BIT_RATE, name: str = "can1") -> None:
        Bench.__init__(self, {name: bit_rate})
        self.bus: Bus = self.buses[name]

    def node(self, name: str) -> Node:
        """Add a node."""
        self.nodes.append(Node(self, self.bus, name))
        return self.nodes[-1]


class Pin:
    """A digital pin of the board. `log`: (time in s, level) of what the board put out on it."""

    def __init__(self, bench: BoardAlone, name: str, number: int) -> None:
        self.bench = bench
        self.name = name
        self.number = number
        self.log: list[tuple[float, int]] = []

    @property
    def level(self) -> int:
        """Its level now."""
        return int(self.bench.chip.pins[self.number])

    def set(self, level: int, at: Duration = "0 s") -> None:
        """Drive it to 0 or 1, `at` this long from now."""
        time_ns = self.bench.now + duration_ns(at, "at")
        self.bench.chip.inbox.push(time_ns, ORDER_PINS, PIN_EDGE, self.number, 1 if level else 0, -1, 0)

    def pulse(self, width: Duration, at: Duration = "0 s") -> None:
        """Drive it high for `width`."""
        begin = duration_ns(at, "at")
        self.set(1, f"{begin} ns")
        self.set(0, f"{begin + duration_ns(width, 'pulse')} ns")


class Encoder:
    """An incremental encoder on two pins of the board: channel A gives edges, B the direction."""

    def __init__(self, bench: BoardAlone, pin_a: int, pin_b: int) -> None:
        self.bench = bench
        self.buffer = EdgeBuffer()
        self.level = 0
        bench.chip.connect_edges(self.buffer, pin_a, pin_b)

    def turn(self, edges: int, period: Duration, forward: bool = True) -> None:
        """Send `edges` edges from now on, one per `period`; pass the time afterwards, then call it again."""
        if self.buffer.read == self.buffer.count:
            self.buffer.clear()
        time_ns, period_ns = self.bench.now, duration_ns(period, "turn: period")
        for _ in range(edges):
            time_ns += period_ns
            self.level ^= 1
            self.buffer.push(time_ns, self.level, self.level ^ 1 if forward else self.level)
        self.bench.chip.note_edges()


class Outputs(Outbox):
    """Receives the board's outputs: frames go to its buses, the rest to logs that the test reads."""

    def __init__(self, bench: BoardAlone) -> None:
        self.bench = bench

    def push(self, time, order, kind, a=0, b=0, c=0, d=0, e=0, f=0, ref=None):  # type: ignore[no-untyped-def]
        """Take one stamped message of the board; returns 0, because the compiled caller needs a number."""
        bench = self.bench
        if kind == CAN_REQUEST:
            bench.buses_of[a][0].request(bench.buses_of[a][1], b, time, c, d, e, f)
        elif kind == CAN_ABORT:
            bench.buses_of[a][0].abort(bench.buses_of[a][1], b, time)
        elif kind == CAN_MODE:
            bench.buses_of[a][0].set_mode(bench.buses_of[a][1], b, time)
        elif kind == CAN_FILTER:
            bench.buses_of[a][0].set_filter(bench.buses_of[a][1], ref if b else None, time)
        elif kind == PWM_UPDATE:
            bench.pwm_log.append((time * 1e-9, (a - b) / c))
        elif kind == PIN_OUTPUT:
            bench.pin_log[a].append((time * 1e-9, b))
        elif kind == UART_OUTPUT:
            bench.uart_log[a].append((time * 1e-9, b))
        elif kind in (SSP_START, SSP_LOAD) and bench.link is not None:
            bench.link.from_board(kind, time, ref)
        return 0


class BoardAlone(Bench):
    """Board `name` of the robot without the others. `chip` is the board itself: all of it may be inspected.

    quirks: switches of the firmware; bit_rate of its buses; network_time: the router's time arrives every ms, as on the
    robot; crystal_ppb: the error of its clock; firmware: a folder of C that the board runs, in this
    process; function names for `replace` are those of its schedule.
    """

    def __init__(
        self,
        name: str,
        quirks: Quirks | None = None,
        bit_rate: int = BUS_BIT_RATE,
        network_time: bool = True,
        crystal_ppb: int = 0,
        firmware: Any = None,
    ) -> None:
        if name not in BOARD_CLASSES:
            raise UserError(unknown("board", name, BOARD_CLASSES))
        wires = [wire for wire in wiring.CAN if wire.board == name]
        Bench.__init__(self, {f"can{wire.bus}": bit_rate for wire in wires})
        self.name = name
        crystal = Crystal(10_000_000, crystal_ppb)
        self.firmware = native_boards.built({name: firmware})[name] if firmware is not None else None
        if self.firmware is not None:
            self.chip: Any = self._board_in_c(self.firmware, crystal)
        else:
            self.chip = BOARD_CLASSES[name](crystal, quirks or Quirks(), 0)
        sent = first_outputs(self.chip)
        self.chip.outbox = Outputs(self)
        self.buses_of: dict[int, tuple[Bus, int]] = {}
        self.node_on: dict[str, Node] = {}
        for wire in wires:
            bus = self.buses[f"can{wire.bus}"]
            number = bus.add_node(name, self.chip.inbox, wire.controller, FIRST_ORDER + wire.controller)
            bus.nodes[number].connect(self.chip.transmit_ends(wire.controller))
            self.buses_of[wire.controller] = (bus, number)
            self.node_on[bus.name] = Node(self, bus, "test")
        self.nodes = list(self.node_on.values())
        self.pwm_log: list[tuple[float, float]] = []  # (time in s, duty -1 ... 1)
        self.pin_log: dict[int, list[tuple[float, int]]] = collections.defaultdict(list)
        self.uart_log: dict[int, list[tuple[float, int]]] = collections.defaultdict(list)
        self.encoders: dict[str, Encoder] = {}
        self.link: Link | None = link_of(self)
        pass_on(sent, self.chip.outbox, 0)
        if network_time and name != "CSR":
            self.call_at(SYNC_NS, self._send_time, SYNC_NS)

    def _board_in_c(self, firmware: Firmware, crystal: Crystal) -> Any:
        """The board with a program in C, first tried in another process."""
        from ranger_sim.ranger.firmware.robot_native_board import RobotNativeBoard  # only here: it loads cffi

        name = self.name

        def start(record: Any) -> None:
            RobotNativeBoard(name, firmware, crystal, 0, record)

        tried(f"{firmware.folder}: {name}", firmware.library, firmware.folder, start)
        board = RobotNativeBoard(name, firmware, crystal, 0)
        board.counts = firmware.counts
        board.leave_record_in(*crash.record_of(name, firmware.library, firmware.folder))
        return board

    # --- inputs ------------------------------------------------------------------------------------------

    def pin(self, name: str) -> Pin:
        """A digital pin, named as in ranger/wiring.py: `board.pin("limit_switch_left").set(1)`."""
        pins = wiring.PINS.get(self.name, {})
        pin = Pin(self, name, self._place("pin", name, pins))
        pin.log = self.pin_log[pin.number]
        return pin

    def volts(self, name: str, volts: float) -> None:
        """Hold a voltage at an analogue input: `board.volts("motor_current", 1.25)`."""
        place = self._place("analogue input", name, wiring.ANALOG_INPUTS.get(self.name, {}))
        self.chip.analog.set_pair(place, self.now, volts, self.now + 1, volts)

    def word(self, name: str, value: int) -> None:
        """Set a digital sensor's word: `board.word("absolute_encoder", 4590)`."""
        registers = {
            each.register: wiring.WORD_REGISTERS[each.register] for each in wiring.WORDS if each.board == self.name
        }
        self.chip.words[self._place("word", name, registers)] = value

    def encoder(self, name: str) -> Encoder:
        """An incremental encoder, by its pair of channels: `board.encoder("01").turn(100, "50 us")`."""
        pairs = {wire.pin_a.split("_")[1]: wire for wire in wiring.ENCODERS if wire.board == self.name}
        if name not in pairs:
            self._place("encoder", name, dict.fromkeys(pairs, 0))
        if name not in self.encoders:
            pins = wiring.PINS[self.name]
            self.encoders[name] = Encoder(self, pins[pairs[name].pin_a], pins[pairs[name].pin_b])
        return self.encoders[name]

    def can(self, number: int | str | None = None) -> Node:
        """The test's node on a bus of the board: 1 for can1; on a board with one bus without a number."""
        name = next(iter(self.node_on), "") if number is None else f"can{number}" if isinstance(number, int) else number
        if name not in self.node_on:
            there = ", ".join(self.node_on) or "no bus: it has the link (board.link)"
            raise UserError(f"{self.name}.can({number!r}): the board is on {there}")
        return self.node_on[name]

    def uart(self, number: int, data: bytes, byte_time: Duration = "21714 ns") -> None:
        """Send bytes to a UART from now on, each taking `byte_time` (10 bits at 460,526 baud)."""
        time_ns = self.now
        for byte in data:
            time_ns += duration_ns(byte_time, "byte_time")
            self.chip.inbox.push(time_ns, ORDER_PINS, UART_BYTE, number, byte, 0, 0, 0)

    def replay(self, frames: Iterable[Frame]) -> int:
        """Send what others sent in a recording, at its pace from now on; returns the number of frames.

        `frames`: of replay.read_log. The board's own publications are left out, because it sends them again. The frames
        must be of buses that the board is on.
        """
        own = set(self.chip.table.SEND)
        given = 0
        first_ns: int | None = None
        for frame in frames:
            if frame.bus not in self.buses:
                if frame.bus in ("can1", "can2", "can3", "can4"):
                    continue  # of a walk's folder, but not of this board
                raise UserError(
                    f"replay: channel {frame.bus!r} is not a bus of {self.name}: "
                    f"read_log(path, bus={next(iter(self.buses), 'can1')!r}) says which it is"
                )
            if frame.identifier in own:
                continue
            if first_ns is None:
                first_ns = frame.time_ns
            node = self.node_on[frame.bus]
            # receivers should have it at its stamp, a bit before its end; the first one begins now
            bits = frame_bits(frame.identifier, frame.flags, frame.lo, frame.hi) - 1
            length_ns = bits * 1_000_000_000 // node.bus.bitrate
            due_ns = self.now + frame.time_ns - first_ns
            node.send_words(max(self.now, due_ns - length_ns), *frame[2:])
            given += 1
        return given

    def replace(self, task: str, function: Callable[[], int | None], cost: int, limit: int | None = None) -> None:
        """Put your own function in a schedule entry; it declares its cost in cycles."""
        self.chip.scheduler.replace(task, function, cost=cost, limit=limit)

    # --- outputs -----------------------------------------------------------------------------------------

    @property
    def duty(self) -> float:
        """Duty of its bridge now, -1 ... 1; 0 before it has written one."""
        return self.pwm_log[-1][1] if self.pwm_log else 0.0

    def errors(self) -> dict[str, int]:
        """How often it recorded each error, by name."""
        from ranger_sim.ranger.records.summary import errors

        return errors(self.chip.counters())

    @property
    def overruns(self) -> int:
        """The number of slots that took longer than allowed."""
        return int(self.chip.counters().slots.overruns)

    # --- inside -------------------------------------------------------------------------------------------

    def _place(self, kind: str, name: str, places: dict[str, int]) -> int:
        if name not in places:
            raise UserError(f"{self.name}: {unknown(kind, name, map(str, places))}")
        return places[name]

    def _send_time(self, time_s: float) -> None:
        ms = self.now // SYNC_NS
        for node in self.nodes:
            node.send_words(self.now, SYNC_ID, DATA_8, ms & 0xFFFFFFFF, ms & 0xFFFFFFFF)
        if self.link is not None:
            self.link.send_words(SYNC_ID, ms, ms)

    def board_due(self) -> int:
        chip = self.chip
        return int(min(chip.next_time, chip.inbox.head_time, chip.edge_time))

    def advance_board(self, until: int) -> None:
        self.chip.advance(until)
