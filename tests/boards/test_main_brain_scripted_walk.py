"""Scripted sensors for several strides: every machine passes through its states in the order of a step."""

import math

from ranger_sim.boards.quirks import Quirks
from tests.boards.main_brain_bench import Bench

STEP_S = 0.6
HALF_SPREAD = 0.19  # leg angle at heel strike, rad

# One step with the outer legs standing: (from this part of the step on) hip, leg, inner foot as driven by hand.
# The pushing foot is given the turn that ends its push.


class ScriptedRobot:
    """Legs as half cosines, feet as ramps: no physics, only plausible sensor values in the right order."""

    def __init__(self) -> None:
        # the script's feet differ by 0.2 rad when one strikes: with the appendix's feet that lifts a leg the least
        self.bench = Bench(quirks=Quirks(estimator_feet="appendix"))
        self.bench.tick(UI_ANG_RATE_X=-0.004)
        self.last_outer = None
        self.standing = "outer"

    def sensors(self, part, standing):
        """Sensor values at `part` (0 strike ... 1 next strike) of a step on the legs `standing`."""
        lean = -HALF_SPREAD * math.cos(math.pi * part)  # standing leg, forward positive
        swing_lean = HALF_SPREAD * math.cos(math.pi * part)
        ahead = lean - swing_lean
        swing_rate = 0.0
        if part < 0.12:  # double stance: the rear foot finishes its push
            swing_ankle, swing_motor = 1.68 + 0.25 + 3.0 * part, 1.68 + 0.25 + 3.0 * part
        elif part < 0.3:  # flip up
            swing_ankle = 2.3 - 2.1 * (part - 0.12) / 0.18
            swing_motor, swing_rate = swing_ankle - 0.05, -2.1 / (0.18 * STEP_S)
        elif part < 0.65:
            swing_ankle = swing_motor = 0.2
        else:  # flip down to where the published foot angle is 2.0
            down = min(1.0, (part - 0.65) / 0.2)
            swing_ankle = swing_motor = 0.2 + down * (1.68 + 0.25 + HALF_SPREAD - 0.2)
        stand_ankle = 1.68 + 0.25 - lean + (max(0.0, part - 0.93) * 3.0)
        pairs = {"stand": (stand_ankle, stand_ankle, 0.0), "swing": (swing_ankle, swing_motor, swing_rate)}
        outer, inner = ("stand", "swing") if standing == "outer" else ("swing", "stand")
        outer_lean = lean if standing == "outer" else swing_lean
        hip = ahead if standing == "outer" else -ahead
        contact = 4000.0 if part < 0.12 or part >= 0.99 else 300.0
        rate = 0.0 if self.last_outer is None else (outer_lean - self.last_outer) / 0.002
        self.last_outer = outer_lean
        return {
            "MCH_ANGLE": hip,
            "MCH_ANG_RATE": (2.0 if standing == "outer" else -2.0) * math.sin(math.pi * part),
            "UI_ANG_RATE_X": -0.004 - rate,
            "MCFO_RIGHT_ANKLE_ANGLE": pairs[outer][0],
            "MCFO_MOTOR_POSITION": pairs[outer][1],
            "MCFO_RIGHT_ANKLE_RATE": pairs[outer][2],
            "MCFI_MID_ANKLE_ANGLE": pairs[inner][0],
            "MCFI_MOTOR_POSITION": pairs[inner][1],
            "MCFI_ANKLE_RATE": pairs[inner][2],
            "MCFO_LEFT_HEEL_SENSE": contact if outer == "swing" else 4000.0,
            "MCFO_RIGHT_HEEL_SENSE": contact if outer == "swing" else 4000.0,
            "MCFI_LEFT_HEEL_SENSE": contact if inner == "swing" else 4000.0,
            "MCFI_RIGHT_HEEL_SENSE": contact if inner == "swing" else 4000.0,
        }

    def walk(self, steps):
        """Names of the states of leg, hip, inner and outer foot, each time one of them changed."""
        bench = self.bench
        for _ in range(5):
            bench.tick(**self.sensors(0.5, "outer"))
        bench.press(1)
        seen = [[], [], [], []]
        for step in range(steps):
            standing = "outer" if step % 2 == 0 else "inner"
            struck = bench.get("E_STEP_COUNT")
            part = 0.45 if step == 0 else 0.0
            while bench.get("E_STEP_COUNT") == struck and part < 1.1:
                part += 0.002 / STEP_S
                bench.tick(**self.sensors(min(part, 1.0), standing))
                for record, name in zip(seen, bench.states()[1:5], strict=True):
                    if not record or record[-1] != name:
                        record.append(name)
        return seen


def test_every_machine_goes_round_in_its_order_for_six_steps():
    leg, hip, inner, outer = ScriptedRobot().walk(6)
    stride = ["LI_preswing", "LI_premid", "LI_aftermid", "LO_preswing", "LO_premid", "LO_aftermid"]
    assert leg[:13] == ["LO_aftermid", *stride, *stride]
    stride = ["HO_preswing", "HO_premid", "HO_aftermid", "HI_preswing", "HI_premid", "HI_aftermid"]
    assert hip[:13] == ["HI_starthold", *stride, *stride]
    stride = ["stance", "prepush", "afterpush", "flipup", "flipdown"]
    assert inner[:11] == ["startflipdown", *stride, *stride]
    stride = ["flipup", "flipdown", "stance", "prepush", "afterpush"]
    assert outer[:11] == ["startstance", *stride, *stride]


def test_the_estimator_follows_the_scripted_legs():
    robot = ScriptedRobot()
    robot.walk(6)
    bench = robot.bench
    assert bench.get("E_STEP_COUNT") == 6
    # the script is what the geometry assumes (level floor, feet alike), so the angle stays right:
    # a tenth of a mrad per step of trapezoid error, and the strike seen two slots late
    assert abs(bench.get("E_LO_ERROR")) < 0.005
    assert abs(bench.get("EST_LAST_STEP_DURATION") - STEP_S) < 0.01
    assert bench.errors == []


def test_the_published_mid_stance_rate_is_that_of_the_script():
    robot = ScriptedRobot()
    robot.walk(6)
    # mean rate from flip-up at 0.12 ... 0.13 of the step to mid-stance at 0.5
    start = 0.125
    expected = HALF_SPREAD * math.cos(math.pi * start) / ((0.5 - start) * STEP_S)
    assert abs(robot.bench.get("E_AM_L_ABSRATE") - expected) < 0.03
