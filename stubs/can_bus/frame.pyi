# Generated from can_bus/frame.py and can_bus/frame.pxd (python -m ranger_sim.tools.stubs); do not edit.

from typing import Any

LENGTH_CODE: int
EIGHT_BYTES: int
SENDABLE: int
RECEIVERS_SEE: int
HIGHEST_STANDARD: int
HIGHEST_EXTENDED: int
INTERMISSION_BITS: int
TAIL_BITS: int
ACK_DELIMITER_FROM_END: int
STANDARD_BITS: int
EXTENDED_BITS: int
ARBITRATION_END: int
EXTENDED_ARBITRATION_END: int
CRC_POLYNOMIAL: int
CRC_BITS: int
CRC_MASK: int
MEASURED_BITS: int
MEASURED_CRC_SHIFT: int
DOMINANT: int
RECESSIVE: int
FIELD_ID_28_21: int
FIELD_START: int
FIELD_SRTR: int
FIELD_IDE: int
FIELD_ID_20_18: int
FIELD_ID_17_13: int
FIELD_CRC: int
FIELD_R0: int
FIELD_DATA: int
FIELD_DLC: int
FIELD_RTR: int
FIELD_R1: int
FIELD_ID_4_0: int
FIELD_ID_12_5: int
FIELD_CRC_DELIMITER: int
FIELD_ACK_SLOT: int
FIELD_END: int
FIELD_ACK_DELIMITER: int
FIELD_ACTIVE_FLAG: int
FIELD_INTERMISSION: int
FIELD_TOLERATED: int
FIELD_PASSIVE_FLAG: int
FIELD_DELIMITER: int
FIELD_OVERLOAD_FLAG: int
STATE_SHIFT: int
STATE_MASK: int
RUN_MASK: int
LEVEL_SHIFT: int
STUFFED_SHIFT: int
IDLE: int
STUFF_AFTER: int
STANDARD_HEADER_BITS: int
DATA_BITS: int
STATES: int
BYTES: int
TABLE_BYTES: int
STANDARD_IDENTIFIERS: int
BEGUN_CRC_SHIFT: int
BEGUN_STUFFED_SHIFT: int
BEGUN_STUFFED_MASK: int
STEP_STATE_SHIFT: int
STEP_STATE_MASK: int
STEP_STUFFED_SHIFT: int
STEP_STUFFED_MASK: int
STEP_PLACE_MASK: int
CRC_LISTS: list[Any]
WALK: list[Any]
WALKS: dict[Any, Any]

def _fill_tables() -> None: ...
def _fill_lists() -> None: ...
def _begin(identifier: Any) -> Any: ...
def measure(identifier: int, flags: int, lo: int, hi: int) -> int: ...
def crc15(identifier: int, flags: int, lo: int, hi: int) -> int: ...
def frame_bits(identifier: int, flags: int, lo: int, hi: int) -> int: ...
def fill_frame_bits(identifiers: Any, flags: Any, lows: Any, highs: Any, bits: Any) -> None: ...
def arbitration_key(identifier: int, flags: int) -> int: ...
def data_length(flags: int) -> int: ...
def unstuffed_bits(flags: int) -> int: ...
def worst_case_bits(flags: int) -> int: ...
def wire(identifier: int, flags: int, lo: int, hi: int) -> tuple[list[int], list[int]]: ...
def first_difference(one: list[int], other: list[int]) -> int: ...
