"""The stamped channel between two processes: turns, bells and mailboxes in anonymous shared memory.

A board process and the plant process share one block of 64-bit words. They take turns: the plant writes messages and
the time up to which the board is to run, and rings; the board runs, writes its outputs, and rings back.
As each side empties the other's mailbox in its turn, a mailbox is filled from its first slot in every turn.

Words of the block (`Channel` in harness/processes/block.py): header, plant's words, board's words, supervisor's
words, lateness, data table, the two mailboxes. README.md in this folder has the tables.

A message is `SLOT_WORDS` words, and whole further slots when it carries an object:
    0       kind | version << 8 | payload words << 16 | number of the message << 32 (24 bits)
    1, 2    stamp in ns, order
    3 - 8   fields a ... f
    9       0
    10      0
    11      check over all the other words of the message, payload included
Anything that is not such a message is counted, named and skipped (`Mailbox.damaged`, `last_damage`): a
damaged message never reaches a chip and never ends a process.
"""

import array
from typing import Final

import cython

from ranger_sim.can_bus.fd_frame import FD_SENDABLE, LENGTHS
from ranger_sim.can_bus.frame import LENGTH_CODE
from ranger_sim.firmware_sim.peripherals.ssp import SspSegment
from ranger_sim.foundation.events import CAN_REQUEST, FLAG_EXTENDED, FLAG_FD, EventQueue, Outbox
from ranger_sim.harness.processes.kinds import FIELDS, KINDS, PAYLOADS, limits
from ranger_sim.harness.processes.places import (
    DIRECTION,
    LEAST_PAYLOAD,
    LIMIT_SIZE,
    MOST_PAYLOAD,
    NOTE_WORDS,
    RANGES,
    SSP_USED,
    SSP_WORDS,
)
from ranger_sim.harness.processes.shared_words import load, mix, pause, post, store

VERSION: Final = 1
SLOT_WORDS: Final = 12
# the places of a message's parts in its first slot
STAMP_WORD: Final = 1
ORDER_WORD: Final = 2
FIELDS_WORD: Final = 3  # and the five after it
CHECK_WORD: Final = 11
FIELD_COUNT: Final = 6
LONGEST: Final = 23  # slots of the longest message: one and those of NOTE_WORDS
FIRST_OWN_KIND: Final = 64  # kinds from here on are between the processes only: no chip sees them
LAST_KIND: Final = 127
# in word 0 of a message
KIND_MASK: Final = 0xFF
VERSION_SHIFT: Final = 8
PAYLOAD_SHIFT: Final = 16
PAYLOAD_MASK: Final = 0xFFFF
NUMBER_SHIFT: Final = 32
NUMBER_MASK: Final = 0xFFFFFF
LAST_STANDARD_ID: Final = 0x7FF
LAST_CLASSIC_FLAGS: Final = 127
FARTHEST_NS: Final = 1_000_000_000  # between a stamp and the time of its turn

# What can be wrong with a message; FIELD_WRONG + i: field i is out of range.
OF_UNKNOWN_KIND: Final = 1
OF_OTHER_VERSION: Final = 2
TOO_LONG: Final = 3
CHECK_WRONG: Final = 4
NO_IDENTIFIER: Final = 5
BAD_PAYLOAD: Final = 6
OUT_OF_TIME: Final = 7
NO_FRAME: Final = 8
FIELD_WRONG: Final = 16

FAULTS = {
    OF_UNKNOWN_KIND: "its kind is not one that goes this way",
    OF_OTHER_VERSION: f"it is not of version {VERSION}",
    TOO_LONG: "its length does not fit its kind",
    CHECK_WRONG: "its check is wrong",
    NO_IDENTIFIER: "its identifier does not fit in 11 bits",
    NO_FRAME: "its flags and its number of data bytes are not those of a frame",
    BAD_PAYLOAD: "its payload is out of range",
    OUT_OF_TIME: "its stamp is more than a second from the turn's time",
}


