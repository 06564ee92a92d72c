"""Reads the master files and checks them against the rules; all faults are reported together.

A main brain, a router and the serial link SSP between them belong together: a table has all three or none. A table is
accepted whole or refused. No content of a file raises anything but TableError.
"""

from __future__ import annotations

import csv
import hashlib
import io
import keyword
import pathlib
import re
from collections.abc import Callable, Collection, Iterable
from fractions import Fraction
from typing import Any

from ranger_sim.datatable.addresses import XCP_IDS
from ranger_sim.datatable.model import (
    CAN_KINDS,
    LARGEST_CAN_ID,
    LARGEST_ID,
    LIMITS,
    LONGEST_NAME,
    MAIN_BRAIN,
    MOST_ELEMENTS,
    PROCESSORS,
    ROLES,
    ROUTER,
    TYPES,
    Board,
    ErrorCode,
    Fault,
    FaultyTableError,
    Table,
    Variable,
)
from ranger_sim.datatable.routing import unreachable
from ranger_sim.foundation import toml_file
from ranger_sim.loading import OWN_TABLE

MASTER_FOLDER = pathlib.Path(__file__).parent / "master"
BOARDS_FILE, VARIABLES_FILE, ERRORS_FILE = "boards.toml", "variables.csv", "errors.csv"
VARIABLE_COLUMNS = (
    "id",
    "name",
    "type",
    "unit",
    "initial",
    "publisher",
    "subscribers",
    "bus",
    "period_ms",
    "minimum",
    "maximum",
    "description",
)
ERROR_COLUMNS = ("id", "name", "boards", "normal_per_s", "normal_at_start", "description")

NAME = re.compile(r"[A-Z][A-Z0-9_]*")
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?", re.ASCII)
WHOLE = re.compile(r"\d{1,9}", re.ASCII)
TEXT = re.compile(r"[ -~]*")  # printable ASCII: the texts go into C and DBC files
MOST_ROWS = 65536
MOST_NORMAL = 1e6  # of errors; no board of the robot counts more than one per slot and cause

# Names that would collide in generated files: Python module constants, C keywords (structure members are the
# names in lower case), C macros, sections of a DBC file, and modules other than the boards'.
RESERVED_NAMES = frozenset(
    "BOARD BOARD_NUMBER BUS CONTROLLER CLOCK_HZ SLOT_US ROWS ROW_NAMES OCCASIONAL_NAMES OCCASIONAL_ROW "
    "ERROR_VARIABLE SEND SEND_TYPES RECEIVE RECEIVE_TYPES TYPES INITIAL NAMES ERRORS LAST DESCRIPTIONS "
    "AUTO BREAK CASE CHAR CONST CONTINUE DEFAULT DO DOUBLE ELSE ENUM EXTERN FLOAT FOR GOTO IF INLINE INT LONG "
    "REGISTER RESTRICT RETURN SHORT SIGNED SIZEOF STATIC STRUCT SWITCH TYPEDEF UNION UNSIGNED VOID VOLATILE WHILE "
    "INT32_MIN INT32_C UINT32_C NULL OFFSETOF "
    "BO_ SG_ CM_ BA_ BU_ EV_ VAL_ BS_ NS_ NS_DESC_ VAL_TABLE_ BA_DEF_ BA_DEF_DEF_ SIG_VALTYPE_".split()
)
RESERVED_PREFIXES = ("ERR_", "RANGER_")
RESERVED_SUFFIXES = ("_BOARD_NUMBER", "_SLOT_US", "_ROWS", "_SEND_COUNT", "_RECEIVE_COUNT", "_BIT_RATE", "_TABLE_H")
RESERVED_ERRORS = frozenset(("LAST", "NAMES", "DESCRIPTIONS", "NORMAL_PER_S", "NORMAL_AT_START"))
RESERVED_BOARDS = frozenset(("ERRORS", "ROUTES", "RANGER"))


