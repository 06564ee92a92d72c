"""Recorded frames from any readable file, with a count of its lines.

python-can reads .mf4, .asc, .blf, .trc, .csv and .db; candump's .log and screen output, BUSMASTER's .log, SavvyCAN's
.csv and packet captures (pcap.py) are read here. A library's reader skips unknown lines, so its frames are compared
with the lines or objects of the file.
"""

import calendar
import contextlib
import functools
import io
import itertools
import logging
import pathlib
import re
import zlib
from collections.abc import Callable, Iterable, Iterator

import can

from ranger_sim.can_bus.edge import log_kinds, pcap
from ranger_sim.can_bus.edge.candump import CanFdError, fd_words, frame_of_line
from ranger_sim.can_bus.edge.messages import frame_of_message
from ranger_sim.can_bus.fd_frame import LENGTHS
from ranger_sim.can_bus.frame_bytes import words_of_data
from ranger_sim.foundation.events import FLAG_ERROR, FLAG_EXTENDED, FLAG_REMOTE
from ranger_sim.foundation.user_error import BusError, DataError, UserError

logging.getLogger("can.io").addHandler(logging.NullHandler())  # a frame that is passed over is counted here
Frame = tuple[str, int, int, int, int, int]  # bus, time_ns, identifier, flags (length in the low four bits), lo, hi
PYTHON_CAN_HEADER = "timestamp,arbitration_id,extended,remote,error,dlc,data"
SAVVYCAN_HEADER = "time stamp,id,extended,"
BUSMASTER_HEADER = "***BUSMASTER"
CONTAINER, CONTAINER_HEAD = 10, 32  # type and bytes of its head, of an object in a BLF file
SMALL_CONTAINER, LARGEST_CONTAINER = 1 << 16, 1 << 28  # bytes; deflate makes at most a thousand of one
SECOND_NS = 1_000_000_000
WORD_EXTENDED, WORD_REMOTE, WORD_ERROR = 1 << 31, 1 << 30, 1 << 29  # of SocketCAN's identifiers


class RecordedFrames:
    """The frames of a recording, error frames left out. Iterating raises UserError for an unreadable file.

    `wants_fd`: return CAN FD frames as such; otherwise those of up to eight bytes become classic, longer ones are lost.
    Afterwards `read` is the number of frames in the file, or as stated by it, including error frames, and `losses` are
    the frames that were not returned: (reason, count, position of the first); reason "cut_off", "not_frames" or
    "can_fd".
    """

    def __init__(self, source: pathlib.Path, wants_fd: bool = False) -> None:
        self.source = source
        self.wants_fd = wants_fd
        self.read = 0
        self.losses: list[tuple[str, int, str]] = []
        self.fd = 0

    def __iter__(self) -> Iterator[Frame]:
        self.read, self.losses, self.fd = 0, [], 0
        try:
            for frame in _opened(self):
                if not frame[3] & FLAG_ERROR:
                    yield frame
            self.lose("can_fd", self.fd, "")
        except UserError:
            raise
        except Exception as error:  # readers of formats raise many types
            cause = error.strerror if isinstance(error, OSError) and error.strerror else error
            text = f"{self.source}: the recording cannot be read ({cause or type(error).__name__})"
            raise DataError(text) from None

    def is_too_long(self, message: can.Message) -> bool:
        """True for a frame of CAN FD that has to become classic and has more than eight bytes, which is counted."""
        message.is_fd = message.is_fd or len(message.data) > 8  # .csv and .db have no mark for it
        if message.is_fd and message.is_remote_frame:  # the reader of .asc calls every frame without data one
            message.is_fd, message.is_remote_frame = message.dlc == 0, message.dlc > 0
        if self.wants_fd:
            return False
        too_long = message.is_fd and len(message.data) > 8
        self.fd += too_long
        message.is_fd = message.bitrate_switch = message.error_state_indicator = False
        return too_long

    def ledger(self) -> dict[str, int]:
        """What became of the file's frames: {"frames": returned, or error frames; "left out: reason": number}."""
        lost = sum(count for _, count, _ in self.losses)
        return {"frames": self.read - lost} | {f"left out: {reason}": count for reason, count, _ in self.losses}

    def lose(self, reason: str, count: int, where: str) -> None:
        """Record frames that are in the file and were not returned."""
        if count > 0:
            self.losses.append((reason, count, where))


