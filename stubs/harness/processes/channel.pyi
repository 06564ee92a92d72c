# Generated from harness/processes/channel.py and harness/processes/channel.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.foundation.events import EventQueue
from ranger_sim.foundation.events import Outbox
from typing import Any

VERSION: int
SLOT_WORDS: int
STAMP_WORD: int
ORDER_WORD: int
FIELDS_WORD: int
CHECK_WORD: int
FIELD_COUNT: int
LONGEST: int
FIRST_OWN_KIND: int
LAST_KIND: int
KIND_MASK: int
VERSION_SHIFT: int
PAYLOAD_SHIFT: int
PAYLOAD_MASK: int
NUMBER_SHIFT: int
NUMBER_MASK: int
LAST_STANDARD_ID: int
FARTHEST_NS: int
OF_UNKNOWN_KIND: int
OF_OTHER_VERSION: int
TOO_LONG: int
CHECK_WRONG: int
NO_IDENTIFIER: int
BAD_PAYLOAD: int
OUT_OF_TIME: int
FIELD_WRONG: int
FAULTS: dict[int, str]

class Bell:
    words: MutableSequence[int]
    count: int
    sleeper: int
    descriptor: int
    rung: int
    def __init__(self, words: MutableSequence[int] | memoryview[int], count: int, sleeper: int, descriptor: int) -> None: ...
    def ring(self) -> None: ...
    def wait(self, count: int) -> bool: ...

class Mailbox:
    words: MutableSequence[int]
    limits: MutableSequence[int]
    name: str
    first: int
    slots: int
    used_word: int
    direction: int
    until: int
    sequence: int
    used: int
    at: int
    closed: int
    damaged: int
    kinds: int
    bit_of_kind: int
    last_damage: str
    notes: list[Any]
    def __init__(self, words: MutableSequence[int] | memoryview[int], name: str, first: int, slots: int, used_word: int, direction: int) -> None: ...
    def put(self, queue: EventQueue) -> bool: ...
    def send(self) -> None: ...
    def open(self) -> None: ...
    def take(self, queue: Outbox) -> bool: ...
    def explain(self, at: Any, fault: Any) -> str: ...
    def _damage(self, text: Any) -> None: ...
