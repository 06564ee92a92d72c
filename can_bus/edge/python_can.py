"""The python-can interface `ranger_sim`: can.Bus(interface="ranger_sim", channel="can1").

It attaches to a running robot (`ranger-sim up`) or a host of private buses (`ranger-sim bus`) of this machine. Where
none runs, it opens a private bus of this process with our arbitration, bit timing, error frames and bus-off.
"""

import logging
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, TypeVar

import can
import can.bus
from can.broadcastmanager import CyclicSendTaskABC, ThreadBasedCyclicSendTask

from ranger_sim.can_bus.edge.attach_records import DEFAULT_NAME, names_running
from ranger_sim.can_bus.edge.attached_link import AttachedLink, channels_of
from ranger_sim.can_bus.edge.links import RECEIVE_QUEUE, LinkError
from ranger_sim.can_bus.edge.messages import frame_of_message, message_of_frame
from ranger_sim.can_bus.edge.paced import DEFAULT_BITRATE, DEFAULT_DATA_BITRATE, PacedBus, speed_of
from ranger_sim.can_bus.edge.private_link import PrivateBus, PrivateLink
from ranger_sim.can_bus.edge.taps import (
    ERROR_ACTIVE,
    ERROR_PASSIVE,
    LISTENING,
    OFF,
    SENT,
    Event,
    fault_of_frame,
)
from ranger_sim.can_bus.frame import LENGTH_CODE, data_length
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.events import FLAG_ERROR, FLAG_EXTENDED, FLAG_FD, FLAG_REMOTE
from ranger_sim.foundation.user_error import BusError, UserError

log = logging.getLogger("can.ranger_sim")

DETECTION_PATIENCE_S = 1.0  # chosen by us: python-can gives all interfaces together five
STATES = {
    ERROR_ACTIVE: can.BusState.ACTIVE,
    ERROR_PASSIVE: can.BusState.PASSIVE,
    LISTENING: can.BusState.PASSIVE,
    OFF: can.BusState.ERROR,
}
TRUE_WORDS = ("1", "true", "yes", "on")

T = TypeVar("T")

_private: dict[str, PrivateBus] = {}  # the private buses of this process
_private_lock = threading.Lock()


