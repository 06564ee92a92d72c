# Generated from harness/timeline/packing.py and harness/timeline/packing.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from typing import Any
from typing import final

HOLE_BYTES: int
VARINT_BYTES: int
PACKET_TAG: int
TIMESTAMP_TAG: int
OUTER_BEGINS: int
OUTER_ENDS: int
INNER_BEGINS: int
INNER_ENDS: int

def varint(value: int) -> bytes: ...

@final
class PacketPacker:
    write: Any
    flush_bytes: int
    used: int
    longest: int
    buffer: Any
    text: Any
    laid: int
    text_begins: MutableSequence[int]
    hole_begins: MutableSequence[int]
    hole_places: MutableSequence[int]
    templates: list[Any]
    holes: list[Any]
    def __init__(self, write: Any, flush_bytes: int = ...) -> None: ...
    def template(self, packet: bytes, holes: list[Any]) -> int: ...
    def _lay(self) -> None: ...
    def put(self, times: MutableSequence[int] | memoryview[int], kinds: MutableSequence[int] | memoryview[int], values: MutableSequence[int] | memoryview[int], firsts: MutableSequence[int] | memoryview[int]) -> None: ...
    def _put_interpreted(self, times: Any, kinds: Any, values: Any, firsts: Any) -> None: ...
    def flush(self) -> None: ...

def nested(outer_start: MutableSequence[int] | memoryview[int], outer_end: MutableSequence[int] | memoryview[int], inner_start: MutableSequence[int] | memoryview[int], inner_end: MutableSequence[int] | memoryview[int], order: MutableSequence[int] | memoryview[int]) -> int: ...
def index_packets(data: MutableSequence[Any] | memoryview[Any], rows: MutableSequence[int] | memoryview[int]) -> int: ...
