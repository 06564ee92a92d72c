"""Compare the bounds of `can_bus.bounds` with the simulated bus: play message sets on a `Bus`, measure responses.

A message set is simulated twice: at its critical instant (the whole level of the second lowest priority is released at
once, just after the longest frame of lower priority has started, every frame as long as stuffing makes it) and at
random (phases, jitters and contents). Functions return figures; nothing is printed. With data rates the bus is a CAN FD
bus, and most frames are of CAN FD.
"""

from __future__ import annotations

import collections
import dataclasses
import functools
import heapq
from collections.abc import Callable, Sequence

from ranger_sim.can_bus.bounds import Bound, Message, Rates, level_of, message, response_times, utilisation
from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.fd_frame import LONGEST, PHASE_MASK, PHASE_SHIFT, fd_data_length, fd_worst_case_phases, phases
from ranger_sim.can_bus.frame import INTERMISSION_BITS, LENGTH_CODE, frame_bits, worst_case_bits
from ranger_sim.can_bus.transmit_buffers import BUFFERS
from ranger_sim.foundation.events import CAN_TX_DONE, FLAG_BRS, FLAG_EXTENDED, FLAG_FD, NEVER, STAGE_BUS, EventQueue
from ranger_sim.foundation.random_stream import RandomStream

BIT_RATES = (125_000, 250_000, 500_000, 1_000_000, 3_000_000)
DATA_RATES = {125_000: 500_000, 250_000: 2_000_000, 500_000: 2_000_000, 1_000_000: 5_000_000}  # by the nominal one
LONGEST_FD = FLAG_FD | FLAG_EXTENDED | LENGTH_CODE
LEAD_NS = 1  # the blocking frame is requested this long before the start that the others miss


@dataclasses.dataclass(frozen=True)
class Sender:
    """A message of a set with what it sends: identifier, flags, and the words of its longest content (`hi` of CAN FD:
    all bytes from the fifth on)."""

    message: Message
    identifier: int
    flags: int
    lo: int
    hi: int


@functools.lru_cache(maxsize=100_000)
def longest_content(identifier: int, flags: int) -> tuple[int, int]:
    """Words (lo, hi) that make a frame as long as, or nearly as long as, stuffing can.

    After five equal bits every four further ones of alternating level cost a stuff bit, so the pattern 00001111 in each
    of its eight phases is tried, with every value of the first byte (the identifier decides how the run begins) and
    some of the last (for the CRC).
    """
    best, words = (-1, -1), (0, 0)
    length = LONGEST if flags & FLAG_FD else 8
    most = fd_worst_case_phases(flags) if flags & FLAG_FD else (worst_case_bits(flags), 0)
    for phase in range(8):
        pattern = (0x0F0F >> phase) & 0xFF
        body = int.from_bytes(bytes([pattern] * length), "little") & ~(0xFF << 8 * (length - 1))
        for first in (pattern, *(0xFF >> n for n in range(9)), *(0xFF << n & 0xFF for n in range(1, 8))):
            for last in (pattern, 0x00, 0xFF, 0x3C, 0xC3, 0x78, 0x87):
                value = body & ~0xFF | first | last << 8 * (length - 1)
                if flags & FLAG_FD:  # the last byte is the last one that is sent
                    value &= (1 << 8 * fd_data_length(flags)) - 1
                lo, hi = value & 0xFFFFFFFF, value >> 32
                bits = bits_of(identifier, flags, lo, hi)
                if bits > best:
                    best, words = bits, (lo, hi)
        if best == most:
            break
    return words


def bits_of(identifier: int, flags: int, lo: int, hi: int) -> tuple[int, int]:
    """(nominal bits, data bits) of a frame, intermission not included."""
    if not flags & FLAG_FD:
        return frame_bits(identifier, flags, lo, hi), 0
    packed = phases(identifier, flags, data_of(flags, lo, hi))
    return packed & PHASE_MASK, packed >> PHASE_SHIFT


def data_of(flags: int, lo: int, hi: int) -> bytes:
    """The data of a CAN FD frame."""
    return (lo | hi << 32).to_bytes(LONGEST, "little")[: fd_data_length(flags)]


class _Lane:
    """Transmit buffers of one controller and the frames that wait for them, first in, first out."""

    def __init__(self, node: int, buffers: Sequence[int]) -> None:
        self.node = node
        self.free = list(buffers)
        self.waiting: collections.deque[int] = collections.deque()


