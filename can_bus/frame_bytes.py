"""The data of a frame as bytes, and as the two words that a message of the bus carries; without python-can.

A CAN FD frame of more than eight bytes has all bytes from the fifth on in its word `hi`.
"""

from ranger_sim.can_bus.fd_frame import fd_data_length
from ranger_sim.can_bus.frame import data_length
from ranger_sim.foundation.events import FLAG_FD


def data_of_words(flags: int, lo: int, hi: int) -> bytes:
    """The data bytes that a frame carries, 0 ... 8; CAN FD 0 ... 64."""
    if flags & FLAG_FD:
        return (lo | hi << 32).to_bytes(64, "little")[: fd_data_length(flags)]
    return (lo.to_bytes(4, "little") + hi.to_bytes(4, "little"))[: data_length(flags)]


def words_of_data(data: bytes) -> tuple[int, int]:
    """Up to eight data bytes as the words lo (bytes 0-3) and hi (bytes 4-7), little-endian."""
    padded = data.ljust(8, b"\0")
    return int.from_bytes(padded[:4], "little"), int.from_bytes(padded[4:8], "little")
