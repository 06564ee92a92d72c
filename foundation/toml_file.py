"""The only reader of TOML files. It limits bytes, nesting and length of keys, and so its time as well."""

import pathlib
import re
import tomllib
from typing import Any

from ranger_sim.foundation.user_error import UserError

# Chosen by us: our longest file has 6 kB, 4 levels and keys of 3 parts.
MOST_BYTES = 1 << 20
MOST_LEVELS = 32  # of arrays and inline tables within each other
MOST_PARTS = 16  # of a dotted key: tables within tables; the library's time grows with the square of it

# Strings and comments as a whole, and the characters that make structure.
TOKEN = re.compile(
    r'"""(?:[^"\\]|\\.|"{1,2}(?!"))*+"{3,5}'
    r"|'''(?:[^']|'{1,2}(?!'))*+'{3,5}"
    r'|"(?:[^"\\\n]|\\.)*+"?'
    r"|'[^'\n]*+'?"
    r"|#[^\n]*+"
    r"|[\[\]{}.=,\n]",
    re.DOTALL,
)
PLACE = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)$")


class TomlError(UserError):
    """File is not TOML, or exceeds a limit. `line` and `column` count from 1; 0: no position."""

    def __init__(self, name: str, reason: str, line: int = 0, column: int = 0) -> None:
        super().__init__(f"{name}:{line}:{column}: {reason}" if line else f"{name}: {reason}")
        self.reason = reason
        self.line = line
        self.column = column


def load(path: str | pathlib.Path, what: str = "") -> dict[str, Any]:
    """The tables of a file, UTF-8 with or without a byte order mark. what: the kind of file, for the message.

    TomlError, with file, line and column, for a file that cannot be read, is not TOML or is beyond a limit.
    """
    name = f"{what} {path}" if what else str(path)
    try:
        with pathlib.Path(path).open("rb") as file:
            data = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise TomlError(name, error.strerror or str(error)) from None
    except ValueError:  # a name with a null byte
        raise TomlError(name, "not the name of a file") from None
    return loads(data, name)


def loads(data: bytes, name: str) -> dict[str, Any]:
    """The tables in `data`, called `name` in messages."""
    if len(data) > MOST_BYTES:
        raise TomlError(name, f"larger than {MOST_BYTES} bytes")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = data[: error.start]
        column = len(before.rpartition(b"\n")[2].decode(errors="replace")) + 1
        raise TomlError(name, f"not UTF-8 text (byte {error.start})", before.count(b"\n") + 1, column) from None
    text = text.replace("\r\n", "\n")
    _check_structure(text, name)
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        found = PLACE.search(str(error))
        what = PLACE.sub("", str(error))
        line, column = (int(found[1]), int(found[2])) if found and found[1] else _end_of(text)
        raise TomlError(name, f"not valid TOML: {what}", line, column) from None
    except ValueError as error:  # a whole number of thousands of digits, for which the library gives no position
        raise TomlError(name, f"not valid TOML: {str(error).partition(';')[0]}") from None


def _check_structure(text: str, name: str) -> None:
    """Refuse, before the library reads it, text that would take it too long or nest too deeply."""
    levels, parts = 0, 1
    for token in TOKEN.finditer(text):
        mark = token[0]
        if mark == ".":
            parts += 1
            if parts > MOST_PARTS:
                raise TomlError(name, f"a key of more than {MOST_PARTS} parts", *_place(text, token.start()))
            continue
        if mark in "=,\n":
            parts = 1
        elif mark in "[{":
            levels, parts = levels + 1, 1
            if levels > MOST_LEVELS:
                raise TomlError(name, f"nested more than {MOST_LEVELS} levels deep", *_place(text, token.start()))
        elif mark in "]}":
            levels, parts = max(0, levels - 1), 1


def _place(text: str, at: int) -> tuple[int, int]:
    """Line and column of a position in the text."""
    return text.count("\n", 0, at) + 1, at - text.rfind("\n", 0, at)


def _end_of(text: str) -> tuple[int, int]:
    return _place(text, len(text))
