"""Faults of incremental encoders: the edges between sensor and board are rewritten before the board sees them.

The wire has its own count in addition to the sensor's, `true`, both in edges of channel A as
plant/sensors/incremental_encoder.py counts them. Channel A is high at even counts; going up, B is its opposite at an
edge, going down its equal, and the board counts by that alone. So whatever a fault does to the count, the edges are
such as a sensor could have sent.

Two families. Faults of the value (offset, drift, noise ...) let the wire follow a wrong count: extra edges come
at intervals of SPACING_NS, and after the end the wire returns, so that the board's count is right again. Faults of the
line (stuck, lost edges, swapped channels ...) act on the edges themselves: after the end the levels are the sensor's
again, and the board keeps the miscount.

The values of parameters count in the joint's sense: an offset above 0 shows a joint that is farther ahead, on every
board.
"""

import math
from collections import deque
from itertools import zip_longest
from typing import Any

from ranger_sim.harness.faults import signals
from ranger_sim.harness.faults.catalogue import mode
from ranger_sim.harness.faults.fault import Fault, Parameter, WholeNumber
from ranger_sim.harness.faults.kinds import EDGES
from ranger_sim.harness.faults.sensor import Quantity, SignalFault, lasting, mode_classes
from ranger_sim.plant.sensors.incremental_encoder import BOUNCE_NS

# From one extra edge to the next. Chosen by us: 50 per slot of a board, so that its ring of 63 takes them all, and as
# fast as the ankles' motor encoders at 18 rad/s of the joint.
SPACING_NS = 10_000
# What keeps a board's count wrong after lost edges, where the place does not define it (`kept` of its details).
KEPT = "the board's count, until its next power-up; it uses only the rate"

COUNTS = Quantity(
    unit="edges",
    typical=100.0,
    limit=20_000.0,
    clip_low=-50.0,
    clip_high=50.0,
    open_value=0.0,
    source="chosen by us: 100 edges are 0.15 rad of a joint, half of a step's half angle; the limit is five turns",
)


class Wire:
    """The state of the two channels: a count, the level of A, and the edges of a step as (time, A, B)."""

    def __init__(self, count: int) -> None:
        self.count = count
        self.level_a = 1 - (count & 1)
        self.latest_ns = -SPACING_NS
        self.edges: list[tuple[int, int, int]] = []

    def step(self, way: int, time_ns: int) -> None:
        """Make one edge up (1) or down (-1)."""
        level = 1 - self.level_a
        self.edge(time_ns, level, 1 - level if way > 0 else level)

    def edge(self, time_ns: int, level_a: int, level_b: int) -> None:
        """Make an edge to these levels, counted as the board does."""
        self.count += 1 if level_a != level_b else -1
        self.level_a = level_a
        self.latest_ns = time_ns
        self.edges.append((time_ns, level_a, level_b))


def way_of(edge: int) -> int:
    """1 for an edge that counts up, -1 down; `edge` as foundation/edge_buffer.py packs it."""
    return 2 * ((edge >> 1 ^ edge) & 1) - 1


