"""Named bus schedules: the variables that a robot on slower buses sends less often, as data.

A schedule is a file `profiles/schedules/NAME.toml`. It changes no firmware: each board's own table is laid out over
several passes without what is not due, and the main brain's link gets the list of what may leave when.

    [every]            variable = n: only every n-th of its own turns. A turn is a pass through the rows for what stands
                       in a board's rows, a slot of the main brain (2 ms) for a command
    [occasional]       board = n: its occasional list is called in every n-th pass only
    commands_in_turn   n: of the commands that [every] does not name, one leaves in every n-th slot of the main brain,
                       in turn. 0: each leaves in the slot in which it was written

What is sent in every n-th pass is spread over the passes: the variables of row r are sent in the passes p with
p mod n = r mod n, so that a board's frames follow each other no more closely than necessary.

`streams` returns what a bus then carries, in the terms of the response-time analysis.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

from ranger_sim import datatable
from ranger_sim.can_bus.bounds import Bound, Message, message, most_waiting, response_times
from ranger_sim.can_bus.frame import arbitration_key
from ranger_sim.datatable.model import Board, Table, Variable
from ranger_sim.firmware_sim.scheduler import Occasional
from ranger_sim.foundation.user_error import UserError

MOST_TURNS = 1000  # turns to the next sending; with more a variable is practically not sent (chosen by us)
MOST_ROWS = 10_000  # rows of a table laid out over its passes (chosen by us)

# What the bounds assume of release times. Crystals: 30 ppm each (firmware_sim/clock.py).
CRYSTAL_PPM = 30
# TIMESTAMP comes from an interrupt that waits at most for the others of its level: four frames of 90 cycles and the
# service of one segment, 240 + 31 x 14 cycles (boards/can_router.py): 18 us.
SYNC_JITTER_NS = 20_000
# The exchange between main brain and router runs every 200 us, free of the main brain's slots (robot.md N1.6).
EXCHANGE_NS = 200_000
FRAMES_PER_EXCHANGE = 6
# How much a main-brain slot varies before it sends, and the router before it has routed: chosen by us, above what the
# costs of boards/main_brain/board.py and boards/can_router.py make of twenty frames and a slot of the router.
COMMAND_VARIATION_NS = 200_000
# What a command that the schedule does not name adds without `commands_in_turn`. Boards that receive something in
# every slot (the motors) get at most one other command per slot: the modes change one thing at a time. Of the other
# boards (display, lights) each command comes at most this often, all of them perhaps in one slot: the fastest is
# ERROR_LCD, once per pass of the main brain's rows, 22 ms. The first slot of all, which sends every command once, is
# not covered.
ON_DEMAND_MS = Fraction(20)
HARDWARE_BUFFERS = 2  # transmit buffers that a board's queue is emptied into (robot.md N1.6, N4.14)
SYNC = "TIMESTAMP"
OTHER = "(other commands)"


@dataclasses.dataclass(frozen=True)
class BusSchedule:
    """One named schedule. `every`: variable -> n; `occasional`: board -> n; see this module's docstring."""

    name: str
    title: str
    description: str
    every: Mapping[str, int]
    occasional: Mapping[str, int]
    commands_in_turn: int

    def turns(self, variable: str) -> int:
        """The n for which it is sent in every n-th of its turns."""
        return self.every.get(variable, 1)


@dataclasses.dataclass(frozen=True)
class Stream:
    """One entry of a schedule: a message of the analysis, and the variables that take turns in it."""

    message: Message
    variables: tuple[str, ...]
    board: str


@functools.cache
def robots_table() -> Table:
    """The master table of the robot, loaded once."""
    return datatable.load()


def command_variables(table: Table) -> tuple[Variable, ...]:
    """What the main brain may send to the buses, by id."""
    return tuple(v for v in table.variables if v.publisher == "MB" and any(bus.startswith("CAN") for bus in v.buses))


@dataclasses.dataclass(frozen=True)
class Commands:
    """The main brain's commands by their departure: in every n-th slot; one in every `turn_every` slots, in turn; in
    the slot in which they are written."""

    regular: tuple[tuple[Variable, int], ...]
    in_turn: tuple[Variable, ...]
    turn_every: int
    at_once: tuple[Variable, ...]


def sort_commands(table: Table, schedules: Mapping[str, BusSchedule]) -> Commands:
    """How each command leaves with the schedules of its buses; where these differ, the slowest counts."""
    regular, in_turn, at_once = [], [], []
    turn_every = 1
    for variable in command_variables(table):
        own = [schedules[bus.lower()] for bus in variable.buses if bus.lower() in schedules]
        naming = [one for one in own if variable.name in one.every]
        if naming:
            regular.append((variable, max(one.turns(variable.name) for one in naming)))
        elif any(one.commands_in_turn for one in own):
            in_turn.append(variable)
            turn_every = max(turn_every, *(one.commands_in_turn for one in own))
        else:
            at_once.append(variable)
    return Commands(tuple(regular), tuple(in_turn), turn_every, tuple(at_once))


