"""Profiles: which boards are emulated, external or absent, and on what each bus runs. Files `profiles/*.toml`.

    title = "..."                      what it is for; description = "..." says more
    [boards]                           "emulated" (also what is not named), "external" or "absent"
    MCH = "external"
    [buses.can1]                       can1 ... can4; what is not named is emulated at the robot's own rate
    interface = "socketcan"            of python-can; left out: the bus is emulated inside
    channel = "can0"
    bit_rate = 1_000_000               bit/s
    schedule = "1mbit"                 schedules/1mbit.toml next to this file or shipped; "full": as the firmware sends
    options = { receive_own_messages = false }   further arguments of python-can's Bus

A profile passes whole or not at all; all mistakes are reported together: file, key, value and the rule broken.
"""

from __future__ import annotations

import dataclasses
import functools
import pathlib
from collections.abc import Callable, Mapping
from typing import Any

from ranger_sim.datatable.model import ROLES, ROUTER, Table
from ranger_sim.foundation import toml_file
from ranger_sim.foundation.user_error import ProfileError, unknown
from ranger_sim.harness.outside.bus_schedule import (
    MOST_ROWS,
    MOST_TURNS,
    BusSchedule,
    command_variables,
    passes_of,
    robots_table,
)

FOLDER = pathlib.Path(__file__).resolve().parents[2] / "profiles"
SCHEDULES = "schedules"
FULL = "full"
EMULATED, EXTERNAL, ABSENT = "emulated", "external", "absent"
STATES = (EMULATED, EXTERNAL, ABSENT)
BUSES = ("can1", "can2", "can3", "can4")
# Below, a frame of 8 bytes takes longer than the robot's slots can wait (chosen by us); above, no controller follows.
LOWEST_BIT_RATE, HIGHEST_BIT_RATE = 10_000, 8_000_000
# ISO 11898-1 classic CAN, and what python-can's bit timings allow. Software-only interfaces have no bit rate.
ADAPTER_BIT_RATE = 1_000_000
SOFTWARE_INTERFACES = ("ranger_sim", "virtual", "udp_multicast")
WITHOUT_CAN = (
    "the main brain has no CAN, only its private link to the router, so it can be external only with an external "
    "router, and an external router only with the main brain"
)


@dataclasses.dataclass(frozen=True)
class ProfileFault:
    """One thing wrong: file, key (dotted), its value, the rule it breaks."""

    file: str
    key: str
    value: str
    rule: str

    def __str__(self) -> str:
        what = f" {self.key}" if self.key else ""
        value = f" = {self.value}" if self.value else ""
        return f"{self.file}{':' if what else ''}{what}{value}: {self.rule}"


class FaultyProfileError(ProfileError):
    """A bad profile with all its faults: `faults` in order, and one line each as the message."""

    def __init__(self, faults: list[ProfileFault]) -> None:
        self.faults = tuple(faults)
        super().__init__(*(str(fault) for fault in self.faults))


@dataclasses.dataclass(frozen=True)
class BusProfile:
    """One bus. `interface` None: emulated inside. `bit_rate` in bit/s; `options`: further arguments of python-can.

    data_bit_rate: bit/s of the data of CAN FD; 0: a classic bus.
    """

    name: str
    interface: str | None
    channel: str | None
    bit_rate: int
    schedule_name: str
    schedule: BusSchedule
    options: Mapping[str, Any]
    data_bit_rate: int = 0

    def python_can(self) -> dict[str, Any] | None:
        """Arguments of `can.Bus`, or None for an emulated bus. The bit rate is included where the interface sets it."""
        if self.interface is None:
            return None
        found: dict[str, Any] = {"interface": self.interface, "channel": self.channel}
        if self.interface != "socketcan" and self.interface not in SOFTWARE_INTERFACES:
            found["bitrate"] = self.bit_rate  # a SocketCAN interface gets its rate from `ip link`
            if self.data_bit_rate:
                found["data_bitrate"] = self.data_bit_rate
        if self.data_bit_rate:
            found["fd"] = True
        return {**found, **self.options}


@dataclasses.dataclass(frozen=True)
class Profile:
    """A checked profile, with every board and every bus of the machine."""

    name: str
    path: str
    title: str
    description: str
    boards: Mapping[str, str]
    buses: Mapping[str, BusProfile]

    def _boards(self, state: str) -> tuple[str, ...]:
        return tuple(name for name, each in self.boards.items() if each == state)

    def emulated(self) -> tuple[str, ...]:
        """Boards that run here."""
        return self._boards(EMULATED)

    def external(self) -> tuple[str, ...]:
        """Boards that are real, or run elsewhere."""
        return self._boards(EXTERNAL)

    def absent(self) -> tuple[str, ...]:
        """Boards that are missing."""
        return self._boards(ABSENT)

    def schedules(self) -> dict[str, BusSchedule]:
        """Schedule by bus."""
        return {name: bus.schedule for name, bus in self.buses.items()}


