"""Frames of the bus as messages of python-can, and back."""

import can

from ranger_sim.can_bus.frame import LENGTH_CODE, data_length
from ranger_sim.foundation.events import FLAG_ERROR, FLAG_EXTENDED, FLAG_REMOTE
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


def frame_of_message(message: can.Message) -> tuple[int, int, int, int]:
    """(identifier, flags, lo, hi) of a python-can message, ready for `Bus.request`.

    UserError for CAN FD, which these buses do not support. An error frame has FLAG_ERROR, identifier 0.
    """
    if message.is_fd:
        raise BusError(
            f"message {message.arbitration_id:#x}: CAN FD cannot be sent, the buses are classic CAN (8 bytes)"
        )
    if message.is_error_frame:
        return 0, FLAG_ERROR, 0, 0
    flags = message.dlc
    if message.is_extended_id:
        flags |= FLAG_EXTENDED
    if message.is_remote_frame:
        return message.arbitration_id, flags | FLAG_REMOTE, 0, 0
    lo, hi = words_of_data(bytes(message.data))
    return message.arbitration_id, flags, lo, hi


def data_of_words(flags: int, lo: int, hi: int) -> bytes:
    """The data bytes that a frame carries, 0 ... 8."""
    return (lo.to_bytes(4, "little") + hi.to_bytes(4, "little"))[: data_length(flags)]


def words_of_data(data: bytes) -> tuple[int, int]:
    """Up to eight data bytes as the words lo (bytes 0-3) and hi (bytes 4-7), little-endian."""
    padded = data.ljust(8, b"\0")
    return int.from_bytes(padded[:4], "little"), int.from_bytes(padded[4:8], "little")