def read_log(path: str | pathlib.Path, fd: bool = False) -> RecordedFrames:
    """(channel, time_ns, identifier, flags, lo, hi) of every frame in a recording, while iterating over it.

    Times are as in the file, or since its first frame where the format defines them so. `fd`: with CAN FD frames, whose
    `hi` holds all bytes from the fifth on; else the recording is read as one of a classic bus (`RecordedFrames`).
    """
    return RecordedFrames(pathlib.Path(path), fd)


def _opened(log: RecordedFrames) -> Iterator[Frame]:
    if not log.source.is_file():
        raise FileNotFoundError(2, "no such file")  # sqlite would make one
    kind = log_kinds.kind(log.source)
    if kind in (log_kinds.CANDUMP, log_kinds.SCREEN, log_kinds.BUSMASTER):
        return _candump_or_busmaster(log)
    if kind in (log_kinds.PYTHON_CAN, log_kinds.SAVVYCAN) or log.source.suffix.lower() == ".csv":
        return _csv(log)
    if kind == log_kinds.PCAP:
        return _captured(log)
    if kind == log_kinds.ASC:
        return _by_lines(log, can.ASCReader, _asc_lines(log), ASC_FRAME)
    if kind == log_kinds.TRC:
        return _by_lines(log, _trc_messages, _text_lines(log), TRC_FRAME)
    return _by_python_can(log)


def _frame(message: can.Message) -> Frame:
    channel = "" if message.channel is None else str(message.channel)
    return channel, round(message.timestamp * 1e9), *frame_of_message(message, fd=True)


# --- by python-can ------------------------------------------------------------------------------------------------

# stamp and bus, then an identifier (a line may be cut off after it), a name, or an error; not a request to send
ASC_FRAME = re.compile(
    r"\s*\d+[.,]\d+\s+(?:\d+\s+(?:[0-9A-F]+x?\b(?!:)(?!.*\bTxRq\b)|\S+\s+(?:Tx|Rx)\b|ErrorFrame)|CANFD\s+\d)",
    re.IGNORECASE,
)
ASC_EVENT = re.compile(r"(\s*)(\d+[.,]\d+)(\s.*)", re.DOTALL)
ASC_SYMBOLIC = re.compile(r"\s*\d+[.,]\d+\s+\d+\s+(?![0-9A-Fa-f]+x?\s)(\S+)\s+(?:Tx|Rx)\b", re.IGNORECASE)
ASC_HEADER = re.compile(r"\s*(?:date\s|base\s|//)", re.IGNORECASE)
# number, offset, then in any version a type that carries data, or (1.0) an identifier and its length
TRC_FRAME = re.compile(
    r"\s*\d+\)?\s+[\d.]+\s+(?:(?:\d+\s+)?(?:Rx|Tx)\s|(?:DT|FD|FB|FE|BI|RR)\s|(?!FFFFFFFF)[0-9A-Fa-f]{4,8}\s+\d)"
)


def _by_python_can(log: RecordedFrames) -> Iterator[Frame]:
    """Formats whose reader takes a path."""
    if log_kinds.kind(log.source) == log_kinds.BLF:
        _refuse_bomb(log.source)
    with can.LogReader(log.source) as reader:
        for message in reader:
            log.read += 1
            if not log.is_too_long(message):
                yield _frame(message)
        if isinstance(reader, can.BLFReader):
            _count_blf(log, reader)


