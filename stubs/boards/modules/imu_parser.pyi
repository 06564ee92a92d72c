# Generated from boards/modules/imu_parser.py and boards/modules/imu_parser.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.firmware_sim.peripherals.uart import Uart
from typing import Any
from typing import final

HEADER_ANGLES_AND_RATES: int
HEADER_RATES_ONLY: int
PACKET_BYTES: int
PACKET_WORDS: int
RING_BYTES: int
RING_MASK: int
CHECKSUM_MASK: int

def start_command(header: Any) -> bytes: ...

@final
class ImuParser:
    ring_write: int
    ring_read: int
    header: int
    needed: int
    ring: MutableSequence[int]
    words: MutableSequence[int]
    has_angles: bool
    rate_x: float
    rate_y: float
    rate_z: float
    roll: float
    pitch: float
    yaw: float
    acceleration_x: float
    acceleration_y: float
    acceleration_z: float
    timer: int
    packets: int
    bad_checksums: int
    skipped_bytes: int
    bytes_lost: int
    code_ring_full: int
    report: Any
    def __init__(self, report: Any, header: int = ..., late_by_one_byte: Any = False) -> None: ...
    def push(self, byte: int) -> bool: ...
    def receive(self, uart: Uart) -> int: ...
    def waiting(self) -> int: ...
    def update(self) -> int: ...
