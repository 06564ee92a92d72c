# Generated from boards/main_brain/error_distribution.py and boards/main_brain/error_distribution.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.datatable.store import DataStore
from typing import Any
from typing import final

SOURCES: tuple[str, ...]
COMPUTER_RING: int
DISPLAY_RING: int
UNREAD_LIMIT_MS: int

@final
class ErrorRing:
    size: int
    dropped: int
    waiting: dict[Any, Any]
    def __init__(self, size: int) -> None: ...
    def add(self, board: int, code: int, count: int, stamp: int) -> None: ...
    def take(self) -> Any: ...

@final
class ErrorDistribution:
    store: DataStore
    errors: ErrorModule
    inverted: bool
    source_ids: list[Any]
    id_own: int
    id_computer: int
    id_display: int
    computer: ErrorRing
    display: ErrorRing
    computer_time_ms: int
    totals: dict[Any, Any]
    def __init__(self, store: Any, errors: Any, inverted: Any) -> None: ...
    def distribute(self) -> int: ...
