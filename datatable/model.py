"""The master table as checked data: boards, variables, errors, and the faults a table can have."""

from __future__ import annotations

import dataclasses
from fractions import Fraction

from ranger_sim.foundation.numbers import float32
from ranger_sim.foundation.user_error import TableError, unknown

LARGEST_CAN_ID = 2031  # identifiers 2032-2047 are illegal: their first 7 bits are recessive (robot.md N1.5)
LARGEST_ID = 0xFFFF  # ids have 16 bits (appendix 4.1)
LONGEST_NAME = 32  # characters; the limit of a name in a DBC file and of a portable C identifier
TYPES = ("f32", "i32", "u32")
FD_LENGTHS = (8, 12, 16, 20, 24, 32, 48, 64)  # bytes of CAN FD frames that hold a value and a time
MOST_ELEMENTS = 15  # of a variable on a CAN FD bus: 64 bytes, of which the time has four
LARGEST_SINGLE = float.fromhex("0x1.fffffep127")
LIMITS = {
    "f32": (-LARGEST_SINGLE, LARGEST_SINGLE),
    "i32": (-(1 << 31), (1 << 31) - 1),
    "u32": (0, (1 << 32) - 1),
}
COMPUTER = "PC"  # the board that publishes parameters
ROUTER, MAIN_BRAIN = "router", "main brain"
ROLES = ("satellite", ROUTER, MAIN_BRAIN, "computer")
# Models of processors that a board with firmware may name, and their highest clocks in Hz (user manuals UM10114 and
# UM10326). Without a name it has the LPC2194's devices at any clock.
CAN_KINDS = ("classic", "fd")
PROCESSORS = {"LPC2194": 60_000_000, "LPC2194/01": 60_000_000, "LPC3250": 208_000_000}


@dataclasses.dataclass(frozen=True)
class Fault:
    """One fault of a table: file, line (1 is the header), the row's name, field, rule broken."""

    file: str
    line: int
    row: str
    field: str
    rule: str

    def __str__(self) -> str:
        what = " ".join(part for part in (self.row, self.field) if part)
        return f"{self.file}:{self.line} {what}: {self.rule}" if what else f"{self.file}:{self.line}: {self.rule}"


class FaultyTableError(TableError):
    """A bad table, with all its faults: `faults` in file order, and one line each as the message."""

    def __init__(self, faults: list[Fault]) -> None:
        self.faults = tuple(faults)
        super().__init__(*(str(fault) for fault in self.faults))


@dataclasses.dataclass(frozen=True)
class Board:
    """A board (or the computer) from boards.toml. Times in us; lists name variables or "(work)"."""

    name: str
    number: int
    description: str
    role: str
    firmware: bool
    buses: tuple[str, ...]
    controller: int  # CAN controller on the board, 0 for none
    ribbon: int
    processor: str
    clock_hz: int
    sends_itself: tuple[str, ...]
    slot_us: int  # 0 when the board runs no schedule
    every: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    occasional: tuple[str, ...]
    occasional_row: int | None
    can: str = ""  # its CAN controllers, of a board with firmware: "fd", or "classic" as those of an LPC2194

    def sends_per_s(self) -> dict[str, Fraction]:
        """How often per second the schedule sends each variable, exact.

        The occasional list has one idle call after its last entry (robot.md N3.1), so n entries need
        n + 1 calls, one per pass through the rows.
        """
        rates: dict[str, Fraction] = {}
        if not self.slot_us or not self.rows:
            return rates
        slots_per_s = Fraction(1_000_000, self.slot_us)
        passes_per_s = slots_per_s / len(self.rows)

        def add(names: tuple[str, ...], rate: Fraction) -> None:
            for name in names:
                if not name.startswith("("):
                    rates[name] = rates.get(name, Fraction(0)) + rate

        add(self.every, slots_per_s)
        for row in self.rows:
            add(row, passes_per_s)
        add(self.occasional, passes_per_s / (len(self.occasional) + 1))
        return rates

    def periods_ms(self) -> dict[str, Fraction]:
        """Mean period of each scheduled variable in ms, exact."""
        return {name: 1000 / rate for name, rate in self.sends_per_s().items()}


