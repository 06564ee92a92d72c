"""Variables that each board's schedule sends, from boards.toml: for tests that compare it with the firmware's
tables."""

from __future__ import annotations

import dataclasses

from ranger_sim.datatable.model import Board, Table


@dataclasses.dataclass(frozen=True)
class PublishedSchedule:
    """Names of the variables sent, in order: in each slot, in each row, in the occasional list.

    A name in parentheses is work that sends nothing. `occasional_row` is the row whose last task is the
    occasional list, None without such a list. Slot length in us.
    """

    board: str
    slot_us: int
    every: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    occasional: tuple[str, ...]
    occasional_row: int | None


def schedule_of(board: Board) -> PublishedSchedule:
    """The published schedule of a board of a loaded table."""
    return PublishedSchedule(board.name, board.slot_us, board.every, board.rows, board.occasional, board.occasional_row)


def published_schedule(name: str, table: Table | None = None) -> PublishedSchedule:
    """The published schedule of the board called `name`; UserError for an unknown board."""
    from ranger_sim.datatable.loader import load_table

    return schedule_of((table or load_table()).board(name))


def scheduled_frames_per_s(table: Table, bus: str) -> float:
    """Frames per second that the schedules of the satellites on `bus` send upwards, error frames left out."""
    total = 0.0
    for board in table.with_role("satellite"):
        if board.firmware and bus in board.buses:
            errors = {variable.name for variable in table.variables if variable.is_error_word}
            total += float(sum(rate for name, rate in board.sends_per_s().items() if name not in errors))
    return total
