"""Text files of any size: their encoding by all of their bytes, then their lines, a chunk at a time.

Compressed files, files with bytes of value 0, and lines longer than LONGEST_LINE are refused before a line is kept.
"""

import codecs
import dataclasses
import pathlib
import re
from collections import deque
from collections.abc import Iterator

from ranger_sim.foundation.user_error import DataError

LONGEST_LINE = 1_000_000  # bytes; 3,000 columns of 20 digits have 60,000
LARGEST_BYTES = 20_000_000_000
CHUNK_BYTES = 1 << 20
CHUNK_LINES = 20_000
CONTINUED = "\f"  # in place of a line that is part of a quoted cell of the line above
LONGEST_CELL = 50  # further lines; a quotation mark that is not closed within them is a character like others
OPENING = re.compile(r'(?:^|[,;\t|]) *"')
CONTENT = re.compile(r'(?:[^"]|"")*"(?!")')  # of a quoted cell, with the mark at its end
COMPRESSED = {
    b"\x1f\x8b": "gzip",
    b"PK\x03\x04": "a zip archive (an .xlsx is one as well)",
    b"BZh": "bzip2",
    b"\xfd7zXZ\0": "xz",
    b"\x28\xb5\x2f\xfd": "zstd",
    b"7z\xbc\xaf": "7z",
}
MARKS = {codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}
ENCODINGS = ("utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "cp1252", "latin-1")


@dataclasses.dataclass(frozen=True)
class Survey:
    """A text file as a whole. ends: its last line has a line end."""

    encoding: str
    size: int
    ends: bool


def survey(path: pathlib.Path, encoding: str = "") -> Survey:
    """Read the whole file once, in chunks. encoding: as assumed, empty when the bytes decide.

    UserError for a file that cannot be read, is not text, or has too long a line.
    """
    try:
        size = path.stat().st_size
        if size > LARGEST_BYTES:
            raise DataError(f"{path}: {size} bytes, a text table may have {LARGEST_BYTES}")
        with path.open("rb") as file:
            return _surveyed(path, file, size, encoding)
    except OSError as error:
        raise DataError(f"{path}: the table cannot be read ({error.strerror or error})") from None


def _surveyed(path: pathlib.Path, file, size: int, encoding: str) -> Survey:  # type: ignore[no-untyped-def]
    first = file.read(4096)
    file.seek(0)
    packed = next((name for magic, name in COMPRESSED.items() if first.startswith(magic)), None)
    if packed:
        raise DataError(f"{path}: the file is compressed ({packed}): unpack it first, a text table is read as text")
    found = encoding or next((name for mark, name in MARKS.items() if first.startswith(mark)), "")
    if not found and b"\0" in first:
        odd, even = first[1::2].count(0), first[::2].count(0)
        found = "utf-16-le" if odd > 0.7 * len(first[1::2]) else "utf-16-be" if even > 0.7 * len(first[::2]) else ""
    is_utf_8 = codecs.getincrementaldecoder("utf-8")()
    wide = found.startswith("utf-16")
    valid, western, position, since_end, last = True, True, 0, 0, b""
    while block := file.read(CHUNK_BYTES):
        if not wide and (place := block.find(0)) >= 0:
            raise DataError(
                f"{path}: this is not a text table, it has bytes of value 0 (the first is byte {position + place + 1})"
            )
        lines = block.replace(b"\r", b"\n").split(b"\n")
        longest = max(since_end + len(lines[0]), *map(len, lines[1:]), 0)
        if longest > LONGEST_LINE * (2 if wide else 1):
            raise DataError(
                f"{path}: a line of more than {LONGEST_LINE} characters begins before byte {position + len(block)}; "
                "no table has such lines"
            )
        since_end = len(lines[-1]) if len(lines) > 1 else since_end + len(lines[0])
        western = western and not any(each in block for each in (b"\x81", b"\x8d", b"\x8f", b"\x90", b"\x9d"))
        if valid and not found:
            try:
                is_utf_8.decode(block)
            except UnicodeDecodeError:
                valid = False
        position, last = position + len(block), block[-4:]
    if not found and valid:
        try:
            is_utf_8.decode(b"", final=True)
        except UnicodeDecodeError:
            valid = False
    chosen = found or ("utf-8-sig" if valid else "cp1252" if western else "latin-1")
    return Survey(chosen, size, last.rstrip(b"\0").endswith((b"\n", b"\r")))


def chunks(path: pathlib.Path, encoding: str, most: int = CHUNK_LINES) -> Iterator[tuple[int, list[str]]]:
    """(number of the first line, from 1; lines without their ends) of the file. UserError for a wrong encoding.

    A row whose quoted cell goes on in further lines is one line, with CONTINUED in place of each of these.
    """
    number, lines = 1, []
    try:
        with path.open(encoding=encoding, newline=None) as file:
            for line in _whole_rows(each.rstrip("\n") for each in file):
                lines.append(line)
                if len(lines) == most:
                    yield number, lines
                    number, lines = number + most, []
    except (UnicodeError, LookupError) as error:
        raise DataError(f"{path}: its text is not {encoding} ({' '.join(str(error).split())[:80]})") from None
    except OSError as error:
        raise DataError(f"{path}: the table cannot be read ({error.strerror or error})") from None
    if lines:
        yield number, lines


def _whole_rows(lines: Iterator[str]) -> Iterator[str]:
    ahead: deque[str] = deque()
    while (line := ahead.popleft() if ahead else next(lines, None)) is not None:
        count, is_open = 0, '"' in line and _is_open(line, False)
        while is_open and count < LONGEST_CELL:
            if count == len(ahead):
                following = next(lines, None)
                if following is None:
                    break
                ahead.append(following)
            is_open = _is_open(ahead[count], True)
            count += 1
        if is_open:  # to the end
            count = 0
        yield " ".join([line, *(ahead.popleft() for _ in range(count))])
        yield from [CONTINUED] * count


def _is_open(line: str, is_open: bool) -> bool:
    """Whether a quoted cell is open at the end of a line. is_open: whether one is at its begin."""
    at = 0
    while True:
        found = CONTENT.match(line, at) if is_open else OPENING.search(line, at)
        if found is None:
            return is_open
        at, is_open = found.end(), not is_open
