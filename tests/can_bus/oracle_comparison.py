"""Random scenarios on our bus and on the oracle of ISO 11898-1: what every node sent, received and counted, and when.

`python -m tests.can_bus.oracle_comparison SCENARIOS FRAMES` from the repository's root compares so many of both and
prints how many differ.
"""

import collections
import dataclasses
import sys

from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.frame import HIGHEST_STANDARD, crc15, frame_bits
from ranger_sim.can_bus.node import BUS_OFF, OPERATING, RESET
from ranger_sim.foundation.events import (
    CAN_RX,
    CAN_STATUS,
    CAN_TX_DONE,
    FLAG_EXTENDED,
    FLAG_REMOTE,
    FLAG_SINGLE_SHOT,
    ORDER_BUS,
    TX_SENT,
    EventQueue,
)
from ranger_sim.foundation.random_stream import RandomStream

from . import bit_oracle as oracle

BIT_NS = 1000
BITRATE = 10**9 // BIT_NS
BITS = 3000  # of a scenario; some twenty frames
RECOVERY_BITS = 3 * 128 * 11  # for one with a way back from bus-off on a busy bus
TAIL = 10  # bits of a frame behind its CRC
KINDS = (
    "clean", "equal", "passive", "errors", "equal-errors", "errors-passive", "equal-passive", "noise", "off",
    "recovery", "resets",
)  # fmt: skip
STATES = {OPERATING: "on", RESET: "off", BUS_OFF: "bus-off"}


@dataclasses.dataclass(frozen=True)
class Scenario:
    """`requests`: (first bit at which it may start, node, Frame with its buffer 1 ... 3). `counters`: (transmit
    errors, receive errors) of each node at the start. `inverted`: bits that every node samples inverted. `modes`: (bit,
    node, OPERATING or RESET): what the program asks for just before that bit."""

    nodes: int
    bits: int
    requests: tuple
    counters: tuple
    inverted: tuple
    modes: tuple = ()


@dataclasses.dataclass
class Outcome:
    """`seen`: by node [(bit, "sent" or "received", frame)]. `counters`: by node (bit, transmit errors, receive errors)
    whenever they moved, but for those
    of bus-off. `states`: of nodes at the end."""

    seen: list
    counters: list
    states: list


def words(data):
    """Data bytes as the two words of our frames."""
    whole = int.from_bytes(data, "little")
    return whole & 0xFFFFFFFF, whole >> 32


def flags_of(frame):
    """The flags of our frames."""
    return (
        frame.dlc
        | (FLAG_REMOTE if frame.remote else 0)
        | (FLAG_EXTENDED if frame.extended else 0)
        | (FLAG_SINGLE_SHOT if frame.single_shot else 0)
    )


def commands_of(scenario):
    """All that programs ask for: (bit, node, buffer, Frame or mode), in order."""
    found = [(bit, node, frame.buffer, frame) for bit, node, frame in scenario.requests]
    found += [(bit, node, 0, mode) for bit, node, mode in scenario.modes]
    return sorted(found, key=lambda each: each[:3])


def moved(counters):
    """Of (bit, transmit errors, receive errors) those that differ from the one before."""
    return [each for i, each in enumerate(counters) if i == 0 or each[1:] != counters[i - 1][1:]]


def run_on_our_bus(scenario, steps=None, prepare=lambda bus: None):
    """(bus, its nodes' inboxes, commands that were accepted) after a scenario; `prepare` gets the bus before it.

    `steps`: lengths in ns of the pieces in which time passes, in turn.
    """
    bus = Bus("can", BITRATE)
    inboxes = [EventQueue(64) for _ in range(scenario.nodes)]
    for i, inbox in enumerate(inboxes):
        bus.add_node(f"n{i}", inbox, 1, ORDER_BUS + i)
        node = bus.nodes[i]
        node.transmit_errors, node.receive_errors = scenario.counters[i]
        node.passive, node.warning = max(scenario.counters[i]) >= 128, max(scenario.counters[i]) >= 96
    for bit in scenario.inverted:
        bus.inject_error_at(bit * BIT_NS)
    prepare(bus)
    accepted = []
    time, turn = 0, 0
    for bit, node, buffer, what in commands_of(scenario):
        at = bit * BIT_NS - 1  # before the edge of its bit
        while steps and time + steps[turn % len(steps)] < at:
            time += steps[turn % len(steps)]
            turn += 1
            bus.advance(time)
        bus.advance(at)
        time = at
        if buffer == 0:
            bus.set_mode(node, what, at)
            accepted.append((bit, node, what))
        elif bus.request(node, buffer, at, what.identifier, flags_of(what), *words(what.data)):
            accepted.append((bit, node, what))
    end = scenario.bits * BIT_NS
    while steps and time + steps[turn % len(steps)] < end:
        time += steps[turn % len(steps)]
        turn += 1
        bus.advance(time)
    bus.advance(end)
    return bus, inboxes, accepted


