"""Check before a run whether a board's slots can hold its table, its interrupts, and its bus at their worst.

Every row has three sums, in cycles: of the costs (without work), of the worst case at the rates stated
below, and of the limits (which no call may exceed, all of them at once). The second also includes what interrupts can
take in one slot at those rates. Then:

    fits         worst and interrupts are within the slot
    may overrun  they are not: a slot that has all of it at once is not finished at the next tick

Both are upper bounds of one slot. They add what hardly coincides (every encoder at full speed, ten new errors, every
frame of a busy bus): `may overrun` means that it is possible, not that it happens, and `ranger-sim slots` puts
measurements next to it.

The most in one slot:
- Edges: an encoder at the speed of its motor without load, RATED_SPEED_RPM; both edges of channel A.
- Frames: every stream of the bus (harness/outside/bus_schedule.py) as often as its period and its proven response time
  allow in a slot, and never more than the wire can carry; `full_bus`: always as many as the wire can carry.
- A function whose work is counted in edges or frames costs that many items; every other one may use its limit.
- A wait ends with its conversions: its limit counts from the function that starts them, CONVERSION_STARTS.
- Interrupts: each source as often as RATES has it. Bus errors come with a fault and are not counted.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Mapping
from typing import Any

from ranger_sim.boards import user_interface
from ranger_sim.boards.modules.ssp_link import SEGMENT_HALF_WORDS
from ranger_sim.can_bus.frame import INTERMISSION_BITS
from ranger_sim.firmware_sim.legend import Legend, TaskLegend
from ranger_sim.firmware_sim.vic import (
    ADC_DONE,
    DMA_DONE,
    EXTERNAL_INTERRUPT,
    SLOT_TIMER,
    SOFTWARE,
    SPI_DONE,
    TIMER_MATCH,
)
from ranger_sim.foundation.events import CAN_RX, PIN_EDGE, SSP_SEGMENT, UART_BYTE
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.outside import bus_schedule, profile
from ranger_sim.ranger import wiring

RATED_SPEED_RPM = 6300  # of a motor without load at 12 V (robot.md B2)
MOTOR_GEAR = {"MCH": 66.0, "MCFO": 34.0, "MCFI": 34.0}  # robot.md B2: from motor to joint
SHORTEST_FRAME_BITS = 108 + INTERMISSION_BITS  # eight bytes of data and not one stuff bit
CONVERSION_STARTS = "adcx_convert_all"
RECEIVES = ("can_rx_dispatch_all", "receive_all")  # names of the function that hands out received frames
EXCHANGE_NS = bus_schedule.EXCHANGE_NS  # of the serial link between router and main brain
CAPTURE_WRAP_NS = 500_000  # of the encoders' timer (boards/modules/encoder_capture.py)
IMU_BAUD = 460_526  # robot.md N4.10
IMU_BITS_PER_BYTE = 10
IMU_FIFO = 8  # bytes per interrupt request of the UART
RC_EDGES = 6  # in 1 ms: pulses are 1 to 2 ms long, so of each of three channels at most one edge of either kind
COMPUTER_SEGMENT_NS = 92 * 10 * 1_000_000 // 929  # 92 bytes at 928,571 baud (firmware_sim/peripherals/uart_hs.py)


@dataclasses.dataclass(frozen=True)
class FunctionBound:
    """A line of the table, in cycles. `items`: the most that one call can handle; `worst`: its cost then."""

    number: int
    name: str
    place: str  # "every slot", "row 2", "occasional, row 3", "end of every slot"
    cost: int
    per_item: int
    item: str
    limit: int
    items: int | None
    worst: int


@dataclasses.dataclass(frozen=True)
class InterruptBound:
    """A source in one slot: how often at most, cycles of one service and of all."""

    name: str
    times: int
    cycles: int
    worst: int
    why: str


@dataclasses.dataclass(frozen=True)
class RowBound:
    """A row: sums in cycles, and whether it fits its slot. `margin`: share of the slot that is left at the worst."""

    row: int
    functions: tuple[str, ...]
    cost: int
    worst: int
    limits: int
    interrupts: int
    slot: int
    margin: float
    verdict: str


@dataclasses.dataclass(frozen=True)
class BoardBound:
    """All bounds of a board; `frames`: that can arrive in one slot, by bus; `edges`: by encoder interrupt."""

    board: str
    hz: int
    slot_ns: int
    slot_cycles: int
    frames: Mapping[str, int]
    edges: Mapping[str, int]
    functions: tuple[FunctionBound, ...]
    interrupts: tuple[InterruptBound, ...]
    rows: tuple[RowBound, ...]

    @property
    def fits(self) -> bool:
        """True when every row does."""
        return all(row.verdict == FITS for row in self.rows)


FITS, OVERRUNS = "fits", "may overrun"


def check(board: Any, edges_per_s: float | None = None, full_bus: bool = False) -> BoardBound:
    """Bounds of an emulated board in its present state. `edges_per_s`: of every encoder, not its motor's top speed."""
    if edges_per_s is not None and not (math.isfinite(edges_per_s) and edges_per_s >= 0.0):
        raise UserError(f"{board.name}: {edges_per_s!r} edges per second: a number of 0 or more is needed")
    legend: Legend = board.legend()
    edges = edges_of(board, legend.slot_ns, edges_per_s)
    frames = frames_of(board.name, legend.slot_ns, full_bus)
    interrupts = tuple(interrupts_of(board, legend.slot_ns, edges, frames))
    stolen = sum(each.worst for each in interrupts)
    bounds = [function_bound(number, task, board, legend, edges, frames) for number, task in enumerate(legend.tasks)]
    rows = []
    for row, numbers in enumerate(legend.rows):
        worst = row_sum(legend, numbers, [each.worst for each in bounds])
        margin = 1.0 - (worst + stolen) / legend.slot_cycles
        rows.append(
            RowBound(
                row=row,
                functions=tuple(legend.tasks[number].name for number in numbers),
                cost=row_sum(legend, numbers, [task.cost for task in legend.tasks]),
                worst=worst,
                limits=row_sum(legend, numbers, [task.limit or task.cost for task in legend.tasks]),
                interrupts=stolen,
                slot=legend.slot_cycles,
                margin=margin,
                verdict=FITS if margin >= 0.0 else OVERRUNS,
            )
        )
    return BoardBound(
        board=board.name,
        hz=legend.hz,
        slot_ns=legend.slot_ns,
        slot_cycles=legend.slot_cycles,
        frames=frames,
        edges=edges,
        functions=tuple(bounds[number] for number in in_order(legend)),
        interrupts=interrupts,
        rows=tuple(rows),
    )