class _Reader:
    """Reads one file and collects its faults; every wrong key is reported, never raised."""

    def __init__(self, file: str, faults: list[ProfileFault]) -> None:
        self.file = file
        self.faults = faults

    def fault(self, key: str, value: object, rule: str) -> None:
        """Record a fault; `value` None: nothing to show."""
        shown = "" if value is None else _shown(value)
        self.faults.append(ProfileFault(self.file, _plain(key), shown, rule))

    def content(self, path: pathlib.Path) -> dict[str, Any] | None:
        """The tables of a TOML file; None with a fault when it cannot be read."""
        try:
            return toml_file.load(path)
        except toml_file.TomlError as error:
            place = f"line {error.line}, column {error.column}: " if error.line else ""
            self.fault("", None, f"{place}{error.reason}")
            return None

    def only(self, table: Mapping[str, Any], allowed: tuple[str, ...], place: str) -> None:
        """Record a fault for each key that is not allowed."""
        for key in table:
            if key not in allowed:
                self.fault(_dotted(place, key), table[key], f"unknown key; allowed are {', '.join(allowed)}")

    def text(self, table: Mapping[str, Any], key: str, place: str = "", default: str | None = "") -> str | None:
        """A text under a key, or the default."""
        value = table.get(key, default)
        if value is default or (isinstance(value, str) and value.isprintable()):
            return value
        self.fault(_dotted(place, key), value, "printable text on one line is expected")
        return default

    def table(self, table: Mapping[str, Any], key: str, place: str = "") -> dict[str, Any]:
        """A table under a key, empty where it is missing."""
        value = table.get(key, {})
        if isinstance(value, dict):
            return value
        self.fault(_dotted(place, key), value, f"a table [{_dotted(place, key)}] is expected")
        return {}

    def whole(self, value: Any, key: str, low: int, high: int, default: int, unit: str = "") -> int:
        """A whole number within limits, or the default with a fault."""
        if type(value) is int and low <= value <= high:
            return value
        self.fault(key, value, f"a whole number from {low} to {high}{unit} is expected")
        return default


def _plain(text: str) -> str:
    """The text on one line, shortened where it is long."""
    printable = text if text.isprintable() else repr(text)[1:-1]
    return printable if len(printable) <= 160 else printable[:157] + "..."


def _shown(value: object) -> str:
    quoted = repr(value)
    return quoted if len(quoted) <= 60 else quoted[:57] + "..."


def _dotted(place: str, key: str) -> str:
    return f"{place}.{key}" if place else key


# ---- schedules


def available_schedules(folder: pathlib.Path | None = None) -> tuple[str, ...]:
    """Names of the schedules shipped, and of those next to a profile in `folder`."""
    folders = [FOLDER / SCHEDULES] + ([folder / SCHEDULES] if folder else [])
    return tuple(sorted({path.stem for each in folders for path in each.glob("*.toml")}))


def _schedule(name: str, folder: pathlib.Path, table: Table, faults: list[ProfileFault]) -> BusSchedule:
    """The schedule of that name, which exists; adds its faults to `faults`."""
    path = folder / SCHEDULES / f"{name}.toml"
    if not path.is_file():
        path = FOLDER / SCHEDULES / f"{name}.toml"
    reader = _Reader(str(path), faults)
    content = reader.content(path) or {}
    reader.only(content, ("title", "description", "every", "occasional", "commands_in_turn"), "")
    sent = {row_name: board for board in table.with_role("satellite") for row in board.rows for row_name in row}
    commands = {variable.name for variable in command_variables(table)}
    every: dict[str, int] = {}
    for key, value in reader.table(content, "every").items():
        if key not in sent and key not in commands:
            listed = [board.name for board in table.boards if key in board.occasional]
            reader.fault(
                f"every.{key}",
                value,
                f"is in the occasional list of {listed[0]}: give [occasional] {listed[0]}"
                if listed
                else "no row of a board's schedule sends it and it is not a command of the main brain",
            )
        else:
            every[key] = reader.whole(value, f"every.{key}", 1, MOST_TURNS, 1)
    occasional: dict[str, int] = {}
    for key, value in reader.table(content, "occasional").items():
        if key not in {board.name for board in table.with_role("satellite") if board.occasional}:
            reader.fault(f"occasional.{key}", value, "no board of that name has both an occasional list and a CAN bus")
        else:
            occasional[key] = reader.whole(value, f"occasional.{key}", 1, MOST_TURNS, 1)
    in_turn = reader.whole(content.get("commands_in_turn", 0), "commands_in_turn", 0, MOST_TURNS, 0)
    found = BusSchedule(
        name,
        reader.text(content, "title") or name,
        reader.text(content, "description") or "",
        every,
        occasional,
        in_turn,
    )
    for board in table.with_role("satellite"):
        if board.firmware and passes_of(board, found) * len(board.rows) > MOST_ROWS:
            reader.fault(
                "every",
                None,
                f"the numbers of {board.name} repeat only after {passes_of(board, found)} passes of {len(board.rows)} "
                f"rows, more than {MOST_ROWS} rows: choose numbers with a smaller common multiple",
            )
    return found


