"""What runs on the robot's boards, and the factory that makes them: emulated firmware, a program in C, or an image."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Protocol

from ranger_sim.boards.can_router import CanRouterBoard
from ranger_sim.boards.hip import HipBoard
from ranger_sim.boards.inner_feet import InnerFeetBoard
from ranger_sim.boards.main_brain.board import MainBrainBoard
from ranger_sim.boards.main_brain.controllers import Controller
from ranger_sim.boards.outer_feet import OuterFeetBoard
from ranger_sim.boards.quirks import Quirks
from ranger_sim.boards.steering import SteeringBoard
from ranger_sim.boards.user_interface import UserInterfaceBoard
from ranger_sim.firmware_sim.clock import seeded_crystal
from ranger_sim.firmware_sim.lpc2194.image import Image
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.harness.firmware.native_firmware import Firmware
from ranger_sim.ranger.firmware.programs_in_c import ProgramsInC

# Boards are powered up together but their resets and start-up code differ: first slots spread over 2 ms.
POWER_UP_SPREAD_NS = 2_000_000

BOARD_CLASSES: dict[str, Any] = {
    "MCH": HipBoard,
    "MCFO": OuterFeetBoard,
    "MCFI": InnerFeetBoard,
    "MCSI": SteeringBoard,
    "UI": UserInterfaceBoard,
    "CSR": CanRouterBoard,
    "MB": MainBrainBoard,
}


class Program(Protocol):
    """A kind of program on a board."""

    def board(self, name: str, crystal: Any, power_up_ns: int, record: Any) -> Any:
        """A new, unwired board that runs it. record: memory for its position when it ends its process."""

    def waits_for_slots(self, board: Any) -> bool:
        """Whether its handlers are known to leave frames, edges and bytes to its tasks, where the wiring says so."""


@dataclasses.dataclass(frozen=True)
class Emulated:
    """The emulated firmware of boards/."""

    quirks: Quirks
    controller: Controller

    def board(self, name: str, crystal: Any, power_up_ns: int, record: Any) -> Any:
        if name == "MB":
            return MainBrainBoard(crystal, self.quirks, power_up_ns, controller=self.controller)
        return BOARD_CLASSES[name](crystal, self.quirks, power_up_ns)

    def waits_for_slots(self, board: Any) -> bool:
        return True


@dataclasses.dataclass(frozen=True)
class InC:
    """A program in C, compiled for this computer; one of the robot's `programs`."""

    firmware: Firmware
    programs: ProgramsInC

    def board(self, name: str, crystal: Any, power_up_ns: int, record: Any) -> Any:
        if self.programs.elsewhere:
            from ranger_sim.ranger.firmware.robot_stand_in import RobotStandIn

            return RobotStandIn(name, crystal, self.programs.trials[name].description)
        from ranger_sim.ranger.firmware.robot_native_board import RobotNativeBoard  # only here: it loads cffi

        with self.programs.printing(name):
            board = RobotNativeBoard(name, self.firmware, crystal, power_up_ns, record)
        board.counts = self.firmware.counts
        if record is None and self.programs.are_watched:  # it replaces another board
            self.programs.watch(board)
        return board

    def waits_for_slots(self, board: Any) -> bool:
        found = board if self.programs.elsewhere else board.scheduler
        return bool(found.names_transmitters)  # else its handlers may send


@dataclasses.dataclass(frozen=True)
class OfImage:
    """A firmware image, executed instruction by instruction; what its handlers do is unknown."""

    image: Image

    def board(self, name: str, crystal: Any, power_up_ns: int, record: Any) -> Any:
        from ranger_sim.ranger.firmware.robot_image_board import RobotImageBoard  # only here: a processor, ELF files

        return RobotImageBoard(name, self.image, crystal, power_up_ns)

    def waits_for_slots(self, board: Any) -> bool:
        return False


class BoardFactory:
    """Makes the boards of a robot. programs: by board; a board without an entry runs `emulated`.

    seed: of the scenario; it chooses each board's crystal, and its power-up time after the robot's, `start_ns`.
    """

    def __init__(self, seed: int, start_ns: int, emulated: Emulated, programs: Mapping[str, Program]) -> None:
        self.seed = seed
        self.start_ns = start_ns
        self.emulated = emulated
        self.programs = programs

    def program(self, name: str) -> Program:
        """What a board runs."""
        return self.programs.get(name, self.emulated)

    def first_board(self, name: str, record: Any = None) -> Any:
        """The board that gets its power when the robot is switched on; otherwise as `board`."""
        crystal, delay_ns = self._drawn(name)
        return self.program(name).board(name, crystal, self.start_ns + delay_ns, record)

    def board(self, name: str, power_up_ns: int, record: Any = None) -> Any:
        """A new, unwired board with its own crystal, powered up at `power_up_ns`.

        record: memory in which a program in C leaves its position when it ends this process.
        """
        return self.program(name).board(name, self.crystal(name), power_up_ns, record)

    def crystal(self, name: str) -> Any:
        """A new crystal of a board, as it was bought."""
        return self._drawn(name)[0]

    def _drawn(self, name: str) -> tuple[Any, int]:
        """(crystal, power-up time after the robot's in ns) of a board."""
        stream = RandomStream(self.seed, f"board {name}")
        return seeded_crystal(stream), stream.integer(POWER_UP_SPREAD_NS)