class Faults:
    """Collects faults; `at` gives a reporter bound to a file, a line and the name of its row."""

    def __init__(self) -> None:
        self.found: list[Fault] = []

    def at(self, file: str, line: int, row: str) -> Callable[[str, str], None]:
        def report(field: str, rule: str) -> None:
            self.found.append(Fault(file, line, one_line(row, 40), one_line(field, 40), one_line(rule, 240)))

        return report


def one_line(text: str, longest: int) -> str:
    """`text` without control characters and not longer than `longest`: a file can hold anything."""
    plain = text if text.isprintable() else repr(text)[1:-1]
    return plain if len(plain) <= longest else plain[: longest - 3] + "..."


def shown(text: object) -> str:
    """A value for a fault message: quoted, on one line, shortened."""
    quoted = repr(text)
    return quoted if len(quoted) <= 60 else quoted[:57] + "..."


def folder_of(folder: str | pathlib.Path | None) -> pathlib.Path:
    """Folder of the master files: as given, or the user's own (RANGER_SIM_TABLE), or ours."""
    return (OWN_TABLE or MASTER_FOLDER) if folder is None else pathlib.Path(folder)


def read_text(path: pathlib.Path, faults: Faults) -> str | None:
    """The text of a master file; reports a fault and returns None when it cannot be read as UTF-8."""
    report = faults.at(path.name, 1, "")
    try:
        data = path.read_bytes()
    except (OSError, ValueError) as error:
        report("", f"cannot be read: {getattr(error, 'strerror', None) or error} ({path})")
        return None
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        faults.at(path.name, line, "")("", f"is not UTF-8 text (byte {data[error.start]:#04x})")
        return None
    if not text.strip():
        report("", "is empty")
        return None
    return text


def read_rows(path: pathlib.Path, columns: tuple[str, ...], faults: Faults) -> list[tuple[int, dict[str, str]]]:
    """(line, row) of a CSV file whose header is exactly `columns`; a row of another length is a fault."""
    text = read_text(path, faults)
    if text is None:
        return []
    rows: list[tuple[int, dict[str, str]]] = []
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        header = next(reader)
        if tuple(header) != columns:
            missing = [column for column in columns if column not in header]
            extra = [column for column in header if column not in columns]
            rule = "missing " + ", ".join(missing) if missing else ""
            rule += ("; " if rule and extra else "") + ("unknown " + shown(", ".join(extra)) if extra else "")
            rule = rule or "same columns in another order or twice"
            faults.at(path.name, 1, "")("header", f"{rule}; it must be {','.join(columns)}")
            return []
        line = reader.line_num
        for cells in reader:
            first, line = line + 1, reader.line_num
            if not cells:
                continue
            if len(cells) != len(columns):
                faults.at(path.name, first, shown(cells[min(1, len(cells) - 1)]))(
                    "", f"has {len(cells)} cells, the header has {len(columns)}"
                )
            elif len(rows) >= MOST_ROWS:
                faults.at(path.name, first, "")("", f"more than {MOST_ROWS} rows")
                break
            else:
                rows.append((first, dict(zip(columns, (cell.strip() for cell in cells), strict=True))))
    except (csv.Error, StopIteration) as error:
        faults.at(path.name, max(1, reader.line_num), "")("", f"is not CSV: {error or 'no rows'}")
    return rows


# ---- boards.toml


