"""The terms of a model file on a virtual bench: additions of the simulator's own equations, at the bench's gear.

Terms act at the robot's joint (plant/terms.py). A bench with the same rotor and another gearbox has the rotor's torques
by its own gear: with r = robot's gear over the bench's, torque / r at rate x r.
"""

import dataclasses
from collections.abc import Mapping, Sequence

from ranger_sim.plant import terms
from ranger_sim.plant.electrics.motor_parameters import MotorParameters
from ranger_sim.plant.electrics.motor_unit import MotorUnit
from ranger_sim.plant.mechanics.parameters import BodyParameters
from ranger_sim.plant.mechanics.term_torques import TermTorques

BODY = BodyParameters()
GEARS = {"hip_motor": BODY.hip_gear, "outer_motor": BODY.ankle_gear, "inner_motor": BODY.ankle_gear}
ELECTRIC = (
    "resistance_change",
    "contact_drop_change",
    "torque_constant_change",
    "resistance_temperature",
    "torque_constant_temperature",
    "dead_time",
)
FRICTION = ("coulomb_friction", "viscous_friction")  # changes of the motor's own parameters
STEADY = ("stribeck", "direction_friction", "drag")
RIPPLE = "commutation_ripple"  # of the torque constant, in torque and back-EMF alike
PERIODIC = ("cogging", RIPPLE)
TURN = "once_per_turn"
# forms that each bench can have, by place; a reading of a turning shaft is a mean over its turns
TAKES: dict[str, dict[str, tuple[str, ...]]] = {
    "stall": {"hip_motor": ELECTRIC},
    "cantilever": {"hip_motor": ELECTRIC + FRICTION + STEADY},
    "motor-run": {"hip_motor": ELECTRIC + FRICTION + STEADY + PERIODIC, "hip_joint": (TURN,)},
    "pulley": {"hip_motor": ("torque_constant_change", *FRICTION)},
    "hip-spring": {"hip_joint": ("spring",)},
    "ankle-spring": {"inner_ankle": ("spring",), "inner_cable": ("cable_stiffening",)},
    "ankle-sine": {
        "inner_motor": ("torque_constant_change", *FRICTION, *STEADY, *PERIODIC, "spring"),
        "inner_ankle": (*FRICTION, *STEADY, TURN, "spring"),
        "inner_cable": ("cable_stiffening", "cable_backlash", "cable_slack", "cable_damping"),
    },
}


class BenchTerms:
    """The terms of a model as they act on a bench; none by default.

    parameters: of the experiment motor-bench as fitted there, at `gear`; its friction and inertia are then the motor's.
    """

    def __init__(
        self, chosen: Sequence[terms.Term] = (), parameters: Mapping[str, float] | None = None, gear: float = 14.0
    ) -> None:
        self.terms = list(chosen)
        self.parameters = dict(parameters or {})
        self.gear = gear
        self.rows = TermTorques(0.0, BODY.hip_gear, BODY.ankle_gear, BODY.friction_smoothing_rad_s)
        self.places: list[str] = []
        for term in self.terms:
            motors_own = term.at in GEARS and term.form.name in FRICTION
            if term.form.torque >= 0 and not motors_own:
                self.rows.add(term.form.torque, 0, 0, list(term.values.values()))
                self.places.append(term.at)

    def of_bench(self, bench: str) -> "BenchTerms":
        """Only the terms that this bench can have."""
        taken = [term for term in self.terms if term.form.name in TAKES.get(bench, {}).get(term.at, ())]
        return BenchTerms(taken, self.parameters, self.gear)

    def not_of_bench(self, bench: str) -> list[str]:
        """The terms that this bench does not have, as text: "spring at inner_ankle"."""
        held = self.of_bench(bench).terms
        return [f"{term.form.name} at {term.at}" for term in self.terms if term not in held]

    def unit(self, place: str, parameters: MotorParameters, name: str) -> MotorUnit:
        """A motor of these parameters with the ripples of its place; its K follows the rotor by `turn`."""
        made = MotorUnit(name, parameters)
        for term in self.terms:
            if term.at == place and term.form.name == RIPPLE:
                made.add_ripple(*term.values.values())
        return made

    def torque_Nm(self, place: str, angle_rad: float, rate_rad_s: float) -> float:
        """Torque of all terms at a place of the robot, at its joint; for a cable: on the joint, angle its stretch."""
        total = 0.0
        for number, at in enumerate(self.places):
            if at == place:
                total += self.rows.torque(number, angle_rad, rate_rad_s, GEARS.get(place, 1.0))
        return total

    def output_Nm(self, angle_rad: float, rate_rad_s: float, gear: float) -> float:
        """The hip motor's terms at the output of a bench's gearbox: torque there, of angle and rate there.

        A term with the period of a turn of the robot's joint has that of a turn of the bench's output.
        """
        if not self.places:
            return 0.0
        r = BODY.hip_gear / gear
        at_motor = self.torque_Nm("hip_motor", angle_rad / r, rate_rad_s / r) / r
        return at_motor + self.torque_Nm("hip_joint", angle_rad, rate_rad_s)

    def motor(self, place: str, parameters: MotorParameters) -> MotorParameters:
        """The motor with the electrical terms of its place, and with the friction of the model."""
        p = parameters
        if place == "hip_motor" and self.parameters:
            p = self._fitted(p)
        for term in self.terms:
            if term.at != place or term.form.name not in ELECTRIC + FRICTION:
                continue
            (value,) = term.values.values()
            r = GEARS[place] / p.gear
            changes = {
                "resistance_change": {"series_resistance_ohm": p.series_resistance_ohm + value},
                "contact_drop_change": {"contact_drop_V": p.contact_drop_V + value},
                "torque_constant_change": {"torque_constant_Nm_per_A": p.torque_constant_Nm_per_A * value},
                "resistance_temperature": {"resistance_per_K": p.resistance_per_K + value},
                "torque_constant_temperature": {"torque_constant_per_K": p.torque_constant_per_K + value},
                "dead_time": {"dead_time_fraction": p.dead_time_fraction + value},
                "coulomb_friction": {"constant_friction_Nm": p.constant_friction_Nm + value / r},
                "viscous_friction": {"viscous_friction_Nms": p.viscous_friction_Nms + value / r**2},
            }[term.form.name]
            if changes.get("series_resistance_ohm", 0.0) < 0.0:  # less than the leads have: the winding's is smaller
                changes = {"series_resistance_ohm": 0.0, "resistance_ohm": p.loop_resistance_ohm + value}
            p = dataclasses.replace(p, **changes)  # type: ignore[arg-type]
        return p

    def _fitted(self, p: MotorParameters) -> MotorParameters:
        """Friction and inertia as fitted at the bench's gearbox; a fit's small negative value counts as 0."""
        r, v = p.gear / self.gear, self.parameters
        changes = {
            "constant_friction_Nm": v.get("constant_friction_Nm", p.constant_friction_Nm / r) * r,
            "viscous_friction_Nms": v.get("viscous_friction_Nms", p.viscous_friction_Nms / r**2) * r * r,
        }
        changes = {name: max(0.0, value) for name, value in changes.items()}
        constant = v.get("torque_constant_Nm_per_A", 0.0)
        if constant > 0.0 and "load_friction_Nm_per_A" in v:
            changes["load_friction"] = max(0.0, v["load_friction_Nm_per_A"] / constant)
        if v.get("inertia_kg_m2", 0.0) > 0.0:
            changes["rotor_inertia_kg_m2"] = v["inertia_kg_m2"] / self.gear**2
        return dataclasses.replace(p, **changes)  # type: ignore[arg-type]


NOTHING = BenchTerms()
