"""What a robot under test can run on, and what each backend offers.

sim         everything in this process, in virtual time
processes   every board a process of its own, in virtual time; the same bytes as sim
vcan        the buses are the kernel's vcan0 ... vcan3, released by the wall clock
hardware    buses and boards as a profile has them, on real adapters, released by the wall clock
"""

from ranger_sim.foundation.user_error import UserError

SIM, PROCESSES, VCAN, HARDWARE = BACKENDS = ("sim", "processes", "vcan", "hardware")

# What a test may require. The names of the backends are such things as well.
OFFERS = {
    SIM: frozenset((SIM, "virtual time", "board memory", "emulated bus")),
    PROCESSES: frozenset((PROCESSES, "virtual time", "emulated bus")),
    VCAN: frozenset((VCAN, "wall clock", "board memory", "external bus")),
    HARDWARE: frozenset((HARDWARE, "wall clock", "external bus")),
}
EVERYTHING = sorted(frozenset().union(*OFFERS.values()))


class MissingError(UserError):
    """The backend cannot carry this test: it has not what the text names. A test that meets it is skipped."""


def check_backend(backend: str) -> str:
    """`backend`, if there is one of this name."""
    if backend not in BACKENDS:
        raise UserError(f"backend is {backend!r}, allowed are {', '.join(BACKENDS)}")
    return backend


def missing(backend: str, things: tuple[str, ...]) -> str:
    """What of `things` the backend has not, as the reason of a skip; empty when it has all. UserError for others."""
    for thing in things:
        if thing not in EVERYTHING:
            raise UserError(f"requires {thing!r}: what can be required is {', '.join(EVERYTHING)}")
    lacks = [thing for thing in things if thing not in OFFERS[check_backend(backend)]]
    return f"backend {backend} has no {', '.join(lacks)}" if lacks else ""
