"""The user's own simulator is checked first: what cannot be determined, parameters at a limit, steps too long."""

import dataclasses

import numpy as np
import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import own_model
from ranger_sim.sysid.free_simulation.fit import TrajectoryFit
from ranger_sim.sysid.machine import Known
from ranger_sim.sysid.pipeline import diagnose
from tests.sysid import test_ways_between_rows as rough
from tests.sysid.test_noise_floor import Disc
from tests.sysid.test_swing_up import WEIGHT, Pendulum, swung_up


class Weighed(Disc):
    """The same disc by its torque constant, friction and inertia, of which only two ratios show."""

    parameters = (
        Known("constant", "N m/V", 0.4, 0.0, 10.0, "of the motor"),
        Known("friction", "N m s", 0.1, 0.0, 10.0, "of the bearing"),
        Known("inertia", "kg m^2", 0.08, 0.001, 10.0, "of the disc"),
    )

    def rates(self, x, u, p):
        return {"speed": (p["constant"] * u["voltage"] - p["friction"] * x["speed"]) / p["inertia"]}


def limited(low, high):
    machine = Disc()
    gain, damping = machine.parameters
    machine.parameters = (dataclasses.replace(gain, low=low, high=high), damping)
    return machine


def findings(result):
    return {each.kind: each for each in result.data_findings}


def test_parameters_that_only_their_ratio_shows_are_refused_by_name():
    with pytest.raises(UserError, match="constant, friction, inertia cannot be determined together: .* as known"):
        diagnose(Weighed(), [rough.spun(3, "held")])


def test_a_parameter_at_its_limit_is_named_with_the_limit_and_no_cause_is():
    result = diagnose(limited(1.0, 4.8), [rough.spun(3, "held")]).result
    found = findings(result)["at_limit"]
    assert found.channel == "gain" and "its limit of 4.8 rad/s^2/V: widen the limit" in found.text
    assert result.detected and not result.causes


def test_a_sound_model_has_neither_of_these_findings():
    result = diagnose(limited(1.0, 10.0), [rough.spun(3, "held")]).result
    assert not {"at_limit", "coarse", "too_coarse", "correlated"} & set(findings(result)) and not result.detected


class Euler(Pendulum):
    """One step of Euler's rule from row to row."""

    weight_Nm = WEIGHT
    parts = 1

    def step(self, x, u, p, step_s):
        rates = self.rates(x, u, p)
        return {name: x[name] + step_s * rates[name] for name in x}


class RungeKutta(Pendulum):
    weight_Nm = WEIGHT


@pytest.mark.parametrize(("machine", "named"), [(Euler(), {"position_rad"}), (RungeKutta(), set())])
def test_steps_that_are_long_for_the_noise_are_named_with_what_to_change(machine, named):
    fit = TrajectoryFit(machine, swung_up(1))
    fit.settle()
    fit.round_again()
    found = own_model.steps(fit)
    assert {each.channel for each in found} >= named and bool(found) == bool(named)
    assert all("take more than 1 `parts`" in each.text for each in found)


def test_more_steps_are_taken_where_one_is_too_long_and_no_more_where_it_is_not():
    long, short = (machine.prepare(swung_up(1)).fit for machine in (Euler(), RungeKutta()))
    assert long.simulator.numerics.parts > 1 and own_model.steps(long) == []
    assert short.simulator.numerics.parts == RungeKutta.parts
    # with them Euler's rule finds the parameters that Runge and Kutta's finds; with one step it does not
    assert long.p_at == pytest.approx(short.p_at, rel=0.01)
    alone = TrajectoryFit(Euler(), swung_up(1))
    alone.settle()
    assert np.max(np.abs(alone.p / short.p_at - 1.0)) > 0.05
