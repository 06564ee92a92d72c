"""A node of python-can on a machine's own bus, in whose `recv` the machine's time passes: for tests with a driver.

    with LockstepBus(machine) as bus:
        bus.send(can.Message(arbitration_id=0x000, data=[1, 5], is_extended_id=False))
        print(bus.recv(0.1))  # at most 0.1 s of the machine's time

No wall clock and no thread: the same program gives the same bytes.
"""

from typing import Any

import can

from ranger_sim.can_bus.edge.messages import frame_of_message, message_of_frame
from ranger_sim.can_bus.edge.taps import FULL, NOT_ON_BUS, RECEIVED, Taps, fault_of_frame
from ranger_sim.foundation.user_error import BusError, UserError, unknown

LEAST_NS = 1000  # a time that `run_for` certainly passes
SLICE_NS = 100_000  # virtual time between two looks at the bus; chosen by us: two frames of 1 Mbit/s


class LockstepBus(can.BusABC):
    """One more controller on bus `bus` of a machine in this process. Stamps are the machine's time since power-up.

    On a CAN FD bus of the machine it sends and receives messages of both kinds.
    """

    def __init__(self, machine: Any, bus: str = "can1", **options: Any) -> None:
        buses = {each.name: each for each in machine.buses}
        if bus not in buses:
            raise BusError(unknown("bus", bus, buses))
        self.machine = machine
        self.is_fd = bool(buses[bus].is_fd)
        self._can_protocol = can.CanProtocol.CAN_FD if self.is_fd else can.CanProtocol.CAN_20
        self.taps = Taps(buses[bus])
        self.taps.time = machine.loop.time
        self.tap = self.taps.add("driver")
        self.channel_info = f"{bus} of a machine in lockstep"
        machine.attach(self)
        super().__init__(channel=bus, **options)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Queue a message; it is sent while time passes. can.CanOperationError for one that the bus does not take."""
        try:
            frame = frame_of_message(msg, self.is_fd)
        except UserError as fault:
            raise can.CanOperationError(str(fault)) from None
        text = fault_of_frame(*frame, fd=self.is_fd)
        if text:
            raise can.CanOperationError(text)
        answer = self.tap.offer(*frame)
        if answer in (FULL, NOT_ON_BUS):
            raise can.CanOperationError("the transmit queue is full" if answer == FULL else "the controller is off")
        self.taps.poll(self.machine.loop.time)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """The oldest message that the filters let pass, after up to `timeout` s of the machine's time.

        None when none has come by then, or when the machine can go no further.
        """
        # python-can's own loop measures the time-out by the wall clock
        loop = self.machine.loop
        end_ns = None if timeout is None else loop.time + round(timeout * 1e9)
        while True:
            self.taps.poll(loop.time)
            while self.tap.events:
                kind, time_ns, identifier, flags, lo, hi = self.tap.events.pop(0)
                if kind == RECEIVED:
                    stamp_ns = time_ns - self.machine.start_ns
                    message = message_of_frame(stamp_ns, identifier, flags, lo, hi, self.channel_info)
                    if self._matches_filters(message):
                        return message
            if self.machine.ended or (end_ns is not None and loop.time >= end_ns):
                return None
            left_ns = SLICE_NS if end_ns is None else min(SLICE_NS, end_ns - loop.time)
            self.machine.run_for(max(LEAST_NS, left_ns) * 1e-9)

    # --- an external connection of the machine -----------------------------------------------------------------

    def poll(self, now_ns: int) -> int:
        """Fill free transmit buffers; returns the time of the next poll."""
        self.taps.poll(now_ns)
        return now_ns + SLICE_NS

    def filenos(self) -> list[int]:
        """Nothing to wait for."""
        return []

    def close(self) -> None:
        """Leave the bus, with the machine."""
        self.shutdown()

    def shutdown(self) -> None:
        """Leave the bus."""
        if not self._is_shutdown:
            self.taps.remove(self.tap)
        super().shutdown()
