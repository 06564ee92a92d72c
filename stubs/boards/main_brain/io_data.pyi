# Generated from boards/main_brain/io_data.py and boards/main_brain/io_data.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.boards.modules.ssp_link import MainBrainSspLink
from ranger_sim.datatable.store import DataStore
from typing import Any

class IoData:
    store: DataStore
    link: MainBrainSspLink
    time: NetworkTime
    subscriber: int
    timestamp: int
    turn: int
    turn_every: int
    slots: int
    send_ids: MutableSequence[int]
    dividers: MutableSequence[int]
    turn_ids: MutableSequence[int]
    def __init__(self, store: DataStore, link: MainBrainSspLink, time: NetworkTime, send_ids: Any) -> None: ...
    def thin(self, send_ids: Any, dividers: Any, turn_ids: Any, turn_every: Any = 1) -> None: ...
    def known(self, numbers: Any) -> Any: ...
    def receive(self) -> Any: ...
    def send(self) -> Any: ...