class RangerSimBus(can.BusABC):
    """One controller on an emulated CAN bus.

    channel: "can1", or "NAME/can1" for the robot or host of that name. robot: its name (default "ranger", whose absence
    is not an error). private: True opens a private bus even if a robot runs. bitrate: of a private bus (default 1
    Mbit/s); attached, it must be the bus's own. speed: 1.0 by the wall clock, "max" as fast as frames are sent; private
    only, as are bit_error_rate (0 ... 0.1 per bit), seed of the disturbances, and acknowledge: True adds a silent node
    that acknowledges every frame, for a bus with one user. receive_own_messages: also receive sent messages, once they
    are on the bus whole. listen_only: receive without acknowledging. rx_queue_size: frames kept for the reader; later
    ones are dropped, counted (`statistics`) and reported by an error frame.

    fd: True makes the private bus CAN FD, with data_bitrate (default 2 Mbit/s, or the nominal rate where that is
    higher), fd_non_iso as before ISO 11898-1:2015, and the sample points of timing, a can.BitTimingFd. On such a bus a
    client without fd is a classic node, which answers FD frames with error frames. Attached, fd needs a CAN FD bus
    there (`ranger-sim bus --data-bitrate`), and data_bitrate and fd_non_iso must be its own.

    Stamps of a robot are its own time since power-up, those of other buses seconds since 1970.
    """

    def __init__(
        self,
        channel: Any = "can1",
        can_filters: Any = None,
        *,
        robot: str | None = None,
        private: bool | str = False,
        bitrate: int | str | None = None,
        timing: Any = None,
        speed: float | str | None = None,
        bit_error_rate: float | str | None = None,
        seed: int | str | None = None,
        acknowledge: bool | str = False,
        receive_own_messages: bool | str = False,
        listen_only: bool | str = False,
        rx_queue_size: int | str = RECEIVE_QUEUE,
        fd: bool | str = False,
        data_bitrate: int | str | None = None,
        fd_non_iso: bool | str = False,
        **kwargs: Any,
    ) -> None:
        name, slash, bus_name = str(channel).rpartition("/")
        named = bool(slash or robot)
        name = name or robot or DEFAULT_NAME
        self._wanted_private: dict[str, Any] = {"speed": speed, "bit_error_rate": bit_error_rate, "seed": seed}
        self._wanted_private["acknowledge"] = True if _truth(acknowledge) else None
        own, listen = _truth(receive_own_messages), _truth(listen_only)
        try:
            if not bus_name:
                raise BusError("ranger_sim: no channel was given (for example can1)")
            self._fd = _truth(fd) or isinstance(timing, can.BitTimingFd)
            self._wanted_fd: dict[str, Any] = {}
            if isinstance(timing, can.BitTimingFd):
                bitrate, data_bitrate = timing.nom_bitrate, timing.data_bitrate
                points = timing.nom_sample_point / 100.0, timing.data_sample_point / 100.0
                self._wanted_fd["sample_points"] = points
            elif timing is not None:
                bitrate = timing.bitrate
            if not self._fd and (data_bitrate is not None or _truth(fd_non_iso)):
                raise BusError(f"ranger_sim {channel}: data_bitrate and fd_non_iso need fd=True")
            if data_bitrate is not None:
                self._wanted_fd["data_bitrate"] = _whole("data_bitrate", data_bitrate, 1000, 100_000_000)
            self._wanted_fd["iso"] = not _truth(fd_non_iso)
            rate = None if bitrate is None else _whole("bitrate", bitrate, 1000, 100_000_000)
            limit = _whole("rx_queue_size", rx_queue_size, 1, 100_000_000)
            if named and _truth(private):
                raise BusError(
                    f"ranger_sim {channel}: private=True and the name of a robot, {name!r}, exclude each other"
                )
            link: AttachedLink | PrivateLink | None = None
            if not _truth(private):
                link = self._attached(name, bus_name, named, rate, listen, own, limit)
            self._link = link or self._opened(bus_name, rate, listen, own, limit)
        except (UserError, ValueError, TypeError) as fault:
            raise can.CanInitializationError(str(fault)) from None
        self.channel = channel  # as given: python-can's users compare messages with it
        self.bitrate = self._link.bitrate
        attached = isinstance(self._link, AttachedLink)
        self.channel_info = (
            f"ranger_sim {self._link.label}, {self.bitrate} bit/s"
            if attached
            else f"ranger_sim private bus {bus_name} of this process, {self.bitrate} bit/s "
            "(to share one between processes: ranger-sim bus)"
        )
        if self._fd:
            self.channel_info += f", CAN FD, {self._link.data_bitrate} bit/s"
            protocol = can.CanProtocol.CAN_FD if self._wanted_fd["iso"] else can.CanProtocol.CAN_FD_NON_ISO
            self._can_protocol = protocol
        super().__init__(channel=channel, can_filters=can_filters, **kwargs)

    def _attached(
        self, name: str, channel: str, named: bool, rate: int | None, listen: bool, own: bool, limit: int
    ) -> AttachedLink | None:
        """A place on a running robot's bus; None when none runs and no particular one was requested."""
        try:
            link = AttachedLink(name, channel, listen, own, limit, self._fd)
        except FileNotFoundError:
            if not named:
                return None
            running = ", ".join(names_running()) or "none"
            raise BusError(
                f"ranger_sim: no robot or bus host named {name!r} is running (running: {running}); "
                "start `ranger-sim up` or `ranger-sim bus`"
            ) from None
        except UserError:
            if not named and not names_running():
                return None  # a system without abstract sockets
            raise
        fault = ""
        data_rate = self._wanted_fd.get("data_bitrate", link.data_bitrate)
        if rate is not None and rate != link.bitrate:
            fault = f"runs at {link.bitrate} bit/s, not at {rate}"
        elif self._fd and data_rate != link.data_bitrate:
            fault = f"runs at a data bit rate of {link.data_bitrate} bit/s, not at {data_rate}"
        elif self._fd and self._wanted_fd["iso"] != link.iso:
            fault = f"runs with fd_non_iso {not link.iso}"
        given = [option for option, value in self._wanted_private.items() if value is not None]
        if given:
            fault = f"is a bus of another process: {', '.join(given)} can only be set where that is started"
        if fault:
            link.close()
            raise BusError(f"ranger_sim: {name}/{channel} {fault} (private=True opens a bus of your own)")
        return link

    def _opened(self, channel: str, rate: int | None, listen: bool, own: bool, limit: int) -> PrivateLink:
        """A place on the private bus of that name in this process, which is opened if needed."""
        wanted = self._wanted_private
        speed = None if wanted["speed"] is None else speed_of(wanted["speed"])
        errors = None if wanted["bit_error_rate"] is None else float(wanted["bit_error_rate"])
        with _private_lock:
            bus = _private.get(channel)
            if bus is None or not bus.links:
                nominal = DEFAULT_BITRATE if rate is None else rate
                options = {"data_bitrate": max(DEFAULT_DATA_BITRATE, nominal)} | self._wanted_fd if self._fd else {}
                paced = PacedBus(
                    channel,
                    nominal,
                    1.0 if speed is None else speed,
                    int(wanted["seed"] or 0),
                    errors or 0.0,
                    **options,
                )
                bus = _private[channel] = PrivateBus(paced)
            if self._fd and not bus.paced.bus.is_fd:
                raise BusError(f"ranger_sim: the private bus {channel} is open as classic CAN, not as CAN FD")
            if self._fd and self._wanted_fd["iso"] != bus.paced.bus.iso:
                raise BusError(f"ranger_sim: the private bus {channel} is open with fd_non_iso {not bus.paced.bus.iso}")
            for what, want, have in (
                ("bitrate", rate, bus.paced.bitrate),
                ("speed", speed, bus.paced.speed),
                ("bit_error_rate", errors, bus.paced.bit_error_rate),
                ("data_bitrate", self._wanted_fd.get("data_bitrate"), bus.paced.bus.data_bitrate),
            ):
                if want is not None and want != have:
                    raise BusError(
                        f"ranger_sim: the private bus {channel} is open with {what} {have:.12g}, not {want:.12g}: the "
                        "first to open it sets it"
                    )
            if wanted["acknowledge"]:
                with bus.lock:
                    bus.paced.add_acknowledger()
            return PrivateLink(bus, channel, listen, own, limit, self._fd)

    # ---- methods required by python-can

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Queue a message; while the queue is full, wait up to `timeout` s (None: as long as the bus carries frames).

        can.CanOperationError: no place in time, no node to acknowledge, bus-off, listening only, the robot has gone, or
        a message that the bus does not have: CAN FD without fd=True, or a remote frame of CAN FD. An FD message is
        filled up with zeros to the next length that CAN FD has.
        """
        try:
            if msg.is_error_frame:
                raise LinkError(f"{self._link.label}: an error frame cannot be sent")
            frame = frame_of_message(msg, self._fd)
            fault = fault_of_frame(*frame, self._fd)
            if fault:
                raise LinkError(f"{self._link.label}: {fault}")
            self._link.send(*frame, timeout)
        except (LinkError, UserError) as fault_of_link:
            raise can.CanOperationError(str(fault_of_link)) from None

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """The oldest message, waiting up to `timeout` s (None: without limit).

        None when none arrives in time, or, once the time is over or after one second, when the bus is shut down
        meanwhile. can.CanOperationError when it was shut down before, or when the robot has gone.
        """
        # python-can's own loop would call a bus again that has been shut down meanwhile
        message, _ = self._recv_internal(timeout)
        if message is not None:
            can.bus.LOG.log(self.RECV_LOGGING_LEVEL, "Received: %s", message)
        return message

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        end = None if timeout is None or self._filters is None else wallclock.monotonic_s() + timeout
        while True:
            try:
                event = self._link.receive(timeout)
            except LinkError as fault:
                raise can.CanOperationError(str(fault)) from None
            if event is None:
                return None, False
            message = message_of_event(event, self.channel)
            # filtered here: python-can's own loop stops after one message that does not match when called without
            # waiting
            if self._filters is None or self._matches_filters(message):
                return message, True
            if end is not None:
                timeout = max(end - wallclock.monotonic_s(), 0.0)

    def fileno(self) -> int:
        """A descriptor to wait on, for asyncio and select."""
        return self._asked(self._link.fileno)

    def flush_tx_buffer(self) -> None:
        """Drop the frames that wait to be sent."""
        self._asked(self._link.flush)

    def shutdown(self) -> None:
        """Leave the bus. Queued frames are still sent while another node is there to receive them."""
        was_open = not self._is_shutdown
        super().shutdown()  # in any case, as python-can requires of its interfaces
        if was_open:
            self._link.close()

    @property
    def state(self) -> can.BusState:
        """ACTIVE; PASSIVE when error passive or listening only; ERROR when bus-off."""
        return STATES[self._link.present_state()]

    @state.setter
    def state(self, new_state: can.BusState) -> None:
        """ACTIVE takes part again, also after bus-off; PASSIVE receives without acknowledging."""
        if new_state == can.BusState.ACTIVE:
            self._asked(self._link.activate)
        elif new_state == can.BusState.PASSIVE:
            self._asked(self._link.listen)
        else:
            raise ValueError("a controller cannot be ordered into BusState.ERROR")

    @staticmethod
    def _detect_available_configs() -> list[Any]:
        """Every channel of every robot and bus host that runs on this machine."""
        found = []
        for name in names_running():
            with suppress(UserError, OSError):
                channels = channels_of(name, DETECTION_PATIENCE_S)
                found += [{"interface": "ranger_sim", "channel": f"{name}/{channel}"} for channel in channels]
        return found

    def _send_periodic_internal(
        self,
        msgs: Sequence[can.Message] | can.Message,
        period: float,
        duration: float | None = None,
        autostart: bool = True,
        modifier_callback: Callable[[can.Message], None] | None = None,
    ) -> CyclicSendTaskABC:
        """python-can's task with a thread; its last message may be sent when the bus is shut down already."""
        if not hasattr(self, "_lock_send_periodic"):
            self._lock_send_periodic = threading.Lock()
        sender: Any = _WhileOpen(self)
        return ThreadBasedCyclicSendTask(
            sender, self._lock_send_periodic, msgs, period, duration, None, autostart, modifier_callback
        )

    # ---- in addition to python-can's methods

    def statistics(self) -> dict[str, int]:
        """Counts of frames: sent, dropped (ours, never sent), lost (not read here in time), missed (not taken
        from the other process in time), and the controller's two error counters."""
        self._link.present_state()
        link = self._link
        return {
            "sent": link.sent_frames,
            "dropped": link.dropped_frames,
            "lost": link.lost_frames,
            "missed": link.missed_frames,
            "transmit_errors": link.counters[0],
            "receive_errors": link.counters[1],
        }

    def inject_errors(self, count: int, position: int = -1) -> None:
        """Corrupt the next `count` frames of a private bus at a bit (`can_bus.bus.Bus.inject_errors`)."""
        if not isinstance(self._link, PrivateLink):
            raise can.CanOperationError(f"{self._link.label}: errors can be injected on a private bus only")
        with self._link.changed:
            self._link.bus.paced.bus.inject_errors(count, position)
            self._link.bus.pass_time()

    @staticmethod
    def _asked(action: Callable[[], T]) -> T:
        try:
            return action()
        except LinkError as fault:
            raise can.CanOperationError(str(fault)) from None