# ---- profiles


def available() -> tuple[str, ...]:
    """Names of the profiles shipped."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))


def boards_of(table: Table) -> tuple[str, ...]:
    """The boards that run firmware: satellites first, then the router and the main brain."""
    found = sorted(table.boards, key=lambda board: ROLES.index(board.role))
    return tuple(board.name for board in found if board.firmware)


@functools.cache
def default() -> Profile:
    """The real robot's profile: every board emulated, its own bit rate, every board sending as its firmware does."""
    table = robots_table()
    schedule = full_schedule()
    buses = {name: BusProfile(name, None, None, table.bit_rates[name.upper()], FULL, schedule, {}) for name in BUSES}
    boards = dict.fromkeys(boards_of(table), EMULATED)
    return Profile("default", "", "the robot unchanged", "", boards, buses)


@functools.cache
def full_schedule() -> BusSchedule:
    """The schedule of the firmware itself."""
    faults: list[ProfileFault] = []
    found = _schedule(FULL, FOLDER, robots_table(), faults)
    if faults:
        raise FaultyProfileError(faults)
    return found


def load(
    name: str | pathlib.Path, interfaces: Callable[[], tuple[str, ...]] | None = None, table: Table | None = None
) -> Profile:
    """The profile `name` of those shipped, or the file at that path when it ends in .toml.

    ProfileError names all its faults. `interfaces` gives python-can's interface names, asked when a bus names one.
    table: of a user's machine, whose boards and buses the profile describes; it cannot have a schedule.
    """
    text = str(name)
    if not text.endswith(".toml") and text not in available():
        raise ProfileError(f"{unknown('profile', text, available())}, or give a .toml file")
    path = pathlib.Path(text) if text.endswith(".toml") else FOLDER / f"{text}.toml"
    faults: list[ProfileFault] = []
    reader = _Reader(str(path), faults)
    content = reader.content(path)
    if content is None:
        raise FaultyProfileError(faults)
    buses_known: tuple[str, ...] = BUSES
    if table is None:
        table = robots_table()
    else:
        buses_known = tuple(bus.lower() for bus in table.channels)
    reader.only(content, ("title", "description", "boards", "buses"), "")
    title = reader.text(content, "title") or path.stem
    description = reader.text(content, "description") or ""
    boards = _boards(reader, reader.table(content, "boards"), boards_of(table))
    buses = _buses(reader, reader.table(content, "buses"), path.parent, table, interfaces or _interfaces, buses_known)
    _together(reader, boards, buses, table)
    if faults:
        raise FaultyProfileError(faults)
    return Profile(path.stem, str(path), title, description, boards, buses)


def _interfaces() -> tuple[str, ...]:
    from ranger_sim.can_bus.edge.interfaces import known_interfaces  # python-can takes a second to load

    return known_interfaces()


def _boards(reader: _Reader, given: Mapping[str, Any], known: tuple[str, ...]) -> dict[str, str]:
    boards = dict.fromkeys(known, EMULATED)
    for name, state in given.items():
        if name not in boards:
            reader.fault(f"boards.{name}", state, f"no such board; the boards are {', '.join(known)}")
        elif state not in STATES:
            reader.fault(f"boards.{name}", state, f"one of {', '.join(STATES)} is expected")
        else:
            boards[name] = state
    return boards


