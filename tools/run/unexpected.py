"""Deviations from a healthy walk: one line for each, for the terminal and for the top of the report."""

from collections.abc import Iterator

from ranger_sim.harness import normal_errors
from ranger_sim.ranger.names import RANGER

HEALTHY = (
    "On its feet; no board dead, no frame lost or refused, no slot overrun, every strike noticed; a floor that only "
    "pushed; no error beyond those of a healthy walk."
)


def lines(summary: dict, floor_friction: float) -> list[str]:
    """All lines except how the walk ended, from its summary. floor_friction: the floor's, over the normal force."""
    return [
        *(f"{board}: the board failed" for board in summary["failed_boards"]),
        *floor(summary["oddities"], floor_friction),
        *boards(summary),
        *errors(summary["errors"], summary["time_s"]),
    ]


def ending(summary: dict) -> Iterator[str]:
    """How the walk ended, if it ended badly."""
    if summary["battery"]["empty"]:
        yield f"batteries: {summary['fall_cause']}"
    elif summary["fell"]:
        yield f"it fell: {summary['fall_cause']}"
    for fault in summary["faults"]:
        if not fault["acted"]:
            yield f"{fault['fault']}: the fault did not act"


def floor(seen: dict, floor_friction: float) -> Iterator[str]:
    """Behaviour of feet and floor that is impossible for a real floor, or that a walk should not need."""
    if seen["tensile_strikes"]:
        worst = seen["tensile_impulse_min_Ns"]
        yield f"{times(seen['tensile_strikes'], 'strike')} pulled at the floor, to {worst:.2f} N s"
    if seen["pull_s"]:
        yield f"the floor pulled at a foot for {seen['pull_s'] * 1e3:.0f} ms, to {seen['normal_force_min_N']:.1f} N"
    # If a contact limits friction, the worst ratio is the limit itself, except for rounding.
    ratio = seen["friction_ratio_max"]
    if ratio is not None and ratio > floor_friction * (1.0 + 1e-6):
        yield f"friction of {ratio:.2f} times the normal force; the floor gives {floor_friction:.2f}"
    for key, one in (
        ("flights", "time with no foot on the floor"),
        ("bounces", "bounce of a leading foot"),
        ("scuffs", "scuff of the swing foot"),
        ("recontacts", "touch out of turn"),
        ("jams", "slide stopped by an impulse"),
        ("lead_lifts", "time that the leading foot left the floor first"),
    ):
        if seen[key]:
            yield times(seen[key], one)


def boards(summary: dict) -> Iterator[str]:
    """Losses of buses, slots and the strike detector."""
    for bus, can in summary["can"].items():
        for key, one in (("lost", "frame lost"), ("queue_full", "frame refused by a full queue"), ("errors", "error")):
            if can[key]:
                yield f"{bus}: {times(can[key], one)}"
    for board, slots in summary["slots"].items():
        if slots["overruns"]:
            longest = slots["max_execution_us"]
            yield f"{board}: {times(slots['overruns'], 'slot overrun')}, the longest of {longest:.0f} µs"
    delay = summary["heel_strike_delay_ms"]
    if delay["missed"]:
        yield f"{times(delay['missed'], 'strike')} not noticed"
    if delay["unmatched"]:
        yield f"{times(delay['unmatched'], 'strike')} reported that did not happen"


def errors(counts: dict, time_s: float) -> Iterator[str]:
    """Errors that boards noted beyond those of a healthy walk of the same length."""
    for board, names in normal_errors.beyond(RANGER, counts, time_s).items():
        yield f"errors of {board}: " + ", ".join(f"{name} x {count}" for name, count in names.items())


def times(count: int, one: str) -> str:
    """`1 frame lost`, `2 frames lost`: `one` begins with the noun."""
    noun, _, rest = one.partition(" ")
    ending = "" if count == 1 else "es" if noun.endswith("ch") else "s"
    return f"{count} {noun}{ending}{' ' + rest if rest else ''}"
