"""Boards of the robot that can run a firmware image: the devices on their chips."""

import os
import pathlib
from collections.abc import Mapping

from ranger_sim.boards import ankle_board, can_router, hip, motor_board, steering
from ranger_sim.boards.modules.front_panel import FrontPanel
from ranger_sim.firmware_sim.lpc2194.hardware import BoardHardware
from ranger_sim.firmware_sim.lpc2194.image import Image, read
from ranger_sim.firmware_sim.native.hardware import ExternalConverter, InternalConverter, SpiDevice
from ranger_sim.foundation.user_error import FirmwareError

BATTERY_VOLTAGE_CHANNEL = 1  # AIN1, P0.28
SEQUENCES = {
    "MCH": hip.SEQUENCE,
    "MCFO": ankle_board.SEQUENCE,
    "MCFI": ankle_board.SEQUENCE,
    "MCSI": steering.SEQUENCE,
}
# The router exchanges a segment every 200 us by its own crystal, 30 ppm off at most; its program feeds the words, so
# the last of them is some us early or late. No exchange may start earlier than the loop looks ahead
# (harness/lockstep.py): one that would be early waits.
LEAST_INTERVAL_NS = 199_980
BOARDS = (*SEQUENCES, "UI", "CSR")


def hardware_of(board: str) -> BoardHardware:
    """The devices on the chip of a board of the robot."""
    if board in SEQUENCES:
        switches = tuple(motor_board.PINS[name] for name in ("limit_switch_left", "limit_switch_right"))
        return BoardHardware(
            external=ExternalConverter(
                eint=1,
                conversion_ns=motor_board.CONVERSION_NS,
                inputs={code: motor_board.ANALOG[name] for name, code, _ in SEQUENCES[board]},
            ),
            internal=InternalConverter(inputs={BATTERY_VOLTAGE_CHANNEL: motor_board.ANALOG["battery_voltage"]}),
            spi={0: SpiDevice(word=motor_board.WORDS["absolute_encoder"])},
            pulled_up=switches,
        )
    if board == "CSR":
        return BoardHardware(
            external=None,
            internal=InternalConverter(
                inputs={0: can_router.ANALOG["supply_current"], 1: can_router.ANALOG["supply_voltage"]}
            ),
            spi={},
            segment_interval_ns=LEAST_INTERVAL_NS,
            slot_timer=0,
        )
    return BoardHardware(external=None, spi={}, panel=FrontPanel)


def known(board: str) -> str:
    """Return `board`, which must be able to run an image."""
    if board not in BOARDS:
        raise FirmwareError(f"image for board {board!r}: boards that can run a firmware image are {', '.join(BOARDS)}")
    return board


def placed(text: str) -> tuple[str, str]:
    """Board and file of `MCH=FILE`; UserError for other forms."""
    board, equals, path = text.partition("=")
    if not equals or not path:
        raise FirmwareError(f"image {text!r}: BOARD=FILE is expected, as in MCH=B2A_Hip_Motor_Controller.axf")
    return known(board), path


def loaded(wanted: Mapping[str, Image | str | os.PathLike]) -> dict[str, Image]:
    """The image of each board, files read. UserError for a board that takes no image, and for a file that is none."""
    return {
        known(board): each if isinstance(each, Image) else read(pathlib.Path(each)) for board, each in wanted.items()
    }
