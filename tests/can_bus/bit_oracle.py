"""A CAN bus bit by bit, as ISO 11898-1 describes each node: slow, and independent of `ranger_sim.can_bus`.

Every node samples the one level of the bus in every bit and decides from that alone what it drives in the next one. No
frame is known as a whole to anybody but its sender. Levels: 0 dominant, 1 recessive. Classical frames only; standard
and extended identifiers, data and remote frames.
"""

import dataclasses
from collections import deque

DOMINANT, RECESSIVE = 0, 1

# What a node is doing.
OFF = "off"  # reset: drives nothing, hears nothing
INTEGRATING = "integrating"  # waits for 11 recessive bits, once or (out of bus-off) 128 times
BUS_OFF = "bus-off"
IDLE = "idle"
FRAME = "frame"
FLAG = "error flag"
AFTER_FLAG = "after the flag"  # recessive, until the others' flags have ended
DELIMITER = "delimiter"
INTERMISSION = "intermission"
SUSPEND = "suspend transmission"


@dataclasses.dataclass(frozen=True)
class Frame:
    """What a node wants to send. `data`: bytes; a remote frame has a length and no data.

    `buffer`: of frames with one identifier in one node the lower one goes first.
    """

    identifier: int
    data: bytes = b""
    extended: bool = False
    remote: bool = False
    length: int | None = None
    single_shot: bool = False
    buffer: int = 0

    @property
    def dlc(self) -> int:
        return len(self.data) if self.length is None else self.length


def number_bits(value, count):
    """The bits of a number, most significant first."""
    return [value >> (count - 1 - i) & 1 for i in range(count)]


def crc15(bits):
    """CRC of CAN by long division: x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1."""
    generator = [1, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1]
    rest = list(bits) + [0] * 15
    for at in range(len(bits)):
        if rest[at]:
            for i, each in enumerate(generator):
                rest[at + i] ^= each
    return rest[-15:]


def arbitration_bits(frame):
    """SOF and arbitration field, without stuff bits."""
    if frame.extended:
        high, low = frame.identifier >> 18, frame.identifier & 0x3FFFF
        return [0, *number_bits(high, 11), 1, 1, *number_bits(low, 18), int(frame.remote)]
    return [0, *number_bits(frame.identifier, 11), int(frame.remote)]


def unstuffed(frame):
    """SOF to the end of the CRC sequence, without stuff bits."""
    bits = arbitration_bits(frame)
    bits += [0, 0]  # IDE and r0; of an extended frame r1 and r0
    bits += number_bits(frame.dlc, 4)
    if not frame.remote:
        for byte in frame.data:
            bits += number_bits(byte, 8)
    return bits + crc15(bits)


def stuffed(frame):
    """(bits from SOF to the end of the CRC sequence, how many of them are SOF and arbitration field)."""
    plain, arbitration = unstuffed(frame), len(arbitration_bits(frame))
    out, run, last, last_arbitration = [], 0, None, 0
    is_stuff = []
    for i, bit in enumerate(plain):
        out.append(bit)
        is_stuff.append(False)
        run = run + 1 if bit == last else 1
        last = bit
        if i < arbitration:
            last_arbitration = len(out)
        if run == 5:
            last = 1 - bit
            out.append(last)
            is_stuff.append(True)
            run = 1
            if i < arbitration - 1:
                last_arbitration = len(out)
    return out, is_stuff, last_arbitration


