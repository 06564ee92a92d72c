"""A CAN FD bus tick by tick, as ISO 11898-1:2015 describes each node: slow, and independent of `ranger_sim.can_bus`.

Nodes behave as those of `bit_oracle`; here are what CAN FD adds to them, and bits of two lengths. A node's bit has a
start and a sample point; with the level it samples there it decides how long the rest of the bit is. Where nodes are
out of step, after an error in a data phase, an edge from recessive to dominant begins the bit of every node that is
outside of a frame, and nodes that are all idle are in step again. A node that integrates counts its recessive bits from
every such edge on.
"""

from . import bit_oracle, fd_oracle
from .bit_oracle import DOMINANT, FRAME, IDLE, INTEGRATING, INTERMISSION, RECESSIVE, SUSPEND, crc15


class Reception:
    """A receiver's view of a frame of either kind; see `bit_oracle.Reception`, whose place it takes."""

    def __init__(self, knows_fd, iso):
        self.knows_fd, self.iso = knows_fd, iso
        self.plain, self.covered, self.field = [], [], []
        self.run, self.last, self.stuffed = 0, None, 0
        self.expect_stuff, self.fixed_next = False, False
        self.fd, self.fast = False, False
        self.total, self.wanted, self.tail = None, 0, 0
        self.crc_right = None
        self.region = "dynamic"

    def take(self, level):
        return getattr(self, "take_" + self.region)(level)

    def take_dynamic(self, level):
        if self.expect_stuff:
            if level == self.last:
                return "stuff"
            self.stuffed += 1
            self.covered.append(level)
            self.run, self.last, self.expect_stuff = 1, level, False
            if len(self.plain) == self.total:
                self.end_classic()
            return None
        self.run = self.run + 1 if level == self.last else 1
        self.last = level
        self.plain.append(level)
        self.covered.append(level)
        wrong = self.header(level)
        if wrong:
            return wrong
        self.expect_stuff = self.run == 5
        if len(self.plain) == self.total:
            if self.fd:
                self.region, self.fixed_next, self.expect_stuff = "fixed", True, False
            elif not self.expect_stuff:
                self.end_classic()
        return None

    @property
    def fdf_at(self):
        return 33 if self.plain[13] else 14

    def header(self, level):
        count = len(self.plain)
        if count < 15 or count <= self.fdf_at:
            return None
        at = self.fdf_at
        if count == at + 1 and level:
            if not self.knows_fd:
                return "form"
            self.fd = True
        if self.fd:
            if count == at + 2 and level:
                return "form"
            if count == at + 3:
                self.fast = bool(level)
            if count == at + 8:
                self.length = fd_oracle.BYTES[self.word(at + 4, 4)]
                self.total = count + 8 * self.length
                self.width = 17 if self.length <= 16 else 21
                self.wanted = self.width + (4 if self.iso else 0)
        else:
            dlc_at = 35 if self.plain[13] else 15
            if count == dlc_at + 4:
                remote = self.plain[32] if self.plain[13] else self.plain[12]
                self.total = count + (0 if remote else 8 * min(self.word(dlc_at, 4), 8)) + 15
        return None

    def word(self, at, count):
        return int("".join(map(str, self.plain[at : at + count])), 2) if count else 0

    def end_classic(self):
        self.region = "tail"
        self.crc_right = crc15(self.plain[:-15]) == self.plain[-15:]

    def take_fixed(self, level):
        if self.fixed_next:
            if level == self.last:
                return "form"
            self.fixed_next = False
        else:
            self.field.append(level)
            self.fixed_next = len(self.field) % 4 == 0
        self.last = level
        if len(self.field) == self.wanted:
            self.region = "tail"
            field = "".join(map(str, self.field))
            count = field[:4] if self.iso else ""
            covered = "".join(map(str, self.covered)) + count
            right = not self.iso or count == fd_oracle.COUNTS[self.stuffed % 8]
            self.crc_right = right and field[len(count) :] == fd_oracle.remainder(covered, self.width, self.iso)
        return None

    def take_tail(self, level):
        self.tail += 1
        self.fast = False
        return "form" if level == DOMINANT and self.tail in (1, 3, 4, 5, 6, 7, 8, 9) else None

    def message(self):
        """(identifier, extended, remote, length code, data, FD, BRS, ESI)."""
        extended = bool(self.plain[13])
        identifier = self.word(1, 11) << 18 | self.word(14, 18) if extended else self.word(1, 11)
        at = self.fdf_at
        if self.fd:
            data = bytes(self.word(at + 8 + 8 * i, 8) for i in range(self.length))
            return (
                identifier,
                extended,
                False,
                self.word(at + 4, 4),
                data,
                True,
                self.word(at + 2, 1),
                self.word(at + 3, 1),
            )
        remote = bool(self.plain[32] if extended else self.plain[12])
        dlc_at = 35 if extended else 15
        count = 0 if remote else min(self.word(dlc_at, 4), 8)
        data = bytes(self.word(dlc_at + 4 + 8 * i, 8) for i in range(count))
        return identifier, extended, remote, self.word(dlc_at, 4), data, False, 0, 0


