"""Measure a running robot by XCP on CAN: `ranger-sim up --xcp-can`, then this. Needs python-can alone.

Prints the hip's angle every 0.5 ms of the robot's time, for as many rows as the argument says (default 20).
"""

import struct
import sys

import can

MASTER, SLAVE = 2000, 2001  # identifiers; docs/how-to/calibration.md
BASE, MCH_ANGLE = 0x10000, 14  # address of a variable: BASE + 4 id (ranger-sim table show MCH_ANGLE)
TICK_S = 10e-6  # of the stamps on CAN


def say(bus: can.BusABC, command: str) -> bytes:
    """The answer to a command; SystemExit when it is refused or not answered."""
    bus.send(can.Message(arbitration_id=MASTER, is_extended_id=False, data=bytes.fromhex(command)))
    while True:
        message = bus.recv(2.0)
        if message is None:
            raise SystemExit("no answer: is the robot running with --xcp-can?")
        if message.data[0] == 0xFE:
            raise SystemExit(f"{command} is refused with error {message.data[1]:#04x}")
        if message.data[0] == 0xFF:
            return bytes(message.data)


def main() -> None:
    """Arrange one list, let it run, take it off again."""
    rows = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    channel = sys.argv[2] if len(sys.argv) > 2 else "can2"
    address = struct.pack("<I", BASE + 4 * MCH_ANGLE).hex()
    filters = [{"can_id": SLAVE, "can_mask": 0x7FF}]
    with can.Bus(interface="ranger_sim", channel=channel, can_filters=filters) as bus:
        say(bus, "FF00")  # CONNECT
        say(bus, "D6")  # FREE_DAQ
        say(bus, "D500 0100")  # ALLOC_DAQ: one list
        say(bus, "D400 0000 01")  # ALLOC_ODT: of one packet
        say(bus, "D300 0000 00 01")  # ALLOC_ODT_ENTRY: with one entry
        say(bus, "E200 0000 00 00")  # SET_DAQ_PTR
        say(bus, f"E1FF0400 {address}")  # WRITE_DAQ: four bytes
        say(bus, "E010 0000 0000 01 00")  # SET_DAQ_LIST_MODE: event 0 (0.5 ms), with stamps
        say(bus, "DE01 0000")  # START_STOP_DAQ_LIST
        before = passed = 0
        for row in range(rows):
            message = bus.recv(2.0)
            if message is None:
                raise SystemExit("no measurement: is the robot paused?")
            _, stamp, angle = struct.unpack("<BHf", message.data)
            passed += (stamp - before) % 65536 if row else 0
            before = stamp
            print(f"{passed * TICK_S * 1e3:8.2f} ms  {angle:8.4f} rad")
        say(bus, "DE00 0000")
        say(bus, "FE")  # DISCONNECT


if __name__ == "__main__":
    main()
