"""Options of the commands that show buses to other programs; `bus.open_servers` obeys them."""

from typing import Any


def add_options(command: Any) -> None:
    """--slcan, --socketcand and --allow-network."""
    command.add_argument(
        "--slcan",
        action="append",
        default=[],
        metavar="CHANNEL",
        help="show this bus as a serial-line adapter on a pseudo-terminal (repeatable)",
    )
    command.add_argument(
        "--socketcand", metavar="[HOST:]PORT", help="show all buses over TCP, on this machine (port 0: a free one)"
    )
    command.add_argument(
        "--allow-network",
        action="store_true",
        help="let --socketcand listen on a HOST beyond this machine; any client there may then send frames",
    )
