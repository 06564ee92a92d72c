"""A board whose firmware is C: the chip and its devices are the emulated ones, tasks and handlers are C functions.

What the program calls (firmware.h) arrives at header_calls.py.
"""

import array
import contextlib
import pathlib
from collections.abc import Iterator
from typing import Any, Final

import cython

from ranger_sim.firmware_sim.counters import CanCounters, ProgramCounters
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.native.functions import Function, function
from ranger_sim.firmware_sim.native.hardware import DEFAULT_HZ, Hardware
from ranger_sim.firmware_sim.native.header_calls import Calls, connect
from ranger_sim.firmware_sim.native.library import Library, ffi, text
from ranger_sim.firmware_sim.native.program import pointer, set_word
from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.scheduler import Occasional, Schedule, Task, Wait
from ranger_sim.firmware_sim.vic import InterruptSource
from ranger_sim.foundation.edge_buffer import EdgeBuffer
from ranger_sim.foundation.user_error import FirmwareError

# fw_schedule_flags and fw_kind of firmware.h
TRANSMITTERS_NAMED, NO_COMPLETION_FLAG, NO_IDLE_CALL = 1, 2, 4
WAIT = 1
WORD: Final = 0xFFFF_FFFF
LONGEST_TURN_NS: Final = 10_000_000  # of a program that is not stopped earlier; chosen by us: some slots
MAIN_ENDED: Final = -1  # further results of a turn of a main loop, next to cycles
NO_STACK: Final = -2


@cython.cclass
class StartUp(Peripheral):
    """The steps of the start-up, each at its time."""

    functions: list

    def __init__(self, chip, steps) -> None:
        Peripheral.__init__(self, chip)
        self.functions = [function for _, function in steps]
        for number, (time, _) in enumerate(steps):
            chip.new_alarm(self, number).set(time)

    def on_alarm(self, alarm: cython.longlong, time: cython.longlong) -> InterruptSource | None:
        self.functions[alarm]()
        return None


@cython.cclass
class PlainPin(Peripheral):
    """A pin with an encoder that the program does not capture: its level can be read, no more."""

    def on_pin(self, channel: cython.longlong, level: cython.longlong, time: cython.longlong) -> cython.longlong:
        return 0


