"""The eight bytes of a frame: a value word and a time word, both little-endian (robot.md N1.3, N1.7)."""

from __future__ import annotations

import struct

from ranger_sim.foundation.numbers import float_of_word, word_of_float, wrap_i32, wrap_u32


def word_of_value(kind: str, value: float) -> int:
    """The 32-bit word of `value` (0 ... 2^32-1). Floats are rounded to single precision, integers wrap."""
    return int(word_of_float(value)) if kind == "f32" else int(value) & 0xFFFFFFFF


def value_of_word(kind: str, word: int) -> float | int:
    """The number that a 32-bit word holds, by type f32, i32 or u32."""
    if kind == "f32":
        return float(float_of_word(word))
    return int(wrap_i32(word) if kind == "i32" else wrap_u32(word))


def pack_frame(kind: str, value: float, time_ms: int) -> bytes:
    """Eight bytes of a frame."""
    return struct.pack("<II", word_of_value(kind, value), wrap_u32(time_ms))


def unpack_frame(kind: str, data: bytes) -> tuple[float | int, int]:
    """(value, time in ms) of the eight bytes of a frame."""
    word, time_ms = struct.unpack("<II", data)
    return value_of_word(kind, word), time_ms


def error_word(code: int, board: int, count: int) -> int:
    """The value word of an error frame: code in bits 0-15, board in 16-21, count in 22-31; the count saturates."""
    return (code & 0xFFFF) | (board & 0x3F) << 16 | min(count, 0x3FF) << 22


def parts_of_error_word(word: int) -> tuple[int, int, int]:
    """(code, board, count) of the value word of an error frame."""
    return word & 0xFFFF, word >> 16 & 0x3F, word >> 22 & 0x3FF
