"""Frame logs in the format of `candump -L`, which can-utils, python-can, cantools and SavvyCAN read.

One line per frame: `(seconds.microseconds) interface identifier#data`; three hexadecimal digits are a
standard identifier, eight an extended one; `#R` and a length is a remote frame. A CAN FD frame is
`identifier##` with one digit of flags (1: BRS, 2: ESI, 4: FDF, which older kernels do not set) and up to 64 bytes. An
error frame is written as identifier 20000080 (error flag of SocketCAN and its class "bus error") with the field of the
error in byte 3 (linux/can/error.h: the position of the violation, the same codes as in can_bus.frame).
Nanoseconds are cut to microseconds, the resolution of the format; the time is the receivers'.
"""

import pathlib
from collections.abc import Iterable, Iterator
from typing import Any

from ranger_sim.can_bus.fd_frame import LENGTHS, LONGEST, length_code
from ranger_sim.can_bus.frame import HIGHEST_EXTENDED, HIGHEST_STANDARD, LENGTH_CODE
from ranger_sim.can_bus.frame_bytes import data_of_words, words_of_data
from ranger_sim.foundation.events import FLAG_BRS, FLAG_ERROR, FLAG_ESI, FLAG_EXTENDED, FLAG_FD, FLAG_REMOTE
from ranger_sim.foundation.user_error import BusError

ERROR_FLAG = 0x20000000  # CAN_ERR_FLAG, linux/can.h
ERROR_BUS = 0x00000080  # CAN_ERR_BUSERROR, linux/can/error.h

FD_BRS, FD_ESI = 1, 2  # CANFD_BRS and CANFD_ESI, linux/can.h

Frame = tuple[int, int, int, int, int]  # time_ns, identifier, flags, lo, hi


def line_of_frame(interface: str, time_ns: int, identifier: int, flags: int, lo: int, hi: int) -> str:
    """One line of the log, with its line end."""
    seconds, rest = divmod(time_ns, 1_000_000_000)
    if flags & FLAG_ERROR:
        text = f"{ERROR_FLAG | ERROR_BUS:08X}#000000{lo & 0xFF:02X}00000000"
    else:
        name = f"{identifier:08X}" if flags & FLAG_EXTENDED else f"{identifier:03X}"
        if flags & FLAG_REMOTE:
            text = f"{name}#R{min(flags & LENGTH_CODE, 8)}"
        elif flags & FLAG_FD:
            shown = (FD_BRS if flags & FLAG_BRS else 0) | (FD_ESI if flags & FLAG_ESI else 0)
            text = f"{name}##{shown}{data_of_words(flags, lo, hi).hex().upper()}"
        else:
            text = f"{name}#{data_of_words(flags, lo, hi).hex().upper()}"
    return f"({seconds:010d}.{rest // 1000:06d}) {interface} {text}\n"


class CanFdError(ValueError):
    """A frame of CAN FD where the reader wants classic ones."""


class CandumpWriter:
    """Writes frames of one or more buses to a file. A context manager.

    UserError when the file cannot be opened, OSError when writing fails; the file always ends with a whole line.
    `frames` counts the lines.
    """

    def __init__(self, path: str | pathlib.Path) -> None:
        self.path = pathlib.Path(path)
        self.frames = 0
        try:
            # unbuffered: the output of a killed program is kept, and a full disk is detected at once
            self.file = self.path.open("wb", buffering=0)
        except OSError as error:
            raise BusError(f"{self.path}: the frame log cannot be written ({error.strerror})") from None

    def __enter__(self) -> "CandumpWriter":
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def close(self) -> None:
        """Finish the file."""
        self.file.close()

    def write(self, interface: str, frames: Iterable[Frame]) -> None:
        """Append frames (time_ns, identifier, flags, lo, hi), in the order of their times."""
        lines = [line_of_frame(interface, *frame) for frame in frames]
        rest = memoryview("".join(lines).encode("ascii"))
        end = self.file.tell()
        try:
            while rest:
                rest = rest[self.file.write(rest) :]
        except OSError:
            self.file.truncate(end)
            raise
        self.frames += len(lines)


def read_candump(path: str | pathlib.Path, fd: bool = False) -> Iterator[tuple[str, int, int, int, int, int]]:
    """(interface, time_ns, identifier, flags, lo, hi) per line; empty lines are skipped.

    A trailing R or T, as python-can writes it, is allowed. UserError names the file and the line for
    anything else, CAN FD included unless `fd`.
    """
    source = pathlib.Path(path)
    try:
        text = source.read_text(encoding="ascii")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not plain ASCII"
        raise BusError(f"{source}: the frame log cannot be read ({reason})") from None
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip():
            try:
                yield frame_of_line(line, fd)
            except ValueError as error:
                raise BusError(f"{source}:{number}: {error}") from None


