"""Message sets from DBC files, for the response-time analysis."""

from __future__ import annotations

import dataclasses
import pathlib
from typing import TYPE_CHECKING

from ranger_sim.can_bus.bounds import Message, message
from ranger_sim.can_bus.fd_frame import LONGEST, length_code
from ranger_sim.foundation.events import FLAG_BRS, FLAG_EXTENDED, FLAG_FD
from ranger_sim.foundation.user_error import BusError

if TYPE_CHECKING:
    from cantools.database.can import Database
    from cantools.database.can import Message as CanMessage

LARGEST_PERIOD_MS = 10**9


def load(path: pathlib.Path) -> Database:
    """The database of a DBC file. UserError for a file that cannot be read or holds no CAN messages."""
    import cantools  # imported only here: half a second

    try:
        database = cantools.database.load_file(str(path), database_format="dbc", strict=False)
    except OSError as error:
        raise BusError(f"{path}: cannot be read: {error.strerror}") from None
    except Exception as error:  # a broken file makes cantools raise many types
        cause = " ".join(f"{type(error).__name__}: {error}".split())
        raise BusError(f"{path}: not a DBC file that cantools can read: {cause}") from None
    if not isinstance(database, cantools.database.can.Database):
        raise BusError(f"{path}: holds no CAN messages")
    return database


@dataclasses.dataclass(frozen=True)
class MessageSet:
    """Messages of a DBC file and the bit rates of their bus in bit/s; `data_bit_rate` 0: a classic one. `silent`: names
    of the messages without a cycle time."""

    messages: list[Message]
    bit_rate: int
    data_bit_rate: int
    silent: list[str]


def read_messages(path: pathlib.Path, bit_rate: int | None, data_bit_rate: int | None = None) -> MessageSet:
    """The messages of a DBC file.

    Period: GenMsgCycleTime, in ms; deadline the same; no jitter; every node sends its frames by priority. Bit rates: as
    given, else the file's attributes Baudrate and BaudrateCANFD; a data rate counts where a message is of CAN FD.
    BRS: the message's attribute CANFD_BRS, 1 where the file does not define it. BusError for a file that cannot be
    read, and for one with CAN FD messages and without a data rate.
    """
    database = load(path)
    rate = bit_rate if bit_rate is not None else bit_rate_of(database)
    if rate is None:
        raise BusError(f"{path}: has no bit rate (attribute Baudrate); give --bit-rate")
    data_rate = data_bit_rate if data_bit_rate is not None else bit_rate_of(database, "BaudrateCANFD")
    if data_rate is not None and data_rate < rate:
        raise BusError(f"{path}: data bit rate {data_rate} bit/s is below the bit rate {rate} bit/s")
    messages = []
    silent = []
    any_fd = False
    for one in database.messages:
        flags = flags_of(one, path)
        if flags & FLAG_FD and not data_rate:
            raise BusError(
                f"{path}: message {one.name} is of CAN FD, and the file has no data bit rate (attribute "
                "BaudrateCANFD); give --data-bit-rate"
            )
        any_fd = any_fd or bool(flags & FLAG_FD)
        period = one.cycle_time
        if not period or not 0 < period <= LARGEST_PERIOD_MS:
            silent.append(one.name)
            continue
        messages.append(message(one.name, one.frame_id, int(period * 1_000_000), flags))
    return MessageSet(messages, rate, (data_rate or 0) if any_fd else 0, silent)


def flags_of(one: CanMessage, path: pathlib.Path) -> int:
    """Flags of the frames of a message (length code and FLAG_*). BusError for one longer than any frame."""
    flags = FLAG_EXTENDED if one.is_extended_frame else 0
    if not one.is_fd and one.length <= 8:
        return flags | one.length
    if one.length > LONGEST:
        raise BusError(f"{path}: message {one.name} has {one.length} bytes; a CAN FD frame has at most {LONGEST}")
    switch = getattr((one.dbc.attributes if one.dbc else {}).get("CANFD_BRS"), "value", 1)
    return flags | FLAG_FD | length_code(one.length) | (FLAG_BRS if switch else 0)


def bit_rate_of(database: Database, name: str = "Baudrate") -> int | None:
    """The network's attribute Baudrate (of the data phase: BaudrateCANFD): bit/s, or kbit/s as many tools write it."""
    attributes = getattr(database.dbc, "attributes", None) or {}
    value = getattr(attributes.get(name), "value", None)
    if not isinstance(value, int | float) or value <= 0:
        return None
    return int(value * 1000) if value < 10_000 else int(value)  # no CAN bus is slower than 10 kbit/s
