"""Message sets from DBC files, for the response-time analysis."""

from __future__ import annotations

import pathlib
from typing import TYPE_CHECKING

from ranger_sim.can_bus.bounds import Message, message
from ranger_sim.foundation.events import FLAG_EXTENDED
from ranger_sim.foundation.user_error import BusError

if TYPE_CHECKING:
    from cantools.database.can import Database

LARGEST_PERIOD_MS = 10**9


def read_messages(path: pathlib.Path, bit_rate: int | None) -> tuple[list[Message], int, list[str]]:
    """(messages, bit rate in bit/s, names of those without a cycle time) of a DBC file.

    Period: GenMsgCycleTime, in ms; deadline the same; no jitter; every node sends its frames by priority. Bit rate: as
    given, else the file's attribute Baudrate. UserError for a file that cannot be read or is not classic CAN.
    """
    import cantools  # imported only here: half a second

    try:
        database = cantools.database.load_file(str(path), database_format="dbc", strict=False)
    except OSError as error:
        raise BusError(f"{path}: cannot be read: {error.strerror}") from None
    except Exception as error:  # a broken file makes cantools raise many types
        said = " ".join(f"{type(error).__name__}: {error}".split())
        raise BusError(f"{path}: not a DBC file that cantools can read: {said}") from None
    if not isinstance(database, cantools.database.can.Database):
        raise BusError(f"{path}: holds no CAN messages")
    rate = bit_rate if bit_rate is not None else _baudrate(database)
    if rate is None:
        raise BusError(f"{path}: says nothing of the bit rate (attribute Baudrate); give --bit-rate")
    messages = []
    silent = []
    for one in database.messages:
        if one.is_fd or one.length > 8:
            raise BusError(
                f"{path}: message {one.name} has {one.length} bytes: CAN FD is not analysed, only classic CAN"
            )
        period = one.cycle_time
        if not period or not 0 < period <= LARGEST_PERIOD_MS:
            silent.append(one.name)
            continue
        flags = one.length | (FLAG_EXTENDED if one.is_extended_frame else 0)
        messages.append(message(one.name, one.frame_id, int(period * 1_000_000), flags))
    return messages, rate, silent


def _baudrate(database: Database) -> int | None:
    """The network's attribute Baudrate: bit/s, or kbit/s as many tools write it."""
    attributes = getattr(database.dbc, "attributes", None) or {}
    value = getattr(attributes.get("Baudrate"), "value", None)
    if not isinstance(value, int | float) or value <= 0:
        return None
    return int(value * 1000) if value < 10_000 else int(value)  # no CAN bus is slower than 10 kbit/s
