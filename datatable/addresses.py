"""Addresses of the variables for calibration programs, and the CAN identifiers for XCP.

One 32-bit word a variable, little-endian, in the order of the table: an address is fixed by the id. No memory exists
beyond the last word.
"""

from __future__ import annotations

BASE = 0x10000  # chosen by us: 0, which programs take for "no address", is unused
WORD_BYTES = 4

# XCP on CAN. Chosen by us: free in the robot's table (robot.md N1.9), and above all of it, so that calibration loses
# every arbitration against the robot. A variable that takes one of them is refused.
XCP_MASTER_ID = 2000  # commands
XCP_SLAVE_ID = 2001  # answers and measurements
XCP_IDS = (XCP_MASTER_ID, XCP_SLAVE_ID)
XCP_BUS = "CAN2"  # chosen by us: the robot's quietest bus, without a motor


def address_of(number: int) -> int:
    """The address of the variable with this id."""
    return BASE + WORD_BYTES * number
