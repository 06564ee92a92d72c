# cython: boundscheck=False, wraparound=False
# (every index below is a controller 1 ... 4, as in the tables of the wires)
"""The wires that leave the boards: to buses, bridges, the serial link, and devices on a UART.

A message is carried on when a board puts it out, with its stamp. The other direction, into a
board's inbox, is written there by its sender: the bus, the link, the plant's sensors.
"""

from typing import TYPE_CHECKING

import cython

from ranger_sim.can_bus.acceptance import Acceptance
from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.node import FDF_KNOWN
from ranger_sim.firmware_sim.peripherals.ssp import SspSegment
from ranger_sim.foundation.events import (
    CAN_ABORT,
    CAN_FILTER,
    CAN_MODE,
    CAN_REQUEST,
    ORDER_INTERRUPTS,
    PIN_OUTPUT,
    PWM_UPDATE,
    SSP_LOAD,
    SSP_SEGMENT,
    SSP_START,
    UART_OUTPUT,
    EventQueue,
    Outbox,
)
from ranger_sim.foundation.row_stream import RowStream
from ranger_sim.foundation.user_error import UserError

if TYPE_CHECKING:
    from ranger_sim.firmware_sim.board import Board
    from ranger_sim.plant.bridge import Bridge

CONTROLLERS = range(1, 5)


@cython.final
@cython.cclass
class WordWire:
    """The register of one digital sensor of the plant, as a board reads it over its serial interface."""

    source: cython.longlong
    word: cython.longlong
    board: "Board"

    def __init__(self, source, board, word) -> None:
        self.source = source
        self.board = board
        self.word = word