class BoardReader:
    """Parses one `[boards.NAME]` table; each wrong or unknown key is a fault."""

    def __init__(self, name: str, content: object, report: Callable[[str, str], None]) -> None:
        self.report = report
        self.content: dict[str, Any] = {}
        if isinstance(content, dict):
            self.content = dict(content)
        else:
            report("", f"is {shown(content)}, not a table")
        if len(name) > 8 or not NAME.fullmatch(name):
            report("", f"the name {shown(name)} is not up to 8 capital letters, digits and underscores")
        if name in RESERVED_BOARDS or keyword.iskeyword(name.lower()):
            report("", f"the name {shown(name)} is reserved for generated code")

    def take(self, key: str, kind: type, default: object = None) -> Any:
        """The value under `key`, of that kind; without a default the key must be there."""
        value = self.content.pop(key, default)
        if value is None:
            self.report(key, "is missing")
            return kind()
        if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
            self.report(key, f"is {shown(value)}, not {'text' if kind is str else kind.__name__}")
            return kind()
        if isinstance(value, str) and not TEXT.fullmatch(value):
            self.report(key, f"{shown(value)} has characters beyond printable ASCII")
            return ""
        return value

    def take_whole(self, key: str, least: int, most: int, default: int | None = None) -> int:
        value: int = self.take(key, int, default)
        if not least <= value <= most:
            self.report(key, f"is {shown(value)}, outside {least} ... {most}")
            return least
        return value

    def take_names(self, key: str, default: list[str] | None = None) -> tuple[str, ...]:
        return self.names(key, self.take(key, list, default))

    def names(self, key: str, value: object) -> tuple[str, ...]:
        if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
            self.report(key, f"is {shown(value)}, not a list of names")
            return ()
        return tuple(value)

    def finish(self) -> None:
        for key in self.content:
            self.report(shown(key), "is not a key of a board")


def board_of(
    name: str,
    content: object,
    channels: dict[str, int],
    fd_buses: Collection[str],
    routed: bool,
    report: Callable[[str, str], None],
) -> Board:
    """A board from its TOML table. `routed`: for a machine with a router, the bus given by its ribbon."""
    reader = BoardReader(name, content, report)
    role = reader.take("role", str, "satellite")
    if role not in ROLES:
        report("role", f"is {shown(role)}, not one of {', '.join(ROLES)}")
        role = "satellite"
    firmware = reader.take("firmware", bool)
    buses = reader.take_names("buses", [])
    for bus in buses:
        if bus not in channels:
            report("buses", f"unknown bus {shown(bus)}")
    buses = tuple(bus for bus in buses if bus in channels)
    on_can = role == "satellite"
    controller = reader.take_whole("controller", 0, 4, None if on_can else 0)
    ribbon = reader.take_whole("ribbon", 0, 1, None if on_can else 0) if routed else 0
    if routed and on_can and buses and channels[buses[0]] != controller + 2 * ribbon:
        report("buses", f"{buses[0]} is not controller + 2 x ribbon = CAN{controller + 2 * ribbon}")
    runs = firmware or "slot_us" in reader.content
    slot_us = reader.take_whole("slot_us", 1, 1_000_000) if runs else 0
    listed = reader.take("rows", list) if runs else []
    rows = tuple(reader.names(f"rows[{index}]", row) for index, row in enumerate(listed))
    if runs and not rows:
        report("rows", "a schedule needs at least one row")
    every = reader.take_names("every", []) if runs else ()
    occasional = reader.take_names("occasional", []) if runs else ()
    occasional_row = None
    if occasional:
        occasional_row = reader.take_whole("occasional_row", 0, max(0, len(rows) - 1))
    processor = reader.take("processor", str, "")
    clock_hz = reader.take_whole("clock_hz", 0, 10**10, 0)
    if firmware and processor:
        _check_processor(processor, clock_hz, report)
    can = _can_kind(reader, firmware, processor, report)
    for bus in buses if firmware else ():
        if bus in fd_buses and can != "fd":
            report(
                "buses",
                f"{bus} is a CAN FD bus, whose frames a classic controller destroys by error frames; "
                'can = "fd" gives the board CAN FD controllers',
            )
    board = Board(
        name=name,
        number=reader.take_whole("number", 0, 63),
        description=reader.take("description", str),
        role=role,
        firmware=firmware,
        buses=buses,
        controller=controller,
        ribbon=ribbon,
        processor=processor,
        clock_hz=clock_hz,
        sends_itself=reader.take_names("sends_itself", []),
        slot_us=slot_us,
        every=every,
        rows=rows,
        occasional=occasional,
        occasional_row=occasional_row,
        can=can,
    )
    reader.finish()
    return board


