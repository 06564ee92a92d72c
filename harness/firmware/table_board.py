"""A board with firmware in C and variables of a master table. Separate from native_firmware.py: it loads cffi."""

import dataclasses

import cython

from ranger_sim.datatable.loader import load_table
from ranger_sim.firmware_sim.native.hardware import Hardware
from ranger_sim.firmware_sim.native.native_board import NativeBoard
from ranger_sim.foundation.user_error import FirmwareError
from ranger_sim.harness.firmware.native_firmware import Firmware, table_version


@cython.cclass
class TableBoard(NativeBoard):
    """Board `name` with `firmware` from `power_up_ns` (ns) on; its CAN controller `controller` is on a bus.

    UserError for a program that was compiled with another version of the table, or does not start its controller.
    hardware: devices on its chip, where the manifest does not list them. record: as of NativeBoard.
    """

    def __init__(
        self, name, firmware, controller, crystal=None, power_up_ns=0, hardware=None, version=None, record=None
    ) -> None:
        given = firmware.manifest.hardware
        if given is None:
            given = hardware
        elif hardware is not None:  # a manifest cannot describe what a person sees of the board
            given = dataclasses.replace(given, panel=hardware.panel)
        given = as_the_table_has_it(name, firmware, given if given is not None else Hardware())
        NativeBoard.__init__(self, name, firmware.library, crystal, power_up_ns, given, record)
        wanted = table_version(firmware.table) if version is None and firmware.table is not None else version
        compiled = self.library.table_version()
        if compiled is not None and wanted is not None and compiled != wanted:
            raise FirmwareError(
                f"{firmware.library}: compiled with version 0x{compiled:08X} of the master table, "
                f"this robot has 0x{wanted:08X}: build it again"
            )
        if controller and controller not in self.devices.cans and controller not in self.devices.fds:
            call, kind = ("fw_canfd_start", "CAN FD") if given.can == "fd" else ("fw_can_start", "CAN")
            raise FirmwareError(
                f"{firmware.library}: firmware_start() does not start {kind} controller {controller}, "
                f"on which {name}'s bus hangs ({call})"
            )


def as_the_table_has_it(name: str, firmware: Firmware, hardware: Hardware) -> Hardware:
    """`hardware` with the clock and the kind of CAN controllers that the firmware's master table gives the board.

    UserError where the manifest gives others.
    """
    master = firmware.manifest.master
    boards = () if master is None else load_table(master).boards
    board = next((board for board in boards if board.name == name), None)
    if board is None:
        return hardware
    for key, given, wanted in (("hz", hardware.hz, board.clock_hz), ("can", hardware.can, board.can)):
        if given and wanted and given != wanted:
            of_the_table = "clock_hz" if key == "hz" else key
            raise FirmwareError(
                f"{firmware.folder}: hardware.{key} is {given}, and {of_the_table} of {name} in {master} is {wanted}"
            )
    return dataclasses.replace(hardware, hz=hardware.hz or board.clock_hz, can=hardware.can or board.can)
