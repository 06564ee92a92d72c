"""What a user's methods have to return, checked once for each recording before anything is fitted."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ranger_sim.foundation.user_error import ModelError
from ranger_sim.sysid.dataset import Array, Table
from ranger_sim.sysid.free_simulation.declared import DeclaredMachine

LOOKED_AT = 16  # samples of a recording, in two shapes


def check_columns(machine: DeclaredMachine, table: Table, given: Any, guess: Any) -> None:
    """ModelError where `inputs` or `first_guess` returns something else than a column of each."""
    for method, found, needed in (("inputs", given, ()), ("first_guess", guess, machine.states)):
        named(machine, method, found, needed)
        for name, column in found.items():
            if np.shape(column) != (len(table),):
                raise ModelError(
                    f"{machine.name}: {method} returns {name} of shape {np.shape(column)}; each has one for each of "
                    f"the {len(table)} rows"
                )
    for joint in machine.joints:
        if joint.drive and joint.drive not in given:
            raise ModelError(
                f"{machine.name}: joint {joint.rate} is driven by {joint.drive}; inputs are {', '.join(given)}"
            )
    missing = [name for name in machine.noisy_inputs if name not in given]
    if missing:
        raise ModelError(f"{machine.name}: noisy_inputs names {', '.join(missing)}; inputs are {', '.join(given)}")


def check_methods(
    machine: DeclaredMachine, states: Array, driven: Any, values: Mapping[str, Array], part_s: float
) -> None:
    """ModelError where `step` or `observe` lacks a name, or is not computed element by element.

    states: (n, s). driven: inputs and ports of these samples (`Simulator.driven`).
    """
    count = min(len(states), LOOKED_AT)
    channels = [each.channel for each in machine.outputs]
    for shape in ((1, count), (3, count)):
        x = {name: np.broadcast_to(states[None, :count, i], shape) for i, name in enumerate(machine.states)}
        samples, middle = ({name: np.broadcast_to(column[..., :count], shape) for name, column in each.items()}
                           for each in (driven.samples, driven.middles[0]))  # fmt: skip
        with np.errstate(all="ignore"):  # at a start value; what the fit meets is judged there
            after = machine.step(x, middle, values, part_s)
            seen = machine.observe(x, samples, values)
        for method, found, needed in (("step", after, machine.states), ("observe", seen, channels)):
            named(machine, method, found, needed)
            for name in needed:
                try:
                    np.broadcast_to(np.asarray(found[name], dtype=float), shape)
                except (TypeError, ValueError):
                    raise ModelError(
                        f"{machine.name}: {method} returns {name} of shape {np.shape(found[name])} for states of shape "
                        f"{shape}; it is computed element by element"
                    ) from None


def named(machine: DeclaredMachine, method: str, found: Any, needed: Sequence[str]) -> None:
    """ModelError unless this is a mapping that has the needed names."""
    if not isinstance(found, Mapping):
        raise ModelError(
            f"{machine.name}: {method} returns {type(found).__name__}; it returns a dictionary"
            + (f" of {', '.join(needed)}" if needed else "")
        )
    missing = [name for name in needed if name not in found]
    if missing:
        raise ModelError(
            f"{machine.name}: {method} returns no {', '.join(missing)}; it has {', '.join(found) or 'none'}"
        )
