"""The data that the page shows: one model for a running robot, a data link and a recording."""

from __future__ import annotations

import contextlib
import functools
from typing import Any

from ranger_sim import Ranger, datatable
from ranger_sim.datatable import parameters
from ranger_sim.foundation.user_error import UserError
from ranger_sim.ranger.conditions import STATE_VARIABLES, state_names
from ranger_sim.tools.panel.channels import EMPTY, Channel, Times, Trace, Values

# The pose of the robot's parts as the robot itself knows it: legs as estimated by its program of 2011 or those of 2015
# and 2016, feet by the ankles' encoders. Angles against gravity, rad; robot.md N4.17, C1.
LEGS = (("E_LO_ANGLE", "E_LI_ANGLE"), ("EST_STATE_TH0", "EST_STATE_TH1"))
ANKLES = ("MCFO_RIGHT_ANKLE_ANGLE", "MCFI_MID_ANKLE_ANGLE")
# between leg and foot, of the body `ranger` (plant/mechanics/parameters.py); 1.60, 1.63: robot.md N5
ANKLE_ZERO_RAD = 1.68
KNOWN_POSE = ("leg_outer_rad", "leg_inner_rad", "foot_outer_rad", "foot_inner_rad")
# The simulated body's own values; rad, m, N, A.
TRUE_POSE = (
    *("leg_outer_rad", "leg_inner_rad", "foot_outer_rad", "foot_inner_rad", "hip_x_m", "hip_y_m"),
    *("outer_Fx_N", "outer_Fy_N", "inner_Fx_N", "inner_Fy_N", "hip_A", "outer_A", "inner_A", "steering_A"),
)


class Source:
    """`channels`, and the supported operations: `can` names them, and the page shows no others.

    keys, parameters, pace, faults, restart: requests of these kinds are carried out. frames, panel, boards, errors: the
    state has them. live: the source's time advances by itself. twins: `walks` can be compared with their twins.
    """

    title = ""
    late_s = 0.25  # how much later than the newest data other data may arrive; a trigger also looks back this far
    can: frozenset[str] = frozenset()
    pose_names: tuple[str, ...] = ()
    walks: tuple[str, ...] = ()  # by name

    def __init__(self) -> None:
        self.channels: list[Channel] = []
        self.geometry: dict[str, Any] = {}
        self.lost = ""  # why no more data will arrive
        self.is_coming = False  # a recording is still being read
        self.listed: list[dict[str, Any]] = []  # the channels as sent to a page, cached

    async def run(self) -> None:
        """Receive data until there are no more."""

    def want(self, channels: list[int]) -> None:
        """Set the channels that all pages together show."""

    def span(self) -> tuple[float, float]:
        """(begin, end) of the available data, s."""
        return (0.0, 0.0)

    def trace(self, channel: int, begin: float, end: float, points: int) -> Trace:
        """A channel in a window."""
        return EMPTY

    def samples(self, channel: int, begin: float, end: float) -> tuple[Times, Values]:
        """(times, values) of a window as received, for a file."""
        return EMPTY.x, EMPTY.low

    def values(self, wanted: list[int], at: float | None) -> list[float | None]:
        """Values of these channels at a time (None: the newest); None where unknown."""
        return [None] * len(wanted)

    def pose(self, at: float | None) -> tuple[float, list[float]] | None:
        """(time, values of `pose_names`) at a time; None if unknown."""
        return None

    def state(self, at: float | None) -> dict[str, Any]:
        """State without channels: boards, buses, panel, errors, frames, faults; missing: why no slots or buses."""
        return {}

    def recording(self, walk: int) -> list[str] | None:
        """The arguments by which `ranger-sim diagnose` reads a walk; None for samples that only the panel has."""
        return None

    async def request(self, request: dict[str, Any]) -> dict[str, Any]:
        """Carry out a request of the page to the robot. UserError with the reason if refused."""
        raise UserError("a recording takes no requests")

    def hello(self) -> dict[str, Any]:
        """Data that the page needs at its start."""
        self.listed = self.listed or [channel.content() for channel in self.channels]
        return {
            "title": self.title,
            "can": sorted(self.can),
            "channels": self.listed,
            "walks": self.walks,
            "pose": list(self.pose_names),
            "geometry": self.geometry,
            "parameters": parameter_rows() if "parameters" in self.can else [],
            "faults": fault_rows() if "faults" in self.can else {},
            "slots_us": slots_us(),
            "span": self.span(),
        }


