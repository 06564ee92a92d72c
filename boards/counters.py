"""Counters of the robot's boards beyond slots and CAN, and their form between processes."""

import dataclasses
from typing import Any

from ranger_sim.firmware_sim.counters import CanCounters, ProcessorCounters, ProgramCounters


@dataclasses.dataclass(frozen=True)
class LinkCounters:
    """One end of the serial link between router and main brain."""

    segments_sent: int
    segments_received: int
    frames_sent: int
    frames_received: int
    checksum_errors: int


@dataclasses.dataclass(frozen=True)
class RouterCounters:
    """The router's program: frames passed on, and frames that it had to drop."""

    routed: int
    receive_lost: int
    own_lost: int
    unroutable: int


@dataclasses.dataclass(frozen=True)
class RangerCounters(ProgramCounters):
    """A board of the robot. `time_ms`: its network time; `processor`: of one that runs a firmware image."""

    link: LinkCounters | None = None
    router: RouterCounters | None = None
    processor: ProcessorCounters | None = None


def of_board(board: Any, can: list[CanCounters], link: Any = None, router: Any = None) -> RangerCounters:
    """The counters of any board of the robot, with those of the caller; `link`, `router`: the board's objects."""
    return RangerCounters(
        hz=board.hz,
        unclaimed=board.unclaimed,
        slots=board.scheduler.counters(),
        can=can,
        time_ms=board.time.ms,
        errors=list(board.errors.totals),
        link=None if link is None else of_link(link),
        router=None if router is None else of_router(router),
    )


def of_can_link(link: Any) -> CanCounters:
    """The one controller of a satellite, and its queues."""
    return of_controller(link.controller, link.receive_lost, link.send_lost)


def of_controller(controller: Any, receive_lost: int, queue_full: int, skipped: int = 0) -> CanCounters:
    """A controller, with the losses of the program's queues at it."""
    return CanCounters(
        controller=controller.number,
        received=controller.received,
        sent=controller.sent,
        data_overruns=controller.data_overruns,
        receive_lost=receive_lost,
        queue_full=queue_full,
        skipped=skipped,
    )


def of_link(link: Any) -> LinkCounters:
    """Either end of the serial link."""
    return LinkCounters(
        segments_sent=link.segments_sent,
        segments_received=link.segments_received,
        frames_sent=link.frames_sent,
        frames_received=link.frames_received,
        checksum_errors=link.checksum_errors,
    )


def of_router(router: Any) -> RouterCounters:
    """The router's program."""
    return RouterCounters(
        routed=router.routed,
        receive_lost=router.receive_lost,
        own_lost=router.own_lost,
        unroutable=router.unroutable,
    )
