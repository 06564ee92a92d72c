"""Boards' normal errors on a healthy machine: columns normal_per_s and normal_at_start of its master table."""

from collections.abc import Mapping

from ranger_sim.harness.names import Names

# Errors come in bursts: a hip that is held back reports its clipped current in every slot. So the errors of one more
# second than has passed are allowed, and a test of 10 ms may see such a burst as well.
BURST_S = 1.0


def most_normal(names: Names, board: str, code: int, passed_s: float, from_power_up: bool) -> float:
    """The most occurrences of an error on a board of a healthy machine in `passed_s` seconds."""
    rate = names.normal_per_s.get(code, {}).get(board, 0.0)
    once = names.normal_at_start.get(code, {}).get(board, 0.0) if from_power_up else 0.0
    return rate * (passed_s + BURST_S) + once if rate or once else 0.0


def beyond(names: Names, errors: Mapping[str, Mapping[str, int]], time_s: float) -> dict[str, dict[str, int]]:
    """Those of a summary's `errors` (counts by board and name) that a healthy machine does not have in `time_s`."""
    found = {
        board: {
            name: count
            for name, count in counts.items()
            if count > most_normal(names, board, names.codes[name], time_s, True)
        }
        for board, counts in errors.items()
    }
    return {board: counts for board, counts in found.items() if counts}