def lanes_of(messages: Sequence[Message]) -> tuple[list[_Lane], int]:
    """The lane of each message (a buffer for itself, or two for its whole queue) and the number of nodes."""
    lanes: list[_Lane] = []
    queues: dict[str, _Lane] = {}
    nodes, alone = 0, 0
    for one in messages:
        if not one.queue:
            if alone % BUFFERS == 0:
                place = nodes
                nodes += 1
            lanes.append(_Lane(place, [alone % BUFFERS + 1]))
            alone += 1
            continue
        if one.queue not in queues:
            queues[one.queue] = _Lane(nodes, [1, 2])
            nodes += 1
        lanes.append(queues[one.queue])
    return lanes, nodes


def play(
    senders: Sequence[Sender],
    bit_rate: int,
    releases: Sequence[Sequence[tuple[int, int]]],
    contents: Callable[[int], tuple[int, int]] | None = None,
    data_bit_rate: int = 0,
) -> list[int]:
    """Play a set on a bus; the longest response of each message in ns, 0 where none was released.

    `releases`: for each message its times (released, queued) in ns, ascending. A message has its own transmit buffer;
    instances queued while an earlier one waits follow in order. Messages of one queue share two buffers, which are
    filled as they become free. `contents(message)`: words of its next frame.
    """
    bus = Bus("bounds", bit_rate, log_capacity=0, data_bitrate=data_bit_rate)
    lanes, nodes = lanes_of([sender.message for sender in senders])
    inboxes = [EventQueue(16) for _ in range(nodes + 1)]  # the last node only receives
    for n, inbox in enumerate(inboxes):
        bus.add_node(f"n{n}", inbox, 1, STAGE_BUS * 256 + n)
    # time; -1 an instance is queued, or the buffer that is free again; message
    events = [(queued, -1, index) for index, times in enumerate(releases) for _, queued in times]
    heapq.heapify(events)
    loaded: dict[tuple[int, int], int] = {}  # node, buffer -> message
    answered = [0] * len(senders)
    worst = [0] * len(senders)
    while events or bus.buffers.waiting_count:
        time = events[0][0] if events else NEVER
        if bus.next_time < time:
            bus.advance(bus.next_time)
        else:
            bus.advance(time)
            _, buffer, index = heapq.heappop(events)
            lane = lanes[index]
            if buffer < 0:
                lane.waiting.append(index)
            else:
                lane.free.append(buffer)
            while lane.waiting and lane.free:
                index, buffer = lane.waiting.popleft(), lane.free.pop()
                one = senders[index]
                lo, hi = (one.lo, one.hi) if contents is None else contents(index)
                if one.flags & FLAG_FD:
                    bus.request_fd(lane.node, buffer, time, one.identifier, one.flags, data_of(one.flags, lo, hi))
                else:
                    bus.request(lane.node, buffer, time, one.identifier, one.flags, lo, hi & 0xFFFFFFFF)
                loaded[lane.node, buffer] = index
        for n, inbox in enumerate(inboxes):
            while inbox.take():
                if inbox.kind == CAN_TX_DONE:
                    index = loaded[n, inbox.b]
                    released = releases[index][answered[index]][0]
                    worst[index] = max(worst[index], inbox.time - released)
                    answered[index] += 1
                    heapq.heappush(events, (inbox.time, inbox.b, index))
    return worst


