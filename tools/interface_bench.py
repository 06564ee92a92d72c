"""`ranger-sim bench --interfaces`: frames through our python-can interface and, on the same work, python-can's own."""

import importlib.util
from typing import Any

from rich.console import Console
from rich.table import Table

# python-can's udp_multicast loses frames and is slower: a tenth of the work shows both
SHARE = {"ranger_sim": 1.0, "virtual": 1.0, "udp_multicast": 0.1}


def compare(frames: int, console: Console) -> list[dict[str, Any]]:
    """`frames` through each interface, in one thread and (where it can) from one process to another."""
    from ranger_sim.can_bus.edge import benchmark

    rows = []
    for way, measure, interfaces in (
        ("1 thread", benchmark.interface_frames, ("ranger_sim", "virtual", "udp_multicast")),
        ("2 processes", benchmark.two_processes, ("ranger_sim", "udp_multicast")),
    ):
        for interface in interfaces:
            if interface == "udp_multicast" and importlib.util.find_spec("msgpack") is None:
                console.print("udp_multicast: left out, it needs the package msgpack")
                continue
            count = max(1, round(frames * SHARE[interface]))
            with console.status(f"{interface}, {way}: {count} frames ..."):
                rows.append({"interface": interface, "way": way, **measure(interface, count)})
    return rows


def table_of(rows: list[dict[str, Any]]) -> Table:
    """The figures for people. Rates of one thread are per second of processor time, of processes per second."""
    table = Table(title="frames through python-can interfaces (1 thread: 3 nodes, each hears the others)")
    for column in ("interface", "way", "frames", "lost", "reordered", "frames/s"):
        table.add_column(column, justify="left" if column in ("interface", "way") else "right", no_wrap=True)
    for row in rows:
        counts = (f"{row[key]:,}" for key in ("frames", "lost", "reordered"))
        table.add_row(row["interface"], row["way"], *counts, f"{row['frames_per_s']:,.0f}")
    return table