def _refuse_bomb(path: pathlib.Path) -> None:
    """UserError for a container that unpacks to more than any program writes: the reader has no limit."""
    limit = LARGEST_CONTAINER
    with path.open("rb") as file:
        place = int.from_bytes(file.read(8)[4:8], "little")
        while True:
            file.seek(place)
            head = file.read(CONTAINER_HEAD)
            if len(head) < 16 or head[:4] != b"LOBJ":
                return
            size, kind = (int.from_bytes(head[at : at + 4], "little") for at in (8, 12))
            if kind == CONTAINER and size > SMALL_CONTAINER and head[16:18] != b"\0\0":
                unpacker = zlib.decompressobj()
                with contextlib.suppress(zlib.error):  # a broken one is reported by the reader
                    if len(unpacker.decompress(file.read(size - CONTAINER_HEAD), limit)) == limit:
                        raise BusError(f"{path}: the container at byte {place} unpacks to more than {limit} bytes")
            place += size + size % 4
            if not size:
                return


def _count_blf(log: RecordedFrames, reader: can.BLFReader) -> None:
    """Compare the size stated in a BLF file with the actual one: the reader does not report a file that was cut off."""
    missing = reader.object_count - log.read
    there = log.source.stat().st_size
    if there < reader.file_size:
        where = f"behind byte {there} of {reader.file_size}"
    elif reader._tail:  # a container that ends within an object
        where = f"behind byte {there}"
    else:
        return
    log.read += max(missing, 1)
    log.lose("cut_off", max(missing, 1), where)


def _captured(log: RecordedFrames) -> Iterator[Frame]:
    """Frames of a packet capture of SocketCAN."""
    broken, first = 0, 0
    with log.source.open("rb") as file:
        try:
            for packet in pcap.packets(file, str(log.source)):
                log.read += 1
                word = packet.word
                flags = (FLAG_EXTENDED if word & WORD_EXTENDED else 0) | (FLAG_REMOTE if word & WORD_REMOTE else 0)
                identifier = word & (0x1FFFFFFF if word & WORD_EXTENDED else 0x7FF)
                if not packet.is_whole and not word & WORD_REMOTE:
                    broken, first = broken + 1, first or log.read
                elif packet.is_fd and log.wants_fd:
                    yield packet.bus, packet.time_ns, identifier, *fd_words(flags | packet.switches, packet.data)
                elif len(packet.data) > 8:
                    log.fd += 1
                elif word & WORD_ERROR:
                    yield packet.bus, packet.time_ns, 0, FLAG_ERROR | 8, 0, 0
                else:
                    lo, hi = words_of_data(b"" if word & WORD_REMOTE else packet.data)
                    yield packet.bus, packet.time_ns, identifier, flags | len(packet.data), lo, hi
        except pcap.CutOffError:
            log.read += 1
            log.lose("cut_off", 1, f"packet {log.read}")
    log.lose("not_frames", broken, f"packet {first}")


LENGTH_BITS = 15  # of a frame's flags
HALF_A_BYTE = re.compile(r"\s[0-9A-Fa-f]$")
CUT_OFF = re.compile(r"\s*\d")  # a last line without an end that begins as frames do


class _Lines(io.TextIOBase):
    """Lines of a file for a library's reader, with a count of those that must become frames."""

    def __init__(self, log: RecordedFrames, lines: Iterable[str], is_frame: re.Pattern[str]) -> None:
        super().__init__()
        self.log, self.lines, self.is_frame = log, iter(lines), is_frame
        self.number = 0
        self.waiting = 0  # the line that must become a frame and has not
        self.line = ""
        self.whole = True  # the last line has its end
        self.lost: list[int] = []

    def __next__(self) -> str:  # type: ignore[override]
        line = next(self.lines, "")
        self.settle()
        if not line:
            raise StopIteration
        self.number += 1
        self.line = line
        self.whole = line.endswith("\n")
        if self.is_frame.match(line):
            self.log.read += 1
            self.waiting = self.number
        elif not self.whole and CUT_OFF.match(line):
            self.log.read += 1
            self.log.lose("cut_off", 1, f"in line {self.number}")
        return line

    def readline(self, size: int | None = -1) -> str:  # type: ignore[override]
        """The next line, for readers that call this."""
        return next(self, "")

    def is_torn(self, message: can.Message) -> bool:
        """True for a frame with fewer bytes than it says, and for a last line that ends within a byte.

        The library fills such a frame up with zeros.
        """
        if message.is_remote_frame or message.is_error_frame:
            return False
        return len(message.data) != message.dlc or (not self.whole and HALF_A_BYTE.search(self.line) is not None)

    def settle(self) -> None:
        """Count a line as lost if it did not become a frame before the next one."""
        if self.waiting:
            self.lost.append(self.waiting)
        self.waiting = 0


