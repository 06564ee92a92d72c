"""Faults of the world: a push, a step, a slope, a slippery floor."""

import math
from typing import Any

from ranger_sim.foundation.user_error import FaultError
from ranger_sim.harness.faults.catalogue import mode
from ranger_sim.harness.faults.fault import Fault, Parameter
from ranger_sim.harness.faults.kinds import FLOOR, ROBOT
from ranger_sim.plant.mechanics.leg import RIGID


class WorldFault(Fault):
    """A fault of what surrounds the robot."""

    def connect(self) -> None:
        self.body: Any = self.robot.plant.body
        self.floor: Any = self.robot.plant.floor


@mode
class Push(WorldFault):
    """A force along the floor, spread over the robot's mass as its weight is: at its centre of mass."""

    mode = "push"
    kinds = (ROBOT,)
    needs = "the robot as a whole"
    meaning = "is pushed along the floor at its centre of mass; forwards positive"
    unit = "N"
    parameters = (
        Parameter("force", "N", 10.0, -1000.0, 1000.0, "the force", "chosen by us: a tenth of the weight"),
        Parameter("length_ms", "ms", 100.0, 0.25, 1e6, "how long, unless it ends before", "chosen by us: a finger's"),
    )

    def begin(self, now_ns: int) -> None:
        super().begin(now_ns)
        self.over_ns = now_ns + round(self.values["length_ms"] * 1e6)

    def before(self, now_ns: int) -> None:
        if now_ns >= self.over_ns:
            self.ended_ns = now_ns
            self.finish(now_ns)
            return
        self.body.set_slope(self.floor.slope_rad)
        self.body.gx = self.body.gx + self.values["force"] / self.body.M
        if self.values["force"]:
            self.note(now_ns, self.values["force"])

    def finish(self, now_ns: int) -> None:
        self.body.set_slope(self.floor.slope_rad)

    def is_clear(self, start_ns: int, end_ns: int) -> bool:
        """Whether only gravity acts, along the floor by its slope."""
        p = self.body.parameters
        return bool(self.body.gx == p.gravity_m_per_s2 * math.sin(self.floor.slope_rad))


@mode
class Slope(WorldFault):
    """The floor falls, as one board does: gravity turns (EQUATIONS 3)."""

    mode = "slope"
    kinds = (FLOOR,)
    needs = "the floor"
    meaning = "falls in the walking direction by an angle on top of its slope"
    unit = "rad"
    parameters = (
        Parameter(
            "angle", "rad", 0.02, -0.5, 0.5, "down positive", "chosen by us: about 1 degree; limits: scenario.py"
        ),
    )

    def begin(self, now_ns: int) -> None:
        super().begin(now_ns)
        self.usual = self.floor.slope_rad
        self.floor.slope_rad = self.usual + self.values["angle"]
        self.body.set_slope(self.floor.slope_rad)

    def before(self, now_ns: int) -> None:
        if self.floor.slope_rad != self.usual:
            self.note(now_ns, self.floor.slope_rad - self.usual)

    def finish(self, now_ns: int) -> None:
        self.floor.slope_rad = self.usual
        self.body.set_slope(self.usual)

    def is_clear(self, start_ns: int, end_ns: int) -> bool:
        p = self.body.parameters
        return bool(self.body.gx == p.gravity_m_per_s2 * math.sin(self.usual))


@mode
class StepInFloor(WorldFault):
    """From the next foothold on all is higher, until the fault ends: a threshold, a kerb."""

    mode = "step"
    kinds = (FLOOR,)
    needs = "the floor"
    meaning = "lies higher from the next foothold on"
    unit = "m"
    parameters = (
        Parameter("height", "m", 0.005, -0.1, 0.1, "up positive", "chosen by us: a carpet's edge; limits: floor.py"),
    )

    def begin(self, now_ns: int) -> None:
        super().begin(now_ns)
        if self.floor.step_at is not None:
            raise FaultError(
                f"fault {self.text()}: the floor has a step already, from foothold {self.floor.step_at} on"
            )
        self.foothold = self.floor.foothold
        self.floor.step_at = self.foothold + 1
        self.floor.step_m = self.values["height"]

    def before(self, now_ns: int) -> None:
        if self.floor.foothold > self.foothold and self.values["height"]:
            self.foothold = self.floor.foothold
            self.note(now_ns, self.values["height"])

    def finish(self, now_ns: int) -> None:
        self.before(now_ns)
        self.floor.step_at = None
        self.floor.step_m = 0.0
        self.last_high = self.floor.foothold

    def is_clear(self, start_ns: int, end_ns: int) -> bool:
        """Whether a foothold is at the height of the floor again, or none ever was at the step's."""
        return bool(self.floor.foothold > self.last_high or not self.acted)


@mode
class SlipperyFloor(WorldFault):
    """Another friction under both feet. It acts while a foot has load: the floor can then hold another force."""

    mode = "slippery"
    kinds = (FLOOR,)
    needs = "the floor"
    meaning = "has another coefficient of friction"
    unit = "N"
    parameters = (
        Parameter("friction", "1", 0.2, 0.0, 10.0, "mu of sole and floor", "chosen by us: oil; rubber has 0.9"),
    )

    def connect(self) -> None:
        super().connect()
        contact = self.robot.plant.parameters.contact
        if contact in RIGID:
            raise FaultError(
                f"fault {self.text()}: it cannot act there; with the body's contact {contact!r} feet never slide, "
                f"bodies with contact 'coulomb' or 'compliant' have friction"
            )

    def begin(self, now_ns: int) -> None:
        super().begin(now_ns)
        self.usual = self.body.sole.mu
        self.body.sole.mu = self.values["friction"]

    def before(self, now_ns: int) -> None:
        """Record, under load only, how much less or more the floor can hold at the feet's load."""
        load_N = self.body.outer.Fy + self.body.inner.Fy
        if load_N > 0.0 and self.body.sole.mu != self.usual:
            self.note(now_ns, (self.body.sole.mu - self.usual) * load_N)

    def finish(self, now_ns: int) -> None:
        self.body.sole.mu = self.usual

    def is_clear(self, start_ns: int, end_ns: int) -> bool:
        return bool(self.body.sole.mu == self.body.parameters.floor_friction)
