"""Worst-case response times of the frames of a CAN bus.

The analysis is that of R. I. Davis, A. Burns, R. J. Bril, J. J. Lukkien, "Controller Area Network (CAN)
schedulability analysis: refuted, revisited and revised", Real-Time Systems 35 (2007), section 3.2, equations 7-11:
every instance in the busy period of a priority level is examined, because a frame that cannot be pre-empted may push
the frames it delays into its own next instance. Its quantities and equations, as written in this file:

    C   longest time of a frame on the wire: all stuff bits it can have, and the intermission
    T   shortest time between two releases; D deadline after the release
    J   jitter: a frame is queued up to J after its release
    B   blocking: the longest frame of lower priority, which has just started
    t   length of the busy period:        t = B + sum over k in hp and m of ceil((t + J_k) / T_k) C_k
    w   queueing of instance q = 0, 1 ..: w = B + q C_m + sum over k in hp of ceil((w + J_k + bit) / T_k) C_k
    R   response, from release to end:    R = max over q of J_m + w(q) - q T_m + C_m

Two things are added, because real controllers need them; without them, this file computes the above.

Queues. Frames that leave a controller first in, first out are not sent in the order of their priorities. After
R. I. Davis, S. Kollmann, V. Pollex, F. Slomka, "Schedulability analysis for Controller Area Network (CAN) with FIFO
queues, priority queues and gateways", Real-Time Systems 49 (2013), such a frame has the lowest priority of its queue,
the others of its queue delay it, and where it delays frames above that level its time in the queue is further jitter.
Frames that are queued after it count as well if their priority is higher: the hardware has several buffers behind the
queue and offers the best of them.

Trains. Messages of one queue that one clock releases at known offsets are never all released at once. Such a queue is a
train: ceil((w + J) / T) is replaced by the largest number of its frames in any window of w + J, and q T by the distance
between the releases of the first frame and the examined one, over all frames it may begin with.

Two bit rates. C of a CAN FD frame with BRS is the time of its nominal bits and that of its data bits, each phase with
all stuff bits it can have; frames still start with nominal bits only, so nothing else changes.

The bounds hold without bit errors, for controllers that offer their frame at every opportunity. All times are whole
numbers: a tick is 1 / rate of a nanosecond, where `rate` is the bit rate, or the least common multiple of both
(`Rates`). Python has no largest integer.
"""

from __future__ import annotations

import bisect
import dataclasses
import math
from collections.abc import Iterable, Sequence
from fractions import Fraction

from ranger_sim.can_bus.fd_frame import fd_worst_case_phases
from ranger_sim.can_bus.frame import INTERMISSION_BITS, arbitration_key, worst_case_bits
from ranger_sim.foundation.events import FLAG_FD

SECOND_NS = 10**9
# A busy period of more instances than this counts as unbounded, so that an answer takes seconds at most. Chosen by
# us: at a utilisation of 99.9 % a level of 100 frames with one period needs some 1000.
MOST_INSTANCES = 2_000
MOST_ROUNDS = 100_000  # of one search for a fixed point; each but the last finds at least one frame more


@dataclasses.dataclass(frozen=True)
class Message:
    """A stream of frames. `key`: arbitration key, the lower wins. `bits`: longest length, intermission included.
    `data_bits`: further bits at the data rate of a CAN FD bus.

    Times in ns. `queue`: name of the first-in-first-out queue that it shares with others of its controller;
    empty where it has a transmit buffer to itself (or the driver keeps its queue sorted by priority). `pause_ns`: how
    long in total that queue may stall while the frame is in it, because its driver fills free buffers late.
    `last_key`: where frames of several identifiers take turns in one stream, the key of the lowest priority among them
    (`key` is the highest then). `offset_ns`: release relative to the others of its queue, on one clock; None: any.
    """

    name: str
    key: int
    bits: int
    period_ns: int
    deadline_ns: int
    jitter_ns: int = 0
    queue: str = ""
    pause_ns: int = 0
    last_key: int = -1
    offset_ns: int | None = None
    data_bits: int = 0

    def __post_init__(self) -> None:
        least = min(self.jitter_ns, self.pause_ns, self.data_bits)
        if min(self.bits, self.period_ns, self.deadline_ns) < 1 or least < 0:
            raise ValueError(
                f"message {self.name}: bits {self.bits}, period {self.period_ns} ns and deadline {self.deadline_ns} ns "
                f"must be above 0, jitter {self.jitter_ns} ns, pause {self.pause_ns} ns and data bits {self.data_bits} "
                "not below"
            )