class EdgeFault(Fault):
    """A fault on the two channels of an incremental encoder. `encoder`: that of the plant."""

    unit = COUNTS.unit

    def connect(self) -> None:
        self.number: int = self.place.details["encoder"]
        self.encoder: Any = self.robot.plant.encoders[self.number]
        self.sign: int = self.encoder.sign

    def joint_rad(self) -> float:
        """The present angle, which this encoder measures."""
        return float(self.robot.plant.encoder_rad(self.number))

    def begin(self, now_ns: int) -> None:
        super().begin(now_ns)
        self.true: int = self.encoder.cell
        self.wire = Wire(self.true)
        self.first_step = True
        self.level_b = self.encoder.level_b(self.joint_rad())
        self.begin_on_wire(now_ns)

    def begin_on_wire(self, now_ns: int) -> None:
        """Start with a wire on which nothing has happened yet."""

    def finish(self, now_ns: int) -> None:
        self.level_b = self.encoder.level_b(self.joint_rad())

    def after(self, start_ns: int, end_ns: int) -> None:
        self._write(self.pass_on, start_ns, end_ns)

    def is_clear(self, start_ns: int, end_ns: int) -> bool:
        self._write(self.resume, start_ns, end_ns)
        return self.on_the_wire_as_at_the_sensor() and self.sensor_as_its_model()

    def _write(self, rewrite: Any, start_ns: int, end_ns: int) -> None:
        """Let `rewrite` replace the step's edges, based on those that the sensor has sent."""
        buffer = self.encoder.edges
        sent = list(buffer.kept[: buffer.count]) if buffer.count else []
        shown = self.wire.edges
        shown.clear()
        rewrite(sent, start_ns, end_ns)
        if sent or shown:
            buffer.clear()
            for time_ns, level_a, level_b in shown:
                buffer.push(time_ns, level_a, level_b)

    def differs(self, time_ns: int) -> None:
        """Note by how much the wire's count differs from the sensor's."""
        self.note(time_ns, self.sign * (self.wire.count - self.true))

    def pass_on(self, sent: list[int], start_ns: int, end_ns: int) -> None:
        """Put the step's edges on the wire while the fault works."""
        raise NotImplementedError

    def resume(self, sent: list[int], start_ns: int, end_ns: int) -> None:
        """Pass the sensor's edges on after the end."""
        raise NotImplementedError

    def on_the_wire_as_at_the_sensor(self) -> bool:
        """Whether the wire shows the sensor's levels."""
        return self.wire.level_a == 1 - (self.true & 1)

    def sensor_as_its_model(self) -> bool:
        """Whether the sensor's count is that of the joint's present angle, and followed here edge by edge.

        An edge of the disc is at most 0.4 edges from its place (plant/sensors/incremental_encoder.py).
        """
        position = self.encoder.position(self.joint_rad())
        return bool(self.true == self.encoder.cell and -0.5 <= position - self.true <= 1.5)


# --- faults of the value --------------------------------------------------------------------------------------


class RunsAfter(EdgeFault):
    """The wire follows a count that `target` returns."""

    def target(self, time_ns: int) -> int:
        """The count that the wire is to show at this time."""
        raise NotImplementedError

    def pass_on(self, sent: list[int], start_ns: int, end_ns: int) -> None:
        self._follow(sent, start_ns, end_ns, self.target)
        self.note_step(sent, end_ns)

    def note_step(self, sent: list[int], end_ns: int) -> None:
        """Record the error of the wire's count at the end, at the time of the first edge of the step that differs."""
        if self.wire.count == self.true:
            return
        shown = [time_ns << 2 | level_a << 1 | level_b for time_ns, level_a, level_b in self.wire.edges]
        pairs = zip_longest(sent, shown, fillvalue=end_ns << 2)
        self.differs(next((min(a, b) >> 2 for a, b in pairs if a != b), end_ns))

    def resume(self, sent: list[int], start_ns: int, end_ns: int) -> None:
        self._follow(sent, start_ns, end_ns, lambda _time_ns: self.true)

    def on_the_wire_as_at_the_sensor(self) -> bool:
        return self.wire.count == self.true and super().on_the_wire_as_at_the_sensor()

    def _follow(self, sent: list[int], start_ns: int, end_ns: int, target: Any) -> None:
        """Make edges to `target` at the step's start and at each edge of the sensor; the rest comes later."""
        self._run_to(target(start_ns), start_ns, sent[0] >> 2 if sent else end_ns, at_once=False)
        for place, edge in enumerate(sent):
            even = self.wire.count == target(edge >> 2)
            self.true += way_of(edge)
            until_ns = sent[place + 1] >> 2 if place + 1 < len(sent) else end_ns
            self._run_to(target(edge >> 2), edge >> 2, until_ns, at_once=even)

    def _run_to(self, count: int, time_ns: int, until_ns: int, at_once: bool) -> None:
        """Make edges from `time_ns` to `until_ns` until the wire shows `count`; the first at `time_ns` if `at_once`."""
        wire = self.wire
        while wire.count != count:
            if not at_once:
                time_ns = max(time_ns, wire.latest_ns + SPACING_NS)
            # an extra edge keeps the distance of the shortest pulse that a board detects
            if time_ns >= until_ns or (not at_once and time_ns + BOUNCE_NS > until_ns):
                return
            at_once = False
            wire.step(1 if count > wire.count else -1, time_ns)


class SignalOnEdges(RunsAfter, SignalFault):
    """A signal of harness/faults/signals.py instead of the count."""

    def begin_on_wire(self, now_ns: int) -> None:
        self.signal = self.new_signal()
        self.signal.begin(self.sign * self.true, now_ns)

    def target(self, time_ns: int) -> int:
        return self.sign * math.floor(self.signal.shown(self.sign * self.true, time_ns) + 0.5)