class Reception:
    """A receiver's view of a frame: it destuffs, knows its place, and says what is wrong with a bit."""

    def __init__(self):
        self.plain = []
        self.run = 0
        self.last = None
        self.stuffing = True
        self.expect_stuff = False
        self.tail = 0  # bits since the CRC sequence
        self.crc_right = None
        self.total = None  # plain bits up to the CRC sequence's end

    def header(self):
        """Set `total` once the length is known."""
        p = self.plain
        if self.total is not None or len(p) < 19:
            return
        extended = p[13] == 1
        if extended and len(p) < 39:
            return
        remote = p[32] if extended else p[12]
        dlc_at = 35 if extended else 15
        dlc = p[dlc_at] << 3 | p[dlc_at + 1] << 2 | p[dlc_at + 2] << 1 | p[dlc_at + 3]
        data = 0 if remote else 8 * min(dlc, 8)
        self.total = dlc_at + 4 + data + 15

    def take(self, level):
        """One bit; returns None, "stuff" or "form". Fills `tail` behind the CRC sequence: 1 CRC delimiter, 2 ACK slot,
        3 ACK delimiter, 4 ... 10 end of frame."""
        if self.stuffing:
            if self.expect_stuff:
                if level == self.last:
                    return "stuff"
                self.expect_stuff = False
                self.last, self.run = level, 1
                if self.total is not None and len(self.plain) == self.total:
                    self.end_of_crc()
                return None
            self.run = self.run + 1 if level == self.last else 1
            self.last = level
            self.plain.append(level)
            self.header()
            self.expect_stuff = self.run == 5
            if self.total is not None and len(self.plain) == self.total and not self.expect_stuff:
                self.end_of_crc()
            return None
        self.tail += 1
        if self.tail == 1 and level == DOMINANT:
            return "form"
        if self.tail == 3 and level == DOMINANT:
            return "form"
        if 4 <= self.tail <= 9 and level == DOMINANT:
            return "form"
        return None

    def end_of_crc(self):
        self.stuffing = False
        self.crc_right = crc15(self.plain[:-15]) == self.plain[-15:]

    def message(self):
        """(identifier, extended, remote, dlc, data)."""
        p = self.plain
        extended = p[13] == 1
        word = lambda bits: int("".join(map(str, bits)), 2) if bits else 0  # noqa: E731
        if extended:
            identifier, remote, at = word(p[1:12] + p[14:32]), p[32], 35
        else:
            identifier, remote, at = word(p[1:12]), p[12], 15
        dlc = word(p[at : at + 4])
        count = 0 if remote else min(dlc, 8)
        data = bytes(word(p[at + 4 + 8 * i : at + 12 + 8 * i]) for i in range(count))
        return identifier, extended, bool(remote), dlc, data