@dataclasses.dataclass(frozen=True)
class Rates:
    """Bit rates of a bus in bit/s; `data` 0: a classic one."""

    nominal: int
    data: int = 0

    @property
    def rate(self) -> int:
        """Ticks per ns: both bits are whole numbers of ticks."""
        return math.lcm(self.nominal, self.data) if self.data else self.nominal

    @property
    def bit(self) -> int:
        """Ticks of a nominal bit."""
        return SECOND_NS * self.rate // self.nominal

    def length(self, message: Message) -> int:
        """C of a message in ticks. ValueError for data bits without a data rate."""
        if not message.data_bits:
            return message.bits * self.bit
        if not self.data:
            raise ValueError(f"message {message.name}: has bits at a data rate, and the bus has no data bit rate")
        return message.bits * self.bit + message.data_bits * SECOND_NS * self.rate // self.data


def message(
    name: str,
    identifier: int,
    period_ns: int,
    flags: int = 8,
    deadline_ns: int | None = None,
    jitter_ns: int = 0,
    queue: str = "",
    offset_ns: int | None = None,
) -> Message:
    """A stream of frames with this identifier and these flags (length code and FLAG_*), as long as stuffing can make
    them. Deadline: the period unless given."""
    bits, data_bits = fd_worst_case_phases(flags) if flags & FLAG_FD else (worst_case_bits(flags), 0)
    return Message(
        name,
        arbitration_key(identifier, flags),
        bits + INTERMISSION_BITS,
        period_ns,
        period_ns if deadline_ns is None else deadline_ns,
        jitter_ns,
        queue,
        offset_ns=offset_ns,
        data_bits=data_bits,
    )


@dataclasses.dataclass(frozen=True)
class Bound:
    """Result of the analysis for one message. `response_ns` None: no bound, the bus is overloaded.

    `instance`: the one in the busy period with the longest response (0: the first), of `instances`. `blocking_ns`: B
    with the pause of the queue. Times in ns, rounded up.
    """

    message: Message
    response_ns: int | None
    blocking_ns: int
    instance: int
    instances: int
    busy_ns: int | None

    @property
    def met(self) -> bool:
        """True when every instance meets its deadline."""
        return self.response_ns is not None and self.response_ns <= self.message.deadline_ns


def utilisation(messages: Iterable[Message], bit_rate: int, data_bit_rate: int = 0) -> Fraction:
    """Largest share of the bus that the messages need, exact; above 1 the bus is overloaded."""
    rates = Rates(bit_rate, data_bit_rate)
    return sum((Fraction(rates.length(m), m.period_ns * rates.rate) for m in messages), Fraction(0))


def level_of(message: Message, messages: Iterable[Message]) -> int:
    """Key of the priority that counts for a message: its own, or the lowest priority in its queue."""
    if not message.queue:
        return max(message.key, message.last_key)
    return max(max(other.key, other.last_key) for other in messages if other.queue == message.queue)


