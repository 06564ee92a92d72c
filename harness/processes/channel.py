"""The stamped channel between two processes: turns, bells and mailboxes in anonymous shared memory.

A board process and the plant process share one block of 64-bit words. They take turns: the plant writes messages
and the instant up to which the board is to run, and rings; the board runs, writes what it put out, and rings back.
As each side empties the other's mailbox in its turn, a mailbox is filled from its first slot in every turn.

Words of the block (`Channel` in harness/processes/block.py): header, plant's words, board's words, supervisor's
words, lateness, data table, the two mailboxes. README.md beside this file has the tables.

A message is `SLOT_WORDS` words, and whole further slots when it carries an object:
    0       kind | version << 8 | payload words << 16 | number of the message << 32 (24 bits)
    1, 2    stamp in ns, order
    3 - 8   fields a ... f
    9       0
    10      0
    11      check over all the other words of the message, payload included
Whatever does not read as such a message is counted, named and skipped (`Mailbox.damaged`, `last_damage`): a
damaged message never reaches a chip and never ends a process.
"""

import array

import cython

from ranger_sim.firmware_sim.peripherals.ssp import SspSegment
from ranger_sim.foundation.events import EventQueue, Outbox
from ranger_sim.harness.processes.kinds import FIELDS, KINDS, NOTE_WORDS, PAYLOADS, limits

if not cython.compiled:
    from ranger_sim.harness.processes.plain import load, mix, pause, post, store

VERSION = 1
SLOT_WORDS = 12
CHECK_WORD = 11
LONGEST = 1 + (NOTE_WORDS + SLOT_WORDS - 1) // SLOT_WORDS  # slots of the longest message

# What can be wrong with a message; 16 + i: field i is out of range.
OF_UNKNOWN_KIND, OF_OTHER_VERSION, TOO_LONG, CHECK_WRONG, NO_IDENTIFIER, BAD_PAYLOAD, OUT_OF_TIME = 1, 2, 3, 4, 5, 6, 7
FAULTS = {
    OF_UNKNOWN_KIND: "its kind is not one that goes this way",
    OF_OTHER_VERSION: f"it is not of version {VERSION}",
    TOO_LONG: "its length does not fit its kind",
    CHECK_WRONG: "its check is wrong",
    NO_IDENTIFIER: "its identifier does not fit in 11 bits",
    BAD_PAYLOAD: "its payload is out of range",
    OUT_OF_TIME: "its stamp lies more than a second from the turn's instant",
}


class Bell:
    """One process rings, the other waits: a count in shared memory, and an eventfd for who sleeps.

    `count`, `sleeper`: places of the two words. The bell of a process that is gone is rung by the supervisor.
    """

    def __init__(self, words, count, sleeper, descriptor) -> None:
        self.words = words
        self.count = count
        self.sleeper = sleeper
        self.descriptor = descriptor
        self.rung = 0

    def ring(self) -> cython.void:
        """One more; wakes the other side if it sleeps."""
        self.rung += 1
        store(self.words, self.count, self.rung)
        if not cython.compiled or load(self.words, self.sleeper) != 0:
            post(self.descriptor)

    def wait(self, count: cython.longlong) -> cython.bint:
        """Sleep until the bell was rung `count` times; False when it was rung from a third side meanwhile."""
        if load(self.words, self.count) == count:
            return True
        store(self.words, self.sleeper, 1)
        if load(self.words, self.count) != count:
            pause(self.descriptor)
        store(self.words, self.sleeper, 0)
        return load(self.words, self.count) == count