@cython.cclass
class NativeBoard(Microcontroller):
    """A chip with the devices of `hardware` that runs the firmware in the library `path` from `phase_ns` (ns) on.

    A misuse of a device that the chip would not survive ends the run with a UserError
    that names the call. `devices` has what the program has started. record: as for `leave_record_in`, from the start.
    """

    turn: cython.longlong
    turns: cython.p_void
    reached: cython.longlong
    failure: object
    devices: Calls
    library: object
    phase_ns: cython.longlong
    pin_levels: object
    counts: object
    main: Function
    limit_hook: Function
    error_counts: object
    start_up: object

    def __init__(self, name, path, crystal=None, phase_ns=0, hardware=None, record=None) -> None:
        hardware = hardware if hardware is not None else Hardware()
        Microcontroller.__init__(self, name, hardware.hz or DEFAULT_HZ, crystal)
        self.library = Library(pathlib.Path(path))
        if record is not None:
            self.leave_record_in(record)
        self.failure = None
        self.phase_ns = phase_ns
        self.now = phase_ns
        if hardware.panel is not None:
            self.carry(hardware.panel(self))
        self.devices = Calls(self, self.library, hardware, phase_ns)
        levels = array.array("q", bytes(8 * len(self.pins)))  # where the program reads them without a call
        self.pins = levels
        self.pin_levels = ffi.from_buffer("int64_t[]", levels)
        self.library.code.fw_pin_levels = self.pin_levels
        connect(self.devices, self.library)
        self.counts = None  # folder for coverage
        self.main = None
        self.limit_hook = None
        self.turn = 0
        self.turns = pointer(self.library.place("fw_turns"))
        self.reached = phase_ns
        with self._running():
            self.library.code.firmware_start()
        self._raise_failure()
        with self._running():
            self.error_counts = self.library.code.firmware_errors() if self.library.has("firmware_errors") else None
        if self.library.schedule:
            self._take_schedule()
        else:
            self.main = Function(self.library.code.fw_turn)
            self.background = self._turn
            self.input_time = self.code_time = phase_ns
            self.next_time = phase_ns

    def _raise_failure(self) -> None:
        if self.failure is not None:
            raise self.failure

    @contextlib.contextmanager
    def _running(self) -> Iterator[None]:
        """Inside, the program runs: a turn of it, which is not endless (`leave_record_in`)."""
        self.turn = (self.turn + 2) & WORD
        set_word(self.turns, self.turn | 1)
        try:
            yield
        finally:
            set_word(self.turns, self.turn)

    def advance(self, until: cython.longlong) -> cython.longlong:
        """Run everything before `until` (ns); UserError for what the program did wrong."""
        end: cython.longlong
        while until - self.reached > LONGEST_TURN_NS:
            end = self.reached + LONGEST_TURN_NS
            self._turn_until(end)
            if self.horizon < end:
                return self.next_time
        return self._turn_until(until)

    @cython.cfunc
    def _turn_until(self, until: cython.longlong) -> cython.longlong:
        next_time: cython.longlong
        self.turn = (self.turn + 2) & WORD
        set_word(self.turns, self.turn | 1)
        try:
            next_time = Microcontroller.advance(self, until)
        finally:
            set_word(self.turns, self.turn)
        self.reached = max(self.reached, until)  # it is asked before its power comes, too
        if self.failure is not None:
            raise self.failure
        return next_time

    def write_counts(self) -> None:
        """Add which lines of its program ran to the counts below `counts`; nothing where that is not asked for."""
        if self.counts is not None:
            self.library.write_counts(self.counts)

    def leave_record_in(self, words: Any, message: str = "") -> None:
        """From now on a signal that ends this process leaves in `words` where the program was (library.py)."""
        self.library.leave_record_in(words, message)

    def connect_edges(self, buffer: EdgeBuffer, pin: cython.longlong, partner_pin: cython.longlong) -> None:
        """As the chip's; the program need not capture the pin."""
        if self.pin_owners[pin] is None:
            self.claim_pin(pin, 0, PlainPin(self))
        Microcontroller.connect_edges(self, buffer, pin, partner_pin)

    # --- the schedule -------------------------------------------------------------------------------------

    def _take_schedule(self) -> None:
        """Ask the program for its schedule and start it."""
        with self._running():
            given = self.library.code.firmware_schedule()
        self._raise_failure()
        if given == ffi.NULL:
            raise FirmwareError(f"{self.library.path}: firmware_schedule() returned NULL")
        every, last = self._tasks(given.every, "every"), self._tasks(given.last, "last")
        rows = [self._tasks(given.rows[row], f"row {row}") for row in range(given.row_count)] or [[]]
        occasional = None
        if given.occasional.count:
            occasional = Occasional(
                self._tasks(given.occasional, "occasional"),
                cost=given.occasional_cost,
                limit=given.occasional_limit,
                extra_idle_call=not given.flags & NO_IDLE_CALL,
            )
        transmitters = None
        if given.flags & TRANSMITTERS_NAMED:
            tasks = [each.tasks[i] for each in (given.every, given.last) for i in range(each.count)]
            transmitters = [text(task.name) for task in tasks if task.transmits]
        schedule = Schedule(
            slot_ns=given.slot_ns,
            every=every,
            rows=rows,
            last=last,
            occasional=occasional,
            occasional_row=given.occasional_row,
            divider=given.divider or 1,
            completion_flag=not given.flags & NO_COMPLETION_FLAG,
            tick_cost=given.tick_cost,
            tick_slot=given.tick_vic_slot,
            transmitters=transmitters,
        )
        hooks = {name: getattr(given, name) for name in ("on_tick", "on_overrun", "on_limit", "on_near_limit")}
        called = {name: function(hook) for name, hook in hooks.items() if hook != ffi.NULL}
        if "on_tick" in called:
            self.on_timer_tick = called["on_tick"].hook
        if "on_overrun" in called:
            self.on_overrun = called["on_overrun"].hook
        if "on_near_limit" in called:
            self.on_near_limit = called["on_near_limit"].hook
        if "on_limit" in called:
            self.on_limit = called["on_limit"].notice
        steps = [given.steps[number] for number in range(given.step_count)]
        self.start_up = StartUp(self, [(self.phase_ns + step.after_ns, function(step.function).hook) for step in steps])
        self.start(schedule, self.phase_ns + given.first_slot_ns)

    def _tasks(self, given: Any, where: str) -> list[Task]:
        """A list of the program's tasks."""
        return [self._task(given.tasks[number], f"{where}[{number}]") for number in range(given.count)]

    def _task(self, given: Any, where: str) -> Task:
        if given.function == ffi.NULL:
            raise FirmwareError(f"{self.library.path}: schedule: {where} {text(given.name)!r} has no function")
        name = text(given.name) or where
        if given.kind == WAIT:
            return Wait(function(given.function).work, cost=given.cost, limit=given.limit, name=name)
        return Task(function(given.function).work, given.cost, given.limit, given.per_item, text(given.item), name)

    # --- the main loop ------------------------------------------------------------------------------------

    @cython.ccall
    def _turn(self) -> cython.longlong:
        """Run one turn of the program's main loop, until it lets time pass. Returns the time at which it goes on."""
        cycles: cython.longlong = self.main.turn()
        if cycles == NO_STACK:
            self.failure = FirmwareError(f"{self.name}: no memory for the stack of the main loop")
        if cycles in (MAIN_ENDED, NO_STACK):
            self.background = None  # as on the chip, where start-up code spins behind it
            return 0
        return self.now + int(cycles * self.ns_per_cycle) if cycles else 0

    # --- looking in ---------------------------------------------------------------------------------------

    def counters(self) -> object:
        """What the board counted, by name. Its program's own queues are not known."""
        return ProgramCounters(
            hz=self.hz,
            unclaimed=self.unclaimed,
            slots=self.scheduler.counters(),
            can=self.can_counters(),
            time_ms=self.network_time_ms(),
            errors=list(self.error_totals(self.error_counts.count if self.error_counts is not None else 0)),
        )

    def network_time_ms(self) -> int:
        """The robot's time as the program has it (ms); 0 where it does not say."""
        if not self.library.has("firmware_time_ms"):
            return 0
        with self._running():
            return self.library.code.firmware_time_ms()

    def error_totals(self, count: int) -> Any:
        """How often the program noted the errors 0 ... count - 1; zeros where it does not say."""
        totals = array.array("q", bytes(8 * count))
        if self.error_counts is not None:
            for code, times in enumerate(ffi.unpack(self.error_counts.counts, min(count, self.error_counts.count))):
                totals[code] = times
        return totals

    def error_image(self, count: int) -> bytes:
        """The memory of `error_totals(count)`; empty where the program does not say."""
        if self.error_counts is None:
            return b""
        return bytes(ffi.buffer(self.error_counts.counts, 4 * min(count, self.error_counts.count)))

    def can_counters(self) -> list[CanCounters]:
        """Of each controller that the program has started."""
        controllers = self.devices.cans.by_number | self.devices.fds.by_number
        return [
            CanCounters(number, can.received, can.sent, can.data_overruns, receive_lost=0, queue_full=0)
            for number, can in sorted(controllers.items())
        ]
