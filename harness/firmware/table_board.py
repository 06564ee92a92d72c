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
        given = at_the_tables_clock(name, firmware, given if given is not None else Hardware())
        NativeBoard.__init__(self, name, firmware.library, crystal, power_up_ns, given, record)
        wanted = table_version(firmware.table) if version is None and firmware.table is not None else version
        compiled = self.library.table_version()
        if compiled is not None and wanted is not None and compiled != wanted:
            raise FirmwareError(
                f"{firmware.library}: compiled with version 0x{compiled:08X} of the master table, "
                f"this robot has 0x{wanted:08X}: build it again"
            )
        if controller and controller not in self.devices.cans:
            raise FirmwareError(
                f"{firmware.library}: firmware_start() does not start CAN controller {controller}, "
                f"on which {name}'s bus hangs (fw_can_start)"
            )


def at_the_tables_clock(name: str, firmware: Firmware, hardware: Hardware) -> Hardware:
    """`hardware` with the clock that the firmware's master table gives the board, if it gives one.

    UserError where the manifest gives another one.
    """
    master = firmware.manifest.master
    boards = () if master is None else load_table(master).boards
    clock_hz = next((board.clock_hz for board in boards if board.name == name), 0)
    if not clock_hz or hardware.hz == clock_hz:
        return hardware
    if hardware.hz:
        raise FirmwareError(
            f"{firmware.folder}: hardware.hz is {hardware.hz}, and clock_hz of {name} in {master} is {clock_hz}"
        )
    return dataclasses.replace(hardware, hz=clock_hz)