class Node:
    """A node of the oracle. `queue`: [(first bit at which its frame may start, Frame)], sent in order of identifier."""

    def __init__(self, name):
        self.name = name
        self.state = IDLE
        self.waiting = []  # [(ready, Frame)]
        self.tec = 0
        self.rec = 0
        self.passive = False
        self.sending = None  # the Frame under way
        self.transmitter = False  # it began the last frame, and has not lost its arbitration
        self.sent = []  # bits of it
        self.drive = RECESSIVE
        self.events = []  # (bit, what, ...)
        self.failures = []  # (bit, Frame): it was sending that when it met an error
        self.recessive = 0
        self.sequences = 0
        self.count = 0

    def leave(self):
        """The program takes it off the bus, with what waits; that does not spare it the recovery from bus-off."""
        self.state = BUS_OFF if self.tec > 255 else OFF
        self.sending = None
        self.transmitter = False
        self.waiting.clear()

    def join(self):
        """The program asks to take part: after 11 recessive bits, out of bus-off after 128 times 11."""
        if self.state in (OFF, BUS_OFF):
            self.sequences = 128 if self.state == BUS_OFF else 1
            self.state = INTEGRATING
            self.recessive = 0

    # what it drives in the bit to come
    def decide(self, bit):
        self.drive = RECESSIVE
        state = self.state
        if state == IDLE:
            self.try_start(bit)
        elif state == SUSPEND and self.count >= 8:
            self.state = IDLE
            self.try_start(bit)
        elif state == FRAME:
            if self.sending is not None and self.at < len(self.bits):
                self.drive = self.bits[self.at]
            elif self.sending is None and self.reception.tail == 1 and self.reception.crc_right:
                self.drive = DOMINANT  # the ACK slot
        elif state == FLAG:
            self.drive = RECESSIVE if self.flag_passive else DOMINANT

    def offered(self, bit):
        ready = [(arbitration_key(f), f.buffer, i, f) for i, (when, f) in enumerate(self.waiting) if when <= bit]
        return min(ready, default=None, key=lambda each: each[:3])

    def try_start(self, bit):
        offer = self.offered(bit)
        if offer is not None:
            self.begin(offer[3])
            self.drive = DOMINANT

    def begin(self, frame, at=0):
        self.state = FRAME
        self.reception = Reception()
        self.sending = frame
        self.transmitter = frame is not None
        if frame is not None:
            stuffed_bits, self.stuff_places, self.arbitration = stuffed(frame)
            self.bits = stuffed_bits
            self.at = at

    # what it makes of the level it samples
    def sample(self, bit, level):
        getattr(self, "in_" + self.state.replace(" ", "_").replace("-", "_"))(bit, level)

    def in_off(self, bit, level):
        pass

    def in_bus_off(self, bit, level):
        pass

    def in_integrating(self, bit, level):
        self.recessive = self.recessive + 1 if level else 0
        if self.recessive == 11:
            self.recessive = 0
            self.sequences -= 1
            if self.sequences == 0:
                if self.tec > 255:
                    self.tec = self.rec = 0
                    self.passive = False
                self.state = IDLE
                self.events.append((bit, "joined"))

    def in_idle(self, bit, level):
        if level == DOMINANT:  # somebody's SOF
            self.begin(None)
            self.in_frame(bit, level)

    def in_suspend_transmission(self, bit, level):
        self.count += 1
        if level == DOMINANT:
            self.begin(None)
            self.in_frame(bit, level)

    def in_frame(self, bit, level):
        reception = self.reception
        if self.sending is not None:
            sent = self.drive
            place = self.at
            self.at += 1
            in_stuffed = place < len(self.bits)
            if sent != level:
                if in_stuffed and sent == RECESSIVE and place < self.arbitration:
                    if self.stuff_places[place]:
                        self.error(bit, "stuff", exempt=True)
                        return
                    reception.take(level)
                    self.lose(bit)
                    return
                tail = place - len(self.bits)
                if in_stuffed:
                    self.error(bit, "bit")
                    return
                if tail == 1:  # ACK slot: somebody acknowledges
                    reception.take(level)
                    return
                self.error(bit, "form")  # in the last bit of EOF too: a frame is sent when that is over without error
                return
            reception.take(level)
            if place - len(self.bits) == 1:  # the ACK slot stayed recessive
                self.error(bit, "ack")
                return
            if reception.tail == 10:
                self.complete(bit)
            return
        sent = self.drive
        wrong = reception.take(level)
        if sent == DOMINANT and level == RECESSIVE:
            self.error(bit, "bit")  # its own acknowledgement did not show
            return
        if sent == DOMINANT:
            self.acknowledge(bit)
        if wrong:
            self.error(bit, wrong)
            return
        if reception.tail == 3 and not reception.crc_right:
            self.error(bit, "crc")
            return
        if reception.tail == 9:
            self.receive(bit)
        elif reception.tail == 10:
            self.to_intermission()
            if level == DOMINANT:
                self.overload(bit)

    def lose(self, bit):
        self.events.append((bit, "lost arbitration"))
        frame = self.sending
        self.sending = None
        self.transmitter = False
        if frame.single_shot:
            self.drop(frame)
            self.events.append((bit, "single shot dropped", frame))

    def drop(self, frame):
        for i, (_, each) in enumerate(self.waiting):
            if each is frame:
                del self.waiting[i]
                return

    def receive(self, bit):
        self.events.append((bit, "received", self.reception.message()))

    def acknowledge(self, bit):
        """A reception counts as good once its ACK bit is sent, whatever becomes of the end of frame."""
        if self.rec > 127:
            self.rec = 119
        elif self.rec > 0:
            self.rec -= 1
        self.confine(bit)

    def complete(self, bit):
        self.events.append((bit, "sent", self.sending))
        self.drop(self.sending)
        self.tec = max(self.tec - 1, 0)
        self.confine(bit)
        self.to_intermission()

    def to_intermission(self):
        self.state = INTERMISSION
        self.count = 0
        self.sending = None

    def in_intermission(self, bit, level):
        self.count += 1
        if level == DOMINANT:
            if self.count < 3:
                self.overload(bit)
            else:  # a start of frame in the third bit: a node with a frame goes on with its identifier
                offer = None if self.transmitter and self.passive else self.offered(bit)
                self.begin(offer[3] if offer else None, at=0)
                if offer:
                    self.drive = DOMINANT
                self.in_frame(bit, level)
            return
        if self.count == 3:
            if self.transmitter and self.passive:
                self.state = SUSPEND
                self.count = 0
            else:
                self.state = IDLE

    # errors
    def error(self, bit, kind, exempt=False, in_flag=False):
        sender = self.transmitter
        frame = self.sending if self.state == FRAME else None
        self.flag_passive = self.passive
        self.flag_kind = kind
        self.events.append((bit, "error", kind, "sending" if sender else "receiving"))
        self.pending_ack = sender and kind == "ack" and self.passive  # TEC rises only if a dominant bit shows
        if sender:
            if not exempt and not self.pending_ack:
                self.tec += 8
        else:
            self.rec = min(self.rec + (8 if in_flag else 1), 255)
        self.state = FLAG
        self.count = 0
        self.flag_level = None
        self.after_dominant = 0
        if frame is not None:
            self.failures.append((bit, frame))
        if frame is not None and frame.single_shot:
            self.drop(frame)
            self.events.append((bit, "single shot dropped", frame))
        self.confine(bit)

    def overload(self, bit):
        self.events.append((bit, "overload"))
        self.flag_passive = False
        self.flag_kind = "overload"
        self.pending_ack = False
        self.state = FLAG
        self.count = 0
        self.flag_level = None
        self.sending = None

    def in_error_flag(self, bit, level):
        if self.flag_passive:
            # complete after six equal bits, whoever drives them
            if level == DOMINANT and self.pending_ack:
                self.pending_ack = False
                self.tec += 8
                self.confine(bit)
            self.count = self.count + 1 if level == self.flag_level else 1
            self.flag_level = level
        else:
            if level == RECESSIVE:
                self.error(bit, "bit", in_flag=True)  # in its own flag, which begins anew
                return
            self.count += 1
        if self.count == 6 and self.state == FLAG:
            self.state = AFTER_FLAG
            self.first_after = True
            self.dominant_after = 0

    def in_after_the_flag(self, bit, level):
        if level == DOMINANT:
            self.dominant_after += 1
            if self.first_after and not self.transmitter and self.flag_kind != "overload":
                self.rec = min(self.rec + 8, 255)
                self.confine(bit)
            if self.dominant_after % 8 == 0:
                if self.transmitter:
                    self.tec += 8
                else:
                    self.rec = min(self.rec + 8, 255)
                self.confine(bit)
            self.first_after = False
            return
        self.first_after = False
        self.state = DELIMITER
        self.count = 1

    def in_delimiter(self, bit, level):
        self.count += 1
        if level == DOMINANT:
            if self.count == 8:
                self.overload(bit)
            else:
                self.error(bit, "form")
            return
        if self.count == 8:
            self.to_intermission()

    def confine(self, bit):
        self.passive = self.tec > 127 or self.rec > 127
        if self.tec > 255 and self.state not in (BUS_OFF, OFF, INTEGRATING):
            self.state = BUS_OFF
            self.events.append((bit, "bus-off"))
            self.waiting.clear()


def arbitration_key(frame):
    """Frames by who wins: the arbitration bits one after the other, dominant first."""
    return tuple(arbitration_bits(frame))


class Bus:
    """Nodes on a wire. `inverted`: numbers of the bits that every node samples inverted."""

    def __init__(self, nodes):
        self.nodes = nodes
        self.bit = 0
        self.inverted = set()
        self.levels = deque(maxlen=100_000)

    def step(self):
        bit = self.bit
        for node in self.nodes:
            node.decide(bit)
        level = min(node.drive for node in self.nodes)
        if bit in self.inverted:
            level ^= 1
        for node in self.nodes:
            node.sample(bit, level)
        self.levels.append(level)
        self.bit += 1

    def run(self, bits):
        for _ in range(bits):
            self.step()
