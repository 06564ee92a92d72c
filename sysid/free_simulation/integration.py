"""Steps of an ordinary differential equation for a machine's `step`."""

from collections.abc import Callable, Mapping
from typing import cast

import numpy as np

from ranger_sim.sysid.dataset import Array

OPEN_S = 0.01  # memory of dry friction's reaction where it holds; chosen by us

Quantities = Mapping[str, Array]  # by name, all of one shape


def held(rate: Array, braking: Array) -> Array:
    """A rate after dry friction that can take `braking` of it in this step: it stops at zero and does not reverse.

    This is the implicit step of Coulomb's law: true standstill, without a smoothed sign that creeps.
    """
    return cast(Array, np.sign(rate) * np.maximum(np.abs(rate) - braking, 0.0))


def standing(rate: Array, friction: Array, slow: float, step_s: float) -> Array:
    """Deviation of dry friction's impulse per step near standstill, where friction balances any torque (for `loose`).

    rate: (n,); friction: its limit, torque or force; slow: rate about which a smoothed sign turns. Otherwise a machine
    that truly rests would differ from every simulation with a smoothed sign, and that would be called an effect.
    """
    return np.asarray(friction * np.exp(-0.5 * (rate / (2.0 * slow)) ** 2) * np.sqrt(2.0 * OPEN_S * step_s))


def runge_kutta(
    rates: Callable[[Quantities, Quantities, Quantities], Quantities],
    x: Quantities,
    u: Quantities,
    p: Quantities,
    step_s: float,
) -> dict[str, Array]:
    """One step of the classical fourth-order method; inputs keep their values of the step's middle. For `step`."""

    def at(rate: Quantities, part_s: float) -> dict[str, Array]:
        return {name: x[name] + part_s * rate[name] for name in x}

    first = rates(x, u, p)
    second = rates(at(first, 0.5 * step_s), u, p)
    third = rates(at(second, 0.5 * step_s), u, p)
    fourth = rates(at(third, step_s), u, p)
    return {
        name: x[name] + step_s / 6.0 * (first[name] + 2.0 * (second[name] + third[name]) + fourth[name]) for name in x
    }
