"""Access to the activity log of a robot's board, in any process."""

from typing import Any


def activity_of(robot: Any, name: str) -> Any:
    """The log of board `name`, which has run to the robot's present time; it begins now if not requested before.

    None for a board that runs elsewhere and does not show its activity.
    """
    board = robot.loop.board(name)
    if not hasattr(board, "activity"):
        return None
    if board.out_of_process:
        board.catch_up(robot.loop.time)
    return board.activity()
