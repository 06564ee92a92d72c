"""Wires that are cut and joined again, and controllers at a wrong bit rate: changes made directly to a bus.

Everything here takes effect between two bits that are decided: a plain frame under way is completed (`bus.py`).
"""

from typing import Any

from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.fd_frame import LONGEST, fd_data_length
from ranger_sim.can_bus.node import JOINING, OPERATING, UNPLUGGED
from ranger_sim.foundation.events import FLAG_FD
from ranger_sim.foundation.user_error import BusError

# A rate for which synchronisation compensates is not a fault: bits of ten time quanta with a jump width of two tolerate
# 1 % at either end (ISO 11898-1, oscillator tolerance), so 2 % between two controllers. The other limit is chosen by
# us: an eighth to eight times covers every prescaler that is wrong by a few steps.
LEAST_MISMATCH = 0.02
MOST_TIMES = 8


def unplug(bus: Any, node: int, time: int) -> list[tuple[int, int, int, int, int]]:
    """Unplug a node from `bus` from `time` (ns) on.

    Returns the requests that waited there, as `Bus.take_out` does.
    """
    controller = bus.nodes[node]
    if controller.mode == OPERATING:
        bus.acknowledging -= not controller.silent
    bus.joining -= controller.mode == JOINING
    controller.mode = UNPLUGGED
    if bus.disturbed:
        bus.bit_level.leave(controller)
    waited = bus.take_out(node, time)
    bus.recompute_next()
    return waited


def plug(bus: Any, node: int, time: int) -> None:
    """Connect an unplugged node to `bus` again: it takes part after one recessive sequence, as after reset."""
    controller = bus.nodes[node]
    if controller.mode == UNPLUGGED:
        controller.leave()
        bus._set_going(controller, time)
        bus.recompute_next()


def check_rate(bus: Any, rate: int, where: str, right: int = 0) -> None:
    """Raise UserError, naming `where`, for a rate (bit/s) too close to the bit rate of `bus`, or too far from it.

    `right`: to be compared with in its place.
    """
    right = right or bus.bitrate
    off = abs(rate / right - 1.0)
    if not (off >= LEAST_MISMATCH and right <= MOST_TIMES * rate <= MOST_TIMES**2 * right):
        raise BusError(
            f"{where}: {rate} bit/s must be {LEAST_MISMATCH:.0%} off {right} at least, because synchronisation"
            f" makes up for less, and {MOST_TIMES} times off at most"
        )


def set_rate_of(bus: Any, node: int, rate: int, time: int, data_rate: int = 0) -> None:
    """Set a controller's bit rate to `rate` bit/s from `time` (ns) on; 0: the bus's. `data_rate`: of a CAN FD bus.

    That takes a reset, because CxBTR can be written in reset mode only: waiting frames are answered with TX_ABORTED.
    UserError for a rate that is too close, or too far off. On a CAN FD bus its bits are whole ticks of the bus.
    """
    controller = bus.nodes[node]
    where = f"bus {bus.name}, {controller.name}"
    if data_rate and not bus.is_fd:
        raise BusError(f"{where}: a classic bus has no data bit rate")
    if rate:
        check_rate(bus, rate, where)
    if data_rate:
        check_rate(bus, data_rate, f"{where}, data phase", bus.data_bitrate)
    takes_part = controller.mode in (OPERATING, JOINING)
    bus._reset(controller, time)
    machine = bus.bit_level.machines[node]
    if bus.is_fd:
        machine.timing = bus.timing.at_rates(rate, data_rate)
    else:
        machine.own_rate = rate
    if takes_part:
        bus._set_going(controller, time)
    bus.recompute_next()


class Cut:
    """The cable between `node` and the other nodes of `bus` is cut: it is alone on a separate piece, `far`.

    The owner of `bus` must advance `far` too. The node has number 0 there.
    """

    def __init__(self, bus: Any, node: int) -> None:
        self.bus = bus
        self.node = node
        self.far: Any = None

    def part(self, time: int) -> Any:
        """Cut at `time` (ns); returns `far`."""
        bus, controller = self.bus, self.bus.nodes[self.node]
        timing = bus.timing
        points = timing.sample / timing.nominal, timing.data_sample / timing.data
        rates = {"data_bitrate": bus.data_bitrate, "sample_point": points[0], "data_sample_point": points[1]}
        self.far = far = Bus(f"{bus.name} behind the cut", bus.bitrate, log_capacity=0, iso=bus.iso, **rates)
        far.add_node(controller.name, controller.inbox, controller.controller, controller.order)
        _move(bus, self.node, far, 0, time)
        return far

    def mend(self, time: int) -> None:
        """Repair the wire at `time` (ns): the node takes part after a recessive sequence."""
        _move(self.far, 0, self.bus, self.node, time)


def _move(source: Any, place: int, target: Any, to: int, time: int) -> None:
    """Move the controller at `place` of one bus to another one as `to`, with its counters and waiting frames."""
    before, after = source.nodes[place], target.nodes[to]
    mode = before.mode
    waited = unplug(source, place, time)
    after.take_over(before)
    if after.mode != UNPLUGGED:  # a new bus: its node takes part at once
        unplug(target, to, time)
    if mode in (OPERATING, JOINING):
        plug(target, to, time)
    else:  # off by its program or bus-off: it remains so
        after.mode = mode
        target.recompute_next()
    for buffer, identifier, flags, low, high in waited:
        if flags & FLAG_FD:
            data = (low | high << 32).to_bytes(LONGEST, "little")[: fd_data_length(flags)]
            target.request_fd(to, buffer, time, identifier, flags, data)
        else:
            target.request(to, buffer, time, identifier, flags, low, high)