@cython.cclass
class Bell:
    """One process rings, the other waits: a count in shared memory, and an eventfd for a sleeping waiter.

    `count`, `sleeper`: places of the two words. The supervisor rings the bell of a process that is gone.
    """

    words: cython.longlong[::1]
    count: cython.longlong
    sleeper: cython.longlong
    descriptor: cython.longlong
    rung: cython.longlong

    def __init__(self, words, count, sleeper, descriptor) -> None:
        self.words = words
        self.count = count
        self.sleeper = sleeper
        self.descriptor = descriptor
        self.rung = 0

    @cython.ccall
    def ring(self) -> cython.void:
        """Ring once more; wakes the other side if it sleeps."""
        self.rung += 1
        store(self.words, self.count, self.rung)
        if not cython.compiled or load(self.words, self.sleeper) != 0:
            post(self.descriptor)

    @cython.ccall
    @cython.exceptval(check=False)
    def wait(self, count: cython.longlong) -> cython.bint:
        """Sleep until the bell was rung `count` times; False when it was rung by a third process meanwhile."""
        if load(self.words, self.count) == count:
            return True
        store(self.words, self.sleeper, 1)
        if load(self.words, self.count) != count:
            pause(self.descriptor)
        store(self.words, self.sleeper, 0)
        return load(self.words, self.count) == count


