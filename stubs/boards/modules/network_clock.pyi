# Generated from boards/modules/network_clock.py and boards/modules/network_clock.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.boards.modules.can_load import CanLoad
from ranger_sim.boards.modules.network_time import NetworkTime
from typing import Any
from typing import final

TICKS_PER_MS: int
SYNC_BUFFER: int
SYNC_IDENTIFIER: int
CYCLES_PER_SYNC: int

@final
class NetworkClock:
    time: NetworkTime
    load: CanLoad
    ticks: int
    divider: int
    controllers: list[Any]
    sent: MutableSequence[int]
    skipped: MutableSequence[int]
    def __init__(self, time: NetworkTime, controllers: Any, load: CanLoad) -> None: ...
    def tick(self) -> bool: ...
    def send_sync(self) -> int: ...
