# Generated from boards/modules/error_module.py and boards/modules/error_module.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.boards.modules.network_time import NetworkTime
from typing import Any
from typing import final

CODES: int
RING_MASK: int
MOST_WAITING: int
COUNT_MASK: int
CODE_MASK: int
BOARD_MASK: int
BOARD_SHIFT: int
COUNT_SHIFT: int

def error_word(code: Any, board: Any, count: Any) -> Any: ...

@final
class ErrorModule:
    flagged_count: int
    waiting: int
    time: NetworkTime
    per_event: bool
    lose_new_after_repeat: bool
    first: int
    dropped: int
    word: int
    stamp: int
    board: int
    codes: MutableSequence[int]
    counts: MutableSequence[int]
    stamps: MutableSequence[int]
    totals: MutableSequence[int]
    flags: MutableSequence[int]
    flagged: MutableSequence[int]
    def __init__(self, board: int, time: NetworkTime, per_event: bool = True, lose_new_after_repeat: bool = False) -> None: ...
    def report(self, code: int) -> None: ...
    def update(self) -> Any: ...
    def take(self) -> bool: ...
