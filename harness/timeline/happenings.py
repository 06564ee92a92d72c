"""Events at one moment: steps, a fall, the stamps of faults."""

from typing import Any

from ranger_sim.harness.timeline.model import Instant, Instants

STAMPS = ("armed", "activated", "acted", "ended", "cleared")


def happenings(robot: Any) -> list[Instants]:
    """Tracks of events without a length: the steps, and the faults, if any."""
    found = [Instants(("Steps",), steps(robot))]
    if robot.faults:
        found.append(Instants(("Faults",), faults(robot)))
    return found


def steps(robot: Any) -> list[Instant]:
    """The last heel strikes of the body, and its fall."""
    plant, record = robot.plant, robot.plant.record
    number, length, _, outer = plant.recent_steps()
    events = []
    time_ns = plant.strike_time_ns - robot.start_ns
    for row in range(len(number) - 1, -1, -1):
        events.append(
            Instant(
                time_ns,
                f"step {number[row]}",
                {"length_m": float(length[row]), "onto": "outer feet" if outer[row] else "inner feet"},
            )
        )
        time_ns -= record.strike_durations_ns[(number[row] - 1) % len(record.strike_durations_ns)]
    events.reverse()
    if plant.fell:
        events.append(Instant(robot.loop.time - robot.start_ns, f"fell: {plant.fall_cause}"))
    return events


def faults(robot: Any) -> list[Instant]:
    """Every stamp of every fault that occurred."""
    events = []
    for fault in robot.faults:
        text = fault.text()
        for stamp in STAMPS:
            time_ns = getattr(fault, f"{stamp}_ns", -1)
            if time_ns >= 0:
                events.append(Instant(time_ns - robot.start_ns, f"{stamp}: {text}"))
    return sorted(events, key=lambda event: event.time_ns)