def _can_kind(reader: BoardReader, firmware: bool, processor: str, report: Callable[[str, str], None]) -> str:
    """The kind of a board's CAN controllers; empty where the table states none."""
    if not firmware:
        return ""
    can: str = reader.take("can", str, "")
    if can not in ("", *CAN_KINDS):
        report("can", f"is {shown(can)}, not one of {', '.join(CAN_KINDS)}")
    elif can == "fd" and processor:
        report(
            "can", f"is 'fd', and an {processor} has classic controllers; leave out processor for a chip with CAN FD"
        )
    return can


def _check_processor(processor: str, clock_hz: int, report: Callable[[str, str], None]) -> None:
    """Report a processor without a model, and a clock above its highest one."""
    if processor not in PROCESSORS:
        report(
            "processor",
            f"no model of {shown(processor)} (available: {', '.join(PROCESSORS)}); without the key the board has the "
            "LPC2194's devices at any clock_hz",
        )
    elif clock_hz > PROCESSORS[processor]:
        report("clock_hz", f"is {clock_hz}, above the {PROCESSORS[processor]} Hz of an {processor}")


def line_of_table(text: str, name: str) -> int:
    """The line of `[boards.NAME]` (1 when it is written differently)."""
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip().replace(" ", "").startswith(f"[boards.{name}]"):
            return number
    return 1


def read_boards(
    path: pathlib.Path, faults: Faults
) -> tuple[dict[str, Board], dict[str, int], dict[str, int], dict[str, int], dict[str, int]]:
    """Boards by name, their lines, channel, bit rate and (CAN FD) data bit rate of each bus."""
    boards: dict[str, Board] = {}
    lines: dict[str, int] = {}
    channels: dict[str, int] = {}
    rates: dict[str, int] = {}
    data_rates: dict[str, int] = {}
    nothing = boards, lines, channels, rates, data_rates
    text = read_text(path, faults)
    if text is None:
        return nothing
    try:
        content = toml_file.loads(text.encode(), path.name)
    except toml_file.TomlError as error:
        faults.at(path.name, error.line or 1, "")("", error.reason)
        return nothing
    report = faults.at(path.name, 1, "")
    for key in content:
        if key not in ("buses", "boards"):
            report(shown(key), "is not a section; the sections are buses and boards")
    sections: dict[str, dict[str, object]] = {}
    for key in ("buses", "boards"):
        section = content.get(key)
        if not isinstance(section, dict) or not section:
            report(key, "the section is missing or empty")
            section = {}
        sections[key] = section
    for name, bus in sections["buses"].items():
        if (
            not isinstance(bus, dict)
            or set(bus) - {"data_bit_rate"} != {"channel", "bit_rate"}
            or not all(type(value) is int and 0 <= value < 10**9 for value in bus.values())
        ):
            text = "needs exactly channel and bit_rate (a CAN FD bus data_bit_rate, too), whole numbers below 10^9"
            report(f"buses {shown(name)}", text)
        elif bus["channel"] > 4 or bus["channel"] in channels.values():
            report(f"buses {shown(name)}", f"channel {bus['channel']} is above 4 or used twice")
        elif name != ("SSP" if bus["channel"] == 0 else f"CAN{bus['channel']}"):
            report(f"buses {shown(name)}", "channel 0 is SSP, channels 1-4 are CAN1-CAN4")
        else:
            channels[name], rates[name] = bus["channel"], bus["bit_rate"]
            if "data_bit_rate" in bus:
                data_rates[name] = bus["data_bit_rate"]
                if name == "SSP":
                    report(f"buses {name}", "a serial link has no data_bit_rate")
                elif bus["data_bit_rate"] < bus["bit_rate"]:
                    text = f"data_bit_rate {bus['data_bit_rate']} is below bit_rate {bus['bit_rate']}"
                    report(f"buses {name}", text)
    routed = "SSP" in channels or any(
        isinstance(board, dict) and board.get("role") in (MAIN_BRAIN, ROUTER) for board in sections["boards"].values()
    )
    if routed and "SSP" not in channels:
        report("buses", "SSP, the link between router and main brain, is missing")
    for name, table in sections["boards"].items():
        lines[name] = line_of_table(text, name)
        of_board = faults.at(path.name, lines[name], shown(name)[1:-1])
        boards[name] = board_of(name, table, channels, data_rates, routed, of_board)
    by_number: dict[int, str] = {}
    without_number = {fault.row for fault in faults.found if fault.field == "number"}
    for name, board in boards.items():
        if name in without_number:
            continue
        first = by_number.setdefault(board.number, name)
        if first != name:
            faults.at(path.name, lines[name], name)("number", f"{board.number} is also the number of {first}")
    for role in (MAIN_BRAIN, ROUTER) if routed else ():
        having = [name for name, board in boards.items() if board.role == role]
        if len(having) != 1:
            report("boards", f"exactly one board must have the role {role!r}, not {len(having)}")
    return nothing


