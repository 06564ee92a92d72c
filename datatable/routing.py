"""Reachability between boards, and the router's table: one destination mask per identifier (robot.md N1.5)."""

from __future__ import annotations

from ranger_sim.datatable.addresses import XCP_IDS
from ranger_sim.datatable.model import LARGEST_CAN_ID, MAIN_BRAIN, Board, Table

ENTRIES = LARGEST_CAN_ID + 1


def unreachable(publisher: Board, subscriber: Board, buses: tuple[str, ...], routed: bool) -> str | None:
    """Why a variable carried on `buses` does not reach `subscriber` from `publisher`; None when it does.

    With a router (`routed`) the computer is connected to the main brain's serial line, so both share everything. All
    other traffic uses the named buses: the router forwards a frame to every bus the variable is carried on. Without one
    every board receives the frames of the buses that it is connected to.
    """
    if not routed:
        common = set(publisher.buses) & set(subscriber.buses)
        if common & set(buses):
            return None
        shared = " and ".join(sorted(common)) or "no bus"
        return f"does not get from {publisher.name} to {subscriber.name}: they have {shared} in common"
    ends = (MAIN_BRAIN, "computer")
    if publisher.role in ends and subscriber.role in ends:
        return None
    if publisher.role in ends and "SSP" not in buses:
        return f"leaves {publisher.name} by SSP only, and SSP is not among its buses"
    if publisher.role not in ends and not set(publisher.buses) & set(buses):
        exits = " or ".join(publisher.buses) or "no bus"
        return f"leaves {publisher.name} by {exits} only, and that is not among its buses"
    entrances = ("SSP",) if subscriber.role in ends else subscriber.buses
    if not set(entrances) & set(buses):
        return f"routing cannot reach {subscriber.name}: it listens on {' and '.join(entrances) or 'no bus'}"
    return None


def destination_masks(table: Table) -> bytes:
    """Destination bits per identifier 0 ... 2031: bit 0 SSP, bits 1-4 CAN1-4.

    Every identifier goes to the main brain unless the table specifies otherwise. Variables that the main brain or the
    computer publishes for a satellite go to the named buses, and not back. Frames that the router itself sends
    (`sends_itself`) are on the buses already, so only the SSP copy is routed. Frames of XCP end where they are sent.
    """
    ssp = 1 << table.channels["SSP"]
    masks = bytearray([ssp]) * ENTRIES
    for identifier in XCP_IDS:  # ROBOT PARITY: its table does not contain XCP and would send these to the main brain
        masks[identifier] = 0
    for variable in table.variables:
        if variable.id >= ENTRIES:
            continue
        publisher = table.board(variable.publisher)
        buses = sum(1 << table.channels[bus] for bus in variable.buses if bus != "SSP")
        if publisher.role in ("main brain", "computer"):
            if buses:
                masks[variable.id] = buses
        elif variable.name not in publisher.sends_itself:
            own = 0 if publisher.role == "router" else sum(1 << table.channels[bus] for bus in publisher.buses)
            masks[variable.id] |= buses & ~own
    return bytes(masks)