def known_pose(values: dict[str, float | None]) -> list[float] | None:
    """KNOWN_POSE from the variables LEGS and ANKLES; None if one of them is unknown.

    A robot's program leaves the other program's estimates at 0.
    """
    outer, inner = (values.get(name) for name in ANKLES)
    estimates = [(values.get(first), values.get(second)) for first, second in LEGS]
    there = [(first, second) for first, second in estimates if first is not None and second is not None]
    if outer is None or inner is None or not there:
        return None
    legs = next((pair for pair in there if pair != (0.0, 0.0)), there[0])
    return [*legs, legs[0] + outer - ANKLE_ZERO_RAD, legs[1] + inner - ANKLE_ZERO_RAD]


@functools.cache
def parameter_rows() -> list[dict[str, Any]]:
    """Every parameter: name, unit, limits, default, description, and the group that its name begins with."""
    return [
        {
            "name": row.name,
            "unit": row.unit,
            "least": row.minimum,
            "most": row.maximum,
            "default": row.initial_as_stored,
            "description": row.description,
            "group": group_of(row.name),
        }
        for row in parameters.parameters()
    ]


def group_of(name: str) -> str:
    """P_H_PM_H_TRATE is one of P_H, CTRL_FSM_LED of CTRL."""
    first, _, rest = name.partition("_")
    return f"{first}_{rest.partition('_')[0]}" if first == "P" and rest else first


@functools.cache
def fault_rows() -> dict[str, Any]:
    """{places: where a fault can be injected; modes: available modes, by kind of place}."""
    from ranger_sim.harness.faults.catalogue import MODES
    from ranger_sim.ranger.faults.catalogue import CATALOGUE

    places = [{"name": place.name, "kind": place.kind, "what": place.what} for place in CATALOGUE.places.values()]
    modes: dict[str, list[dict[str, str]]] = {}
    for (kind, name), mode in MODES.items():
        modes.setdefault(kind, []).append({"mode": name, "meaning": mode.meaning})
    return {"places": places, "modes": modes}


@functools.cache
def slots_us() -> dict[str, float]:
    """{board: slot length, us} of the boards that have slots."""
    return {board.name: board.slot_us for board in datatable.load().boards if board.slot_us}


@functools.cache
def error_rows() -> dict[int, tuple[str, str]]:
    """{code: (name, meaning)} of the master table."""
    return {row.id: (row.name, row.description) for row in datatable.load().errors}


@functools.cache
def known_states() -> dict[str, dict[int, str]]:
    """{variable: {number: state}} of our main brain's program, which has the record walk's numbers: for a source that
    does not report them itself.
    """
    with contextlib.closing(Ranger()) as robot:
        return {variable: state_names(robot, machine) for machine, variable in STATE_VARIABLES.items()}


def table_channels(states: dict[str, dict[int, str]] | None = None) -> dict[int, Channel]:
    """{identifier: channel} of the master table's variables, in their order, without spares and the link's own.

    states: names of the numbers that a variable takes, by its name.
    """
    return {
        row.id: Channel(
            row.name,
            row.unit,
            row.description,
            "parameters" if row.publisher == "PC" else row.publisher,
            (states or {}).get(row.name, {}),
        )
        for row in datatable.load().variables
        if not row.is_spare and not row.name.startswith(parameters.CHANNEL_PREFIX)
    }
