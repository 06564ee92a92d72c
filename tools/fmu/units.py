"""Units as FMI writes them: exponents of the SI base units, and a factor."""

from __future__ import annotations

from ranger_sim.foundation.user_error import UserError

# Exponents of kg, m, s, A, rad. The International System of Units (BIPM), 9th edition, tables 2 and 4.
BASE = ("kg", "m", "s", "A", "rad")
UNITS = {
    "kg": (1, 0, 0, 0, 0),
    "m": (0, 1, 0, 0, 0),
    "s": (0, 0, 1, 0, 0),
    "A": (0, 0, 0, 1, 0),
    "rad": (0, 0, 0, 0, 1),
    "N": (1, 1, -2, 0, 0),
    "J": (1, 2, -2, 0, 0),
    "W": (1, 2, -3, 0, 0),
    "V": (1, 2, -3, -1, 0),
    "ohm": (1, 2, -3, -2, 0),
    "h": (0, 0, 1, 0, 0),
}
FACTORS = {"h": 3600.0}  # of the units that are not coherent


def exponents(unit: str) -> tuple[dict[str, int], float]:
    """({base unit: exponent}, factor to SI) of a unit as our tables write it: "N m s/rad", "kg m^2"."""
    total = [0] * len(BASE)
    factor = 1.0
    above, *below = unit.split("/")
    for text, sign in [(above, 1), *((each, -1) for each in below)]:
        for word in text.split():
            name, _, power = word.partition("^")
            if name == "1":
                continue
            if name not in UNITS:
                raise UserError(f"unit {unit!r}: {name!r} is none of {', '.join(UNITS)}")
            times = sign * int(power or 1)
            factor *= FACTORS.get(name, 1.0) ** times
            total = [before + times * more for before, more in zip(total, UNITS[name], strict=True)]
    return {name: number for name, number in zip(BASE, total, strict=True) if number}, factor
