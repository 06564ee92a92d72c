"""`ranger-sim bench interfaces`: frames through our python-can interface and, on the same work, python-can's own."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable

# python-can's udp_multicast loses frames and is slower: a tenth of the work shows both
SHARE = {"ranger_sim": 1.0, "virtual": 1.0, "udp_multicast": 0.1}


def run(frames: int, report: Callable[[str], None]) -> list[dict]:
    """Send `frames` through each interface and report a line for each.

    In one thread three nodes receive each other's frames, and rates are per second of processor time. Between processes
    (where the interface supports it) rates are per second of the wall clock.
    """
    from ranger_sim.can_bus.edge import benchmark

    rows = []
    for way, measure, interfaces in (
        ("3 nodes in 1 thread", benchmark.interface_frames, ("ranger_sim", "virtual", "udp_multicast")),
        ("from process to process", benchmark.two_processes, ("ranger_sim", "udp_multicast")),
    ):
        for interface in interfaces:
            if interface == "udp_multicast" and importlib.util.find_spec("msgpack") is None:
                report("udp_multicast: left out, it needs the package msgpack")
                continue
            row = {"interface": interface, "way": way, **measure(interface, max(1, round(frames * SHARE[interface])))}
            rows.append(row)
            report(
                f"{interface}, {way}: {row['frames_per_s']:,.0f} frames/s; of {row['frames']:,} "
                f"{row['lost']:,} lost, {row['reordered']:,} reordered"
            )
    return rows