class _Train:
    """Frames released on one clock, in ticks: `entries` (offset, message) over one cycle, by offset."""

    def __init__(self, messages: Sequence[Message], level: int, rates: Rates, clock_ppm: int) -> None:
        rate = rates.rate
        self.queue = messages[0].queue
        self.level = level
        self.length = max(rates.length(one) for one in messages)
        self.jitter = max(one.jitter_ns for one in messages) * rate
        self.pause = max(one.pause_ns for one in messages) * rate
        self.cycle = math.lcm(*(one.period_ns for one in messages)) * rate
        self.clock_ppm = clock_ppm
        self.held: int | None = 0  # longest time behind others of its queue; None: no bound
        self.entries: list[tuple[int, Message]] = []
        if sum(self.cycle // (one.period_ns * rate) for one in messages) > MOST_INSTANCES:
            raise ValueError(f"queue {self.queue}: periods have no common multiple of at most {MOST_INSTANCES} frames")
        for one in messages:
            first, period = (one.offset_ns or 0) * rate, one.period_ns * rate
            self.entries += [(at % self.cycle, one) for at in range(first, first + self.cycle, period)]
        self.entries.sort(key=lambda entry: entry[0])
        self.known_spans: dict[int | None, list[int]] = {}

    def spans(self, level: int | None) -> list[int]:
        """Place n - 1: least distance from the first to the last of n releases of this level or above (None: all)."""
        if level not in self.known_spans:
            at = [offset for offset, one in self.entries if level is None or one.key <= level]
            twice = at + [offset + self.cycle for offset in at]
            self.known_spans[level] = [min(twice[i + n] - twice[i] for i in range(len(at))) for n in range(len(at))]
        return self.known_spans[level]

    def most(self, level: int | None, window: int) -> int:
        """Largest number of releases of this level or above in a window of that many true ticks."""
        spans = self.spans(level)
        if not spans or window <= 0:
            return 0
        window = self.by_its_clock(window)
        if len(spans) == 1:
            return -(-window // self.cycle)
        cycles = (window - 1) // self.cycle
        return cycles * len(spans) + bisect.bisect_left(spans, window - cycles * self.cycle)

    def by_its_clock(self, ticks: int) -> int:
        """Largest number of ticks that pass on a fast clock in `ticks` true ones."""
        return ticks if not self.clock_ppm else ticks + -(-ticks * self.clock_ppm // 1_000_000)

    def distance(self, first: int, last: int) -> int:
        """Smallest number of true ticks between releases number `first` and `last`, counted from the start of a
        cycle."""
        count = len(self.entries)
        ticks = self.entries[last % count][0] - self.entries[first % count][0]
        ticks += (last // count - first // count) * self.cycle
        return ticks if not self.clock_ppm else ticks - -(-ticks * self.clock_ppm // 1_000_000)


def _trains(messages: Sequence[Message], rates: Rates, clock_ppm: int) -> list[_Train]:
    """Each queue whose messages all have offsets is one train, any other message is a separate train."""
    trains = []
    free = [one for one in messages if not one.queue]
    for queue in dict.fromkeys(one.queue for one in messages if one.queue):
        members = [one for one in messages if one.queue == queue]
        if all(one.offset_ns is not None for one in members):
            trains.append(_Train(members, level_of(members[0], members), rates, clock_ppm))
        else:
            free += members
    for one in free:
        trains.append(_Train([one], level_of(one, messages), rates, clock_ppm))
    return trains


class _Delays:
    """Interference with the frames of one train: delays as (train, level that counts, jitter), and blocking in
    ticks."""

    def __init__(self, own: _Train, trains: Sequence[_Train]) -> None:
        self.sources: list[tuple[_Train, int | None, int]] = []
        self.blocking = 0
        self.bounded = True
        for other in trains:
            if other is own:
                continue
            if own.queue and other.queue == own.queue:
                self.sources.append((other, None, other.jitter))
                continue
            if other.spans(own.level):
                jitter = other.jitter
                if other.level > own.level:  # it may have waited behind frames that its own level does not count
                    if other.held is None:
                        self.bounded = False
                        return
                    jitter += other.held
                self.sources.append((other, own.level, jitter))
            if any(max(one.key, one.last_key) > own.level for _, one in other.entries):
                self.blocking = max(self.blocking, other.length)
        self.blocking += own.pause

    def work(self, time: int) -> int:
        """Ticks of work that the others add until `time`."""
        return sum(train.most(level, time + jitter) * train.length for train, level, jitter in self.sources)

    def load(self) -> Fraction:
        """Share of the bus that the others take."""
        return sum((Fraction(len(t.spans(level)) * t.length, t.cycle) for t, level, _ in self.sources), Fraction(0))


def response_times(
    messages: Iterable[Message], bit_rate: int, clock_ppm: int = 0, data_bit_rate: int = 0
) -> list[Bound]:
    """The bound of every message at `bit_rate` (bit/s), in the order given; `data_bit_rate`: of a CAN FD bus.

    Periods and offsets are by clocks that may be fast or slow by `clock_ppm`. Two messages with one key (the same
    identifier in two places of a schedule) delay each other.
    """
    given = list(messages)
    rates = Rates(bit_rate, data_bit_rate)
    trains = _trains(given, rates, clock_ppm)
    found: dict[int, Bound] = {}
    # from the lowest level up: only queues of lower levels add jitter to a level above them
    for own in sorted(trains, key=lambda train: -train.level):
        delays = _Delays(own, trains)
        busy = _busy_period(own, delays)
        for one in dict.fromkeys(id(one) for _, one in own.entries):
            found[one] = _bound(one, own, delays, busy, rates)
        if own.queue:
            answers = [found[id(one)].response_ns for _, one in own.entries]
            held = None if None in answers else max(answer * rates.rate - own.jitter for answer in answers if answer)
            own.held = held
    return [found[id(one)] for one in given]


def _busy_period(own: _Train, delays: _Delays) -> int | None:
    """Longest busy period of the level of `own` in ticks; None when it does not end."""
    load = delays.load() + Fraction(len(own.entries) * own.length, own.cycle)
    jitter = own.jitter or own.clock_ppm or any(jitter for _, _, jitter in delays.sources)
    if not delays.bounded or load > 1 or (load == 1 and (delays.blocking or jitter)):
        return None
    shortest = own.cycle // len(own.entries)
    busy, rounds = delays.blocking + own.length, 0
    while (longer := delays.blocking + own.most(None, busy + own.jitter) * own.length + delays.work(busy)) != busy:
        busy = longer
        rounds += 1
        if rounds > MOST_ROUNDS or busy > MOST_INSTANCES * shortest:
            return None
    return busy


def _bound(which: int, own: _Train, delays: _Delays, busy: int | None, rates: Rates) -> Bound:
    """The bound of the message with this id() in its train."""
    places = [place for place, (_, one) in enumerate(own.entries) if id(one) == which]
    message = own.entries[places[0]][1]
    blocking_ns = -(-delays.blocking // rates.rate)
    if busy is None:
        return Bound(message, None, blocking_ns, 0, 0, None)
    instances = own.most(None, busy + own.jitter)
    count = len(own.entries)
    worst, latest = 0, 0
    for place in places:
        later = [n for n in range(1, count + 1) if own.queue and own.entries[(place + n) % count][1].key <= message.key]
        for before in range(instances):  # frames of the train since the busy period began
            first = place + count * (instances // count + 1) - before
            since = own.distance(first, first + before)
            if since >= busy + own.jitter:
                break
            wait = delays.blocking + before * own.length
            while True:
                horizon = wait + rates.bit
                passing = _passing(own, first, before, later, horizon + own.jitter)
                longer = delays.blocking + (before + passing) * own.length + delays.work(horizon)
                if longer <= wait:
                    break
                wait = longer
            response = own.jitter + wait + own.length - since
            if response > worst:
                worst, latest = response, before
    return Bound(message, -(-worst // rates.rate), blocking_ns, latest, instances, -(-busy // rates.rate))


def _passing(own: _Train, first: int, before: int, later: Sequence[int], window: int) -> int:
    """How many later frames of higher priority are released within `window` of frame number `first`."""
    if not later:
        return 0
    count = len(own.entries)
    here = first + before
    turns = 0
    passed = 0
    while True:
        for n in later:
            if own.distance(first, here + turns * count + n) >= window:
                return passed
            passed += 1
        turns += 1


def most_waiting(
    bounds: Iterable[Bound], queue: str, bit_rate: int, clock_ppm: int = 0, data_bit_rate: int = 0
) -> int | None:
    """Largest number of frames of a queue under way at once, including the one being sent; None: no bound.

    At any time these are frames that were queued within the longest response.
    """
    own = [bound for bound in bounds if bound.message.queue == queue]
    longest = 0
    for bound in own:
        if bound.response_ns is None:
            return None
        longest = max(longest, bound.response_ns)
    rates = Rates(bit_rate, data_bit_rate)
    trains = _trains([bound.message for bound in own], rates, clock_ppm)
    return sum(train.most(None, longest * rates.rate) for train in trains)