def _by_lines(
    log: RecordedFrames, reader: Callable[..., Iterable[can.Message]], lines: Iterable[str], is_frame: re.Pattern[str]
) -> Iterator[Frame]:
    """Frames of a text format by a reader of python-can."""
    given = _Lines(log, lines, is_frame)
    try:
        for message in reader(given):
            if given.is_torn(message):
                continue  # it is counted as lost with its line
            given.waiting = 0
            if not log.is_too_long(message):
                yield _frame(message)
        given.settle()
    except (ValueError, IndexError) as error:
        if given.whole:
            text = f"{log.source}:{given.number}: not a frame that python-can can read ({error})"
            raise DataError(text) from None
        log.read += not given.waiting
        log.lose("cut_off", 1, f"in line {given.number}")
        return
    if given.lost:
        log.lose("not_frames", len(given.lost), f"in line {given.lost[0]}")


def _trc_messages(lines: Iterable[str]) -> Iterator[can.Message]:
    """Messages of a TRC file: the reader takes the length code of a CAN FD frame for its length."""
    for message in can.TRCReader(lines):  # type: ignore[arg-type]
        if message.is_fd:
            message.dlc = LENGTHS[message.dlc]
        yield message


def _text_lines(log: RecordedFrames) -> Iterator[str]:
    with log.source.open(encoding="utf-8", errors="replace") as file:
        yield from file


def _asc_lines(log: RecordedFrames) -> Iterator[str]:
    """Lines of an ASC file as python-can reads them: with the header ended, and stamps since the beginning.

    The reader loses the first line after a header without an end, and takes a relative stamp, which counts from the
    previous line, for an absolute one.
    """
    relative, in_header, time_s = False, True, 0.0
    for number, line in enumerate(_text_lines(log), 1):
        if in_header and ASC_HEADER.match(line):
            relative = relative or bool(re.search(r"\btimestamps\s+relative\b", line, re.IGNORECASE))
            yield line
            continue
        if in_header and line.strip():
            in_header = False
            if not re.match(r"\s*(no\s+)?internal\s+events\s+logged", line, re.IGNORECASE):
                # this replaces the line that ends the header; both are one line of the file
                line = "internal events logged\n" + line
                first, line = line.split("\n", 1)
                yield first + "\n"
        symbolic = ASC_SYMBOLIC.match(line)
        if symbolic:
            raise DataError(
                f"{log.source}:{number}: {symbolic[1][:40]} is a name where an identifier is expected; export the log "
                "with numeric identifiers"
            )
        event = ASC_EVENT.match(line)
        if event and relative:
            time_s += float(event[2].replace(",", "."))
            line = f"{event[1]}{time_s:.9f}{event[3]}"
        yield "\n" if "start of measurement" in line.lower() else line


FD_MARK = re.compile("##[0-9A-Fa-f]")  # with the flags of a frame of CAN FD


# --- formats of other programs ------------------------------------------------------------------------------------