class Mailbox:
    """Messages one way. `first`: place of its first word; `used_word`: place of the number of slots in use.

    `name` stands in what is said about damage. `direction`: of the kinds that may stand in it (kinds.py).
    """

    def __init__(self, words, name, first, slots, used_word, direction) -> None:
        self.words = words
        self.limits = array.array("q", limits())
        self.name = name
        self.first = first
        self.slots = slots
        self.used_word = used_word
        self.direction = direction
        self.until = 0  # instant of the turn (ns): stamps lie near it
        self.sequence = 0
        self.used = 0
        self.at = 0
        self.closed = 0
        self.bit_of_kind = 1  # as wide as `kinds`
        self.kinds = 0  # bits of the kinds below 60 that were taken since the last `open`
        self.damaged = 0
        self.last_damage = ""
        self.notes = []

    # --- writing ------------------------------------------------------------------------------------------

    def put(self, queue: EventQueue) -> cython.bint:
        """Add the message in the fields of `queue`; False when the mailbox is full (then nothing is written)."""
        at: cython.longlong = self.first + self.used * 12
        payload: cython.longlong = 0
        if self.used + LONGEST > self.slots:
            return False
        self.words[at + 1] = queue.time
        self.words[at + 2] = queue.order
        self.words[at + 3] = queue.a
        self.words[at + 4] = queue.b
        self.words[at + 5] = queue.c
        self.words[at + 6] = queue.d
        self.words[at + 7] = queue.e
        self.words[at + 8] = queue.f
        self.words[at + 9] = 0
        self.words[at + 10] = 0
        if queue.ref is not None:
            payload = self._write_payload(queue.kind, queue.ref, at + 12)
        self.words[at] = queue.kind | 1 << 8 | payload << 16 | (self.sequence & 0xFFFFFF) << 32
        self.words[at + 11] = self._check(at, payload)
        self.sequence += 1
        self.used += 1 + (payload + 11) // 12
        return True

    def send(self) -> cython.void:
        """Close what was put: the other side may read it once the bell rings."""
        self.words[self.used_word] = self.used
        self.used = 0

    def _write_payload(self, kind: cython.longlong, ref: object, at: cython.longlong) -> cython.longlong:
        """The object of a message as words from `at` on; returns how many."""
        i: cython.longlong
        segment: SspSegment
        if isinstance(ref, SspSegment):
            segment = ref
            for i, half_word in enumerate(segment.words):
                self.words[at + i] = half_word
            self.words[at + 31] = segment.used
            return 32
        data = bytes(ref)
        padded = array.array("q", data + bytes(-len(data) % 8))  # the bytes themselves, eight to a word
        self.words[at] = len(data)
        for i in range(len(padded)):
            self.words[at + 1 + i] = padded[i]
        return 1 + len(padded)

    # --- reading ------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Look at what the other side sent."""
        used = self.words[self.used_word]
        self.at = 0
        self.kinds = 0
        self.closed = used
        if not 0 <= used <= self.slots:
            self.closed = 0
            self._damage(f"{used} slots in use, allowed are 0 to {self.slots}")

    def take(self, queue: Outbox) -> cython.bint:
        """Push the next whole message into `queue` (a kind of ours alone into `notes`); False at the end."""
        at: cython.longlong
        payload: cython.longlong
        fault: cython.longlong
        skipping: cython.bint = False
        ref: object
        while self.at < self.closed:
            at = self.first + self.at * 12
            fault = self._fault(at)
            if fault != 0:
                if not skipping:
                    skipping = True
                    self._damage(self.explain(at, fault))
                self.at += 1
                continue
            payload = self.words[at] >> 16 & 0xFFFF
            if (self.words[at] >> 32 & 0xFFFFFF) != (self.sequence & 0xFFFFFF):
                if not skipping:
                    self._damage("messages before this one are missing")
                self.sequence = self.words[at] >> 32 & 0xFFFFFF
            self.sequence += 1
            self.at += 1 + (payload + 11) // 12
            ref = None
            if payload > 0:
                ref = self._read_payload(at + 12, payload, self.words[at] & 0xFF)
            if (self.words[at] & 0xFF) >= 64:
                fields = [self.words[at + 1 + i] for i in range(8)]
                self.notes.append((self.words[at] & 0xFF, *fields, ref))
                return True
            self.kinds |= self.bit_of_kind << (self.words[at] & 0x3F)
            queue.push(
                self.words[at + 1],
                self.words[at + 2],
                self.words[at] & 0xFF,
                self.words[at + 3],
                self.words[at + 4],
                self.words[at + 5],
                self.words[at + 6],
                self.words[at + 7],
                self.words[at + 8],
                ref,
            )
            return True
        return False

    def _read_payload(self, at: cython.longlong, count: cython.longlong, kind: cython.longlong) -> object:
        """The object whose words begin at `at`."""
        segment: SspSegment
        if self.limits[kind * 15 + 2] == 32:  # SSP_WORDS
            segment = SspSegment()
            segment.words = [self.words[at + i] for i in range(31)]
            segment.used = self.words[at + 31]
            return segment
        data = array.array("q", [self.words[at + i] for i in range(1, count)]).tobytes()
        return data[: self.words[at]]

    # --- what is whole ------------------------------------------------------------------------------------

    def _check(self, at: cython.longlong, payload: cython.longlong) -> cython.longlong:
        """The check of the message at word `at`."""
        i: cython.longlong
        sum: cython.longlong = 1
        for i in range(11):
            sum = mix(sum, self.words[at + i])
        for i in range(12, 12 + payload):
            sum = mix(sum, self.words[at + i])
        return sum

    def _fault(self, at: cython.longlong) -> cython.longlong:
        """What is wrong with the message at word `at`; 0 when nothing is."""
        head: cython.longlong = self.words[at]
        kind: cython.longlong = head & 0xFF
        payload: cython.longlong = head >> 16 & 0xFFFF
        row: cython.longlong = kind * 15  # kinds.LIMIT_SIZE
        i: cython.longlong
        if kind > 127 or self.limits[row] != self.direction:
            return OF_UNKNOWN_KIND
        if (head >> 8 & 0xFF) != 1 or head < 0:
            return OF_OTHER_VERSION
        if payload < self.limits[row + 1] or payload > self.limits[row + 2]:
            return TOO_LONG
        if self.at + 1 + (payload + 11) // 12 > self.closed:
            return TOO_LONG
        if self.words[at + 11] != self._check(at, payload):
            return CHECK_WRONG
        if self.words[at + 1] < self.until - 1000000000 or self.words[at + 1] > self.until + 1000000000:
            return OUT_OF_TIME
        for i in range(6):
            if self.words[at + 3 + i] < self.limits[row + 3 + 2 * i]:
                return 16 + i
            if self.words[at + 3 + i] > self.limits[row + 4 + 2 * i]:
                return 16 + i
        if kind == 32 and self.words[at + 5] > 0x7FF and not self.words[at + 6] & 64:  # CAN_REQUEST
            return NO_IDENTIFIER
        if payload > 0:
            if self.limits[row + 2] == 32:  # SSP_WORDS
                if payload != 32 or self.words[at + 12 + 31] < 0 or self.words[at + 12 + 31] > 31:
                    return BAD_PAYLOAD
                for i in range(31):
                    if self.words[at + 12 + i] < 0 or self.words[at + 12 + i] > 0xFFFF:
                        return BAD_PAYLOAD
            elif self.words[at + 12] < 0 or self.words[at + 12] > 8 * (payload - 1):
                return BAD_PAYLOAD
        return 0

    def explain(self, at, fault) -> str:
        """The fault of the message at word `at`, in words."""
        kind = KINDS.get(self.words[at] & 0xFF)
        name = kind.name if kind is not None else f"kind {self.words[at] & 0xFF}"
        if fault >= 16:
            least, largest = kind.ranges[fault - 16]
            value = self.words[at + 3 + fault - 16]
            return f"{name}: field {FIELDS[fault - 16]} is {value}, allowed are {least} to {largest}"
        return f"{name}: {FAULTS[fault]}"

    def _damage(self, text) -> None:
        """Count what was not readable, and keep the words for it."""
        self.damaged += 1
        self.last_damage = f"channel {self.name}, message {self.sequence}: {text}"


assert max(PAYLOADS.values()) <= NOTE_WORDS