def schedule_of_board(schedules: Mapping[str, BusSchedule], board: Board) -> BusSchedule:
    """The schedule of the one bus that a satellite is on. `schedules`: by bus, can1 ... can4."""
    return schedules[board.buses[0].lower()]


# ---- applied to boards


def passes_of(board: Board, schedule: BusSchedule) -> int:
    """The number of passes through its rows after which a board's sending repeats."""
    turns = [schedule.turns(name) for row in board.rows for name in row]
    return math.lcm(schedule.occasional.get(board.name, 1), *turns)


def thinned_rows(board: Board, rows: list, schedule: BusSchedule) -> list:
    """The rows of a board's table laid out over as many passes as it takes until all repeats.

    `rows`: lists of tasks, in the order of boards.toml, the occasional list as the last task of its row.
    """
    occasional = schedule.occasional.get(board.name, 1)
    laid_out = []
    for number in range(passes_of(board, schedule)):
        for row, (names, tasks) in enumerate(zip(board.rows, rows, strict=True)):
            turns = [schedule.turns(name) for name in names]
            if any(isinstance(task, Occasional) for task in tasks):
                turns.append(occasional)
            laid_out.append([task for task, n in zip(tasks, turns, strict=True) if number % n == row % n])
    return laid_out


def apply(board: Any, schedules: Mapping[str, BusSchedule], table: Table | None = None) -> None:
    """Apply to an emulated board the schedules of its buses, by name: after it is built, before time passes."""
    table = table if table is not None else robots_table()
    description = table.board(board.name)
    if description.role == "main brain":
        _apply_to_main_brain(board, schedules, table)
    elif description.role == "satellite":
        _apply_to_satellite(board, schedule_of_board(schedules, description), description)


def _apply_to_satellite(board: Any, schedule: BusSchedule, description: Board) -> None:
    scheduler = board.scheduler
    if scheduler.slot_count:
        raise UserError(f"{board.name}: a bus schedule is given before the first slot")
    rows = thinned_rows(description, scheduler.schedule.rows, schedule)
    if len(rows) == len(scheduler.schedule.rows):
        return
    scheduler.schedule.rows = rows
    scheduler.layout()
    scheduler.row = scheduler.row_count - 1  # the first tick starts row 0


def _apply_to_main_brain(board: Any, schedules: Mapping[str, BusSchedule], table: Table) -> None:
    sorted_out = sort_commands(table, schedules)
    turns = {variable.id: n for variable, n in sorted_out.regular}
    in_turn = [variable.id for variable in sorted_out.in_turn]
    if in_turn or any(n != 1 for n in turns.values()):
        at_once = [number for number in board.io.send_ids if number not in in_turn]
        board.io.thin(at_once, [turns.get(number, 1) for number in at_once], in_turn, sorted_out.turn_every)


# ---- as the analysis sees it


def _stream(board: str, title: str, variables: list[Variable], period_ms: Fraction, **more: Any) -> Stream:
    """A stream of one or several variables in turn."""
    numbers = sorted(variable.id for variable in variables)
    one = message(title, numbers[0], int(period_ms * 1_000_000), **more)
    if len(numbers) > 1:
        one = dataclasses.replace(one, last_key=arbitration_key(numbers[-1], 8))
    return Stream(one, tuple(variable.name for variable in variables), board)


def streams(table: Table, bus: str, schedules: Mapping[str, BusSchedule], absent: tuple[str, ...] = ()) -> list[Stream]:
    """All traffic on `bus` (can1 ... can4), by schedule; without that of `absent` boards.

    Satellites: a row's variables once per pass or every n-th, anywhere in their slots; the occasional list as one
    stream. Router: TIMESTAMP, and the main brain's commands. Those that the schedule names come in every n-th of its
    slots; the others one per `commands_in_turn` slots where that is set, otherwise as described at ON_DEMAND_MS.
    """
    schedule = schedules[bus]
    found: list[Stream] = []
    sync = table.variable(SYNC)
    router = table.with_role("router")[0]
    main_brain = table.with_role("main brain")[0]
    if router.name not in absent and bus.upper() in sync.buses and sync.period_ms is not None:
        found.append(_stream(router.name, SYNC, [sync], sync.period_ms, jitter_ns=SYNC_JITTER_NS))
    for board in table.with_role("satellite"):
        if board.firmware and bus.upper() in board.buses and board.name not in absent:
            found += _satellite_streams(table, board, schedule)
    if router.name not in absent and main_brain.name not in absent:
        found += _command_streams(table, bus, schedules, router.name, Fraction(main_brain.slot_us, 1000))
    return found