def _buses(
    reader: _Reader,
    given: Mapping[str, Any],
    folder: pathlib.Path,
    table: Table,
    interfaces: Callable[[], tuple[str, ...]],
    known: tuple[str, ...],
) -> dict[str, BusProfile]:
    for name in given:
        if name not in known:
            reader.fault(f"buses.{name}", given[name], f"no such bus; the buses are {', '.join(known)}")
    schedules: dict[str, BusSchedule] = {}
    if not table.with_role(ROUTER):
        schedules[FULL] = BusSchedule(FULL, "as the firmware sends", "", {}, {}, 0)
    found = {}
    for name in known:
        place = f"buses.{name}"
        entry = reader.table(given, name, "buses")
        reader.only(entry, ("interface", "channel", "bit_rate", "schedule", "options"), place)
        interface = reader.text(entry, "interface", place, None)
        channel = reader.text(entry, "channel", place, None)
        options = reader.table(entry, "options", place)
        if interface is not None and interface not in interfaces():
            reader.fault(f"{place}.interface", interface, f"unknown to python-can; it knows {', '.join(interfaces())}")
        if interface is not None and not channel:
            reader.fault(f"{place}.channel", channel, "is missing: which channel of the interface, for example can0")
        if interface is None:
            for key in ("channel", "options"):
                if entry.get(key):
                    reader.fault(f"{place}.{key}", entry[key], "needs `interface`: without one the bus is emulated")
        for key in options:
            if key in ("interface", "channel", "bitrate", "fd"):
                reader.fault(
                    f"{place}.options.{key}", options[key], "is given by the profile's own keys, not as an option"
                )
        usual = table.bit_rates[name.upper()]
        rate = reader.whole(
            entry.get("bit_rate", usual), f"{place}.bit_rate", LOWEST_BIT_RATE, HIGHEST_BIT_RATE, usual, " bit/s"
        )
        if interface is not None and rate > ADAPTER_BIT_RATE and not _without_rate(interface, channel or ""):
            reader.fault(
                f"{place}.bit_rate",
                rate if "bit_rate" in entry else None,
                f"{'' if 'bit_rate' in entry else f'is missing, so {rate}: '}adapters for classic CAN reach at most "
                f"{ADAPTER_BIT_RATE} bit/s",
            )
        wanted = reader.text(entry, "schedule", place, FULL) or FULL
        if wanted not in schedules:
            if wanted in available_schedules(folder):
                schedules[wanted] = _schedule(wanted, folder, table, reader.faults)
            else:
                there = ", ".join(available_schedules(folder))
                reader.fault(f"{place}.schedule", wanted, f"no such schedule; there are {there}")
                schedules[wanted] = full_schedule()
        data_rate = table.data_bit_rates.get(name.upper(), 0)
        found[name] = BusProfile(name, interface, channel, rate, wanted, schedules[wanted], options, data_rate)
    return found


def _without_rate(interface: str, channel: str) -> bool:
    """True for software-only interfaces, where a bit rate means nothing."""
    return interface in SOFTWARE_INTERFACES or (interface == "socketcan" and channel.startswith(("vcan", "vxcan")))


def _together(reader: _Reader, boards: Mapping[str, str], buses: Mapping[str, BusProfile], table: Table) -> None:
    """Check the combination of boards and buses."""
    if table.with_role(ROUTER):
        _with_router(reader, boards, table)
    for name, state in boards.items():
        if state == EXTERNAL:
            for bus in table.board(name).buses:
                if bus.lower() in buses and buses[bus.lower()].interface is None:
                    reader.fault(
                        f"boards.{name}",
                        EXTERNAL,
                        f"hangs on {bus.lower()}, which is emulated inside: give [buses.{bus.lower()}] an interface",
                    )
    users: dict[tuple[str, str], str] = {}
    for name, used in buses.items():
        if used.interface is not None and used.channel:
            first = users.setdefault((used.interface, used.channel), name)
            if first != name:
                rule = f"{used.interface} {used.channel} is also what {first} uses"
                reader.fault(f"buses.{name}.channel", used.channel, rule)


def _with_router(reader: _Reader, boards: Mapping[str, str], table: Table) -> None:
    """Check that main brain and router are outside together, or not at all."""
    brain, router = table.with_role("main brain")[0].name, table.with_role("router")[0].name
    if EXTERNAL in (boards[brain], boards[router]) and boards[brain] != boards[router]:
        external = brain if boards[brain] == EXTERNAL else router
        reader.fault(f"boards.{external}", EXTERNAL, WITHOUT_CAN)
    elif boards[router] == ABSENT and boards[brain] == EMULATED:
        reader.fault(
            f"boards.{router}", ABSENT, f"without the router {brain} reaches no board: make {brain} absent as well"
        )
