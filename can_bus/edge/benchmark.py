"""The same work on our bus and on python-can's `virtual` interface: frames/s of processor time."""

import can

from can_bus.benchmark import million_frames
from foundation import wallclock


def virtual_frames(frames: int = 20_000, nodes: int = 3) -> dict:
    """`frames` through python-can's `virtual` interface: each is received by the `nodes` - 1 others.

    One thread; the nodes send in turn and everybody empties its queue after each round, so that no queue
    grows. There is no arbitration and no timing in it. Figures: frames, delivered, lost, cpu_s, frames_per_s.
    """
    buses = [can.Bus(interface="virtual", channel="ranger-sim-benchmark") for _ in range(nodes)]
    try:
        delivered = 0
        start = wallclock.process_cpu_s()
        for number in range(0, frames, nodes):
            for node in range(min(nodes, frames - number)):
                data = (number + node).to_bytes(8, "little")
                buses[node].send(can.Message(arbitration_id=16 * node + 1, data=data, is_extended_id=False))
            for bus in buses:
                while bus.recv(0) is not None:
                    delivered += 1
        cpu_s = max(wallclock.process_cpu_s() - start, 1e-9)
    finally:
        for bus in buses:
            bus.shutdown()
    return {
        "frames": frames,
        "delivered": delivered,
        "lost": frames * (nodes - 1) - delivered,
        "cpu_s": cpu_s,
        "frames_per_s": frames / cpu_s,
    }


def against_virtual(frames: int = 200_000, virtual: int = 20_000, nodes: int = 3) -> dict:
    """Both on the same work, one after the other: {"ours": ..., "python_can_virtual": ..., "ratio": ...}.

    `frames` and `virtual` are how many each gets; the ratio is of frames/s of processor time.
    """
    ours = million_frames(frames, 1.0, nodes)
    theirs = virtual_frames(virtual, nodes)
    return {
        "ours": ours,
        "python_can_virtual": theirs,
        "ratio": ours["frames_per_s"] / theirs["frames_per_s"],
    }
