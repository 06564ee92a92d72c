"""What `ranger-sim up` is to do, as data: made from its options before anything is opened, built or started."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ranger_sim import loading
from ranger_sim.boards.quirks import Quirks
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.outside.profile import BUSES, Profile
from ranger_sim.harness.outside.profile import load as load_profile
from ranger_sim.harness.processes.settings import Settings, one_processor
from ranger_sim.harness.stop_rule import MOST_STEPS
from ranger_sim.ranger import wiring
from ranger_sim.ranger.faults.catalogue import CATALOGUE
from ranger_sim.ranger.requests import can_be_armed
from ranger_sim.ranger.scenario import Scenario, StopRule
from ranger_sim.tools.firmware.images import files_of
from ranger_sim.tools.run import serial_options, walk, walk_options

if TYPE_CHECKING:
    from ranger_sim.harness.faults.fault import Fault

FOREVER = StopRule(steps=MOST_STEPS)
# Boards with one CAN controller: each can have its own place on an interface. The router is on all buses.
ON_ONE_BUS = {wire.board: f"can{wire.bus}" for wire in wiring.CAN if wire.board != "CSR"}


@dataclasses.dataclass(frozen=True)
class OutsideBus:
    """A bus on a python-can interface. keywords: of `can.Bus`. bit_rate: bit/s; None: that of the emulated bus."""

    name: str
    keywords: Mapping[str, Any]
    bit_rate: int | None = None


@dataclasses.dataclass(frozen=True)
class Plan:
    """A run: which robot, until when, what replaces its boards' programs, which buses are outside.

    firmware, images: folder and file by board. peers: keywords of `can.Bus` by board, for boards of outside buses
    that have their own place. xcp_udp: port; xcp_can: bus; None without.
    """

    settings: Settings
    scenario: Scenario
    stop: StopRule
    log: str
    quirks: Quirks
    profile: Profile | None
    faults: tuple[Fault, ...]
    firmware: Mapping[str, str]
    images: Mapping[str, str]
    outside: tuple[OutsideBus, ...]
    peers: Mapping[str, Mapping[str, Any]]
    xcp_udp: int | None
    xcp_can: str | None

    def not_here(self) -> list[str]:
        """Lines that name the boards without a process."""
        if self.profile is None:
            return []
        found = (("outside", self.profile.external()), ("absent", self.profile.absent()))
        return [f"{', '.join(boards)}: {what}" for what, boards in found if boards]

    @property
    def has_hardware(self) -> bool:
        """True when a board of the robot has no process here."""
        return bool(self.not_here())


def plan_of(options: argparse.Namespace) -> Plan:
    """The plan of these options. UserError for options that are impossible or contradict each other."""
    faults = tuple(can_be_armed(CATALOGUE.typed(text)) for text in options.fault)
    settings = Settings(
        speed=options.speed,
        restart=options.restart,
        real_time=not options.no_real_time,
        name=options.name,
        processor=processor(options.processor),
        boards=wiring.BOARDS,
    )
    profile = load_profile(options.profile) if options.profile is not None else None
    if profile is not None:
        settings = dataclasses.replace(settings, boards=profile.emulated())
    outside, peers = buses_of(options.bus, profile)
    return Plan(
        settings=settings,
        scenario=walk_options.scenario_of(options),
        stop=walk_options.stop_of(options) or FOREVER,
        log=walk_options.log_of(options),
        quirks=serial_options.quirks_of(options),
        profile=profile,
        faults=faults,
        firmware=emulated("--firmware", walk.firmware_folders(options), settings),
        images=emulated("--image", files_of(options), settings),
        outside=outside,
        peers=peers,
        xcp_udp=options.xcp_udp,
        xcp_can=options.xcp_can,
    )


def processor(text: str) -> int | None:
    """The processor that --processor means; None for all of them."""
    if text == "one":
        return one_processor() if loading.RUNS_COMPILED else None
    if text == "all":
        return None
    if not text.isdecimal():
        raise UserError(f"--processor {text}: one, all or the number of a processor is expected")
    return int(text)


def emulated(option: str, programs: dict[str, str], settings: Settings) -> dict[str, str]:
    """The same programs by board. UserError for a board that has no process."""
    for board, path in programs.items():
        if board not in settings.boards:
            raise UserError(f"{option} {board}={path}: {board} is not emulated in this profile")
    return programs


def buses_of(given: list[str], profile: Profile | None) -> tuple[tuple[OutsideBus, ...], dict[str, Mapping[str, Any]]]:
    """(buses outside, keywords by board) of --bus, and of the profile for buses that --bus does not name.

    UserError for what is unknown or contradicts itself.
    """
    if not given and profile is None:
        return (), {}
    from ranger_sim.can_bus.edge.external_bus import place_of

    found: dict[str, OutsideBus] = {}
    peers: dict[str, Mapping[str, Any]] = {}
    for text in given:
        name, keywords = place_of(text)
        if name in found or name in peers:
            raise UserError(f"--bus {text}: {name} is given twice")
        if name in ON_ONE_BUS:
            peers[name] = keywords
        elif name in BUSES:
            bit_rate = keywords.get("bitrate")
            found[name] = OutsideBus(name, keywords, None if bit_rate is None else int(bit_rate))
        else:
            known = ", ".join([*BUSES, *(each for each in wiring.BOARDS if each in ON_ONE_BUS)])
            raise UserError(f"--bus {text}: unknown bus or board {name!r} (available: {known})")
    for name, bus in profile.buses.items() if profile is not None else ():
        keywords_of_profile = bus.python_can()
        if keywords_of_profile is not None and name not in found:
            found[name] = OutsideBus(name, keywords_of_profile, bus.bit_rate)
    for board in peers:
        bus_name = ON_ONE_BUS[board]
        if bus_name not in found:
            raise UserError(f"--bus {board}=...: its bus {bus_name} is not outside (--bus {bus_name}=...)")
    return tuple(found.values()), peers
