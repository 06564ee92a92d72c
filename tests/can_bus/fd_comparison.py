"""Random CAN FD frames, coded by us and by the oracle of ISO 11898-1:2015.

`python -m tests.can_bus.fd_comparison FRAMES` from the repository's root compares so many and prints how many differ.
"""

import sys

from ranger_sim.can_bus.fd_frame import LENGTHS, PHASE_MASK, PHASE_SHIFT, fd_wire, length_code, phases
from ranger_sim.can_bus.frame import HIGHEST_EXTENDED, HIGHEST_STANDARD
from ranger_sim.foundation.events import FLAG_BRS, FLAG_ESI, FLAG_EXTENDED, FLAG_FD

from . import fd_oracle as oracle
from .oracle_comparison import Dice


def random_fd_frame(rng):
    """Any frame; half of them have long runs of equal bits."""
    extended = rng.chance(0.3)
    identifier = rng.number(0, HIGHEST_EXTENDED if extended else HIGHEST_STANDARD)
    if rng.chance(0.2):
        identifier = rng.choice((0, 0x7FF, identifier & ~0xFF, identifier | 0xFF))
    length = rng.choice(LENGTHS)
    values = (0, 255, 0x0F, 0xF8, 0x83) if rng.chance(0.5) else tuple(range(256))
    return oracle.FdFrame(
        identifier, bytes(rng.choice(values) for _ in range(length)), extended, rng.chance(0.7), rng.chance(0.2)
    )


def fd_flags_of(frame):
    """The flags of our frames."""
    flags = FLAG_FD | length_code(len(frame.data))
    flags |= FLAG_EXTENDED if frame.extended else 0
    flags |= FLAG_BRS if frame.brs else 0
    return flags | (FLAG_ESI if frame.esi else 0)


def oracle_phases(frame, iso):
    """(bits at the nominal rate, bits at the data rate) of the oracle's frame, counted as `fd_frame.phases` does."""
    text, brs, delimiter = oracle.transmitted(frame, iso)
    return (brs + 1 + 9, delimiter - brs) if frame.brs else (len(text), 0)


def difference(frame, iso):
    """What differs between ours and the oracle's coding of a frame: "" for nothing."""
    ours = frame.identifier, fd_flags_of(frame), frame.data, iso
    text = "".join(map(str, fd_wire(*ours)[0]))
    if text != oracle.transmitted(frame, iso)[0]:
        return "bits"
    if oracle.received(text, iso) != frame:
        return "what a receiver reads"
    packed = phases(*ours)
    return "" if (packed & PHASE_MASK, packed >> PHASE_SHIFT) == oracle_phases(frame, iso) else "phases"


def compare_fd_frames(count):
    """Frames of so many random ones that differ, each fifth of them non-ISO."""
    rng = Dice("FD frames")
    found = []
    for number in range(count):
        frame = random_fd_frame(rng)
        if difference(frame, number % 5 != 0):
            found.append(frame)
    return found


if __name__ == "__main__":
    frames = int(sys.argv[1])
    different = compare_fd_frames(frames)
    print(f"{frames} FD frames compared, {len(different)} differ {different[:3] or ''}")
    sys.exit(1 if different else 0)
