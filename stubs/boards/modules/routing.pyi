# Generated from boards/modules/routing.py and boards/modules/routing.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.boards.modules.can_load import CanLoad
from ranger_sim.boards.modules.ssp_link import RouterSspLink
from typing import Any
from typing import final

IDENTIFIERS: int
CHANNEL_SSP: int
FIRST_BUS: int
LAST_BUS: int
CHANNEL_OWN: int
SOURCE_UNKNOWN: int
DESTINATIONS: int
SOURCE_SHIFT: int
ALL_CHANNELS: int
TO_SSP: int
NOT_LEARNED: int
RECEIVE_RING: int
RECEIVE_MASK: int
RECEIVED: int
TRANSMIT_RING: int
TRANSMIT_MASK: int
OWN_MASK: int
TO_SEND: int

@final
class RoutingTable:
    rows: MutableSequence[int]
    learned: int
    changed: int
    def __init__(self, routes: Any = ...) -> None: ...
    def set_destinations(self, identifier: Any, mask: Any) -> None: ...
    @property
    def destinations(self) -> Any: ...
    @property
    def sources(self) -> Any: ...
    def learn(self, identifier: int, channel: int) -> None: ...
    def subscribe(self, identifier: int, channel: int) -> None: ...

@final
class Router:
    rx_write: int
    rx_read: int
    own_write: int
    own_read: int
    to_route: int
    waiting: int
    table: RoutingTable
    ssp: RouterSspLink
    load: CanLoad
    routed: int
    copies: int
    one_frame_lag: bool
    tx_write: MutableSequence[int]
    tx_read: MutableSequence[int]
    rx_rows: MutableSequence[int]
    own_rows: MutableSequence[int]
    tx_rows: MutableSequence[int]
    report: Any
    receive_lost: int
    own_lost: int
    unroutable: int
    transmit_lost: MutableSequence[int]
    receive_lost_from: MutableSequence[int]
    receive_full_codes: MutableSequence[int]
    def __init__(self, table: RoutingTable, ssp: RouterSspLink, load: CanLoad, report: Any, one_frame_lag: bool = False) -> None: ...
    def receive(self, channel: int, identifier: int, flags: int, word0: int, word1: int) -> bool: ...
    def send(self, identifier: int, word0: int, word1: int) -> bool: ...
    def route_step(self, now: int) -> int: ...
    def route(self, source: int, identifier: int, flags: int, word0: int, word1: int, now: int) -> int: ...
    def queue(self, channel: int, identifier: int, flags: int, word0: int, word1: int) -> bool: ...
    def frames_for(self, channel: int) -> int: ...
