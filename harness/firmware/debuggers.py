"""Endpoints for debuggers at boards of a machine that run machine code."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

from ranger_sim.firmware_sim.gdb.server import GdbServer, never
from ranger_sim.foundation.user_error import FirmwareError, unknown


class Place(NamedTuple):
    """The address at which the debugger of `board` connects."""

    board: str
    host: str
    port: int


def placed(text: str) -> Place:
    """`MCH=3333` or `MCH=192.168.1.2:3333`; UserError for other forms."""
    board, _, where = text.partition("=")
    host, _, port = where.rpartition(":")
    if not board or not port.isdecimal():
        raise FirmwareError(f"gdb {text!r}: BOARD=PORT or BOARD=HOST:PORT is expected, as in MCH=3333")
    return Place(board, host or "127.0.0.1", int(port))


def open_doors(
    boards: Mapping[str, Any], wanted: Iterable[str], allow_network: bool = False, ends: Callable[[], bool] = never
) -> list[GdbServer]:
    """A debugger endpoint for each of `wanted` ("MCH=3333"), whose boards have their own processor.

    UserError for a board that has none or is named twice, and for a port that is not available.
    """
    doors: list[GdbServer] = []
    try:
        for text in wanted:
            place = placed(text)
            if place.board not in boards:
                raise FirmwareError(f"gdb {text}: {unknown('board', place.board, boards)}")
            board = boards[place.board]
            if getattr(board, "core", None) is None:
                raise FirmwareError(f"gdb {text}: {place.board} runs no machine code, so give it an --image")
            if any(door.board is board for door in doors):
                raise FirmwareError(f"gdb {text}: {place.board} has a door already")
            doors.append(GdbServer(board, place.port, place.host, allow_network, ends))
    except BaseException:
        close_doors(doors)
        raise
    for door in doors:
        door.together(doors)
    return doors


def close_doors(doors: Iterable[GdbServer]) -> None:
    """Close the endpoints and disconnect debuggers."""
    for door in doors:
        door.close()
