"""Walks with a cause at the size that a comparison found: by them its answer is confirmed."""

import numpy as np

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.twins.evidence import Asked, Emulated
from ranger_sim.tools.twins.walking import Task, Walked, walk

WALKS = 2  # of a cause at a size
REPEATS = 6  # of bodies within tolerances, with the cause that is named
FIRST_SEED = 900_000  # other than any twin's
FEWEST_STEPS = 6  # of a walk that counts: others fell at once
FIRST_REPEATED = 910_000
CHARGES, VOLTAGES_V = (0.35, 0.65, 1.0), (25.3, 26.4, 29.4)  # of the packs of `ranger` while it walks
USUAL_CHARGE, ANY_CHARGE = 0.8, (0.4, 1.0)  # of a log without the battery's voltage: of one walk, of several


def emulate(asked: Asked) -> list[Emulated]:
    """The walks asked for, by the same seeds each time; none when the robot falls at once with this cause."""
    count = REPEATS if asked.repeats else WALKS
    charges = np.linspace(*ANY_CHARGE, count) if asked.repeats else np.full(count, USUAL_CHARGE)
    if np.isfinite(asked.voltage_V):
        charges = np.full(count, np.interp(asked.voltage_V, VOLTAGES_V, CHARGES))
    key = f"{asked.cause}@{asked.at}@{asked.parameter}"
    seed = FIRST_REPEATED if asked.repeats else FIRST_SEED
    found: list[Walked] = []
    for number, charge in enumerate(charges.tolist()):
        try:
            found.append(
                walk(
                    Task(
                        "",
                        seed + number,
                        asked.controller,
                        asked.body,
                        key,
                        asked.size,
                        asked.floor_m,
                        charge,
                        asked.repeats,
                    )
                )  # fmt: skip
            )
        except UserError:  # no body has this number
            return []
    return [Emulated(each.leg, each.full, each.link) for each in found if len(each.leg) >= FEWEST_STEPS]