VALUE_MODES = mode_classes(
    SignalOnEdges, EDGES, COUNTS, without=("stuck", "scale", "drop_out", "delay", "swapped_sign", "saturation")
)
for each in VALUE_MODES:
    mode(each)


@mode
class EdgesScale(SignalOnEdges):
    """The joint's motion from the start on is scaled by a factor: the disc of another encoder."""

    mode = "scale"
    kinds = (EDGES,)
    meaning = "shows every turn from its start on times a factor, as a disc with other lines does"
    parameters = (
        Parameter("factor", "1", 1.1, -2.0, 2.0, "what turns are multiplied by", "chosen by us: a tenth too many"),
    )
    signal_class = signals.ScaleFromStart


@mode
class EdgesSaturation(SignalOnEdges):
    """The count stays within a number of edges of its start: the disc's end, a torn coupling."""

    mode = "saturation"
    kinds = (EDGES,)
    meaning = "shows at most this many edges to either side of where it starts"
    parameters = (
        Parameter("low", COUNTS.unit, -50.0, -20_000.0, 0.0, "the least, from the start on", COUNTS.source),
        Parameter("high", COUNTS.unit, 50.0, 0.0, 20_000.0, "the most, from the start on", COUNTS.source),
    )
    signal_class = signals.SaturationFromStart


@mode
class EdgesDelay(RunsAfter):
    """Every edge is late by the same time; at the end all delayed edges come at once."""

    mode = "delay"
    kinds = (EDGES,)
    meaning = "sends every edge late by the same time"
    parameters = (Parameter("delay_ms", "ms", 5.0, 0.25, 1e4, "how late", "chosen by us: ten slots of a motor board"),)

    def begin_on_wire(self, now_ns: int) -> None:
        self.waiting: deque[int] = deque()

    def pass_on(self, sent: list[int], start_ns: int, end_ns: int) -> None:
        late_ns = round(self.values["delay_ms"] * 1e6)
        for edge in sent:
            self.true += way_of(edge)
            self.waiting.append(edge + (late_ns << 2))
        while self.waiting and self.waiting[0] >> 2 < end_ns:
            edge = self.waiting.popleft()
            self.wire.step(way_of(edge), edge >> 2)
        self.note_step(sent, end_ns)


# --- faults of the line ---------------------------------------------------------------------------------------


class OnTheLine(EdgeFault):
    """A fault of the edges themselves; the board keeps the miscount."""

    def connect(self) -> None:
        super().connect()
        self.permanent = self.place.details.get("kept") or KEPT

    @property
    def miscount(self) -> int:
        """Edges by which the board's count is ahead of the sensor's because of this fault, in the joint's sense."""
        return self.sign * (self.wire.count - self.true) if self.activated_ns >= 0 else 0

    def as_the_sensor(self, time_ns: int) -> None:
        """Set the wire to the levels of the sensor."""
        level_a = 1 - (self.true & 1)
        if self.wire.level_a != level_a:
            self.wire.edge(time_ns, level_a, self.level_b)

    def send(self, edge: int) -> None:
        """Pass an edge of the sensor on unchanged, if the wire is not at its level already."""
        if self.wire.level_a != edge >> 1 & 1:
            self.wire.edge(edge >> 2, edge >> 1 & 1, edge & 1)

    def resume(self, sent: list[int], start_ns: int, end_ns: int) -> None:
        self.as_the_sensor(start_ns)
        for edge in sent:
            self.true += way_of(edge)
            self.send(edge)


@mode
class EdgesStuck(OnTheLine):
    """Channels that keep their level: a broken wire, a dead comparator."""

    mode = "stuck"
    kinds = (EDGES,)
    meaning = "sends no edges: channel A, B or both keep their level"
    parameters = (
        WholeNumber(
            "level",
            "A x 2 + B",
            math.nan,
            0.0,
            3.0,
            "the two levels; none given: as they are",
            "of two wires: four",
        ),
        WholeNumber(
            "channel",
            "1",
            0.0,
            0.0,
            2.0,
            "0: both channels, 1: A alone, 2: B alone",
            "chosen by us: both",
        ),
    )

    def begin_on_wire(self, now_ns: int) -> None:
        level = self.values["level"]
        self.fixed_a, self.fixed_b = self.wire.level_a, self.level_b
        if not math.isnan(level):
            self.fixed_a, self.fixed_b = int(level) >> 1, int(level) & 1

    def pass_on(self, sent: list[int], start_ns: int, end_ns: int) -> None:
        channel = int(self.values["channel"])
        if channel != 2 and self.wire.level_a != self.fixed_a:
            self.wire.edge(start_ns, self.fixed_a, self.fixed_b if channel == 0 else self.level_b)
            self.differs(start_ns)
        for edge in sent:
            self.true += way_of(edge)
            if channel == 2:
                self.wire.edge(edge >> 2, edge >> 1 & 1, self.fixed_b)
                if edge & 1 != self.fixed_b:
                    self.differs(edge >> 2)
            else:
                self.differs(edge >> 2)


