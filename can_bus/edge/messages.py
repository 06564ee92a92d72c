"""Frames of the bus as messages of python-can, and back."""

import can

from ranger_sim.can_bus.fd_frame import fd_data_length, length_code, padded
from ranger_sim.can_bus.frame import LENGTH_CODE
from ranger_sim.can_bus.frame_bytes import data_of_words, words_of_data
from ranger_sim.foundation.events import FLAG_BRS, FLAG_ERROR, FLAG_ESI, FLAG_EXTENDED, FLAG_FD, FLAG_REMOTE
from ranger_sim.foundation.user_error import BusError


def message_of_frame(
    time_ns: int,
    identifier: int,
    flags: int,
    lo: int,
    hi: int,
    channel: str | None = None,
    is_rx: bool = True,
) -> can.Message:
    """A python-can message of a frame; `time_ns` becomes its timestamp in seconds.

    A frame with FLAG_ERROR becomes an error frame without content, as python-can's readers return it.
    """
    if flags & FLAG_ERROR:
        return can.Message(timestamp=time_ns * 1e-9, is_error_frame=True, channel=channel, is_rx=is_rx)
    remote = bool(flags & FLAG_REMOTE)
    if flags & FLAG_FD:
        return can.Message(
            timestamp=time_ns * 1e-9,
            arbitration_id=identifier,
            is_extended_id=bool(flags & FLAG_EXTENDED),
            dlc=fd_data_length(flags),
            data=data_of_words(flags, lo, hi),
            channel=channel,
            is_rx=is_rx,
            is_fd=True,
            bitrate_switch=bool(flags & FLAG_BRS),
            error_state_indicator=bool(flags & FLAG_ESI),
            check=True,
        )
    # python-can holds classic lengths to 8; codes above mean eight bytes
    length = min(flags & LENGTH_CODE, 8)
    data = None if remote else data_of_words(flags, lo, hi)
    return can.Message(
        timestamp=time_ns * 1e-9,
        arbitration_id=identifier,
        is_extended_id=bool(flags & FLAG_EXTENDED),
        is_remote_frame=remote,
        dlc=length,
        data=data,
        channel=channel,
        is_rx=is_rx,
        check=True,
    )


def frame_of_message(message: can.Message, fd: bool = False) -> tuple[int, int, int, int]:
    """(identifier, flags, lo, hi) of a python-can message.

    UserError for a CAN FD message unless `fd`; it is filled up with zeros to the next length that CAN FD has. An error
    frame has FLAG_ERROR, identifier 0.
    """
    if message.is_fd and not fd:
        raise BusError(f"message {message.arbitration_id:#x}: CAN FD cannot be sent, the bus is classic CAN (8 bytes)")
    if message.is_fd and not message.is_error_frame:
        if message.is_remote_frame:
            raise BusError(f"message {message.arbitration_id:#x}: CAN FD has no remote frames")
        try:
            data = padded(bytes(message.data))
        except ValueError as fault:
            raise BusError(f"message {message.arbitration_id:#x}: {fault}") from None
        flags = FLAG_FD | length_code(len(data)) | (FLAG_EXTENDED if message.is_extended_id else 0)
        flags |= (FLAG_BRS if message.bitrate_switch else 0) | (FLAG_ESI if message.error_state_indicator else 0)
        return message.arbitration_id, flags, int.from_bytes(data[:4], "little"), int.from_bytes(data[4:], "little")
    if message.is_error_frame:
        return 0, FLAG_ERROR, 0, 0
    flags = message.dlc
    if message.is_extended_id:
        flags |= FLAG_EXTENDED
    if message.is_remote_frame:
        return message.arbitration_id, flags | FLAG_REMOTE, 0, 0
    lo, hi = words_of_data(bytes(message.data))
    return message.arbitration_id, flags, lo, hi