def frame_of_line(line: str, fd: bool = False) -> tuple[str, int, int, int, int, int]:
    """One line of a log; ValueError describes its fault, CanFdError a frame of CAN FD unless `fd`."""
    parts = line.split()
    if len(parts) == 4 and parts[3] in ("R", "T"):
        del parts[3]
    if len(parts) != 3 or not (parts[0].startswith("(") and parts[0].endswith(")")):
        raise ValueError(f"not `(seconds.microseconds) interface identifier#data`: {line.strip()[:60]!r}")
    stamp, interface, frame = parts
    seconds, _, fraction = stamp[1:-1].partition(".")
    if not (_digits(seconds) and _digits(fraction) and len(fraction) <= 9):
        raise ValueError(f"time {stamp} is not (seconds.fraction) with at most nine decimals")
    time_ns = int(seconds) * 1_000_000_000 + int(fraction.ljust(9, "0"))
    name, mark, data = frame.partition("#")
    if not mark:
        raise ValueError(f"frame {frame[:40]!r} has no #")
    if data.startswith("#") and not fd:
        raise CanFdError(f"frame {frame[:40]!r} is CAN FD; these logs are classic CAN")
    if len(name) not in (3, 8) or not _hexadecimal(name):
        raise ValueError(f"identifier {name[:20]!r} is not three or eight hexadecimal digits")
    identifier = int(name, 16)
    flags = FLAG_EXTENDED if len(name) == 8 else 0
    if len(name) == 3 and identifier > HIGHEST_STANDARD:
        raise ValueError(f"identifier {name} is above 7FF")
    if len(name) == 8 and identifier & ERROR_FLAG:
        if not _hexadecimal(data or "0") or len(data) % 2 or len(data) > 16:
            raise ValueError(f"data {data[:40]!r} is not up to eight bytes in hexadecimal")
        content = bytes.fromhex(data).ljust(8, b"\0")
        return interface, time_ns, 0, FLAG_ERROR, content[3], 0
    if identifier > HIGHEST_EXTENDED:
        raise ValueError(f"identifier {name} is above 1FFFFFFF")
    if data.startswith("#"):
        return interface, time_ns, identifier, *_fd_content(flags, data[1:])
    if data[:1] in ("R", "r"):
        length = data[1:] or "0"
        if not _digits(length) or int(length) > 8:
            raise ValueError(f"length {length[:10]!r} of a remote frame is not 0 ... 8")
        return interface, time_ns, identifier, flags | FLAG_REMOTE | int(length), 0, 0
    if data and (not _hexadecimal(data) or len(data) % 2 or len(data) > 16):
        raise ValueError(f"data {data[:40]!r} is not up to eight bytes in hexadecimal")
    content = bytes.fromhex(data)
    lo, hi = words_of_data(content)
    return interface, time_ns, identifier, flags | len(content), lo, hi


def fd_words(flags: int, data: bytes) -> tuple[int, int, int]:
    """(flags, lo, hi) of a CAN FD frame. ValueError for a number of bytes that it does not have."""
    if len(data) not in LENGTHS:
        raise ValueError(f"{len(data)} bytes are not a length of a CAN FD frame")
    flags |= FLAG_FD | length_code(len(data))
    return flags, int.from_bytes(data[:4], "little"), int.from_bytes(data[4:], "little")


def _fd_content(flags: int, text: str) -> tuple[int, int, int]:
    """(flags, lo, hi) of what follows `##`: a digit of flags and the data."""
    if not _hexadecimal(text) or len(text) % 2 != 1 or len(text) > 1 + 2 * LONGEST:
        raise ValueError(f"data {text[:40]!r} are not a digit of flags and up to {LONGEST} bytes in hexadecimal")
    shown = int(text[0], 16)
    flags |= (FLAG_BRS if shown & FD_BRS else 0) | (FLAG_ESI if shown & FD_ESI else 0)
    return fd_words(flags, bytes.fromhex(text[1:]))


def _digits(text: str) -> bool:
    return text.isascii() and text.isdigit()


def _hexadecimal(text: str) -> bool:
    return all(letter in "0123456789abcdefABCDEF" for letter in text)
