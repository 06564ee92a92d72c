"""Boards of the robot that can have firmware in C: the devices on their chips, and compiling it with the table."""

import functools
import os
import pathlib
from collections.abc import Mapping
from typing import Any, NamedTuple

from ranger_sim.boards import ankle_board, hip, motor_board, steering
from ranger_sim.boards.modules.front_panel import FrontPanel
from ranger_sim.datatable import generated
from ranger_sim.datatable.generated import mcfi, mcfo, mch, mcsi, ui
from ranger_sim.firmware_sim.native import build as compiling
from ranger_sim.firmware_sim.native import image_build
from ranger_sim.firmware_sim.native.hardware import ExternalConverter, Hardware, InternalConverter
from ranger_sim.firmware_sim.peripherals.adc_external import CONVERSION_NS as FASTEST_CONVERSION_NS
from ranger_sim.foundation.user_error import FirmwareError
from ranger_sim.harness.firmware import native_firmware
from ranger_sim.harness.firmware.native_firmware import Firmware

BATTERY_VOLTAGE_CHANNEL = 1  # AIN1, P0.28


class Place(NamedTuple):
    """A board that firmware in C can take: its generated table and, of one with a motor, its external converter."""

    table: Any
    sequence: tuple[tuple[str, int, int], ...] = ()  # (analog input, multiplexer code, gain code)
    conversion_ns: int = 0


PLACES = {
    "MCH": Place(mch, hip.SEQUENCE, FASTEST_CONVERSION_NS),
    "MCFO": Place(mcfo, ankle_board.SEQUENCE, motor_board.CONVERSION_NS),
    "MCFI": Place(mcfi, ankle_board.SEQUENCE, motor_board.CONVERSION_NS),
    "MCSI": Place(mcsi, steering.SEQUENCE, motor_board.CONVERSION_NS),
    "UI": Place(ui),
}


def hardware_of(board: str) -> Hardware:
    """The devices on the chip of a board of the robot, as on the emulated one."""
    place = PLACES[board]
    if not place.sequence:
        return Hardware(hz=place.table.CLOCK_HZ, external=None, spi={}, panel=FrontPanel)
    return Hardware(
        hz=place.table.CLOCK_HZ,
        external=ExternalConverter(
            eint=1,
            conversion_ns=place.conversion_ns,
            inputs={code: motor_board.ANALOG[name] for name, code, _ in place.sequence},
        ),
        internal=InternalConverter(inputs={BATTERY_VOLTAGE_CHANNEL: motor_board.ANALOG["battery_voltage"]}),
    )


def build(folder: str | pathlib.Path, sanitize: bool = False, coverage: bool = False) -> Firmware:
    """Compile a folder of firmware, with the generated C of the tables that it names, unless it is up to date."""
    return native_firmware.build(folder, generated_c(), sanitize, coverage)


def build_image(folder: str | pathlib.Path) -> image_build.Image:
    """The same for the chip: an image for an LPC2194."""
    return native_firmware.build_image(folder, generated_c())


def built(wanted: Mapping[str, Firmware | str | os.PathLike]) -> dict[str, Firmware]:
    """The firmware of each board, folders compiled unless up to date. UserError for a board that takes none."""
    return {
        known(board): each if isinstance(each, Firmware) else build(pathlib.Path(each))
        for board, each in wanted.items()
    }


def include_folders() -> tuple[pathlib.Path, ...]:
    """Where firmware.h and the table's headers are."""
    return compiling.INCLUDE, generated_c()


def generated_c() -> pathlib.Path:
    """The folder of the table's generated C."""
    return pathlib.Path(next(iter(generated.__path__))) / "c"


@functools.cache
def table_version() -> int:
    """RANGER_TABLE_VERSION of the table that this robot has."""
    return native_firmware.table_version(generated_c())


def placed(text: str) -> tuple[str, str]:
    """Board and folder of `MCH=DIR`; UserError for other forms."""
    board, equals, folder = text.partition("=")
    if not equals or not folder:
        raise FirmwareError(f"firmware {text!r}: BOARD=DIR is expected, as in MCH=examples/hip_in_c")
    return known(board), folder


def known(board: str) -> str:
    """A board that firmware in C can take."""
    if board not in PLACES:
        raise FirmwareError(f"firmware for board {board!r}: boards that can run firmware in C are {', '.join(PLACES)}")
    return board