# ---- CSV files


def whole_of(text: str, most: int, field: str, report: Callable[[str, str], None]) -> int | None:
    if not WHOLE.fullmatch(text) or int(text) > most:
        report(field, f"is {shown(text)}, not a whole number 0 ... {most}")
        return None
    return int(text)


def name_of(text: str, report: Callable[[str, str], None]) -> str:
    if not NAME.fullmatch(text):
        report("name", f"{shown(text)} is not capital letters, digits and underscores beginning with a letter")
    elif len(text) > LONGEST_NAME:
        report("name", f"has {len(text)} characters, {LONGEST_NAME} are allowed")
    return text


def text_of(row: dict[str, str], field: str, needed: bool, report: Callable[[str, str], None]) -> str:
    text = row[field]
    if needed and not text:
        report(field, "is empty")
    if not TEXT.fullmatch(text) or '"' in text or "\\" in text or "*/" in text:
        report(field, f'{shown(text)} may hold printable ASCII only, without ", \\ and */')
    return text


def names_of(text: str) -> list[str]:
    return [name.strip() for name in text.split(";")] if text else []


def type_of(text: str) -> tuple[str, int]:
    """(type, number of values) of a cell such as f32 or f32[12]."""
    found = re.fullmatch(r"(\w+)\[(\d{1,3})\]", text)
    return (found[1], int(found[2])) if found else (text, 1)


def value_of(text: str, kind: str, field: str, report: Callable[[str, str], None]) -> float | int | None:
    """A number that the type can hold; a fault and None otherwise."""
    low, high = LIMITS[kind]
    if not NUMBER.fullmatch(text) or len(text) > 60:
        report(field, f"is {shown(text)}, not a number")
        return None
    exact = Fraction(text)
    if kind != "f32" and exact.denominator != 1:
        report(field, f"is {text}, not a whole number as type {kind} needs")
        return None
    if not low <= exact <= high:
        report(field, f"is {text}, outside the range of type {kind} ({low:.9g} ... {high:.9g})")
        return None
    return float(exact) if kind == "f32" else int(exact)


def repeated(names: Iterable[str]) -> list[str]:
    seen: set[str] = set()
    return [name for name in names if name in seen or seen.add(name)]  # type: ignore[func-returns-value]