def on_our_bus(scenario, steps=None):
    """(Outcome, commands that were accepted), of `run_on_our_bus`."""
    bus, inboxes, accepted = run_on_our_bus(scenario, steps)
    outcome = Outcome([], [], [])
    for node, inbox in zip(bus.nodes, inboxes, strict=True):
        seen, counters = [], [(-1, *scenario.counters[node.index])]
        while inbox.take():
            bit = inbox.time // BIT_NS - 1  # the one that ends then
            if bit >= scenario.bits - 1:
                continue
            if inbox.kind == CAN_RX:
                seen.append((bit, "received", (inbox.b, inbox.c, inbox.d, inbox.e)))
            elif inbox.kind == CAN_TX_DONE and inbox.c == TX_SENT:
                seen.append((bit, "sent"))
            elif inbox.kind == CAN_STATUS and inbox.e == 0:  # of a node that is bus-off a register shows 127
                counters.append((bit, inbox.c, inbox.d))
        outcome.seen.append(seen)
        outcome.counters.append(moved(counters))
        # a bus that has decided bits beyond the end shows a node's mode as it will be then
        ahead = bus.free_bit > scenario.bits
        outcome.states.append("not yet known" if ahead else STATES.get(node.mode, "joining"))
    return outcome, accepted


def on_the_oracle(scenario, accepted):
    """Outcome of what our bus accepted."""
    return run_on_the_oracle(scenario, accepted)[0]


def run_on_the_oracle(scenario, accepted):
    """(Outcome, the oracle's nodes) of what our bus accepted."""
    nodes = [oracle.Node(f"n{i}") for i in range(scenario.nodes)]
    counters = []
    for node, (transmit_errors, receive_errors) in zip(nodes, scenario.counters, strict=True):
        node.tec, node.rec = transmit_errors, receive_errors
        node.passive = max(transmit_errors, receive_errors) >= 128
        counters.append([(-1, transmit_errors, receive_errors)])
    wire = oracle.Bus(nodes)
    wire.inverted = set(scenario.inverted)
    waiting = collections.deque(accepted)
    away = [False] * len(nodes)  # one bit ago, when the program asked
    for bit in range(scenario.bits):
        while waiting and waiting[0][0] == bit:
            _, number, what = waiting.popleft()
            if what == OPERATING:
                if away[number]:
                    nodes[number].join()
            elif what == RESET:
                nodes[number].leave()
            else:
                nodes[number].waiting.append((bit, what))
        away = [node.state in (oracle.OFF, oracle.BUS_OFF) for node in nodes]
        wire.step()
        for node, known in zip(nodes, counters, strict=True):
            if node.tec < 256 and bit < scenario.bits - 1:
                known.append((bit, node.tec, node.rec))
    outcome = Outcome([], [], [])
    for node, known in zip(nodes, counters, strict=True):
        seen = []
        for bit, what, *more in node.events:
            if what == "received" and bit < scenario.bits - 1:
                identifier, extended, remote, dlc, data = more[0]
                flags = dlc | (FLAG_REMOTE if remote else 0) | (FLAG_EXTENDED if extended else 0)
                seen.append((bit, "received", (identifier, flags, *words(data))))
            elif what == "sent" and bit < scenario.bits - 1:
                seen.append((bit, "sent"))
        outcome.seen.append(seen)
        outcome.counters.append(moved(known))
        state = {oracle.OFF: "off", oracle.BUS_OFF: "bus-off", oracle.INTEGRATING: "joining"}
        outcome.states.append(state.get(node.state, "on"))
    return outcome, nodes


def differences(scenario):
    """What differs between our bus and the oracle: names of the fields of `Outcome`, empty when they agree."""
    ours, accepted = on_our_bus(scenario)
    theirs = on_the_oracle(scenario, accepted)
    if "not yet known" in ours.states:
        theirs.states = ours.states
    return [name for name in ("seen", "counters", "states") if getattr(ours, name) != getattr(theirs, name)]


# ---- random ones -----------------------------------------------------------------------------------------


class Dice:
    """Random choices from a stream of a name."""

    def __init__(self, name):
        self.stream = RandomStream(1, name)

    def chance(self, probability):
        return self.stream.uniform() < probability

    def number(self, first, last):
        """A whole number, first ... last."""
        return first + self.stream.integer(last - first + 1)

    def choice(self, things):
        return things[self.stream.integer(len(things))]

    def numbers(self, first, last, count):
        """So many different ones of `first` ... `last`."""
        found = set()
        while len(found) < count:
            found.add(self.number(first, last))
        return found


