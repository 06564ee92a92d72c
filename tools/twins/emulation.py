"""Walks with a cause at the size that a comparison found: by them its answer is confirmed."""

import dataclasses

import numpy as np

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.twins.evidence import Asked, Emulated
from ranger_sim.tools.twins.walking import Task, Walked, walk

WALKS = 2  # of a cause at a size
FIRST_SEED = 900_000  # other than any twin's
FEWEST_STEPS = 6  # of a walk that counts: others fell at once
CHARGES, VOLTAGES_V = (0.35, 0.65, 1.0), (25.3, 26.4, 29.4)  # of the packs of `ranger` while it walks
USUAL_CHARGE = 0.8  # of a log without the battery's voltage


def emulate(asked: Asked) -> list[Emulated]:
    """The walks asked for, by the same seeds each time; none when the robot falls at once with this cause."""
    charge = USUAL_CHARGE
    if np.isfinite(asked.voltage_V):
        charge = float(np.interp(asked.voltage_V, VOLTAGES_V, CHARGES))
    key = f"{asked.cause}@{asked.at}@{asked.parameter}"
    first = Task("", FIRST_SEED, asked.controller, asked.body, key, asked.size, asked.floor_m, charge)
    found: list[Walked] = []
    for number in range(WALKS):
        try:
            found.append(walk(dataclasses.replace(first, seed=FIRST_SEED + number)))
        except UserError:  # no body has this number
            return []
    return [Emulated(each.leg, each.full, each.link) for each in found if len(each.leg) >= FEWEST_STEPS]