class VariableChecker:
    """Turns rows of variables.csv into variables, using the data of the boards."""

    def __init__(
        self, boards: dict[str, Board], channels: dict[str, int], fd_buses: Collection[str], faults: Faults
    ) -> None:
        self.boards = boards
        self.channels = channels
        self.fd_buses = fd_buses
        self.routed = any(board.role == ROUTER for board in boards.values())
        self.faults = faults
        self.periods = {name: board.periods_ms() for name, board in boards.items()}
        self.ids: dict[int, int] = {}
        self.names: dict[str, tuple[int, str]] = {}

    def check(self, line: int, row: dict[str, str]) -> Variable | None:
        """The variable of a row; None when the row has a fault."""
        before = len(self.faults.found)
        report = self.faults.at(VARIABLES_FILE, line, row["name"] if NAME.fullmatch(row["name"]) else "")
        number = whole_of(row["id"], LARGEST_ID, "id", report)
        name = name_of(row["name"], report)
        if name in RESERVED_NAMES or name.startswith(RESERVED_PREFIXES) or name.endswith(RESERVED_SUFFIXES):
            report("name", f"{name} is reserved for generated code")
        kind, count = type_of(row["type"])
        if kind not in TYPES:
            report("type", f"is {shown(row['type'])}, not one of {', '.join(TYPES)}")
        publisher = self.publisher_of(row["publisher"], report)
        self.note_duplicates(line, number, name, row["publisher"], report)
        subscribers = self.subscribers_of(row["subscribers"], publisher, report)
        buses = self.buses_of(row["bus"], number, report)
        if count != 1:
            self.check_count(row["type"], count, name, buses, report)
        if publisher is not None:
            for subscriber in subscribers:
                reason = unreachable(publisher, self.boards[subscriber], buses, self.routed)
                if reason is not None:
                    report("bus", f"{shown(row['bus'])}: {reason}")
                    if reason.startswith("leaves"):
                        break
        period = self.period_of(row["period_ms"], name, row["publisher"], publisher, report)
        initial: float | int | None = 0
        minimum: float | int | None = None
        maximum: float | int | None = None
        if kind in TYPES:
            initial = value_of(row["initial"], kind, "initial", report)
            minimum = value_of(row["minimum"], kind, "minimum", report) if row["minimum"] else None
            maximum = value_of(row["maximum"], kind, "maximum", report) if row["maximum"] else None
            if minimum is not None and maximum is not None and minimum > maximum:
                report("minimum", f"{row['minimum']} is above the maximum {row['maximum']}")
            elif initial is not None:
                if minimum is not None and initial < minimum:
                    report("initial", f"{row['initial']} is below the minimum {row['minimum']}")
                if maximum is not None and initial > maximum:
                    report("initial", f"{row['initial']} is above the maximum {row['maximum']}")
        unit = text_of(row, "unit", False, report)
        description = text_of(row, "description", True, report)
        if len(self.faults.found) > before or number is None or publisher is None or initial is None:
            return None
        return Variable(
            id=number,
            name=name,
            type=kind,
            unit=unit,
            initial=initial,
            publisher=publisher.name,
            subscribers=tuple(subscribers),
            buses=buses,
            period_ms=period,
            minimum=minimum,
            maximum=maximum,
            description=description,
            count=count,
        )

    def check_count(
        self, text: str, count: int, name: str, buses: tuple[str, ...], report: Callable[[str, str], None]
    ) -> None:
        """A variable of several values has its place in one CAN FD frame."""
        if not 2 <= count <= MOST_ELEMENTS:
            report("type", f"is {shown(text)}, and a variable of several values has 2 ... {MOST_ELEMENTS} of them")
        if name.startswith("ERROR_"):
            report("type", f"is {shown(text)}, and an error word is one value")
        classic = [bus for bus in buses if bus not in self.fd_buses]
        if classic or not buses:
            where = f"{classic[0]} is not" if classic else "it is not on"
            report("type", f"is {shown(text)}: several values need a CAN FD bus, and {where} one")

    def note_duplicates(
        self, line: int, number: int | None, name: str, publisher: str, report: Callable[[str, str], None]
    ) -> None:
        if number is not None and self.ids.setdefault(number, line) != line:
            report("id", f"{number} is also the id in line {self.ids[number]}")
        first_line, first_publisher = self.names.setdefault(name, (line, publisher))
        if first_line != line:
            report("name", f"is also the name in line {first_line}")
            if publisher != first_publisher:
                report("publisher", f"two publishers, {first_publisher} and {publisher}")

    def publisher_of(self, text: str, report: Callable[[str, str], None]) -> Board | None:
        names = names_of(text)
        if not names:
            report("publisher", "is empty")
        elif len(names) > 1:
            report("publisher", f"two publishers, {' and '.join(shown(name)[1:-1] for name in names[:4])}")
        elif names[0] not in self.boards:
            report("publisher", f"unknown board {shown(names[0])}")
        else:
            return self.boards[names[0]]
        return None

    def subscribers_of(self, text: str, publisher: Board | None, report: Callable[[str, str], None]) -> list[str]:
        names = names_of(text)
        if not names:
            report("subscribers", "is empty")
        for name in repeated(names):
            report("subscribers", f"{shown(name)} is named twice")
        for name in names:
            if name not in self.boards:
                report("subscribers", f"unknown board {shown(name)}")
            elif publisher is not None and name == publisher.name:
                report("subscribers", f"{name} publishes it, so it does not subscribe to it")
        return [name for name in dict.fromkeys(names) if name in self.boards]

    def buses_of(self, text: str, number: int | None, report: Callable[[str, str], None]) -> tuple[str, ...]:
        names = names_of(text)
        for name in names:
            if name not in self.channels:
                report("bus", f"unknown bus {shown(name)}")
        for name in repeated(names):
            report("bus", f"{shown(name)} is named twice")
        if self.routed and number in XCP_IDS and names:
            report(
                "id", f"{number} is an identifier of XCP on CAN ({' and '.join(map(str, XCP_IDS))}); take another one"
            )
        if number is not None and number > LARGEST_CAN_ID and names:
            report(
                "id",
                f"{number} is above {LARGEST_CAN_ID} and routed to {', '.join(shown(name)[1:-1] for name in names)}; "
                "such identifiers are illegal on CAN",
            )
        return tuple(name for name in dict.fromkeys(names) if name in self.channels)

    def period_of(
        self,
        text: str,
        name: str,
        publisher_name: str,
        publisher: Board | None,
        report: Callable[[str, str], None],
    ) -> Fraction | None:
        served = self.periods.get(publisher_name, {}).get(name)
        if not text:
            if served is not None:
                report("period_ms", f"is empty, the schedule of {publisher_name} sends it every {float(served):g} ms")
            return None
        if not NUMBER.fullmatch(text) or len(text) > 30 or not 0 < float(text) < 1e9:
            report("period_ms", f"is {shown(text)}, not a period between 0 and 10^9 ms")
            return None
        period = Fraction(text)
        if publisher is None:
            return period
        if served is None:
            report("period_ms", f"no schedule serves {text} ms: {publisher_name} never sends it ({BOARDS_FILE})")
        elif abs(period - served) * 10_000 > served:  # 0.01 %: periods such as 1000/3 ms cannot be written out
            report("period_ms", f"no schedule serves {text} ms: {publisher_name}'s rows give {float(served):g} ms")
        return period


