"""Which errors of boards belong to a healthy walk: columns normal_per_s and normal_at_start of the master table."""

from collections.abc import Mapping

from ranger_sim.datatable.generated import errors as error_table

# Errors come in bursts: a hip that is held back tells of its clipped current in every slot. So a second more of them is
# allowed than has passed, and a test of 10 ms may see such a burst as well.
BURST_S = 1.0


def most_normal(board: str, code: int, passed_s: float, from_power_up: bool) -> float:
    """How often a board of a healthy robot notes an error at most, in so many seconds of walking."""
    rate = error_table.NORMAL_PER_S.get(code, {}).get(board, 0.0)
    once = error_table.NORMAL_AT_START.get(code, {}).get(board, 0.0) if from_power_up else 0.0
    return rate * (passed_s + BURST_S) + once


def beyond(errors: Mapping[str, Mapping[str, int]], time_s: float) -> dict[str, dict[str, int]]:
    """Those of a summary's `errors` (counts by board and name) that are not of a healthy walk of so long a time."""
    codes = {name: code for code, name in error_table.NAMES.items()}
    found = {
        board: {name: count for name, count in names.items() if count > most_normal(board, codes[name], time_s, True)}
        for board, names in errors.items()
    }
    return {board: names for board, names in found.items() if names}