def random_frame(rng, few, buffer=1):
    """Any frame; its identifier often one of `few`, when there are any."""
    extended, remote, length = rng.chance(0.15), rng.chance(0.1), rng.number(0, 8)
    identifier = rng.choice(few) if few and rng.chance(0.9) else rng.number(0, HIGHEST_STANDARD)
    if extended and rng.chance(0.7):  # else one with eleven bits 0
        identifier = identifier << 18 | rng.number(0, (1 << 18) - 1)
    stuffy = rng.chance(0.5)
    data = bytes(
        rng.choice((0, 255, 0x55, rng.number(0, 255))) if stuffy else rng.number(0, 255) for _ in range(length)
    )
    return oracle.Frame(identifier, b"" if remote else data, extended, remote, length, rng.chance(0.1), buffer)


def random_scenario(rng, kind):
    """One of the KINDS."""
    count, bits = rng.number(2, 4), BITS
    few = [rng.number(0, HIGHEST_STANDARD) for _ in range(2)] if "equal" in kind else []
    requests = []
    for node in range(count):
        for buffer in (1, 2, 3):
            if rng.chance(0.5):
                requests.append((rng.choice((1, 1, 1, rng.number(1, 400))), node, random_frame(rng, few, buffer)))
    counters = [(0, 0)] * count
    if "passive" in kind:
        counters = [
            (rng.choice((0, 100, 125, 128, 140, 200, 250)), rng.choice((0, 0, 120, 127, 130))) for _ in range(count)
        ]
    inverted = set()
    if "errors" in kind:
        inverted = rng.numbers(20, 700, rng.number(1, 4))
    if kind == "noise":  # down to a bus on which nothing comes to an end
        rate = 10 ** (-1 - 2 * rng.stream.uniform())
        inverted = {bit for bit in range(2, bits) if rng.chance(rate)}
    modes = []
    if kind in ("off", "recovery"):
        counters = [(rng.choice((0, 240, 248, 250, 255)), rng.choice((0, 0, 127))) for _ in range(count)]
        inverted = rng.numbers(2, 700, rng.number(2, 12))
    if kind in ("recovery", "resets"):
        if kind == "recovery":
            bits = RECOVERY_BITS
            modes = [(rng.number(100, 900), node, OPERATING) for node in range(count)]
        else:
            inverted = rng.numbers(20, 1500, rng.number(0, 6))
            for node in range(count):
                if rng.chance(0.7):  # before anything is on the bus: ours completes what is under way
                    modes.append((1, node, RESET))
                    modes.append((rng.number(2, 1500), node, OPERATING))
            requests = [(bit + 1, node, frame) for bit, node, frame in requests]
        for _ in range(rng.number(0, 30)):
            node, buffer = rng.number(0, count - 1), rng.number(1, 3)
            requests.append((rng.number(2, bits - 200), node, random_frame(rng, few, buffer)))
    return Scenario(count, bits, tuple(requests), tuple(counters), tuple(sorted(inverted)), tuple(modes))


def scenario_of(kind, seed):
    """The random scenario of a kind that a seed gives."""
    return random_scenario(Dice(f"{kind} {seed}"), kind)


def compare_scenarios(count):
    """Compare so many, the KINDS in turn: {kind: [how many, seeds of those that differ]}."""
    found = {kind: [0, []] for kind in KINDS}
    for number in range(count):
        kind, seed = KINDS[number % len(KINDS)], number // len(KINDS)
        found[kind][0] += 1
        if differences(scenario_of(kind, seed)):
            found[kind][1].append(seed)
    return found


def compare_frames(count):
    """How many of so many random frames have another length or CRC than the oracle says."""
    rng = Dice("frames")
    wrong = 0
    for _ in range(count):
        frame = random_frame(rng, [])
        ours = (frame.identifier, flags_of(frame), *words(frame.data))
        bits, is_stuff, _ = oracle.stuffed(frame)
        crc = [bit for bit, stuff in zip(bits, is_stuff, strict=True) if not stuff][-15:]
        wrong += (frame_bits(*ours), crc15(*ours)) != (len(bits) + TAIL, int("".join(map(str, crc)), 2))
    return wrong


if __name__ == "__main__":
    scenarios, frames = int(sys.argv[1]), int(sys.argv[2])
    results = compare_scenarios(scenarios)
    for name, (compared, different) in results.items():
        print(f"{name:15} {compared:6} scenarios, {len(different)} differ {different[:10] or ''}")
    wrong_frames = compare_frames(frames)
    print(f"{'frames':15} {frames:6} compared, {wrong_frames} differ")
    sys.exit(1 if wrong_frames or any(different for _, different in results.values()) else 0)