def check_schedules(
    boards: dict[str, Board],
    lines: dict[str, int],
    variables: list[tuple[int, dict[str, str]]],
    faults: Faults,
) -> None:
    """Every name in the schedules must be a variable that its board publishes."""
    publishers = {row["name"]: row["publisher"] for _, row in variables}
    for name, board in boards.items():
        report = faults.at(BOARDS_FILE, lines[name], name)
        lists = [("every", board.every), ("occasional", board.occasional), ("sends_itself", board.sends_itself)]
        lists += [(f"rows[{index}]", row) for index, row in enumerate(board.rows)]
        for field, names in lists:
            for variable in names:
                if variable.startswith("(") and variable.endswith(")"):
                    continue
                if variable not in publishers:
                    report(field, f"unknown variable {shown(variable)}")
                elif publishers[variable] != name:
                    report(field, f"sends {variable}, which {shown(publishers[variable])[1:-1]} publishes")


def normal_of(
    row: dict[str, str], field: str, users: list[str], report: Callable[[str, str], None]
) -> dict[str, float]:
    """{board: count} of a cell such as MCH:350;MCFO:280; only boards that raise the error, numbers above 0."""
    normal: dict[str, float] = {}
    for part in names_of(row[field]):
        board, colon, text = part.partition(":")
        board, text = board.strip(), text.strip()
        if not colon:
            report(field, f"{shown(part)} is not BOARD:NUMBER")
        elif board not in users:
            report(field, f"{shown(board)} is none of its boards")
        elif board in normal:
            report(field, f"{shown(board)} is named twice")
        elif not NUMBER.fullmatch(text) or not 0.0 < float(text) <= MOST_NORMAL:
            report(field, f"{shown(text)} is not above 0 and up to {MOST_NORMAL:g}")
        else:
            normal[board] = float(text)
    return normal


