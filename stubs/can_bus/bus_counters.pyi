# Generated from can_bus/bus_counters.py and can_bus/bus_counters.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from typing import Any
from typing import final

@final
class BusCounters:
    frames: int
    merged: int
    lost: int
    single_shot_skipped: int
    single_shot_dropped: int
    retries: int
    errors: int
    refused: int
    arbitrations_lost: int
    aborted: int
    flushed: int
    late_results: int
    late_requests: int
    @property
    def identifiers(self) -> MutableSequence[int]: ...
    def __init__(self) -> None: ...
    def reset(self) -> None: ...
    @property
    def over(self) -> int: ...
    @property
    def frames_by_identifier(self) -> list[Any]: ...
    @property
    def response_max_ns(self) -> list[Any]: ...
