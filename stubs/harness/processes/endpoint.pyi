# Generated from harness/processes/endpoint.py and harness/processes/endpoint.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.foundation.events import EventQueue
from ranger_sim.harness.processes.channel import Bell
from ranger_sim.harness.processes.channel import Mailbox
from ranger_sim.harness.processes.stage import Audience
from typing import Any

SLOT_KINDS: Any
LONGEST_TURN_NS: int
ERRORS_EVERY: int
NOTE_BYTES: Any

class Endpoint:
    board: Microcontroller
    counts_errors: bool
    runs_c: bool
    clock: Any
    shared: Any
    activity: Any
    block: MutableSequence[int]
    stage: MutableSequence[int]
    stage_doubles: MutableSequence[float]
    ask: Bell
    answer: Bell
    to_board: Mailbox
    from_board: Mailbox
    audience: Audience
    pending: EventQueue
    out: EventQueue
    slots_seen: int
    cycles_seen: int
    ring_first: int
    turns: int
    reached: int
    can_wait: int
    promised: int
    def __init__(self, board: Microcontroller, shared: Any, stage: Any, audience: Audience, place: Any) -> None: ...
    def serve(self) -> None: ...
    def broke_its_promise(self) -> None: ...
    def obey(self) -> None: ...
    def tell(self, what: Any, data: Any) -> None: ...
