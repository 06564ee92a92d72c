"""Worst-case response times of the frames of a CAN bus.

The analysis is that of R. I. Davis, A. Burns, R. J. Bril, J. J. Lukkien, "Controller Area Network (CAN)
schedulability analysis: refuted, revisited and revised", Real-Time Systems 35 (2007), section 3.2, equations 7-11:
every instance in the busy period of a priority level is looked at, because a frame that cannot be pre-empted may
push what it delays into its own next instance. What it needs and how this file writes it:

    C   longest time of a frame on the wire: all stuff bits it can have, and the intermission
    T   shortest time between two releases; D deadline after the release
    J   jitter: a frame is queued up to J after its release
    B   blocking: the longest frame of lower priority, which has just started
    t   length of the busy period:        t = B + sum over k in hp and m of ceil((t + J_k) / T_k) C_k
    w   queueing of instance q = 0, 1 ..: w = B + q C_m + sum over k in hp of ceil((w + J_k + bit) / T_k) C_k
    R   response, from release to end:    R = max over q of J_m + w(q) - q T_m + C_m

Frames that leave a controller through a first-in-first-out queue are not sent in the order of their priorities.
After R. I. Davis, S. Kollmann, V. Pollex, F. Slomka, "Schedulability analysis for Controller Area Network with FIFO
queues" (2013), each such frame has the lowest priority of its queue, all others of its queue delay it, and where it
delays frames of a higher level its time in the queue counts as further jitter.

Holds without bit errors, for controllers that offer their frame at every chance. All times are whole numbers: a tick is
1 / bit rate of a nanosecond, so that a bit is 10^9 ticks at any bit rate. Python has no largest integer.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from fractions import Fraction

from can_bus.frame import INTERMISSION_BITS, arbitration_key, worst_case_bits

TICKS_PER_BIT = 10**9
# A busy period of more instances than this is given up as unbounded. At a utilisation of 99.9 % a level of 100 frames
# with one period needs some 1000; chosen by us so that an answer comes within seconds.
MOST_INSTANCES = 100_000
MOST_ROUNDS = 100_000  # of one search for a fixed point; each but the last finds at least one frame more


@dataclasses.dataclass(frozen=True)
class Message:
    """A stream of frames. `key`: arbitration key, the lower wins. `bits`: longest length, intermission included.

    Times in ns. `queue`: name of the first-in-first-out queue that it shares with others of its controller;
    empty where it has a transmit buffer to itself (or the driver keeps its queue sorted by priority). `pause_ns`: how
    long in all that queue may stand still while the frame is in it, because its driver fills free buffers late.
    """

    name: str
    key: int
    bits: int
    period_ns: int
    deadline_ns: int
    jitter_ns: int = 0
    queue: str = ""
    pause_ns: int = 0

    def __post_init__(self) -> None:
        if min(self.bits, self.period_ns, self.deadline_ns) < 1 or min(self.jitter_ns, self.pause_ns) < 0:
            raise ValueError(
                f"message {self.name}: bits {self.bits}, period {self.period_ns} ns and deadline {self.deadline_ns} ns "
                f"must be above 0, jitter {self.jitter_ns} ns and pause {self.pause_ns} ns not below"
            )


def message(
    name: str,
    identifier: int,
    period_ns: int,
    flags: int = 8,
    deadline_ns: int | None = None,
    jitter_ns: int = 0,
    queue: str = "",
) -> Message:
    """A stream of frames with this identifier and these flags (length code and FLAG_*), as long as stuffing can make
    them. Deadline: the period unless given."""
    return Message(
        name,
        arbitration_key(identifier, flags),
        worst_case_bits(flags) + INTERMISSION_BITS,
        period_ns,
        period_ns if deadline_ns is None else deadline_ns,
        jitter_ns,
        queue,
    )


@dataclasses.dataclass(frozen=True)
class Bound:
    """What the analysis says of one message. `response_ns` None: no bound, the bus has more to do than it can.

    `instance`: which one in the busy period answers latest (0: the first), of `instances`. `blocking_ns`: B with the
    pause of the queue. Times in ns, rounded up.
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


def utilisation(messages: Iterable[Message], bit_rate: int) -> Fraction:
    """Share of the bus that the messages need at most, exact; above 1 is more than there is."""
    return sum((Fraction(m.bits * 10**9, m.period_ns * bit_rate) for m in messages), Fraction(0))