@cython.cclass
class Mailbox:
    """Messages one way. `first`: place of its first word; `used_word`: place of the number of slots in use.

    `name` is used in reports of damage. `direction`: of the kinds that may be in it (kinds.py).
    """

    words: cython.longlong[::1]
    limits: cython.longlong[::1]
    lengths: cython.longlong[::1]
    name: str
    first: cython.longlong
    slots: cython.longlong
    used_word: cython.longlong
    direction: cython.longlong
    until: cython.longlong
    sequence: cython.longlong
    used: cython.longlong
    at: cython.longlong
    closed: cython.longlong
    damaged: cython.longlong
    kinds: cython.longlong
    bit_of_kind: cython.longlong
    last_damage: str
    notes: list

    def __init__(self, words, name, first, slots, used_word, direction) -> None:
        self.words = words
        self.limits = array.array("q", limits())
        self.lengths = array.array("q", LENGTHS)
        self.name = name
        self.first = first
        self.slots = slots
        self.used_word = used_word
        self.direction = direction
        self.until = 0  # time of the turn (ns): stamps are near it
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

    @cython.ccall
    def put(self, queue: EventQueue) -> cython.bint:
        """Add the message in the fields of `queue`; False when the mailbox is full (then nothing is written)."""
        at: cython.longlong = self.first + self.used * SLOT_WORDS
        payload: cython.longlong = 0
        if self.used + LONGEST > self.slots:
            return False
        self.words[at + STAMP_WORD] = queue.time
        self.words[at + ORDER_WORD] = queue.order
        self.words[at + FIELDS_WORD] = queue.a
        self.words[at + FIELDS_WORD + 1] = queue.b
        self.words[at + FIELDS_WORD + 2] = queue.c
        self.words[at + FIELDS_WORD + 3] = queue.d
        self.words[at + FIELDS_WORD + 4] = queue.e
        self.words[at + FIELDS_WORD + 5] = queue.f
        self.words[at + 9] = 0
        self.words[at + 10] = 0
        if queue.ref is not None:
            payload = self._write_payload(queue.kind, queue.ref, at + SLOT_WORDS)
        self.words[at] = (
            queue.kind
            | VERSION << VERSION_SHIFT
            | payload << PAYLOAD_SHIFT
            | (self.sequence & NUMBER_MASK) << NUMBER_SHIFT
        )
        self.words[at + CHECK_WORD] = self._check(at, payload)
        self.sequence += 1
        self.used += 1 + (payload + SLOT_WORDS - 1) // SLOT_WORDS
        return True

    @cython.ccall
    def send(self) -> cython.void:
        """Complete what was put: the other side may read it once the bell rings."""
        self.words[self.used_word] = self.used
        self.used = 0

    @cython.cfunc
    def _write_payload(self, kind: cython.longlong, ref: object, at: cython.longlong) -> cython.longlong:
        """Write the object of a message as words from `at` on; returns how many."""
        i: cython.longlong
        segment: SspSegment
        if isinstance(ref, SspSegment):
            segment = ref
            for i, half_word in enumerate(segment.words):
                self.words[at + i] = half_word
            self.words[at + SSP_USED] = segment.used
            return SSP_WORDS
        data = bytes(ref)
        padded = array.array("q", data + bytes(-len(data) % 8))  # the bytes themselves, eight to a word
        self.words[at] = len(data)
        for i in range(len(padded)):
            self.words[at + 1 + i] = padded[i]
        return 1 + len(padded)

    # --- reading ------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Start reading what the other side sent."""
        used = self.words[self.used_word]
        self.at = 0
        self.kinds = 0
        self.closed = used
        if not 0 <= used <= self.slots:
            self.closed = 0
            self._damage(f"{used} slots in use, allowed are 0 to {self.slots}")

    @cython.ccall
    def take(self, queue: Outbox) -> cython.bint:
        """Push the next whole message into `queue` (a kind of ours alone into `notes`); False at the end."""
        at: cython.longlong
        kind: cython.longlong
        payload: cython.longlong
        fault: cython.longlong
        skipping: cython.bint = False
        ref: object
        while self.at < self.closed:
            at = self.first + self.at * SLOT_WORDS
            fault = self._fault(at)
            if fault != 0:
                if not skipping:
                    skipping = True
                    self._damage(self.explain(at, fault))
                self.at += 1
                continue
            kind = self.words[at] & KIND_MASK
            payload = self.words[at] >> PAYLOAD_SHIFT & PAYLOAD_MASK
            if (self.words[at] >> NUMBER_SHIFT & NUMBER_MASK) != (self.sequence & NUMBER_MASK):
                if not skipping:
                    self._damage("messages before this one are missing")
                self.sequence = self.words[at] >> NUMBER_SHIFT & NUMBER_MASK
            self.sequence += 1
            self.at += 1 + (payload + SLOT_WORDS - 1) // SLOT_WORDS
            ref = None
            if payload > 0:
                ref = self._read_payload(at + SLOT_WORDS, payload, kind)
            if kind >= FIRST_OWN_KIND:
                fields = [self.words[at + STAMP_WORD + i] for i in range(2 + FIELD_COUNT)]
                self.notes.append((kind, *fields, ref))
                return True
            self.kinds |= self.bit_of_kind << kind
            queue.push(
                self.words[at + STAMP_WORD],
                self.words[at + ORDER_WORD],
                kind,
                self.words[at + FIELDS_WORD],
                self.words[at + FIELDS_WORD + 1],
                self.words[at + FIELDS_WORD + 2],
                self.words[at + FIELDS_WORD + 3],
                self.words[at + FIELDS_WORD + 4],
                self.words[at + FIELDS_WORD + 5],
                ref,
            )
            return True
        return False

    @cython.cfunc
    def _read_payload(self, at: cython.longlong, count: cython.longlong, kind: cython.longlong) -> object:
        """The object whose words begin at `at`."""
        segment: SspSegment
        if self.limits[kind * LIMIT_SIZE + MOST_PAYLOAD] == SSP_WORDS:
            segment = SspSegment()
            segment.words = [self.words[at + i] for i in range(SSP_USED)]
            segment.used = self.words[at + SSP_USED]
            return segment
        data = array.array("q", [self.words[at + i] for i in range(1, count)]).tobytes()
        return data[: self.words[at]]

    # --- what is whole ------------------------------------------------------------------------------------

    @cython.cfunc
    @cython.exceptval(check=False)
    def _check(self, at: cython.longlong, payload: cython.longlong) -> cython.longlong:
        """The check word of the message at word `at`."""
        i: cython.longlong
        sum: cython.longlong = 1
        for i in range(CHECK_WORD):
            sum = mix(sum, self.words[at + i])
        for i in range(SLOT_WORDS, SLOT_WORDS + payload):
            sum = mix(sum, self.words[at + i])
        return sum

    @cython.cfunc
    @cython.exceptval(check=False)
    def _fault(self, at: cython.longlong) -> cython.longlong:
        """The fault of the message at word `at`; 0 for none."""
        head: cython.longlong = self.words[at]
        kind: cython.longlong = head & KIND_MASK
        payload: cython.longlong = head >> PAYLOAD_SHIFT & PAYLOAD_MASK
        row: cython.longlong = kind * LIMIT_SIZE
        body: cython.longlong = at + SLOT_WORDS
        i: cython.longlong
        flags: cython.longlong
        if kind > LAST_KIND or self.limits[row + DIRECTION] != self.direction:
            return OF_UNKNOWN_KIND
        if (head >> VERSION_SHIFT & KIND_MASK) != VERSION or head < 0:
            return OF_OTHER_VERSION
        if payload < self.limits[row + LEAST_PAYLOAD] or payload > self.limits[row + MOST_PAYLOAD]:
            return TOO_LONG
        if self.at + 1 + (payload + SLOT_WORDS - 1) // SLOT_WORDS > self.closed:
            return TOO_LONG
        if self.words[at + CHECK_WORD] != self._check(at, payload):
            return CHECK_WRONG
        if (
            self.words[at + STAMP_WORD] < self.until - FARTHEST_NS
            or self.words[at + STAMP_WORD] > self.until + FARTHEST_NS
        ):
            return OUT_OF_TIME
        for i in range(FIELD_COUNT):
            if self.words[at + FIELDS_WORD + i] < self.limits[row + RANGES + 2 * i]:
                return FIELD_WRONG + i
            if self.words[at + FIELDS_WORD + i] > self.limits[row + RANGES + 2 * i + 1]:
                return FIELD_WRONG + i
        # fields c and d: identifier and flags
        if kind == CAN_REQUEST:
            flags = self.words[at + FIELDS_WORD + 3]
            if self.words[at + FIELDS_WORD + 2] > LAST_STANDARD_ID and not flags & FLAG_EXTENDED:
                return NO_IDENTIFIER
            if (flags > LAST_CLASSIC_FLAGS or payload > 0) and not self._is_fd_request(flags, payload, body):
                return NO_FRAME
        if payload > 0:
            if self.limits[row + MOST_PAYLOAD] == SSP_WORDS:
                if payload != SSP_WORDS or self.words[body + SSP_USED] < 0 or self.words[body + SSP_USED] > SSP_USED:
                    return BAD_PAYLOAD
                for i in range(SSP_USED):
                    if self.words[body + i] < 0 or self.words[body + i] > 0xFFFF:
                        return BAD_PAYLOAD
            elif self.words[body] < 0 or self.words[body] > 8 * (payload - 1):
                return BAD_PAYLOAD
        return 0

    @cython.cfunc
    @cython.exceptval(check=False)
    def _is_fd_request(self, flags: cython.longlong, payload: cython.longlong, body: cython.longlong) -> cython.bint:
        """Whether these are the flags and the number of data bytes of a CAN FD frame; its data begin at word `body`."""
        return (
            payload > 0
            and flags & FLAG_FD != 0
            and flags & ~FD_SENDABLE == 0
            and self.words[body] == self.lengths[flags & LENGTH_CODE]
        )

    def explain(self, at, fault) -> str:
        """Text for the fault of the message at word `at`."""
        number = self.words[at] & KIND_MASK
        kind = KINDS.get(number)
        name = kind.name if kind is not None else f"kind {number}"
        if fault >= FIELD_WRONG:
            field = fault - FIELD_WRONG
            least, largest = kind.ranges[field]
            value = self.words[at + FIELDS_WORD + field]
            return f"{name}: field {FIELDS[field]} is {value}, allowed are {least} to {largest}"
        return f"{name}: {FAULTS[fault]}"

    def note_damage(self, text) -> None:
        """Count a message that no receiver can take, and keep its description."""
        self._damage(text)

    def _damage(self, text) -> None:
        """Count an unreadable message, and keep its description."""
        self.damaged += 1
        self.last_damage = f"channel {self.name}, message {self.sequence}: {text}"


assert max(PAYLOADS.values()) <= NOTE_WORDS <= (LONGEST - 1) * SLOT_WORDS
