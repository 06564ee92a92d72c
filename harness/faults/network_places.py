"""The places of faults that follow from a machine's wiring: its CAN controllers, and its buses."""

from collections.abc import Iterable

from ranger_sim.harness.faults.fault import Place
from ranger_sim.harness.faults.kinds import BUS, CONTROLLER
from ranger_sim.harness.wiring.wires import CanWire


def controllers(wires: Iterable[CanWire]) -> list[Place]:
    """Each board's controller on each of its buses."""
    return [
        Place(
            f"{each.board}.can{each.bus}",
            CONTROLLER,
            f"the controller and transceiver of {each.board} on can{each.bus}",
            {"board": each.board, "bus": each.bus},
        )
        for each in wires
    ]


def buses(count: int) -> list[Place]:
    """The buses of a machine that has `count` buses."""
    return [
        Place(f"can{number}", BUS, f"the wire of CAN bus {number}", {"bus": number}) for number in range(1, count + 1)
    ]
