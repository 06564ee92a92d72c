"""Prints the trace digest of a short run: python -m tests.system.digest_of SECONDS [UPTIME_MS]."""

import sys

from ranger_sim.harness.ranger import Ranger
from ranger_sim.harness.scenario import Scenario


def digest(seconds: float, uptime_ms: int = 0) -> str:
    """BLAKE2b-256 of the first `seconds` after power-up at `uptime_ms`."""
    robot = Ranger(Scenario(start_uptime_ms=uptime_ms))
    robot.run_for(seconds)
    assert not robot.ended
    return robot.trace_digest()


if __name__ == "__main__":
    print(digest(float(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0))
