"""Random CAN FD frames and scenarios, by us and by the oracles of ISO 11898-1:2015.

`python -m tests.can_bus.fd_comparison SCENARIOS FRAMES` from the repository's root compares so many of both and prints
how many differ.
"""

import collections
import dataclasses
import sys

from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.fd_frame import LENGTHS, PHASE_MASK, PHASE_SHIFT, fd_wire, length_code, phases
from ranger_sim.can_bus.frame import HIGHEST_EXTENDED, HIGHEST_STANDARD
from ranger_sim.can_bus.node import OPERATING, RESET
from ranger_sim.foundation.events import (
    CAN_RX,
    CAN_STATUS,
    CAN_TX_DONE,
    FLAG_BRS,
    FLAG_ESI,
    FLAG_EXTENDED,
    FLAG_FD,
    FLAG_REMOTE,
    FLAG_SINGLE_SHOT,
    ORDER_BUS,
    TX_SENT,
    EventQueue,
)

from . import fd_bus_oracle
from . import fd_oracle as oracle
from .oracle_comparison import Dice, Outcome, flags_of, moved, random_frame, words

BITRATE = 500_000
# data rates and what they make of a bus: ticks per second, ticks of a nominal and of a data bit, with sample points
RATES = {2_000_000: (40_000_000, (80, 64), (20, 16)), 5_000_000: (100_000_000, (200, 160), (20, 16))}
BITS = 3000  # nominal ones, of a scenario
RECOVERY_BITS = 3 * 128 * 11  # of one with a way back from bus-off on a busy bus
KINDS = (
    "clean", "equal", "passive", "errors", "equal-errors", "errors-passive", "noise", "off", "classic", "non-iso",
    "resets", "recovery",
)  # fmt: skip


def random_fd_frame(rng):
    """Any frame; half of them have long runs of equal bits."""
    extended = rng.chance(0.3)
    identifier = rng.number(0, HIGHEST_EXTENDED if extended else HIGHEST_STANDARD)
    if rng.chance(0.2):
        identifier = rng.choice((0, 0x7FF, identifier & ~0xFF, identifier | 0xFF))
    length = rng.choice(LENGTHS)
    values = (0, 255, 0x0F, 0xF8, 0x83) if rng.chance(0.5) else tuple(range(256))
    return oracle.FdFrame(
        identifier, bytes(rng.choice(values) for _ in range(length)), extended, rng.chance(0.7), rng.chance(0.2)
    )


def fd_flags_of(frame):
    """The flags of our frames."""
    flags = FLAG_FD | length_code(len(frame.data))
    flags |= FLAG_EXTENDED if frame.extended else 0
    flags |= FLAG_BRS if frame.brs else 0
    flags |= FLAG_SINGLE_SHOT if frame.single_shot else 0
    return flags | (FLAG_ESI if frame.esi else 0)


def oracle_phases(frame, iso):
    """(bits at the nominal rate, bits at the data rate) of the oracle's frame, counted as `fd_frame.phases` does."""
    text, brs, delimiter = oracle.transmitted(frame, iso)
    return (brs + 1 + 9, delimiter - brs) if frame.brs else (len(text), 0)


def difference(frame, iso):
    """What differs between ours and the oracle's coding of a frame: "" for nothing."""
    ours = frame.identifier, fd_flags_of(frame), frame.data, iso
    text = "".join(map(str, fd_wire(*ours)[0]))
    if text != oracle.transmitted(frame, iso)[0]:
        return "bits"
    if oracle.received(text, iso) != frame:
        return "what a receiver reads"
    packed = phases(*ours)
    return "" if (packed & PHASE_MASK, packed >> PHASE_SHIFT) == oracle_phases(frame, iso) else "phases"


def compare_fd_frames(count):
    """Frames of so many random ones that differ, each fifth of them non-ISO."""
    rng = Dice("FD frames")
    found = []
    for number in range(count):
        frame = random_fd_frame(rng)
        if difference(frame, number % 5 != 0):
            found.append(frame)
    return found


# ---- scenarios


@dataclasses.dataclass(frozen=True)
class Scenario:
    """`requests`: (time in ns, node, frame of either kind). `counters`: (transmit errors, receive errors) of each node
    at the start. `inverted`: times in ns from which every node samples inverted for a nominal bit. `classic`: nodes.
    `modes`: (time in ns, node, RESET or OPERATING), what programs ask for."""

    nodes: int
    data_bitrate: int
    requests: tuple
    counters: tuple
    inverted: tuple
    classic: tuple
    iso: bool
    bits: int = BITS
    modes: tuple = ()

    @property
    def end_ns(self):
        return self.bits * 10**9 // BITRATE