def _satellite_streams(table: Table, board: Board, schedule: BusSchedule) -> list[Stream]:
    """Each slot sends the variables of its row, so the frames of a board come one after the other: a train."""
    slot_ns = board.slot_us * 1000
    pass_ms = Fraction(board.slot_us * len(board.rows), 1000)
    common = {"jitter_ns": slot_ns, "queue": board.name}  # anywhere in its slot
    found = []
    for row, names in enumerate(board.rows):
        for name in names:
            if not name.startswith("("):
                period = pass_ms * schedule.turns(name)
                found.append(
                    _stream(board.name, name, [table.variable(name)], period, offset_ns=row * slot_ns, **common)
                )
    listed = [table.variable(name) for name in dict.fromkeys(board.occasional) if not name.startswith("(")]
    if listed and board.occasional_row is not None:
        n, row = schedule.occasional.get(board.name, 1), board.occasional_row
        period = pass_ms * n
        deadline = int(period * (len(board.occasional) + 1) * 1_000_000)  # each entry's own period
        title = f"(occasional list of {board.name})"
        offset = (row % n * len(board.rows) + row) * slot_ns
        found.append(_stream(board.name, title, listed, period, deadline_ns=deadline, offset_ns=offset, **common))
    return found


def _command_streams(
    table: Table, bus: str, schedules: Mapping[str, BusSchedule], router: str, slot_ms: Fraction
) -> list[Stream]:
    """What the main brain sends to one bus: a slot's frames leave together, in the order of identifiers."""
    commands = sort_commands(table, schedules)

    def here(variables: Sequence[Variable]) -> list[Variable]:
        return [variable for variable in variables if bus.upper() in variable.buses]

    def common(variable: Variable, beside: Sequence[Variable], offset: int) -> dict[str, Any]:
        """Frames of lower numbers leave before it: the regular ones, and others of its slot."""
        before = sum(1 for one, _ in commands.regular if one.id < variable.id)
        before += sum(1 for one in beside if one.id < variable.id)
        jitter = EXCHANGE_NS * (1 + before // FRAMES_PER_EXCHANGE) + COMMAND_VARIATION_NS
        return {"queue": router, "jitter_ns": jitter, "offset_ns": int(slot_ms * offset * 1_000_000)}

    found = []
    for variable, n in commands.regular:
        if here([variable]):
            found.append(_stream("MB", variable.name, [variable], slot_ms * n, **common(variable, (), 0)))
    if in_turn := here(commands.in_turn):
        every = commands.turn_every
        found.append(_stream("MB", OTHER, in_turn, slot_ms * every, **common(in_turn[-1], (), every - 1)))
    steered = {one.subscribers for one, _ in commands.regular}
    if of_steered := [one for one in here(commands.at_once) if one.subscribers in steered]:
        found.append(_stream("MB", OTHER, of_steered, slot_ms, **common(of_steered[-1], (), 0)))
    for one in here(commands.at_once):
        if one.subscribers not in steered:
            beside = [other for other in here(commands.at_once) if other.subscribers == one.subscribers]
            found.append(_stream("MB", one.name, [one], ON_DEMAND_MS, **common(one, beside, 1)))
    return found


@dataclasses.dataclass(frozen=True)
class BusBounds:
    """The analysis of one bus: streams with their bounds in the same order, and the most frames waiting by queue."""

    bus: str
    bit_rate: int
    streams: tuple[Stream, ...]
    bounds: tuple[Bound, ...]
    waiting: Mapping[str, int | None]

    @property
    def met(self) -> bool:
        """True when every stream meets its deadline."""
        return all(bound.met for bound in self.bounds)


def bounds_of(table: Table, bus: str, bit_rate: int, found: list[Stream]) -> BusBounds:
    """Bounds of the streams of one bus.

    A satellite moves waiting frames into its two hardware buffers once per slot (boards/modules/can_link.py). When more
    than two frames wait, both buffers may be empty before that: for each two frames beyond them the queue stops for up
    to a slot. The number that can wait follows from the bounds, so this is repeated until it no longer grows (or until
    the queue is late beyond every deadline).
    """
    satellites = {board.name: board.slot_us * 1000 for board in table.with_role("satellite")}
    pauses = dict.fromkeys(satellites, 0)
    while True:
        messages = [dataclasses.replace(one.message, pause_ns=pauses.get(one.message.queue, 0)) for one in found]
        bounds = response_times(messages, bit_rate, CRYSTAL_PPM)
        queues = dict.fromkeys(one.queue for one in messages if one.queue)
        waiting = {queue: most_waiting(bounds, queue, bit_rate, CRYSTAL_PPM) for queue in queues}
        before = dict(pauses)
        for queue, most in waiting.items():
            if queue in satellites and most is not None:
                pause = -(-(most - HARDWARE_BUFFERS) // 2) * satellites[queue]
                if pauses[queue] <= max(one.deadline_ns for one in messages):
                    pauses[queue] = max(pauses[queue], pause)
        if pauses == before:
            return BusBounds(bus, bit_rate, tuple(found), tuple(bounds), waiting)