def read_errors(path: pathlib.Path, boards: dict[str, Board], faults: Faults) -> list[ErrorCode]:
    """The error codes. Rows with a fault may be among them, as such a table is refused."""
    errors: list[ErrorCode] = []
    ids: dict[int, int] = {}
    names: dict[str, int] = {}
    for line, row in read_rows(path, ERROR_COLUMNS, faults):
        report = faults.at(path.name, line, row["name"] if NAME.fullmatch(row["name"]) else "")
        number = whole_of(row["id"], LARGEST_ID, "id", report)
        name = name_of(row["name"], report)
        if number is not None and ids.setdefault(number, line) != line:
            report("id", f"{number} is also the code in line {ids[number]}")
        if name in RESERVED_ERRORS:
            report("name", f"{name} is reserved for generated code")
        if names.setdefault(name, line) != line:
            report("name", f"is also the name in line {names[name]}")
        users = names_of(row["boards"])
        if not users:
            report("boards", "is empty")
        for user in users:
            if user not in boards:
                report("boards", f"unknown board {shown(user)}")
        for user in repeated(users):
            report("boards", f"{shown(user)} is named twice")
        per_s = normal_of(row, "normal_per_s", users, report)
        at_start = normal_of(row, "normal_at_start", users, report)
        description = text_of(row, "description", True, report)
        if number is not None:
            errors.append(ErrorCode(number, name, tuple(users), description, per_s, at_start))
    return sorted(errors, key=lambda error: error.id)


def load_table(folder: str | pathlib.Path | None = None) -> Table:
    """The checked table of a folder with boards.toml, variables.csv and errors.csv; TableError names all faults."""
    master = folder_of(folder)
    faults = Faults()
    boards, lines, channels, rates, data_rates = read_boards(master / BOARDS_FILE, faults)
    rows = read_rows(master / VARIABLES_FILE, VARIABLE_COLUMNS, faults)
    if boards:
        checker = VariableChecker(boards, channels, data_rates, faults)
        variables = [variable for line, row in rows if (variable := checker.check(line, row)) is not None]
        if rows:  # an unreadable file is one fault, not one for each name missing from it
            check_schedules(boards, lines, rows, faults)
        errors = read_errors(master / ERRORS_FILE, boards, faults)
        if not faults.found and not variables:
            faults.at(VARIABLES_FILE, 1, "")("", "has no rows")
    if faults.found:
        order = {BOARDS_FILE: 0, VARIABLES_FILE: 1, ERRORS_FILE: 2}
        raise FaultyTableError(sorted(faults.found, key=lambda fault: (order[fault.file], fault.line)))
    return Table(
        boards=tuple(sorted(boards.values(), key=lambda board: board.number)),
        variables=tuple(sorted(variables, key=lambda variable: variable.id)),
        errors=tuple(errors),
        channels=channels,
        bit_rates=rates,
        hash=hash_of_master_files(master),
        data_bit_rates=data_rates,
    )


def hash_of_master_files(folder: str | pathlib.Path | None = None) -> str:
    """SHA-256 over the names and contents of the master files, line endings made equal."""
    digest = hashlib.sha256()
    faults = Faults()
    for name in (BOARDS_FILE, VARIABLES_FILE, ERRORS_FILE):
        text = read_text(folder_of(folder) / name, faults)
        if text is None:
            raise FaultyTableError(faults.found)
        data = text.replace("\r\n", "\n").encode()
        digest.update(f"{name} {len(data)}\n".encode())
        digest.update(data)
    return digest.hexdigest()