def random_scenario(rng, kind):
    """One of the KINDS."""
    count = rng.number(2, 4)
    bit_ns = 10**9 // BITRATE
    few = [rng.number(0, HIGHEST_STANDARD) for _ in range(2)] if "equal" in kind else []
    classic = tuple(node for node in range(count) if rng.chance(0.4)) if kind == "classic" else ()
    requests = []
    for node in range(count):
        for buffer in (1, 2, 3):
            if not rng.chance(0.5):
                continue
            time = rng.choice((1, 1, 1, rng.number(1, 400 * bit_ns)))
            frame = random_frame(rng, few, buffer)
            if node not in classic and rng.chance(0.7):
                fd = random_fd_frame(rng)
                identifier, extended = (frame.identifier, frame.extended) if few else (fd.identifier, fd.extended)
                frame = dataclasses.replace(
                    fd, identifier=identifier, extended=extended, buffer=buffer, single_shot=rng.chance(0.1)
                )
            requests.append((time, node, frame))
    requests.sort(key=lambda each: each[:2])
    counters = [(0, 0)] * count
    if "passive" in kind:
        counters = [
            (rng.choice((0, 100, 125, 128, 140, 200, 250)), rng.choice((0, 0, 120, 127, 130))) for _ in range(count)
        ]
    inverted = []
    last = 900 * bit_ns
    if "errors" in kind or kind in ("classic", "non-iso"):
        inverted = [rng.number(20 * bit_ns, last) for _ in range(rng.number(1, 4))]
    if kind == "noise":
        inverted = [rng.number(2 * bit_ns, BITS * bit_ns) for _ in range(rng.number(5, 150))]
    if kind == "off":
        counters = [(rng.choice((0, 240, 248, 250, 255)), rng.choice((0, 0, 127))) for _ in range(count)]
        inverted = [rng.number(2 * bit_ns, last) for _ in range(rng.number(2, 12))]
    modes = []
    bits = RECOVERY_BITS if kind == "recovery" else BITS
    if kind == "recovery":  # one node goes bus-off at its next error, and its program lets it return
        counters = [(250 if node == 0 else 0, 0) for node in range(count)]
        inverted = [rng.number(20 * bit_ns, last) for _ in range(rng.number(1, 3))]
        modes = [(rng.number(900, 1500) * bit_ns + rng.number(0, bit_ns), 0, OPERATING)]
    if kind == "resets":  # before the first frame: ours completes a plain one that is under way
        for node in range(count):
            if rng.chance(0.7):
                modes.append((0, node, RESET))
                modes.append((rng.number(2, 1500 * bit_ns), node, OPERATING))
    if modes:
        for _ in range(rng.number(5, 40)):
            node = rng.number(0, count - 1)
            frame = dataclasses.replace(random_fd_frame(rng), buffer=rng.number(1, 3))
            requests.append((rng.number(2, (bits - 400) * bit_ns), node, frame))
        requests.sort(key=lambda each: each[:2])
    return Scenario(
        count,
        rng.choice(tuple(RATES)),
        tuple(requests),
        tuple(counters),
        tuple(sorted(set(inverted))),
        classic,
        kind != "non-iso",
        bits,
        tuple(sorted(modes)),
    )


def scenario_of(kind, seed):
    """The random scenario of a kind that a seed gives."""
    return random_scenario(Dice(f"FD {kind} {seed}"), kind)


def run_on_our_bus(scenario, steps=None):
    """(bus, its nodes' inboxes, requests that were accepted) after a scenario; time passes in `steps` (ns), in turn."""
    bus = Bus("can", BITRATE, data_bitrate=scenario.data_bitrate, iso=scenario.iso)
    inboxes = [EventQueue(64) for _ in range(scenario.nodes)]
    for number, inbox in enumerate(inboxes):
        bus.add_node(f"n{number}", inbox, 1, ORDER_BUS + number)
        node = bus.nodes[number]
        node.transmit_errors, node.receive_errors = scenario.counters[number]
        node.passive, node.warning = max(scenario.counters[number]) >= 128, max(scenario.counters[number]) >= 96
        if number in scenario.classic:
            bus.set_classic(number)
    for time in scenario.inverted:
        bus.inject_error_at(time)
    accepted = []
    now = turn = 0

    def advance(until):
        nonlocal now, turn
        while steps and now + steps[turn % len(steps)] < until:
            now += steps[turn % len(steps)]
            turn += 1
            bus.advance(now)
        bus.advance(until)
        now = until

    for time, node, frame in sorted(scenario.modes + scenario.requests, key=lambda each: each[0]):
        advance(time)
        if isinstance(frame, int):
            bus.set_mode(node, frame, time)
            accepted.append((time, node, frame))
            continue
        if isinstance(frame, oracle.FdFrame):
            done = bus.request_fd(node, frame.buffer, time, frame.identifier, fd_flags_of(frame), frame.data)
        else:
            done = bus.request(node, frame.buffer, time, frame.identifier, flags_of(frame), *words(frame.data))
        if done:
            accepted.append((time, node, frame))
    advance(scenario.end_ns)
    return bus, inboxes, accepted