SCREEN = re.compile(  # candump on a screen: with or without stamps, -x, and the name of the interface
    r"\s*(?:\((?P<time>[^)]*)\)\s+)?(?P<bus>\S+)\s+(?:(?:RX|TX)\s+\S+\s+\S+\s+)?"
    r"(?P<id>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})\s+\[(?P<length>\d+)\]\s*(?P<data>.*)"
)
BUSMASTER = re.compile(
    r"(?P<h>\d+):(?P<m>\d+):(?P<s>\d+):(?P<part>\d{1,4})\s+(?:Rx|Tx)\s+(?P<bus>\d+)\s+(?P<id>(?:0x)?[0-9A-Fa-f]+)\s+"
    r"(?P<kind>[sx]r?)\s+(?P<length>\d+)\s*(?P<data>.*)",
    re.IGNORECASE,
)


def _candump_or_busmaster(log: RecordedFrames) -> Iterator[Frame]:
    """candump's file or screen, or BUSMASTER's log: every line is a frame, and only the last may be cut off."""
    try:
        text = log.source.read_text(encoding="ascii")
    except UnicodeDecodeError:
        raise DataError(f"{log.source}: the recording cannot be read (not plain ASCII)") from None
    lines = [(number, line) for number, line in enumerate(text.splitlines(keepends=True), 1) if line.strip()]
    parse: Callable[[str], Frame] = functools.partial(frame_of_line, fd=log.wants_fd)
    if lines and lines[0][1].startswith(BUSMASTER_HEADER):
        if any("***DEC***" in line for _, line in lines[:20]):
            raise DataError(f"{log.source}: BUSMASTER's log in decimal numbers; write it in hexadecimal ones")
        lines = [(number, line) for number, line in lines if not line.startswith("***")]
        parse = _busmaster_frame
    elif lines and SCREEN.match(lines[0][1]):
        parse = _ScreenLine([line for _, line in lines], log.wants_fd)
    lengths: dict[tuple[str, int, int], int] = {}  # of the frames so far, in bytes
    for number, line in lines:
        log.read += 1
        try:
            frame = parse(line)
            which = (frame[0], frame[2], frame[3] & FLAG_EXTENDED)
            if not line.endswith("\n") and frame[3] & LENGTH_BITS < lengths.get(which, 0):
                log.lose("cut_off", 1, f"in line {number}")
                return
            lengths[which] = frame[3] & LENGTH_BITS
            yield frame
        except CanFdError:
            try:
                yield parse(FD_MARK.sub("#", line))
            except ValueError:
                log.fd += 1
        except ValueError as error:
            if number == lines[-1][0] and not line.endswith("\n"):
                log.lose("cut_off", 1, f"in line {number}")
                return
            raise DataError(f"{log.source}:{number}: {error}") from None


class _ScreenLine:
    """candump's screen output: with -ta or -tA stamps are absolute, with -tz since the beginning.

    With -td they are since the previous frame, and resemble those of -tz, except that they may decrease.
    """

    def __init__(self, lines: list[str], fd: bool) -> None:
        self.fd = fd
        stamps = [float(found[1]) for line in lines if (found := re.match(r"\s*\((\d{1,9}\.\d{6})\)", line))]
        self.since_before = any(stamp < before for before, stamp in itertools.pairwise(stamps))
        self.time_ns = 0

    def __call__(self, line: str) -> Frame:
        found = SCREEN.fullmatch(line.strip())
        if found is None:
            raise ValueError(f"not `(stamp) interface identifier [length] data`: {line.strip()[:60]!r}")
        if found["time"] is None:
            raise ValueError("frames without stamps: candump shows them with -ta, and writes a file with -L or -l")
        time_ns = _stamp_ns(found["time"])
        self.time_ns = time_ns = time_ns + self.time_ns if self.since_before else time_ns
        identifier, length = int(found["id"], 16), int(found["length"])
        flags = FLAG_EXTENDED if len(found["id"]) == 8 else 0
        if "remote request" in found["data"]:
            return found["bus"], time_ns, identifier, flags | FLAG_REMOTE | min(length, 8), 0, 0
        return (
            found["bus"],
            time_ns,
            *_words(identifier, flags, length, found["data"].split("'")[0].split()[:length], self.fd),
        )


