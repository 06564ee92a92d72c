"""The backends of a robot under test, and what each offers.

sim         everything in this process, in virtual time
processes   every board in its own process, in virtual time; the same bytes as sim
vcan        the buses are the kernel's vcan0 ... vcan3, released by the wall clock
hardware    buses and boards of a profile, on real adapters, released by the wall clock
"""

from ranger_sim.foundation.user_error import UserError

SIM, PROCESSES, VCAN, HARDWARE = BACKENDS = ("sim", "processes", "vcan", "hardware")

# What a test may require, including the names of the backends.
OFFERS = {
    SIM: frozenset((SIM, "virtual time", "board memory", "emulated bus")),
    PROCESSES: frozenset((PROCESSES, "virtual time", "emulated bus")),
    VCAN: frozenset((VCAN, "wall clock", "board memory", "external bus")),
    HARDWARE: frozenset((HARDWARE, "wall clock", "external bus")),
}
EVERYTHING = sorted(frozenset().union(*OFFERS.values()))


class MissingError(UserError):
    """The backend does not support this test: the message names what is missing. Such a test is skipped."""


def check_backend(backend: str) -> str:
    """`backend`, if it is a known name."""
    if backend not in BACKENDS:
        raise UserError(f"backend is {backend!r}, allowed are {', '.join(BACKENDS)}")
    return backend


def missing(backend: str, things: tuple[str, ...]) -> str:
    """The `things` that the backend lacks, as the reason of a skip; empty for none. UserError for unknown ones."""
    for thing in things:
        if thing not in EVERYTHING:
            raise UserError(f"requires {thing!r}: what can be required is {', '.join(EVERYTHING)}")
    lacks = [thing for thing in things if thing not in OFFERS[check_backend(backend)]]
    return f"backend {backend} has no {', '.join(lacks)}" if lacks else ""
