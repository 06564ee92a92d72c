"""A static curve that no shape of the catalogue has, in a recording with few stretches of it."""

import numpy as np

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid.balance import Balance
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.machine import Known, Quantity
from ranger_sim.sysid.pipeline import diagnose
from ranger_sim.tools.diagnose import words


class Wheel(Balance):
    """speed = gain command."""

    name = "wheel"
    quantities = (Quantity("command", "", "-250 to 250", drives=True), Quantity("speed", "", "in rpm"))
    parameters = (Known("gain", "1", 2.5, 0.0, 10.0, "of the motor"),)
    response = "speed"

    def columns(self, s):
        return {"gain": s["command"]}


def ramp(seed, bend):
    """100 commands from one end to the other, 2 s each."""
    command = np.linspace(-250.0, 250.0, 101)
    noise = 3.0 * generator(seed, "wheel").normal(size=101)
    speed = 2.4 * command + bend * np.sin(command / 40.0) * np.exp(-np.abs(command) / 200.0) + noise
    return Table(2.0 * np.arange(101.0), {"command": command, "speed": speed}, (slice(0, 101),), f"wheel {seed}")


def test_a_curve_that_a_black_box_learns_is_not_called_too_short():
    found = diagnose(Wheel(), [ramp(1, 150.0)], [ramp(2, 150.0)])
    said, evidence = words.sentence(found), found.result.evidence
    errors = evidence.held_out_errors["speed"]
    assert not found.result.causes and errors.black_box < 0.7 * errors.before
    assert "too short" not in said and evidence.too_short_s is None
    assert evidence.learnable == ("speed",) and f"{errors.before:.2%}" in said


def test_a_straight_line_leaves_nothing_to_learn():
    assert diagnose(Wheel(), [ramp(1, 0.0)], [ramp(2, 0.0)]).result.evidence.learnable is None
