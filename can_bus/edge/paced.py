"""A bus with its own clock: private buses follow the wall clock, or run as fast as frames are offered."""

from ranger_sim.can_bus.bit_timing import SAMPLE_POINT
from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.edge.taps import ORDER, TRANSMIT_QUEUE, Tap, Taps
from ranger_sim.can_bus.transmit_buffers import NODE_SHIFT
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.events import NEVER, EventQueue
from ranger_sim.foundation.user_error import BusError

# bit/s; chosen by us, because it is the fastest rate of classic CAN adapters (ISO 11898-2)
DEFAULT_BITRATE = 1_000_000
DEFAULT_DATA_BITRATE = 2_000_000  # of CAN FD, bit/s; chosen by us: the first step of most transceivers
MAX = "max"
BURST = 1024  # most events per call, so that the caller can serve its clients; chosen by us


def speed_of(text: str | float) -> float:
    """Speed factor of "1", 0.05 or "max" (0.0: as fast as possible). UserError for anything else."""
    if isinstance(text, str) and text.strip().lower() == MAX:
        return 0.0
    try:
        speed = float(text)
    except (TypeError, ValueError):
        speed = -1.0
    if not 0.001 <= speed <= 1000.0:
        raise BusError(f"speed {text!r} is neither a number in 0.001 ... 1000 nor 'max'")
    return speed


def alone_and_passive(bus: Bus) -> bool:
    """True while no node can acknowledge the frames that wait on `bus`, which only repeat."""
    if bus.buffers.waiting_count == 0 or bus.acknowledging >= 2 or bus.disturbed:
        return False
    if bus.joining or bus.commands.count or bus.strike_bit < NEVER or bus.disturbance.frames_left > 0:
        return False
    return all(bus.nodes[row >> NODE_SHIFT].passive for row in bus.buffers.waiting())


def is_quiet(bus: Bus) -> bool:
    """True while nothing happens on `bus` except noise."""
    waiting = bus.buffers.waiting_count or bus.joining or bus.commands.count
    return not waiting and not bus.disturbed and not bus.disturbance.planned_bits


def hold_off(bus: Bus, bit: int) -> None:
    """Delay attempts on `bus` until `bit`: waiting frames become ready then."""
    for row in bus.buffers.waiting():
        bus.buffers.hold(row, bit)
    bus.next_bit = max(bus.next_bit, bus.aligned(bit))
    bus.next_time = max(bus.next_time, bus.edge_ns(bus.aligned(bit)))


class PacedBus:
    """A bus with clients only, which advances its own time.

    `speed`: virtual over wall time; 0.0 advances time only while there are frames to send, without delay. Stamps plus
    `epoch_ns` are nanoseconds since 1970 (at a speed other than 1: the opening time plus virtual time).
    `acknowledge`: see `add_acknowledger`. `data_bitrate`, `iso`, `sample_points`: of a CAN FD bus (`bus.Bus`).
    """

    def __init__(
        self,
        channel: str,
        bitrate: int = DEFAULT_BITRATE,
        speed: float = 1.0,
        seed: int = 0,
        bit_error_rate: float = 0.0,
        depth: int = TRANSMIT_QUEUE,
        acknowledge: bool = False,
        data_bitrate: int = 0,
        iso: bool = True,
        sample_points: tuple[float, float] = (SAMPLE_POINT, SAMPLE_POINT),
    ) -> None:
        try:
            self.bus = Bus(channel, bitrate, seed, 0, data_bitrate, iso, *sample_points)
            if bit_error_rate:
                self.bus.set_bit_error_rate(bit_error_rate)
        except ValueError as fault:
            raise BusError(str(fault)) from None
        self.channel = channel
        self.bitrate = bitrate
        self.speed = speed
        self.bit_error_rate = bit_error_rate
        self.taps = Taps(self.bus, depth)
        self.time = 0
        self.epoch_ns = wallclock.epoch_ns()
        self.started_ns = wallclock.monotonic_ns()
        self.acknowledger: EventQueue | None = None
        if acknowledge:
            self.add_acknowledger()

    def add_acknowledger(self) -> None:
        """Add a node that acknowledges every frame and sends none, so that a client may be alone. One is enough."""
        if self.acknowledger is None:
            self.advance()
            self.acknowledger = EventQueue(64)
            node = self.bus.add_node(f"{self.channel} acknowledger", self.acknowledger, 1, ORDER)
            self.bus.nodes[node].listening = False

    def add(self, name: str, fd: bool = True) -> Tap:
        """Add a client, from now on; see `Taps.add`."""
        self.advance()
        return self.taps.add(name, fd)

    def now(self) -> int:
        """Virtual time that the wall clock allows, ns."""
        if self.speed == 0.0:
            return NEVER - 1
        return int((wallclock.monotonic_ns() - self.started_ns) * self.speed)

    def seconds_until(self, virtual_ns: int) -> float:
        """Wall-clock seconds until a virtual time is allowed; 0 when it is, and at full speed."""
        if self.speed == 0.0:
            return 0.0
        return max(virtual_ns - self.now(), 0) * 1e-9 / self.speed

    def advance(self) -> int:
        """Advance to now (at most BURST events); returns the next virtual time of interest, or NEVER.

        Where no node is left to acknowledge, an error-passive sender repeats for ever without any change: such
        repetitions are skipped, and the frame is sent as soon as a client joins.
        """
        bus, taps = self.bus, self.taps
        if self.acknowledger is not None:
            self.acknowledger.clear()  # error states of a node without a program
        until = self.time if self.held() else self.now()
        bit_ns = 1_000_000_000 // self.bitrate
        for _ in range(BURST):
            poll_time = taps.poll(self.time)
            # at full speed an idle bus waits for its clients, whatever noise may hit it meanwhile
            due = poll_time if self.speed == 0.0 and is_quiet(bus) else min(bus.next_time, poll_time)
            waits = bus.operating < 2 and due <= until and alone_and_passive(bus)
            if waits:
                due = poll_time  # earlier events are still reported
            if due > until:
                break
            # one bit more: events within it belong to the same frame, and no frame starts that soon after another
            self.time = max(self.time, min(due + bit_ns, until))
            if not waits and bus.next_time <= self.time:
                bus.advance(self.time)
        else:
            return self.time
        alone = bus.operating < 2 and alone_and_passive(bus)
        if self.speed != 0.0:
            self.time = max(self.time, until)
        if alone:
            hold_off(bus, bus.bit_of(self.time) + 1)
        if self.speed != 0.0:
            bus.advance(self.time)
            poll_time = taps.poll(self.time)
        rests = alone or (self.speed == 0.0 and is_quiet(bus))
        return poll_time if rests else min(bus.next_time, poll_time)

    def held(self) -> bool:
        """True when time waits: at full speed the bus waits for its slowest reader; by the clock it does not."""
        return self.speed == 0.0 and any(tap.held for tap in self.taps.taps)
