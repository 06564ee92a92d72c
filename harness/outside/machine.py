"""A machine with a part outside: buses on interfaces of python-can, boards that are real or run elsewhere.

    servo = new()
    put_outside(servo, load(HERE / "control_outside.toml", table=load_table(TABLE)))
    servo.until("angle_rad > 1", within="5 s")

Boards that run here are in this process. Virtual time is released by the wall clock, at `speed`; while no caller passes
time it stops, and frames from outside wait in the interface.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any

from ranger_sim.firmware_sim.board import Board
from ranger_sim.foundation import descriptors, wallclock
from ranger_sim.foundation.events import NEVER
from ranger_sim.foundation.user_error import UserError, unknown

if TYPE_CHECKING:
    from ranger_sim.can_bus.edge.external_bus import ExternalBus

SLICE_NS = 500_000  # virtual time between two readings of the wall clock: one slot of a motor board, as in `up`
RESET = 1  # mode of a bus node


class Elsewhere(Board):
    """Substitute for board `built`, which is outside or absent: it does nothing."""

    def __init__(self, built: Any) -> None:
        Board.__init__(self, built.name)
        self.inbox = built.inbox
        self.memory = built.memory
        self.built = built

    def advance(self, until: int) -> int:
        """Do nothing; inputs are lost."""
        self.inbox.clear()
        self.next_time = NEVER
        return NEVER

    def connect_edges(self, buffer: Any, pin: int, partner_pin: int) -> None:
        """Discard edges at its pins."""

    def counters(self) -> Any:
        """Return empty counters."""
        return self.built.counters()


def leave_out(machine: Any, name: str) -> None:
    """Take board `name` out: it does not run here, and is not on an emulated bus."""
    machine.loop.replace(Elsewhere(machine.boards[name]))
    wires = machine.loop.wires[machine.loop.place(name)]
    for bus, node in zip(wires.buses, wires.nodes, strict=True):
        if bus is not None:
            bus.set_mode(node, RESET, machine.loop.time)


class Pace:
    """Slows a machine's time down to the wall clock's; `speed`: virtual seconds per second."""

    def __init__(self, machine: Any, speed: float) -> None:
        if not 1e-4 <= speed <= 1000.0:
            raise UserError(f"speed is {speed!r}, allowed are 0.0001 to 1000")
        self.machine = machine
        self.speed = speed
        self.begun_ns = 0
        self.begun_s = 0.0

    def begin(self, now_ns: int) -> None:
        """Start passing time."""
        self.begun_ns, self.begun_s = now_ns, wallclock.monotonic_s()

    def release(self, now_ns: int) -> int:
        """Wait until the wall clock reaches `now_ns`; returns the time up to which the machine may then run.

        Input from outside meanwhile is read at once.
        """
        due_s = self.begun_s + (now_ns - self.begun_ns) * 1e-9 / self.speed
        while (left := due_s - wallclock.monotonic_s()) > 0.0:
            numbers = [number for end in self.machine.polled for number in end.filenos()]  # a poll may close some
            if descriptors.wait(numbers, [], min(left, SLICE_NS * 1e-9))[0]:
                self.machine.poll_now()
        return now_ns + SLICE_NS


def put_outside(machine: Any, profile: Any, speed: float = 1.0) -> None:
    """Apply a profile (profile.py) to a new machine: its buses on interfaces, its boards elsewhere.

    UserError when an interface cannot be opened.
    """
    buses = {name: keywords for name, bus in profile.buses.items() if (keywords := bus.python_can()) is not None}
    move_outside(machine, buses, profile.emulated(), speed)


def move_outside(
    machine: Any, buses: Mapping[str, Mapping[str, Any]], here: Collection[str], speed: float
) -> list[ExternalBus]:
    """Put buses on interfaces, {bus: keywords of python-can}; the boards `here` stay, the others are elsewhere."""
    from ranger_sim.can_bus.edge.external_bus import ExternalBus, opener  # python-can: only where it is used
    from ranger_sim.harness.processes.outside import move_bus

    machine.pace = Pace(machine, speed)
    rates = {bus.name: (bus.bitrate, bus.data_bitrate if bus.is_fd else 0) for bus in machine.buses}
    for name in machine.boards:
        if name not in here:
            leave_out(machine, name)
    moved = []
    for name, keywords in buses.items():
        rate, data_rate = rates[name]
        wanted = {**keywords, "fd": True} if data_rate else dict(keywords)
        moved.append(ExternalBus(name, rate, opener(name, wanted), data_rate))
    for each in moved:
        move_bus(machine, each, {}, tuple(here))
    return moved


def offer(machine: Any, name: str, speed: float = 1.0) -> str:
    """Let other processes attach to the machine's emulated buses under `name`, at the wall clock's pace times `speed`.

    Returns the channels, for can.Bus(interface="ranger_sim", channel=...). UserError when the name is taken.
    """
    from ranger_sim.can_bus.edge.attach import AttachServer

    server = AttachServer(name, {bus.name: bus for bus in machine.buses})
    machine.attach(server)
    machine.pace = Pace(machine, speed)
    return ", ".join(f"{name}/{bus.name}" for bus in machine.buses)


def put_on(machine: Any, bus: str, where: str, speed: float = 1.0) -> str:
    """Put a bus on an interface of python-can, "socketcan:vcan0"; every board stays here. Returns `where`.

    UserError for a bus that the machine does not have, and when the interface cannot be opened.
    """
    known = [each.name for each in machine.buses]
    if bus not in known:
        raise UserError(unknown("bus", bus, known))
    interface, _, channel = where.partition(":")
    move_outside(machine, {bus: {"interface": interface, "channel": channel}}, tuple(machine.boards), speed)
    return where