@cython.final
@cython.cclass
class SspWire:
    """The serial link between two boards; an exchange that the master starts takes `exchange_ns`.

    `tampering`: a fault that changes what arrives, or None (`harness/faults/links.py`).
    """

    master: "EventQueue"
    slave: "EventQueue"
    exchange_ns: cython.longlong
    exchanges: cython.longlong
    loaded: object
    tampering: object
    watch: RowStream

    def __init__(self, master, slave, exchange_ns, idle_segment) -> None:
        self.master = master.inbox
        self.slave = slave.inbox
        self.exchange_ns = exchange_ns
        self.loaded = idle_segment
        self.exchanges = 0
        self.watch = None  # a RowStream that takes what is exchanged (`_note`)
        self.tampering = None

    @cython.ccall
    def start(self, time_ns: cython.longlong, segment: object) -> cython.void:
        """Start an exchange for the master; both sides have the other's segment at its end."""
        end: cython.longlong = time_ns + self.exchange_ns
        to_slave: object = segment
        to_master: object = self.loaded
        if self.tampering is not None:
            to_slave, to_master = self.tampering.exchange(end, segment, self.loaded)
        if to_slave is not None:
            self.slave.push(end, ORDER_INTERRUPTS, SSP_SEGMENT, 0, 0, 0, 0, 0, 0, to_slave)
        if to_master is not None:
            self.master.push(end, ORDER_INTERRUPTS, SSP_SEGMENT, 0, 0, 0, 0, 0, 0, to_master)
        self.exchanges += 1
        if self.watch is not None:
            self._note(time_ns, segment, 0)
            self._note(time_ns, self.loaded, 1)

    @cython.cfunc
    def _note(self, time_ns: cython.longlong, segment: SspSegment, from_slave: cython.longlong) -> cython.void:
        """Add a row to `watch` for each frame in a segment: exchange start (ns), from_slave, header, both words."""
        i: cython.longlong
        watch: RowStream = self.watch
        for i in range(0, segment.used * 3 // 5, 3):  # five half-words are a frame and three numbers of `rows`
            watch.integers[watch.used] = time_ns
            watch.integers[watch.used + 1] = from_slave
            watch.integers[watch.used + 2] = segment.rows[i]
            watch.integers[watch.used + 3] = segment.rows[i + 1]
            watch.integers[watch.used + 4] = segment.rows[i + 2]
            watch.finish_row(time_ns)

    @cython.ccall
    def load(self, segment: object) -> cython.void:
        """Set what the slave will send in the next exchange."""
        self.loaded = segment


@cython.final
@cython.cclass
class BoardWires(Outbox):
    """The wires that leave one board: its outbox in the assembled robot.

    Frames go to its buses, PWM and pins to its bridge, segments over the link, bytes to their receiver. Output of a
    pin, a controller or a UART that is not connected here is dropped.
    """

    board: "Board"
    drive: "Bridge"
    window_ns: cython.longlong
    silent_until: cython.longlong
    watchdog_pin: cython.longlong
    low_side_2_pin: cython.longlong
    low_side_6_pin: cython.longlong
    low_side_2: cython.bint
    low_side_6: cython.bint
    buses: list
    nodes: cython.longlong[5]
    link: SspWire
    watch: RowStream
    can_lines: dict
    serial_lines: dict

    def __init__(self, board, window_ns) -> None:
        self.board = board
        self.window_ns = window_ns  # the earliest return of the board's own output
        # by controller 1 ... 4: the bus and the node number there
        self.buses = [None] * 5
        self.nodes = [-1] * 5
        self.can_lines = {}  # {controller: receiver of its requests}, where the bus is outside
        self.drive = None
        self.watchdog_pin = -1
        self.low_side_2_pin = -1
        self.low_side_6_pin = -1
        self.low_side_2 = False
        self.low_side_6 = False
        self.silent_until = 0  # ns: before that the board promised to put nothing on a bus
        self.link = None
        self.watch = None  # a RowStream that takes the outputs of its pins and its PWM unit: ns, kind, a, b, c
        self.serial_lines = {}  # {UART: its receiver}

    def connect_bus(self, controller, bus, node) -> None:
        """Connect controller 1 ... 4 of the board as `node` of `bus`; None for `bus` takes it off.

        The bus writes the ends of its transmissions where the controller reads them.
        """
        if bus is not None and not isinstance(bus, Bus):  # used as one without a further check
            raise UserError(f"{self.board.name}: {bus!r} is not a Bus")
        if self.buses[controller] is not None:
            self.buses[controller].nodes[self.nodes[controller]].connect(None)
        self.buses[controller] = bus
        self.nodes[controller] = node
        self._connect_ends(controller)

    def _connect_ends(self, controller) -> None:
        bus = self.buses[controller]
        if bus is not None:
            node = bus.nodes[self.nodes[controller]]
            node.connect(self.board.transmit_ends(controller))
            filter_bytes = self.board.filter_of(controller)
            node.acceptance = None if filter_bytes is None else Acceptance(filter_bytes)

    def lead_from(self, board) -> None:
        """Connect `board` to these wires from now on."""
        self.board = board
        board.outbox = self
        for controller in CONTROLLERS:
            self._connect_ends(controller)

    @cython.ccall
    @cython.exceptval(check=False)
    def frames_only(self) -> cython.bint:
        """Whether only buses of this machine take what it puts out: no bridge, link, serial line, or observer."""
        return (
            self.drive is None
            and self.watch is None
            and self.link is None
            and not self.serial_lines
            and not self.can_lines
        )

    def connect_drive(self, drive, watchdog_pin, low_side_2_pin, low_side_6_pin) -> None:
        """Connect the board's PWM unit and three of its pins to a bridge."""
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
        """Forward the board's output at `time` (ns)."""
        if self.watch is not None and (kind == PIN_OUTPUT or kind == PWM_UPDATE):
            self._note(time, kind, a, b, c)
        if kind == PIN_OUTPUT:
            if a == self.watchdog_pin:
                self.drive.watchdog_edge(time)
            elif a == self.low_side_2_pin:
                self.low_side_2 = b != 0
                self.drive.low_side(time, self.low_side_2, self.low_side_6)
            elif a == self.low_side_6_pin:
                self.low_side_6 = b != 0
                self.drive.low_side(time, self.low_side_2, self.low_side_6)
        elif kind == PWM_UPDATE:
            if self.drive is not None:
                self.drive.write_pwm(time, a, b, c)
        elif kind == CAN_REQUEST:
            if ref is None:
                self.request(time, a, b, c, d, e, f)
            else:
                self._request_fd(time, a, b, c, d, ref)
        elif kind == CAN_ABORT or kind == CAN_MODE:
            if self.buses[a] is None:
                self._to_bus_outside(kind, time, a, b, c, d, e, f)
            elif kind == CAN_ABORT:
                self.buses[a].abort(self.nodes[a], b, time)
            else:
                self.buses[a].set_mode(self.nodes[a], b, time)
        elif kind == CAN_FILTER:
            self._set_filter(time, a, ref if b else None)
        elif kind == SSP_START:
            self.link.start(time, ref)
            self.board.stop_at(time + self.link.exchange_ns + self.window_ns)
        elif kind == SSP_LOAD:
            self.link.load(ref)
        elif kind == UART_OUTPUT:
            self._to_serial_line(time, a, b, c, ref)

    @cython.cfunc
    def _note(
        self, time: cython.longlong, kind: cython.longlong, a: cython.longlong, b: cython.longlong, c: cython.longlong
    ) -> None:
        watch: RowStream = self.watch
        watch.integers[watch.used] = time
        watch.integers[watch.used + 1] = kind
        watch.integers[watch.used + 2] = a
        watch.integers[watch.used + 3] = b
        watch.integers[watch.used + 4] = c
        watch.finish_row(time)

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
        """Forward a frame to its bus."""
        if time < self.silent_until:
            self._check_early_transmit(time)
        if self.buses[controller] is None:
            self._to_bus_outside(CAN_REQUEST, time, controller, buffer, identifier, flags, lo, hi)
        else:
            cython.cast(Bus, self.buses[controller]).request(
                self.nodes[controller], buffer, time, identifier, flags, lo, hi
            )
            if time + self.window_ns < self.board.horizon:
                self.board.stop_at(time + self.window_ns)

    def _request_fd(self, time, controller, buffer, identifier, flags, data) -> None:
        """Forward a CAN FD frame to its bus."""
        if time < self.silent_until:
            self._check_early_transmit(time)
        bus = self.buses[controller]
        why = ""
        if bus is None:
            line = self.can_lines.get(controller)
            if line is not None and line.is_fd:
                low, high = int.from_bytes(data[:4], "little"), int.from_bytes(data[4:], "little")
                line.from_board(CAN_REQUEST, time, buffer, identifier, flags, low, high)
            elif line is not None:
                why = "its bus outside, or its controller, is classic CAN"
        elif not bus.is_fd:
            why = f"{bus.name} is classic CAN (a bus of the machine with two bit rates is CAN FD)"
        elif bus.nodes[self.nodes[controller]].fdf != FDF_KNOWN:
            why = "its program has not started it as a CAN FD controller in firmware_start()"
        if why:
            self.board.refuse_output(f"CAN FD frame {identifier:#x} of controller {controller}: {why}")
        if why or bus is None:
            return
        bus.request_fd(self.nodes[controller], buffer, time, identifier, flags, data)
        if time + self.window_ns < self.board.horizon:
            self.board.stop_at(time + self.window_ns)

    def _set_filter(self, time, controller, filter_bytes) -> None:
        """Forward the acceptance filter of a controller to its bus."""
        if time < self.silent_until:
            self._check_early_transmit(time, "an acceptance filter was changed")
        if self.buses[controller] is not None:
            self.buses[controller].set_filter(self.nodes[controller], filter_bytes, time)

    def _check_early_transmit(self, time, what="a frame was sent") -> None:
        raise UserError(
            f"{self.board.name}: {what} at {time} ns, but by its schedule's `transmitters` none could be "
            f"before {self.silent_until} ns: name the task that sends there; for a handler that sends, leave "
            "`transmitters` out"
        )

    def _to_bus_outside(self, kind, time, controller, b, c, d, e, f) -> None:
        line = self.can_lines.get(controller)
        if line is not None:
            line.from_board(kind, time, b, c, d, e, f)

    def _to_serial_line(self, time, uart, byte, count, data) -> None:
        line = self.serial_lines.get(uart)
        if line is not None:
            line.from_board(time, byte, count, data)
