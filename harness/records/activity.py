"""Where the activity log of a robot's board is, wherever the board runs."""

from typing import Any


def activity_of(robot: Any, name: str) -> Any:
    """The log of board `name`, which has run to the robot's present instant; it begins now where nobody asked before.

    None for a board that runs elsewhere and shows nothing of it.
    """
    board = robot.loop.board(name)
    if not hasattr(board, "activity"):
        return None
    if board.apart:
        board.catch_up(robot.loop.time)
    return board.activity()