@mode
class EdgesDropOut(OnTheLine):
    """No supply at the sensor for a while: both channels are low."""

    mode = "drop_out"
    kinds = (EDGES,)
    meaning = "has no supply for a while, at random: both channels are low"
    parameters = lasting("a drop-out", 10.0, 100.0)

    def begin_on_wire(self, now_ns: int) -> None:
        self.gaps = signals.Random(self.random, **self.values)
        self.gaps.begin(0.0, now_ns)

    def before(self, now_ns: int) -> None:
        self.level_b = self.encoder.level_b(self.joint_rad())

    def pass_on(self, sent: list[int], start_ns: int, end_ns: int) -> None:
        self._change(start_ns)
        for edge in sent:
            self.true += way_of(edge)
            if self.gaps.on(edge >> 2):
                self._change(edge >> 2)
                self.differs(edge >> 2)
            else:
                self.send(edge)

    def _change(self, time_ns: int) -> None:
        """Set the channels low, or restore them."""
        if not self.gaps.on(time_ns):
            self.as_the_sensor(time_ns)
        elif self.wire.level_a:
            self.wire.edge(time_ns, 0, 0)
            self.differs(time_ns)


@mode
class LostEdges(OnTheLine):
    """Pulses that the receiver misses: a lost edge takes its successor with it, which finds the level there."""

    mode = "lost_edges"
    kinds = (EDGES,)
    needs = "edges on a wire"
    meaning = "loses edges at random, each with the next one, which finds its level there already"
    parameters = (
        Parameter("share", "1", 0.1, 0.0, 1.0, "share of the edges that begin a loss", "chosen by us: one in ten"),
    )

    def pass_on(self, sent: list[int], start_ns: int, end_ns: int) -> None:
        for edge in sent:
            self.true += way_of(edge)
            if self.wire.level_a == edge >> 1 & 1:
                continue
            if self.random.uniform() < self.values["share"]:
                self.differs(edge >> 2)
            else:
                self.send(edge)


@mode
class ContactBounce(OnTheLine):
    """An edge goes back and over again, as plant/sensors/incremental_encoder.py lets some of the hip's."""

    mode = "contact_bounce"
    kinds = (EDGES,)
    needs = "edges on a wire"
    meaning = "lets edges go back and over again"
    parameters = (
        Parameter("share", "1", 0.5, 0.0, 1.0, "share of the edges that bounce", "chosen by us: every other one"),
        WholeNumber(
            "times",
            "1",
            1.0,
            1.0,
            10.0,
            "how often each does",
            "chosen by us; a contact bounces a few times",
        ),
    )

    def pass_on(self, sent: list[int], start_ns: int, end_ns: int) -> None:
        for place, edge in enumerate(sent):
            self.true += way_of(edge)
            self.send(edge)
            following_ns = sent[place + 1] >> 2 if place + 1 < len(sent) else end_ns
            time_ns, level_a, level_b = edge >> 2, edge >> 1 & 1, edge & 1
            if self.random.uniform() >= self.values["share"]:
                continue
            for _ in range(int(self.values["times"])):
                if time_ns + 3 * BOUNCE_NS >= following_ns:
                    break
                self.wire.edge(time_ns + BOUNCE_NS, 1 - level_a, level_b)
                self.differs(time_ns + BOUNCE_NS)
                time_ns += 2 * BOUNCE_NS
                self.wire.edge(time_ns, level_a, level_b)


@mode
class EdgesSwapped(OnTheLine):
    """Channel B inverted, as with its two wires swapped: the board counts the other way."""

    mode = "swapped_sign"
    kinds = (EDGES,)
    needs = "a signal on two wires or channels that can be swapped"
    meaning = "has channel B inverted, so that the board counts the other way"

    def pass_on(self, sent: list[int], start_ns: int, end_ns: int) -> None:
        for edge in sent:
            self.true += way_of(edge)
            self.wire.edge(edge >> 2, edge >> 1 & 1, 1 - (edge & 1))
            self.differs(edge >> 2)
