"""The health of buses and boards of any machine: traffic of a bus, and whether a board still works."""

from collections.abc import Mapping
from typing import Any

from ranger_sim.firmware_sim.counters import BoardCounters


def can(machine: Any, bus: Any, counters: Mapping[str, BoardCounters]) -> dict:
    """Traffic of one bus; loads as fractions 0-1 with stuff bits and intermission.

    lost: frames accepted for sending that a receiving node did not get, on the wire or in its receive buffers.
    queue_full: frames that a full transmit ring of a board did not accept.
    """
    now = machine.loop.time
    wired = {(wire.board, wire.controller) for wire in machine.wiring.can if f"can{wire.bus}" == bus.name}
    ends = [each for name, board in counters.items() for each in board.can if (name, each.controller) in wired]
    return {
        "frames": bus.counters.frames,
        "load_mean": bus.load_mean(now),
        "load_max": bus.load.largest(),
        "lost": bus.counters.lost + sum(end.data_overruns + end.receive_lost for end in ends),
        "queue_full": sum(end.queue_full for end in ends),
        "single_shot_skipped": bus.counters.single_shot_skipped + sum(end.skipped for end in ends),
        "errors": bus.counters.errors,
    }


def alive(machine: Any, counters: BoardCounters) -> bool:
    """True when the board finished a slot's work lately: a program that hangs only has slots that begin."""
    silent_ns = machine.loop.time - counters.slots.finished_ns
    return machine.loop.time - machine.start_ns < 20_000_000 or silent_ns < 20 * counters.slots.slot_ns