def row_sum(legend: Legend, numbers: tuple[int, ...], cycles: list[int]) -> int:
    """Cycles of a row whose tasks take `cycles` (by number): of a list one entry; a wait ends with what it awaits."""
    total = 0
    started = 0
    for number in numbers:
        task = legend.tasks[number]
        if task.spins:
            total = max(total + task.cost, started + cycles[number])
            continue
        total += cycles[number]
        if task.entries:
            total += max(cycles[entry] for entry in task.entries)
        if task.name == CONVERSION_STARTS:
            started = total
    return total


def in_order(legend: Legend) -> list[int]:
    """Task numbers as in the firmware's table: every slot's, the rows' with the occasional entries, the last."""
    rows = legend.rows
    common = 0
    while all(len(row) > common and row[common] == rows[0][common] for row in rows):
        common += 1
    closing = 0
    while all(len(row) > common + closing and row[-1 - closing] == rows[0][-1 - closing] for row in rows):
        closing += 1
    found = list(rows[0][:common])
    for row in rows:
        for number in row[common : len(row) - closing]:
            found += [number, *legend.tasks[number].entries]
    return list(dict.fromkeys(found + list(rows[0][len(rows[0]) - closing :])))


def place_of(legend: Legend, number: int) -> str:
    """A task's place in the table."""
    inside = [row for row, numbers in enumerate(legend.rows) if number in numbers]
    lists = [task for task in range(len(legend.tasks)) if number in legend.tasks[task].entries]
    if lists:
        return f"{place_of(legend, lists[0])}, in turn"
    if len(inside) == len(legend.rows) > 1:
        return "every slot"
    return "row " + ", ".join(str(row) for row in inside)


def function_bound(
    number: int, task: TaskLegend, board: Any, legend: Legend, edges: Mapping[str, int], frames: Mapping[str, int]
) -> FunctionBound:
    """The most that one call can cost."""
    items: int | None = None
    extra = 0
    if task.item == "edge":
        items = next((count for name, count in edges.items() if f"cap{name[-1]}" in task.name), None)
    elif task.item == "frame" and task.name in RECEIVES:
        items = sum(frames.values())
        listened = [each.cycles for each in board.can.receivers if each is not None]
        extra = max([board.can.search_cycles, *listened])
    worst = task.limit if items is None else task.cost + items * (task.per_item + extra)
    if task.limit:
        worst = min(worst, task.limit)
    return FunctionBound(
        number=number,
        name=task.name,
        place=place_of(legend, number),
        cost=task.cost,
        per_item=task.per_item,
        item=task.item,
        limit=task.limit,
        items=items,
        worst=max(worst, task.cost),
    )


def edges_of(board: Any, slot_ns: int, edges_per_s: float | None = None) -> dict[str, int]:
    """The most edges in one slot, by the encoder's interrupt."""
    found = {}
    for channel, capture in ((0, "cap01"), (2, "cap23")):
        decoder = getattr(board, capture, None)
        if decoder is None or board.name not in MOTOR_GEAR:
            continue
        turns_per_s = RATED_SPEED_RPM / 60.0
        pulses, on_motor = encoder_of(board, capture)
        rate = 2.0 * pulses * turns_per_s / (1.0 if on_motor else MOTOR_GEAR[board.name])
        rate = rate if edges_per_s is None else edges_per_s
        found[f"encoder_edge_{channel}"] = math.floor(rate * slot_ns * 1e-9) + (1 if rate > 0.0 else 0)
    return found