def on_our_bus(scenario, steps=None):
    """(Outcome, requests that were accepted), of `run_on_our_bus`; times in ns."""
    bus, inboxes, accepted = run_on_our_bus(scenario, steps)
    outcome = Outcome([], [], [])
    for node, inbox in zip(bus.nodes, inboxes, strict=True):
        seen, counters = [], [(-1, *scenario.counters[node.index])]
        while inbox.take():
            if inbox.time >= scenario.end_ns:
                continue
            if inbox.kind == CAN_RX:
                data = inbox.ref if inbox.c & FLAG_FD else (inbox.d | inbox.e << 32).to_bytes(8, "little")
                seen.append((inbox.time, "received", inbox.b, inbox.c, data))
            elif inbox.kind == CAN_TX_DONE and inbox.c == TX_SENT:
                seen.append((inbox.time, "sent"))
            elif inbox.kind == CAN_STATUS and inbox.e == 0:
                counters.append((inbox.time, inbox.c, inbox.d))
        outcome.seen.append(seen)
        outcome.counters.append(moved(counters))
    return outcome, accepted


def on_the_oracle(scenario, accepted):
    """Outcome of what our bus accepted."""
    rate, nominal, data = RATES[scenario.data_bitrate]
    step = 10**9 // rate
    nodes = [
        fd_bus_oracle.Node(f"n{number}", number not in scenario.classic, scenario.iso)
        for number in range(scenario.nodes)
    ]
    counters = {}
    for node, (transmit_errors, receive_errors) in zip(nodes, scenario.counters, strict=True):
        node.tec, node.rec = transmit_errors, receive_errors
        node.passive = max(transmit_errors, receive_errors) >= 128
        counters[node.name] = [(-1, transmit_errors, receive_errors)]
    wire = fd_bus_oracle.Bus(nodes, nominal, data)
    for time, number, frame in accepted:
        if frame == RESET:
            nodes[number].leave()
            nodes[number].next_start = None
        elif frame == OPERATING:
            wire.joining.append((time // step + 1, nodes[number]))
    requests = collections.deque(each for each in accepted if not isinstance(each[2], int))
    wire.windows = [(time // step, time // step + nominal[0]) for time in scenario.inverted]

    def note(node, end):
        if node.tec < 256 and end * step < scenario.end_ns:
            counters[node.name].append((end * step, node.tec, node.rec))

    def ask(tick):
        while requests and requests[0][0] // step < tick:
            time, number, frame = requests.popleft()
            nodes[number].waiting.append((time // step + 1, frame))

    wire.on_sample = note
    wire.run(scenario.end_ns // step, ask)
    outcome = Outcome([], [], [])
    for node in nodes:
        seen = []
        for tick, what, *more in node.events:
            time = tick * step
            if time >= scenario.end_ns:
                continue
            if what == "received":
                identifier, extended, remote, code, payload, fd, brs, esi = more[0]
                flags = code | (FLAG_REMOTE if remote else 0) | (FLAG_EXTENDED if extended else 0)
                flags |= (FLAG_FD if fd else 0) | (FLAG_BRS if brs else 0) | (FLAG_ESI if esi else 0)
                seen.append((time, "received", identifier, flags, payload if fd else payload.ljust(8, b"\0")))
            elif what == "sent":
                seen.append((time, "sent"))
        outcome.seen.append(seen)
        outcome.counters.append(moved(counters[node.name]))
    return outcome


def differences(scenario):
    """What differs between our bus and the oracle: names of the fields of `Outcome`, empty when they agree."""
    ours, accepted = on_our_bus(scenario)
    theirs = on_the_oracle(scenario, accepted)
    return [name for name in ("seen", "counters") if getattr(ours, name) != getattr(theirs, name)]


def compare_scenarios(count):
    """Compare so many, the KINDS in turn: {kind: [how many, seeds of those that differ]}."""
    found = {kind: [0, []] for kind in KINDS}
    for number in range(count):
        kind, seed = KINDS[number % len(KINDS)], number // len(KINDS)
        found[kind][0] += 1
        if differences(scenario_of(kind, seed)):
            found[kind][1].append(seed)
    return found


if __name__ == "__main__":
    scenarios, frames = int(sys.argv[1]), int(sys.argv[2])
    results = compare_scenarios(scenarios)
    for name, (compared, unequal) in results.items():
        print(f"{name:15} {compared:6} scenarios, {len(unequal)} differ {unequal[:10] or ''}")
    different = compare_fd_frames(frames)
    print(f"{'frames':15} {frames:6} compared, {len(different)} differ {different[:3] or ''}")
    sys.exit(1 if different or any(unequal for _, unequal in results.values()) else 0)
