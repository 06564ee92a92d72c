# Generated from can_bus/medium_access.py and can_bus/medium_access.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.can_bus.node import Node
from typing import Any
from typing import final

MAC_AWAY: int
MAC_JOINING: int
MAC_IDLE: int
MAC_FRAME: int
MAC_ACTIVE_FLAG: int
MAC_PASSIVE_FLAG: int
MAC_OVERLOAD_FLAG: int
MAC_TOLERATING: int
MAC_DELIMITER: int
MAC_INTERMISSION: int
MAC_SUSPENDED: int
MET_RECEIVED: int
MET_SENT: int
MET_LOSS: int
MET_ERROR: int
MET_FAILURE: int
MET_COUNTER: int
MET_SETTLED: int
MET_START: int
MET_JOIN: int
RECEIVER_PENALTY: int
FLAG_BITS: int
DELIMITER_BITS: int
TOLERATED_BITS: int

@final
class MediumAccess:
    node: Node
    state: int
    count: int
    driven: int
    sending: bool
    failed: bool
    after_error: bool
    unacknowledged: bool
    unheeded: bool
    begun: int
    position: int
    field: int
    left: int
    stuff_run: int
    stuff_level: int
    register: int
    identifier: int
    flags: int
    lo: int
    hi: int
    row: int
    offered: int
    arbitration_bits: int
    bits: list[Any]
    run_level: int
    capture: int
    met: int
    own_rate: int
    own_bit: int
    own_rest: int
    def __init__(self, node: Node) -> None: ...
    def place(self, bit: int, free_bit: int) -> None: ...
    def sample(self, wire_level: int, bit: int) -> int: ...