def encoder_of(board: Any, capture: str) -> tuple[int, bool]:
    """(pulses of a turn of its shaft, whether it sits on the motor's shaft) of an encoder, from its board's package."""
    from ranger_sim.boards import hip, inner_feet, outer_feet

    room = {"MCH": hip, "MCFO": outer_feet, "MCFI": inner_feet}[board.name]
    on_motor = getattr(board, capture) is board.motor
    return (room.MOTOR_ENCODER if on_motor else room.JOINT_ENCODER)[0], on_motor


@functools.cache
def bounds_of_bus(bus: str) -> bus_schedule.BusBounds:
    """The proven response times of the robot's own traffic on a bus."""
    table = bus_schedule.robots_table()
    own = profile.default()
    streams = bus_schedule.streams(table, bus, own.schedules())
    return bus_schedule.bounds_of(table, bus, own.buses[bus].bit_rate, streams)


def frames_of(board: str, slot_ns: int, full_bus: bool = False) -> dict[str, int]:
    """Frames of others that can arrive in one slot, by bus."""
    found = {}
    for wire in wiring.CAN:
        if wire.board != board:
            continue
        bus = f"can{wire.bus}"
        bounds = bounds_of_bus(bus)
        frame_ns = SHORTEST_FRAME_BITS * 1e9 / bounds.bit_rate
        most = math.floor(slot_ns / frame_ns) + 1
        if not full_bus:
            by_schedule = 0
            for stream, bound in zip(bounds.streams, bounds.bounds, strict=True):
                if stream.message.queue == board or stream.board == board:
                    continue
                if bound.response_ns is None:
                    by_schedule = most
                    break
                by_schedule += math.ceil((slot_ns + bound.response_ns) / stream.message.period_ns)
            most = min(most, by_schedule)
        found[bus] = most
    return found


def periods(slot_ns: int, period_ns: int) -> int:
    """The most services in a slot of an event every `period_ns`: one may have been pending at its start."""
    return slot_ns // period_ns + 1


def interrupts_of(
    board: Any, slot_ns: int, edges: Mapping[str, int], frames: Mapping[str, int]
) -> list[InterruptBound]:
    """Every source that is in use, with its most occurrences in one slot."""
    found = []
    for source in board.vic.sources.values():
        if not source.attached:
            continue
        times, items, extra, why = services(board, source, slot_ns, edges, frames)
        cycles = source.base_cycles + source.per_item * items + extra
        found.append(InterruptBound(source.name, times, cycles, times * cycles, why))
    return found


def services(
    board: Any, source: Any, slot_ns: int, edges: Mapping[str, int], frames: Mapping[str, int]
) -> tuple[int, int, int, str]:
    """(services in a slot, items of each, further cycles, why) of a source."""
    kind = source.kind
    if kind == SLOT_TIMER:
        extra = user_interface.LCD_BYTE_CYCLES if board.name == "UI" else 0
        return board.scheduler.divider, 0, extra, "the timer's ticks"
    if kind == PIN_EDGE:
        return edges.get(source.name, 0), 0, 0, "edges at the motor's top speed"
    if kind == CAN_RX:
        bus = [f"can{wire.bus}" for wire in wiring.CAN if wire.board == board.name and wire.controller == source.index]
        return sum(frames[name] for name in bus), 0, 0, "frames of others"
    if kind == EXTERNAL_INTERRUPT:
        return board.adc_external.length, 0, 0, "conversions of the sequence"
    if kind in (ADC_DONE, SPI_DONE):
        return 1, 0, 0, "started once a slot"
    if kind == UART_BYTE:
        bytes_ = math.ceil(slot_ns * 1e-9 * IMU_BAUD / IMU_BITS_PER_BYTE)
        return math.ceil(bytes_ / IMU_FIFO), IMU_FIFO, 0, f"{bytes_} bytes in a row"
    if kind == SSP_SEGMENT:
        items = SEGMENT_HALF_WORDS if source.per_item else 0
        return periods(slot_ns, EXCHANGE_NS), items, 0, "an exchange of the link each 200 us"
    if kind == TIMER_MATCH and board.name == "CSR":
        return periods(slot_ns, EXCHANGE_NS), 0, board.sync_cycles, "an exchange of the link each 200 us"
    if kind == TIMER_MATCH and board.name == "UI":
        return RC_EDGES, 0, 0, "edges of three radio channels"
    if kind == TIMER_MATCH:
        return periods(slot_ns, CAPTURE_WRAP_NS), 0, 0, "the capture timer's wraps"
    if kind in (DMA_DONE, SOFTWARE):
        return periods(slot_ns, COMPUTER_SEGMENT_NS), 0, 0, "segments to the computer"
    return 0, 0, 0, "only with errors of the bus"
