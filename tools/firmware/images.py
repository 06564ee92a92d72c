"""`--image` of walk and up: firmware images that replace boards' programs."""

import argparse
import pathlib

from ranger_sim.firmware_sim.lpc2194 import image
from ranger_sim.firmware_sim.lpc2194.image import Image
from ranger_sim.foundation.user_error import UserError
from ranger_sim.ranger.firmware import image_boards
from ranger_sim.tools.command_line.options import Option
from ranger_sim.tools.command_line.units import word

IMAGE = Option(
    "--image",
    "a firmware image instead of the emulated board, run instruction by instruction: an ELF file (.axf) or Intel HEX",
    word("BOARD=FILE"),
    "BOARD=FILE",
    repeated=True,
)
OPTIONS = (IMAGE,)


def files_of(options: argparse.Namespace) -> dict[str, str]:
    """The files of --image, by board. UserError for a board that is unknown or has two."""
    wanted: dict[str, str] = {}
    for text in options.image:
        board, path = image_boards.placed(text)
        if board in wanted:
            raise UserError(f"--image {text}: {board} has {wanted[board]} already")
        wanted[board] = path
    return wanted


def images_of(options: argparse.Namespace) -> dict[str, Image]:
    """Read the requested images, by board."""
    return {board: image.read(pathlib.Path(path)) for board, path in files_of(options).items()}