@dataclasses.dataclass(frozen=True)
class Variable:
    """One row of variables.csv. `count`: values in one frame, above 1 on CAN FD buses only."""

    id: int
    name: str
    type: str
    unit: str
    initial: float | int
    publisher: str
    subscribers: tuple[str, ...]
    buses: tuple[str, ...]
    period_ms: Fraction | None
    minimum: float | int | None
    maximum: float | int | None
    description: str
    count: int = 1

    @property
    def frame_bytes(self) -> int:
        """Length of its frame: its values and a time of four bytes each, filled up to a length that there is."""
        return next(length for length in FD_LENGTHS if length >= 4 * self.count + 4)

    @property
    def initial_as_stored(self) -> float | int:
        """The initial value as 32 bits hold it."""
        return float32(self.initial) if self.type == "f32" else self.initial

    @property
    def is_error_word(self) -> bool:
        """True for words packed as error frames: code, board, count (robot.md N1.7)."""
        return self.type == "u32" and self.name.startswith("ERROR_")

    @property
    def is_spare(self) -> bool:
        """True for the named spare slots of the robot's table."""
        return "_EMPTY" in self.name


@dataclasses.dataclass(frozen=True)
class ErrorCode:
    """One row of errors.csv. `normal_per_s`, `normal_at_start`: the most that a healthy walk raises, by board."""

    id: int
    name: str
    boards: tuple[str, ...]
    description: str
    normal_per_s: dict[str, float] = dataclasses.field(default_factory=dict)
    normal_at_start: dict[str, float] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class Table:
    """The whole master table, checked. Variables and errors are sorted by id, boards by number."""

    boards: tuple[Board, ...]
    variables: tuple[Variable, ...]
    errors: tuple[ErrorCode, ...]
    channels: dict[str, int]  # bus name -> the router's channel number
    bit_rates: dict[str, int]  # bus name -> bit/s
    hash: str
    data_bit_rates: dict[str, int] = dataclasses.field(default_factory=dict)  # CAN FD bus name -> bit/s

    def board(self, name: str) -> Board:
        """The board of that name. UserError for an unknown name."""
        for board in self.boards:
            if board.name == name:
                return board
        raise TableError(unknown("board", name, (board.name for board in self.boards)))

    def rates(self, bus: str) -> int | tuple[int, int]:
        """The bit rate of a bus, bit/s; of a CAN FD bus that and the data's, as `harness.machine.Machine` has them."""
        return (self.bit_rates[bus], self.data_bit_rates[bus]) if bus in self.data_bit_rates else self.bit_rates[bus]

    def with_role(self, role: str) -> tuple[Board, ...]:
        """All boards of a role."""
        return tuple(board for board in self.boards if board.role == role)

    def variable(self, name_or_id: str | int) -> Variable:
        """A variable by name (any case) or id. UserError for an unknown one."""
        wanted = str(name_or_id).strip()
        for variable in self.variables:
            if variable.name == wanted.upper() or str(variable.id) == wanted:
                return variable
        what = unknown("variable", wanted.upper(), (variable.name for variable in self.variables))
        raise TableError(f"{what}; `ranger-sim table list` shows all")

    def published_by(self, board: str) -> tuple[Variable, ...]:
        """Variables that `board` publishes, by id."""
        return tuple(variable for variable in self.variables if variable.publisher == board)

    def subscribed_by(self, board: str) -> tuple[Variable, ...]:
        """Variables that `board` subscribes to, by id."""
        return tuple(variable for variable in self.variables if board in variable.subscribers)

    def on_bus(self, bus: str) -> tuple[Variable, ...]:
        """Variables carried on `bus`, by id."""
        return tuple(variable for variable in self.variables if bus in variable.buses)