class _WhileOpen:
    """A bus for a task of python-can: a message sent after the shut-down is not an error."""

    def __init__(self, bus: RangerSimBus) -> None:
        self.bus = bus

    def send(self, msg: can.Message) -> None:
        try:
            self.bus.send(msg)
        except can.CanOperationError:
            if not self.bus._is_shutdown:
                raise


def message_of_event(event: Event, channel: Any) -> can.Message:
    """A python-can message of a frame from a link."""
    kind, time_ns, identifier, flags, lo, hi = event
    if flags & FLAG_ERROR:
        return can.Message(
            timestamp=time_ns * 1e-9,
            arbitration_id=identifier,
            is_extended_id=False,
            is_error_frame=True,
            dlc=8,
            data=(lo | hi << 32).to_bytes(8, "little"),
            channel=channel,
        )
    remote = bool(flags & FLAG_REMOTE)
    if flags & FLAG_FD:
        return message_of_frame(time_ns, identifier, flags, lo, hi, channel, kind != SENT)
    return can.Message(
        timestamp=time_ns * 1e-9,
        arbitration_id=identifier,
        is_extended_id=bool(flags & FLAG_EXTENDED),
        is_remote_frame=remote,
        dlc=min(flags & LENGTH_CODE, 8),
        data=None if remote else (lo | hi << 32).to_bytes(8, "little")[: data_length(flags)],
        channel=channel,
        is_rx=kind != SENT,
    )


def _truth(value: Any) -> bool:
    """True and its spellings in configuration files and on command lines."""
    return value.strip().lower() in TRUE_WORDS if isinstance(value, str) else bool(value)


def _whole(name: str, value: Any, low: int, high: int) -> int:
    """A whole number in its limits; UserError otherwise."""
    try:
        number = int(value)
    except (TypeError, ValueError):
        number = low - 1
    if not low <= number <= high:
        raise BusError(f"ranger_sim: {name} {value!r} is not a whole number in {low} ... {high}")
    return number
