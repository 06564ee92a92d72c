"""What other numerics, which a simulator could as well have, move the sizes of effects by."""

import copy
import dataclasses
import itertools

import numpy as np

from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.free_simulation.fit import CHOSEN, TrajectoryFit
from ranger_sim.sysid.free_simulation.simulator import Numerics

ROUNDS = 4  # with other numerics, from the fit without them
FINE_ENOUGH = 0.05  # of an output's noise: a quarter of a percent of its square. Chosen by us
MORE_ROUNDS = 12  # where a lag starts elsewhere
MORE, MOST_PARTS = 4, 64  # times as many steps; the most from sample to sample
NARROW = 0.25  # of what is open at standstill
FINER = 16  # steps of a check, for each of the simulator's
LEAST_LAG = 0.01  # samples: a delay has a size
OPEN = 1e-6  # of a state's size: a law that leaves less open is not open


def moved(fit: TrajectoryFit) -> Array:
    """(variants, coefficients): what the coefficients of what acts move by."""
    acting = slice(fit.count, len(fit.p_at) - fit.unknown)
    out = []
    for other in _otherwise(fit):
        other.settle(ROUNDS)
        out.append(other.p[acting] - fit.p_at[acting])
    for other in _held_otherwise(fit):
        other.settle(MORE_ROUNDS)
        if other.surprise - fit.surprise < CHOSEN:  # the data do not show which it is
            out.append(other.p[acting] - fit.p_at[acting])
    return np.array(out)


def by_finer_steps(fit: TrajectoryFit) -> Array:
    """(outputs,) rms by which steps of a sixteenth move each output from row to row, in its noise.

    After the parameters have taken what they can; where `round_again` linearised.
    """
    now, predictor = fit.simulator, fit.predictor
    assert predictor is not None
    finer = now.stepping(dataclasses.replace(now.numerics, parts=FINER * now.numerics.parts))
    entering = fit.entering()
    f, g = (each.at(fit.x, fit.p_at, each.driven(fit.u, entering))[0] for each in (now, finer))
    moved: Array = g - f
    moved[fit.ends] = 0.0
    forced = np.concatenate((moved[:, :, None], fit.lin.f_p), axis=2)
    shown = np.concatenate((np.zeros((*fit.y.shape, 1)), fit.lin.h_p), axis=2)
    return np.asarray(np.sqrt(np.mean(predictor.left(forced, shown) ** 2, axis=0)))


def take_finer_steps(fit: TrajectoryFit, rounds: int) -> bool:
    """Settle the fit with more steps from sample to sample, until they move no output by much of its noise.

    True where steps were added, up to MOST_PARTS.
    """
    before = fit.simulator.numerics.parts
    while MORE * fit.simulator.numerics.parts <= MOST_PARTS:
        p = fit.p
        fit.round_again()
        fit.p = p
        if not np.any(by_finer_steps(fit) > FINE_ENOUGH):
            break
        now = fit.simulator.numerics
        fit.simulator = fit.simulator.stepping(dataclasses.replace(now, parts=MORE * now.parts))
        fit.settle_anew(rounds)
    return fit.simulator.numerics.parts > before


def likelier_held(fit: TrajectoryFit) -> TrajectoryFit:
    """The fit, or where a lag acts one with an input held otherwise, if it is surely likelier.

    Without its lag a heater that was held looked like one that jumps inside its steps.
    """
    best = fit
    for other in _held_otherwise(fit):
        other.settle(MORE_ROUNDS)
        if other.surprise < best.surprise - CHOSEN:
            best = other
    return best


def _otherwise(fit: TrajectoryFit) -> list[TrajectoryFit]:
    """Fits that continue from here with other numerics: half the step; inputs on straight lines instead of cubics, or
    on straight lines instead of held where they seem to stay; a quarter of what is open at standstill."""
    now = fit.simulator.numerics
    variants = [dataclasses.replace(now, parts=2 * now.parts)]
    straight = dataclasses.replace(now, curved=frozenset(), held=now.held - fit.simulator.staying)
    if straight != now:
        variants.append(straight)
    if np.any(fit.loose() > OPEN * fit.size_x):
        variants.append(dataclasses.replace(now, open_share=NARROW))
    return [_with(fit, variant) for variant in variants]


def _held_otherwise(fit: TrajectoryFit) -> list[TrajectoryFit]:
    """Where a lag acts, fits with a smooth input held from row to row, or on its cubic where it is held now; and with
    one that stays at values and jumps held, or jumping anywhere inside the step before the row.

    What is held is late by half a row, so that the lag starts with half a row less, or more; at its shape, and at that
    of its new size.
    """
    now = fit.simulator.numerics
    made = []
    for name, same_shape in itertools.product(sorted(fit.simulator.curving | fit.simulator.staying), (True, False)):
        lags = [each for each in fit.acting if each.term.cause == "sensor_lag"
                or (each.term.cause, each.term.at) == ("input_lag", name)]  # fmt: skip
        if not lags:
            continue
        held = now.held ^ {name}
        unsure = now.unsure - {name} if name in held or name in fit.simulator.curving else now.unsure | {name}
        other = _with(fit, dataclasses.replace(now, held=held, unsure=unsure))
        later_s = (0.5 if name in now.held else -0.5) * fit.step_s
        other.acting, other.p = [], fit.p.copy()
        first = len(fit.simulator.names)
        for each in fit.acting:
            if each in lags:
                other.p[first] += later_s
                if each.term.scale is not None and not same_shape:
                    lag_s = max(float(other.p[first]), LEAST_LAG * fit.step_s)
                    each = dataclasses.replace(each, shape={**each.shape, each.term.scale: lag_s})
            other.acting.append(each)
            first += len(each.coefficients)
        made.append(other)
    return made


def _with(fit: TrajectoryFit, numerics: Numerics) -> TrajectoryFit:
    other = copy.copy(fit)
    other.simulator = fit.simulator.stepping(numerics)
    return other
