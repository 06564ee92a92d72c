"""Benchmark our python-can interface against python-can's own interfaces that need no adapter.

`python -m ranger_sim.can_bus.edge.benchmark` is not for users: it runs the sender and the host of the two-process
measurement.
"""

import contextlib
import os
import subprocess
import sys
from typing import Any

import can

from ranger_sim.can_bus.edge.attach import AttachServer
from ranger_sim.can_bus.edge.host import BusHost
from ranger_sim.can_bus.edge.paced import PacedBus
from ranger_sim.foundation import wallclock

IDENTIFIERS = 16  # per sender
SPACING = 64  # between the first identifiers of two senders
SILENCE_S = 2.0  # after this long without a frame, the missing frames are lost
MULTICAST_GROUP = "239.74.163.2"  # python-can's default group for IPv4

# Options that open each interface, {options} with {channel}; ours at full speed, as the others have no bit timing.
OPENED: dict[str, dict[str, Any]] = {
    "ranger_sim": {"interface": "ranger_sim", "speed": "max", "private": True, "rx_queue_size": 10_000_000},
    "virtual": {"interface": "virtual"},
    "udp_multicast": {"interface": "udp_multicast", "port": 43113},
}


def opened(interface: str, channel: str) -> can.BusABC:
    """A bus of one of python-can's interfaces; ours is private and at full speed."""
    options = dict(OPENED[interface])
    options["channel"] = MULTICAST_GROUP if interface == "udp_multicast" else channel
    if interface == "udp_multicast":
        options["fd"] = False
    return can.Bus(ignore_config=True, **options)


class Tally:
    """Frames that one reader has received: their number, and how many arrived out of order within their identifier.

    Those of the reader itself (`own`) do not count: `udp_multicast` returns them unrequested.
    """

    def __init__(self, own: int = -1) -> None:
        self.own = own
        self.received = 0
        self.reordered = 0
        self.expected: dict[int, int] = {}

    def take(self, message: can.Message) -> None:
        """Count a frame; its data are the running number of its identifier."""
        if message.arbitration_id // SPACING == self.own:
            return
        number = int.from_bytes(message.data, "little")
        self.reordered += number < self.expected.get(message.arbitration_id, 0)
        self.expected[message.arbitration_id] = number + 1
        self.received += 1


def numbered(sender: int, number: int) -> can.Message:
    """Frame `number` of a sender: its identifiers in turn, each with a running number."""
    return can.Message(
        arbitration_id=SPACING * sender + number % IDENTIFIERS,
        data=(number // IDENTIFIERS).to_bytes(8, "little"),
        is_extended_id=False,
    )


def interface_frames(interface: str, frames: int, nodes: int = 3) -> dict:
    """`frames` through an interface in one thread: each is received by the `nodes` - 1 others.

    The nodes send in turn and each node empties its queue after each round, so that no queue grows. Figures:
    frames, delivered, lost, reordered (within an identifier, at any reader), cpu_s, wall_s, frames_per_s (of processor
    time).
    """
    channel = f"ranger-sim-benchmark-{os.getpid()}"
    tallies = [Tally(node) for node in range(nodes)]
    with contextlib.ExitStack() as stack:
        buses = [stack.enter_context(opened(interface, channel)) for _ in range(nodes)]
        start, wall = wallclock.process_cpu_s(), wallclock.monotonic_s()
        for number in range(0, frames, nodes):
            for node in range(min(nodes, frames - number)):
                buses[node].send(numbered(node, number // nodes))
            for bus, tally in zip(buses, tallies, strict=True):
                while (message := bus.recv(0)) is not None:
                    tally.take(message)
        cpu_s = max(wallclock.process_cpu_s() - start, 1e-9)
        wall_s = wallclock.monotonic_s() - wall
        for bus, tally in zip(buses, tallies, strict=True):  # frames still in transit
            while tally.received < frames - frames // nodes and (message := bus.recv(0.05)) is not None:
                tally.take(message)
    delivered = sum(tally.received for tally in tallies)
    return {
        "frames": frames,
        "delivered": delivered,
        "lost": frames * (nodes - 1) - delivered,
        "reordered": sum(tally.reordered for tally in tallies),
        "cpu_s": cpu_s,
        "wall_s": wall_s,
        "frames_per_s": frames / cpu_s,
    }


def two_processes(interface: str, frames: int) -> dict:
    """A burst of `frames` from one process to another, as fast as the interface takes them.

    `ranger_sim` goes through a third process, the host of the bus. Figures: frames, delivered, lost, reordered,
    wall_s (first to last frame received), frames_per_s (of wall-clock time: several processes share the work).
    """
    tally = Tally()
    first = last = 0.0
    with contextlib.ExitStack() as stack:
        name = f"benchmark-{os.getpid()}"
        if interface == "ranger_sim":
            stack.enter_context(_helper("host", name)).wait_for("hosting")
            bus = can.Bus(interface="ranger_sim", channel=f"{name}/can1", rx_queue_size=10_000_000, ignore_config=True)
        else:
            bus = opened(interface, name)
        stack.enter_context(bus)
        sender = stack.enter_context(_helper("send", interface, name, str(frames)))
        while tally.received < frames:
            message = bus.recv(SILENCE_S)
            if message is None:
                if sender.process.poll() is None:
                    continue
                break
            last = wallclock.monotonic_s()
            first = first or last
            tally.take(message)
    wall_s = max(last - first, 1e-9)
    return {
        "frames": frames,
        "delivered": tally.received,
        "lost": frames - tally.received,
        "reordered": tally.reordered,
        "wall_s": wall_s,
        "frames_per_s": tally.received / wall_s,
    }


class _helper:  # noqa: N801  (used like a function)
    """Another process of the measurement; it ends with the `with`."""

    def __init__(self, *arguments: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "ranger_sim.can_bus.edge.benchmark", *arguments], stdout=subprocess.PIPE, text=True
        )

    def __enter__(self) -> "_helper":
        return self

    def wait_for(self, word: str) -> None:
        """Wait until it reports that."""
        assert self.process.stdout is not None
        while word not in (line := self.process.stdout.readline()):
            if not line:
                raise RuntimeError("a process of the measurement has ended at once")

    def __exit__(self, *_: Any) -> None:
        self.process.terminate()
        self.process.wait()
        if self.process.stdout is not None:
            self.process.stdout.close()


def _main(arguments: list[str]) -> None:
    """host NAME: a bus at full speed until terminated. send INTERFACE NAME FRAMES: a burst."""
    if arguments[0] == "host":
        paced = PacedBus("can1", speed=0.0)
        host = BusHost([paced])
        host.serve(AttachServer(arguments[1], {"can1": paced.taps}, paced.epoch_ns))
        print("hosting", flush=True)
        while True:
            host.turn()
    interface, name, frames = arguments[1], arguments[2], int(arguments[3])
    with (
        can.Bus(interface="ranger_sim", channel=f"{name}/can1", ignore_config=True)
        if interface == "ranger_sim"
        else opened(interface, name)
    ) as bus:
        for number in range(frames):
            bus.send(numbered(0, number))


if __name__ == "__main__":
    _main(sys.argv[1:])