def _stamp_ns(text: str) -> int:
    """A stamp in s, or as date and time, taken as UTC: only differences matter."""
    if re.fullmatch(r"\d+\.\d{1,9}", text):
        seconds, _, fraction = text.partition(".")
        return int(seconds) * SECOND_NS + int(fraction.ljust(9, "0"))
    found = re.fullmatch(r"(\d{4})-(\d\d)-(\d\d) (\d\d):(\d\d):(\d\d)\.(\d{6})", text)
    if found is None:
        raise ValueError(f"stamp ({text}) is neither seconds nor date and time")
    numbers = [int(each) for each in found.groups()]
    return calendar.timegm((*numbers[:6], 0, 0, 0)) * SECOND_NS + numbers[6] * 1000


def _words(identifier: int, flags: int, length: int, data: list[str], fd: bool = False) -> tuple[int, int, int, int]:
    """(identifier, flags, lo, hi) of bytes in hexadecimal. ValueError if they are not a classic frame, or (`fd`) one of
    CAN FD, as which one of more than eight bytes is taken: these formats have no mark for it."""
    if len(data) != length or not all(re.fullmatch("[0-9A-Fa-f]{2}", byte) for byte in data):
        raise ValueError(f"frame {identifier:x} has {length} bytes and the data {' '.join(data)[:40]!r}")
    content = bytes.fromhex("".join(data))
    if length > 8:
        if not fd:
            raise CanFdError(f"frame {identifier:x} has {length} bytes, CAN FD; these logs are classic CAN")
        return identifier, *fd_words(flags, content)
    lo, hi = words_of_data(content)
    return identifier, flags | length, lo, hi


def _busmaster_frame(line: str) -> Frame:
    found = BUSMASTER.fullmatch(line.strip())
    if found is None:
        raise ValueError(f"not `time direction bus identifier kind length data`: {line.strip()[:60]!r}")
    seconds = int(found["h"]) * 3600 + int(found["m"]) * 60 + int(found["s"])
    part_ns = 100_000 if len(found["part"]) == 4 else 1_000_000  # version 2 writes ms without zeros in front
    time_ns = seconds * SECOND_NS + int(found["part"]) * part_ns
    kind, identifier, length = found["kind"].lower(), int(found["id"], 16), int(found["length"])
    flags = FLAG_EXTENDED if kind[0] == "x" else 0
    if "r" in kind:
        return found["bus"], time_ns, identifier, flags | FLAG_REMOTE | min(length, 8), 0, 0
    return found["bus"], time_ns, *_words(identifier, flags, length, found["data"].split()[:length])


def _csv(log: RecordedFrames) -> Iterator[Frame]:
    """python-can's table or SavvyCAN's."""
    with log.source.open(encoding="utf-8", errors="replace") as file:
        header = file.readline(200).strip().lower()
    if header == PYTHON_CAN_HEADER:
        yield from _by_lines(log, can.CSVReader, _text_lines(log), re.compile(r"\s*[\d.]"))
        return
    if not header.startswith(SAVVYCAN_HEADER):
        raise DataError(f"{log.source}: a .csv of frames begins with {PYTHON_CAN_HEADER!r} or as SavvyCAN writes it")
    place = {name: index for index, name in enumerate(header.split(","))}
    for number, line in enumerate(_text_lines(log), 1):
        if number == 1 or not line.strip():
            continue
        log.read += 1
        cells = [cell.strip() for cell in line.split(",")]
        try:
            flags = FLAG_EXTENDED if cells[place["extended"]].lower() == "true" else 0
            length = int(cells[place["len"]])
            words = _words(
                int(cells[place["id"]], 16), flags, length, cells[place["d1"] : place["d1"] + length], log.wants_fd
            )
            yield cells[place["bus"]], int(cells[0]) * 1000, *words
        except (ValueError, IndexError, KeyError) as error:
            if not line.endswith("\n"):
                log.lose("cut_off", 1, f"in line {number}")
                return
            raise DataError(f"{log.source}:{number}: not a frame as SavvyCAN writes it ({error})") from None