class Node(bit_oracle.Node):
    """A node. `knows_fd`: it is not a classic one. Ticks of its present bit: `start`, `sample_at`, `next_start`."""

    def __init__(self, name, knows_fd=True, iso=True):
        super().__init__(name)
        self.knows_fd, self.iso = knows_fd, iso
        self.start, self.sample_at, self.next_start = 0, None, 0
        self.on_wire = RECESSIVE
        self.reception = Reception(knows_fd, iso)

    def begin(self, frame, at=0):
        self.state = FRAME
        self.reception = Reception(self.knows_fd, self.iso)
        self.sending = frame
        self.transmitter = frame is not None
        if frame is None:
            return
        self.at = at
        if isinstance(frame, bit_oracle.Frame):
            self.bits, self.stuff_places, self.arbitration = bit_oracle.stuffed(frame)
            return
        shown = fd_oracle.FdFrame(frame.identifier, frame.data, frame.extended, frame.brs, frame.esi or self.passive)
        text, _, delimiter = fd_oracle.transmitted(shown, self.iso)
        self.bits = [int(bit) for bit in text[:delimiter]]
        places = set(fd_oracle.places_of_stuff_bits(text[:60]))
        self.stuff_places = [place in places for place in range(delimiter)]
        plain = [place for place in range(60) if place not in places]
        self.arbitration = plain[32 if frame.extended else 12] + 1

    @property
    def fast(self):
        return self.state == FRAME and self.reception.fast

    @property
    def at_rest(self):
        return self.state in (IDLE, SUSPEND, INTEGRATING, bit_oracle.OFF, bit_oracle.BUS_OFF)

    @property
    def away(self):
        return self.state in (bit_oracle.OFF, bit_oracle.BUS_OFF)


class Bus:
    """Nodes on a wire. `windows`: (first tick, tick after the last) in which every node samples inverted.

    `nominal`, `data`: (ticks of a bit, ticks from its start to its sample point).
    """

    def __init__(self, nodes, nominal, data):
        self.nodes, self.nominal, self.data = nodes, nominal, data
        self.windows = []
        self.tick = 0
        self.joining = []  # [(first tick, node)]: programs have asked, and the node has had no bit since
        self.level = RECESSIVE
        self.on_sample = lambda node, end: None

    def run(self, until, before=lambda tick: None):
        """Up to the first bit that begins at or after `until`; `before` is called with the tick of every such start."""
        while True:
            starts = [node.next_start for node in self.nodes if node.next_start is not None]
            if not starts and self.joining:  # alone: the bits of an idle bus
                starts = [self.tick + -(-(self.joining[0][0] - self.tick) // self.nominal[0]) * self.nominal[0]]
            if not starts or min(starts) >= until:
                return
            self.tick = min(starts)
            self.begin_joining()
            if all(node.at_rest for node in self.nodes):
                for node in self.nodes:
                    if not node.away:
                        node.sample_at, node.next_start = None, self.tick
            before(self.tick)
            self.start()
            self.sample_all()

    def begin_joining(self):
        """A node's first bit begins with a nominal one of another node that is on the bus, if there is one."""
        others = [node for node in self.nodes if not node.away]
        if others and not any(node.next_start == self.tick and not node.fast for node in others):
            return
        for entry in [entry for entry in self.joining if entry[0] <= self.tick]:
            self.joining.remove(entry)
            node = entry[1]
            if node.state in (bit_oracle.OFF, bit_oracle.BUS_OFF):
                node.join()
                node.next_start = self.tick

    def start(self):
        began = False
        for node in self.nodes:
            if node.next_start == self.tick and node.away:  # its last bit is over
                node.on_wire, node.next_start = RECESSIVE, None
            elif node.next_start == self.tick:
                began |= self.decide(node)
        if began:
            for node in self.nodes:
                waits = node.state == IDLE or (node.state == SUSPEND and node.count >= 8)
                if waits and node.next_start is not None and node.next_start > self.tick:
                    self.decide(node)
        level = min(node.on_wire for node in self.nodes)
        if level < self.level:
            for node in self.nodes:
                outside = node.state in (IDLE, SUSPEND, INTEGRATING)
                outside |= node.state == INTERMISSION and node.count == 2
                if outside and node.start < self.tick and not node.away:
                    self.begin_bit(node)
                    if node.state == INTEGRATING:
                        node.recessive = 0
        self.level = level

    def decide(self, node):
        before = node.state
        node.decide(self.tick)
        node.on_wire = node.drive  # a node decides within a bit what it will drive, and drives it from the next one on
        self.begin_bit(node)
        return before != FRAME and node.state == FRAME

    def begin_bit(self, node):
        node.start = self.tick
        node.sample_at = self.tick + (self.data if node.fast else self.nominal)[1]
        node.next_start = None

    def sample_all(self):
        while True:
            waiting = [node for node in self.nodes if node.sample_at is not None]
            starts = [node.next_start for node in self.nodes if node.next_start is not None]
            if not waiting or (starts and min(starts) < min(node.sample_at for node in waiting)):
                return
            tick = min(node.sample_at for node in waiting)
            level = min(node.on_wire for node in self.nodes)
            if any(first <= tick < end for first, end in self.windows):
                level = 1 - level
            for node in waiting:
                if node.sample_at == tick:
                    known = len(node.events)
                    node.sample(node.start, level)
                    length, sampled = self.data if node.fast else self.nominal
                    node.sample_at = None
                    node.next_start = tick + length - sampled
                    for number in range(known, len(node.events)):
                        node.events[number] = (node.next_start, *node.events[number][1:])
                    self.on_sample(node, node.next_start)
