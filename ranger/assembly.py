"""The parts of one robot, made in the order in which a signal passes them; `Machine` then wires them.

plant -> sensors -> boards -> CAN -> boards -> bridges -> plant
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ranger_sim import datatable
from ranger_sim.firmware_sim.lpc2194.image import Image
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.outside import bus_schedule
from ranger_sim.harness.outside.profile import Profile
from ranger_sim.plant import body_files
from ranger_sim.plant.ranger import RangerPlant
from ranger_sim.ranger import wiring
from ranger_sim.ranger.board_programs import BoardFactory, Emulated, InC, OfImage, Program
from ranger_sim.ranger.firmware.programs_in_c import ProgramsInC
from ranger_sim.ranger.scenario import Scenario

BUSES = ("can1", "can2", "can3", "can4")
BUS_BIT_RATE = 3_000_000  # bit/s, appendix 3.11


class Parts(NamedTuple):
    """A robot before it is wired: its body, its boards in the order in which they run, its buses' bit rates."""

    plant: RangerPlant
    boards: dict[str, Any]
    buses: dict[str, int]


def factory_of(
    scenario: Scenario, emulated: Emulated, in_c: ProgramsInC, images: dict[str, Image], profile: Profile | None
) -> BoardFactory:
    """The factory of a robot's boards. UserError for a board with two programs, or one in C that does not start."""
    for name, image in images.items():
        if name in in_c.firmware:
            raise UserError(f"{name} is to run both {in_c.firmware[name].folder} and {image.path}")
    programs: dict[str, Program] = {
        **{name: InC(firmware, in_c) for name, firmware in in_c.firmware.items()},
        **{name: OfImage(image) for name, image in images.items()},
    }
    factory = BoardFactory(scenario.seed, scenario.start_uptime_ms * 1_000_000, emulated, programs)

    def tried_board(name: str, record: Any) -> Any:
        board = factory.first_board(name, record)
        if profile is not None:
            bus_schedule.apply(board, profile.schedules())
        return board

    in_c.try_each(tried_board)
    return factory


def parts_of(scenario: Scenario, body: body_files.BodyFile, factory: BoardFactory, profile: Profile | None) -> Parts:
    """The parts of a robot: its body by the scenario, its boards by the factory, its buses by the profile."""
    datatable.check_own_table()
    plant = plant_of(scenario, body)

    # each on its own crystal, powered up at its own time
    boards = {name: factory.first_board(name) for name in wiring.BOARDS}
    if isinstance(factory.program("CSR"), Emulated):
        boards["CSR"].time.ms = scenario.start_uptime_ms

    rates = dict.fromkeys(BUSES, BUS_BIT_RATE)
    if profile is not None:
        rates |= {name: bus.bit_rate for name, bus in profile.buses.items() if name in rates}
        for board in boards.values():
            if not board.out_of_process:  # else where its program is
                bus_schedule.apply(board, profile.schedules())
    return Parts(plant, boards, rates)


def plant_of(scenario: Scenario, body: body_files.BodyFile) -> RangerPlant:
    """The body of a scenario, with its sensors."""
    return RangerPlant(
        seed=scenario.seed,
        slope_rad=scenario.slope_rad,
        floor_roughness_m=scenario.floor_roughness_m,
        model_file=scenario.model_file,
        start_ns=scenario.start_uptime_ms * 1_000_000,
        parameters=body.parameters,
        electrics=scenario.electrics(body.electrics),
    )
