"""The servo: two boards in C on one bus, and the arm that they move.

    with contextlib.closing(Servo(seed=3)) as servo:
        servo.until("angle_rad > 1.4", within="1 s")
        print(servo.quantities(), servo.counters()["DRIVE"].slots.max_cycles)

Read WIRING from left to right in the direction in which signals go.
"""

import pathlib

import faults
from body import Arm, Numbers

from ranger_sim.datatable.loader import load_table
from ranger_sim.firmware_sim.clock import seeded_crystal
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.harness.firmware.native_firmware import build
from ranger_sim.harness.firmware.table_board import TableBoard
from ranger_sim.harness.machine import Machine
from ranger_sim.harness.names import Names
from ranger_sim.harness.wiring.wires import AnalogInput, BridgeWire, CanWire, EncoderWire, Wiring

HERE = pathlib.Path(__file__).resolve().parent
TABLE = HERE / "table"
FIRMWARE = {"DRIVE": HERE / "drive", "CONTROL": HERE / "control"}
POWER_UP_SPREAD_NS = 2_000_000  # power comes to both together; resets and start-up code differ so much at most

WIRING = Wiring(
    can=[CanWire("DRIVE", 1, 1), CanWire("CONTROL", 1, 1)],
    encoders=[EncoderWire(0, "DRIVE", "P0.22", "P0.27")],
    analog=[AnalogInput(0, "DRIVE", "AIN0")],
    bridges=[BridgeWire("DRIVE", 0)],
    names={"DRIVE": {"P0.22": 22, "P0.27": 27, "AIN0": 0}},
)


class Servo(Machine):
    """One servo. Same seed and numbers, same bytes. Close it when done.

    numbers: of motor and arm; firmware: folders that take the place of a board's own, by board; log: as `Machine`.
    """

    def __init__(self, seed: int = 1, numbers: Numbers | None = None, log: str = "none", firmware=None) -> None:
        table = load_table(TABLE)
        folders = FIRMWARE | (firmware if firmware is not None else {})
        boards = {name: self.new_board(name, folder, seed) for name, folder in folders.items()}
        super().__init__(
            plant=Arm(numbers, seed),
            boards=boards,
            buses={"can1": table.bit_rates["CAN1"]},
            wiring=WIRING,
            seed=seed,
            log=log,
            names=Names.of(table),
            places=faults.PLACES,
        )

    @staticmethod
    def new_board(name: str, folder: pathlib.Path, seed: int) -> TableBoard:
        """A board on its own crystal, powered up in its own moment."""
        stream = RandomStream(seed, f"board {name}")
        crystal = seeded_crystal(stream)
        return TableBoard(name, build(folder), 1, crystal, stream.integer(POWER_UP_SPREAD_NS))


def new(seed: int = 1, log: str = "none", **numbers: float) -> Servo:
    """One with these of its `Numbers`, as marks of tests and campaigns give them."""
    return Servo(seed, Numbers(**numbers), log)