def critical_releases(
    senders: Sequence[Sender], place: int, bit_rate: int, busy_ns: int, data_bit_rate: int = 0
) -> list[list[tuple[int, int]]]:
    """Releases at the critical instant of message `place` for a busy period.

    The longest frame of lower level starts just before; then everything that can delay the message is queued at once,
    each as late after its release as its jitter allows, and from then on as soon as its period allows. A train begins
    with the message if it is in it, else with its highest priority.
    """
    messages = [sender.message for sender in senders]
    level = level_of(messages[place], messages)
    start = -(-100 * 10**9 // bit_rate)  # an edge: frames queued then take part from the next one on
    lower = [i for i, m in enumerate(messages) if m.key > level and m.offset_ns is None]
    rates = Rates(bit_rate, data_bit_rate)
    longest = max(lower, key=lambda i: rates.length(messages[i]), default=-1)
    releases: list[list[tuple[int, int]]] = []
    for index, one in enumerate(messages):
        if one.key > level and one.offset_ns is None:  # a train keeps its offsets, independent of its frames' levels
            # requested just before the edge that the others miss
            releases.append([(start - LEAD_NS, start - LEAD_NS)] if index == longest else [])
            continue
        released = start - one.jitter_ns
        if one.offset_ns is not None:
            train = [m for m in messages if m.queue == one.queue]
            first = messages[place] if messages[place].queue == one.queue else min(train, key=lambda m: m.key)
            released += (one.offset_ns - (first.offset_ns or 0)) % one.period_ns
        times = []
        while released <= start + busy_ns:
            times.append((released, max(released, start)))
            released += one.period_ns
        releases.append(times)
    return releases


def random_set(stream: RandomStream, fd: bool = False) -> tuple[list[Sender], int]:
    """A message set and its bit rate: 2 to 12 messages, 20 to 95 % of the bus in the worst case.

    In a quarter of the sets some messages share first-in-first-out queues, in another the first half is a train.
    `fd`: for a CAN FD bus, whose data rate is that of DATA_RATES; three quarters of its frames are of CAN FD.
    """
    bit_rates = tuple(DATA_RATES) if fd else BIT_RATES
    bit_rate = bit_rates[stream.integer(len(bit_rates))]
    rates = Rates(bit_rate, DATA_RATES[bit_rate] if fd else 0)
    count = 2 + stream.integer(11)
    load = 0.2 + 0.75 * stream.uniform()
    shares = [0.1 + stream.uniform() for _ in range(count)]
    with_jitter = stream.integer(2) == 1
    kind = stream.integer(4)
    queues = ("", "", "one", "two") if kind == 0 else ("",)
    cycle = 0
    used: set[int] = set()
    senders = []
    for index, share in enumerate(shares):
        flags = stream.integer(9) | (FLAG_EXTENDED if stream.integer(4) == 0 else 0)
        if fd and stream.integer(4):
            flags = flags & ~LENGTH_CODE | FLAG_FD | stream.integer(16) | (FLAG_BRS if stream.integer(4) else 0)
        identifier = stream.integer(1 << 29 if flags & FLAG_EXTENDED else 0x7F0)
        while identifier in used:
            identifier += 1
        used.add(identifier)
        length_ns = rates.length(message("", identifier, 1, flags)) / rates.rate
        period = int(length_ns * sum(shares) / (share * load))
        jitter = stream.integer(period) if with_jitter and stream.integer(2) else 0
        queue = queues[stream.integer(len(queues))]
        offset = None
        if kind == 1 and index < count // 2:  # one frame per slot, anywhere in it; some every other cycle only
            # as many frames as if each had the worst of the periods: at most the target load
            most_ns = rates.length(message("", 0, 1, LONGEST_FD)) / rates.rate if fd else 160 * 1e9 / bit_rate
            cycle = cycle or int(most_ns * sum(shares) / (min(shares[: count // 2]) * load))
            slot = cycle // (count // 2)
            period = cycle * (1 + stream.integer(2))
            offset, jitter, queue = index * slot, slot if with_jitter else 0, "train"
        one = message(f"m{index}", identifier, period, flags, jitter_ns=jitter, queue=queue, offset_ns=offset)
        senders.append(Sender(one, identifier, flags, *longest_content(identifier, flags)))
    return senders, bit_rate


def random_releases(senders: Sequence[Sender], stream: RandomStream, length_ns: int) -> list[list[tuple[int, int]]]:
    """Random phases, gaps at least a period (most of them exactly that) and delays up to the jitter."""
    releases = []
    phase = stream.integer(max(sender.message.period_ns for sender in senders))
    for sender in senders:
        one = sender.message
        released = stream.integer(one.period_ns) if one.offset_ns is None else phase + one.offset_ns
        queued = 0
        times = []
        while released < length_ns:
            delay = stream.integer(one.jitter_ns + 1) if one.jitter_ns else 0
            queued = max(queued, released + delay)  # two instances are not queued in the wrong order
            times.append((released, queued))
            released += one.period_ns
            if one.offset_ns is None and stream.integer(8) == 0:
                released += stream.integer(one.period_ns)
        releases.append(times)
    return releases


def lengths_as_sent(senders: Sequence[Sender]) -> list[Message]:
    """The messages with the actual lengths of their contents instead of the longest possible ones."""
    found = []
    for sender in senders:
        bits, data_bits = bits_of(sender.identifier, sender.flags, sender.lo, sender.hi)
        found.append(dataclasses.replace(sender.message, bits=bits + INTERMISSION_BITS, data_bits=data_bits))
    return found


@dataclasses.dataclass
class Figures:
    """Results of a check. Shares: longest simulated response at the critical instant over its bound, per message;
    `shares`: bounds for the longest frames there can be, `shares_as_sent`: for the frames that were sent."""

    sets: int = 0
    messages: int = 0
    exceeded: int = 0
    unbounded: int = 0
    later_instances: int = 0
    shares: list[float] = dataclasses.field(default_factory=list)
    shares_as_sent: list[float] = dataclasses.field(default_factory=list)

    def summary(self) -> dict[str, float]:
        """Summarise as plain figures; of the shares: minimum, median and the part of messages that reach 90 %."""
        found: dict[str, float] = {
            "sets": self.sets,
            "messages": self.messages,
            "unbounded": self.unbounded,
            "worst_in_a_later_instance": self.later_instances,
            "exceeded": self.exceeded,
        }
        for name, shares in (("reached", sorted(self.shares)), ("reached_as_sent", sorted(self.shares_as_sent))):
            if shares:
                found[f"{name}_min"] = shares[0]
                found[f"{name}_median"] = shares[len(shares) // 2]
                found[f"{name}_90_percent"] = sum(share >= 0.9 for share in shares) / len(shares)
        return found


def check_set(
    senders: Sequence[Sender], bit_rate: int, stream: RandomStream, figures: Figures, data_bit_rate: int = 0
) -> list[Bound]:
    """One set at every message's critical instant and at random, added to `figures`; returns its bounds."""
    bounds = response_times([sender.message for sender in senders], bit_rate, data_bit_rate=data_bit_rate)
    as_sent = response_times(lengths_as_sent(senders), bit_rate, data_bit_rate=data_bit_rate)
    figures.sets += 1
    figures.messages += len(senders)

    def hold(worst: list[int], limits: list[Bound]) -> None:
        for limit, response in zip(limits, worst, strict=True):
            if limit.response_ns is not None and response > limit.response_ns:
                figures.exceeded += 1

    for place, bound in enumerate(bounds):
        if bound.response_ns is None or bound.busy_ns is None:
            figures.unbounded += 1
            continue
        figures.later_instances += bound.instance > 0
        releases = critical_releases(senders, place, bit_rate, bound.busy_ns, data_bit_rate)
        worst = play(senders, bit_rate, releases, data_bit_rate=data_bit_rate)
        hold(worst, bounds)
        hold(worst, as_sent)
        if not any(sender.message.queue for sender in senders):  # with queues, the critical instant is a different one
            figures.shares.append(worst[place] / bound.response_ns)
            figures.shares_as_sent.append(worst[place] / (as_sent[place].response_ns or bound.response_ns))
    longest = max(sender.message.period_ns for sender in senders)

    def contents(index: int) -> tuple[int, int]:
        if stream.integer(2):
            return senders[index].lo, senders[index].hi
        words = [stream.integer(1 << 32) for _ in range(2 if data_bit_rate == 0 else LONGEST // 4)]
        return words[0], sum(word << 32 * place for place, word in enumerate(words[1:]))

    hold(play(senders, bit_rate, random_releases(senders, stream, 3 * longest), contents, data_bit_rate), bounds)
    return bounds


def random_sets(count: int, seed: int = 1, fd: bool = False) -> dict:
    """Compare `count` random message sets with their bounds: figures of `Figures.summary`, mean load and seed.

    `fd`: sets of CAN FD buses.
    """
    figures = Figures()
    load = 0.0
    for number in range(count):
        stream = RandomStream(seed, f"bounds {number}")
        senders, bit_rate = random_set(stream, fd)
        data_bit_rate = DATA_RATES[bit_rate] if fd else 0
        load += float(utilisation((sender.message for sender in senders), bit_rate, data_bit_rate))
        check_set(senders, bit_rate, stream, figures, data_bit_rate)
    return {**figures.summary(), "load_mean": load / count, "seed": seed}
