"""The interface of a board: stamped messages in, stamped messages out, and the time at which it must run next.

An emulated microcontroller implements it, and so does the proxy of a board in another process; firmware compiled for
the host or an original image could as well. The caller that passes time needs nothing else.
"""

import array

import cython

from ranger_sim.firmware_sim.analog import AnalogPins
from ranger_sim.foundation.edge_buffer import EdgeBuffer
from ranger_sim.foundation.events import NEVER, EventQueue, Outbox
from ranger_sim.foundation.renamed import renamed
from ranger_sim.foundation.user_error import FirmwareError

WORDS = 16
EVERY_KIND = 0xFFFF  # bits of the message kinds to a board


@cython.cclass
class Board:
    """A board called `name`. Every kind of board implements `advance`; the rest has a meaning for any board.

    Inputs: `inbox`, the stamped messages; `analog`, the voltages at its pins; `words`, digital words that sensors
    provide; the edges of encoders (`connect_edges`). Outputs: `outbox` takes each message as it is output.
    `next_time`: the time (ns) at which it must run if no input arrives; NEVER for none. `edge_time`: that of the first
    edge that waits. `horizon`: how far it runs at most, or has run.
    `out_of_process`: it runs in a separate process, in parallel with the others: between `begin` and `advance` of one
    time others may begin as well.
    `memory`: the words of its program's memory that others may read at any time (None: none are shown).
    """

    next_time: cython.longlong
    edge_time: cython.longlong
    horizon: cython.longlong
    inbox: EventQueue
    outbox: "Outbox"
    analog: AnalogPins
    words: cython.longlong[::1]
    name: str
    out_of_process: cython.bint
    memory: object

    def __init__(self, name) -> None:
        self.name = name
        self.inbox = EventQueue()
        self.outbox = EventQueue()
        self.analog = AnalogPins()
        self.words = array.array("q", [0]) * WORDS
        self.next_time = 0
        self.edge_time = NEVER
        self.horizon = 0
        self.out_of_process = False
        self.memory = None

    # --- passing time -------------------------------------------------------------------------------------

    @cython.ccall
    @cython.exceptval(check=True)
    def begin(self, until: cython.longlong) -> cython.void:
        """Announce that `advance(until)` will follow: a board in a separate process starts now."""

    @cython.ccall
    @cython.exceptval(check=False)
    def can_wait(self, until: cython.longlong) -> cython.bint:
        """Whether nothing that it does before `until` (ns) acts on anything but itself: it may run that time later."""
        return False

    @cython.ccall
    def advance(self, until: cython.longlong) -> cython.longlong:
        """Run everything before `until` (ns), or less far where an output asks for it; returns `next_time`."""
        raise NotImplementedError(f"{self.name}: a board must say how it advances")

    @cython.ccall
    @cython.exceptval(check=False)
    def stop_at(self, time: cython.longlong) -> cython.longlong:
        """Limit a running board to `time` (ns), which is later than now. Returns where it stops."""
        if time < self.horizon:
            self.horizon = time
        return self.horizon

    @cython.ccall
    def earliest_transmit_ns(self) -> cython.longlong:
        """Earliest time (ns) at which the board can send on a bus, unless an urgent message arrives."""
        return self.next_time

    @cython.ccall
    @cython.exceptval(check=False)
    def quiet_until(self) -> cython.longlong:
        """Earliest time (ns) at which the board can output anything, whatever non-urgent input arrives."""
        return 0

    @cython.ccall
    @cython.exceptval(check=False)
    def urgent_kinds(self) -> cython.longlong:
        """Bits of the message kinds that it may answer at once: they cannot wait."""
        return EVERY_KIND

    # --- what is connected to it --------------------------------------------------------------------------

    @cython.ccall
    def connect_edges(self, buffer: EdgeBuffer, pin: cython.longlong, partner_pin: cython.longlong) -> None:
        """Take edges of `buffer` on `pin`, each with the level of `partner_pin`; `note_edges` announces them."""
        raise NotImplementedError(f"{self.name}: this kind of board has no pins for an encoder")

    @cython.ccall
    @cython.exceptval(check=False)
    def note_edges(self) -> cython.longlong:
        """Note that the buffers of encoders may hold new edges; returns `edge_time`."""
        return self.edge_time

    @cython.ccall
    def transmit_ends(self, controller: cython.longlong) -> object:
        """The buffer for the ends of a CAN controller's transmissions; None: the bus sends them as messages."""
        return None

    def filter_of(self, controller) -> bytes | None:
        """The acceptance filter of a CAN controller (bytes of `can_bus.acceptance`); None: it accepts every frame."""
        return None

    def refuse_output(self, text) -> None:
        """Take what was wrong with an output that nothing outside can take: its program's mistake. FirmwareError."""
        raise FirmwareError(f"{self.name}: {text}")

    def can_rates(self, controller) -> tuple[int, int] | None:
        """Both bit rates of a CAN FD controller, bit/s; None: a classic one, or no such controller."""
        return None

    def listen_to_edges(self, buffer: EdgeBuffer, pin, partner_pin) -> None:
        """The old name of `connect_edges`."""
        renamed("Board.listen_to_edges", "connect_edges")
        self.connect_edges(buffer, pin, partner_pin)

    def edges_came(self) -> int:
        """The old name of `note_edges`."""
        renamed("Board.edges_came", "note_edges")
        return self.note_edges()

    def speaks_from(self) -> int:
        """The old name of `earliest_transmit_ns`."""
        renamed("Board.speaks_from", "earliest_transmit_ns")
        return self.earliest_transmit_ns()

    # --- inspection ---------------------------------------------------------------------------------------

    @cython.ccall
    def move_memory(self, words) -> None:
        """Move the words of `memory`, with their values, into `words`: memory that processes share."""
        raise NotImplementedError(f"{self.name} shows no memory")

    @cython.ccall
    @cython.exceptval(check=False)
    def watched(self) -> cython.longlong:
        """One number of its program, as a debugger would watch it; the kind of board defines which."""
        return 0

    @cython.ccall
    @cython.exceptval(check=False)
    def latest_slot(self) -> cython.longlong:
        """Start of its latest slot (ns); 0 before the first."""
        return 0

    @cython.ccall
    def counters(self) -> object:
        """The board's counters, by name."""
        raise NotImplementedError(f"{self.name}: this kind of board counts nothing")
