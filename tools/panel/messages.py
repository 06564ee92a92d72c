"""Messages between server and page over the one WebSocket, version 3 (README.md describes the page's side).

From the page: text, JSON objects with `do`. To the page: binary, a head of 16 bytes and a body, little-endian.

    head    version (u8), kind (u8), plot (u16), channels (u16), flags (u16), points (u32), 0 (u32)
    TEXT    the body is JSON
    TRACES  of one plot: its end (f64) and span (f64), s, and in the head its wanted number of points; flags FOLLOWS
            (the plot follows time; else a held window) and ANEW (all of it; else what is new since the last such
            message, and part of what was already sent). Then per channel its number (u32), flags (u32), points (u32),
            0 (u32); then x (f64), low (f32), high (f32, only with ENVELOPE), padded to 8 bytes; NaN is a gap
    POSE    time (f64), then angles and lengths of the robot (f32), as the channels of `pose` in HELLO say
    PICTURE all messages of one picture, as above; the head has their number as points. Each follows its length (u32)
            and 0 (u32), and is padded to 8
"""

from __future__ import annotations

import dataclasses
import json
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np

from ranger_sim.tools.panel.channels import Trace

VERSION = 3
TEXT, TRACES, POSE, PICTURE = 1, 2, 3, 4
ENVELOPE = 1
FOLLOWS, ANEW = 1, 2
HEAD = struct.Struct("<BBHHHII")
WINDOW = struct.Struct("<dd")
TRACE_HEAD = struct.Struct("<IIII")
PART_HEAD = struct.Struct("<II")


@dataclasses.dataclass(frozen=True)
class Window:
    """The window of a plot: the `span` seconds before `end`, in `points` points. flags: FOLLOWS, ANEW."""

    end: float
    span: float
    points: int
    flags: int


def text(content: Any) -> bytes:
    """A JSON message; infinities and NaN become null."""
    body = json.dumps(content, separators=(",", ":"), allow_nan=False).encode()
    return HEAD.pack(VERSION, TEXT, 0, 0, 0, len(body), 0) + body


def traces(plot: int, window: Window, channels: Sequence[int], found: Sequence[Trace]) -> bytes:
    """All traces of one plot."""
    parts = [
        HEAD.pack(VERSION, TRACES, plot, len(channels), window.flags, window.points, 0),
        WINDOW.pack(window.end, window.span),
    ]
    for channel, trace in zip(channels, found, strict=True):
        count = len(trace.x)
        flags = 0 if trace.high is None else ENVELOPE
        parts.append(TRACE_HEAD.pack(channel, flags, count, 0))
        parts.append(trace.x.astype("<f8").tobytes())
        body = trace.low.astype("<f4").tobytes()
        if trace.high is not None:
            body += trace.high.astype("<f4").tobytes()
        parts.append(body + bytes(-len(body) % 8))
    return b"".join(parts)


def pose(time_s: float, values: Sequence[float]) -> bytes:
    """The positions of the robot's parts."""
    return (
        HEAD.pack(VERSION, POSE, 0, 0, 0, len(values), 0)
        + struct.pack("<d", time_s)
        + np.array(values, "<f4").tobytes()
    )


def picture(parts: Sequence[bytes]) -> bytes:
    """Parts as one message, because many small ones cost server and page a wake-up each."""
    whole = [HEAD.pack(VERSION, PICTURE, 0, 0, 0, len(parts), 0)]
    for part in parts:
        whole += [PART_HEAD.pack(len(part), 0), part, bytes(-len(part) % 8)]
    return b"".join(whole)