def level_of(message: Message, messages: Iterable[Message]) -> int:
    """Key of the priority that a message counts with: its own, or the lowest priority in its queue."""
    if not message.queue:
        return message.key
    return max(other.key for other in messages if other.queue == message.queue)


class _Stream:
    """One message in ticks."""

    __slots__ = ("message", "level", "length", "period", "jitter", "held")

    def __init__(self, message: Message, level: int, bit_rate: int) -> None:
        self.message = message
        self.level = level
        self.length = message.bits * TICKS_PER_BIT
        self.period = message.period_ns * bit_rate
        self.jitter = message.jitter_ns * bit_rate
        self.held: int | None = 0  # longest time behind others of its queue; None: no bound


def _arrivals(streams: Sequence[tuple[int, int, int]], time: int) -> int:
    """Ticks of work that (length, period, jitter) bring until `time`."""
    return sum(-(-(time + jitter) // period) * length for length, period, jitter in streams)


def response_times(messages: Iterable[Message], bit_rate: int) -> list[Bound]:
    """The bound of every message at `bit_rate` (bit/s), in the order given.

    Two messages with one key (the same identifier in two places of a schedule) delay each other.
    """
    given = list(messages)
    streams = [_Stream(m, level_of(m, given), bit_rate) for m in given]
    found: dict[int, Bound] = {}
    # from the lowest level up: only queues of lower levels add jitter to a level above them
    for place in sorted(range(len(streams)), key=lambda i: -streams[i].level):
        bound = _bound(streams[place], streams, bit_rate)
        found[place] = bound
        one = streams[place]
        if one.message.queue:
            one.held = None if bound.response_ns is None else max(0, bound.response_ns * bit_rate - one.jitter)
    return [found[place] for place in range(len(streams))]


def _bound(own: _Stream, streams: list[_Stream], bit_rate: int) -> Bound:
    """The bound of one stream; those of lower levels are known."""
    queue = own.message.queue
    before: list[tuple[int, int, int]] = []  # length, period, jitter of what can delay it
    blocking = 0
    for other in streams:
        if other is own:
            continue
        if other.message.key <= own.level or (queue and other.message.queue == queue):
            jitter = other.jitter
            if other.level > own.level:  # it may have waited behind frames that the own level does not count
                if other.held is None:
                    return _unbounded(own, blocking, bit_rate)
                jitter += other.held
            before.append((other.length, other.period, jitter))
        else:
            blocking = max(blocking, other.length)
    blocking += own.message.pause_ns * bit_rate
    level = [*before, (own.length, own.period, own.jitter)]
    load = sum((Fraction(length, period) for length, period, _ in level), Fraction(0))
    if load > 1 or (load == 1 and (blocking or any(jitter for _, _, jitter in level))):
        return _unbounded(own, blocking, bit_rate)
    busy = blocking + sum(length for length, _, _ in level)
    rounds = 0
    while (longer := blocking + _arrivals(level, busy)) != busy:
        busy = longer
        rounds += 1
        if rounds > MOST_ROUNDS or busy > MOST_INSTANCES * own.period:
            return _unbounded(own, blocking, bit_rate)
    instances = -(-(busy + own.jitter) // own.period)
    worst, latest = 0, 0
    wait = blocking
    for q in range(instances):
        while (longer := blocking + q * own.length + _arrivals(before, wait + TICKS_PER_BIT)) != wait:
            wait = longer
        response = own.jitter + wait - q * own.period + own.length
        if response > worst:
            worst, latest = response, q
        wait += own.length
    return Bound(own.message, -(-worst // bit_rate), -(-blocking // bit_rate), latest, instances, -(-busy // bit_rate))


def _unbounded(own: _Stream, blocking: int, bit_rate: int) -> Bound:
    return Bound(own.message, None, -(-blocking // bit_rate), 0, 0, None)


def most_waiting(bounds: Iterable[Bound], queue: str) -> int | None:
    """Most frames of a first-in-first-out queue that can wait at once, the one being sent included; None: no bound.

    Each stream has at most ceil(R / T) frames between release and end at any time.
    """
    total = 0
    for bound in bounds:
        if bound.message.queue == queue:
            if bound.response_ns is None:
                return None
            total += -(-bound.response_ns // bound.message.period_ns)
    return total
